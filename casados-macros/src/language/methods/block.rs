//! Rows, columns and blocks of small nalgebra matrices, and methods that change a matrix in place.

use super::algebra::same_shape;
use super::iterator::Iter;
use super::matrix::argument;
use super::{Call, Receiver, option};
use crate::language::evaluator::{Evaluator, error, unsupported};
use crate::language::place::Projection;
use crate::language::value::{Matrix, Value};
use std::rc::Rc;
use syn::Result;

/// Methods that return parts: `column`, `fixed_rows::<3>(0)`, `fixed_view_mut::<3, 3>(0, 0)`, ..
pub(super) fn blocks(
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
        _ => evaluator.value_part(&Value::Matrix(matrix.clone()), projection, at).map(Some),
    }
}

/// Methods that change the matrix.
pub(super) fn mutating_method(
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
            set_row_or_column(evaluator, &mut new, call)?;
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

/// A column or a row of a matrix.
fn set_row_or_column(evaluator: &mut Evaluator, new: &mut Matrix, call: &Call) -> Result<()> {
    let (at, rows, columns) = (call.at, new.rows, new.columns);
    call.expect_argument_count(2)?;
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
    Ok(())
}

pub(super) fn column(matrix: &Matrix, column: usize) -> Matrix {
    let first = column * matrix.rows;
    Matrix { rows: matrix.rows, columns: 1, elements: matrix.elements[first..first + matrix.rows].to_vec() }
}

pub(super) fn row(matrix: &Matrix, row: usize) -> Matrix {
    let elements = (0..matrix.columns).map(|c| matrix.elements[row + c * matrix.rows].clone()).collect();
    Matrix { rows: 1, columns: matrix.columns, elements }
}

/// All pairs; the second index runs fastest.
pub(super) fn pairs(outer: usize, inner: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..outer).flat_map(move |a| (0..inner).map(move |b| (a, b)))
}
