//! Elastic mode: bounds of states and constraints get linear penalties, so that the QP is feasible.

use crate::ocp::formulation::instance::{InitialState, Ocp};
use crate::ocp::formulation::program::Program;
pub(in crate::ocp) use crate::qp::Violation as Worst;
use crate::qp::{StageDims, largest_violation, padded_len};
use crate::scalar::Real;

/// The length of the memory for the linear penalties.
pub(in crate::ocp) const fn penalty_memory_len(dims: &[StageDims]) -> usize {
    let (mut length, mut rest) = (0_usize, dims);
    while let Some((first, others)) = rest.split_first() {
        length = length.saturating_add(row_count(*first).saturating_mul(2));
        rest = others;
    }
    length
}

const fn row_count(dims: StageDims) -> usize {
    dims.nx.saturating_add(dims.nu).saturating_add(dims.ng)
}

impl<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Saves all linear penalties, as pairs of lower and upper bound.
    pub(in crate::ocp) fn save_penalties(&self, saved_penalties: &mut [T]) {
        let mut pairs = saved_penalties.as_chunks_mut().0.iter_mut();
        for stage in self.qp().stages() {
            for bounds in [stage.x_bounds(), stage.u_bounds(), stage.g_bounds()] {
                let penalties = bounds.lower_linear.iter().zip(bounds.upper_linear);
                for ((&lower, &upper), pair) in penalties.zip(&mut pairs) {
                    *pair = [lower, upper];
                }
            }
        }
    }

    /// Restores the saved penalties. With an `elastic_penalty` the infinite ones of constraints,
    /// and of states except the initial one, become `elastic_penalty / unit` of the row (or
    /// `elastic_penalty`, without units).
    pub(in crate::ocp) fn set_penalties(
        &mut self,
        saved_penalties: &[T],
        elastic_penalty: Option<T>,
        units: &[T],
    ) {
        let mut pairs = saved_penalties.as_chunks().0.iter();
        let mut row = 0;
        for (k, mut stage) in self.qp.stages_mut().enumerate() {
            let StageDims { nx, nu, ng } = stage.dims();
            let ld = padded_len::<T>(nx + nu);
            for (kind, begin) in [row, row + nx, row + ld].into_iter().enumerate() {
                let bounds = match kind {
                    0 => stage.x_bounds_mut(),
                    1 => stage.u_bounds_mut(),
                    _ => stage.g_bounds_mut(),
                };
                let stage_penalty = elastic_penalty.filter(|_| kind == 2 || (kind == 0 && k > 0));
                let penalties = bounds.lower_linear.iter_mut().zip(bounds.upper_linear);
                for (i, ((lower, upper), &[below, above])) in penalties.zip(&mut pairs).enumerate() {
                    let row_penalty =
                        stage_penalty.map(|e| e / units.get(begin + i).copied().unwrap_or(T::ONE));
                    let elastic_or_given =
                        |given: T| row_penalty.filter(|_| !given.is_finite()).unwrap_or(given);
                    (*lower, *upper) = (elastic_or_given(below), elastic_or_given(above));
                }
            }
            row += ld + padded_len::<T>(ng);
        }
    }

    /// Sets the linear penalties of all inequalities to zero; equations keep theirs.
    pub(in crate::ocp) fn ignore_inequalities(&mut self) {
        for mut stage in self.qp.stages_mut() {
            for kind in 0..3 {
                let bounds = match kind {
                    0 => stage.x_bounds_mut(),
                    1 => stage.u_bounds_mut(),
                    _ => stage.g_bounds_mut(),
                };
                let penalties = bounds.lower_linear.iter_mut().zip(bounds.upper_linear);
                let limits = bounds.lower.iter().zip(&*bounds.upper);
                for ((below, above), _) in penalties.zip(limits).filter(|(_, (lower, upper))| lower < upper) {
                    (*below, *above) = (T::ZERO, T::ZERO);
                }
            }
        }
    }

    /// Returns the largest violation of a bound that is hard according to the saved penalties, in
    /// units if there are any, and the unscaled sum of these violations.
    pub(in crate::ocp) fn largest_hard_violation(
        &self,
        saved_penalties: &[T],
        units: &[T],
    ) -> (Option<Worst>, f64) {
        let mut pairs = saved_penalties.as_chunks().0.iter();
        let fixed = self.initial_state == InitialState::Fixed;
        largest_violation(self.qp(), self.iterate.variables_and_costates().0, units, |place, row| {
            let given = pairs.next().copied().unwrap_or([T::ZERO; 2]);
            if fixed && place.stage == 0 && row < place.nx { [T::ZERO; 2] } else { given }
        })
    }
}
