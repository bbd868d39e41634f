//! Places: variables and their parts, the targets of assignments and `&mut`.

use super::evaluator::{Evaluator, TokenSpan, error};
use super::value::{Matrix, Value};
use std::cell::RefCell;
use std::rc::Rc;
use syn::Result;

/// The storage of a variable.
pub type Cell = Rc<RefCell<Value>>;

/// A variable or a part of it.
#[derive(Clone, Debug)]
pub struct Place {
    /// The variable.
    pub cell: Cell,
    /// The projections to the part. Slices and blocks are last.
    pub path: Vec<Projection>,
}

/// One projection from a value to a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Projection {
    /// A field of a struct or tuple.
    Field(usize),
    /// An element of an array.
    Index(usize),
    /// A slice of an array: start, end.
    Slice(usize, usize),
    /// An element of a matrix: row, column.
    Element(usize, usize),
    /// A block of a matrix.
    Block {
        /// The first row.
        row: usize,
        /// The first column.
        column: usize,
        /// The number of rows.
        rows: usize,
        /// The number of columns.
        columns: usize,
    },
    /// The content of an `Option`.
    Some,
}

impl Place {
    /// The place of a new variable.
    pub fn new(value: Value) -> Place {
        Place { cell: Rc::new(RefCell::new(value)), path: Vec::new() }
    }

    /// Whether both are the same storage.
    pub fn is_same_memory(&self, other: &Place) -> bool {
        Rc::ptr_eq(&self.cell, &other.cell) && self.path == other.path
    }

    fn get(&self) -> Option<Value> {
        let value = self.cell.borrow();
        let mut value: &Value = &value;
        for step in &self.path {
            value = match (step, value) {
                (Projection::Field(index), Value::Tuple(elements)) => elements.get(*index)?,
                (Projection::Field(index), Value::Struct(structure)) => structure.fields.get(*index)?,
                (Projection::Index(index), Value::Array(elements)) => elements.get(*index)?,
                (Projection::Slice(start, end), Value::Array(elements)) => {
                    return Some(Value::array(elements.get(*start..*end)?.to_vec()));
                }
                (Projection::Element(row, column), Value::Matrix(matrix)) => {
                    matrix.elements.get(row + column * matrix.rows)?
                }
                (Projection::Block { row, column, rows, columns }, Value::Matrix(matrix)) => {
                    let mut elements = Vec::with_capacity(rows * columns);
                    for c in *column..column + columns {
                        let first = row + c * matrix.rows;
                        elements.extend_from_slice(matrix.elements.get(first..first + rows)?);
                    }
                    return Some(Value::matrix(*rows, *columns, elements));
                }
                (Projection::Some, Value::Option(Some(value))) => value,
                _ => return None,
            };
        }
        Some(value.clone())
    }

    fn set(&self, new: Value) -> Option<()> {
        let mut value = self.cell.borrow_mut();
        let mut value: &mut Value = &mut value;
        for step in &self.path {
            value = match (step, value) {
                (Projection::Field(index), Value::Tuple(elements)) => {
                    Rc::make_mut(elements).get_mut(*index)?
                }
                (Projection::Field(index), Value::Struct(structure)) => {
                    Rc::make_mut(structure).fields.get_mut(*index)?
                }
                (Projection::Index(index), Value::Array(elements)) => {
                    Rc::make_mut(elements).get_mut(*index)?
                }
                (Projection::Slice(start, end), Value::Array(elements)) => {
                    let Value::Array(new) = new else { return None };
                    let part = Rc::make_mut(elements).get_mut(*start..*end)?;
                    if part.len() != new.len() {
                        return None;
                    }
                    part.clone_from_slice(&new);
                    return Some(());
                }
                (Projection::Element(row, column), Value::Matrix(matrix)) => {
                    let index = row + column * matrix.rows;
                    Rc::make_mut(matrix).elements.get_mut(index)?
                }
                (Projection::Block { row, column, rows, columns }, Value::Matrix(matrix)) => {
                    let Value::Matrix(new) = new else { return None };
                    if (new.rows, new.columns) != (*rows, *columns) {
                        return None;
                    }
                    let matrix = Rc::make_mut(matrix);
                    for c in 0..*columns {
                        let first = row + (column + c) * matrix.rows;
                        let part = matrix.elements.get_mut(first..first + rows)?;
                        part.clone_from_slice(&new.elements[c * rows..(c + 1) * rows]);
                    }
                    return Some(());
                }
                (Projection::Some, Value::Option(Some(value))) => value,
                _ => return None,
            };
        }
        *value = new;
        Some(())
    }
}

impl Evaluator {
    /// The value in a place.
    pub fn read(&mut self, place: &Place, at: TokenSpan) -> Result<Value> {
        place.get().ok_or_else(|| error(at, "this is no part of the value"))
    }

    /// Writes to a place.
    pub fn write(&mut self, place: &Place, value: Value, at: TokenSpan) -> Result<()> {
        if refers_to_cell(&value, &place.cell) {
            return Err(error(at, "a reference to a variable cannot be stored in that variable itself"));
        }
        self.save_old_value(&place.cell);
        place.set(value).ok_or_else(|| error(at, "the value does not fit where it is assigned to"))
    }

    /// Follows mutable references to the place of a method's receiver.
    pub fn follow_place(&mut self, mut place: Place, at: TokenSpan) -> Result<Place> {
        loop {
            match self.read(&place, at)? {
                Value::Reference(target) => place = target,
                _ => return Ok(place),
            }
        }
    }

    /// Follows mutable references to the value.
    pub fn follow_value(&mut self, mut value: Value, at: TokenSpan) -> Result<Value> {
        while let Value::Reference(place) = &value {
            value = self.read(place, at)?;
        }
        Ok(value)
    }

    /// A part of a place, with bounds checks. Slices of slices, and elements of slices and blocks,
    /// are resolved.
    pub fn project(&mut self, place: &Place, projection: Projection, at: TokenSpan) -> Result<Place> {
        let mut place = self.follow_place(place.clone(), at)?;
        let value = match place.path.last() {
            Some(Projection::Slice(..) | Projection::Block { .. }) => None,
            _ => Some(self.read(&place, at)?),
        };
        let projection = match (projection, place.path.last().copied()) {
            (Projection::Index(index), Some(Projection::Slice(start, end))) => {
                check_index(index, end - start, at)?;
                place.path.pop();
                Projection::Index(start + index)
            }
            (Projection::Slice(first, last), Some(Projection::Slice(start, end))) => {
                slice(first, last, end - start, at)?;
                place.path.pop();
                Projection::Slice(start + first, start + last)
            }
            (Projection::Element(r, c), Some(Projection::Block { row, column, rows, columns })) => {
                check_index(r, rows, at)?;
                check_index(c, columns, at)?;
                place.path.pop();
                Projection::Element(row + r, column + c)
            }
            (
                Projection::Block { row: r, column: c, rows: height, columns: width },
                Some(Projection::Block { row, column, rows, columns }),
            ) => {
                slice(r, r.saturating_add(height), rows, at)?;
                slice(c, c.saturating_add(width), columns, at)?;
                place.path.pop();
                Projection::Block { row: row + r, column: column + c, rows: height, columns: width }
            }
            (projection, _) => {
                match (projection, &value) {
                    (Projection::Index(index), Some(Value::Array(elements))) => {
                        check_index(index, elements.len(), at)?
                    }
                    (Projection::Slice(first, last), Some(Value::Array(elements))) => {
                        slice(first, last, elements.len(), at)?;
                    }
                    (Projection::Element(r, c), Some(Value::Matrix(matrix))) => {
                        check_index(r, matrix.rows, at)?;
                        check_index(c, matrix.columns, at)?;
                    }
                    (Projection::Block { row, column, rows, columns }, Some(Value::Matrix(matrix))) => {
                        slice(row, row.saturating_add(rows), matrix.rows, at)?;
                        slice(column, column.saturating_add(columns), matrix.columns, at)?;
                    }
                    (Projection::Field(index), Some(Value::Tuple(elements))) if index < elements.len() => {}
                    (Projection::Field(index), Some(Value::Struct(s))) if index < s.fields.len() => {}
                    (Projection::Some, Some(Value::Option(Some(_)))) => {}
                    _ => return Err(error(at, "this value has no such part")),
                }
                projection
            }
        };
        place.path.push(projection);
        Ok(place)
    }

    /// A part of a value, as [`Evaluator::project`] for a place.
    pub fn value_part(&mut self, value: &Value, projection: Projection, at: TokenSpan) -> Result<Value> {
        match (projection, value) {
            (Projection::Index(index), Value::Array(elements)) => {
                check_index(index, elements.len(), at)?;
                Ok(elements[index].clone())
            }
            (Projection::Element(r, c), Value::Matrix(matrix)) => {
                check_index(r, matrix.rows, at)?;
                check_index(c, matrix.columns, at)?;
                Ok(element(matrix, r, c))
            }
            _ => {
                let place = self.project(&Place::new(value.clone()), projection, at)?;
                self.read(&place, at)
            }
        }
    }
}

/// Whether a value contains references to a variable, directly or through other variables.
fn refers_to_cell(value: &Value, cell: &Cell) -> bool {
    let any = |values: &[Value]| values.iter().any(|value| refers_to_cell(value, cell));
    match value {
        Value::Reference(place) => {
            Rc::ptr_eq(&place.cell, cell) || refers_to_cell(&place.cell.borrow(), cell)
        }
        Value::Array(values) | Value::Tuple(values) => any(values),
        Value::Struct(structure) => any(&structure.fields),
        Value::Matrix(matrix) => any(&matrix.elements),
        Value::Option(Some(value)) => refers_to_cell(value, cell),
        _ => false,
    }
}

fn element(matrix: &Matrix, row: usize, column: usize) -> Value {
    matrix.elements[row + column * matrix.rows].clone()
}

fn check_index(index: usize, length: usize, at: TokenSpan) -> Result<()> {
    if index < length {
        return Ok(());
    }
    Err(error(at, format!("index out of range: the length is {length} but the index is {index}")))
}

fn slice(start: usize, end: usize, length: usize, at: TokenSpan) -> Result<()> {
    if start <= end && end <= length {
        return Ok(());
    }
    Err(error(at, format!("range out of bounds: the length is {length} but the range is {start}..{end}")))
}
