//! Construction of nalgebra matrices: `Vector3::new`, `SMatrix::from_row_slice`, ..

use super::Call;
use crate::language::evaluator::{Evaluator, TokenSpan, error};
use crate::language::types::Type;
use crate::language::value::{Builtin, Matrix, Value};
use std::rc::Rc;
use syn::Result;

/// `SVector::from(array)`, `into()`: numbers become a column, arrays of numbers become columns.
pub fn from_arrays(
    evaluator: &mut Evaluator,
    elements: &[Value],
    rows: Option<usize>,
    columns: Option<usize>,
    at: TokenSpan,
) -> Result<Value> {
    let mut all = Vec::new();
    let mut height = None;
    for element in elements {
        match evaluator.follow_value(element.clone(), at)? {
            Value::Array(column) => {
                if *height.get_or_insert(column.len()) != column.len() {
                    return Err(error(at, "the columns have different lengths"));
                }
                all.extend(column.iter().cloned());
            }
            number => all.push(Value::Real(evaluator.real(&number, at)?)),
        }
    }
    let (found_rows, found_columns) = match height {
        Some(height) => (height, elements.len()),
        None if rows == Some(1) => (1, elements.len()),
        None => (elements.len(), 1),
    };
    if rows.is_some_and(|rows| rows != found_rows) || columns.is_some_and(|columns| columns != found_columns)
    {
        return Err(error(at, format!("this array makes a {found_rows} x {found_columns} matrix")));
    }
    Ok(Value::matrix(found_rows, found_columns, all))
}

/// A constructor by path. `None` if there is no such function.
pub fn function(evaluator: &mut Evaluator, function: &Builtin, call: &Call) -> Result<Option<Value>> {
    let Some(Type::Matrix(own_rows, own_columns)) = function.owner else { return Ok(None) };
    let Some(name) = function.path.last().map(String::as_str) else { return Ok(None) };
    let at = call.at;
    let (rows, columns) = match call.expected {
        Type::Matrix(rows, columns) => (own_rows.or(*rows), own_columns.or(*columns)),
        _ => (own_rows, own_columns),
    };
    let size = |evaluator: &mut Evaluator| known_size(evaluator, name, (rows, columns), at);
    let constant = |evaluator: &mut Evaluator, value: f64| Value::Real(evaluator.graph.constant(value));
    Ok(Some(match name {
        "zeros" | "zero" => {
            let (rows, columns) = size(evaluator)?;
            Value::matrix(rows, columns, vec![constant(evaluator, 0.0); rows * columns])
        }
        "identity" | "one" => {
            let (rows, columns) = size(evaluator)?;
            let (zero, one) = (constant(evaluator, 0.0), constant(evaluator, 1.0));
            from_fn(rows, columns, |r, c| Ok(if r == c { one.clone() } else { zero.clone() }))?
        }
        "repeat" | "from_element" => {
            let (rows, columns) = size(evaluator)?;
            let element = Value::Real(evaluator.real(call.only()?, at)?);
            Value::matrix(rows, columns, vec![element; rows * columns])
        }
        "from_diagonal_element" => {
            let (rows, columns) = size(evaluator)?;
            let (zero, element) = (constant(evaluator, 0.0), Value::Real(evaluator.real(call.only()?, at)?));
            from_fn(rows, columns, |r, c| Ok(if r == c { element.clone() } else { zero.clone() }))?
        }
        "from_fn" => {
            let (rows, columns) = size(evaluator)?;
            let closure = call.only()?;
            from_fn(rows, columns, |r, c| {
                evaluator.count_steps(1, at)?;
                evaluator.call(closure, vec![Value::usize(r), Value::usize(c)], at)
            })?
        }
        // Elements in row-major order.
        "new" => {
            let (rows, columns) = size(evaluator)?;
            let elements = reals(evaluator, &call.arguments, at)?;
            check_element_count(elements.len(), rows, columns, at)?;
            from_fn(rows, columns, |r, c| Ok(elements[r * columns + c].clone()))?
        }
        "from_row_slice"
        | "from_column_slice"
        | "from_array_storage"
        | "from_slice"
        | "from_vec"
        | "from_row_iterator"
        | "from_column_iterator"
        | "from_iterator" => from_list(evaluator, name, call, (rows, columns))?,
        "from" => match evaluator.follow_value(call.only()?.clone(), at)? {
            Value::Array(elements) => from_arrays(evaluator, &elements, rows, columns, at)?,
            other => other,
        },
        "from_columns" | "from_rows" => from_vectors(evaluator, name, call, (rows, columns))?,
        "from_diagonal" => {
            let Value::Matrix(diagonal) = evaluator.follow_value(call.only()?.clone(), at)? else {
                return Err(error(at, "`from_diagonal` takes a vector"));
            };
            let zero = constant(evaluator, 0.0);
            let n = diagonal.elements.len();
            from_fn(n, n, |r, c| Ok(if r == c { diagonal.elements[r].clone() } else { zero.clone() }))?
        }
        "x" | "y" | "z" | "w" | "x_axis" | "y_axis" | "z_axis" if call.arguments.is_empty() => {
            let (rows, columns) = size(evaluator)?;
            let Some((axis, _)) = super::matrix::field(&name[..1], rows, columns) else { return Ok(None) };
            let (zero, one) = (constant(evaluator, 0.0), constant(evaluator, 1.0));
            from_fn(rows, columns, |r, _| Ok(if r == axis { one.clone() } else { zero.clone() }))?
        }
        _ => return Ok(None),
    }))
}

/// The size of a matrix, which must be known.
fn known_size(
    evaluator: &mut Evaluator,
    name: &str,
    size: (Option<usize>, Option<usize>),
    at: TokenSpan,
) -> Result<(usize, usize)> {
    match size {
        (Some(rows), Some(columns)) => {
            evaluator.count_steps(rows.saturating_mul(columns), at)?;
            Ok((rows, columns))
        }
        _ => Err(error(
            at,
            format!(
                "the size of this matrix is not known here: write `SMatrix::<f64, 2, 3>::{name}(..)` or name its type in a `let`"
            ),
        )),
    }
}

/// A matrix from a list of its elements.
fn from_list(
    evaluator: &mut Evaluator,
    name: &str,
    call: &Call,
    (rows, columns): (Option<usize>, Option<usize>),
) -> Result<Value> {
    let elements = take_elements(evaluator, call, rows.zip(columns))?;
    let (rows, columns) = match (rows, columns) {
        (None, Some(1)) => (elements.len(), 1),
        size => known_size(evaluator, name, size, call.at)?,
    };
    check_element_count(elements.len(), rows, columns, call.at)?;
    if name.starts_with("from_row") {
        from_fn(rows, columns, |r, c| Ok(elements[r * columns + c].clone()))
    } else {
        Ok(Value::matrix(rows, columns, elements))
    }
}

fn reals(evaluator: &mut Evaluator, values: &[Value], at: TokenSpan) -> Result<Vec<Value>> {
    values.iter().map(|value| evaluator.real(value, at).map(Value::Real)).collect()
}

fn check_element_count(found: usize, rows: usize, columns: usize, at: TokenSpan) -> Result<()> {
    if found == rows * columns {
        return Ok(());
    }
    Err(error(
        at,
        format!("a {rows} x {columns} matrix has {} elements, but {found} are given", rows * columns),
    ))
}

fn from_fn(
    rows: usize,
    columns: usize,
    mut element: impl FnMut(usize, usize) -> Result<Value>,
) -> Result<Value> {
    let mut elements = Vec::with_capacity(rows.saturating_mul(columns).min(1 << 16));
    for column in 0..columns {
        for row in 0..rows {
            elements.push(element(row, column)?);
        }
    }
    Ok(Value::matrix(rows, columns, elements))
}

/// Numbers of an iterator, at most the number of elements.
fn take_elements(evaluator: &mut Evaluator, call: &Call, size: Option<(usize, usize)>) -> Result<Vec<Value>> {
    let at = call.at;
    let mut elements = Vec::new();
    let source = evaluator.follow_value(call.only()?.clone(), at)?;
    let mut iter = super::iterator::into_iter(evaluator, source, at)?;
    let limit = size.map_or(usize::MAX, |(rows, columns)| rows.saturating_mul(columns));
    while elements.len() < limit {
        let Some(value) = iter.next(evaluator, at)? else { break };
        elements.push(Value::Real(evaluator.real(&value, at)?));
    }
    Ok(elements)
}

/// `from_columns`, `from_rows`
fn from_vectors(
    evaluator: &mut Evaluator,
    name: &str,
    call: &Call,
    (rows, columns): (Option<usize>, Option<usize>),
) -> Result<Value> {
    let at = call.at;
    let Value::Array(parts) = evaluator.follow_value(call.only()?.clone(), at)? else {
        return Err(error(at, format!("`{name}` takes an array of vectors")));
    };
    let mut vectors: Vec<Rc<Matrix>> = Vec::new();
    for part in parts.iter() {
        match evaluator.follow_value(part.clone(), at)? {
            Value::Matrix(vector) => vectors.push(vector),
            other => return Err(error(at, format!("expected a vector, found {}", other.description()))),
        }
    }
    let length = vectors.first().map_or(0, |vector| vector.elements.len());
    if vectors.iter().any(|vector| vector.elements.len() != length) {
        return Err(error(at, "the vectors have different lengths"));
    }
    let by_columns = name == "from_columns";
    let (height, width) = if by_columns { (length, vectors.len()) } else { (vectors.len(), length) };
    if rows.is_some_and(|rows| rows != height) || columns.is_some_and(|columns| columns != width) {
        return Err(error(at, format!("these vectors make a {height} x {width} matrix")));
    }
    from_fn(height, width, |r, c| {
        Ok(if by_columns { vectors[c].elements[r].clone() } else { vectors[r].elements[c].clone() })
    })
}
