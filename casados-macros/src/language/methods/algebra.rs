//! Algebra of small nalgebra matrices.
//!
//! Sums and products have nalgebra's order, so that results are bitwise equal: its `dot` is
//! unrolled for 2, 3 and 4 elements, and has eight accumulators for more than 7; products of
//! matrices sum over columns from the first to the last.

use super::Call;
use super::block::column;
use crate::graph::{Binary, Node, Unary};
use crate::language::arithmetic::Operator;
use crate::language::evaluator::{Evaluator, TokenSpan, error, unsupported};
use crate::language::value::{Matrix, Value};
use std::rc::Rc;
use syn::Result;

/// An operator with a matrix as one operand. `None` if there is no such operator.
pub fn operator(
    evaluator: &mut Evaluator,
    operator: Operator,
    a: &Value,
    b: &Value,
    at: TokenSpan,
) -> Result<Option<Value>> {
    match (operator, a, b) {
        (Operator::Add | Operator::Sub, Value::Matrix(x), Value::Matrix(y)) => {
            if (x.rows, x.columns) != (y.rows, y.columns) {
                return Err(error(at, shapes(operator.symbol(), x, y)));
            }
            let operation = if operator == Operator::Add { Binary::Add } else { Binary::Sub };
            zip(evaluator, x, y, operation, at).map(|m| Some(Value::Matrix(Rc::new(m))))
        }
        (Operator::Mul, Value::Matrix(x), Value::Matrix(y)) => {
            if x.columns != y.rows {
                return Err(error(at, shapes("*", x, y)));
            }
            product(evaluator, x, y, at).map(Some)
        }
        (Operator::Mul | Operator::Div, Value::Matrix(x), Value::Real(_) | Value::Opaque(_)) => {
            let factor = evaluator.real(b, at)?;
            let operation = if operator == Operator::Mul { Binary::Mul } else { Binary::Div };
            scale(evaluator, x, operation, factor, at).map(Some)
        }
        (Operator::Mul, Value::Real(_) | Value::Opaque(_), Value::Matrix(y)) => {
            let factor = evaluator.real(a, at)?;
            scale(evaluator, y, Binary::Mul, factor, at).map(Some)
        }
        _ => Ok(None),
    }
}

pub(super) fn shapes(symbol: &str, a: &Matrix, b: &Matrix) -> String {
    format!("there is no `{symbol}` of a {} x {} and a {} x {} matrix", a.rows, a.columns, b.rows, b.columns)
}

/// `Σₖ a_ik b_kj`, from the first `k` to the last.
pub(super) fn product(evaluator: &mut Evaluator, a: &Matrix, b: &Matrix, at: TokenSpan) -> Result<Value> {
    evaluator.count_steps(a.rows.saturating_mul(a.columns).saturating_mul(b.columns), at)?;
    let (x, y) = (nodes(evaluator, a, at)?, nodes(evaluator, b, at)?);
    let mut elements = Vec::with_capacity(a.rows * b.columns);
    for j in 0..b.columns {
        for i in 0..a.rows {
            let mut sum = None;
            for k in 0..a.columns {
                let term = evaluator.graph.binary(Binary::Mul, x[i + k * a.rows], y[k + j * b.rows]);
                sum = Some(match sum {
                    None => term,
                    Some(sum) => evaluator.graph.binary(Binary::Add, term, sum),
                });
            }
            let sum = sum.unwrap_or_else(|| evaluator.graph.constant(0.0));
            elements.push(Value::Real(sum));
        }
    }
    Ok(Value::matrix(a.rows, b.columns, elements))
}

/// `Σ aᵢⱼ bᵢⱼ` in the order of nalgebra's `dot`.
pub(super) fn dot(evaluator: &mut Evaluator, a: &Matrix, b: &Matrix, at: TokenSpan) -> Result<Node> {
    let terms = products(evaluator, a, b, at)?;
    let mut add = |a: Node, b: Node| evaluator.graph.binary(Binary::Add, a, b);
    if a.columns == 1 {
        match *terms.as_slice() {
            [a, b] => return Ok(add(a, b)),
            [a, b, c] => {
                let sum = add(a, b);
                return Ok(add(sum, c));
            }
            [a, b, c, d] => {
                let (even, odd) = (add(a, c), add(b, d));
                return Ok(add(even, odd));
            }
            _ => {}
        }
    }
    let mut sum: Option<Node> = None;
    for column in terms.chunks(a.rows.max(1)) {
        let mut plus = |sum: Option<Node>, term: Node| Some(sum.map_or(term, |sum| add(sum, term)));
        let (eights, rest) = column.split_at(column.len() - column.len() % 8);
        let mut lanes = [None; 8];
        for eight in eights.chunks_exact(8) {
            for (lane, term) in lanes.iter_mut().zip(eight) {
                *lane = plus(*lane, *term);
            }
        }
        for i in 0..4 {
            if let (Some(low), Some(high)) = (lanes[i], lanes[i + 4])
                && let Some(pair) = plus(Some(low), high)
            {
                sum = plus(sum, pair);
            }
        }
        for term in rest {
            sum = plus(sum, *term);
        }
    }
    Ok(sum.unwrap_or_else(|| evaluator.graph.constant(0.0)))
}

/// In column-major order, as nalgebra.
pub(super) fn norm_squared(evaluator: &mut Evaluator, matrix: &Matrix, at: TokenSpan) -> Result<Node> {
    let mut sum = evaluator.graph.constant(0.0);
    for c in 0..matrix.columns {
        let column = column(matrix, c);
        let term = dot(evaluator, &column, &column, at)?;
        sum = evaluator.graph.binary(Binary::Add, sum, term);
    }
    Ok(sum)
}

pub(super) fn determinant(evaluator: &mut Evaluator, matrix: &Matrix, at: TokenSpan) -> Result<Node> {
    if matrix.rows != matrix.columns {
        return Err(error(at, "`determinant` is of a square matrix"));
    }
    let m = nodes(evaluator, matrix, at)?;
    let n = matrix.rows;
    if n > 3 {
        return Err(unsupported(at, "`determinant` of more than three rows, which pivots on values,"));
    }
    let entry = |row: usize, column: usize| m[row + column * n];
    // `a d - b c`
    let mut minor = |a: Node, d: Node, b: Node, c: Node| {
        let (ad, bc) = (evaluator.graph.binary(Binary::Mul, a, d), evaluator.graph.binary(Binary::Mul, b, c));
        evaluator.graph.binary(Binary::Sub, ad, bc)
    };
    match n {
        0 => Ok(evaluator.graph.constant(1.0)),
        1 => Ok(entry(0, 0)),
        2 => Ok(minor(entry(0, 0), entry(1, 1), entry(1, 0), entry(0, 1))),
        _ => {
            let minors = [
                minor(entry(1, 1), entry(2, 2), entry(2, 1), entry(1, 2)),
                minor(entry(1, 0), entry(2, 2), entry(2, 0), entry(1, 2)),
                minor(entry(1, 0), entry(2, 1), entry(2, 0), entry(1, 1)),
            ];
            let [a, b, c] = [0, 1, 2].map(|j| evaluator.graph.binary(Binary::Mul, entry(0, j), minors[j]));
            let difference = evaluator.graph.binary(Binary::Sub, a, b);
            Ok(evaluator.graph.binary(Binary::Add, difference, c))
        }
    }
}

pub(super) fn same_shape(a: &Matrix, b: &Matrix, call: &Call) -> Result<()> {
    if (a.rows, a.columns) == (b.rows, b.columns) {
        return Ok(());
    }
    Err(error(call.at, shapes(call.name, a, b)))
}

/// The elements as numbers.
pub fn nodes(evaluator: &mut Evaluator, matrix: &Matrix, at: TokenSpan) -> Result<Vec<Node>> {
    matrix.elements.iter().map(|element| evaluator.real(element, at)).collect()
}

pub(super) fn products(
    evaluator: &mut Evaluator,
    a: &Matrix,
    b: &Matrix,
    at: TokenSpan,
) -> Result<Vec<Node>> {
    let (a, b) = (nodes(evaluator, a, at)?, nodes(evaluator, b, at)?);
    Ok(a.into_iter().zip(b).map(|(a, b)| evaluator.graph.binary(Binary::Mul, a, b)).collect())
}

pub(super) fn zip(
    evaluator: &mut Evaluator,
    a: &Matrix,
    b: &Matrix,
    operation: Binary,
    at: TokenSpan,
) -> Result<Matrix> {
    let (x, y) = (nodes(evaluator, a, at)?, nodes(evaluator, b, at)?);
    let elements = x.into_iter().zip(y).map(|(x, y)| Value::Real(evaluator.graph.binary(operation, x, y)));
    Ok(Matrix { rows: a.rows, columns: a.columns, elements: elements.collect() })
}

pub(super) fn scale(
    evaluator: &mut Evaluator,
    a: &Matrix,
    operation: Binary,
    factor: Node,
    at: TokenSpan,
) -> Result<Value> {
    let x = nodes(evaluator, a, at)?;
    let elements = x.into_iter().map(|x| Value::Real(evaluator.graph.binary(operation, x, factor))).collect();
    Ok(Value::matrix(a.rows, a.columns, elements))
}

pub(super) fn elementwise(
    evaluator: &mut Evaluator,
    a: &Matrix,
    function: Unary,
    at: TokenSpan,
) -> Result<Value> {
    let x = nodes(evaluator, a, at)?;
    let elements = x.into_iter().map(|x| Value::Real(evaluator.graph.unary(function, x))).collect();
    Ok(Value::matrix(a.rows, a.columns, elements))
}
