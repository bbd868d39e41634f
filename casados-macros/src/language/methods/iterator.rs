//! Iterators: lazy, double-ended, pulled by `for` and by consuming methods.
//!
//! Closures run when an element is pulled, in the order in which Rust runs them.

use crate::language::evaluator::{At, Evaluator, error, unsupported};
use crate::language::place::{Place, Projection};
use crate::language::value::{Integer, IntegerType, Value};
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
    /// The same value for ever.
    Repeat(Value),
    /// Calls a closure for each element.
    FromFn(Value),
    /// The next element, and a closure that makes the one after it.
    Successors(Option<Box<Value>>, Value),
    /// Pairs.
    Zip(Box<Iter>, Box<Iter>),
    /// Pairs of the index and the element.
    Enumerate(Box<Iter>, usize),
    /// Elements through a closure.
    Map(Box<Iter>, Value),
    /// Elements for which a closure holds.
    Filter(Box<Iter>, Value),
    /// The elements that a closure makes some of.
    FilterMap(Box<Iter>, Value),
    /// As long as a closure holds; `None` once it did not.
    TakeWhile(Option<Box<Iter>>, Value),
    /// From where a closure does not hold; the closure is gone then.
    SkipWhile(Box<Iter>, Option<Value>),
    /// As long as a closure makes some; `None` once it did not.
    MapWhile(Option<Box<Iter>>, Value),
    /// A closure with a state.
    Scan { inner: Box<Iter>, state: Place, closure: Value },
    /// From the back.
    Rev(Box<Iter>),
    /// The first so many.
    Take(Box<Iter>, usize),
    /// Without the first so many.
    Skip(Box<Iter>, usize),
    /// Every `step`-th; the first one comes at once.
    StepBy { inner: Box<Iter>, step: usize, begun: bool },
    /// One after the other.
    Chain(Option<Box<Iter>>, Box<Iter>),
    /// The elements of the elements, of which the first and the last are open.
    Flatten { inner: Box<Iter>, front: Option<Box<Iter>>, back: Option<Box<Iter>> },
    /// Again and again.
    Cycle { original: Box<Iter>, now: Box<Iter> },
    /// With a look at the next one.
    Peekable(Box<Iter>, Option<Option<Box<Value>>>),
    /// A closure that only looks.
    Inspect(Box<Iter>, Value),
}

impl Iter {
    /// All of some values.
    pub fn of(values: Vec<Value>) -> Iter {
        Iter::Elements { front: 0, back: values.len(), array: Rc::new(values) }
    }

    /// The next element from the front.
    pub fn next(&mut self, evaluator: &mut Evaluator, at: At) -> Result<Option<Value>> {
        evaluator.tick(1, at)?;
        Ok(match self {
            Iter::Elements { array, front, back } if *front < *back => {
                *front += 1;
                Some(array[*front - 1].clone())
            }
            Iter::Places { place, front, back } if *front < *back => {
                *front += 1;
                Some(Value::Reference(evaluator.project(place, Projection::Index(*front - 1), at)?))
            }
            Iter::Range { front, back, ty } if *front < *back => {
                *front += 1;
                Some(Value::Integer(Integer { value: *front - 1, ty: *ty }))
            }
            Iter::Elements { .. } | Iter::Places { .. } | Iter::Range { .. } => None,
            Iter::ByRef(place) => by_ref(evaluator, place, at, |inner, evaluator| inner.next(evaluator, at))?,
            Iter::Repeat(value) => Some(value.clone()),
            Iter::FromFn(closure) => {
                let value = evaluator.call(closure, Vec::new(), at)?;
                known_option(value, at)?
            }
            Iter::Successors(now, closure) => match now.take() {
                None => None,
                Some(value) => {
                    let next = evaluator.call(closure, vec![(*value).clone()], at)?;
                    *now = known_option(next, at)?.map(Box::new);
                    Some(*value)
                }
            },
            Iter::Zip(a, b) => match a.next(evaluator, at)? {
                None => None,
                Some(a) => b.next(evaluator, at)?.map(|b| Value::tuple(vec![a, b])),
            },
            Iter::Enumerate(inner, index) => inner.next(evaluator, at)?.map(|value| {
                *index += 1;
                Value::tuple(vec![Value::usize(*index - 1), value])
            }),
            Iter::Map(inner, closure) => match inner.next(evaluator, at)? {
                None => None,
                Some(value) => Some(evaluator.call(closure, vec![value], at)?),
            },
            Iter::Filter(inner, closure) => loop {
                let Some(value) = inner.next(evaluator, at)? else { break None };
                if holds(evaluator, closure, value.clone(), "filter", at)? {
                    break Some(value);
                }
            },
            Iter::FilterMap(inner, closure) => loop {
                let Some(value) = inner.next(evaluator, at)? else { break None };
                let value = evaluator.call(closure, vec![value], at)?;
                if let Some(value) = known_option(value, at)? {
                    break Some(value);
                }
            },
            Iter::TakeWhile(inner, closure) => match inner {
                None => None,
                Some(open) => match open.next(evaluator, at)? {
                    Some(value) if holds(evaluator, closure, value.clone(), "take_while", at)? => Some(value),
                    _ => {
                        *inner = None;
                        None
                    }
                },
            },
            Iter::SkipWhile(inner, closure) => loop {
                let Some(value) = inner.next(evaluator, at)? else { break None };
                match closure {
                    Some(skip) if holds(evaluator, skip, value.clone(), "skip_while", at)? => {}
                    _ => {
                        *closure = None;
                        break Some(value);
                    }
                }
            },
            Iter::MapWhile(inner, closure) => match inner {
                None => None,
                Some(open) => {
                    let value = match open.next(evaluator, at)? {
                        None => None,
                        Some(value) => known_option(evaluator.call(closure, vec![value], at)?, at)?,
                    };
                    if value.is_none() {
                        *inner = None;
                    }
                    value
                }
            },
            Iter::Scan { inner, state, closure } => match inner.next(evaluator, at)? {
                None => None,
                Some(value) => {
                    let arguments = vec![Value::Reference(state.clone()), value];
                    known_option(evaluator.call(closure, arguments, at)?, at)?
                }
            },
            Iter::Rev(inner) => inner.next_back(evaluator, at)?,
            Iter::Take(_, 0) => None,
            Iter::Take(inner, left) => {
                *left -= 1;
                inner.next(evaluator, at)?
            }
            Iter::Skip(inner, left) => {
                while *left > 0 {
                    *left -= 1;
                    if inner.next(evaluator, at)?.is_none() {
                        *left = 0;
                    }
                }
                inner.next(evaluator, at)?
            }
            Iter::StepBy { inner, step, begun } => {
                if std::mem::replace(begun, true) {
                    for _ in 1..*step {
                        if inner.next(evaluator, at)?.is_none() {
                            return Ok(None);
                        }
                    }
                }
                inner.next(evaluator, at)?
            }
            Iter::Chain(first, second) => {
                if let Some(inner) = first {
                    if let Some(value) = inner.next(evaluator, at)? {
                        return Ok(Some(value));
                    }
                    *first = None;
                }
                second.next(evaluator, at)?
            }
            Iter::Flatten { inner, front, back } => loop {
                if let Some(open) = front {
                    if let Some(value) = open.next(evaluator, at)? {
                        break Some(value);
                    }
                    *front = None;
                }
                match inner.next(evaluator, at)? {
                    Some(value) => *front = Some(Box::new(into_iter(evaluator, value, at)?)),
                    None => match back {
                        Some(open) => break open.next(evaluator, at)?,
                        None => break None,
                    },
                }
            },
            Iter::Cycle { original, now } => match now.next(evaluator, at)? {
                Some(value) => Some(value),
                None => {
                    *now = original.clone();
                    now.next(evaluator, at)?
                }
            },
            Iter::Peekable(inner, peeked) => match peeked.take() {
                Some(value) => value.map(|value| *value),
                None => inner.next(evaluator, at)?,
            },
            Iter::Inspect(inner, closure) => match inner.next(evaluator, at)? {
                None => None,
                Some(value) => {
                    evaluator.call(closure, vec![value.clone()], at)?;
                    Some(value)
                }
            },
        })
    }

    /// The next element from the back.
    pub fn next_back(&mut self, evaluator: &mut Evaluator, at: At) -> Result<Option<Value>> {
        evaluator.tick(1, at)?;
        Ok(match self {
            Iter::Elements { array, front, back } if *front < *back => {
                *back -= 1;
                Some(array[*back].clone())
            }
            Iter::Places { place, front, back } if *front < *back => {
                *back -= 1;
                Some(Value::Reference(evaluator.project(place, Projection::Index(*back), at)?))
            }
            Iter::Range { front, back, ty } if *front < *back => {
                if *back == i128::MAX {
                    return Err(error(at, "a range without an end has no last element"));
                }
                *back -= 1;
                Some(Value::Integer(Integer { value: *back, ty: *ty }))
            }
            Iter::Elements { .. } | Iter::Places { .. } | Iter::Range { .. } => None,
            Iter::ByRef(place) => {
                by_ref(evaluator, place, at, |inner, evaluator| inner.next_back(evaluator, at))?
            }
            Iter::Repeat(value) => Some(value.clone()),
            Iter::Zip(a, b) => {
                let (left, right) = (a.length(evaluator, at)?, b.length(evaluator, at)?);
                for _ in right..left {
                    a.next_back(evaluator, at)?;
                }
                for _ in left..right {
                    b.next_back(evaluator, at)?;
                }
                match (a.next_back(evaluator, at)?, b.next_back(evaluator, at)?) {
                    (Some(a), Some(b)) => Some(Value::tuple(vec![a, b])),
                    _ => None,
                }
            }
            Iter::Enumerate(inner, index) => {
                let length = inner.length(evaluator, at)?;
                inner
                    .next_back(evaluator, at)?
                    .map(|value| Value::tuple(vec![Value::usize(*index + length - 1), value]))
            }
            Iter::Map(inner, closure) => match inner.next_back(evaluator, at)? {
                None => None,
                Some(value) => Some(evaluator.call(closure, vec![value], at)?),
            },
            Iter::Filter(inner, closure) => loop {
                let Some(value) = inner.next_back(evaluator, at)? else { break None };
                if holds(evaluator, closure, value.clone(), "filter", at)? {
                    break Some(value);
                }
            },
            Iter::FilterMap(inner, closure) => loop {
                let Some(value) = inner.next_back(evaluator, at)? else { break None };
                let value = evaluator.call(closure, vec![value], at)?;
                if let Some(value) = known_option(value, at)? {
                    break Some(value);
                }
            },
            Iter::Rev(inner) => inner.next(evaluator, at)?,
            Iter::Take(inner, left) => {
                for _ in *left..inner.length(evaluator, at)? {
                    inner.next_back(evaluator, at)?;
                }
                *left = left.saturating_sub(1);
                inner.next_back(evaluator, at)?
            }
            Iter::Skip(inner, left) => {
                if inner.length(evaluator, at)? <= *left {
                    None
                } else {
                    inner.next_back(evaluator, at)?
                }
            }
            Iter::StepBy { inner, step, begun } => {
                let length = inner.length(evaluator, at)?;
                // The elements that come are those at `first`, `first + step`, ..
                let first = if *begun { *step - 1 } else { 0 };
                if length <= first {
                    return Ok(None);
                }
                for _ in 0..(length - 1 - first) % *step {
                    inner.next_back(evaluator, at)?;
                }
                inner.next_back(evaluator, at)?
            }
            Iter::Chain(first, second) => match (second.next_back(evaluator, at)?, first) {
                (Some(value), _) => Some(value),
                (None, Some(inner)) => inner.next_back(evaluator, at)?,
                (None, None) => None,
            },
            Iter::Flatten { inner, front, back } => loop {
                if let Some(open) = back {
                    if let Some(value) = open.next_back(evaluator, at)? {
                        break Some(value);
                    }
                    *back = None;
                }
                match inner.next_back(evaluator, at)? {
                    Some(value) => *back = Some(Box::new(into_iter(evaluator, value, at)?)),
                    None => match front {
                        Some(open) => break open.next_back(evaluator, at)?,
                        None => break None,
                    },
                }
            },
            Iter::Inspect(inner, closure) => match inner.next_back(evaluator, at)? {
                None => None,
                Some(value) => {
                    evaluator.call(closure, vec![value.clone()], at)?;
                    Some(value)
                }
            },
            Iter::FromFn(_)
            | Iter::Successors(..)
            | Iter::TakeWhile(..)
            | Iter::SkipWhile(..)
            | Iter::MapWhile(..)
            | Iter::Scan { .. }
            | Iter::Cycle { .. }
            | Iter::Peekable(..) => return Err(error(at, "this iterator cannot be read from the back")),
        })
    }

    /// How many elements are left. An error if that is known only after they are read.
    pub fn length(&self, evaluator: &mut Evaluator, at: At) -> Result<usize> {
        Ok(match self {
            Iter::Elements { front, back, .. } | Iter::Places { front, back, .. } => {
                back.saturating_sub(*front)
            }
            Iter::Range { front, back, .. } => usize::try_from((*back - *front).max(0)).unwrap_or(usize::MAX),
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

/// Reads an iterator in a variable, and writes back what is left of it.
fn by_ref(
    evaluator: &mut Evaluator,
    place: &Place,
    at: At,
    read: impl FnOnce(&mut Iter, &mut Evaluator) -> Result<Option<Value>>,
) -> Result<Option<Value>> {
    let Value::Iterator(mut inner) = evaluator.read(place, at)? else {
        return Err(error(at, "this is no iterator any more"));
    };
    let value = read(&mut inner, evaluator)?;
    evaluator.write(place, Value::Iterator(inner), at)?;
    Ok(value)
}

/// The content of an option that a closure returned.
pub(super) fn known_option(value: Value, at: At) -> Result<Option<Value>> {
    match value {
        Value::Option(content) => Ok(content.map(|value| *value)),
        other => Err(error(at, format!("expected an `Option`, found {}", other.kind()))),
    }
}

/// Whether a predicate holds: it must be known.
pub(super) fn holds(
    evaluator: &mut Evaluator,
    closure: &Value,
    value: Value,
    method: &str,
    at: At,
) -> Result<bool> {
    match evaluator.call(closure, vec![value], at)? {
        Value::Bool(known) => Ok(known),
        Value::Condition(_) => {
            Err(unsupported(at, format!("`{method}` by a comparison of model quantities")))
        }
        other => Err(error(at, format!("expected a `bool`, found {}", other.kind()))),
    }
}

/// `IntoIterator::into_iter`: arrays, ranges, iterators, `&mut` to arrays, options.
pub fn into_iter(evaluator: &mut Evaluator, value: Value, at: At) -> Result<Iter> {
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
            Value::Matrix(matrix) => places(evaluator, &place, matrix.rows, matrix.columns, at),
            Value::Iterator(_) => Ok(Iter::ByRef(place)),
            other => into_iter(evaluator, other, at),
        },
        other => Err(error(at, format!("{} is no iterator", other.kind()))),
    }
}

/// `&mut` to each element of a matrix, column after column.
fn places(evaluator: &mut Evaluator, place: &Place, rows: usize, columns: usize, at: At) -> Result<Iter> {
    let mut places = Vec::with_capacity(rows * columns);
    for column in 0..columns {
        for row in 0..rows {
            places.push(Value::Reference(evaluator.project(place, Projection::Element(row, column), at)?));
        }
    }
    Ok(Iter::of(places))
}
