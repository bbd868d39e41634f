//! Iterators: lazy, double-ended, advanced by `for` and by consuming methods.
//!
//! Closures run when an element is requested, in the order of Rust.

mod adapters;
mod ends;

use crate::language::evaluator::{Evaluator, TokenSpan, error, unsupported};
use crate::language::place::{Place, Projection};
use crate::language::value::{IntegerType, Value};
use std::rc::Rc;
use syn::Result;

/// An iterator.
#[derive(Clone, Debug)]
pub enum Iter {
    /// Elements `front..back` of an array.
    Elements { array: Rc<Vec<Value>>, front: usize, back: usize },
    /// `&mut` to elements `front..back` of an array.
    Places { place: Place, front: usize, back: usize },
    /// Integers `front..back`; without an end, `back` is `i128::MAX`.
    Range { front: i128, back: i128, ty: Option<IntegerType> },
    /// An iterator in a variable: `by_ref`, `&mut iterator`.
    ByRef(Place),
    /// The same value repeatedly.
    Repeat(Value),
    /// Calls a closure for each element.
    FromFn(Value),
    /// The next element, and a closure that computes its successor.
    Successors(Option<Box<Value>>, Value),
    /// Pairs.
    Zip(Box<Iter>, Box<Iter>),
    /// Pairs of the index and the element.
    Enumerate(Box<Iter>, usize),
    /// Elements mapped by a closure.
    Map(Box<Iter>, Value),
    /// Elements for which a closure holds.
    Filter(Box<Iter>, Value),
    /// The values of `Some` returned by a closure.
    FilterMap(Box<Iter>, Value),
    /// Elements while a closure holds; `None` afterwards.
    TakeWhile(Option<Box<Iter>>, Value),
    /// Elements from the first for which a closure does not hold; the closure is then dropped.
    SkipWhile(Box<Iter>, Option<Value>),
    /// Values while a closure returns `Some`; `None` afterwards.
    MapWhile(Option<Box<Iter>>, Value),
    /// A closure with a state, which copies of the iterator do not share.
    Scan { inner: Box<Iter>, state: Value, closure: Value },
    /// Reversed.
    Rev(Box<Iter>),
    /// The first elements.
    Take(Box<Iter>, usize),
    /// All but the first elements.
    Skip(Box<Iter>, usize),
    /// Every `step`-th element, starting with the first.
    StepBy { inner: Box<Iter>, step: usize, begun: bool },
    /// Two iterators in succession.
    Chain(Option<Box<Iter>>, Box<Iter>),
    /// The elements of nested iterators; the first and the last one are open.
    Flatten { inner: Box<Iter>, front: Option<Box<Iter>>, back: Option<Box<Iter>> },
    /// Repeated endlessly.
    Cycle { original: Box<Iter>, now: Box<Iter> },
    /// With the peeked element, if any.
    Peekable(Box<Iter>, Option<Option<Box<Value>>>),
    /// A closure that inspects each element.
    Inspect(Box<Iter>, Value),
}

impl Iter {
    /// An iterator over values.
    pub fn of(values: Vec<Value>) -> Iter {
        Iter::Elements { front: 0, back: values.len(), array: Rc::new(values) }
    }

    /// The number of remaining elements. An error if it is unknown before they are read.
    pub fn length(&self, evaluator: &mut Evaluator, at: TokenSpan) -> Result<usize> {
        Ok(match self {
            Iter::Elements { front, back, .. } | Iter::Places { front, back, .. } => {
                back.saturating_sub(*front)
            }
            Iter::Range { front, back, .. } => {
                usize::try_from(back.saturating_sub(*front).max(0)).unwrap_or(usize::MAX)
            }
            Iter::ByRef(place) => match evaluator.read(place, at)? {
                Value::Iterator(inner) => inner.length(evaluator, at)?,
                _ => 0,
            },
            Iter::Repeat(_) | Iter::Cycle { .. } => usize::MAX,
            Iter::Zip(a, b) => a.length(evaluator, at)?.min(b.length(evaluator, at)?),
            Iter::Enumerate(inner, _) | Iter::Map(inner, _) | Iter::Rev(inner) | Iter::Inspect(inner, _) => {
                inner.length(evaluator, at)?
            }
            Iter::Take(inner, left) => inner.length(evaluator, at)?.min(*left),
            Iter::Skip(inner, left) => inner.length(evaluator, at)?.saturating_sub(*left),
            Iter::StepBy { inner, step, begun } => {
                let length = inner.length(evaluator, at)?;
                if *begun { length / *step } else { length.div_ceil(*step) }
            }
            Iter::Chain(first, second) => {
                let first = match first {
                    Some(inner) => inner.length(evaluator, at)?,
                    None => 0,
                };
                first.saturating_add(second.length(evaluator, at)?)
            }
            _ => return Err(error(at, "the length of this iterator is not known before it is read")),
        })
    }
}

/// The content of an option that a closure returned.
pub(super) fn option_content(value: Value, at: TokenSpan) -> Result<Option<Value>> {
    match value {
        Value::Option(content) => Ok(content.map(|value| *value)),
        other => Err(error(at, format!("expected an `Option`, found {}", other.description()))),
    }
}

/// Whether a predicate holds, which must be known.
pub(super) fn holds(
    evaluator: &mut Evaluator,
    closure: &Value,
    value: Value,
    method: &str,
    at: TokenSpan,
) -> Result<bool> {
    match evaluator.call(closure, vec![value], at)? {
        Value::Bool(known) => Ok(known),
        Value::Condition(_) => Err(unsupported(at, format!("`{method}` by a comparison of model variables"))),
        other => Err(error(at, format!("expected a `bool`, found {}", other.description()))),
    }
}

/// `IntoIterator::into_iter`: arrays, ranges, iterators, `&mut` to arrays, options.
pub fn into_iter(evaluator: &mut Evaluator, value: Value, at: TokenSpan) -> Result<Iter> {
    match value {
        Value::Iterator(iterator) => Ok(*iterator),
        Value::Array(array) => Ok(Iter::Elements { front: 0, back: array.len(), array }),
        Value::Option(content) => Ok(Iter::of(content.map(|value| *value).into_iter().collect())),
        Value::Matrix(matrix) => Ok(Iter::of(matrix.elements.clone())),
        Value::Range(range) => {
            let Some(start) = &range.start else {
                return Err(error(at, "a range without a start is no iterator"));
            };
            let start = evaluator.integer(start, at)?;
            let (back, ty) = match &range.end {
                None => (i128::MAX, start.ty),
                Some(end) => {
                    let end = evaluator.integer(end, at)?;
                    (end.value.saturating_add(i128::from(range.inclusive)), start.ty.or(end.ty))
                }
            };
            Ok(Iter::Range { front: start.value, back, ty })
        }
        Value::Reference(place) => match evaluator.read(&place, at)? {
            Value::Array(array) => Ok(Iter::Places { place, front: 0, back: array.len() }),
            Value::Matrix(matrix) => element_places(evaluator, &place, matrix.rows, matrix.columns, at),
            Value::Iterator(_) => Ok(Iter::ByRef(place)),
            other => into_iter(evaluator, other, at),
        },
        other => Err(error(at, format!("{} is no iterator", other.description()))),
    }
}

/// `&mut` to each element of a matrix, in column-major order.
fn element_places(
    evaluator: &mut Evaluator,
    place: &Place,
    rows: usize,
    columns: usize,
    at: TokenSpan,
) -> Result<Iter> {
    let mut places = Vec::with_capacity(rows * columns);
    for column in 0..columns {
        for row in 0..rows {
            places.push(Value::Reference(evaluator.project(place, Projection::Element(row, column), at)?));
        }
    }
    Ok(Iter::of(places))
}
