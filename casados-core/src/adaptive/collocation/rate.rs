//! What an iteration left of the residual at the last stage.

use super::*;

impl<M: Dae, B: Method<S>, T: Real, const S: usize, const G: usize> Collocation<M, B, T, S, G> {
    /// The residual at the last stage relative to the one before the iteration at all stages, of
    /// the worst equation: the rate of convergence, where a force or its derivatives jump in the
    /// step. The rate of an earlier step knows nothing of that.
    ///
    /// # Errors
    /// [`Failure::NotFinite`]
    pub(super) fn measured_rate(&mut self, residuals: &mut usize) -> Result<f64, Failure> {
        let Memory { points, point, .. } = &mut *self.memory;
        // The last lane repeats the last stage.
        for (to, [.., last]) in point.as_mut().iter_mut().zip(points.last().map_or(&[][..], AsRef::as_ref)) {
            *to = *last;
        }
        self.evaluate_point(residuals)?;
        let Memory { f, f_point, .. } = &*self.memory;
        let mut rate = 0.0f64;
        for (equation, after) in f_point.as_ref().iter().enumerate() {
            let before = f.iter().flat_map(|f| f[equation]).fold(0.0f64, |most, f| most.max(f.abs().to_f64()));
            // Written so that nothing of nothing is nothing.
            rate = rate.max(after.abs().to_f64() / before);
        }
        Ok(rate)
    }
}
