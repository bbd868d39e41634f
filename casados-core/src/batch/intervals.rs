//! The inputs of a batch.

use super::error::{BatchError, Slice};
use crate::error::{Argument, Error};
use crate::finite::{check_input, check_model_input};
use crate::model::{Dae, VectorP, VectorU, VectorX, VectorZ};
use crate::scalar::Real;
use crate::shape::{Matrix, Plain, Shape, copy};
use bytemuck::Zeroable;

/// Many intervals of one model. Each slice has one element for each interval; all but `x0` may have
/// one element for all of them instead.
///
/// Programs set some fields and take the others from `..Default::default()`, which has empty
/// slices.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
///
/// let (x0, u) = ([vector![0.0, 0.0]; 8], [vector![1.0]; 8]);
/// // A control for each interval, one length for all of them.
/// let intervals = Intervals::<Cart> { x0: &x0, u: &u, h: &[0.1], ..Default::default() };
/// assert!(intervals.t0.is_empty()); // all begin at zero
/// ```
#[derive(Debug)]
pub struct Intervals<'a, M: Dae, T: Plain = f64> {
    /// Initial states, one for each interval: their number is the number of intervals.
    pub x0: &'a [VectorX<M, T>],
    /// Controls; may be empty if the model has none.
    pub u: &'a [VectorU<M, T>],
    /// Parameters; may be empty if the model has none.
    pub p: &'a [VectorP<M, T>],
    /// Lengths of the intervals.
    pub h: &'a [T],
    /// Times at the starts of the intervals; zero if empty.
    pub t0: &'a [T],
}

copy!(['a, M: Dae, T: Plain] Intervals<'a, M, T>);

/// No intervals; the default for fields that are not set.
impl<M: Dae, T: Plain> Default for Intervals<'_, M, T> {
    fn default() -> Self {
        Self { x0: &[], u: &[], p: &[], h: &[], t0: &[] }
    }
}

/// One interval.
#[derive(Debug)]
pub struct Interval<'a, M: Dae, T: Plain> {
    pub x0: &'a VectorX<M, T>,
    /// Empty if the model has none; so is `p`.
    pub u: &'a [T],
    pub p: &'a [T],
    pub h: T,
    pub t0: T,
    /// Empty without adjoints.
    pub lambda: &'a [T],
    /// Weights of the initial algebraic states; empty without them.
    pub nu: &'a [T],
}

copy!(['a, M: Dae, T: Plain] Interval<'a, M, T>);

/// The inputs of a call, with checked lengths.
pub struct BatchInputs<'a, M: Dae, T: Plain> {
    intervals: &'a Intervals<'a, M, T>,
    lambda: Option<&'a [VectorX<M, T>]>,
    nu: Option<&'a [VectorZ<M, T>]>,
}

impl<'a, M: Dae, T: Real> BatchInputs<'a, M, T> {
    /// Checks the lengths of all slices.
    ///
    /// # Errors
    /// [`BatchError::Length`]
    pub fn new(
        intervals: &'a Intervals<'a, M, T>,
        lambda: Option<&'a [VectorX<M, T>]>,
        nu: Option<&'a [VectorZ<M, T>]>,
        results: usize,
    ) -> Result<Self, BatchError> {
        let count = intervals.x0.len();
        let [no_u, no_p, no_z] = [M::Shape::NU, M::Shape::NP, M::Shape::NZ].map(|length| length == 0);
        for (argument, length, may_be_empty) in [
            (Argument::U, intervals.u.len(), no_u),
            (Argument::P, intervals.p.len(), no_p),
            (Argument::H, intervals.h.len(), false),
            (Argument::T, intervals.t0.len(), true),
            (Argument::Lambda, lambda.map_or(count, <[_]>::len), false),
            (Argument::Nu, nu.map_or(count, <[_]>::len), no_z),
        ] {
            if length != count && length != 1 && !(length == 0 && may_be_empty) {
                return Err(BatchError::Length {
                    slice: Slice::Argument(argument),
                    length,
                    intervals: count,
                });
            }
        }
        if results != count {
            return Err(BatchError::Length { slice: Slice::Results, length: results, intervals: count });
        }
        Ok(Self { intervals, lambda, nu })
    }

    /// Returns the number of intervals.
    pub fn len(&self) -> usize {
        self.intervals.x0.len()
    }

    /// Returns one interval.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]
    pub fn interval(&self, index: usize) -> Result<Interval<'a, M, T>, Error> {
        let Intervals { x0, u, p, h, t0 } = *self.intervals;
        let interval: Interval<'a, M, T> = Interval {
            x0: x0.get(index).ok_or(Error::NoResult)?,
            u: interval_element(u, index).map_or(&[], Matrix::as_slice),
            p: interval_element(p, index).map_or(&[], Matrix::as_slice),
            h: interval_element(h, index).map_or(T::ZERO, |h| *h),
            t0: interval_element(t0, index).map_or(T::ZERO, |t| *t),
            lambda: self
                .lambda
                .and_then(|lambda| interval_element(lambda, index))
                .map_or(&[], Matrix::as_slice),
            nu: self.nu.and_then(|nu| interval_element(nu, index)).map_or(&[], Matrix::as_slice),
        };
        check_model_input::<M, T>(Argument::X0, interval.x0.as_slice())?;
        check_model_input::<M, T>(Argument::U, interval.u)?;
        check_model_input::<M, T>(Argument::P, interval.p)?;
        check_input(Argument::H, &[interval.h])?;
        check_input(Argument::T, &[interval.t0])?;
        check_model_input::<M, T>(Argument::Lambda, interval.lambda)?;
        check_model_input::<M, T>(Argument::Nu, interval.nu)?;
        Ok(interval)
    }
}

/// Returns the element of an interval, or the element for all intervals.
fn interval_element<V>(slice: &[V], index: usize) -> Option<&V> {
    if slice.len() == 1 { slice.first() } else { slice.get(index) }
}

/// Converts elements to a vector.
pub fn vector<T: Plain, V: Matrix<T> + Zeroable>(elements: &[T]) -> V {
    let mut vector = V::zeroed();
    for (to, from) in vector.as_mut_slice().iter_mut().zip(elements) {
        *to = *from;
    }
    vector
}
