//! Compound patterns: tuples, slices, structs.

use super::{Bindings, Subject, Truth};
use crate::language::evaluator::{Evaluated, Evaluator, TokenSpan, error};
use crate::language::place::Projection;
use crate::language::types::Type;
use crate::language::value::{Struct, Value};
use quote::ToTokens;
use std::rc::Rc;

impl Evaluator {
    pub(super) fn subject_part(
        &mut self,
        subject: &Subject,
        projection: Projection,
        at: TokenSpan,
    ) -> Evaluated<Subject> {
        Ok(match subject {
            Subject::Value(Value::Option(Some(value))) if projection == Projection::Some => {
                Subject::Value((**value).clone())
            }
            Subject::Value(value) => Subject::Value(self.value_part(value, projection, at)?),
            Subject::Place(place, by_reference) => {
                Subject::Place(self.project(place, projection, at)?, *by_reference)
            }
        })
    }

    /// Tuples and tuple structs.
    pub(super) fn match_parts(
        &mut self,
        patterns: &syn::punctuated::Punctuated<syn::Pat, syn::Token![,]>,
        at: TokenSpan,
        subject: Subject,
        bindings: &mut Bindings,
    ) -> Evaluated<Truth> {
        let length = match self.subject_value(&subject, at)? {
            Value::Tuple(parts) => parts.len(),
            Value::Struct(structure) => structure.fields.len(),
            other => {
                return Err(error(at, format!("this pattern does not match {}", other.description())).into());
            }
        };
        let rest = patterns.iter().position(|pattern| matches!(pattern, syn::Pat::Rest(_)));
        let count = patterns.len() - usize::from(rest.is_some());
        if count > length || rest.is_none() && count != length {
            return Err(
                error(at, format!("this pattern has {count} parts, but the value has {length}")).into()
            );
        }
        let mut truths = Vec::new();
        for (index, pattern) in patterns.iter().enumerate() {
            let index = match rest {
                Some(rest) if index == rest => continue,
                Some(rest) if index > rest => length - (patterns.len() - index),
                _ => index,
            };
            let part = self.subject_part(&subject, Projection::Field(index), at)?;
            truths.push(self.matches(pattern, part, bindings)?);
        }
        Ok(self.all_truths(truths))
    }

    pub(super) fn match_slice(
        &mut self,
        slice: &syn::PatSlice,
        subject: Subject,
        bindings: &mut Bindings,
    ) -> Evaluated<Truth> {
        let subject = match subject {
            Subject::Value(value @ Value::Opaque(_)) => {
                // `let [a, b] = CONSTANT;` determines the length.
                let ty = Type::Array(Rc::new(Type::Real), Some(slice.elems.len()));
                Subject::Value(self.coerce(value, &ty, slice)?)
            }
            subject => subject,
        };
        let length = match self.subject_value(&subject, slice)? {
            Value::Array(elements) => elements.len(),
            other => {
                return Err(
                    error(slice, format!("this pattern does not match {}", other.description())).into()
                );
            }
        };
        let rest = slice.elems.iter().position(is_rest);
        let count = slice.elems.len() - usize::from(rest.is_some());
        if count > length || rest.is_none() && count != length {
            return Ok(Truth::Known(false));
        }
        let mut truths = Vec::new();
        for (index, pattern) in slice.elems.iter().enumerate() {
            let part = match rest {
                Some(rest) if index == rest => {
                    if matches!(pattern, syn::Pat::Rest(_)) {
                        continue;
                    }
                    let end = length - (slice.elems.len() - 1 - index);
                    let part = self.subject_part(&subject, Projection::Slice(index, end), slice)?;
                    let syn::Pat::Ident(name) = pattern else { continue };
                    let plain = syn::Pat::Ident(syn::PatIdent { subpat: None, ..name.clone() });
                    truths.push(self.matches(&plain, part, bindings)?);
                    continue;
                }
                Some(rest) if index > rest => length - (slice.elems.len() - index),
                _ => index,
            };
            let part = self.subject_part(&subject, Projection::Index(part), slice)?;
            truths.push(self.matches(pattern, part, bindings)?);
        }
        Ok(self.all_truths(truths))
    }

    pub(super) fn match_struct(
        &mut self,
        pattern: &syn::PatStruct,
        subject: Subject,
        bindings: &mut Bindings,
    ) -> Evaluated<Truth> {
        let value = self.subject_value(&subject, pattern)?;
        let Value::Struct(structure) = &value else {
            return Err(error(pattern, format!("this pattern does not match {}", value.description())).into());
        };
        if !is_variant(structure, &pattern.path) {
            return Ok(Truth::Known(false));
        }
        let fields = &structure.definition.variants[structure.variant].fields;
        let mut truths = Vec::new();
        for field in &pattern.fields {
            let name = field.member.to_token_stream().to_string();
            let Some(index) = fields.iter().position(|(field, _)| *field == name) else {
                return Err(
                    error(field, format!("`{}` has no field `{name}`", structure.definition.name)).into()
                );
            };
            let part = self.subject_part(&subject, Projection::Field(index), pattern)?;
            truths.push(self.matches(&field.pat, part, bindings)?);
        }
        Ok(self.all_truths(truths))
    }
}

/// Whether a value of an enum is the variant of the path; true for structs.
fn is_variant(structure: &Struct, path: &syn::Path) -> bool {
    !structure.definition.is_enum
        || path
            .segments
            .last()
            .is_some_and(|last| last.ident == structure.definition.variants[structure.variant].name)
}

fn is_rest(pattern: &syn::Pat) -> bool {
    match pattern {
        syn::Pat::Rest(_) => true,
        syn::Pat::Ident(name) => {
            name.subpat.as_ref().is_some_and(|(_, inner)| matches!(**inner, syn::Pat::Rest(_)))
        }
        _ => false,
    }
}
