//! Scopes: which names stand for which variables and items.
//!
//! A scope is never changed after it was made: every `let` makes a new one in front of the last. So
//! a closure that keeps its scope sees what it saw where it was written, and shadowing is free.

use super::items::{Items, Symbol};
use super::place::Cell;
use super::types::Type;
use std::cell::RefCell;
use std::rc::Rc;

/// Names, and the scope around them.
#[derive(Debug, Default)]
pub struct Scope {
    /// The scope around it.
    pub parent: Option<Rc<Scope>>,
    /// What it declares.
    pub names: Names,
}

/// What a scope declares.
#[derive(Debug, Default)]
pub enum Names {
    /// Nothing.
    #[default]
    None,
    /// Variables and const parameters; later ones shadow earlier ones.
    Variables(Vec<(Symbol, Cell)>),
    /// Type parameters, known as soon as an argument tells.
    Types(Vec<(Symbol, RefCell<Type>)>),
    /// `Self`, and how the `impl` block writes it.
    SelfType(Type, Option<Rc<syn::Type>>),
    /// Items of a block or module.
    Items(Box<Items>),
}

impl Scope {
    /// A scope inside of another.
    pub fn child_scope(parent: &Rc<Scope>, names: Names) -> Rc<Scope> {
        Rc::new(Scope { parent: Some(parent.clone()), names })
    }

    /// This scope and those around it, from the inside out.
    pub fn enclosing_scopes(self: &Rc<Scope>) -> impl Iterator<Item = &Rc<Scope>> {
        std::iter::successors(Some(self), |scope| scope.parent.as_ref())
    }

    /// The variable of a name, unless an item of that name is nearer.
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
    /// Long chains are taken apart in a loop, not by recursion.
    fn drop(&mut self) {
        let mut next = self.parent.take();
        while let Some(scope) = next {
            next = Rc::into_inner(scope).and_then(|mut scope| scope.parent.take());
        }
    }
}
