//! The interior-point method in given memory.

use super::Ipm;
use super::IpmOptions;
use super::kkt::dimensions::counts_with_all_bounds_soft;
use super::kkt::workspace::Workspace;
use crate::ocp::formulation::error::{OcpError, Part};
use crate::ocp::formulation::program::{Program, ends};
use crate::qp::interior::{Counts, Iterate};
use crate::qp::{Solution, StageDims};
use crate::scalar::Real;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;

impl<'a, T: Real> Ipm<T, &'a [StageDims], &'a mut [T], &'a mut [u32]> {
    /// Returns the lengths of the memory for numbers and for indices, given the number of finite
    /// bounds of variables and constraints (lower and upper ones counted separately), and of
    /// equations (pairs of equal bounds) except the initial state. They suffice for all bounds
    /// being soft, as in elastic mode.
    ///
    /// Periodic states and shared controls, which require the feature `alloc`, take
    /// [`InteriorPoint::memory_of_coupling`](crate::qp::InteriorPoint::memory_of_coupling) more
    /// numbers.
    #[must_use]
    pub const fn memory<P: Program<T>>(
        dims: &[StageDims],
        bounds: usize,
        equations: usize,
    ) -> (usize, usize) {
        let solution = Solution::<T, (), ()>::memory(dims);
        if solution == usize::MAX {
            return (usize::MAX, usize::MAX);
        }
        let [numbers, work, indices] = memory_lengths::<T>(dims, bounds, equations);
        (solution.saturating_mul(3).saturating_add(numbers).saturating_add(work), indices)
    }

    /// Creates a solver for problems of these dimensions with at most so many bounds and equations,
    /// in memory of the lengths that [`Ipm::memory`] returns.
    ///
    /// # Errors
    /// [`OcpError::Length`]
    pub fn in_memory<P: Program<T>>(
        dims: &'a [StageDims],
        bounds: usize,
        equations: usize,
        numbers: &'a mut [T],
        indices: &'a mut [u32],
    ) -> Result<Self, OcpError> {
        let (expected, of_indices) = Self::memory::<P>(dims, bounds, equations);
        for (expected, found) in [(expected, numbers.len()), (of_indices, indices.len())] {
            if found < expected {
                return Err(OcpError::Length { part: Part::Memory, stage: 0, expected, found });
            }
        }
        let length = Solution::<T, (), ()>::memory(dims);
        let [_, work, _] = memory_lengths::<T>(dims, bounds, equations);
        let (trial, rest) = numbers.split_at_mut_checked(length).unwrap_or_default();
        let (best, rest) = rest.split_at_mut_checked(length).unwrap_or_default();
        let (guess, rest) = rest.split_at_mut_checked(length).unwrap_or_default();
        // The rest is memory of couplings.
        let (work, numbers) = rest.split_at_mut_checked(work).unwrap_or_default();
        Ok(Self {
            options: IpmOptions::new::<T>(),
            trial_point: Solution::in_memory(dims, trial)?,
            best_iterate: Solution::in_memory(dims, best)?,
            guess: Solution::in_memory(dims, guess)?,
            kkt_numbers: numbers,
            kkt_indices: indices,
            workspace: work,
            #[cfg(feature = "alloc")]
            log: Vec::new(),
        })
    }
}

/// The lengths of Newton's equations, of the workspace, and of the indices.
const fn memory_lengths<T: Real>(dims: &[StageDims], bounds: usize, equations: usize) -> [usize; 3] {
    let counts = counts_with_all_bounds_soft(&Counts { lower: bounds, upper: 0, soft: 0, equations });
    let work = Workspace::<T>::length(dims, ends(dims), &counts);
    [Iterate::<T>::memory(dims, &counts) + equations, work, counts.indices()]
}
