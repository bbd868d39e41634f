//! Scopes: which names stand for which variables and items.

use super::place::Cell;
use std::cell::RefCell;
use std::rc::Rc;

/// A scope and those around it.
#[derive(Debug, Default)]
pub struct Scope {
    /// The scope around it.
    pub parent: Option<Rc<Scope>>,
    /// Variables, in order of their declaration: later ones shadow earlier ones.
    pub variables: RefCell<Vec<(u32, Cell)>>,
}
