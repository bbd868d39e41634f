//! Elements from the front or from the back.

use super::{Iter, adapters, option_content};
use crate::language::evaluator::{Evaluator, TokenSpan, error};
use crate::language::place::Projection;
use crate::language::value::{Integer, Value};
use syn::Result;

/// The end at which an element is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum IteratorEnd {
    Front,
    Back,
}

impl Iter {
    /// The next element from one of the ends.
    pub(super) fn pull(
        &mut self,
        end: IteratorEnd,
        evaluator: &mut Evaluator,
        at: TokenSpan,
    ) -> Result<Option<Value>> {
        match end {
            IteratorEnd::Front => self.next(evaluator, at),
            IteratorEnd::Back => self.next_back(evaluator, at),
        }
    }

    /// The next element from the front.
    pub fn next(&mut self, evaluator: &mut Evaluator, at: TokenSpan) -> Result<Option<Value>> {
        const FRONT: IteratorEnd = IteratorEnd::Front;
        evaluator.count_steps(1, at)?;
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
            Iter::ByRef(place) => adapters::by_ref(place, FRONT, evaluator, at)?,
            Iter::Repeat(value) => Some(value.clone()),
            Iter::FromFn(closure) => option_content(evaluator.call(closure, Vec::new(), at)?, at)?,
            Iter::Successors(now, closure) => adapters::successor(now, closure, evaluator, at)?,
            Iter::Zip(a, b) => match a.next(evaluator, at)? {
                None => None,
                Some(a) => b.next(evaluator, at)?.map(|b| Value::tuple(vec![a, b])),
            },
            Iter::Enumerate(inner, index) => inner.next(evaluator, at)?.map(|value| {
                *index += 1;
                Value::tuple(vec![Value::usize(*index - 1), value])
            }),
            Iter::Map(inner, closure) => adapters::map(inner, closure, FRONT, evaluator, at)?,
            Iter::Filter(inner, closure) => adapters::filter(inner, closure, FRONT, evaluator, at)?,
            Iter::FilterMap(inner, closure) => adapters::filter_map(inner, closure, FRONT, evaluator, at)?,
            Iter::TakeWhile(inner, closure) => adapters::take_while(inner, closure, evaluator, at)?,
            Iter::SkipWhile(inner, closure) => adapters::skip_while(inner, closure, evaluator, at)?,
            Iter::MapWhile(inner, closure) => adapters::map_while(inner, closure, evaluator, at)?,
            Iter::Scan { inner, state, closure } => match inner.next(evaluator, at)? {
                None => None,
                Some(value) => adapters::scan(state, closure, value, evaluator, at)?,
            },
            Iter::Rev(inner) => inner.next_back(evaluator, at)?,
            Iter::Take(_, 0) => None,
            Iter::Take(inner, left) => {
                *left -= 1;
                inner.next(evaluator, at)?
            }
            Iter::Skip(inner, left) => adapters::skip(inner, left, evaluator, at)?,
            Iter::StepBy { inner, step, begun } => adapters::step_by(inner, *step, begun, evaluator, at)?,
            Iter::Chain(first, second) => adapters::chain(first, second, evaluator, at)?,
            Iter::Flatten { inner, front, back } => {
                adapters::flatten(inner, [front, back], FRONT, evaluator, at)?
            }
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
            Iter::Inspect(inner, closure) => adapters::inspect(inner, closure, FRONT, evaluator, at)?,
        })
    }

    /// The next element from the back.
    pub fn next_back(&mut self, evaluator: &mut Evaluator, at: TokenSpan) -> Result<Option<Value>> {
        const BACK: IteratorEnd = IteratorEnd::Back;
        evaluator.count_steps(1, at)?;
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
            Iter::ByRef(place) => adapters::by_ref(place, BACK, evaluator, at)?,
            Iter::Repeat(value) => Some(value.clone()),
            Iter::Zip(a, b) => adapters::last_of_both(a, b, evaluator, at)?,
            Iter::Enumerate(inner, index) => {
                let length = inner.length(evaluator, at)?;
                inner
                    .next_back(evaluator, at)?
                    .map(|value| Value::tuple(vec![Value::usize(*index + length - 1), value]))
            }
            Iter::Map(inner, closure) => adapters::map(inner, closure, BACK, evaluator, at)?,
            Iter::Filter(inner, closure) => adapters::filter(inner, closure, BACK, evaluator, at)?,
            Iter::FilterMap(inner, closure) => adapters::filter_map(inner, closure, BACK, evaluator, at)?,
            Iter::Rev(inner) => inner.next(evaluator, at)?,
            Iter::Take(inner, left) => {
                // All values of `repeat` equal its last one.
                let endless = matches!(**inner, Iter::Repeat(_));
                let length = if endless { *left } else { inner.length(evaluator, at)? };
                for _ in *left..length {
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
                adapters::last_of_steps(inner, *step, *begun, evaluator, at)?
            }
            Iter::Chain(first, second) => match (second.next_back(evaluator, at)?, first) {
                (Some(value), _) => Some(value),
                (None, Some(inner)) => inner.next_back(evaluator, at)?,
                (None, None) => None,
            },
            Iter::Flatten { inner, front, back } => {
                adapters::flatten(inner, [back, front], BACK, evaluator, at)?
            }
            Iter::Inspect(inner, closure) => adapters::inspect(inner, closure, BACK, evaluator, at)?,
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
}
