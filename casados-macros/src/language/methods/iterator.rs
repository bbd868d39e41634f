//! Iterators: lazy, double-ended, pulled by `for` and by consuming methods.

use crate::language::evaluator::{At, Evaluator, error};
use crate::language::place::{Place, Projection};
use crate::language::value::Value;
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
    Range { front: i128, back: i128, ty: Option<crate::language::value::IntegerType> },
}

impl Iter {
    /// The next element from the front.
    pub fn next(&mut self, evaluator: &mut Evaluator, at: At) -> Result<Option<Value>> {
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
                Some(Value::Integer(crate::language::value::Integer { value: *front - 1, ty: *ty }))
            }
            _ => None,
        })
    }
}

/// `IntoIterator::into_iter`: arrays, ranges, iterators, `&mut` to arrays, options.
pub fn into_iter(evaluator: &mut Evaluator, value: Value, at: At) -> Result<Iter> {
    match value {
        Value::Iterator(iterator) => Ok(*iterator),
        Value::Array(array) => Ok(Iter::Elements { front: 0, back: array.len(), array }),
        Value::Range(range) => {
            let Some(start) = &range.start else {
                return Err(error(at, "a range without a start is no iterator"));
            };
            let start = evaluator.integer(start, at)?;
            let (back, ty) = match &range.end {
                None => (i128::MAX, start.ty),
                Some(end) => {
                    let end = evaluator.integer(end, at)?;
                    (end.value + i128::from(range.inclusive), start.ty.or(end.ty))
                }
            };
            Ok(Iter::Range { front: start.value, back, ty })
        }
        Value::Reference(place) => match evaluator.read(&place, at)? {
            Value::Array(array) => Ok(Iter::Places { place, front: 0, back: array.len() }),
            Value::Iterator(_) => Err(error(at, "not written yet")),
            other => into_iter(evaluator, other, at),
        },
        other => Err(error(at, format!("{} is no iterator", other.kind()))),
    }
}
