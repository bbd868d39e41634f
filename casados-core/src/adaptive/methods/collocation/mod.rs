//! One step of a Radau IIA or Gauss method with `S` stages: simplified Newton, the estimate of its
//! error, and its polynomial.
//!
//! E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, section IV.8; for
//! `f(ẋ, x, z, t) = 0` with unknowns `k_i`, `z_i` instead of increments of `y`.
//!
//! Stages lie side by side in `G` groups of four, registers of the usual machine; what is left of
//! the last repeats the last stage.

mod branches;
mod estimate;
mod points;
mod rate;
mod scheme;
mod switches;

use crate::adaptive::discontinuity::{BranchChange, Branches};
use crate::adaptive::error_estimate::{DefectFilter, RelativeErrors};
use crate::adaptive::methods::kernels::{Advance, Continue, GROUP, Groups, Residual, Split};
use crate::adaptive::newton_monitor::{Convergence, Culprit, Failure, Sides};
use crate::adaptive::order::weighted;
use crate::adaptive::point::variable;
use crate::adaptive::stages::{FilteredDefect, MOST, Stages, StepContext};
use crate::adaptive::tolerances::{FEW, ORDER_REDUCTION_RATIO, mean, norm};
use crate::error::Error;
use crate::finite::find_non_finite;
use crate::irk::dot;
use crate::linalg::{Complex, EigenFactors, Eigenbasis, PARTS, Rows, axpy, dispatch, slot};
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
use points::{combine, evaluate_polynomial, last_stage, take};
use scheme::Scheme;

/// An estimate that is smaller lets the next step grow, whatever it is of.
const SAFE_ESTIMATE: f64 = 0.25;

/// Memory of a step.
#[derive(Zeroable)]
#[zeroable(bound = "T: Zeroable")]
struct Memory<M: Dae, T: Plain, const S: usize, const G: usize> {
    /// The unknowns `(k, z)` at the stages.
    y: ArrayK<M, Groups<T, G>>,
    /// Those of the last accepted step.
    accepted: ArrayK<M, [T; S]>,
    /// Variables of the model at the stages.
    points: [ArrayV<M, [T; GROUP]>; G],
    /// The residual at the stages.
    f: [ArrayK<M, [T; GROUP]>; G],
    rows: Rows<M, T>,
    /// Variables at one point, and the residual there.
    point: ArrayV<M, T>,
    f_point: ArrayK<M, T>,
    /// The estimated error of `(x, z)`.
    error: ArrayK<M, T>,
    /// The branches of the model at the stages.
    branches: [Branches; S],
    factors: EigenFactors<M, T>,
}

/// A step of a collocation method with `S` stages in `G` groups.
pub struct Collocation<M: Dae, T: Real, const S: usize, const G: usize> {
    scheme: Scheme<T, S, G>,
    memory: Box<Memory<M, T, S, G>>,
}

impl<M: Dae, T: Real, const S: usize, const G: usize> Collocation<M, T, S, G> {
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub fn new(tableau: Tableau<S>) -> Result<Self, Error> {
        // Gauss and Radau IIA methods have one: tests construct all.
        let scheme = Scheme::new(tableau).ok_or(Error::OutOfMemory { bytes: 0 })?;
        Ok(Self { scheme, memory: allocate()? })
    }
}

impl<M: Dae, T: Real, const S: usize, const G: usize> Stages<M, T> for Collocation<M, T, S, G> {
    fn count(&self) -> usize {
        S
    }

    fn factor(&mut self, jacobian: &M::Jacobian<T>, h: T) -> Result<bool, usize> {
        self.memory.factors.factor(jacobian, self.scheme.basis.values(), h)
    }

    fn set_pivoted(&mut self, pivoted: bool) {
        self.memory.factors.set_pivoted(pivoted);
    }

    fn factors_hold(&self, start: &StepContext<'_, M, T>) -> bool {
        let factors = &self.memory.factors;
        if !factors.are_planned() {
            return true;
        }
        let units = ArrayK::<M, T>::from_fn(|unknown| {
            let unit = T::ONE / start.scale[unknown];
            if unknown < M::Shape::NX { unit / start.h.abs() } else { unit }
        });
        let error = factors.backward_error(&units);
        error * error <= T::EPSILON
    }

    fn culprit(&self, start: &StepContext<'_, M, T>, jacobian: &M::Jacobian<T>) -> Culprit {
        let Memory { rows, f, .. } = &*self.memory;
        let (mut culprit, mut largest, nx) = (Culprit::default(), 0.0, M::Shape::NX);
        for (unknown, ([[row]], scale)) in rows.as_ref().iter().zip(start.scale.as_ref()).enumerate() {
            let unit = if unknown < nx { start.h.abs() * *scale } else { *scale };
            let increment = row.parts.iter().fold(0.0f64, |most, part| most.max(part.abs().to_f64()));
            // Written so that the first one that is not finite counts.
            let increment = increment * unit.to_f64();
            if increment > largest || increment.is_nan() && largest < f64::INFINITY {
                largest = if increment.is_nan() { f64::INFINITY } else { increment };
                culprit.unknown = unknown;
            }
        }
        let mut terms: ArrayK<M, T> = Zeroable::zeroed();
        for (entry, value) in jacobian.as_ref().iter().enumerate() {
            let (equation, variable) = M::STRUCTURE.jacobian.at(entry);
            terms[equation] = terms[equation] + (*value * start.point[variable]).abs();
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

    fn begin(&mut self, point: &ArrayV<M, T>) {
        let nx = M::Shape::NX;
        let (xdot, z) = (&point.as_ref()[..nx], &point.as_ref()[2 * nx..]);
        for (y, value) in self.memory.y.as_mut().iter_mut().zip(xdot.iter().chain(z)) {
            *y = [[*value; GROUP]; G];
        }
    }

    fn continue_from_last(&mut self, ratio: f64) {
        let weights = self.scheme.continued(ratio);
        let Memory { y, accepted, .. } = &mut *self.memory;
        dispatch(Continue { weights, from: accepted.as_ref(), to: y.as_mut() });
    }

    fn predict(&self, start: &StepContext<'_, M, T>, middle: &mut ArrayV<M, T>) {
        let (nx, stage) = (M::Shape::NX, S / 2);
        *middle = *start.point;
        let to = middle.as_mut();
        for (index, y) in self.memory.y.as_ref().iter().enumerate() {
            let y = y.as_flattened();
            to[variable::<M>(index)] = y[stage];
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

    fn adopt(&mut self, other: &dyn Stages<M, T>) {
        let count = other.count();
        for (stage, node) in self.scheme.tableau.c().iter().enumerate() {
            let weights = other.lagrange(*node);
            let unknowns = other.accepted().chunks_exact(count);
            for (to, from) in self.memory.accepted.as_mut().iter_mut().zip(unknowns) {
                to[stage] = weighted(&weights, from);
            }
        }
    }

    fn solve(
        &mut self,
        start: &StepContext<'_, M, T>,
        tolerance: f64,
        convergence: &mut Convergence,
        residuals: &mut usize,
    ) -> Result<(), Failure> {
        self.scheme.set_step(start.h);
        let t = start.point.as_ref().last().copied().unwrap_or(T::ZERO);
        let inputs = 2 * M::Shape::NX + M::Shape::NZ;
        for (points, times) in self.memory.points.iter_mut().zip(&self.scheme.times(t, start.h)) {
            for (to, from) in points.as_mut().iter_mut().zip(start.point.as_ref()).skip(inputs) {
                *to = [*from; GROUP];
            }
            if let Some(time) = points.as_mut().last_mut() {
                *time = *times;
            }
        }
        self.advance(start, false);
        convergence.begin(S, start.h.abs().to_f64());
        convergence.moved(self.sides(convergence.branches));
        for iteration in 1..=convergence.most {
            *residuals += S;
            self.evaluate();
            let Memory { rows, factors, .. } = &mut *self.memory;
            factors.solve(rows);
            let increment = mean(self.advance(start, true), M::Shape::NK * S);
            convergence.iterations = iteration;
            if !increment.is_finite() {
                // A value of the model that is not finite leaves no increment that is.
                let finite =
                    self.memory.f.iter().all(|f| find_non_finite(f.as_ref().as_flattened()).is_none());
                return Err(if finite { Failure::Diverges } else { Failure::NotFinite });
            }
            convergence.moved(self.sides(convergence.branches));
            if convergence.after(increment, tolerance)? {
                let exact = M::STRUCTURE.constant_matrix;
                if convergence.goes_on(exact) {
                    continue;
                }
                if convergence.is_measured(exact, increment <= tolerance)
                    || self.confirms(tolerance / increment, convergence, residuals)?
                {
                    convergence.end();
                    return Ok(());
                }
            }
        }
        Err(Failure::Diverges)
    }

    fn estimates(&self, start: &StepContext<'_, M, T>, point: &mut ArrayV<M, T>) -> bool {
        *point = *start.point;
        if !self.scheme.stiffly_accurate {
            self.extrapolate(start.h, point);
            if let Some(time) = point.as_mut().last_mut() {
                *time = *time + start.h;
            }
            return true;
        }
        combine(&self.scheme.lagrange, &self.memory.y.as_ref()[..M::Shape::NX], point.as_mut());
        false
    }

    fn filter(&mut self, h: T, residual: &mut ArrayK<M, T>) {
        let Memory { rows, factors, .. } = &mut *self.memory;
        // The same in the systems of all eigenvalues.
        for (equation, f) in residual.as_ref().iter().enumerate() {
            rows[slot::<M>(equation)] = [[Complex::real(-*f)]];
        }
        factors.solve(rows);
        // The real one is the first. Of methods with an even number of stages there is none; the
        // error is the real part.
        let (re, im) = self.scheme.basis.values().scaled(h).get(0);
        for (index, (error, [[row]])) in residual.as_mut().iter_mut().zip(rows.as_ref()).enumerate() {
            let (real, imaginary) = row.get(0);
            *error = if index < M::Shape::NX { re * real - im * imaginary } else { real };
        }
    }

    fn filtered_defect(&self, h: T) -> FilteredDefect<M, T> {
        let mut errors = FilteredDefect::<M, T>::zeroed();
        for (error, weights) in errors.iter_mut().zip(self.scheme.defect_filter.weights()) {
            let weights = weights.map(T::from_f64);
            for (error, [[row]]) in error.as_mut().iter_mut().zip(self.memory.rows.as_ref()) {
                *error = h * dot(&weights, &row.parts);
            }
        }
        errors
    }

    fn defect_filter(&self) -> &DefectFilter {
        &self.scheme.defect_filter
    }

    fn unknowns(&self, to: &mut Vec<T>) {
        for y in self.memory.y.as_ref() {
            to.extend(y.as_flattened().iter().take(S));
        }
    }

    fn error(
        &mut self,
        start: &StepContext<'_, M, T>,
        again: bool,
        residuals: &mut usize,
    ) -> Result<f64, Failure> {
        let mut point = ArrayV::<M, T>::zeroed();
        let at_end = self.estimates(start, &mut point);
        self.memory.point = point;
        // What the method misses is how far the derivative of its polynomial, extrapolated to the
        // start of the step, is from the solution there.
        let error = self.estimate(start, at_end, residuals)?;
        if at_end && error < 1.0 {
            return self.larger_at_start(start, error, residuals);
        }
        if at_end || !(again && error >= 1.0) {
            return Ok(error);
        }
        self.memory.point = point;
        let states = &mut self.memory.point.as_mut()[M::Shape::NX..];
        for (state, error) in states.iter_mut().zip(self.memory.error.as_ref()) {
            *state = *state + *error;
        }
        // What the model is on the other side of a border says nothing of this one.
        let branches = Branches::of::<M, T>(start.point);
        if branches.change(Branches::of::<M, T>(&self.memory.point)) == Some(BranchChange::Switch) {
            return Ok(error);
        }
        self.estimate(start, at_end, residuals)
    }

    fn largest_defect(
        &mut self,
        start: &StepContext<'_, M, T>,
        residuals: &mut usize,
    ) -> Result<f64, Failure> {
        self.largest_defect(start, residuals)
    }

    fn change(&mut self, start: &StepContext<'_, M, T>) -> Option<BranchChange> {
        self.change(start)
    }

    fn accept(&mut self) {
        let Memory { y, accepted, .. } = &mut *self.memory;
        for (accepted, y) in accepted.as_mut().iter_mut().zip(y.as_ref()) {
            accepted.copy_from_slice(&y.as_flattened()[..S]);
        }
    }

    fn end(&self, h: T, point: &mut ArrayV<M, T>) -> bool {
        if !self.scheme.stiffly_accurate {
            self.extrapolate(h, point);
            return false;
        }
        // It is the end of the step.
        last_stage(&self.memory.points, point.as_mut());
        true
    }

    fn accepted(&self) -> &[T] {
        self.memory.accepted.as_ref().as_flattened()
    }

    fn lagrange(&self, theta: f64) -> [f64; MOST] {
        padded(self.scheme.polynomials(theta))
    }

    fn weights(&self, theta: f64) -> [f64; MOST] {
        padded(self.scheme.tableau.weights(theta))
    }
}

fn padded<const S: usize>(weights: [f64; S]) -> [f64; MOST] {
    let mut all = [0.0; MOST];
    for (to, from) in all.iter_mut().zip(weights) {
        *to = from;
    }
    all
}
