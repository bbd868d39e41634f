//! Tables of `casados::tables`: constructors and methods.

use super::Call;
use crate::graph::{self, Binary, Node, Unary};
use crate::language::Table;
use crate::language::evaluator::{Evaluator, TokenSpan, error};
use crate::language::value::{Interpolation, Value};
use proc_macro2::TokenStream;
use quote::{format_ident, quote};
use std::rc::Rc;
use syn::Result;

/// The degree of cubic splines, and of tables that may be one.
const CUBIC_DEGREE: u8 = 3;

/// A table by its type and constructor: the numbers of variables and of the constructor's
/// arguments, and the degree.
fn form(ty: &str, function: &str) -> Option<(&'static str, usize, usize, u8)> {
    Some(match (ty, function) {
        ("Linear", "new") => ("Linear", 1, 2, 1),
        ("Linear2", "new") => ("Linear2", 2, 3, 1),
        ("Spline", "natural" | "not_a_knot") => ("Spline", 1, 2, CUBIC_DEGREE),
        ("Spline", "clamped") => ("Spline", 1, 3, CUBIC_DEGREE),
        ("Spline2", "natural" | "not_a_knot") => ("Spline2", 2, 3, CUBIC_DEGREE),
        _ => return None,
    })
}

/// `Spline::natural(points, values)` and the other constructors. `None` for other functions.
pub fn construct(evaluator: &mut Evaluator, ty: &str, call: &Call) -> Result<Option<Value>> {
    let Some((name, variables, arguments, degree)) = form(ty, call.name) else { return Ok(None) };
    call.expect_argument_count(arguments)?;
    let mut arguments = Vec::new();
    for argument in &call.arguments {
        arguments.push(numeric_tokens(evaluator, argument, call.at)?);
    }
    for points in &call.arguments[..variables] {
        increasing(evaluator, points, call.at)?;
    }
    let (ident, function) = (format_ident!("{name}"), format_ident!("{}", call.name));
    let expression = quote!(casados_tables::#ident::#function(#(#arguments),*));
    Ok(Some(Value::Table(Rc::new(Interpolation { name, variables, degree, expression }))))
}

/// Numbers and nested arrays as tokens.
fn numeric_tokens(evaluator: &mut Evaluator, value: &Value, at: TokenSpan) -> Result<TokenStream> {
    Ok(match evaluator.follow_value(value.clone(), at)? {
        Value::Opaque(tokens) => (*tokens).clone(),
        Value::Array(elements) => {
            evaluator.count_steps(elements.len(), at)?;
            let elements = elements
                .iter()
                .map(|value| numeric_tokens(evaluator, value, at))
                .collect::<Result<Vec<_>>>()?;
            quote!([#(#elements),*])
        }
        Value::Real(node) => match (evaluator.graph.value(node), evaluator.graph.op(node)) {
            (Some(number), _) if number.is_finite() => quote!(#number),
            (Some(_), _) => return Err(error(at, "the numbers of a table have to be finite")),
            (None, graph::Op::Opaque(index)) => evaluator.opaque[index as usize].clone(),
            _ => {
                return Err(error(
                    at,
                    "the numbers of a table have to be known when the program is compiled: make it of literals and \
                     constants, and multiply its value by what depends on model variables",
                ));
            }
        },
        other => {
            return Err(error(
                at,
                format!("a table is made of arrays of `f64`, but {} is among them", other.description()),
            ));
        }
    })
}

/// Checks that known points increase; the compiler checks the others.
fn increasing(evaluator: &mut Evaluator, points: &Value, at: TokenSpan) -> Result<()> {
    let Value::Array(points) = evaluator.follow_value(points.clone(), at)? else { return Ok(()) };
    let known = |value: &Value| match value {
        Value::Real(node) => evaluator.graph.value(*node),
        _ => None,
    };
    for pair in points.windows(2) {
        if let (Some(a), Some(b)) = (known(&pair[0]), known(&pair[1]))
            && a >= b
        {
            return Err(error(
                at,
                format!("the points of a table have to increase, but {a} is followed by {b}"),
            ));
        }
    }
    Ok(())
}

/// Whether tables have a method of this name.
pub fn is_method(name: &str) -> bool {
    matches!(name, "value" | "derivative" | "gradient")
}

/// A method of a table. `None` if there is no such method.
pub fn method(evaluator: &mut Evaluator, of: &Interpolation, call: &Call) -> Result<Option<Value>> {
    if !is_method(call.name) {
        return Ok(None);
    }
    let (given, name) = (call.arguments.len(), call.name);
    if given != of.variables {
        let takes = if of.variables == 1 { "1 argument" } else { "2 arguments" };
        let are = if given == 1 { "is" } else { "are" };
        return Err(error(
            call.at,
            format!("`{name}` of a `{}` takes {takes}, but {given} {are} given", of.name),
        ));
    }
    evaluate_table(evaluator, &of.expression, of.degree, call)
}

/// A method of a constant defined outside of the macro's input.
pub fn opaque_table_method(evaluator: &mut Evaluator, of: &TokenStream, call: &Call) -> Result<Value> {
    let value = evaluate_table(evaluator, of, CUBIC_DEGREE, call)?;
    value.ok_or_else(|| error(call.at, "a table has one or two variables"))
}

fn evaluate_table(
    evaluator: &mut Evaluator,
    expression: &TokenStream,
    degree: u8,
    call: &Call,
) -> Result<Option<Value>> {
    let mut at = Vec::new();
    for argument in &call.arguments {
        at.push(evaluator.real(argument, call.at)?);
    }
    let index = evaluator.table(expression, at.len());
    Ok(match (call.name, at.as_slice()) {
        ("value", &[a]) => Some(univariate_value(evaluator, graph::Table { index, orders: [0], degree }, a)),
        ("derivative", &[a]) => {
            Some(univariate_value(evaluator, graph::Table { index, orders: [1], degree }, a))
        }
        ("value", &[a, b]) => {
            Some(bivariate_value(evaluator, graph::Table { index, orders: [0, 0], degree }, [a, b]))
        }
        ("gradient", &[a, b]) => {
            let partials = [[1, 0], [0, 1]];
            Some(Value::array(
                partials
                    .map(|orders| bivariate_value(evaluator, graph::Table { index, orders, degree }, [a, b]))
                    .to_vec(),
            ))
        }
        _ => None,
    })
}

fn univariate_value(evaluator: &mut Evaluator, table: graph::Table<1>, a: Node) -> Value {
    Value::Real(evaluator.graph.unary(Unary::Table(table), a))
}

fn bivariate_value(evaluator: &mut Evaluator, table: graph::Table<2>, [a, b]: [Node; 2]) -> Value {
    Value::Real(evaluator.graph.binary(Binary::Table(table), a, b))
}

impl Evaluator {
    /// The index of a table; equal expressions share it.
    fn table(&mut self, expression: &TokenStream, variables: usize) -> u32 {
        let text = expression.to_string();
        let same = |table: &Table| table.variables == variables && table.expression.to_string() == text;
        let index = self.tables.iter().position(same).unwrap_or_else(|| {
            self.tables.push(Table { expression: expression.clone(), variables });
            self.tables.len() - 1
        });
        index as u32
    }
}
