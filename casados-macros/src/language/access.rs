//! Fields, elements and slices: expressions that denote a place.

use super::evaluator::{Evaluated, Evaluator, TokenSpan, error, opaque_value_error};
use super::methods::{self, Receiver};
use super::path::PathMeaning;
use super::place::{Place, Projection};
use super::types::Type;
use super::value::{Integer, IntegerType, Range, Value};
use quote::{ToTokens, quote};
use std::rc::Rc;
use syn::{Expr, Result};

impl Evaluator {
    /// The place that an expression denotes, otherwise its value.
    pub(super) fn place(&mut self, expression: &Expr, mutable: bool) -> Evaluated<Receiver> {
        self.place_of_type(expression, mutable, &Type::Unknown)
    }

    pub(super) fn place_of_type(
        &mut self,
        expression: &Expr,
        mutable: bool,
        expected: &Type,
    ) -> Evaluated<Receiver> {
        match expression {
            Expr::Path(path) => Ok(match self.path_meaning(path)? {
                PathMeaning::Variable(cell) => Receiver::Place(Place { cell, path: Vec::new() }),
                PathMeaning::Value(value) => Receiver::Value(value),
                PathMeaning::Builtin(builtin) => Receiver::Value(self.builtin_value(builtin, path)),
            }),
            Expr::Paren(inner) => {
                self.deeper(expression, |e| e.place_of_type(&inner.expr, mutable, expected))
            }
            Expr::Group(inner) => {
                self.deeper(expression, |e| e.place_of_type(&inner.expr, mutable, expected))
            }
            Expr::Field(field) => self.deeper(expression, |e| e.field_place(field, mutable)),
            Expr::Index(index) => self.deeper(expression, |e| e.index_place(index, mutable)),
            Expr::Unary(unary) if matches!(unary.op, syn::UnOp::Deref(_)) => {
                let inner = self.deeper(expression, |e| e.place_of_type(&unary.expr, mutable, expected))?;
                Ok(match inner {
                    Receiver::Place(place) => match self.read(&place, expression)? {
                        Value::Reference(target) => Receiver::Place(target),
                        _ => Receiver::Place(place),
                    },
                    Receiver::Value(Value::Reference(place)) => Receiver::Place(place),
                    value => value,
                })
            }
            other => Ok(Receiver::Value(self.expression(other, expected)?)),
        }
    }

    fn field_place(&mut self, field: &syn::ExprField, mutable: bool) -> Evaluated<Receiver> {
        let base = self.place(&field.base, mutable)?;
        let base = self.dereferenced(base, field)?;
        let value = base.value(self, field)?;
        match (field_projection(&value, &field.member), base) {
            (Ok(projection), Receiver::Place(place)) => {
                Ok(Receiver::Place(self.project(&place, projection, field)?))
            }
            (Ok(projection), Receiver::Value(value)) => {
                Ok(Receiver::Value(self.value_part(&value, projection, field)?))
            }
            (Err(_), _) => match (&value, &field.member) {
                (Value::Opaque(tokens), member) => {
                    Ok(Receiver::Value(Value::Opaque(Rc::new(quote!(#tokens.#member)))))
                }
                (Value::Range(range), syn::Member::Named(name)) => {
                    let part = if name == "start" { &range.start } else { &range.end };
                    match part {
                        Some(value) => Ok(Receiver::Value(value.clone())),
                        None => Err(error(field, "this range has no such end").into()),
                    }
                }
                (value, member) => {
                    let name = member.to_token_stream();
                    Err(error(field, format!("{} has no field `{name}`", value.description())).into())
                }
            },
        }
    }

    /// Follows mutable references.
    pub(super) fn dereferenced(&mut self, receiver: Receiver, at: TokenSpan) -> Result<Receiver> {
        Ok(match receiver {
            Receiver::Place(place) => Receiver::Place(self.follow_place(place, at)?),
            Receiver::Value(Value::Reference(place)) => Receiver::Place(self.follow_place(place, at)?),
            value => value,
        })
    }

    fn index_place(&mut self, index: &syn::ExprIndex, mutable: bool) -> Evaluated<Receiver> {
        let base = self.place(&index.expr, mutable)?;
        let base = self.dereferenced(base, index)?;
        let value = base.value(self, index)?;
        let hint = match &value {
            Value::Struct(_) => Type::Unknown,
            _ => Type::Integer(IntegerType::Usize),
        };
        let position = match &*index.index {
            // Literals in a range or tuple get a type as well, which has no effect.
            Expr::Range(_) | Expr::Tuple(_) => self.expression(&index.index, &Type::Unknown)?,
            expression => self.expression(expression, &hint)?,
        };
        let position = self.follow_value(position, &index.index)?;
        if matches!(hint, Type::Integer(_)) {
            self.infer_usize_index(&index.index);
        }
        let projection = match (&value, &position) {
            (Value::Struct(_), _) => {
                let name = if mutable { "index_mut" } else { "index" };
                let receiver = match (&base, mutable) {
                    (Receiver::Place(place), true) => Value::Reference(place.clone()),
                    _ => value.clone(),
                };
                let result = self.user_method("Index", name, &receiver, vec![position.clone()], index)?;
                return match result {
                    Some(Value::Reference(place)) => Ok(Receiver::Place(place)),
                    Some(value) => Ok(Receiver::Value(value)),
                    None => Err(error(index, "this struct cannot be indexed").into()),
                };
            }
            (Value::Opaque(tokens), Value::Integer(integer)) => {
                let position = proc_macro2::Literal::i128_unsuffixed(integer.value);
                return Ok(Receiver::Value(Value::Opaque(Rc::new(quote!(#tokens[#position])))));
            }
            (Value::Opaque(_), _) => return Err(opaque_value_error(&index.expr, "an array").into()),
            (_, Value::Real(_) | Value::Condition(_)) => {
                return Err(error(
                    &index.index,
                    "the index depends on model variables: a graph model needs indices known at compile time",
                )
                .into());
            }
            (Value::Array(elements), Value::Range(range)) => {
                let (start, end) = self.range_bounds(range, elements.len(), &index.index)?;
                Projection::Slice(start, end)
            }
            (Value::Array(_), position) => Projection::Index(self.usize(position, &index.index)?),
            (Value::Matrix(_), Value::Tuple(parts)) if parts.len() == 2 => {
                let row = self.usize(&parts[0], &index.index)?;
                Projection::Element(row, self.usize(&parts[1], &index.index)?)
            }
            (Value::Matrix(matrix), position) => {
                let position = self.usize(position, &index.index)?;
                let rows = matrix.rows.max(1);
                if position >= matrix.elements.len() {
                    let length = matrix.elements.len();
                    return Err(error(
                        index,
                        format!("index out of range: the length is {length} but the index is {position}"),
                    )
                    .into());
                }
                Projection::Element(position % rows, position / rows)
            }
            (value, _) => {
                return Err(error(index, format!("{} cannot be indexed", value.description())).into());
            }
        };
        match base {
            Receiver::Place(place) => Ok(Receiver::Place(self.project(&place, projection, index)?)),
            Receiver::Value(value) => Ok(Receiver::Value(self.value_part(&value, projection, index)?)),
        }
    }

    /// Sets the type of an integer variable used as an index to `usize`, unless it is known.
    fn infer_usize_index(&mut self, index: &Expr) {
        let Expr::Path(path) = index else { return };
        let Some(name) = path.path.get_ident() else { return };
        let symbol = self.symbol(name);
        if let Some(cell) = self.scope.variable(symbol)
            && let Value::Integer(Integer { ty: ty @ None, .. }) = &mut *cell.borrow_mut()
        {
            *ty = Some(IntegerType::Usize);
        }
    }

    /// The start and end of a range of indices.
    pub fn range_bounds(&mut self, range: &Range, length: usize, at: TokenSpan) -> Result<(usize, usize)> {
        let start = match &range.start {
            Some(start) => self.usize(start, at)?,
            None => 0,
        };
        let end = match &range.end {
            Some(end) => self.usize(end, at)?.saturating_add(usize::from(range.inclusive)),
            None => length,
        };
        Ok((start, end))
    }
}

/// The projection from a value to its field.
fn field_projection(value: &Value, member: &syn::Member) -> std::result::Result<Projection, ()> {
    match (value, member) {
        (Value::Tuple(_), syn::Member::Unnamed(index)) => Ok(Projection::Field(index.index as usize)),
        (Value::Struct(structure), member) => {
            let name = member.to_token_stream().to_string();
            let fields = &structure.definition.variants[structure.variant].fields;
            fields.iter().position(|(field, _)| *field == name).map(Projection::Field).ok_or(())
        }
        (Value::Matrix(matrix), syn::Member::Named(name)) => {
            let element = methods::matrix_field(&name.to_string(), matrix.rows, matrix.columns);
            element.map(|(row, column)| Projection::Element(row, column)).ok_or(())
        }
        _ => Err(()),
    }
}
