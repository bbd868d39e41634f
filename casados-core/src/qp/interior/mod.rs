//! The library's own solver: a primal-dual interior point with Mehrotra's predictor and corrector, whose linear systems
//! are solved by a Riccati recursion.

mod active;
mod coupling;
mod kernels;
mod newton;
mod options;
mod riccati;
mod run;
mod sides;
mod store;
mod symmetric;
mod vector;

pub(crate) use kernels::{
    Columns, add_symmetric, add_transposed, scale, splat, subtract, subtract_column, symmetric,
};
#[cfg(feature = "alloc")]
pub(super) use kernels::{MORE, Part, Source, product};
pub use options::InteriorPointOptions;
pub use store::Store;
pub(crate) use coupling::{Coupling, last_state};
pub(crate) use newton::{Iterate, Largest};
pub(crate) use riccati::First;
pub(crate) use sides::{Counts, Penalties, Sides, count, is_first_fixed, set};
pub(crate) use vector::dot;

use super::check::check_all_bounds;
use super::error::{Field, QpError};
use super::layout::StageDims;
use super::problem::QpView;
use super::solution::SolutionView;
use super::solver::{QpSolver, Start};
use super::statistics::Statistics;
use crate::scalar::Real;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;
use core::marker::PhantomData;
use run::{Limits, Run};

/// An interior point that exploits the structure of optimal control.
///
/// Each iteration costs one Riccati factorisation, `O(N (nx + nu)³)`, and two solves. With the feature `alloc` its memory is
/// on the heap, and is allocated by the first call and by calls with larger problems only. Elsewhere see
/// [`InteriorPoint::in_memory`].
///
/// A warm start first takes the bounds with multipliers for the active ones, and corrects this set by semismooth Newton steps
/// (Hintermüller, Ito, Kunisch, "The primal-dual active set strategy as a semismooth Newton method", SIAM J. Optim. 13, 2002): for a
/// problem like the last one a single factorisation is enough. Where
/// [`active_sets`](InteriorPointOptions::active_sets) of them are not, the interior point follows.
///
/// Violated bounds of an infeasible problem are found by solving it once more with all bounds soft.
#[derive(Clone, Debug)]
pub struct InteriorPoint<T, N, I> {
    /// Options, which may be changed between calls.
    pub options: InteriorPointOptions,
    /// A tolerance above that of the options is asked for.
    relaxed: T,
    numbers: N,
    indices: I,
    number: PhantomData<T>,
}

/// An interior point with its memory on the heap.
#[cfg(feature = "alloc")]
pub type HeapInteriorPoint<T = f64> = InteriorPoint<T, Vec<T>, Vec<u32>>;

#[cfg(feature = "alloc")]
impl<T: Real> HeapInteriorPoint<T> {
    /// A solver without memory: the first call allocates it.
    #[must_use]
    pub fn new() -> Self {
        Self::in_memory(Vec::new(), Vec::new())
    }
}

#[cfg(feature = "alloc")]
impl<T: Real> Default for HeapInteriorPoint<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real, N, I> InteriorPoint<T, N, I> {
    /// How many numbers and indices the solver takes for a problem with so many finite bounds (each side for itself), soft
    /// ones among them, and equations (pairs of equal hard bounds) beside the state at the start.
    ///
    /// To locate what makes a problem infeasible it takes as much as if all were soft.
    #[must_use]
    pub const fn memory(dims: &[StageDims], bounds: usize, soft: usize, equations: usize) -> (usize, usize) {
        let counts = Counts { lower: bounds, upper: 0, soft, equations };
        (Iterate::<T>::memory(dims, &counts), counts.indices())
    }
}

impl<T: Real, N: Store<T>, I: Store<u32>> InteriorPoint<T, N, I> {
    /// A solver in given memory, of the lengths that [`InteriorPoint::memory`] tells.
    pub fn in_memory(numbers: N, indices: I) -> Self {
        Self {
            options: InteriorPointOptions::new::<T>(),
            relaxed: T::ZERO,
            numbers,
            indices,
            number: PhantomData,
        }
    }

    /// One run of the method.
    fn run(
        &mut self,
        qp: QpView<'_, T>,
        penalties: Penalties<T>,
        start: Start,
        solution: &mut SolutionView<'_, T>,
    ) -> Result<Statistics, QpError> {
        let fixed = is_first_fixed(qp);
        let counts = count(qp, fixed, penalties);
        let length = Iterate::<T>::memory(qp.dims, &counts);
        let mut numbers = self.numbers.at_least(length, Field::Numbers)?;
        let mut indices = self.indices.at_least(counts.indices(), Field::Indices)?;
        numbers.fill(T::ZERO);
        let sides = Sides::list(qp, fixed, penalties, counts, &mut numbers, &mut indices);
        let first = if fixed { First::Fixed } else { First::Free };
        let mut iterate = Iterate::new(qp, first, sides, &mut numbers);
        let mut result = Ok(Statistics::default());
        let scale = if let Penalties::Elastic(weight) = penalties { weight } else { T::ONE };
        T::registers(Run {
            iterate: &mut iterate,
            options: &self.options,
            limits: Limits::new(&self.options, self.relaxed, scale),
            start,
            scale,
            solution,
            result: &mut result,
        });
        result
    }

    /// The bound that is violated most where all together are violated least.
    fn locate(&mut self, qp: QpView<'_, T>, solution: &mut SolutionView<'_, T>) -> Option<QpError> {
        // Violations have to cost more than anything else could gain.
        let largest = |all: &[T]| all.iter().fold(0.0, |m: f64, x| m.max(x.to_f64().abs()));
        let gradients = qp.stages().map(|s| largest(s.gradient_x()).max(largest(s.gradient_u())));
        let weight = 1e4 * (1.0 + gradients.fold(0.0, f64::max));
        let _ = self.run(qp, Penalties::Elastic(T::from_f64(weight)), Start::Cold, solution);
        run::worst(qp, solution, 1e2 * self.options.tolerance)
    }
}

impl<T: Real, N: Store<T>, I: Store<u32>> QpSolver<T> for InteriorPoint<T, N, I> {
    fn solve(
        &mut self,
        qp: QpView<'_, T>,
        start: Start,
        mut solution: SolutionView<'_, T>,
    ) -> Result<Statistics, QpError> {
        check_all_bounds(qp)?;
        solution.fits(qp)?;
        let result = self.run(qp, Penalties::Given, start, &mut solution);
        match result {
            // A number that is not finite is found here, not in every call.
            Err(_) if super::check::check(qp).is_err() => super::check::check(qp).and(result),
            Err(QpError::MaxIterations { .. } | QpError::Stalled { .. }) if self.options.locate => {
                match self.locate(qp, &mut solution) {
                    Some(infeasible) => Err(infeasible),
                    None => {
                        let _ = self.run(qp, Penalties::Given, start, &mut solution);
                        result
                    }
                }
            }
            result => result,
        }
    }

    fn relax(&mut self, tolerance: f64) {
        self.relaxed = T::from_f64(tolerance);
    }
}
