//! What a batch is given.

use super::error::{BatchError, Slice};
use crate::error::{Argument, Error};
use crate::finite::{check_input, check_model_input};
use crate::model::{Dae, VectorP, VectorU, VectorX, VectorZ};
use crate::scalar::Real;
use crate::shape::{Matrix, Plain, Shape, copy};
use bytemuck::Zeroable;

/// Many intervals of one model: one element of each slice for each interval. Of all but `x0` there
/// may be one element for all of them instead.
///
/// What a program says begins with `..Default::default()`, which is no interval at all.
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
    /// States at the start: as many as there are intervals.
    pub x0: &'a [VectorX<M, T>],
    /// Controls; may be empty if the model has none.
    pub u: &'a [VectorU<M, T>],
    /// Parameters; may be empty if the model has none.
    pub p: &'a [VectorP<M, T>],
    /// Lengths of the intervals.
    pub h: &'a [T],
    /// Times at their starts; zero if empty.
    pub t0: &'a [T],
}

copy!(['a, M: Dae, T: Plain] Intervals<'a, M, T>);

/// No interval at all: what is there is set in it.
impl<M: Dae, T: Plain> Default for Intervals<'_, M, T> {
    fn default() -> Self {
        Self { x0: &[], u: &[], p: &[], h: &[], t0: &[] }
    }
}

/// One of them.
#[derive(Debug)]
pub struct Interval<'a, M: Dae, T: Plain> {
    pub x0: &'a VectorX<M, T>,
    /// Empty if the model has none, as `p`.
    pub u: &'a [T],
    pub p: &'a [T],
    pub h: T,
    pub t0: T,
    /// Empty if nobody asks for adjoints.
    pub lambda: &'a [T],
    /// Weights of the algebraic states at the start; empty if there are none.
    pub nu: &'a [T],
}

copy!(['a, M: Dae, T: Plain] Interval<'a, M, T>);

/// All that a call was given, of the right lengths.
pub struct BatchInputs<'a, M: Dae, T: Plain> {
    intervals: &'a Intervals<'a, M, T>,
    lambda: Option<&'a [VectorX<M, T>]>,
    nu: Option<&'a [VectorZ<M, T>]>,
}

impl<'a, M: Dae, T: Real> BatchInputs<'a, M, T> {
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

    /// How many intervals there are.
    pub fn len(&self) -> usize {
        self.intervals.x0.len()
    }

    /// One interval.
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

/// The element of an interval, which may be that of all.
fn interval_element<V>(slice: &[V], index: usize) -> Option<&V> {
    if slice.len() == 1 { slice.first() } else { slice.get(index) }
}

/// A vector of these elements.
pub fn vector<T: Plain, V: Matrix<T> + Zeroable>(elements: &[T]) -> V {
    let mut vector = V::zeroed();
    for (to, from) in vector.as_mut_slice().iter_mut().zip(elements) {
        *to = *from;
    }
    vector
}
