//! Degenerate start: the gradient of a violated constraint vanishes, so that its linearisation has
//! no solution, as for `u₁² + u₂² = 1` at `u = 0`.

use super::advanced::StartOptions;
use crate::linalg::dot;
use crate::ocp::formulation::instance::{InitialState, Ocp};
use crate::ocp::formulation::program::Program;
use crate::qp::{Bounds, Solution, StageDims, StageOffsetsIter, part};
use crate::scalar::Real;

/// The variables that are perturbed.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum PerturbedVariables {
    Controls,
    /// All states except a fixed initial state.
    States,
}

impl<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Whether the gradient of a violated constraint vanishes at the iterate. The QP must be
    /// written there.
    pub(super) fn has_vanishing_gradient(&self, vanishing_gradient: f64) -> bool {
        let (qp, (v, _)) = (self.qp.view(), self.iterate.variables_and_costates());
        StageOffsetsIter::<T>::new(qp.dims).zip(qp.stages()).any(|(place, stage)| {
            let (view, stage_variables) = (stage.arrays(), part(v, place.v, place.ld));
            let Bounds { lower, upper, .. } = stage.g_bounds();
            lower.iter().zip(upper).enumerate().any(|(i, (&lower, &upper))| {
                let row = part(view.matrix, (place.next + i) * place.ld, place.ld);
                let value = dot(row, stage_variables);
                let violation = (lower - value).max(value - upper);
                let changes = row.iter().zip(stage_variables).map(|(&g, &v)| g.abs() * v.abs().max(T::ONE));
                let largest = changes.fold(T::ZERO, |largest, change| largest.max(change));
                violation > T::ZERO && largest <= T::from_f64(vanishing_gradient) * violation
            })
        })
    }

    /// Perturbs variables of the iterate within their bounds, equally at all stages: shared
    /// controls remain equal.
    pub(super) fn perturb_variables(&mut self, which: PerturbedVariables, options: &StartOptions) {
        let fixed = self.initial_state == InitialState::Fixed;
        let Self { qp, iterate, .. } = self;
        for (k, stage) in qp.view().stages().enumerate() {
            let Some(point) = iterate.stage_mut(k) else { return };
            let (values, bounds) = match which {
                PerturbedVariables::Controls => (point.u, stage.u_bounds()),
                PerturbedVariables::States if k == 0 && fixed => continue,
                PerturbedVariables::States => (point.x, stage.x_bounds()),
            };
            let limits = bounds.lower.iter().zip(bounds.upper);
            for (i, (value, (&lower, &upper))) in values.iter_mut().zip(limits).enumerate() {
                let relative = T::from_f64(options.relative_perturbation / (i + 1) as f64);
                let size = relative * value.abs().max(T::ONE);
                *value = if *value + size <= upper { *value + size } else { (*value - size).max(lower) };
            }
        }
    }

    /// Perturbs the iterate, where the QP was written, until no gradient of a violated constraint
    /// vanishes. Returns whether the iterate has been perturbed; otherwise the iterate is restored
    /// from `copy`.
    ///
    /// # Errors
    /// The error of the linearisation at the iterate.
    pub(super) fn leave_degenerate_start<E>(
        &mut self,
        copy: &mut Solution<T, D, M>,
        mut linearise: impl FnMut(&mut Self) -> Result<(), E>,
        options: &StartOptions,
    ) -> Result<bool, E> {
        if !self.has_vanishing_gradient(options.vanishing_gradient) {
            return Ok(false);
        }
        copy.copy_from(&self.iterate);
        for which in [PerturbedVariables::Controls, PerturbedVariables::States] {
            self.perturb_variables(which, options);
            self.equalise_shared_controls();
            self.equalise_periodic_states();
            if linearise(self).is_ok() && !self.has_vanishing_gradient(options.vanishing_gradient) {
                return Ok(true);
            }
        }
        self.iterate.copy_from(copy);
        linearise(self).map(|()| false)
    }
}
