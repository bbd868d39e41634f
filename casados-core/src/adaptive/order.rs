//! The order: methods of a family, opened when they are needed, and which of them is next.

use super::newton_monitor::Convergence;
use super::replay::StepDifferentiator;
use super::stages::Stages;
use crate::error::Error;
use crate::finite::check_output;
use crate::model::Dae;
use crate::result::Dense;
use crate::scalar::Real;
use crate::shape::Matrix;
use alloc::boxed::Box;

/// The number of stages grows where Newton's method converges at this rate or faster,
const EASY: f64 = 0.01;
/// and falls where it converges at this rate or slower,
const HARD: f64 = 0.8;
/// but grows only if the step size hardly changes,
const STEADY: (f64, f64) = (0.8, 1.2);
/// and not before so many steps have been taken with it.
const SETTLED: usize = 5;

/// The methods that an integrator may change between.
pub trait Family: 'static {
    /// How many.
    const LEVELS: usize;
    /// See [`Engine`].
    const ENDS_ON_STAGE: bool;
    /// What takes their steps again.
    type Replays<M: Dae, T: Real>: StepDifferentiator<M, T> + Default + Send + Sync;
    /// One of them.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    fn open<M: Dae, T: Real>(level: usize) -> Result<Box<dyn Stages<M, T> + Send + Sync>, Error>;
}

/// The number of stages, and what speaks for another one.
#[derive(Clone, Copy, Debug, Default)]
pub struct Order {
    pub level: usize,
    /// How fast Newton's method converged.
    rate: f64,
    /// How many steps were taken with it.
    settled: usize,
    /// Whether an iteration did not converge, or a matrix was singular,
    pub unexpected: bool,
    /// or converged only with a much shorter step.
    pub much_shorter: bool,
}

impl Order {
    /// The level for the next matrix, for a step that is `ratio` times as long as the last one.
    pub fn next(&mut self, convergence: &Convergence, ratio: f64, levels: usize) -> usize {
        self.settled += 1;
        self.rate = convergence.rate.max(0.5 * self.rate).min(10.0);
        let steady = ratio > STEADY.0 && ratio < STEADY.1;
        let easy = convergence.iterations > 1 && self.rate <= EASY;
        let hard = self.rate >= HARD || self.unexpected || self.much_shorter;
        (self.unexpected, self.much_shorter) = (false, false);
        if hard {
            self.level.saturating_sub(1)
        } else if easy && steady && self.settled > SETTLED {
            (self.level + 1).min(levels - 1)
        } else {
            self.level
        }
    }

    /// Counts a step with the matrix of the last one; whether the number of stages is worth a new
    /// matrix instead.
    pub fn keeps(&mut self, levels: usize) -> bool {
        self.settled += 1;
        self.settled >= SETTLED && self.level + 1 < levels
    }

    pub fn change(&mut self, level: usize) {
        (self.level, self.settled) = (level, 1);
    }
}

/// The levels of a family that are in use.
pub struct Orders<M: Dae, T: Real> {
    open: [Option<Box<dyn Stages<M, T> + Send + Sync>>; 3],
}

impl<M: Dae, T: Real> Default for Orders<M, T> {
    fn default() -> Self {
        Self { open: [None, None, None] }
    }
}

impl<M: Dae, T: Real> Orders<M, T> {
    pub fn get<B: Family>(&mut self, level: usize) -> Result<&mut dyn Stages<M, T>, Error> {
        let missing = Error::OutOfMemory { bytes: 0 };
        let place = self.open.get_mut(level).ok_or(missing)?;
        if place.is_none() {
            *place = Some(B::open::<M, T>(level)?);
        }
        match place {
            Some(stages) => Ok(&mut **stages),
            None => Err(missing),
        }
    }

    /// The last accepted step of one level becomes that of another.
    pub fn change<B: Family>(&mut self, from: usize, to: usize) -> Result<(), Error> {
        self.get::<B>(from)?;
        self.get::<B>(to)?;
        let [first, second, third] = &mut self.open;
        let (old, new) = match (from, to) {
            (0, 1) => (first, second),
            (1, 0) => (second, first),
            (1, 2) => (second, third),
            (2, 1) => (third, second),
            _ => return Ok(()),
        };
        if let (Some(old), Some(new)) = (old, new) {
            new.adopt(&**old);
        }
        Ok(())
    }
}

/// `Σ_i weight_i y_i`, a loop of its own, which is not unrolled.
#[inline(never)]
pub(super) fn weighted<T: Real>(weights: &[f64], y: &[T]) -> T {
    weights.iter().zip(y).fold(T::ZERO, |sum, (weight, y)| sum + T::from_f64(*weight) * *y)
}

/// The polynomial of a step: `x(t_n + θh) = x_n + h Σ_i b_i(θ) k_i`,
/// `z(t_n + θh) = Σ_i ℓ_i(θ) z_i`.
///
/// # Errors
/// [`Error::Overflow`]
pub(super) fn interpolate<M: Dae, T: Real>(
    stages: &dyn Stages<M, T>,
    x: &[T],
    y: &[T],
    passed: T,
    h: T,
    dense: &mut Dense<M, T>,
) -> Result<(), Error> {
    let theta = (passed / h).to_f64();
    let (weights, lagrange) = (stages.weights(theta), stages.lagrange(theta));
    let mut unknowns = y.chunks_exact(stages.count());
    for ((to, x), k) in dense.x.as_mut_slice().iter_mut().zip(x).zip(&mut unknowns) {
        *to = *x + h * weighted(&weights, k);
    }
    for (to, z) in dense.z.as_mut_slice().iter_mut().zip(unknowns) {
        *to = weighted(&lagrange, z);
    }
    check_output(dense.x.as_slice(), 0)?;
    check_output(dense.z.as_slice(), 0)
}
