//! One step of a Radau IIA or Gauss method with `S` stages: simplified Newton iterations, the error
//! estimate, and the collocation polynomial.
//!
//! E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, section IV.8; for
//! `f(ẋ, x, z, t) = 0`, with unknowns `k_i`, `z_i` instead of increments of `y`.
//!
//! Stages are stored in `G` groups of four, the lanes of common registers; surplus lanes repeat the
//! last stage.

mod branches;
mod contraction_rate;
mod estimate;
mod further_defects;
mod scheme;
mod stage_evaluation;

use crate::adaptive::discontinuity::{BranchChange, Branches};
use crate::adaptive::error_estimate::{DefectFilter, RelativeErrors};
use crate::adaptive::methods::kernels::{
    ApplyIncrement, EvaluateResiduals, ExtrapolateStages, STAGES_PER_GROUP, StageGroups, TransformResiduals,
};
use crate::adaptive::newton_monitor::{FailureLocation, NewtonFailure, NewtonMonitor, SurfaceCrossing};
use crate::adaptive::order::weighted_sum;
use crate::adaptive::point::variable_of_unknown;
use crate::adaptive::stages::{FilteredDefect, MAX_STAGES, StageSolver, StepContext};
use crate::adaptive::tolerances::{MAX_UNROLLED_LENGTH, ORDER_REDUCTION_RATIO, norm, root_mean_square};
use crate::error::Error;
use crate::finite::find_non_finite;
use crate::irk::dot;
use crate::linalg::{COMPLEX_PARTS, Complex, EigenFactors, EigenRows, Eigenbasis, axpy, dispatch, slot};
use crate::memory::allocate;
use crate::model::{ArrayK, ArrayV, ArrayX, Dae};
use crate::scalar::Real;
use crate::shape::{Array, Plain, Shape};
use crate::tableau::Tableau;
use alloc::boxed::Box;
use alloc::vec::Vec;
use bytemuck::Zeroable;
use core::array::from_fn;
use core::marker::PhantomData;
use scheme::Scheme;
use stage_evaluation::{copy_lane, copy_last_stage, evaluate_polynomial, weighted_stage_sums};

/// An error estimate below this lets the next step grow; larger ones are examined further.
const SAFE_ESTIMATE: f64 = 0.25;

/// Memory of a step.
#[derive(Zeroable)]
#[zeroable(bound = "T: Zeroable")]
struct StageMemory<M: Dae, T: Plain, const S: usize, const G: usize> {
    /// The unknowns `(k, z)` at the stages.
    stage_unknowns: ArrayK<M, StageGroups<T, G>>,
    /// The unknowns of the last accepted step.
    accepted_unknowns: ArrayK<M, [T; S]>,
    /// Variables of the model at the stages.
    stage_points: [ArrayV<M, [T; STAGES_PER_GROUP]>; G],
    /// The residual at the stages.
    stage_residuals: [ArrayK<M, [T; STAGES_PER_GROUP]>; G],
    right_hand_sides: EigenRows<M, T>,
    /// The variables at one point, and the residual there.
    defect_point: ArrayV<M, T>,
    defect_residual: ArrayK<M, T>,
    /// The estimated error of `(x, z)`.
    error_estimate: ArrayK<M, T>,
    /// The branches of the model at the stages.
    stage_branches: [Branches; S],
    factors: EigenFactors<M, T>,
}

/// A step of a collocation method with `S` stages in `G` groups.
pub struct Collocation<M: Dae, T: Real, const S: usize, const G: usize> {
    scheme: Scheme<T, S, G>,
    memory: Box<StageMemory<M, T, S, G>>,
}

impl<M: Dae, T: Real, const S: usize, const G: usize> Collocation<M, T, S, G> {
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub fn new(tableau: Tableau<S>) -> Result<Self, Error> {
        // Gauss and Radau IIA methods have a scheme: tests construct all.
        let scheme = Scheme::new(tableau).ok_or(Error::OutOfMemory { bytes: 0 })?;
        Ok(Self { scheme, memory: allocate()? })
    }
}

impl<M: Dae, T: Real, const S: usize, const G: usize> StageSolver<M, T> for Collocation<M, T, S, G> {
    fn stage_count(&self) -> usize {
        S
    }

    fn factor(&mut self, jacobian: &M::Jacobian<T>, h: T) -> Result<bool, usize> {
        self.memory.factors.factor(jacobian, self.scheme.basis.eigenvalues(), h)
    }

    fn set_pivoted(&mut self, pivoted: bool) {
        self.memory.factors.set_pivoted(pivoted);
    }

    fn are_factors_accurate(&self, start: &StepContext<'_, M, T>) -> bool {
        let factors = &self.memory.factors;
        if !factors.has_planned_factors() {
            return true;
        }
        let units = ArrayK::<M, T>::from_fn(|unknown| {
            let unit = T::ONE / start.estimator_scale[unknown];
            if unknown < M::Shape::NX { unit / start.h.abs() } else { unit }
        });
        let error = factors.backward_error(&units);
        error * error <= T::EPSILON
    }

    fn failure_location(&self, start: &StepContext<'_, M, T>, jacobian: &M::Jacobian<T>) -> FailureLocation {
        let StageMemory { right_hand_sides: rows, stage_residuals: f, .. } = &*self.memory;
        let (mut culprit, mut largest, nx) = (FailureLocation::default(), 0.0, M::Shape::NX);
        for (unknown, ([[row]], scale)) in
            rows.as_ref().iter().zip(start.estimator_scale.as_ref()).enumerate()
        {
            let unit = if unknown < nx { start.h.abs() * *scale } else { *scale };
            let increment = row.parts.iter().fold(0.0f64, |most, part| most.max(part.abs().to_f64()));
            // The first non-finite increment becomes the largest one.
            let increment = increment * unit.to_f64();
            if increment > largest || increment.is_nan() && largest < f64::INFINITY {
                largest = if increment.is_nan() { f64::INFINITY } else { increment };
                culprit.unknown = unknown;
            }
        }
        let mut terms: ArrayK<M, T> = Zeroable::zeroed();
        for (entry, value) in jacobian.as_ref().iter().enumerate() {
            let (equation, variable) = M::STRUCTURE.jacobian.at(entry);
            terms[equation] = terms[equation] + (*value * start.start_point[variable]).abs();
        }
        for (equation, terms) in terms.as_ref().iter().enumerate() {
            let all = f.iter().flat_map(|group| &group[equation]);
            let residual = all.fold(0.0f64, |most, f| most.max(f.abs().to_f64()));
            let relative = residual / (residual + terms.to_f64());
            if relative > culprit.residual {
                (culprit.equation, culprit.residual) = (equation, relative);
            }
        }
        culprit
    }

    fn begin_from_start(&mut self, point: &ArrayV<M, T>) {
        let nx = M::Shape::NX;
        let (xdot, z) = (&point.as_ref()[..nx], &point.as_ref()[2 * nx..]);
        for (y, value) in self.memory.stage_unknowns.as_mut().iter_mut().zip(xdot.iter().chain(z)) {
            *y = [[*value; STAGES_PER_GROUP]; G];
        }
    }

    fn extrapolate_last_step(&mut self, ratio: f64) {
        let weights = self.scheme.extrapolation_weights(ratio);
        let StageMemory { stage_unknowns: y, accepted_unknowns: accepted, .. } = &mut *self.memory;
        dispatch(ExtrapolateStages { weights, from: accepted.as_ref(), to: y.as_mut() });
    }

    fn predict_midpoint(&self, start: &StepContext<'_, M, T>, middle: &mut ArrayV<M, T>) {
        let (nx, stage) = (M::Shape::NX, S / 2);
        *middle = *start.start_point;
        let to = middle.as_mut();
        for (index, y) in self.memory.stage_unknowns.as_ref().iter().enumerate() {
            let y = y.as_flattened();
            to[variable_of_unknown::<M>(index)] = y[stage];
            if index < nx {
                let terms = self.scheme.tableau.a()[stage].iter().zip(y);
                let sum = terms.fold(T::ZERO, |sum, (a, y)| sum + T::from_f64(*a) * *y);
                to[nx + index] = to[nx + index] + start.h * sum;
            }
        }
        if let Some(time) = to.last_mut() {
            *time = *time + start.h * T::from_f64(self.scheme.tableau.c()[stage]);
        }
    }

    fn adopt_last_step(&mut self, other: &dyn StageSolver<M, T>) {
        let count = other.stage_count();
        for (stage, node) in self.scheme.tableau.c().iter().enumerate() {
            let weights = other.lagrange(*node);
            let unknowns = other.accepted_unknowns().chunks_exact(count);
            for (to, from) in self.memory.accepted_unknowns.as_mut().iter_mut().zip(unknowns) {
                to[stage] = weighted_sum(&weights, from);
            }
        }
    }

    fn solve(
        &mut self,
        start: &StepContext<'_, M, T>,
        tolerance: f64,
        convergence: &mut NewtonMonitor,
        residuals: &mut usize,
    ) -> Result<(), NewtonFailure> {
        self.scheme.set_step_size(start.h);
        let t = start.start_point.as_ref().last().copied().unwrap_or(T::ZERO);
        let inputs = 2 * M::Shape::NX + M::Shape::NZ;
        for (points, times) in self.memory.stage_points.iter_mut().zip(&self.scheme.stage_times(t, start.h)) {
            for (to, from) in points.as_mut().iter_mut().zip(start.start_point.as_ref()).skip(inputs) {
                *to = [*from; STAGES_PER_GROUP];
            }
            if let Some(time) = points.as_mut().last_mut() {
                *time = *times;
            }
        }
        self.apply_increment(start, false);
        convergence.begin_iteration(S, start.h.abs().to_f64());
        convergence.record_crossing(self.update_surface_crossing(convergence.jacobian_branches));
        for iteration in 1..=convergence.max_iterations {
            *residuals += S;
            self.evaluate_stages();
            let StageMemory { right_hand_sides: rows, factors, .. } = &mut *self.memory;
            factors.solve(rows);
            let increment = root_mean_square(self.apply_increment(start, true), M::Shape::NK * S);
            convergence.iterations = iteration;
            if !increment.is_finite() {
                // A non-finite value of the model makes the increment non-finite.
                let finite = self
                    .memory
                    .stage_residuals
                    .iter()
                    .all(|f| find_non_finite(f.as_ref().as_flattened()).is_none());
                return Err(if finite { NewtonFailure::Diverges } else { NewtonFailure::NotFinite });
            }
            convergence.record_crossing(self.update_surface_crossing(convergence.jacobian_branches));
            if convergence.check_increment(increment, tolerance)? {
                let exact = M::STRUCTURE.constant_matrix;
                if convergence.needs_another_iteration(exact) {
                    continue;
                }
                if convergence.is_rate_known(exact, increment <= tolerance)
                    || self.confirm_convergence(tolerance / increment, convergence, residuals)?
                {
                    convergence.end_iteration();
                    return Ok(());
                }
            }
        }
        Err(NewtonFailure::Diverges)
    }

    fn estimate_point(&self, start: &StepContext<'_, M, T>, point: &mut ArrayV<M, T>) -> bool {
        *point = *start.start_point;
        if !self.scheme.stiffly_accurate {
            self.evaluate_end(start.h, point);
            if let Some(time) = point.as_mut().last_mut() {
                *time = *time + start.h;
            }
            return true;
        }
        weighted_stage_sums(
            &self.scheme.lagrange_at_start,
            &self.memory.stage_unknowns.as_ref()[..M::Shape::NX],
            point.as_mut(),
        );
        false
    }

    fn filter_residual(&mut self, h: T, residual: &mut ArrayK<M, T>) {
        let StageMemory { right_hand_sides: rows, factors, .. } = &mut *self.memory;
        // The same right-hand side for the systems of all eigenvalues.
        for (equation, f) in residual.as_ref().iter().enumerate() {
            rows[slot::<M>(equation)] = [[Complex::real(-*f)]];
        }
        factors.solve(rows);
        // The real eigenvalue is the first. Methods with an even number of stages have none; their
        // estimate is the real part.
        let (re, im) = self.scheme.basis.eigenvalues().scaled(h).get(0);
        for (index, (error, [[row]])) in residual.as_mut().iter_mut().zip(rows.as_ref()).enumerate() {
            let (real, imaginary) = row.get(0);
            *error = if index < M::Shape::NX { re * real - im * imaginary } else { real };
        }
    }

    fn filtered_defect(&self, h: T) -> FilteredDefect<M, T> {
        let mut errors = FilteredDefect::<M, T>::zeroed();
        for (error, weights) in errors.iter_mut().zip(self.scheme.defect_filter.weights()) {
            let weights = weights.map(T::from_f64);
            for (error, [[row]]) in error.as_mut().iter_mut().zip(self.memory.right_hand_sides.as_ref()) {
                *error = h * dot(&weights, &row.parts);
            }
        }
        errors
    }

    fn defect_filter(&self) -> &DefectFilter {
        &self.scheme.defect_filter
    }

    fn append_unknowns(&self, to: &mut Vec<T>) {
        for y in self.memory.stage_unknowns.as_ref() {
            to.extend(y.as_flattened().iter().take(S));
        }
    }

    fn estimate_error(
        &mut self,
        start: &StepContext<'_, M, T>,
        again: bool,
        residuals: &mut usize,
    ) -> Result<f64, NewtonFailure> {
        let mut point = ArrayV::<M, T>::zeroed();
        let at_end = self.estimate_point(start, &mut point);
        self.memory.defect_point = point;
        // The defect: the difference of the derivative of the polynomial, extrapolated to the start
        // or end of the step, and the derivative of the solution.
        let error = self.estimate_from_point(start, at_end, residuals)?;
        if at_end && error < 1.0 {
            return self.max_with_start_estimate(start, error, residuals);
        }
        if at_end || !(again && error >= 1.0) {
            return Ok(error);
        }
        self.memory.defect_point = point;
        let states = &mut self.memory.defect_point.as_mut()[M::Shape::NX..];
        for (state, error) in states.iter_mut().zip(self.memory.error_estimate.as_ref()) {
            *state = *state + *error;
        }
        // The model beyond a switching surface gives no estimate on this side.
        let branches = Branches::at_point::<M, T>(start.start_point);
        if branches.change_to(Branches::at_point::<M, T>(&self.memory.defect_point))
            == Some(BranchChange::Switch)
        {
            return Ok(error);
        }
        self.estimate_from_point(start, at_end, residuals)
    }

    fn largest_defect(
        &mut self,
        start: &StepContext<'_, M, T>,
        residuals: &mut usize,
    ) -> Result<f64, NewtonFailure> {
        self.largest_defect(start, residuals)
    }

    fn branch_change(&mut self, start: &StepContext<'_, M, T>) -> Option<BranchChange> {
        self.branch_change(start)
    }

    fn accept_step(&mut self) {
        let StageMemory { stage_unknowns: y, accepted_unknowns: accepted, .. } = &mut *self.memory;
        for (accepted, y) in accepted.as_mut().iter_mut().zip(y.as_ref()) {
            accepted.copy_from_slice(&y.as_flattened()[..S]);
        }
    }

    fn end_point(&self, h: T, point: &mut ArrayV<M, T>) -> bool {
        if !self.scheme.stiffly_accurate {
            self.evaluate_end(h, point);
            return false;
        }
        // The last stage is at the end of the step.
        copy_last_stage(&self.memory.stage_points, point.as_mut());
        true
    }

    fn accepted_unknowns(&self) -> &[T] {
        self.memory.accepted_unknowns.as_ref().as_flattened()
    }

    fn lagrange(&self, theta: f64) -> [f64; MAX_STAGES] {
        pad_to_max_stages(self.scheme.lagrange_polynomials(theta))
    }

    fn weights(&self, theta: f64) -> [f64; MAX_STAGES] {
        pad_to_max_stages(self.scheme.tableau.weights(theta))
    }
}

fn pad_to_max_stages<const S: usize>(weights: [f64; S]) -> [f64; MAX_STAGES] {
    let mut all = [0.0; MAX_STAGES];
    for (to, from) in all.iter_mut().zip(weights) {
        *to = from;
    }
    all
}
