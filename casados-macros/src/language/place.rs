//! Places: variables and parts of them, which assignments and `&mut` refer to.

use super::value::Value;
use std::cell::RefCell;
use std::rc::Rc;

/// The memory of one variable.
pub type Cell = Rc<RefCell<Value>>;

/// A variable, or a part of it.
#[derive(Clone, Debug)]
pub struct Place {
    /// The variable.
    pub cell: Cell,
    /// The way to the part.
    pub path: Vec<Projection>,
}

/// One step on the way from a value to its part.
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
        /// First row.
        row: usize,
        /// First column.
        column: usize,
        /// Rows.
        rows: usize,
        /// Columns.
        columns: usize,
    },
    /// What is in an `Option`.
    Some,
}
