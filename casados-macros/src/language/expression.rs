//! Expressions.

use super::arithmetic::wrapped_integer;
use super::evaluator::{Evaluated, Evaluator, Flow, error, opaque_value_error, unsupported};
use super::methods::Receiver;
use super::path::PathMeaning;
use super::pattern::Truth;
use super::place::Place;
use super::types::Type;
use super::value::{Integer, Range, Value};
use quote::quote;
use std::rc::Rc;
use syn::Expr;

impl Evaluator {
    /// The value of an expression with the expected type of the context.
    pub(super) fn expression(&mut self, expression: &Expr, expected: &Type) -> Evaluated {
        self.deeper(expression, |evaluator| evaluator.expression_within(expression, expected))
    }

    fn expression_within(&mut self, expression: &Expr, expected: &Type) -> Evaluated {
        match expression {
            Expr::Lit(literal) => self.literal(literal, expected),
            Expr::Path(path) => self.path_value(path),
            Expr::Paren(inner) => self.expression(&inner.expr, expected),
            Expr::Group(inner) => self.expression(&inner.expr, expected),
            Expr::Binary(binary) => self.binary_expression(binary, expected),
            Expr::Unary(unary) => self.unary_expression(unary, expected),
            Expr::Field(_) | Expr::Index(_) => {
                let place = self.place(expression, false)?;
                Ok(place.value(self, expression)?)
            }
            Expr::Call(call) => self.call_expression(call, expected),
            Expr::MethodCall(call) => self.method_call(call, expected),
            Expr::Array(array) => self.array_expression(array, expected),
            Expr::Repeat(repeat) => self.repeat_expression(repeat, expected),
            Expr::Tuple(tuple) => {
                let mut parts = Vec::with_capacity(tuple.elems.len());
                for (index, part) in tuple.elems.iter().enumerate() {
                    parts.push(self.expression(part, &expected.tuple_element(index))?);
                }
                Ok(Value::tuple(parts))
            }
            Expr::Struct(literal) => self.struct_expression(literal, expected),
            Expr::Block(block) => self.labelled_block(block, expected),
            Expr::Const(block) => self.block(&block.block, expected),
            Expr::If(branch) => self.if_expression(branch, expected),
            Expr::Match(choice) => self.match_expression(choice, expected),
            Expr::ForLoop(inner) => self.for_loop(inner),
            Expr::While(inner) => self.while_loop(inner),
            Expr::Loop(inner) => self.endless_loop(inner, expected),
            Expr::Assign(assign) => self.assignment(assign),
            Expr::Reference(reference) => self.reference_expression(reference, expected),
            Expr::Cast(cast) => self.cast_expression(cast),
            Expr::Range(range) => self.range_expression(range),
            Expr::Closure(closure) => self.closure_expression(closure),
            Expr::Return(inner) => self.return_expression(inner),
            Expr::Break(inner) => self.break_expression(inner),
            Expr::Continue(inner) => {
                let label = inner.label.as_ref().map(|label| label.ident.to_string());
                self.check_target(label, inner)?;
                Err(Flow::Continue(inner.label.clone()))
            }
            Expr::Macro(call) => self.macro_call(&call.mac, expected),
            Expr::Let(_) => match self.condition(expression)? {
                Truth::Known(value) => Ok(Value::Bool(value)),
                Truth::When(node) => Ok(Value::Condition(node)),
            },
            Expr::Try(inner) => {
                let value = self.expression(&inner.expr, &Type::Option(Rc::new(expected.clone())))?;
                match self.follow_value(value, expression)? {
                    Value::Option(Some(value)) => Ok(*value),
                    Value::Option(None) => {
                        self.check_return(expression)?;
                        Err(Flow::Return(Value::Option(None)))
                    }
                    other => {
                        Err(error(expression, format!("there is no `?` of {}", other.description())).into())
                    }
                }
            }
            Expr::Infer(_) => Err(error(expression, "`_` is no value").into()),
            Expr::Unsafe(_) => Err(unsupported(expression, "unsafe code").into()),
            _ => Err(unsupported(expression, "this kind of expression").into()),
        }
    }

    /// The value of a path.
    pub(super) fn path_value(&mut self, path: &syn::ExprPath) -> Evaluated {
        match self.path_meaning(path)? {
            PathMeaning::Variable(cell) => Ok(cell.borrow().clone()),
            PathMeaning::Value(value) => Ok(value),
            PathMeaning::Builtin(builtin) => Ok(self.builtin_value(builtin, path)),
        }
    }

    fn reference_expression(&mut self, reference: &syn::ExprReference, expected: &Type) -> Evaluated {
        if reference.mutability.is_none() {
            let value = self.expression(&reference.expr, expected)?;
            return Ok(self.follow_value(value, reference)?);
        }
        match self.place_of_type(&reference.expr, true, expected)? {
            Receiver::Place(place) => Ok(Value::Reference(self.follow_place(place, reference)?)),
            Receiver::Value(value @ Value::Reference(_)) => Ok(value),
            Receiver::Value(value) => Ok(Value::Reference(Place::new(value))),
        }
    }

    fn cast_expression(&mut self, cast: &syn::ExprCast) -> Evaluated {
        let scope = self.scope.clone();
        let ty = self.resolve(&cast.ty, &scope)?;
        let hint = if matches!(ty, Type::Real) { Type::Unknown } else { ty.scalar() };
        let hint = if matches!(&*cast.expr, Expr::Lit(_)) { hint } else { Type::Unknown };
        let value = self.expression(&cast.expr, &hint)?;
        let value = self.follow_value(value, cast)?;
        Ok(match (ty, value) {
            (Type::Real, Value::Integer(integer)) => Value::Real(self.graph.constant(integer.value as f64)),
            (Type::Real, value @ Value::Real(_)) => value,
            (Type::Real, Value::Opaque(tokens)) => Value::Opaque(Rc::new(quote!((#tokens as f64)))),
            (Type::Integer(ty), Value::Integer(integer)) => {
                Value::Integer(wrapped_integer(integer.value, ty))
            }
            (Type::Integer(ty), Value::Bool(value)) => {
                Value::Integer(Integer { value: i128::from(value), ty: Some(ty) })
            }
            (Type::Integer(ty), Value::Real(node)) => match self.graph.value(node) {
                Some(value) => {
                    // As `as`: towards zero, saturating, NaN is 0.
                    let value = (value as i128).clamp(ty.min(), ty.max());
                    Value::Integer(Integer { value, ty: Some(ty) })
                }
                None => {
                    return Err(unsupported(
                        cast,
                        "an integer that is computed from model variables, which has no derivative,",
                    )
                    .into());
                }
            },
            (Type::Integer(ty), Value::Struct(structure)) if structure.definition.is_enum => {
                let mut value = 0;
                for (index, variant) in structure.definition.variants.iter().enumerate() {
                    if let Some(discriminant) = &variant.discriminant {
                        let scope = structure.definition.scope();
                        let saved = std::mem::replace(&mut self.scope, scope);
                        let discriminant = self.expression(discriminant, &Type::Unknown);
                        self.scope = saved;
                        let discriminant = discriminant?;
                        value = self.integer(&discriminant, cast)?.value;
                    }
                    if index == structure.variant {
                        break;
                    }
                    value += 1;
                }
                Value::Integer(wrapped_integer(value, ty))
            }
            (Type::Integer(_), Value::Opaque(_)) => return Err(opaque_value_error(cast, "an integer").into()),
            (Type::Bool, value @ (Value::Bool(_) | Value::Condition(_))) => value,
            (Type::Unknown, value) => value,
            (_, value) => {
                return Err(
                    error(cast, format!("{} cannot be cast to this type", value.description())).into()
                );
            }
        })
    }

    fn range_expression(&mut self, range: &syn::ExprRange) -> Evaluated {
        let mut start = match &range.start {
            Some(start) => {
                let value = self.expression(start, &Type::Unknown)?;
                Some(self.follow_value(value, start)?)
            }
            None => None,
        };
        let mut end = match &range.end {
            Some(end) => {
                let value = self.expression(end, &Type::Unknown)?;
                Some(self.follow_value(value, end)?)
            }
            None => None,
        };
        // The range `0..n` has the type of `n`.
        if let (Some(Value::Integer(a)), Some(Value::Integer(b))) = (&mut start, &mut end) {
            let ty = a.ty.or(b.ty);
            (a.ty, b.ty) = (ty, ty);
        }
        let inclusive = matches!(range.limits, syn::RangeLimits::Closed(_));
        Ok(Value::Range(Rc::new(Range { start, end, inclusive })))
    }
}
