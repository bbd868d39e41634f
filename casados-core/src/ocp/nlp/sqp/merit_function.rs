//! Objective and weighted violations at a point, and their slope along the step.

use crate::linalg::dot;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::{Program, ProgramParts, intervals_end};
use crate::ocp::nlp::filter::FilterPair;
use crate::qp::element::get;
use crate::qp::{
    Bounds, Solution, SolutionStage, StageDims, add_symmetric_product, copy_common, part, part_mut,
};
use crate::scalar::Real;

impl<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Returns `∇fᵀd`: the slope of the objective from the iterate to the solution of its QP, plus
    /// the change of the `penalties`.
    pub(in crate::ocp) fn objective_slope(&mut self, solution: &Solution<T, D, M>, penalties: f64) -> f64 {
        let ProgramParts { qp, iterate, scratch, .. } = P::split(self);
        let (from, _) = iterate.variables_and_costates();
        let (to, _) = solution.variables_and_costates();
        let (mut slope, mut begin) = (T::ZERO, 0);
        let mut soft = -penalties;
        for (stage, point) in qp.view().stages().zip(solution.stages()) {
            let view = stage.arrays();
            let (v, w) = (part(from, begin, view.ld), part(to, begin, view.ld));
            begin += view.ld;
            let (direction, rest) = scratch.split_at_mut_checked(view.ld).unwrap_or_default();
            let gradient = part_mut(rest, 0, view.ld);
            for ((d, &w), &v) in direction.iter_mut().zip(w).zip(v) {
                *d = w - v;
            }
            copy_common(gradient, part(view.gradient, 0, view.ld));
            add_symmetric_product(gradient, view.hessian, view.ld, v, view.n);
            slope = gradient.iter().zip(&*direction).fold(slope, |sum, (&g, &d)| sum + g * d);
            let x = |i: usize| point.x.get(i).copied().unwrap_or(T::ZERO);
            let u = |i: usize| point.u.get(i).copied().unwrap_or(T::ZERO);
            let g = |i: usize| {
                let column = part(view.matrix, (view.next + i) * view.ld, view.ld);
                dot(column, w)
            };
            soft += bound_terms(&stage.x_bounds(), x, None).objective
                + bound_terms(&stage.u_bounds(), u, None).objective
                + bound_terms(&stage.g_bounds(), g, None).objective;
        }
        slope.to_f64() + soft
    }

    /// Returns `dᵀ H d / dᵀ d` along the step from the iterate to the solution of its QP.
    pub(super) fn curvature_along_step(&mut self, solution: &Solution<T, D, M>) -> f64 {
        let ProgramParts { qp, iterate, scratch, .. } = P::split(self);
        let ((from, _), (to, _)) = (iterate.variables_and_costates(), solution.variables_and_costates());
        let (mut curvature, mut square, mut begin) = (T::ZERO, T::ZERO, 0);
        for stage in qp.view().stages() {
            let view = stage.arrays();
            let (v, w) = (part(from, begin, view.ld), part(to, begin, view.ld));
            begin += view.ld;
            let (direction, rest) = scratch.split_at_mut_checked(view.ld).unwrap_or_default();
            let hessian_product = part_mut(rest, 0, view.ld);
            for ((d, &w), &v) in direction.iter_mut().zip(w).zip(v) {
                *d = w - v;
            }
            hessian_product.fill(T::ZERO);
            add_symmetric_product(hessian_product, view.hessian, view.ld, direction, view.n);
            for (&d, &f) in direction.iter().zip(&*hessian_product).take(view.n) {
                (curvature, square) = (curvature + d * f, square + d * d);
            }
        }
        (curvature / square).to_f64()
    }

    /// Returns objective and weighted violations at a point.
    ///
    /// # Errors
    /// The errors of functions and integrators.
    pub(in crate::ocp) fn objective_and_violation_at(
        &mut self,
        trial_point: &Solution<T, D, M>,
        weights: &Solution<T, D, M>,
        ends: &mut [T],
    ) -> Result<FilterPair, OcpError> {
        let objective = self.evaluate(trial_point, ends)?;
        let mut sum = FilterPair { objective: objective.to_f64(), violation: 0.0 };
        let ProgramParts { qp, given: [lower, upper], .. } = P::split(self);
        let (mut ends, values) = ends.split_at_checked(intervals_end(qp.dims())).unwrap_or_default();
        let (mut stages, mut row) = (trial_point.stages().peekable(), 0);
        let mut weights = weights.stages();
        for stage in qp.view().stages() {
            let Some(point) = stages.next() else { break };
            let weights = weights.next();
            if let Some(next) = stages.peek() {
                let (phi, behind) = ends.split_at_checked(next.x.len()).unwrap_or_default();
                ends = behind;
                for (i, (&phi, &x)) in phi.iter().zip(next.x).enumerate() {
                    sum.violation += weighted_gap(weights.as_ref(), i, phi - x);
                }
            }
            sum += variable_bound_terms(&stage, &point, weights.as_ref());
            let bounds = stage.g_bounds();
            for index in 0..bounds.lower.len() {
                let [lower, upper, value] = [lower, upper, values].map(|list| get(list, row + index));
                let weights = weights.map(|w| [w.g_lower, w.g_upper]);
                sum += bound_term(&bounds, index, [lower, upper], value, weights);
            }
            row += bounds.lower.len();
        }
        Ok(sum)
    }

    /// Returns the sum of the gaps at the iterate, from the QP that was written there.
    pub(super) fn gap_sum(&self) -> f64 {
        let (v, _) = self.iterate.variables_and_costates();
        let (mut sum, mut begin) = (0.0, 0);
        let mut stages = self.iterate.stages().skip(1);
        for stage in self.qp.view().stages() {
            let Some(next) = stages.next() else { break };
            let view = stage.arrays();
            let stage_variables = part(v, begin, view.ld);
            begin += view.ld;
            for ((&offset, &x), column) in
                view.offset.iter().zip(next.x).zip(view.matrix.chunks_exact(view.ld.max(1)))
            {
                sum += (offset + dot(column, stage_variables) - x).abs().to_f64();
            }
        }
        sum
    }

    /// Returns [`Ocp::objective_and_violation_at`] of the iterate, from the QP that was written
    /// there.
    pub(in crate::ocp) fn objective_and_violation(&self, weights: &Solution<T, D, M>) -> FilterPair {
        let mut sum = FilterPair { objective: self.objective.to_f64(), violation: 0.0 };
        let (v, _) = self.iterate.variables_and_costates();
        let mut begin = 0;
        let mut stages = self.iterate.stages().peekable();
        let mut weights = weights.stages();
        for stage in self.qp.view().stages() {
            let Some(point) = stages.next() else { break };
            let weights = weights.next();
            let view = stage.arrays();
            let stage_variables = part(v, begin, view.ld);
            begin += view.ld;
            let value = |column: usize| dot(part(view.matrix, column * view.ld, view.ld), stage_variables);
            if let Some(next) = stages.peek() {
                for (i, (&offset, &x)) in view.offset.iter().zip(next.x).enumerate() {
                    sum.violation += weighted_gap(weights.as_ref(), i, offset + value(i) - x);
                }
            }
            sum += variable_bound_terms(&stage, &point, weights.as_ref());
            let weights = weights.map(|w| [w.g_lower, w.g_upper]);
            sum += bound_terms(&stage.g_bounds(), |i| value(view.next + i), weights);
        }
        sum
    }
}

/// The weighted size of a gap.
fn weighted_gap<T: Real>(weights: Option<&SolutionStage<'_, T>>, index: usize, gap: T) -> f64 {
    let weight = weights.map_or(1.0, |w| w.dynamics.get(index).map_or(0.0, |w| w.to_f64()));
    weight * gap.abs().to_f64()
}

/// Penalties and violations of the bounds of states and controls.
fn variable_bound_terms<T: Real>(
    stage: &crate::qp::Stage<'_, T>,
    point: &SolutionStage<'_, T>,
    weights: Option<&SolutionStage<'_, T>>,
) -> FilterPair {
    let x = |i: usize| point.x.get(i).copied().unwrap_or(T::ZERO);
    let u = |i: usize| point.u.get(i).copied().unwrap_or(T::ZERO);
    let mut sum = bound_terms(&stage.x_bounds(), x, weights.map(|w| [w.x_lower, w.x_upper]));
    sum += bound_terms(&stage.u_bounds(), u, weights.map(|w| [w.u_lower, w.u_upper]));
    sum
}

/// Penalties and violations of several bounds.
fn bound_terms<T: Real>(
    bounds: &Bounds<'_, T>,
    value: impl Fn(usize) -> T,
    weights: Option<[&[T]; 2]>,
) -> FilterPair {
    let mut sum = FilterPair::default();
    for (i, (&lower, &upper)) in bounds.lower.iter().zip(bounds.upper).enumerate() {
        sum += bound_term(bounds, i, [lower, upper], value(i), weights);
    }
    sum
}

/// Penalty and violation of one pair of bounds.
fn bound_term<T: Real>(
    bounds: &Bounds<'_, T>,
    index: usize,
    [lower, upper]: [T; 2],
    value: T,
    weights: Option<[&[T]; 2]>,
) -> FilterPair {
    let mut sum = FilterPair::default();
    let at_index = |values: &[T]| values.get(index).map_or(0.0, |p| p.to_f64());
    let [of_lower, of_upper] = weights.map_or([1.0; 2], |sides| sides.map(at_index));
    for (excess, weight, linear, quadratic) in [
        (lower - value, of_lower, bounds.lower_linear, bounds.lower_quadratic),
        (value - upper, of_upper, bounds.upper_linear, bounds.upper_quadratic),
    ] {
        let excess = excess.to_f64();
        if excess > 0.0 {
            let linear = at_index(linear);
            if linear.is_finite() {
                sum.objective += excess * (linear + 0.5 * at_index(quadratic) * excess);
            } else {
                sum.violation += weight * excess;
            }
        } else if excess.is_nan() {
            sum.violation = f64::NAN;
        }
    }
    sum
}
