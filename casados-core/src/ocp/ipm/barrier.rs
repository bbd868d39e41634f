//! How the barrier parameter changes.

use crate::qp::Residuals;
use crate::qp::interior::Sides;
use crate::scalar::{Real, Scalar};

/// What the barrier parameter follows.
///
/// ```
/// use casados::ocp::{Barrier, IpmOptions};
///
/// let mut options = IpmOptions::new::<f64>();
/// assert_eq!(options.barrier, Barrier::Monotone);
/// options.barrier = Barrier::Adaptive;
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Barrier {
    /// It shrinks where the barrier problem is solved well enough: Wächter and Biegler (2006), with
    /// proofs of convergence.
    #[default]
    Monotone,
    /// It follows the products of slacks and multipliers from iteration to iteration (the rule of
    /// LOQO), while residuals shrink; where they do not, it is monotone until they do. J. Nocedal,
    /// A. Wächter, R. A. Waltz, SIAM J. Optim. 19 (2009).
    Adaptive,
}

/// So many errors are remembered.
const REMEMBERED: usize = 4;
/// `κ`: an error is to be below this part of the largest of them.
const PROGRESS: f64 = 0.9999;
/// A monotone phase begins at this part of the mean product.
const BEGIN: f64 = 0.8;

/// What an adaptive barrier parameter remembers.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Progress {
    errors: [f64; REMEMBERED],
    count: usize,
    /// Whether the phase is a monotone one.
    monotone: bool,
}

impl Progress {
    /// The next `μ`, from the error of the problem itself, and slacks and multipliers.
    pub fn next<T: Real>(
        &mut self,
        mu: f64,
        error: impl Fn(f64) -> f64,
        [slacks, multipliers]: [&[T]; 2],
        tolerance: f64,
    ) -> f64 {
        let (now, least) = (error(0.0), tolerance / 10.0);
        let largest = self.errors.iter().take(self.count).fold(0.0, |m: f64, &e| m.max(e));
        let (mean, spread) = centrality(slacks, multipliers);
        if self.count < REMEMBERED || now <= PROGRESS * largest {
            if let Some(error) = self.errors.get_mut(self.count % REMEMBERED) {
                *error = now;
            }
            self.count += 1;
            self.monotone = false;
            return (loqo(spread) * mean).max(least);
        }
        if self.monotone {
            return shrink(mu, error, tolerance);
        }
        self.monotone = true;
        (BEGIN * mean).max(least)
    }
}

/// The mean of the products of slacks and multipliers, and the least one as a part of it.
fn centrality<T: Real>(slacks: &[T], multipliers: &[T]) -> (f64, f64) {
    let products = || slacks.iter().zip(multipliers).map(|(s, l)| s.to_f64() * l.to_f64());
    let count = slacks.len().max(1) as f64;
    let mean = products().fold(0.0, |sum, product| sum + product) / count;
    let least = products().fold(f64::INFINITY, f64::min);
    (mean, if mean > 0.0 { (least / mean).clamp(0.0, 1.0) } else { 1.0 })
}

/// `σ` of the rule of LOQO: small where all products are alike (R. J. Vanderbei, D. F. Shanno,
/// Comput. Optim. Appl. 13, 1999).
fn loqo(spread: f64) -> f64 {
    let factor = if spread > 0.0 { (0.05 * (1.0 - spread) / spread).min(2.0) } else { 2.0 };
    0.1 * factor * factor * factor
}

/// `κ_ε`: a barrier problem is solved well enough where its error is below this times `μ`.
const ENOUGH: f64 = 10.0;
/// `κ_μ`
const LINEAR: f64 = 0.2;
/// `θ_μ`
const SUPERLINEAR: f64 = 1.5;

/// `E_μ`: the largest residual of the conditions of the barrier problem.
pub(super) fn error(residuals: &Residuals, farthest: f64) -> f64 {
    let Residuals { stationarity, dynamics, inequalities, .. } = *residuals;
    [stationarity, dynamics, inequalities].into_iter().fold(farthest, larger)
}

/// The largest `|s λ − μ|`.
pub(super) fn farthest<T: Real>(slacks: &[T], multipliers: &[T], mu: f64) -> f64 {
    let products = slacks.iter().zip(multipliers);
    products.fold(0.0, |m, (&s, &l)| larger(m, (s.to_f64() * l.to_f64() - mu).abs()))
}

/// What is left of the sides, and of `s λ = μ`, in the barrier problem itself: there soft bounds
/// are violated a little everywhere.
pub(super) fn residuals<T: Real>(sides: &Sides<'_, T>, mu: f64) -> (f64, f64) {
    let all = sides.residual.iter().chain(&*sides.equation_residual);
    let largest = all.fold(0.0, |m, residual| larger(m, residual.abs().to_f64()));
    (largest, farthest(sides.slack, sides.multiplier, mu))
}

/// The larger one; NaN stays.
fn larger(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}

/// The next `μ` where the error is small enough for it.
pub(super) fn shrink(mu: f64, error: impl Fn(f64) -> f64, tolerance: f64) -> f64 {
    let (mut mu, least) = (mu, tolerance / 10.0);
    while mu > least && error(mu) <= ENOUGH * mu {
        mu = (LINEAR * mu).min(Scalar::powf(mu, SUPERLINEAR)).max(least);
    }
    mu
}

/// `τ`: slacks and multipliers keep `1 − τ` of what they have.
pub(super) fn fraction_to_boundary(mu: f64) -> f64 {
    (1.0 - mu).max(0.99)
}
