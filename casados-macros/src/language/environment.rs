//! Scopes: the variables and items of names.
//!
//! Scopes are immutable: every `let` creates a new one inside of the last. A closure therefore
//! keeps the scope in which it was written, and shadowing needs no special case.

use super::items::{Items, Symbol};
use super::place::Cell;
use super::types::Type;
use std::cell::RefCell;
use std::rc::Rc;

/// Names, and the enclosing scope.
#[derive(Debug, Default)]
pub struct Scope {
    /// The enclosing scope.
    pub parent: Option<Rc<Scope>>,
    /// The names that it declares.
    pub names: Names,
}

/// The names declared by a scope.
#[derive(Debug, Default)]
pub enum Names {
    /// No names.
    #[default]
    None,
    /// Variables and const parameters; later ones shadow earlier ones.
    Variables(Vec<(Symbol, Cell)>),
    /// Type parameters, bound when an argument determines them.
    Types(Vec<(Symbol, RefCell<Type>)>),
    /// `Self`, and its form in the `impl` block.
    SelfType(Type, Option<Rc<syn::Type>>),
    /// Items of a block or module.
    Items(Box<Items>),
}

impl Scope {
    /// A scope inside of another.
    pub fn child_scope(parent: &Rc<Scope>, names: Names) -> Rc<Scope> {
        Rc::new(Scope { parent: Some(parent.clone()), names })
    }

    /// This scope and the enclosing ones, from the inside out.
    pub fn enclosing_scopes(self: &Rc<Scope>) -> impl Iterator<Item = &Rc<Scope>> {
        std::iter::successors(Some(self), |scope| scope.parent.as_ref())
    }

    /// The variable of a name, unless an item of an inner scope shadows it.
    pub fn variable(self: &Rc<Scope>, name: Symbol) -> Option<Cell> {
        for scope in self.enclosing_scopes() {
            match &scope.names {
                Names::Variables(variables) => {
                    if let Some((_, cell)) = variables.iter().rev().find(|(symbol, _)| *symbol == name) {
                        return Some(cell.clone());
                    }
                }
                Names::Items(items) if items.values.contains_key(&name) => return None,
                _ => {}
            }
        }
        None
    }
}

impl Drop for Scope {
    /// Long chains are dropped in a loop, not by recursion.
    fn drop(&mut self) {
        let mut next = self.parent.take();
        while let Some(scope) = next {
            next = Rc::into_inner(scope).and_then(|mut scope| scope.parent.take());
        }
    }
}
