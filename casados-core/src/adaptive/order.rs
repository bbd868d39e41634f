//! Order selection: the methods of a family, allocated on first use, and the choice of the next
//! one.

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

/// The number of stages increases up to this contraction rate of Newton's method.
const FAST_CONTRACTION_RATE: f64 = 0.01;
/// The number of stages decreases from this contraction rate.
const SLOW_CONTRACTION_RATE: f64 = 0.8;
/// The number of stages increases only if the ratio of step sizes is in this range.
const STEADY_STEP_RATIO: (f64, f64) = (0.8, 1.2);

/// The methods among which an integrator selects.
pub trait MethodFamily: 'static {
    /// The number of methods.
    const ORDER_COUNT: usize;
    /// See [`Engine`].
    const ENDS_ON_STAGE: bool;
    /// Differentiates the steps of the methods.
    type Differentiator<M: Dae, T: Real>: StepDifferentiator<M, T> + Default + Send + Sync;
    /// Creates the method of a level.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    fn open<M: Dae, T: Real>(level: usize) -> Result<Box<dyn StageSolver<M, T> + Send + Sync>, Error>;
}

/// The number of stages, and the criteria for its change.
#[derive(Clone, Copy, Debug, Default)]
pub struct OrderSelection {
    pub order_index: usize,
    /// The number of methods.
    order_count: usize,
    /// The contraction rate of Newton's method.
    contraction_rate: f64,
    /// Whether an iteration did not converge, or a matrix was singular.
    pub iteration_failed: bool,
    /// Whether a slow iteration reduced the step to half or less.
    pub step_was_halved: bool,
}

impl OrderSelection {
    /// The lowest of this number of orders.
    pub fn lowest(order_count: usize) -> Self {
        Self { order_count, ..Self::default() }
    }

    /// Whether the order may increase after a step: it is not the highest one, and the iteration
    /// has measured a contraction rate.
    pub fn may_increase(&self, convergence: &NewtonMonitor) -> bool {
        self.order_index + 1 < self.order_count && convergence.iterations > 1
    }

    /// The order for the next matrix, of a step that is `ratio` times as long as the last one.
    pub fn select_order(&mut self, convergence: &NewtonMonitor, ratio: f64) -> usize {
        self.contraction_rate = convergence.contraction_rate.max(0.5 * self.contraction_rate).min(10.0);
        let steady = ratio > STEADY_STEP_RATIO.0 && ratio < STEADY_STEP_RATIO.1;
        let easy = self.may_increase(convergence) && self.contraction_rate <= FAST_CONTRACTION_RATE;
        let hard =
            self.contraction_rate >= SLOW_CONTRACTION_RATE || self.iteration_failed || self.step_was_halved;
        (self.iteration_failed, self.step_was_halved) = (false, false);
        if hard {
            self.order_index.saturating_sub(1)
        } else if easy && steady {
            self.order_index + 1
        } else {
            self.order_index
        }
    }
}

/// The allocated methods of a family.
pub struct MethodsByOrder<M: Dae, T: Real> {
    methods: [Option<Box<dyn StageSolver<M, T> + Send + Sync>>; 3],
}

impl<M: Dae, T: Real> Default for MethodsByOrder<M, T> {
    fn default() -> Self {
        Self { methods: [None, None, None] }
    }
}

impl<M: Dae, T: Real> MethodsByOrder<M, T> {
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

    /// Converts the last accepted step of one level to another.
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

/// `Σ_i weight_i y_i`; a separate loop, which is not unrolled.
#[inline(never)]
pub(super) fn weighted_sum<T: Real>(weights: &[f64], y: &[T]) -> T {
    weights.iter().zip(y).fold(T::ZERO, |sum, (weight, y)| sum + T::from_f64(*weight) * *y)
}

/// Dense output of a step: `x(t_n + θh) = x_n + h Σ_i b_i(θ) k_i`, `z(t_n + θh) = Σ_i ℓ_i(θ) z_i`.
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
