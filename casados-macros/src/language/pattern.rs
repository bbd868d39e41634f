//! Patterns: matching, and the declared variables.

mod compound_patterns;

use super::arithmetic::Comparison;
use super::environment::{Names, Scope};
use super::evaluator::{Evaluated, Evaluator, TokenSpan, error, unsupported};
use super::items::Symbol;
use super::methods;
use super::path::PathMeaning;
use super::place::{Place, Projection};
use super::types::Type;
use super::value::Value;
use crate::graph::Node;
use std::cell::RefCell;
use std::rc::Rc;
use syn::ext::IdentExt;

/// A truth value: known, or a run-time condition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Truth {
    /// Known at compile time.
    Known(bool),
    /// A run-time condition.
    When(Node),
}

/// The subject of a pattern.
#[derive(Clone, Debug)]
pub enum Subject {
    /// A value.
    Value(Value),
    /// A place, and whether plain names become references to its parts.
    Place(Place, bool),
}

/// The variables declared by a pattern, with their values.
pub type Bindings = Vec<(Symbol, Value)>;

impl Evaluator {
    /// Declares variables in a new scope.
    pub(super) fn declare(&mut self, bindings: Bindings) {
        if bindings.is_empty() {
            return;
        }
        let variables =
            bindings.into_iter().map(|(name, value)| (name, Rc::new(RefCell::new(value)))).collect();
        self.scope = Scope::child_scope(&self.scope, Names::Variables(variables));
    }

    /// Matches an irrefutable pattern.
    pub(super) fn bind(&mut self, pattern: &syn::Pat, subject: Subject) -> Evaluated<Bindings> {
        let mut bindings = Vec::new();
        let saved = std::mem::replace(&mut self.irrefutable, true);
        let truth = self.matches(pattern, subject, &mut bindings);
        self.irrefutable = saved;
        match truth? {
            Truth::Known(true) => Ok(bindings),
            Truth::Known(false) => Err(error(pattern, "this pattern does not match the value").into()),
            Truth::When(_) => {
                Err(unsupported(pattern, "a pattern that matches or not depending on model variables").into())
            }
        }
    }

    /// The value of a subject.
    pub(super) fn subject_value(&mut self, subject: &Subject, at: TokenSpan) -> Evaluated {
        match subject {
            Subject::Value(value) => Ok(value.clone()),
            Subject::Place(place, _) => Ok(self.read(place, at)?),
        }
    }

    /// Whether a pattern matches, and its variables.
    pub(super) fn matches(
        &mut self,
        pattern: &syn::Pat,
        subject: Subject,
        bindings: &mut Bindings,
    ) -> Evaluated<Truth> {
        self.deeper(pattern, |evaluator| evaluator.match_nested(pattern, subject, bindings))
    }

    fn match_nested(
        &mut self,
        pattern: &syn::Pat,
        subject: Subject,
        bindings: &mut Bindings,
    ) -> Evaluated<Truth> {
        // Patterns other than names look through references.
        let subject = match (pattern, subject) {
            (
                syn::Pat::Ident(_) | syn::Pat::Wild(_) | syn::Pat::Reference(_) | syn::Pat::Type(_),
                subject,
            ) => subject,
            (_, Subject::Value(Value::Reference(place))) => {
                Subject::Place(self.follow_place(place, pattern)?, true)
            }
            (_, Subject::Place(place, by_reference)) => {
                let target = self.follow_place(place.clone(), pattern)?;
                let by_reference = by_reference || !target.is_same_memory(&place);
                Subject::Place(target, by_reference)
            }
            (_, subject) => subject,
        };
        match pattern {
            syn::Pat::Wild(_) | syn::Pat::Rest(_) => Ok(Truth::Known(true)),
            syn::Pat::Paren(inner) => self.matches(&inner.pat, subject, bindings),
            syn::Pat::Ident(inner) => self.match_name(inner, subject, bindings),
            syn::Pat::Type(inner) => {
                let scope = self.scope.clone();
                let ty = self.resolve(&inner.ty, &scope)?;
                let subject = match subject {
                    Subject::Value(value) => Subject::Value(self.coerce(value, &ty, pattern)?),
                    place => place,
                };
                self.matches(&inner.pat, subject, bindings)
            }
            syn::Pat::Reference(inner) => {
                let subject = match subject {
                    Subject::Value(Value::Reference(place)) => Subject::Value(self.read(&place, pattern)?),
                    Subject::Place(place, _) => {
                        let value = self.read(&place, pattern)?;
                        Subject::Value(self.follow_value(value, pattern)?)
                    }
                    subject => subject,
                };
                self.matches(&inner.pat, subject, bindings)
            }
            syn::Pat::Tuple(tuple) => self.match_parts(&tuple.elems, pattern, subject, bindings),
            syn::Pat::Slice(slice) => self.match_slice(slice, subject, bindings),
            syn::Pat::Struct(inner) => self.match_struct(inner, subject, bindings),
            syn::Pat::TupleStruct(inner) => self.match_tuple_struct(inner, subject, bindings),
            syn::Pat::Path(path) => {
                let value = self.subject_value(&subject, pattern)?;
                let constant = self.path_value(path)?;
                self.match_constant(&value, &constant, pattern)
            }
            syn::Pat::Lit(literal) => {
                let value = self.subject_value(&subject, pattern)?;
                let constant = self.literal(literal, &Type::Unknown)?;
                self.match_constant(&value, &constant, pattern)
            }
            syn::Pat::Const(block) => {
                let value = self.subject_value(&subject, pattern)?;
                let constant = self.block(&block.block, &Type::Unknown)?;
                self.match_constant(&value, &constant, pattern)
            }
            syn::Pat::Range(range) => self.match_range(range, subject),
            syn::Pat::Or(or) => self.match_any(or, subject, bindings),
            syn::Pat::Guard(guard) => {
                let truth = self.matches(&guard.pat, subject, bindings)?;
                if truth == Truth::Known(false) {
                    return Ok(truth);
                }
                let saved = self.scope.clone();
                self.declare(bindings.clone());
                let value = self.expression(&guard.guard, &Type::Bool);
                self.scope = saved;
                let value = self.follow_value(value?, pattern)?;
                self.both(truth, &value, pattern)
            }
            _ => Err(unsupported(pattern, "this pattern").into()),
        }
    }

    fn match_tuple_struct(
        &mut self,
        pattern: &syn::PatTupleStruct,
        subject: Subject,
        bindings: &mut Bindings,
    ) -> Evaluated<Truth> {
        let path =
            syn::ExprPath { attrs: Vec::new(), qself: pattern.qself.clone(), path: pattern.path.clone() };
        let value = self.subject_value(&subject, pattern)?;
        if let Value::Option(content) = &value {
            let name = path.path.segments.last().map(|name| name.ident.to_string()).unwrap_or_default();
            return match (name.as_str(), content) {
                ("Some" | "Ok", Some(_)) => {
                    let inside = self.subject_part(&subject, Projection::Some, pattern)?;
                    match pattern.elems.first() {
                        Some(content) => self.matches(content, inside, bindings),
                        None => Ok(Truth::Known(true)),
                    }
                }
                ("Some" | "Ok", None) | ("Err", Some(_)) => Ok(Truth::Known(false)),
                ("Err", None) => match pattern.elems.first() {
                    None | Some(syn::Pat::Wild(_) | syn::Pat::Rest(_)) => Ok(Truth::Known(true)),
                    Some(error_value) => Err(error(
                        error_value,
                        "of a `Result` the macro knows the value only, not the error: write `Err(_)`",
                    )
                    .into()),
                },
                _ => Err(unsupported(pattern, format!("this pattern on {}", value.description())).into()),
            };
        }
        match (self.path_meaning(&path)?, &value) {
            (PathMeaning::Value(Value::Constructor(_, variant)), Value::Struct(structure)) => {
                if structure.variant != variant {
                    return Ok(Truth::Known(false));
                }
                self.match_parts(&pattern.elems, pattern, subject, bindings)
            }
            _ => Err(unsupported(pattern, format!("this pattern on {}", value.description())).into()),
        }
    }

    fn match_range(&mut self, range: &syn::PatRange, subject: Subject) -> Evaluated<Truth> {
        let value = self.subject_value(&subject, range)?;
        let mut truth = Truth::Known(true);
        if let Some(start) = &range.start {
            let start = self.expression(start, &Type::Unknown)?;
            let above = self.compare(Comparison::Le, &start, &value, range)?;
            truth = self.both(truth, &above, range)?;
        }
        if let Some(end) = &range.end {
            let end = self.expression(end, &Type::Unknown)?;
            let comparison = match range.limits {
                syn::RangeLimits::HalfOpen(_) => Comparison::Lt,
                syn::RangeLimits::Closed(_) => Comparison::Le,
            };
            let below = self.compare(comparison, &value, &end, range)?;
            truth = self.both(truth, &below, range)?;
        }
        Ok(truth)
    }

    /// The first matching one of several patterns.
    fn match_any(&mut self, or: &syn::PatOr, subject: Subject, bindings: &mut Bindings) -> Evaluated<Truth> {
        let mut some: Option<Node> = None;
        for case in &or.cases {
            let mut inner = Vec::new();
            match self.matches(case, subject.clone(), &mut inner)? {
                Truth::Known(false) => {}
                Truth::Known(true) if some.is_none() => {
                    bindings.extend(inner);
                    return Ok(Truth::Known(true));
                }
                _ if !inner.is_empty() => {
                    return Err(unsupported(
                        case,
                        "a variable in one of several patterns that depend on model variables",
                    )
                    .into());
                }
                Truth::Known(true) => return Ok(Truth::Known(true)),
                Truth::When(condition) => {
                    some = Some(match some {
                        Some(before) => self.graph.or(before, condition),
                        None => condition,
                    });
                }
            }
        }
        Ok(some.map_or(Truth::Known(false), Truth::When))
    }

    fn match_constant(&mut self, value: &Value, constant: &Value, at: TokenSpan) -> Evaluated<Truth> {
        let equal = self.compare(Comparison::Eq, value, constant, at)?;
        self.truth(&equal, at)
    }

    /// The truth value of a `bool`.
    pub(super) fn truth(&mut self, value: &Value, at: TokenSpan) -> Evaluated<Truth> {
        match self.follow_value(value.clone(), at)? {
            Value::Bool(value) => Ok(Truth::Known(value)),
            Value::Condition(node) => Ok(Truth::When(node)),
            Value::Opaque(_) => Err(super::evaluator::opaque_value_error(at, "a `bool`").into()),
            other => Err(error(at, format!("expected a `bool`, found {}", other.description())).into()),
        }
    }

    fn both(&mut self, truth: Truth, value: &Value, at: TokenSpan) -> Evaluated<Truth> {
        Ok(match (truth, self.truth(value, at)?) {
            (Truth::Known(false), _) | (_, Truth::Known(false)) => Truth::Known(false),
            (Truth::Known(true), other) | (other, Truth::Known(true)) => other,
            (Truth::When(a), Truth::When(b)) => Truth::When(self.graph.and(a, b)),
        })
    }

    pub(super) fn all_truths(&mut self, truths: Vec<Truth>) -> Truth {
        let mut result = Truth::Known(true);
        for truth in truths {
            result = match (result, truth) {
                (Truth::Known(false), _) | (_, Truth::Known(false)) => return Truth::Known(false),
                (Truth::Known(true), other) | (other, Truth::Known(true)) => other,
                (Truth::When(a), Truth::When(b)) => Truth::When(self.graph.and(a, b)),
            };
        }
        result
    }

    fn match_name(
        &mut self,
        pattern: &syn::PatIdent,
        subject: Subject,
        bindings: &mut Bindings,
    ) -> Evaluated<Truth> {
        let name = self.symbol(&pattern.ident);
        if pattern.by_ref.is_none() && pattern.mutability.is_none() && pattern.subpat.is_none() {
            // If a constant or unit struct has this name, the pattern is a comparison.
            let constant = self.pattern_constant(&pattern.ident)?;
            if let Some(constant) = constant {
                let value = self.subject_value(&subject, pattern)?;
                return self.match_constant(&value, &constant, pattern);
            }
        }
        let truth = match &pattern.subpat {
            Some((_, inner)) => self.matches(inner, subject.clone(), bindings)?,
            None => Truth::Known(true),
        };
        let by_ref_mut = pattern.by_ref.is_some() && pattern.mutability.is_some();
        let value = match subject {
            Subject::Value(value) if by_ref_mut => Value::Reference(Place::new(value)),
            Subject::Value(value) => value,
            Subject::Place(place, by_reference) => {
                if by_ref_mut || by_reference && pattern.by_ref.is_none() {
                    Value::Reference(place)
                } else {
                    self.read(&place, pattern)?
                }
            }
        };
        bindings.push((name, value));
        Ok(truth)
    }

    /// The constant, unit struct or variant denoted by a plain name in a pattern.
    fn pattern_constant(&mut self, ident: &syn::Ident) -> Evaluated<Option<Value>> {
        if ident == "None" {
            return Ok(Some(Value::Option(None)));
        }
        let name = self.symbol(ident);
        if self.scope.variable(name).is_some() {
            return Ok(None);
        }
        let path = syn::ExprPath { attrs: Vec::new(), qself: None, path: ident.clone().into() };
        Ok(match self.path_meaning(&path)? {
            PathMeaning::Value(Value::Function(_) | Value::Constructor(..)) => None,
            PathMeaning::Value(value) => Some(value),
            // By convention constants and variants start with a capital, variables do not. In
            // irrefutable patterns the compiler would reject them.
            PathMeaning::Builtin(builtin)
                if !self.irrefutable && ident.unraw().to_string().starts_with(char::is_uppercase) =>
            {
                let known = methods::constant(self, &builtin);
                Some(known.unwrap_or_else(|| Value::Opaque(Rc::new(self.emitted_path(&builtin, &path)))))
            }
            _ => None,
        })
    }
}
