//! Coercion of values to a type: integers get their width, constants from outside are split.

use super::evaluator::{Evaluator, TokenSpan, error};
use super::types::Type;
use super::value::{Struct, Value};
use quote::quote;
use std::rc::Rc;
use syn::Result;

impl Evaluator {
    /// Coerces the value to the type: opaque constants are split, integers get their type, `&mut`
    /// is unchanged. An error if the shapes differ.
    pub fn coerce(&mut self, value: Value, ty: &Type, at: TokenSpan) -> Result<Value> {
        Ok(match (ty, &value) {
            (Type::Unknown, _) | (_, Value::Reference(_)) => value,
            (Type::Real, Value::Opaque(_)) => Value::Real(self.real(&value, at)?),
            (Type::Integer(ty), Value::Integer(integer)) if integer.ty.is_none() => {
                match super::arithmetic::checked_integer(Some(integer.value), Some(*ty)) {
                    Some(integer) => Value::Integer(integer),
                    None => {
                        let message = format!("{} is out of the range of `{}`", integer.value, ty.name());
                        return Err(error(at, message));
                    }
                }
            }
            (Type::Integer(_), Value::Opaque(_)) => {
                return Err(super::evaluator::opaque_value_error(at, "an integer"));
            }
            (Type::Bool, Value::Opaque(_)) => {
                return Err(super::evaluator::opaque_value_error(at, "a `bool`"));
            }
            (Type::Array(_, Some(length)), Value::Array(elements)) if *length != elements.len() => {
                let found = elements.len();
                return Err(error(
                    at,
                    format!("expected an array of {length} elements, found one of {found}"),
                ));
            }
            (Type::Array(element, _), Value::Array(elements)) => {
                if elements.iter().all(|element| matches!(element, Value::Real(_))) {
                    return Ok(value);
                }
                let mut result = Vec::with_capacity(elements.len());
                for value in elements.iter() {
                    result.push(self.coerce(value.clone(), element, at)?);
                }
                Value::array(result)
            }
            (Type::Tuple(types), Value::Tuple(parts)) if types.len() == parts.len() => {
                let mut result = Vec::with_capacity(parts.len());
                for (ty, value) in types.iter().zip(parts.iter()) {
                    result.push(self.coerce(value.clone(), ty, at)?);
                }
                Value::tuple(result)
            }
            (Type::Matrix(rows, columns), Value::Matrix(matrix)) => {
                if rows.is_some_and(|rows| rows != matrix.rows)
                    || columns.is_some_and(|columns| columns != matrix.columns)
                {
                    let (r, c) = (matrix.rows, matrix.columns);
                    return Err(error(
                        at,
                        format!("this matrix is {r}x{c}, which is not the expected shape"),
                    ));
                }
                value
            }
            (Type::Option(inner), Value::Option(Some(content))) => {
                let content = (**content).clone();
                Value::some(self.coerce(content, inner, at)?)
            }
            (
                Type::Array(_, Some(_)) | Type::Tuple(_) | Type::Matrix(Some(_), Some(_)) | Type::Struct(..),
                Value::Opaque(tokens),
            ) => self.split_opaque(tokens, ty, at)?,
            _ => value,
        })
    }

    /// Splits an opaque constant of a known shape into opaque parts.
    fn split_opaque(&mut self, tokens: &proc_macro2::TokenStream, ty: &Type, at: TokenSpan) -> Result<Value> {
        match ty {
            Type::Real => self.real(&Value::Opaque(Rc::new(tokens.clone())), at).map(Value::Real),
            Type::Array(element, Some(length)) => {
                self.count_steps(*length, at)?;
                let part = |index: usize| {
                    let index = proc_macro2::Literal::usize_unsuffixed(index);
                    quote!(#tokens[#index])
                };
                (0..*length)
                    .map(|index| self.split_opaque(&part(index), element, at))
                    .collect::<Result<_>>()
                    .map(Value::array)
            }
            Type::Tuple(parts) => {
                let part = |index: usize| {
                    let index = proc_macro2::Literal::usize_unsuffixed(index);
                    quote!(#tokens.#index)
                };
                let parts = parts.iter().enumerate();
                parts
                    .map(|(index, ty)| self.split_opaque(&part(index), ty, at))
                    .collect::<Result<_>>()
                    .map(Value::tuple)
            }
            Type::Matrix(Some(rows), Some(columns)) => {
                self.count_steps(rows.saturating_mul(*columns), at)?;
                let part = |index: usize| {
                    let index = proc_macro2::Literal::usize_unsuffixed(index);
                    quote!(#tokens[#index])
                };
                let elements: Result<_> = (0..rows * columns)
                    .map(|index| self.split_opaque(&part(index), &Type::Real, at))
                    .collect();
                Ok(Value::matrix(*rows, *columns, elements?))
            }
            Type::Struct(definition, arguments) if !definition.is_enum => {
                let types = self.field_types(definition, 0, arguments)?;
                let mut fields = Vec::new();
                for ((name, _), ty) in definition.variants[0].fields.iter().zip(&types) {
                    let part = match name.parse::<usize>() {
                        Ok(index) => {
                            let index = proc_macro2::Literal::usize_unsuffixed(index);
                            quote!(#tokens.#index)
                        }
                        Err(_) => {
                            let name = quote::format_ident!("{name}");
                            quote!(#tokens.#name)
                        }
                    };
                    fields.push(self.split_opaque(&part, ty, at)?);
                }
                Ok(Value::Struct(Rc::new(Struct { definition: definition.clone(), variant: 0, fields })))
            }
            _ => Err(super::evaluator::opaque_value_error(at, "a value of this type")),
        }
    }
}
