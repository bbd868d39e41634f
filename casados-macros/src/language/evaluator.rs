//! The state of an evaluation, and its basic operations.

use super::Table;
use super::environment::Scope;
use super::implementation::Implementation;
use super::items::Symbol;
use super::place::Cell;
use super::types::Type;
use super::value::{CallStack, Integer, Value};
use crate::graph::{Graph, Node};
use proc_macro2::TokenStream;
use quote::ToTokens;
use std::collections::{HashMap, HashSet};
use std::rc::Rc;
use syn::Result;

/// The tokens of an error.
pub type TokenSpan<'a> = &'a dyn ToTokens;

/// An error at the user's tokens: one lower-case sentence with the cause and the remedy.
pub fn error(at: TokenSpan, message: impl std::fmt::Display) -> syn::Error {
    syn::Error::new_spanned(at, message)
}

/// An error about a construct that graph models do not support: `what` is the subject of the
/// sentence.
pub fn unsupported(at: TokenSpan, what: impl std::fmt::Display) -> syn::Error {
    error(
        at,
        format!(
            "{what} is outside of what a graph model can express: rewrite it, or make the model generic, \
             `fn f<T: DualNum + Copy>(...)`, where any Rust is allowed"
        ),
    )
}

/// Maximum number of evaluation steps; more are treated as an infinite loop.
pub const MAX_STEPS: usize = 10_000_000;
/// Maximum number of graph nodes; more are treated as an infinite loop.
pub const MAX_NODES: usize = 4_000_000;
/// Maximum nesting of expressions and calls.
pub const MAX_DEPTH: usize = 200;
/// Maximum stack size of an evaluation, in bytes. An unoptimised macro needs 4 to 20 kB per level,
/// and the smallest threads of macros have 2 MiB.
const MAX_STACK_BYTES: usize = 5 << 18;

/// The reason why an expression has no value.
#[derive(Debug)]
pub enum Flow {
    /// An error.
    Error(syn::Error),
    /// `break 'label value`
    Break(Option<syn::Lifetime>, Value),
    /// `continue 'label`
    Continue(Option<syn::Lifetime>),
    /// `return value`
    Return(Value),
}

impl From<syn::Error> for Flow {
    fn from(error: syn::Error) -> Flow {
        Flow::Error(error)
    }
}

/// The result of an expression.
pub type Evaluated<T = Value> = std::result::Result<T, Flow>;

/// Executes functions symbolically.
#[derive(Default)]
pub struct Evaluator {
    /// The graph of expressions.
    pub graph: Graph,
    /// Constants from outside: `Op::Opaque` is an index into this list.
    pub opaque: Vec<TokenStream>,
    /// Tables: the graph has indices into this list.
    pub tables: Vec<Table>,
    /// `use` items in bodies, which opaque constants may need.
    pub uses: Vec<syn::ItemUse>,
    /// The scope of the executed code.
    pub(super) scope: Rc<Scope>,
    /// The indices of names.
    pub(super) symbols: HashMap<String, Symbol>,
    /// All `impl` blocks so far.
    pub(super) implementations: Vec<Rc<Implementation>>,
    /// Scopes of items, kept alive for the definitions in them.
    pub(super) scopes: Vec<Rc<Scope>>,
    /// The functions in execution.
    pub(super) calls: Option<Rc<CallStack>>,
    /// The enclosing loops and labelled blocks, with the number of enclosing branches on run-time
    /// conditions.
    pub(super) targets: Vec<(Option<String>, Target, usize)>,
    /// The return type of the executed function.
    pub(super) returns: Type,
    /// The number of branches around the call of the executed function.
    pub(super) function_branches: usize,
    /// Whether the current pattern is irrefutable, so that its names are variables.
    pub(super) irrefutable: bool,
    /// The changes within the branches in execution.
    journals: Vec<ChangeJournal>,
    numbers: HashMap<String, u32>,
    steps: usize,
    depth: usize,
    /// The stack pointer at the start of the evaluation.
    bottom: Option<usize>,
}

/// The target of a `break`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// A loop.
    Loop,
    /// A labelled block.
    Block,
}

/// Changed variables, with their old values.
#[derive(Default)]
struct ChangeJournal {
    entries: Vec<(Cell, Value)>,
    seen: HashSet<*const std::cell::RefCell<Value>>,
}

/// The changes of a branch: variables and their new values.
pub type Changes = Vec<(Cell, Value)>;

impl Evaluator {
    /// Counts steps: loops in built-in functions call this once for each element.
    pub fn count_steps(&mut self, steps: usize, at: TokenSpan) -> Result<()> {
        self.steps = self.steps.saturating_add(steps);
        if self.steps > MAX_STEPS {
            return Err(error(
                at,
                format!("the model takes more than {MAX_STEPS} evaluation steps: does this loop end?"),
            ));
        }
        if self.graph.len() > MAX_NODES {
            return Err(error(at, format!("the model has more than {MAX_NODES} operations")));
        }
        Ok(())
    }

    /// Evaluates something one nesting level deeper.
    pub(super) fn deeper<T>(
        &mut self,
        at: TokenSpan,
        execute: impl FnOnce(&mut Self) -> Evaluated<T>,
    ) -> Evaluated<T> {
        self.count_steps(1, at)?;
        let marker = 0_u8;
        let here = std::ptr::from_ref(&marker).addr();
        let used = self.bottom.get_or_insert(here).abs_diff(here);
        if self.depth >= MAX_DEPTH || used > MAX_STACK_BYTES {
            return Err(error(
                at,
                "expressions and calls are nested too deeply here: split them into statements",
            )
            .into());
        }
        self.depth += 1;
        let result = execute(self);
        self.depth -= 1;
        result
    }

    /// The value of an expression that `break`, `continue` or `return` cannot leave.
    pub(super) fn require_value(&mut self, result: Evaluated, at: TokenSpan) -> Result<Value> {
        match result {
            Ok(value) => Ok(value),
            Err(Flow::Error(error)) => Err(error),
            Err(_) => Err(error(at, "`break`, `continue` and `return` are not supported here")),
        }
    }

    /// Records the value of a variable before it is changed.
    pub(super) fn save_old_value(&mut self, cell: &Cell) {
        if let Some(journal) = self.journals.last_mut()
            && journal.seen.insert(Rc::as_ptr(cell))
        {
            let old = cell.borrow().clone();
            journal.entries.push((cell.clone(), old));
        }
    }

    /// The number of enclosing run-time conditions.
    pub(super) fn open_branch_count(&self) -> usize {
        self.journals.len()
    }

    /// Executes a branch on a run-time condition; returns its changes, after undoing them.
    pub(super) fn branch<T>(
        &mut self,
        execute: impl FnOnce(&mut Self) -> Evaluated<T>,
    ) -> Evaluated<(T, Changes)> {
        self.journals.push(ChangeJournal::default());
        let result = execute(self);
        let journal = self.journals.pop().unwrap_or_default();
        let value = result?;
        let mut changes = Vec::new();
        for (cell, old) in journal.entries {
            // Variables of the branch itself are dropped.
            if Rc::strong_count(&cell) > 1 {
                let new = cell.replace(old);
                changes.push((cell, new));
            }
        }
        Ok((value, changes))
    }

    /// Executes code that depends on a run-time condition.
    pub(super) fn run_conditionally<T>(
        &mut self,
        condition: Node,
        execute: impl FnOnce(&mut Self) -> Result<T>,
        at: TokenSpan,
    ) -> Result<T> {
        match self.branch(|evaluator| Ok(execute(evaluator)?)) {
            Ok((value, changes)) => {
                self.merge(condition, changes, Vec::new(), at)?;
                Ok(value)
            }
            Err(Flow::Error(error)) => Err(error),
            Err(_) => Err(error(at, "`break`, `continue` and `return` are not supported here")),
        }
    }

    /// Merges the changes of two branches; the first one is taken if the condition holds.
    pub(super) fn merge(&mut self, condition: Node, a: Changes, b: Changes, at: TokenSpan) -> Result<()> {
        let position: HashMap<_, _> =
            b.iter().enumerate().map(|(index, (cell, _))| (Rc::as_ptr(cell), index)).collect();
        let mut merged = HashSet::new();
        for (cell, then) in a {
            merged.insert(Rc::as_ptr(&cell));
            let otherwise = match position.get(&Rc::as_ptr(&cell)) {
                Some(&index) => b[index].1.clone(),
                None => cell.borrow().clone(),
            };
            let value = self.select(condition, &then, &otherwise, at)?;
            self.save_old_value(&cell);
            cell.replace(value);
        }
        for (cell, otherwise) in b {
            if !merged.contains(&Rc::as_ptr(&cell)) {
                let then = cell.borrow().clone();
                let value = self.select(condition, &then, &otherwise, at)?;
                self.save_old_value(&cell);
                cell.replace(value);
            }
        }
        Ok(())
    }

    /// The value as a number. Opaque constants are converted.
    pub fn real(&mut self, value: &Value, at: TokenSpan) -> Result<Node> {
        match value {
            Value::Real(node) => Ok(*node),
            Value::Opaque(tokens) => {
                let text = tokens.to_string();
                let next = self.opaque.len() as u32;
                let index = *self.numbers.entry(text).or_insert(next);
                if index == next {
                    self.opaque.push((**tokens).clone());
                }
                Ok(self.graph.opaque(index))
            }
            Value::Reference(place) => {
                let value = self.read(place, at)?;
                self.real(&value, at)
            }
            other => Err(error(at, format!("expected an `f64`, found {}", other.description()))),
        }
    }

    /// The value as a known integer.
    pub fn integer(&mut self, value: &Value, at: TokenSpan) -> Result<Integer> {
        match value {
            Value::Integer(integer) => Ok(*integer),
            Value::Reference(place) => {
                let value = self.read(place, at)?;
                self.integer(&value, at)
            }
            Value::Opaque(_) => Err(opaque_value_error(at, "an integer")),
            other => Err(error(at, format!("expected an integer, found {}", other.description()))),
        }
    }

    /// The value as a known index or length.
    pub fn usize(&mut self, value: &Value, at: TokenSpan) -> Result<usize> {
        let integer = self.integer(value, at)?;
        usize::try_from(integer.value)
            .map_err(|_| error(at, format!("this is {}, which is no `usize`", integer.value)))
    }
}

/// The error for a constant whose value is required.
pub fn opaque_value_error(at: TokenSpan, what: &str) -> syn::Error {
    error(
        at,
        format!(
            "this constant is needed as {what}, but the macro does not see where it is defined: define it in \
             the body, or put it beside the model in a `#[dae] mod`"
        ),
    )
}
