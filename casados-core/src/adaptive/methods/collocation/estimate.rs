//! The error estimates of a step.

use super::*;
use crate::shape::InBounds;

impl<M: Dae, T: Real, const S: usize, const G: usize> Collocation<M, T, S, G> {
    /// The larger of the two error estimates, from the defect at the current point.
    ///
    /// The first is the defect, solved with the matrix of one eigenvalue. At the end of a step
    /// without a stage there, the defect is the difference of the extrapolated derivative and that
    /// of the solution: for stiff components this is their error, which methods with `|R(∞)| = 1`
    /// do not damp. The extrapolated `z` is discarded, and the solve removes it from the estimate.
    /// The second estimate, of the states, is that of [`DefectFilter`].
    pub(super) fn estimate_from_point(
        &mut self,
        start: &StepContext<'_, M, T>,
        at_end: bool,
        residuals: &mut usize,
    ) -> Result<f64, NewtonFailure> {
        self.estimate_from_defect(start.h, residuals)?;
        let counted = if at_end { M::Shape::NX } else { M::Shape::NK };
        let errors = self.memory.error_estimate.as_ref().get(..counted).in_bounds().unwrap_or_default();
        let first = norm(errors, start.estimator_scale.as_ref());
        let larger = self.second_estimate(first, start);
        if at_end || !start.derivatives_are_known || larger <= first.max(SAFE_ESTIMATE) {
            return Ok(larger);
        }
        // Newton's method leaves a residual of algebraic equations at the start, which is no error
        // of this step and does not shrink with it. Without it the second estimate may meet its
        // tolerance.
        let mut defect = self.memory.defect_residual;
        self.memory.defect_point = *start.start_point;
        self.evaluate_point_residual(residuals)?;
        for (defect, left) in defect.as_mut().iter_mut().zip(self.memory.defect_residual.as_ref()) {
            *defect = *defect - *left;
        }
        self.filter_residual(start.h, &mut defect);
        Ok(self.second_estimate(first, start))
    }

    /// The larger of the estimate `first` and the second estimate, of the last filtered defect.
    fn second_estimate(&self, first: f64, start: &StepContext<'_, M, T>) -> f64 {
        let [error, divided] = self.filtered_defect(start.h);
        let mut relative = RelativeErrors::default();
        let user_ratio = start.estimator_scale.as_ref().iter().zip(start.user_ratio.as_ref());
        for ((error, divided), (scale, user_ratio)) in
            error.as_ref().iter().zip(divided.as_ref()).zip(user_ratio)
        {
            let user_ratio = *scale * *user_ratio;
            relative.add((*error * user_ratio).to_f64(), (*divided * user_ratio).to_f64());
        }
        self.scheme.defect_filter.max_estimate(first, start.tolerance_ratio, &relative)
    }

    /// The larger of the estimate at the end of a step and the same estimate at its start: a
    /// discontinuity before the first stage is invisible to the stages and the end.
    ///
    /// The start is evaluated only if the difference of the polynomial's `ẋ` and the solution's
    /// there is large: for components that are neither stiff nor oscillating the filter does not
    /// amplify it, and relative to the user's tolerance it counts at most
    /// `tolerance_ratio / ORDER_REDUCTION_RATIO` times.
    pub(super) fn max_with_start_estimate(
        &mut self,
        start: &StepContext<'_, M, T>,
        error: f64,
        residuals: &mut usize,
    ) -> Result<f64, NewtonFailure> {
        let (nx, mut changes) = (M::Shape::NX, ArrayK::<M, T>::zeroed());
        self.memory.defect_point = *start.start_point;
        let StageMemory { defect_point: point, stage_unknowns: y, .. } = &mut *self.memory;
        weighted_stage_sums(&self.scheme.lagrange_at_start, y.as_ref(), changes.as_mut());
        for (index, change) in changes.as_mut().iter_mut().enumerate() {
            let old = &mut point[variable_of_unknown::<M>(index)];
            let slope = *change;
            *change = slope - *old;
            *old = slope;
        }
        let unfiltered = self.scheme.basis.eigenvalues().scaled(start.h).get(0).0.to_f64().abs()
            * norm(&changes.as_ref()[..nx], start.estimator_scale.as_ref());
        let safe_estimate = SAFE_ESTIMATE * (ORDER_REDUCTION_RATIO / start.tolerance_ratio).min(1.0);
        if unfiltered <= 2.0 * error.max(safe_estimate) {
            return Ok(error);
        }
        let at_end = self.memory.error_estimate;
        self.estimate_from_defect(start.h, residuals)?;
        let first = norm(&self.memory.error_estimate.as_ref()[..nx], start.estimator_scale.as_ref());
        self.memory.error_estimate = at_end;
        let at_start = self.second_estimate(first, start);
        // NaN is returned.
        Ok(if at_start <= error { error } else { at_start })
    }

    /// Evaluates the residual at the current point.
    pub(super) fn evaluate_point_residual(&mut self, residuals: &mut usize) -> Result<(), NewtonFailure> {
        let StageMemory { defect_point: point, defect_residual: f_point, .. } = &mut *self.memory;
        *residuals += 1;
        M::residual::<T>(point, f_point);
        if find_non_finite(f_point.as_ref()).is_some() { Err(NewtonFailure::NotFinite) } else { Ok(()) }
    }

    /// Estimates the error of `(x, z)` from the defect at the current point.
    fn estimate_from_defect(&mut self, h: T, residuals: &mut usize) -> Result<(), NewtonFailure> {
        self.evaluate_point_residual(residuals)?;
        let mut error = self.memory.defect_residual;
        self.filter_residual(h, &mut error);
        self.memory.error_estimate = error;
        Ok(())
    }
}
