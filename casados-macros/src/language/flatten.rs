//! Values as flat lists of numbers, in the order of declaration: arrays by index, structs by field,
//! matrices in column-major order.

use super::evaluator::{Evaluator, TokenSpan, error};
use super::value::Value;
use crate::graph::Node;
use proc_macro2::Span;
use syn::spanned::Spanned;
use syn::{Block, Expr, Result, Stmt};

impl Evaluator {
    /// The numbers of a value, in order.
    pub fn flatten(&mut self, value: &Value, at: TokenSpan) -> Result<Vec<Node>> {
        let mut numbers = Vec::new();
        self.flatten_into(value, &mut numbers, at)?;
        Ok(numbers)
    }

    fn flatten_into(&mut self, value: &Value, numbers: &mut Vec<Node>, at: TokenSpan) -> Result<()> {
        match value {
            Value::Array(elements) | Value::Tuple(elements) => {
                elements.iter().try_for_each(|element| self.flatten_into(element, numbers, at))
            }
            Value::Struct(structure) => {
                structure.fields.iter().try_for_each(|field| self.flatten_into(field, numbers, at))
            }
            Value::Matrix(matrix) => {
                matrix.elements.iter().try_for_each(|element| self.flatten_into(element, numbers, at))
            }
            Value::Reference(place) => {
                let value = self.read(place, at)?;
                self.flatten_into(&value, numbers, at)
            }
            Value::Real(_) | Value::Opaque(_) => {
                numbers.push(self.real(value, at)?);
                Ok(())
            }
            other => Err(error(
                at,
                format!(
                    "a model returns numbers (`f64`, arrays, tuples, structs and nalgebra vectors of them), not {}",
                    other.description()
                ),
            )),
        }
    }
}

/// The source position of each returned number of a block: its own tokens, if the last expression
/// is a literal of the value's shape.
pub fn spans(block: &Block, value: &Value) -> Vec<Span> {
    let mut spans = Vec::new();
    match block.stmts.last() {
        Some(Stmt::Expr(expression, _)) => collect_spans(expression, value, &mut spans),
        other => spans.resize(count(value), other.map_or_else(|| block.span(), Spanned::span)),
    }
    spans
}

fn collect_spans(expression: &Expr, value: &Value, spans: &mut Vec<Span>) {
    match (expression, value) {
        (Expr::Paren(inner), _) => collect_spans(&inner.expr, value, spans),
        (Expr::Group(inner), _) => collect_spans(&inner.expr, value, spans),
        (Expr::Return(inner), _) if inner.expr.is_some() => {
            if let Some(inner) = &inner.expr {
                collect_spans(inner, value, spans);
            }
        }
        (Expr::Array(array), Value::Array(values)) if array.elems.len() == values.len() => {
            array
                .elems
                .iter()
                .zip(values.iter())
                .for_each(|(element, value)| collect_spans(element, value, spans));
        }
        (Expr::Tuple(tuple), Value::Tuple(values)) if tuple.elems.len() == values.len() => {
            tuple
                .elems
                .iter()
                .zip(values.iter())
                .for_each(|(element, value)| collect_spans(element, value, spans));
        }
        (Expr::Struct(literal), Value::Struct(structure)) => {
            let declared = structure.definition.variants.get(structure.variant);
            for (i, value) in structure.fields.iter().enumerate() {
                let field = declared.and_then(|variant| variant.fields.get(i)).and_then(|(name, _)| {
                    literal.fields.iter().find(|field| match &field.member {
                        syn::Member::Named(member) => member == name,
                        syn::Member::Unnamed(member) => member.index.to_string() == *name,
                    })
                });
                match field {
                    Some(field) => collect_spans(&field.expr, value, spans),
                    None => repeat_span(literal.path.span(), value, spans),
                }
            }
        }
        (Expr::Call(call), Value::Matrix(matrix))
            if call.args.len() == matrix.elements.len() && matrix.columns == 1 =>
        {
            spans.extend(call.args.iter().map(Spanned::span));
        }
        _ => repeat_span(expression.span(), value, spans),
    }
}

fn repeat_span(span: Span, value: &Value, spans: &mut Vec<Span>) {
    spans.resize(spans.len() + count(value), span);
}

/// The number of numbers in a value.
fn count(value: &Value) -> usize {
    match value {
        Value::Array(elements) | Value::Tuple(elements) => elements.iter().map(count).sum(),
        Value::Struct(structure) => structure.fields.iter().map(count).sum(),
        Value::Matrix(matrix) => matrix.elements.len(),
        _ => 1,
    }
}
