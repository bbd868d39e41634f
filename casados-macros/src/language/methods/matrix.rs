//! Methods of small nalgebra matrices.

use super::algebra::{determinant, dot, elementwise, nodes, norm_squared, products, same_shape, scale, zip};
use super::block::{blocks, column, mutating_method, pairs, row};
use super::iterator::Iter;
use super::{Call, Receiver, construction};
use crate::graph::{Binary, Node, Unary};
use crate::language::arithmetic::Operator;
use crate::language::evaluator::{Evaluator, TokenSpan, error, unsupported};
use crate::language::types::Type;
use crate::language::value::{Matrix, Value};
use std::rc::Rc;
use syn::Result;

pub use construction::{from_arrays, function};

/// Row and column of a named element: `x`, `y`, `z`, `w`, `a`, `b`; `m23`.
pub fn field(name: &str, rows: usize, columns: usize) -> Option<(usize, usize)> {
    let (row, column) = match name.as_bytes() {
        [letter] if rows == 1 || columns == 1 => {
            let index = b"xyzwab".iter().position(|l| l == letter)?;
            if columns == 1 { (index, 0) } else { (0, index) }
        }
        [b'm', row @ b'1'..=b'6', column @ b'1'..=b'6'] => {
            (usize::from(row - b'1'), usize::from(column - b'1'))
        }
        _ => return None,
    };
    (row < rows && column < columns).then_some((row, column))
}

/// The norm of a difference: squares are summed in order, unlike in `dot`.
fn distance(evaluator: &mut Evaluator, a: &Matrix, b: &Matrix, at: TokenSpan) -> Result<Node> {
    let mut squared = evaluator.graph.constant(0.0);
    for element in &zip(evaluator, a, b, Binary::Sub, at)?.elements {
        let element = evaluator.real(element, at)?;
        let square = evaluator.graph.binary(Binary::Mul, element, element);
        squared = evaluator.graph.binary(Binary::Add, squared, square);
    }
    Ok(evaluator.graph.unary(Unary::Sqrt, squared))
}

/// Whether nalgebra has a method of this name; all take `&self`.
#[rustfmt::skip]
pub fn is_inherent(name: &str) -> bool {
    const NAMES: &[&str] = &[
        "abs", "add_scalar", "column", "component_div", "component_mul", "cross", "cross_matrix", "determinant",
        "diagonal", "dot", "iter", "len", "magnitude", "magnitude_squared", "map", "max", "mean",
        "metric_distance", "min", "norm", "norm_squared", "normalize", "product", "row", "scale", "sum",
        "tr_dot", "trace", "transpose", "unscale", "zip_map",
    ];
    NAMES.contains(&name)
}

/// A method of a matrix. `None` if there is no such method.
pub fn method(
    evaluator: &mut Evaluator,
    receiver: &Receiver,
    value: &Value,
    call: &Call,
) -> Result<Option<Value>> {
    let Value::Matrix(matrix) = value else { return Ok(None) };
    if let Some(value) = blocks(evaluator, receiver, matrix, call)? {
        return Ok(Some(value));
    }
    if let Some(value) = mutating_method(evaluator, receiver, matrix, call)? {
        return Ok(Some(value));
    }
    if let Some(value) = algebra(evaluator, matrix, call)? {
        return Ok(Some(value));
    }
    shape(evaluator, matrix, call)
}

/// Methods that compute.
fn algebra(evaluator: &mut Evaluator, matrix: &Rc<Matrix>, call: &Call) -> Result<Option<Value>> {
    let at = call.at;
    let real = |node: Node| Ok(Some(Value::Real(node)));
    if matches!(
        call.name,
        "row_sum"
            | "column_sum"
            | "row_mean"
            | "column_mean"
            | "lu"
            | "qr"
            | "cholesky"
            | "svd"
            | "try_inverse"
            | "symmetric_eigen"
            | "exp"
            | "pinv"
            | "solve_lower_triangular"
            | "solve_upper_triangular"
            | "simd_max"
            | "imax"
            | "imin"
            | "amax"
            | "amin"
            | "camax"
    ) {
        return Err(unsupported(at, format!("`{}` of a matrix", call.name)));
    }
    match call.name {
        "dot" | "dotc" => {
            let other = argument(evaluator, call, 0)?;
            same_shape(matrix, &other, call)?;
            real(dot(evaluator, matrix, &other, at)?)
        }
        "tr_dot" => {
            let other = argument(evaluator, call, 0)?;
            let transposed = transpose(matrix);
            same_shape(&transposed, &other, call)?;
            let mut terms = products(evaluator, &transposed, &other, at)?.into_iter();
            let first = terms.next().unwrap_or_else(|| evaluator.graph.constant(0.0));
            real(terms.fold(first, |sum, term| evaluator.graph.binary(Binary::Add, sum, term)))
        }
        "norm" | "magnitude" => {
            let squared = norm_squared(evaluator, matrix, at)?;
            real(evaluator.graph.unary(Unary::Sqrt, squared))
        }
        "norm_squared" | "magnitude_squared" => real(norm_squared(evaluator, matrix, at)?),
        "normalize" => {
            let squared = norm_squared(evaluator, matrix, at)?;
            let norm = evaluator.graph.unary(Unary::Sqrt, squared);
            scale(evaluator, matrix, Binary::Div, norm, at).map(Some)
        }
        "metric_distance" => {
            let other = argument(evaluator, call, 0)?;
            same_shape(matrix, &other, call)?;
            real(distance(evaluator, matrix, &other, at)?)
        }
        "scale" | "unscale" => {
            let factor = evaluator.real(call.only()?, at)?;
            let operation = if call.name == "scale" { Binary::Mul } else { Binary::Div };
            scale(evaluator, matrix, operation, factor, at).map(Some)
        }
        "add_scalar" => {
            let term = evaluator.real(call.only()?, at)?;
            scale(evaluator, matrix, Binary::Add, term, at).map(Some)
        }
        "component_mul" | "component_div" => {
            let other = argument(evaluator, call, 0)?;
            same_shape(matrix, &other, call)?;
            let operation = if call.name == "component_mul" { Binary::Mul } else { Binary::Div };
            zip(evaluator, matrix, &other, operation, at).map(|m| Some(Value::Matrix(Rc::new(m))))
        }
        "cross" => cross(evaluator, matrix, call),
        "cross_matrix" => cross_matrix(evaluator, matrix, call),
        "sum" | "trace" | "product" | "mean" => reduction_method(evaluator, matrix, call),
        "determinant" => determinant(evaluator, matrix, at).map(|node| Some(Value::Real(node))),
        "tr_mul" | "ad_mul" => transposed_product(evaluator, matrix, call),
        "kronecker" => kronecker(evaluator, matrix, call),
        "lerp" => lerp(evaluator, matrix, call),
        "neg" => evaluator.negate(&Value::Matrix(matrix.clone()), at).map(Some),
        "add" | "sub" | "mul" | "div" => {
            let Some((Some(operator), _)) = super::float::operator_by_name(call.name) else {
                return Ok(None);
            };
            evaluator.binary(operator, &Value::Matrix(matrix.clone()), call.only()?, at).map(Some)
        }
        "abs" => elementwise(evaluator, matrix, Unary::Abs, at).map(Some),
        "max" | "min" => Err(unsupported(at, format!("`{}` of a matrix", call.name))),
        _ => Ok(None),
    }
}

/// `a × b`
fn cross(evaluator: &mut Evaluator, matrix: &Rc<Matrix>, call: &Call) -> Result<Option<Value>> {
    let at = call.at;
    let other = argument(evaluator, call, 0)?;
    same_shape(matrix, &other, call)?;
    let (a, b) = (nodes(evaluator, matrix, at)?, nodes(evaluator, &other, at)?);
    let (&[ax, ay, az], &[bx, by, bz]) = (a.as_slice(), b.as_slice()) else {
        return Err(error(at, "`cross` is of vectors of three elements"));
    };
    let mut minor = |a, b, c, d| {
        let (ab, cd) = (evaluator.graph.binary(Binary::Mul, a, b), evaluator.graph.binary(Binary::Mul, c, d));
        Value::Real(evaluator.graph.binary(Binary::Sub, ab, cd))
    };
    let elements = vec![minor(ay, bz, az, by), minor(az, bx, ax, bz), minor(ax, by, ay, bx)];
    Ok(Some(Value::matrix(matrix.rows, matrix.columns, elements)))
}

/// The matrix that multiplies by a vector product.
fn cross_matrix(evaluator: &mut Evaluator, matrix: &Rc<Matrix>, call: &Call) -> Result<Option<Value>> {
    let at = call.at;
    let &[x, y, z] = nodes(evaluator, matrix, at)?.as_slice() else {
        return Err(error(at, "`cross_matrix` is of a vector of three elements"));
    };
    let zero = evaluator.graph.constant(0.0);
    let minus = [x, y, z].map(|a| evaluator.graph.unary(Unary::Neg, a));
    let columns = [zero, z, minus[1], minus[2], zero, x, y, minus[0], zero];
    Ok(Some(Value::matrix(3, 3, columns.into_iter().map(Value::Real).collect())))
}

/// Sums and products of elements.
fn reduction_method(evaluator: &mut Evaluator, matrix: &Rc<Matrix>, call: &Call) -> Result<Option<Value>> {
    let at = call.at;
    let real = |node: Node| Ok(Some(Value::Real(node)));
    let all = nodes(evaluator, matrix, at)?;
    let terms = if call.name == "trace" {
        if matrix.rows != matrix.columns {
            return Err(error(at, "`trace` is of a square matrix"));
        }
        all.into_iter().step_by(matrix.rows + 1).collect()
    } else {
        all
    };
    let (operation, start) = if call.name == "product" { (Binary::Mul, 1.0) } else { (Binary::Add, 0.0) };
    let start = evaluator.graph.constant(start);
    let count = terms.len();
    let sum = terms.into_iter().fold(start, |sum, term| evaluator.graph.binary(operation, sum, term));
    if call.name == "mean" && count > 0 {
        let count = evaluator.graph.constant(count as f64);
        return real(evaluator.graph.binary(Binary::Div, sum, count));
    }
    real(sum)
}

/// `Aᵀ B`
fn transposed_product(evaluator: &mut Evaluator, matrix: &Rc<Matrix>, call: &Call) -> Result<Option<Value>> {
    let at = call.at;
    let other = argument(evaluator, call, 0)?;
    if matrix.rows != other.rows {
        return Err(error(at, "the numbers of rows differ"));
    }
    let mut elements = Vec::new();
    for j in 0..other.columns {
        for i in 0..matrix.columns {
            let (a, b) = (column(matrix, i), column(&other, j));
            elements.push(Value::Real(dot(evaluator, &a, &b, at)?));
        }
    }
    Ok(Some(Value::matrix(matrix.columns, other.columns, elements)))
}

/// The Kronecker product.
fn kronecker(evaluator: &mut Evaluator, matrix: &Rc<Matrix>, call: &Call) -> Result<Option<Value>> {
    let at = call.at;
    let other = argument(evaluator, call, 0)?;
    let mut elements = Vec::new();
    for (j1, j2) in pairs(matrix.columns, other.columns) {
        for (i1, i2) in pairs(matrix.rows, other.rows) {
            let (a, b) = (&matrix.elements[i1 + j1 * matrix.rows], &other.elements[i2 + j2 * other.rows]);
            elements.push(evaluator.binary(Operator::Mul, a, b, at)?);
        }
    }
    Ok(Some(Value::matrix(matrix.rows * other.rows, matrix.columns * other.columns, elements)))
}

/// Linear interpolation between two matrices.
fn lerp(evaluator: &mut Evaluator, matrix: &Rc<Matrix>, call: &Call) -> Result<Option<Value>> {
    let at = call.at;
    call.expect_argument_count(2)?;
    // In nalgebra: rhs * t, then self * (1 - t) is added.
    let other = argument(evaluator, call, 0)?;
    same_shape(matrix, &other, call)?;
    let t = evaluator.real(&call.arguments[1], at)?;
    let one = evaluator.graph.constant(1.0);
    let rest = evaluator.graph.binary(Binary::Sub, one, t);
    let (a, b) =
        (scale(evaluator, matrix, Binary::Mul, rest, at)?, scale(evaluator, &other, Binary::Mul, t, at)?);
    evaluator.binary(Operator::Add, &a, &b, at).map(Some)
}

/// Methods that rearrange elements, and iterators.
fn shape(evaluator: &mut Evaluator, matrix: &Rc<Matrix>, call: &Call) -> Result<Option<Value>> {
    let at = call.at;
    let Matrix { rows, columns, .. } = **matrix;
    Ok(Some(match call.name {
        "transpose" | "adjoint" => Value::Matrix(Rc::new(transpose(matrix))),
        "clone_owned" | "into_owned" | "as_view" | "conjugate" => Value::Matrix(matrix.clone()),
        "nrows" => Value::usize(rows),
        "ncols" => Value::usize(columns),
        "len" => Value::usize(rows * columns),
        "shape" => Value::tuple(vec![Value::usize(rows), Value::usize(columns)]),
        "is_empty" => Value::Bool(matrix.elements.is_empty()),
        "is_square" => Value::Bool(rows == columns),
        "iter" | "into_iter" => Value::iterator(Iter::of(matrix.elements.clone())),
        "as_slice" | "data" => Value::array(matrix.elements.clone()),
        "column_iter" => Value::iterator(Iter::of(
            (0..columns).map(|c| Value::Matrix(Rc::new(column(matrix, c)))).collect(),
        )),
        "row_iter" => {
            Value::iterator(Iter::of((0..rows).map(|r| Value::Matrix(Rc::new(row(matrix, r)))).collect()))
        }
        "diagonal" => {
            let n = rows.min(columns);
            Value::matrix(n, 1, (0..n).map(|i| matrix.elements[i + i * rows].clone()).collect())
        }
        "map" => {
            let mut elements = Vec::with_capacity(rows * columns);
            for element in &matrix.elements {
                elements.push(evaluator.call(call.only()?, vec![element.clone()], at)?);
            }
            Value::matrix(rows, columns, elements)
        }
        "map_with_location" => {
            let mut elements = Vec::with_capacity(rows * columns);
            for (i, element) in matrix.elements.iter().enumerate() {
                let location = [Value::usize(i % rows), Value::usize(i / rows), element.clone()];
                elements.push(evaluator.call(call.only()?, location.to_vec(), at)?);
            }
            Value::matrix(rows, columns, elements)
        }
        "zip_map" => {
            call.expect_argument_count(2)?;
            let other = argument(evaluator, call, 0)?;
            same_shape(matrix, &other, call)?;
            let mut elements = Vec::with_capacity(rows * columns);
            for (a, b) in matrix.elements.iter().zip(&other.elements) {
                elements.push(evaluator.call(&call.arguments[1], vec![a.clone(), b.clone()], at)?);
            }
            Value::matrix(rows, columns, elements)
        }
        "fold" => {
            call.expect_argument_count(2)?;
            let mut accumulated = call.arguments[0].clone();
            for element in &matrix.elements {
                accumulated = evaluator.call(&call.arguments[1], vec![accumulated, element.clone()], at)?;
            }
            accumulated
        }
        "get" => {
            let index = evaluator.usize(call.only()?, at)?;
            Value::Option(matrix.elements.get(index).cloned().map(Box::new))
        }
        "push" | "to_homogeneous" if columns == 1 => {
            let last = match call.name {
                "push" => Value::Real(evaluator.real(call.only()?, at)?),
                _ => Value::Real(evaluator.graph.constant(0.0)),
            };
            let elements = matrix.elements.iter().cloned().chain([last]).collect();
            Value::matrix(rows + 1, 1, elements)
        }
        "xy" | "xz" | "yz" | "yx" | "zx" | "zy" | "xyz" | "zyx" | "xx" | "yy" | "zz" if columns == 1 => {
            let mut elements = Vec::new();
            for letter in call.name.chars() {
                let Some((row, _)) = field(&letter.to_string(), rows, 1) else { return Ok(None) };
                elements.push(matrix.elements[row].clone());
            }
            Value::matrix(elements.len(), 1, elements)
        }
        "into" if !matches!(call.expected, Type::Array(..) | Type::Unknown) => Value::Matrix(matrix.clone()),
        _ => return Ok(None),
    }))
}

/// An argument as a matrix.
pub(super) fn argument(evaluator: &mut Evaluator, call: &Call, index: usize) -> Result<Rc<Matrix>> {
    let Some(argument) = call.arguments.get(index) else {
        call.expect_argument_count(index + 1)?;
        return Err(error(call.at, "an argument is missing"));
    };
    match evaluator.follow_value(argument.clone(), call.at)? {
        Value::Matrix(matrix) => Ok(matrix),
        Value::Opaque(_) => Err(crate::language::evaluator::opaque_value_error(call.at, "a matrix")),
        other => Err(error(call.at, format!("expected a matrix, found {}", other.description()))),
    }
}

fn transpose(matrix: &Matrix) -> Matrix {
    let (rows, columns) = (matrix.rows, matrix.columns);
    let elements = pairs(rows, columns).map(|(r, c)| matrix.elements[r + c * rows].clone()).collect();
    Matrix { rows: columns, columns: rows, elements }
}

/// A matrix as an array of columns; a vector as an array of numbers unless `nested`.
pub fn to_arrays(matrix: &Matrix, nested: bool) -> Value {
    if nested {
        let columns = matrix.elements.chunks(matrix.rows.max(1));
        return Value::array(columns.map(|column| Value::array(column.to_vec())).collect());
    }
    Value::array(matrix.elements.clone())
}
