//! The contraction rate of one iteration, measured by the residual at the last stage.

use super::*;

/// Maximum ratio of the residual of any equation after and before the first iteration.
const MAX_RESIDUAL_RATIO: f64 = 0.1;

impl<M: Dae, T: Real, const S: usize, const G: usize> Collocation<M, T, S, G> {
    /// Whether the error after the last increment, `rate/(1 − rate)` times the increment, is at
    /// most `most` times the increment.
    ///
    /// # Errors
    /// [`NewtonFailure::NotFinite`]
    pub(super) fn confirm_convergence(
        &mut self,
        most: f64,
        convergence: &mut NewtonMonitor,
        residuals: &mut usize,
    ) -> Result<bool, NewtonFailure> {
        let rate = self.residual_ratio(residuals)?;
        // An increment far below the tolerance may be the whole value of a state far below `atol`.
        let most = if convergence.iterations == 1 { most.min(MAX_RESIDUAL_RATIO) } else { most };
        let confirmed = rate <= most * (1.0 - rate);
        if confirmed {
            convergence.record_confirmed_rate(rate);
        }
        Ok(confirmed)
    }

    /// The ratio of the residual at the last stage after the iteration and the largest residual at
    /// all stages before it, for the equation in which it is largest. It is the contraction rate
    /// across a discontinuity and in steps longer than those before, for which the rate of an
    /// earlier step does not hold.
    ///
    /// # Errors
    /// [`NewtonFailure::NotFinite`]
    fn residual_ratio(&mut self, residuals: &mut usize) -> Result<f64, NewtonFailure> {
        let StageMemory { stage_points: points, defect_point: point, .. } = &mut *self.memory;
        copy_last_stage(points, point.as_mut());
        self.evaluate_point_residual(residuals)?;
        let StageMemory { stage_residuals: f, defect_residual: f_point, .. } = &*self.memory;
        Ok(largest_ratio(f_point.as_ref(), f.each_ref().map(AsRef::as_ref).as_slice()))
    }
}

/// The largest ratio `|after| / |before|` of all equations, with the maximum of `before` over all
/// lanes.
fn largest_ratio<T: Real>(after: &[T], before: &[&[[T; STAGES_PER_GROUP]]]) -> f64 {
    let mut ratio = 0.0f64;
    for (equation, after) in after.iter().enumerate() {
        let all = before.iter().flat_map(|group| group.get(equation)).flatten();
        let most = all.fold(0.0f64, |most, f| most.max(f.abs().to_f64()));
        // `0/0` counts as zero.
        ratio = ratio.max(after.abs().to_f64() / most);
    }
    ratio
}
