//! One step of an explicit pair: its stages, error estimate, and dense output.

use super::rounding::RoundingErrors;
use crate::adaptive::discontinuity::{BranchChange, Branches};
use crate::adaptive::pairs::EmbeddedPair;
use crate::adaptive::tolerances::norm;
use crate::erk::{Grid, Scheme, StagePoint, StepRecord, UnitStride};
use crate::error::{Error, Place};
use crate::finite::check_output;
use crate::memory::allocate;
use crate::model::{ArrayX, Dae, Ode};
use crate::result::Dense;
use crate::scalar::{Real, Scalar};
use crate::shape::{Array, InBounds, Matrix, Shape};
use alloc::boxed::Box;
use bytemuck::Zeroable;
use core::marker::PhantomData;

/// Memory of a step.
#[derive(Zeroable)]
#[zeroable(bound = "")]
struct StepMemory<M: Ode, T: Real, const S: usize> {
    point: StagePoint<M, T>,
    stage_record: StepRecord<M, T, S>,
    /// The state and its derivative at the end of the step.
    end_state: ArrayX<M, T>,
    end_derivative: ArrayX<M, T>,
    difference: ArrayX<M, T>,
    scale: ArrayX<M, T>,
    /// The stages for dense output.
    dense_stages: [ArrayX<M, T>; 3],
    /// The branches of the model at the start and at the end of the step.
    end_branches: [Branches; 2],
}

/// A step of an explicit pair.
pub trait ExplicitStepper<M: Dae, T: Real> {
    /// Sets the inputs and the state at the start of a step.
    fn go(&mut self, inputs: &[T], x: &[T]);
    /// The derivative at the start.
    ///
    /// # Errors
    /// A value that is not finite.
    fn slope(&mut self, t: T) -> Result<&[T], Error>;
    /// Computes the stages after the first one, and the state at the end.
    ///
    /// # Errors
    /// A value that is not finite.
    fn take(&mut self, t: T, h: T) -> Result<(), Error>;
    /// Computes the derivative at the end.
    ///
    /// # Errors
    /// A value that is not finite.
    fn arrive(&mut self, t: T, h: T) -> Result<(), Error>;
    /// The estimated error relative to the tolerance, with a global error factor of at most `most`.
    /// If it is at most one, the derivative at the end has been computed.
    ///
    /// # Errors
    /// A value that is not finite.
    fn estimate_error(&mut self, t: T, h: T, most: f64, rtol: &[T], atol: &[T]) -> Result<f64, Error>;
    /// The change of branches over the last attempted step, if any.
    fn branch_change(&self) -> Option<BranchChange>;
    /// The state at the end.
    fn end_state(&self) -> &[T];
    /// Makes the end of the step the next start.
    fn move_to_end(&mut self);
    /// Dense output of the last step.
    ///
    /// # Errors
    /// A value that is not finite.
    fn interpolate(&mut self, t: T, h: T, theta: T, dense: &mut Dense<M, T>) -> Result<(), Error>;
    /// Whether stability limited the majority of accepted steps of the run, counting only those
    /// with a global error factor.
    fn is_stiff(&self) -> bool;
    /// Whether rounding errors limited the majority of attempts of the run.
    fn is_limited_by_rounding(&self) -> bool;
    /// The number of model evaluations since the last call.
    fn take_evaluation_count(&mut self) -> usize;
}

pub struct PairStepper<M: Ode, B, T: Real, const S: usize> {
    scheme: Scheme<M, T, S>,
    memory: Box<StepMemory<M, T, S>>,
    /// The change of branches over the last attempted step, if any.
    branch_change: Option<BranchChange>,
    /// The number of steps at the stability bound, minus the number of others.
    stability_limited_minus_unlimited: i64,
    rounding: RoundingErrors,
    method: PhantomData<fn() -> B>,
}

impl<M: Ode, B: EmbeddedPair<S>, T: Real, const S: usize> PairStepper<M, B, T, S> {
    pub fn new() -> Result<Self, Error> {
        Ok(Self {
            scheme: Scheme::new(&B::TABLEAU),
            memory: allocate()?,
            branch_change: None,
            stability_limited_minus_unlimited: 0,
            rounding: RoundingErrors::default(),
            method: PhantomData,
        })
    }

    /// Evaluates the derivative at a state.
    fn evaluate_derivative(
        scheme: &Scheme<M, T, S>,
        point: &mut StagePoint<M, T>,
        x: &[T],
        t: T,
        slope: &mut ArrayX<M, T>,
    ) -> Result<(), Error> {
        let nx = M::Shape::NX;
        let numbers = point.variables_mut();
        numbers[nx..2 * nx].copy_from_slice(x);
        if let Some(time) = numbers.last_mut() {
            *time = t;
        }
        point.derivative(scheme, slope, Place { step: 0, stage: 0, iteration: 0 })
    }
}

impl<M: Ode, B: EmbeddedPair<S>, T: Real, const S: usize> PairStepper<M, B, T, S> {
    /// The global error factor of this step, from one for damped errors to `count` for others; see
    /// [`EmbeddedPair::GLOBAL_ERROR_FACTOR`].
    ///
    /// The last stage `Y` is at the end of the step. With `d = x_next − Y` the flow damps the error
    /// if `d` and `J d` have opposite directions; the factor decreases with the squared cosine of
    /// their angle. A step is at the stability bound if `h |J d|/|d|` reaches it (E. Hairer, G.
    /// Wanner, Solving Ordinary Differential Equations II, section IV.2).
    fn global_error_factor(&mut self, count: f64) -> f64 {
        if count <= 1.0 {
            return 1.0;
        }
        let StepMemory { stage_record: record, end_derivative: end_slope, difference, scale, .. } =
            &mut *self.memory;
        let Some(last) = record.k.last() else { return 1.0 };
        difference.as_mut().fill(T::ZERO);
        weighted_stage_sum(&B::FSAL_DIFFERENCE, &record.k, difference.as_mut());
        let (mut along, mut distances, mut changes) = (T::ZERO, T::ZERO, T::ZERO);
        let slopes = end_slope.as_ref().iter().zip(last.as_ref());
        for ((distance, (end, last)), scale) in difference.as_ref().iter().zip(slopes).zip(scale.as_ref()) {
            let (distance, change) = (*distance * *scale, (*end - *last) * *scale);
            along = along + distance * change;
            distances = distances + distance * distance;
            changes = changes + change * change;
        }
        // The factor `h` is contained in the scales, and thus in the changes.
        let is_at_bound = changes.to_f64() > B::STABILITY_BOUND * B::STABILITY_BOUND * distances.to_f64();
        self.stability_limited_minus_unlimited += if is_at_bound { 1 } else { -1 };
        let (along, lengths) = (along.to_f64(), distances.to_f64() * changes.to_f64());
        let damped = if along < 0.0 && lengths > 0.0 { along * along / lengths } else { 0.0 };
        if damped.is_nan() { count } else { count + (1.0 - count) * damped.min(1.0) }
    }
}

impl<M: Ode, B: EmbeddedPair<S>, T: Real, const S: usize> PairStepper<M, B, T, S> {
    /// Measures the rounding error of the difference in a step of this length, with the scales of
    /// the last step; see [`RoundingErrors`].
    fn measure_rounding(&mut self, t: T, size: f64) {
        let Self { scheme, memory, rounding, .. } = self;
        let StepMemory { point, stage_record: record, dense_stages: [slope, ..], difference, scale, .. } =
            &mut **memory;
        for (to, x) in difference.as_mut().iter_mut().zip(record.x.as_ref()) {
            *to = *x * T::from_f64(1.0 + 2.0 * T::EPSILON * rounding.random_sign());
        }
        // The model may be undefined beside the solution.
        if Self::evaluate_derivative(scheme, point, difference.as_ref(), t, slope).is_err() {
            return;
        }
        for (slope, start) in slope.as_mut().iter_mut().zip(record.k[0].as_ref()) {
            *slope = *slope - *start;
        }
        let (stages, last) = B::ERROR_COEFFICIENTS;
        let squares = stages.iter().fold(last * last, |sum, e| sum + e * e);
        rounding.record_measurement(Scalar::sqrt(squares) * norm(slope.as_ref(), scale.as_ref()), size);
    }
}

/// `Σ_i e_i k_i`
fn weighted_stage_sum<T: Real, R: Array<T>>(coefficients: &[f64], stages: &[R], sum: &mut [T]) {
    for (coefficient, stage) in coefficients.iter().zip(stages) {
        if *coefficient != 0.0 {
            let coefficient = T::from_f64(*coefficient);
            for (sum, k) in sum.iter_mut().zip(stage.as_ref()) {
                *sum = *sum + coefficient * *k;
            }
        }
    }
}

impl<M: Ode, B: EmbeddedPair<S>, T: Real, const S: usize> ExplicitStepper<M, T> for PairStepper<M, B, T, S> {
    fn go(&mut self, inputs: &[T], x: &[T]) {
        (self.stability_limited_minus_unlimited, self.rounding) = (0, RoundingErrors::default());
        let StepMemory { point, stage_record: record, .. } = &mut *self.memory;
        point.variables_mut().copy_from_slice(inputs);
        // Explicit models are evaluated at `ẋ = 0`.
        point.variables_mut()[..M::Shape::NX].fill(T::ZERO);
        record.x.as_mut().copy_from_slice(x);
    }

    fn slope(&mut self, t: T) -> Result<&[T], Error> {
        let StepMemory { point, stage_record: record, end_branches: branches, .. } = &mut *self.memory;
        Self::evaluate_derivative(&self.scheme, point, record.x.as_ref(), t, &mut record.k[0])?;
        branches[0] = Branches::at_point::<M, UnitStride<T>>(&point.v);
        Ok(record.k[0].as_ref())
    }

    fn take(&mut self, t: T, h: T) -> Result<(), Error> {
        let StepMemory { point, stage_record: record, end_state: end, end_branches: branches, .. } =
            &mut *self.memory;
        let grid = Grid { start_time: t, h, steps: 1, compensated: false };
        self.branch_change = None;
        for stage in 1..S {
            let at = Place { step: 0, stage, iteration: 0 };
            point.move_to_stage(&self.scheme, &grid, record, at)?;
            point.derivative(&self.scheme, &mut record.k[stage], at)?;
            self.branch_change = self
                .branch_change
                .max(branches[0].change_to(Branches::at_point::<M, UnitStride<T>>(&point.v)));
        }
        record.advance(&self.scheme, &grid, 0, end, None, &mut point.non_finite)
    }

    fn arrive(&mut self, t: T, h: T) -> Result<(), Error> {
        let StepMemory { point, end_state: end, end_derivative: end_slope, end_branches: branches, .. } =
            &mut *self.memory;
        Self::evaluate_derivative(&self.scheme, point, end.as_ref(), t + h, end_slope)?;
        branches[1] = Branches::at_point::<M, UnitStride<T>>(&point.v);
        self.branch_change = self.branch_change.max(branches[0].change_to(branches[1]));
        Ok(())
    }

    fn estimate_error(&mut self, t: T, h: T, most: f64, rtol: &[T], atol: &[T]) -> Result<f64, Error> {
        let (stages, last) = B::ERROR_COEFFICIENTS;
        if last != 0.0 {
            self.arrive(t, h)?;
        }
        let StepMemory {
            stage_record: record,
            end_state: end,
            end_derivative: end_slope,
            difference,
            scale,
            ..
        } = &mut *self.memory;
        let states = record.x.as_ref().iter().zip(end.as_ref());
        for (((scale, (before, after)), rtol), atol) in
            scale.as_mut().iter_mut().zip(states).zip(rtol).zip(atol)
        {
            *scale = h / (*atol + *rtol * before.abs().max(after.abs()));
        }
        let mut difference_of = |coefficients: &[f64; S]| {
            difference.as_mut().fill(T::ZERO);
            weighted_stage_sum(coefficients, &record.k, difference.as_mut());
            if last != 0.0 {
                weighted_stage_sum(&[last], core::slice::from_ref(end_slope), difference.as_mut());
            }
            norm(difference.as_ref(), scale.as_ref())
        };
        let fine = difference_of(&stages);
        let coarse = B::THIRD_ORDER.as_ref().map(difference_of);
        let error = B::combined_estimate(fine, coarse);
        // NaN is rejected.
        if error > 1.0 {
            return Ok(error);
        }
        if last == 0.0 {
            self.arrive(t, h)?;
        }
        let count = self.global_error_factor(most);
        if count <= 1.0 {
            return Ok(error);
        }
        let size = h.to_f64().abs();
        if self.rounding.is_measurement_due() {
            self.measure_rounding(t, size);
        }
        let truncation = B::combined_estimate(self.rounding.truncation_error(fine, size), coarse);
        self.rounding.count_attempt(error, count * truncation);
        Ok(error + (count - 1.0) * truncation)
    }

    fn branch_change(&self) -> Option<BranchChange> {
        self.branch_change
    }

    fn end_state(&self) -> &[T] {
        self.memory.end_state.as_ref()
    }

    fn move_to_end(&mut self) {
        let StepMemory {
            stage_record: record,
            end_state: end,
            end_derivative: end_slope,
            end_branches: branches,
            ..
        } = &mut *self.memory;
        record.x = *end;
        record.k[0] = *end_slope;
        branches[0] = branches[1];
    }

    fn interpolate(&mut self, t: T, h: T, theta: T, dense: &mut Dense<M, T>) -> Result<(), Error> {
        let StepMemory {
            point,
            stage_record: record,
            end_state: end,
            end_derivative: end_slope,
            dense_stages: more,
            difference: x,
            ..
        } = &mut *self.memory;
        let last = core::slice::from_ref(&*end_slope);
        for index in 0..B::DENSE_STAGES.len().min(more.len()) {
            let Some(stage) = B::DENSE_STAGES.get(index).in_bounds() else { break };
            x.as_mut().fill(T::ZERO);
            weighted_stage_sum(&stage.stages, &record.k, x.as_mut());
            weighted_stage_sum(&[stage.end_coefficient], last, x.as_mut());
            weighted_stage_sum(&stage.dense_coefficients, &more[..index], x.as_mut());
            for (x, start) in x.as_mut().iter_mut().zip(record.x.as_ref()) {
                *x = *start + h * *x;
            }
            let time = t + h * T::from_f64(stage.node);
            Self::evaluate_derivative(&self.scheme, point, x.as_ref(), time, &mut more[index])?;
        }
        // Nested form: y + θ (Δ + θ' (b + θ (d + θ' (…)))), θ' = 1 − θ.
        let rest = T::ONE - theta;
        let to = dense.x.as_mut_slice();
        to.fill(T::ZERO);
        for (power, (stages, end, others)) in B::DENSE_POLYNOMIAL.iter().enumerate().rev() {
            x.as_mut().fill(T::ZERO);
            weighted_stage_sum(stages, &record.k, x.as_mut());
            weighted_stage_sum(&[*end], last, x.as_mut());
            weighted_stage_sum(others, more, x.as_mut());
            let factor = if power % 2 == 0 { rest } else { theta };
            for (to, x) in to.iter_mut().zip(x.as_ref()) {
                *to = factor * (h * *x + *to);
            }
        }
        for (index, to) in to.iter_mut().enumerate() {
            let (start, change) = (record.x[index], end[index] - record.x[index]);
            let bend = h * record.k[0][index] - change;
            let cubic = change - h * end_slope[index] - bend;
            *to = start + theta * (change + rest * (bend + theta * (cubic + *to)));
        }
        check_output(to, 0)
    }

    fn is_stiff(&self) -> bool {
        self.stability_limited_minus_unlimited > 0
    }

    fn is_limited_by_rounding(&self) -> bool {
        self.rounding.limited_most_attempts()
    }

    fn take_evaluation_count(&mut self) -> usize {
        core::mem::take(&mut self.memory.point.counts.residuals)
    }
}
