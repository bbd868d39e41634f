//! Mehrotra's predictor: the affine-scaling step (`μ = 0`) predicts `μ`, and its products of slack
//! and multiplier changes correct the step towards `μ`.
//!
//! S. Mehrotra, "On the implementation of a primal-dual interior point method", SIAM J. Optim. 2
//! (1992); T. J. Carpenter, I. J. Lustig, J. M. Mulvey, D. F. Shanno, "Higher-order
//! predictor-corrector interior point methods with application to quadratic objectives", SIAM J.
//! Optim. 3 (1993).

use super::barrier;
use super::kkt::newton::resolve;
use super::line_search::max_step_to_boundary;
use crate::ocp::nlp::advanced::AdvancedIpmOptions;
use crate::qp::QpError;
use crate::qp::interior::{Inequalities, Iterate};
use crate::scalar::Real;

/// Returns the primal and the dual step length that keep `1 − τ` of slacks and multipliers.
pub(super) fn step_lengths<T: Real>(inequalities: &Inequalities<'_, T>, tau: f64) -> (f64, f64) {
    let primal = max_step_to_boundary(inequalities.slack, inequalities.slack_step, tau);
    let dual = max_step_to_boundary(inequalities.multiplier, inequalities.multiplier_step, tau);
    if needs_equal_step_lengths(inequalities) { (primal.min(dual), primal.min(dual)) } else { (primal, dual) }
}

/// Whether primal and dual step lengths must be equal: quadratic penalties couple them by
/// `λ + ν = linear + quadratic e`.
pub(super) fn needs_equal_step_lengths<T: Real>(inequalities: &Inequalities<'_, T>) -> bool {
    inequalities.quadratic.iter().any(|&quadratic| quadratic > T::ZERO)
}

/// Returns `μ` predicted by the present affine-scaling step: the mean complementarity times the
/// cube of the fraction that the step leaves.
pub(super) fn probing_mu<T: Real>(inequalities: &Inequalities<'_, T>, min_mu: f64) -> f64 {
    let (primal, dual) = step_lengths(inequalities, 1.0);
    let mean_complementarity = barrier::mean_complementarity(inequalities);
    let slacks = inequalities.slack.iter().zip(&*inequalities.slack_step);
    let multipliers = inequalities.multiplier.iter().zip(&*inequalities.multiplier_step);
    let value_after_step = |(value, step): (&T, &T), length: f64| value.to_f64() + length * step.to_f64();
    let products =
        slacks.zip(multipliers).map(|(s, l)| value_after_step(s, primal) * value_after_step(l, dual));
    let sum = products.fold(0.0, |sum, product| sum + product);
    let ratio = sum / inequalities.slack.len().max(1) as f64 / mean_complementarity;
    // Without inequalities the ratio is not a number.
    let ratio = if ratio > 0.0 { ratio.min(1.0) } else { 0.0 };
    (ratio * ratio * ratio * mean_complementarity).max(min_mu)
}

/// Computes the step towards `μ` with higher-order corrections, starting from the present
/// affine-scaling step. Returns whether the corrected step is accepted; otherwise the step is the
/// uncorrected one.
///
/// # Errors
/// The errors of the recursion.
pub(super) fn corrected_step<T: Real>(
    iterate: &mut Iterate<'_, T>,
    mu: f64,
    (objective_unit, violation): (f64, f64),
    AdvancedIpmOptions { predictor, barrier, .. }: &AdvancedIpmOptions,
) -> Result<bool, QpError> {
    let allows_several = violation <= predictor.multiple_corrections_violation;
    let corrections = predictor.max_corrections.min(if allows_several { usize::MAX } else { 1 });
    for _ in 0..corrections {
        resolve(iterate, T::from_f64(mu), true)?;
    }
    let tau = barrier.fraction_to_boundary(mu / objective_unit);
    let (primal, dual) = step_lengths(&iterate.inequalities, tau);
    let is_accepted = corrections > 0
        && primal.min(dual) >= predictor.min_corrected_step
        && iterate.step.iter().all(|d| d.is_finite());
    if !is_accepted {
        resolve(iterate, T::from_f64(mu), false)?;
    }
    Ok(is_accepted)
}
