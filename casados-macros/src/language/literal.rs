//! Literals: numbers, arrays, structs.

use super::evaluator::{Evaluated, Evaluator, TokenSpan, error, unsupported};
use super::path::PathMeaning;
use super::types::Type;
use super::value::{Integer, IntegerType, Struct, Value};
use quote::ToTokens;
use std::rc::Rc;
use syn::Expr;

impl Evaluator {
    /// A literal.
    pub(super) fn literal(&mut self, literal: &syn::ExprLit, expected: &Type) -> Evaluated {
        match &literal.lit {
            syn::Lit::Float(float) => self.float_literal(float.base10_digits(), float.suffix(), literal),
            syn::Lit::Int(int) if int.suffix().starts_with('f') => {
                self.float_literal(int.base10_digits(), int.suffix(), literal)
            }
            syn::Lit::Int(int) if int.suffix() == "u128" => Err(error(
                literal,
                "a model has no `u128`, whose values exceed `i128`: write `f64` or `i128`",
            )
            .into()),
            syn::Lit::Int(int) => {
                let value = int
                    .base10_parse::<i128>()
                    .map_err(|_| error(literal, "this integer does not fit into an `i128`"))?;
                let ty = match (int.suffix(), expected) {
                    ("", Type::Integer(ty)) => Some(*ty),
                    ("", _) => None,
                    (suffix, _) => IntegerType::by_name(suffix),
                };
                Ok(Value::Integer(Integer { value, ty }))
            }
            syn::Lit::Bool(value) => Ok(Value::Bool(value.value)),
            syn::Lit::Byte(byte) => {
                let value = i128::from(byte.value());
                Ok(Value::Integer(Integer { value, ty: Some(IntegerType::U8) }))
            }
            _ => Err(unsupported(literal, "text").into()),
        }
    }

    fn float_literal(&mut self, digits: &str, suffix: &str, at: TokenSpan) -> Evaluated {
        if !suffix.is_empty() && suffix != "f64" {
            return Err(error(at, format!("models are computed in `f64`, not in `{suffix}`")).into());
        }
        match digits.parse::<f64>() {
            Ok(value) => Ok(Value::Real(self.graph.constant(value))),
            Err(_) => Err(error(at, "this is no number").into()),
        }
    }

    pub(super) fn array_expression(&mut self, array: &syn::ExprArray, expected: &Type) -> Evaluated {
        let hint = expected.element();
        let mut elements = Vec::with_capacity(array.elems.len());
        for element in &array.elems {
            elements.push(self.expression(element, &hint)?);
        }
        Ok(Value::array(elements))
    }

    pub(super) fn repeat_expression(&mut self, repeat: &syn::ExprRepeat, expected: &Type) -> Evaluated {
        let value = self.expression(&repeat.expr, &expected.element())?;
        let length = match (&*repeat.len, expected) {
            (Expr::Infer(_), Type::Array(_, Some(length))) => *length,
            (Expr::Infer(_), _) => {
                return Err(error(&repeat.len, "the length cannot be inferred: write it").into());
            }
            (length, _) => {
                let value = self.expression(length, &Type::Integer(IntegerType::Usize))?;
                self.usize(&value, length)?
            }
        };
        self.count_steps(length, repeat)?;
        Ok(Value::array(vec![value; length]))
    }

    pub(super) fn struct_expression(&mut self, literal: &syn::ExprStruct, expected: &Type) -> Evaluated {
        let scope = self.scope.clone();
        let name = literal.path.to_token_stream().to_string();
        let mut variant = 0;
        let mut ty = self.resolve_path(&literal.path, &scope, 0)?;
        if !matches!(ty, Type::Struct(..)) && literal.path.segments.len() > 1 {
            let mut prefix = literal.path.clone();
            let last = prefix.segments.pop();
            ty = self.resolve_path(&prefix, &scope, 0)?;
            if let (Type::Struct(definition, _), Some(last)) = (&ty, last) {
                match super::path::variant_index(definition, &last.ident.to_string()) {
                    Some(index) => variant = index,
                    None => return Err(error(&literal.path, format!("`{name}` is no variant")).into()),
                }
            }
        }
        if !matches!(ty, Type::Struct(..)) {
            // A variant imported by a `use`.
            let path = syn::ExprPath { attrs: Vec::new(), qself: None, path: literal.path.clone() };
            if let PathMeaning::Value(Value::Constructor(owner, index)) = self.path_meaning(&path)? {
                (ty, variant) = (owner, index);
            }
        }
        let Type::Struct(definition, mut arguments) = ty else {
            return Err(error(
                &literal.path,
                format!(
                    "the macro does not see the definition of `{name}`: define it in the body, or put it beside \
                     the model in a `#[dae] mod`"
                ),
            )
            .into());
        };
        if let Type::Struct(same, known) = expected
            && Rc::ptr_eq(same, &definition)
            && arguments.is_empty()
        {
            arguments = known.clone();
        }
        let types = self.field_types(&definition, variant, &arguments)?;
        let declared = &definition.variants[variant].fields;
        let mut fields = vec![Value::Uninitialised; declared.len()];
        for field in &literal.fields {
            let member = field.member.to_token_stream().to_string();
            let Some(index) = declared.iter().position(|(name, _)| *name == member) else {
                return Err(error(field, format!("`{}` has no field `{member}`", definition.name)).into());
            };
            let value = self.expression(&field.expr, &types[index])?;
            fields[index] = self.coerce(value, &types[index], &field.expr)?;
        }
        // `..rest` is evaluated after the fields.
        if let Some(rest) = &literal.rest {
            let own = Type::Struct(definition.clone(), arguments.clone());
            let value = self.expression(rest, &own)?;
            match self.follow_value(value, rest)? {
                Value::Struct(structure) if Rc::ptr_eq(&structure.definition, &definition) => {
                    for (field, value) in fields.iter_mut().zip(&structure.fields) {
                        if matches!(field, Value::Uninitialised) {
                            *field = value.clone();
                        }
                    }
                }
                other => {
                    let message = format!("expected a `{}`, found {}", definition.name, other.description());
                    return Err(error(rest, message).into());
                }
            }
        }
        if fields.iter().any(|field| matches!(field, Value::Uninitialised)) {
            return Err(error(literal, format!("fields of `{}` are missing", definition.name)).into());
        }
        Ok(Value::Struct(Rc::new(Struct { definition, variant, fields })))
    }
}
