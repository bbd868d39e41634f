//! The order: methods of a family, opened when they are needed, and which of them is next.

use super::newton_monitor::NewtonMonitor;
use super::replay::StepDifferentiator;
use super::stages::StageSolver;
use crate::error::Error;
use crate::finite::check_output;
use crate::model::Dae;
use crate::result::Dense;
use crate::scalar::Real;
use crate::shape::Matrix;
use alloc::boxed::Box;

/// The number of stages grows where Newton's method converges at this rate or faster,
const FAST_CONTRACTION_RATE: f64 = 0.01;
/// and falls where it converges at this rate or slower,
const SLOW_CONTRACTION_RATE: f64 = 0.8;
/// but grows only if the step size hardly changes,
const STEADY_STEP_RATIO: (f64, f64) = (0.8, 1.2);
/// and not before so many steps have been taken with it.
const MIN_STEPS_BEFORE_INCREASE: usize = 5;

/// The methods that an integrator may change between.
pub trait MethodFamily: 'static {
    /// How many.
    const ORDER_COUNT: usize;
    /// See [`Engine`].
    const ENDS_ON_STAGE: bool;
    /// What takes their steps again.
    type Differentiator<M: Dae, T: Real>: StepDifferentiator<M, T> + Default + Send + Sync;
    /// One of them.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    fn open<M: Dae, T: Real>(level: usize) -> Result<Box<dyn StageSolver<M, T> + Send + Sync>, Error>;
}

/// The number of stages, and what speaks for another one.
#[derive(Clone, Copy, Debug, Default)]
pub struct OrderSelection {
    pub order_index: usize,
    /// How fast Newton's method converged.
    contraction_rate: f64,
    /// How many steps were taken with it.
    steps_with_order: usize,
    /// Whether an iteration did not converge, or a matrix was singular,
    pub iteration_failed: bool,
    /// or converged only with a much shorter step.
    pub step_was_halved: bool,
}

impl OrderSelection {
    /// The level for the next matrix, for a step that is `ratio` times as long as the last one.
    pub fn select_order(&mut self, convergence: &NewtonMonitor, ratio: f64, levels: usize) -> usize {
        self.steps_with_order += 1;
        self.contraction_rate = convergence.contraction_rate.max(0.5 * self.contraction_rate).min(10.0);
        let steady = ratio > STEADY_STEP_RATIO.0 && ratio < STEADY_STEP_RATIO.1;
        let easy = convergence.iterations > 1 && self.contraction_rate <= FAST_CONTRACTION_RATE;
        let hard =
            self.contraction_rate >= SLOW_CONTRACTION_RATE || self.iteration_failed || self.step_was_halved;
        (self.iteration_failed, self.step_was_halved) = (false, false);
        if hard {
            self.order_index.saturating_sub(1)
        } else if easy && steady && self.steps_with_order > MIN_STEPS_BEFORE_INCREASE {
            (self.order_index + 1).min(levels - 1)
        } else {
            self.order_index
        }
    }

    /// Counts a step with the matrix of the last one; whether the number of stages is worth a new
    /// matrix instead.
    pub fn may_increase_order(&mut self, levels: usize) -> bool {
        self.steps_with_order += 1;
        self.steps_with_order >= MIN_STEPS_BEFORE_INCREASE && self.order_index + 1 < levels
    }

    pub fn set_order(&mut self, level: usize) {
        (self.order_index, self.steps_with_order) = (level, 1);
    }
}

/// The levels of a family that are in use.
pub struct Orders<M: Dae, T: Real> {
    methods: [Option<Box<dyn StageSolver<M, T> + Send + Sync>>; 3],
}

impl<M: Dae, T: Real> Default for Orders<M, T> {
    fn default() -> Self {
        Self { methods: [None, None, None] }
    }
}

impl<M: Dae, T: Real> Orders<M, T> {
    pub fn get<B: MethodFamily>(&mut self, level: usize) -> Result<&mut dyn StageSolver<M, T>, Error> {
        let missing = Error::OutOfMemory { bytes: 0 };
        let place = self.methods.get_mut(level).ok_or(missing)?;
        if place.is_none() {
            *place = Some(B::open::<M, T>(level)?);
        }
        match place {
            Some(stages) => Ok(&mut **stages),
            None => Err(missing),
        }
    }

    /// The last accepted step of one level becomes that of another.
    pub fn transfer_last_step<B: MethodFamily>(&mut self, from: usize, to: usize) -> Result<(), Error> {
        self.get::<B>(from)?;
        self.get::<B>(to)?;
        let [first, second, third] = &mut self.methods;
        let (old, new) = match (from, to) {
            (0, 1) => (first, second),
            (1, 0) => (second, first),
            (1, 2) => (second, third),
            (2, 1) => (third, second),
            _ => return Ok(()),
        };
        if let (Some(old), Some(new)) = (old, new) {
            new.adopt_last_step(&**old);
        }
        Ok(())
    }
}

/// `Σ_i weight_i y_i`, a loop of its own, which is not unrolled.
#[inline(never)]
pub(super) fn weighted_sum<T: Real>(weights: &[f64], y: &[T]) -> T {
    weights.iter().zip(y).fold(T::ZERO, |sum, (weight, y)| sum + T::from_f64(*weight) * *y)
}

/// The polynomial of a step: `x(t_n + θh) = x_n + h Σ_i b_i(θ) k_i`,
/// `z(t_n + θh) = Σ_i ℓ_i(θ) z_i`.
///
/// # Errors
/// [`Error::Overflow`]
pub(super) fn interpolate_step<M: Dae, T: Real>(
    stages: &dyn StageSolver<M, T>,
    x: &[T],
    y: &[T],
    passed: T,
    h: T,
    dense: &mut Dense<M, T>,
) -> Result<(), Error> {
    let theta = (passed / h).to_f64();
    let (weights, lagrange) = (stages.weights(theta), stages.lagrange(theta));
    let mut unknowns = y.chunks_exact(stages.stage_count());
    for ((to, x), k) in dense.x.as_mut_slice().iter_mut().zip(x).zip(&mut unknowns) {
        *to = *x + h * weighted_sum(&weights, k);
    }
    for (to, z) in dense.z.as_mut_slice().iter_mut().zip(unknowns) {
        *to = weighted_sum(&lagrange, z);
    }
    check_output(dense.x.as_slice(), 0)?;
    check_output(dense.z.as_slice(), 0)
}
