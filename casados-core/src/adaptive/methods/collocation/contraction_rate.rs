//! What an iteration left of the residual at the last stage.

use super::*;

/// What one iteration may leave of the residual of any equation.
const MAX_RESIDUAL_RATIO: f64 = 0.1;

impl<M: Dae, T: Real, const S: usize, const G: usize> Collocation<M, T, S, G> {
    /// Whether an increment that may be so much larger than what is left after it is the last one.
    ///
    /// # Errors
    /// [`Failure::NotFinite`]
    pub(super) fn confirm_convergence(
        &mut self,
        most: f64,
        convergence: &mut NewtonMonitor,
        residuals: &mut usize,
    ) -> Result<bool, NewtonFailure> {
        let rate = self.residual_ratio(residuals)?;
        // An increment far below the tolerance may be the whole of a state that is below it, too.
        let most = if convergence.iterations == 1 { most.min(MAX_RESIDUAL_RATIO) } else { most };
        let confirmed = rate <= most * (1.0 - rate);
        if confirmed {
            convergence.record_confirmed_rate(rate);
        }
        Ok(confirmed)
    }

    /// The residual at the last stage relative to the one before the iteration at all stages, of
    /// the worst equation: the rate of convergence, where a force or its derivatives jump in the
    /// step, or where it is longer than those before. The rate of an earlier step knows nothing of
    /// that.
    ///
    /// # Errors
    /// [`Failure::NotFinite`]
    fn residual_ratio(&mut self, residuals: &mut usize) -> Result<f64, NewtonFailure> {
        let StageMemory { stage_points: points, defect_point: point, .. } = &mut *self.memory;
        copy_last_stage(points, point.as_mut());
        self.evaluate_point_residual(residuals)?;
        let StageMemory { stage_residuals: f, defect_residual: f_point, .. } = &*self.memory;
        Ok(largest_ratio(f_point.as_ref(), f.each_ref().map(AsRef::as_ref).as_slice()))
    }
}

/// `|after| / |before|` of the worst equation, of the largest before in all lanes.
fn largest_ratio<T: Real>(after: &[T], before: &[&[[T; STAGES_PER_GROUP]]]) -> f64 {
    let mut ratio = 0.0f64;
    for (equation, after) in after.iter().enumerate() {
        let all = before.iter().flat_map(|group| group.get(equation)).flatten();
        let most = all.fold(0.0f64, |most, f| most.max(f.abs().to_f64()));
        // Written so that nothing of nothing is nothing.
        ratio = ratio.max(after.abs().to_f64() / most);
    }
    ratio
}
