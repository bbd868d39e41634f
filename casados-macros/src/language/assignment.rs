//! Assignments: `=`, also to several places, and compound assignments.

use super::arithmetic::Operator;
use super::evaluator::{Evaluated, Evaluator, error};
use super::methods::Receiver;
use super::place::Place;
use super::types::Type;
use super::value::Value;
use quote::ToTokens;
use syn::Expr;

impl Evaluator {
    pub(super) fn assignment(&mut self, assign: &syn::ExprAssign) -> Evaluated {
        match &*assign.left {
            Expr::Infer(_) => {
                self.expression(&assign.right, &Type::Unknown)?;
            }
            Expr::Tuple(_) | Expr::Array(_) | Expr::Struct(_) | Expr::Call(_) => {
                let value = self.expression(&assign.right, &Type::Unknown)?;
                self.assign_pattern(&assign.left, value)?;
            }
            left => {
                let place = self.assignment_target(left);
                // The right side is executed first, and may change the place.
                let place = if is_side_effect_free(left) { place.ok() } else { Some(place?) };
                let expected = match &place {
                    Some(place) => {
                        let old = self.read(place, left)?;
                        self.type_of(&old)
                    }
                    None => Type::Unknown,
                };
                let value = self.expression(&assign.right, &expected)?;
                let value = self.coerce(value, &expected, &assign.right)?;
                let place = match place {
                    Some(place) if !is_side_effect_free(left) || is_side_effect_free(&assign.right) => place,
                    _ => self.assignment_target(left)?,
                };
                self.write(&place, value, assign)?;
            }
        }
        Ok(Value::unit())
    }

    /// The place on the left side of an assignment.
    fn assignment_target(&mut self, left: &Expr) -> Evaluated<Place> {
        match self.place(left, true)? {
            Receiver::Place(place) => Ok(place),
            Receiver::Value(_) => Err(error(left, "this cannot be assigned to").into()),
        }
    }

    /// Destructuring assignment.
    fn assign_pattern(&mut self, left: &Expr, value: Value) -> Evaluated<()> {
        self.deeper(left, |evaluator| evaluator.assign_pattern_nested(left, value))
    }

    fn assign_pattern_nested(&mut self, left: &Expr, value: Value) -> Evaluated<()> {
        let parts: Vec<&Expr> = match left {
            Expr::Infer(_) => return Ok(()),
            Expr::Paren(inner) => return self.assign_pattern(&inner.expr, value),
            Expr::Tuple(tuple) => tuple.elems.iter().collect(),
            Expr::Array(array) => array.elems.iter().collect(),
            Expr::Call(call) => call.args.iter().collect(),
            Expr::Struct(literal) => {
                let Value::Struct(structure) = &value else {
                    return Err(
                        error(left, format!("expected a struct, found {}", value.description())).into()
                    );
                };
                let names: Vec<String> = structure.definition.variants[structure.variant]
                    .fields
                    .iter()
                    .map(|f| f.0.clone())
                    .collect();
                for field in &literal.fields {
                    let member = field.member.to_token_stream().to_string();
                    match names.iter().position(|name| *name == member) {
                        Some(index) => self.assign_pattern(&field.expr, structure.fields[index].clone())?,
                        None => return Err(error(field, format!("there is no field `{member}`")).into()),
                    }
                }
                return Ok(());
            }
            left => {
                let Receiver::Place(place) = self.place(left, true)? else {
                    return Err(error(left, "this cannot be assigned to").into());
                };
                return Ok(self.write(&place, value, left)?);
            }
        };
        let value = self.follow_value(value, left)?;
        let values: Vec<Value> = match &value {
            Value::Tuple(values) | Value::Array(values) => values.to_vec(),
            Value::Struct(structure) => structure.fields.clone(),
            other => return Err(error(left, format!("{} has no such parts", other.description())).into()),
        };
        let is_rest =
            |part: &&Expr| matches!(part, Expr::Range(range) if range.start.is_none() && range.end.is_none());
        let rest = parts.iter().position(is_rest);
        let count = parts.len() - usize::from(rest.is_some());
        if count > values.len() || rest.is_none() && count != values.len() {
            let length = values.len();
            return Err(
                error(left, format!("there are {count} parts on the left, but {length} values")).into()
            );
        }
        for (index, part) in parts.iter().enumerate() {
            let position = match rest {
                Some(rest) if index == rest => continue,
                Some(rest) if index > rest => values.len() - (parts.len() - index),
                _ => index,
            };
            self.assign_pattern(part, values[position].clone())?;
        }
        Ok(())
    }

    pub(super) fn compound_assignment(&mut self, operator: Operator, binary: &syn::ExprBinary) -> Evaluated {
        let place = match self.place(&binary.left, true)? {
            Receiver::Place(place) => self.follow_place(place, binary)?,
            Receiver::Value(Value::Reference(place)) => place,
            Receiver::Value(_) => {
                return Err(error(&binary.left, "this cannot be assigned to").into());
            }
        };
        let before = self.read(&place, binary)?;
        let shift = matches!(operator, Operator::Shl | Operator::Shr);
        let hint = if shift { Type::Unknown } else { self.type_of(&before).scalar() };
        let right = self.expression(&binary.right, &hint)?;
        let (of, method) = operator.method();
        let name = format!("{method}_assign");
        if matches!(before, Value::Struct(_))
            && self
                .user_method(
                    &format!("{of}Assign"),
                    &name,
                    &Value::Reference(place.clone()),
                    vec![right.clone()],
                    binary,
                )?
                .is_some()
        {
            return Ok(Value::unit());
        }
        // For numbers the right side is executed first, and may change the place.
        let is_number = matches!(
            before,
            Value::Real(_) | Value::Integer(_) | Value::Bool(_) | Value::Condition(_) | Value::Opaque(_)
        );
        let place = if is_number && is_side_effect_free(&binary.left) && !is_side_effect_free(&binary.right) {
            let place = self.assignment_target(&binary.left)?;
            self.follow_place(place, binary)?
        } else {
            place
        };
        let before = self.read(&place, binary)?;
        let value = self.binary(operator, &before, &right, binary)?;
        self.write(&place, value, binary)?;
        Ok(Value::unit())
    }
}

/// Whether an expression has no side effects.
fn is_side_effect_free(expression: &Expr) -> bool {
    match expression {
        Expr::Path(_) | Expr::Lit(_) => true,
        Expr::Field(field) => is_side_effect_free(&field.base),
        Expr::Index(index) => is_side_effect_free(&index.expr) && is_side_effect_free(&index.index),
        Expr::Paren(inner) => is_side_effect_free(&inner.expr),
        Expr::Group(inner) => is_side_effect_free(&inner.expr),
        Expr::Cast(cast) => is_side_effect_free(&cast.expr),
        Expr::Unary(unary) => is_side_effect_free(&unary.expr),
        Expr::Binary(binary) => {
            super::operator::operator(&binary.op).is_some()
                && is_side_effect_free(&binary.left)
                && is_side_effect_free(&binary.right)
        }
        Expr::Tuple(tuple) => tuple.elems.iter().all(is_side_effect_free),
        Expr::Range(range) => {
            [&range.start, &range.end].into_iter().flatten().all(|end| is_side_effect_free(end))
        }
        _ => false,
    }
}
