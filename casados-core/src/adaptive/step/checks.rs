//! Checks of a step: a finite Jacobian, convergence, and a minimum step size.

use super::crossing::shortest_step;
use super::state::StepState;
use super::*;
use crate::error::Unsettled;
use crate::irk::{analyse_pivots, unknown_name};

/// Ratio to the longest accepted step below which a step that is not solved ends the run.
const MIN_STEP_TO_LONGEST: f64 = 1e-6;

impl<M: Dae, T: Real> Run<'_, M, T> {
    /// Evaluates the Jacobian at the current point, or in the middle of the step.
    ///
    /// # Errors
    /// A value that is not finite.
    pub(super) fn evaluate_jacobian(&mut self, middle: bool, step: usize) -> Result<(), Error> {
        let Workspace { point, midpoint: foreseen, f, jacobian, .. } = &mut *self.workspace;
        self.statistics.jacobians += 1;
        M::residual_jacobian::<T>(if middle { foreseen } else { point }, f, jacobian);
        let at = Place { step, stage: 0, iteration: 0 };
        if let Some((equation, value)) = find_non_finite(f.as_ref()) {
            return Err(Error::NonFiniteModel { quantity: Quantity::Residual, equation, value, at });
        }
        if let Some((entry, value)) = find_non_finite(jacobian.as_ref()) {
            let equation = M::STRUCTURE.jacobian.at(entry).0;
            return Err(Error::NonFiniteModel { quantity: Quantity::Jacobian, equation, value, at });
        }
        Ok(())
    }

    /// After a failed iteration: tests whether a shorter step is worth an attempt.
    ///
    /// # Errors
    /// [`Error::StepSizeUnderflow`], with the equation and unknown that do not converge.
    pub(super) fn check_convergence(
        &self,
        stages: &dyn StageSolver<M, T>,
        state: &StepState<T>,
        span: Span<T>,
    ) -> Result<(), Error> {
        let size = state.h.abs();
        // Steps across a switching surface are attempted down to a part of the shortest step size.
        let least = if M::BRANCHES == 0 {
            shortest_step(span, state.t).max(T::from_f64(1e-12) * (span.end - span.start).abs())
        } else {
            T::from_f64(0.125) * shortest_step(span, state.t)
        };
        let is_short = size < least && size < T::from_f64(MIN_STEP_TO_LONGEST) * state.longest_so_far;
        if !(state.is_unsolved() && is_short) {
            return Ok(());
        }
        let culprit = stages.failure_location(&self.workspace.step_context(state), &self.workspace.jacobian);
        let (nx, unknown) = (M::Shape::NX, culprit.unknown);
        let unsettled = Unsettled {
            equation: culprit.equation,
            residual: culprit.residual,
            unknown: unknown_name::<M>(unknown),
            value: self.workspace.point[nx + unknown].to_f64(),
            algebraic: unknown >= nx,
        };
        let (t, h) = (state.t.to_f64(), state.h.to_f64());
        let reason = self.singular_algebraic(Refusal::NotConverged).unwrap_or(Refusal::NotConverged);
        Err(Error::StepSizeUnderflow { t, h, reason, unsettled: Some(unsettled) })
    }

    /// # Errors
    /// [`Error::StepSizeUnderflow`]
    pub(in crate::adaptive) fn check_step_size(&self, t: T, h: T, reason: Refusal) -> Result<(), Error> {
        let size = h.to_f64().abs();
        // The smallest subnormal numbers have no tenth.
        let tenth = T::from_f64(0.1) * h;
        let part = if tenth == T::ZERO { h } else { tenth };
        if size.is_nan() || size <= 0.0 || size < self.options.min_step || t + part == t {
            let reason = self.singular_algebraic(reason).unwrap_or(reason);
            return Err(Error::StepSizeUnderflow { t: t.to_f64(), h: h.to_f64(), reason, unsettled: None });
        }
        Ok(())
    }

    /// Whether `∂f/∂(ẋ, z)` becomes singular along an algebraic state at the current point, as a
    /// possible cause of the failure.
    fn singular_algebraic(&self, reason: Refusal) -> Option<Refusal> {
        let possible = matches!(reason, Refusal::Error | Refusal::NotConverged | Refusal::Singular);
        if M::Shape::NZ == 0 || !possible {
            return None;
        }
        let (mut f, mut jacobian) = (ArrayK::<M, T>::zeroed(), M::Jacobian::<T>::zeroed());
        M::jacobian_constants::<T>(&mut jacobian);
        M::residual_jacobian::<T>(&self.workspace.point, &mut f, &mut jacobian);
        let number = |of: &[T], at: usize| of.get(at).map_or(f64::NAN, |v| v.to_f64());
        let (entries, point) = (jacobian.as_ref(), self.workspace.point.as_ref());
        let found = analyse_pivots::<M>(|entry| number(entries, entry), |variable| number(point, variable))?;
        let unknown = unknown_name::<M>(found.unknown.filter(|_| found.is_singular::<T>())?);
        Some(Refusal::SingularAlgebraic { unknown })
    }
}
