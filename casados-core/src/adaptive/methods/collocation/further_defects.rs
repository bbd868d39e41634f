//! The defect at further points of a step in which the model changes its branch.
//!
//! The polynomial `u` of a step has the defect `d(τ) = u̇ − f(u)`, which is zero at the nodes. The
//! error at the end of a smooth step is the integral of the defect, in which all but the high-order
//! terms cancel: it has order `2s − 1` or `2s`, and the estimate, of order `s`, may be a thousand
//! tolerances. If a force or one of its derivatives jumps within the step, nothing cancels, and the
//! estimate may be close to the error or below it. The defect at further points shows this.

use super::*;

impl<M: Dae, T: Real, const S: usize, const G: usize> Collocation<M, T, S, G> {
    /// The larger of the filtered defects between the last two nodes and in the middle, relative to
    /// the estimator tolerance.
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
