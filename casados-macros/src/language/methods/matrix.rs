//! Methods and operators of small nalgebra matrices.
//!
//! Sums and products are in nalgebra's order, so that the bits are those of the plain function: `dot` of
//! 2, 3 and 4 elements is unrolled there, of more than 7 it has eight accumulators; products of
//! matrices sum over columns from the first to the last.

use super::iterator::Iter;
use super::{Call, Receiver, construction, option};
use crate::graph::{Binary, Node, Unary};
use crate::language::arithmetic::Operator;
use crate::language::evaluator::{At, Evaluator, error, unsupported};
use crate::language::place::Projection;
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
    if let Some(value) = change(evaluator, receiver, matrix, call)? {
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
            let difference = zip(evaluator, matrix, &other, Binary::Sub, at)?;
            let squared = norm_squared(evaluator, &difference, at)?;
            real(evaluator.graph.unary(Unary::Sqrt, squared))
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
        "cross" => {
            let other = argument(evaluator, call, 0)?;
            same_shape(matrix, &other, call)?;
            let (a, b) = (nodes(evaluator, matrix, at)?, nodes(evaluator, &other, at)?);
            let (&[ax, ay, az], &[bx, by, bz]) = (a.as_slice(), b.as_slice()) else {
                return Err(error(at, "`cross` is of vectors of three elements"));
            };
            let mut minor = |a, b, c, d| {
                let (ab, cd) =
                    (evaluator.graph.binary(Binary::Mul, a, b), evaluator.graph.binary(Binary::Mul, c, d));
                Value::Real(evaluator.graph.binary(Binary::Sub, ab, cd))
            };
            let elements = vec![minor(ay, bz, az, by), minor(az, bx, ax, bz), minor(ax, by, ay, bx)];
            Ok(Some(Value::matrix(matrix.rows, matrix.columns, elements)))
        }
        "cross_matrix" => {
            let &[x, y, z] = nodes(evaluator, matrix, at)?.as_slice() else {
                return Err(error(at, "`cross_matrix` is of a vector of three elements"));
            };
            let zero = evaluator.graph.constant(0.0);
            let minus = [x, y, z].map(|a| evaluator.graph.unary(Unary::Neg, a));
            let columns = [zero, z, minus[1], minus[2], zero, x, y, minus[0], zero];
            Ok(Some(Value::matrix(3, 3, columns.into_iter().map(Value::Real).collect())))
        }
        "sum" | "trace" | "product" | "mean" => {
            let all = nodes(evaluator, matrix, at)?;
            let terms = if call.name == "trace" {
                if matrix.rows != matrix.columns {
                    return Err(error(at, "`trace` is of a square matrix"));
                }
                all.into_iter().step_by(matrix.rows + 1).collect()
            } else {
                all
            };
            let (operation, start) =
                if call.name == "product" { (Binary::Mul, 1.0) } else { (Binary::Add, 0.0) };
            let start = evaluator.graph.constant(start);
            let count = terms.len();
            let sum = terms.into_iter().fold(start, |sum, term| evaluator.graph.binary(operation, sum, term));
            if call.name == "mean" && count > 0 {
                let count = evaluator.graph.constant(count as f64);
                return real(evaluator.graph.binary(Binary::Div, sum, count));
            }
            real(sum)
        }
        "determinant" => determinant(evaluator, matrix, at).map(|node| Some(Value::Real(node))),
        "tr_mul" | "ad_mul" => {
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
        "kronecker" => {
            let other = argument(evaluator, call, 0)?;
            let mut elements = Vec::new();
            for (j1, j2) in pairs(matrix.columns, other.columns) {
                for (i1, i2) in pairs(matrix.rows, other.rows) {
                    let (a, b) =
                        (&matrix.elements[i1 + j1 * matrix.rows], &other.elements[i2 + j2 * other.rows]);
                    elements.push(evaluator.binary(Operator::Mul, a, b, at)?);
                }
            }
            Ok(Some(Value::matrix(matrix.rows * other.rows, matrix.columns * other.columns, elements)))
        }
        "lerp" => {
            call.expect(2)?;
            // nalgebra: rhs * t, then self * (1 - t) added.
            let other = argument(evaluator, call, 0)?;
            same_shape(matrix, &other, call)?;
            let t = evaluator.real(&call.arguments[1], at)?;
            let one = evaluator.graph.constant(1.0);
            let rest = evaluator.graph.binary(Binary::Sub, one, t);
            let (a, b) = (
                scale(evaluator, matrix, Binary::Mul, rest, at)?,
                scale(evaluator, &other, Binary::Mul, t, at)?,
            );
            evaluator.binary(Operator::Add, &a, &b, at).map(Some)
        }
        "neg" => evaluator.negate(&Value::Matrix(matrix.clone()), at).map(Some),
        "add" | "sub" | "mul" | "div" => {
            let Some((Some(operator), _)) = super::float::operator(call.name) else { return Ok(None) };
            evaluator.binary(operator, &Value::Matrix(matrix.clone()), call.only()?, at).map(Some)
        }
        "abs" => elementwise(evaluator, matrix, Unary::Abs, at).map(Some),
        "max" | "min" => Err(unsupported(at, format!("`{}` of a matrix", call.name))),
        _ => Ok(None),
    }
}

/// Methods that rearrange, and iterators.
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
            call.expect(2)?;
            let other = argument(evaluator, call, 0)?;
            same_shape(matrix, &other, call)?;
            let mut elements = Vec::with_capacity(rows * columns);
            for (a, b) in matrix.elements.iter().zip(&other.elements) {
                elements.push(evaluator.call(&call.arguments[1], vec![a.clone(), b.clone()], at)?);
            }
            Value::matrix(rows, columns, elements)
        }
        "fold" => {
            call.expect(2)?;
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

/// Methods that give parts: `column`, `fixed_rows::<3>(0)`, `fixed_view_mut::<3, 3>(0, 0)`, ..
fn blocks(
    evaluator: &mut Evaluator,
    receiver: &Receiver,
    matrix: &Rc<Matrix>,
    call: &Call,
) -> Result<Option<Value>> {
    let at = call.at;
    let Matrix { rows, columns, .. } = **matrix;
    let (name, mutable) = match call.name.strip_suffix("_mut") {
        Some(name) => (name, true),
        None => (call.name, false),
    };
    let mut arguments = Vec::new();
    if matches!(
        name,
        "row" | "column" | "rows" | "columns" | "fixed_rows" | "fixed_columns" | "fixed_view" | "fixed_slice"
    ) {
        for argument in &call.arguments {
            arguments.push(evaluator.usize(argument, at)?);
        }
    }
    let mut sizes = call.turbofish.iter().filter_map(|generic| match generic {
        crate::language::value::Generic::Const(size) => usize::try_from(size.value).ok(),
        crate::language::value::Generic::Type(_) => None,
    });
    let projection = match (name, arguments.as_slice()) {
        ("row", &[row]) => Projection::Block { row, column: 0, rows: 1, columns },
        ("column", &[column]) => Projection::Block { row: 0, column, rows, columns: 1 },
        ("rows", &[row, rows]) => Projection::Block { row, column: 0, rows, columns },
        ("columns", &[column, columns]) => Projection::Block { row: 0, column, rows, columns },
        ("fixed_rows" | "fixed_columns" | "fixed_view" | "fixed_slice", _) => {
            let (first, second) = (sizes.next(), sizes.next());
            let block = match (name, arguments.as_slice(), first, second) {
                ("fixed_rows", &[row], Some(rows), _) => Some((row, 0, rows, columns)),
                ("fixed_columns", &[column], Some(columns), _) => Some((0, column, rows, columns)),
                (_, &[row, column], Some(rows), Some(columns)) => Some((row, column, rows, columns)),
                _ => None,
            };
            let Some((row, column, rows, columns)) = block else {
                return Err(error(at, format!("the size is not known here: write `{}::<2>(..)`", call.name)));
            };
            Projection::Block { row, column, rows, columns }
        }
        _ => return Ok(None),
    };
    match receiver {
        Receiver::Place(place) if mutable => {
            Ok(Some(Value::Reference(evaluator.project(place, projection, at)?)))
        }
        _ => evaluator.part(&Value::Matrix(matrix.clone()), projection, at).map(Some),
    }
}

/// Methods that change the matrix.
fn change(
    evaluator: &mut Evaluator,
    receiver: &Receiver,
    matrix: &Rc<Matrix>,
    call: &Call,
) -> Result<Option<Value>> {
    let at = call.at;
    let Matrix { rows, columns, .. } = **matrix;
    let mut new = (**matrix).clone();
    match call.name {
        "iter_mut" | "as_mut_slice" => {
            let Receiver::Place(place) = receiver else {
                return Ok(Some(Value::iterator(Iter::of(matrix.elements.clone()))));
            };
            if call.name == "as_mut_slice" {
                return Err(unsupported(
                    at,
                    "`as_mut_slice` of a matrix (`iter_mut` and indexing do the same)",
                ));
            }
            let iter = super::iterator::into_iter(evaluator, Value::Reference(place.clone()), at)?;
            return Ok(Some(Value::iterator(iter)));
        }
        "copy_from" => {
            let source = argument(evaluator, call, 0)?;
            same_shape(matrix, &source, call)?;
            new = (*source).clone();
        }
        "fill" => {
            let value = Value::Real(evaluator.real(call.only()?, at)?);
            new.elements.fill(value);
        }
        "fill_diagonal" => {
            let value = Value::Real(evaluator.real(call.only()?, at)?);
            (0..rows.min(columns)).for_each(|i| new.elements[i + i * rows] = value.clone());
        }
        "set_column" | "set_row" => {
            call.expect(2)?;
            let index = evaluator.usize(&call.arguments[0], at)?;
            let source = argument(evaluator, call, 1)?;
            let by_column = call.name == "set_column";
            let (limit, length) = if by_column { (columns, rows) } else { (rows, columns) };
            if index >= limit || source.elements.len() != length {
                return Err(error(
                    at,
                    format!(
                        "`{}` of {index} with {} elements does not fit a matrix of {rows} rows and {columns} columns",
                        call.name,
                        source.elements.len()
                    ),
                ));
            }
            for (i, element) in source.elements.iter().enumerate() {
                let position = if by_column { i + index * rows } else { index + i * rows };
                new.elements[position] = element.clone();
            }
        }
        "set_diagonal" => {
            let source = argument(evaluator, call, 0)?;
            if source.elements.len() != rows.min(columns) {
                return Err(error(at, "the diagonal has another length"));
            }
            for (i, element) in source.elements.iter().enumerate() {
                new.elements[i + i * rows] = element.clone();
            }
        }
        "swap_rows"
        | "swap_columns"
        | "scale_mut"
        | "unscale_mut"
        | "normalize_mut"
        | "neg_mut"
        | "apply"
        | "axpy"
        | "gemm"
        | "gemv"
        | "ger"
        | "component_mul_assign"
        | "component_div_assign"
        | "add_assign" => {
            return Err(unsupported(
                at,
                format!("`{}` (the operators and methods that return a new matrix do the same)", call.name),
            ));
        }
        _ => return Ok(None),
    }
    option::update(evaluator, receiver, Value::Matrix(Rc::new(new)), call)?;
    Ok(Some(Value::unit()))
}

/// An operator of which one side is a matrix. `None` if there is no such operator.
pub fn operator(
    evaluator: &mut Evaluator,
    operator: Operator,
    a: &Value,
    b: &Value,
    at: At,
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

fn shapes(symbol: &str, a: &Matrix, b: &Matrix) -> String {
    format!("there is no `{symbol}` of a {} x {} and a {} x {} matrix", a.rows, a.columns, b.rows, b.columns)
}

/// `Σₖ a_ik b_kj`, from the first `k` to the last.
fn product(evaluator: &mut Evaluator, a: &Matrix, b: &Matrix, at: At) -> Result<Value> {
    evaluator.tick(a.rows.saturating_mul(a.columns).saturating_mul(b.columns), at)?;
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
fn dot(evaluator: &mut Evaluator, a: &Matrix, b: &Matrix, at: At) -> Result<Node> {
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

/// Column after column, as nalgebra does it.
fn norm_squared(evaluator: &mut Evaluator, matrix: &Matrix, at: At) -> Result<Node> {
    let mut sum = evaluator.graph.constant(0.0);
    for c in 0..matrix.columns {
        let column = column(matrix, c);
        let term = dot(evaluator, &column, &column, at)?;
        sum = evaluator.graph.binary(Binary::Add, sum, term);
    }
    Ok(sum)
}

fn determinant(evaluator: &mut Evaluator, matrix: &Matrix, at: At) -> Result<Node> {
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

/// An argument as a matrix.
fn argument(evaluator: &mut Evaluator, call: &Call, index: usize) -> Result<Rc<Matrix>> {
    let Some(argument) = call.arguments.get(index) else {
        call.expect(index + 1)?;
        return Err(error(call.at, "an argument is missing"));
    };
    match evaluator.load(argument.clone(), call.at)? {
        Value::Matrix(matrix) => Ok(matrix),
        Value::Opaque(_) => Err(crate::language::evaluator::opaque(call.at, "a matrix")),
        other => Err(error(call.at, format!("expected a matrix, found {}", other.kind()))),
    }
}

fn same_shape(a: &Matrix, b: &Matrix, call: &Call) -> Result<()> {
    if (a.rows, a.columns) == (b.rows, b.columns) {
        return Ok(());
    }
    Err(error(call.at, shapes(call.name, a, b)))
}

/// The elements as numbers.
pub fn nodes(evaluator: &mut Evaluator, matrix: &Matrix, at: At) -> Result<Vec<Node>> {
    matrix.elements.iter().map(|element| evaluator.real(element, at)).collect()
}

fn products(evaluator: &mut Evaluator, a: &Matrix, b: &Matrix, at: At) -> Result<Vec<Node>> {
    let (a, b) = (nodes(evaluator, a, at)?, nodes(evaluator, b, at)?);
    Ok(a.into_iter().zip(b).map(|(a, b)| evaluator.graph.binary(Binary::Mul, a, b)).collect())
}

fn zip(evaluator: &mut Evaluator, a: &Matrix, b: &Matrix, operation: Binary, at: At) -> Result<Matrix> {
    let (x, y) = (nodes(evaluator, a, at)?, nodes(evaluator, b, at)?);
    let elements = x.into_iter().zip(y).map(|(x, y)| Value::Real(evaluator.graph.binary(operation, x, y)));
    Ok(Matrix { rows: a.rows, columns: a.columns, elements: elements.collect() })
}

fn scale(evaluator: &mut Evaluator, a: &Matrix, operation: Binary, factor: Node, at: At) -> Result<Value> {
    let x = nodes(evaluator, a, at)?;
    let elements = x.into_iter().map(|x| Value::Real(evaluator.graph.binary(operation, x, factor))).collect();
    Ok(Value::matrix(a.rows, a.columns, elements))
}

fn elementwise(evaluator: &mut Evaluator, a: &Matrix, function: Unary, at: At) -> Result<Value> {
    let x = nodes(evaluator, a, at)?;
    let elements = x.into_iter().map(|x| Value::Real(evaluator.graph.unary(function, x))).collect();
    Ok(Value::matrix(a.rows, a.columns, elements))
}

fn column(matrix: &Matrix, column: usize) -> Matrix {
    let first = column * matrix.rows;
    Matrix { rows: matrix.rows, columns: 1, elements: matrix.elements[first..first + matrix.rows].to_vec() }
}

fn row(matrix: &Matrix, row: usize) -> Matrix {
    let elements = (0..matrix.columns).map(|c| matrix.elements[row + c * matrix.rows].clone()).collect();
    Matrix { rows: 1, columns: matrix.columns, elements }
}

fn transpose(matrix: &Matrix) -> Matrix {
    let (rows, columns) = (matrix.rows, matrix.columns);
    let elements = pairs(rows, columns).map(|(r, c)| matrix.elements[r + c * rows].clone()).collect();
    Matrix { rows: columns, columns: rows, elements }
}

/// All pairs, the second index running fastest.
fn pairs(outer: usize, inner: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..outer).flat_map(move |a| (0..inner).map(move |b| (a, b)))
}

/// A matrix as an array of columns, a vector as an array of numbers unless it shall be nested.
pub fn to_arrays(matrix: &Matrix, nested: bool) -> Value {
    if nested {
        let columns = matrix.elements.chunks(matrix.rows.max(1));
        return Value::array(columns.map(|column| Value::array(column.to_vec())).collect());
    }
    Value::array(matrix.elements.clone())
}
