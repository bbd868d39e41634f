//! The defect of a step in which the model changes its branch.
//!
//! The polynomial `u` of a step leaves the defect `d(τ) = u̇ − f(u)`, which is zero at the nodes.
//! The error at the end of a smooth step is the integral of the defect, in which all but high terms
//! cancel: so it is of order `2s − 1` or `2s`, and the estimate, of order `s`, may be a thousand
//! tolerances. Where a force jumps inside the step, or one of its derivatives, nothing cancels, and
//! the estimate may be close to the error, or below it: further points of the defect tell.

use super::*;

impl<M: Dae, T: Real, const S: usize, const G: usize> Collocation<M, T, S, G> {
    /// The larger one of the filtered defects between the last two nodes and in the middle,
    /// relative to what the estimate tolerates.
    pub(super) fn largest_defect(
        &mut self,
        start: &StepContext<'_, M, T>,
        residuals: &mut usize,
    ) -> Result<f64, NewtonFailure> {
        let mut largest = 0.0f64;
        for stage in [S - 1, S / 2] {
            let defect = self.defect_at(self.scheme.midpoint_node(stage), start, residuals)?;
            largest = largest.max(norm(&defect.as_ref()[..M::Shape::NX], start.estimator_scale.as_ref()));
        }
        Ok(largest)
    }

    /// The filtered defect of the polynomial at a point of the step.
    fn defect_at(
        &mut self,
        tau: f64,
        start: &StepContext<'_, M, T>,
        residuals: &mut usize,
    ) -> Result<ArrayK<M, T>, NewtonFailure> {
        self.memory.defect_point = *start.start_point;
        let StageMemory { defect_point: point, stage_unknowns: y, .. } = &mut *self.memory;
        let (values, integrals) = (self.scheme.lagrange_values(tau), self.scheme.lagrange_integrals(tau));
        evaluate_polynomial::<M, T, S, G>(y, [&values, &integrals], start.h, point);
        if let Some(time) = point.as_mut().last_mut() {
            *time = *time + start.h * T::from_f64(tau);
        }
        self.evaluate_point_residual(residuals)?;
        let mut defect = self.memory.defect_residual;
        self.filter_residual(start.h, &mut defect);
        Ok(defect)
    }
}
