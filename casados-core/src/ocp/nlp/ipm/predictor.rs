//! The step without barrier: what it gets to says what `μ` is, and its changes correct the step
//! towards `μ`.
//!
//! S. Mehrotra, "On the implementation of a primal-dual interior point method", SIAM J. Optim. 2
//! (1992); T. J. Carpenter, I. J. Lustig, J. M. Mulvey, D. F. Shanno, "Higher-order
//! predictor-corrector interior point methods with application to quadratic objectives", SIAM J.
//! Optim. 3 (1993).

use super::barrier;
use super::kkt::newton::resolve;
use super::line_search::longest;
use crate::qp::QpError;
use crate::qp::interior::{Inequalities, Iterate};
use crate::scalar::Real;

/// Corrections one after the other, each for the changes of the step before. With the same factors
/// they cost little beside derivatives, and where a slack and its multiplier both vanish a step
/// leaves a fifteenth of their product instead of a seventh.
const CORRECTIONS: usize = 3;
/// One is enough where more than this is violated, in units: there the QP is far from the problem.
const NEAR: f64 = 0.3;
/// A corrected step that is shorter than this is not taken: products are too different for the
/// correction to be right.
const SHORT: f64 = 0.6;

/// The lengths of the primal and of the dual step that keep `1 − τ` of slacks and multipliers.
pub(super) fn lengths<T: Real>(sides: &Inequalities<'_, T>, tau: f64) -> (f64, f64) {
    let primal = longest(sides.slack, sides.slack_step, tau);
    let dual = longest(sides.multiplier, sides.multiplier_step, tau);
    if needs_equal_steps(sides) { (primal.min(dual), primal.min(dual)) } else { (primal, dual) }
}

/// Violations with a quadratic cost tie the lengths of both steps: `λ + ν = linear + quadratic e`.
pub(super) fn needs_equal_steps<T: Real>(sides: &Inequalities<'_, T>) -> bool {
    sides.quadratic.iter().any(|&quadratic| quadratic > T::ZERO)
}

/// `μ` after the step without barrier that is there: the mean product, times the third power of
/// what that step, as far as it may be gone, leaves of it.
pub(super) fn probe<T: Real>(sides: &Inequalities<'_, T>, least: f64) -> f64 {
    let (primal, dual) = lengths(sides, 1.0);
    let mean = barrier::mean(sides);
    let slacks = sides.slack.iter().zip(&*sides.slack_step);
    let multipliers = sides.multiplier.iter().zip(&*sides.multiplier_step);
    let after = |(value, step): (&T, &T), length: f64| value.to_f64() + length * step.to_f64();
    let products = slacks.zip(multipliers).map(|(s, l)| after(s, primal) * after(l, dual));
    let sum = products.fold(0.0, |sum, product| sum + product);
    let ratio = sum / sides.slack.len().max(1) as f64 / mean;
    // Without sides there is no ratio.
    let ratio = if ratio > 0.0 { ratio.min(1.0) } else { 0.0 };
    (ratio * ratio * ratio * mean).max(least)
}

/// The step towards `μ`, corrected for its own changes, beginning with those of the step without
/// barrier that is there; whether it is.
///
/// # Errors
/// Those of the recursion.
pub(super) fn correct<T: Real>(
    iterate: &mut Iterate<'_, T>,
    mu: f64,
    force: f64,
    violation: f64,
) -> Result<bool, QpError> {
    let corrections = if violation <= NEAR { CORRECTIONS } else { 1 };
    for _ in 0..corrections {
        resolve(iterate, T::from_f64(mu), true)?;
    }
    let tau = barrier::fraction_to_boundary(mu / force);
    let (primal, dual) = lengths(&iterate.sides, tau);
    let is_long = primal.min(dual) >= SHORT && iterate.step.iter().all(|d| d.is_finite());
    if !is_long {
        resolve(iterate, T::from_f64(mu), false)?;
    }
    Ok(is_long)
}
