//! How the barrier parameter changes.

use crate::qp::element::set;
use crate::qp::interior::Inequalities;
use crate::qp::{Residuals, nan_max};
use crate::scalar::{Real, Scalar};

/// What the barrier parameter follows.
///
/// ```
/// use casados::ocp::{Barrier, IpmOptions};
///
/// let mut options = IpmOptions::new::<f64>();
/// assert_eq!(options.barrier, Barrier::Adaptive);
/// options.barrier = Barrier::Monotone;
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Barrier {
    /// It shrinks where the barrier problem is solved well enough: Wächter and Biegler (2006), with
    /// proofs of convergence.
    Monotone,
    /// It follows a step without barrier, as far as that gets, which is also corrected for the
    /// products of its changes (S. Mehrotra, SIAM J. Optim. 2, 1992), three times near feasible
    /// points, while residuals shrink and the reduced Hessian is positive definite; where they do
    /// not or it is not, it is monotone until they do and it is. It is monotone for good where no
    /// step is short enough, and where [`final_mu`](super::IpmOptions::final_mu) is not zero.
    /// J. Nocedal, A. Wächter, R. A. Waltz, SIAM J. Optim. 19 (2009).
    #[default]
    Adaptive,
}

/// So many errors are remembered.
const KKT_ERROR_RED_ITERS: usize = 4;
/// `κ`: an error is to be below this part of the largest of them.
const KKT_ERROR_RED_FACT: f64 = 0.9999;
/// So many steps without regularisation, one after the other, end a monotone phase.
const UNREGULARISED_STEPS_BEFORE_FREE_MODE: usize = 3;
/// A monotone phase does not begin with less than this, or the mean product if that is less.
const MONOTONE_MU_INIT: f64 = 0.1;

/// What an adaptive barrier parameter follows.
#[derive(Clone, Copy, Debug)]
pub(in crate::ocp::nlp) struct AdaptiveMu {
    kkt_errors: [f64; KKT_ERROR_RED_ITERS],
    kkt_error_count: usize,
    /// Whether it may follow steps at all.
    allows_free_mode: bool,
    /// Whether it does.
    in_free_mode: bool,
    /// Steps without regularisation, one after the other.
    unregularised_steps: usize,
}

impl AdaptiveMu {
    /// Of a run that begins.
    pub fn new(barrier: Barrier) -> Self {
        let adapts = barrier == Barrier::Adaptive;
        Self {
            kkt_errors: [0.0; KKT_ERROR_RED_ITERS],
            kkt_error_count: 0,
            allows_free_mode: adapts,
            in_free_mode: adapts,
            unregularised_steps: 0,
        }
    }

    /// Whether it may follow steps.
    pub fn allows_free_mode(&self) -> bool {
        self.allows_free_mode
    }

    /// Whether the next step says what `μ` is.
    pub fn is_in_free_mode(&self) -> bool {
        self.in_free_mode
    }

    /// The next `μ` unless a step says what it is, from the error of the barrier problem as a
    /// function of `μ`, and the mean product of slacks and multipliers.
    pub fn update_mu(
        &mut self,
        mu: f64,
        error: impl Fn(f64) -> f64,
        mean_complementarity: f64,
        tolerance: f64,
    ) -> f64 {
        let current_error = error(0.0);
        let largest = self.kkt_errors.iter().take(self.kkt_error_count).fold(0.0, |m: f64, &e| m.max(e));
        let error_decreases =
            self.kkt_error_count < KKT_ERROR_RED_ITERS || current_error <= KKT_ERROR_RED_FACT * largest;
        if error_decreases
            && (self.in_free_mode
                || self.allows_free_mode && self.unregularised_steps >= UNREGULARISED_STEPS_BEFORE_FREE_MODE)
        {
            if let Some(error) = self.kkt_errors.get_mut(self.kkt_error_count % KKT_ERROR_RED_ITERS) {
                *error = current_error;
            }
            self.kkt_error_count += 1;
            self.in_free_mode = true;
            return mu;
        }
        if self.in_free_mode {
            self.in_free_mode = false;
            return initial_monotone_mu(mu, mean_complementarity);
        }
        decrease_mu(mu, error, tolerance)
    }

    /// Counts a step; `μ` if it needed a regularisation and said what `μ` is.
    pub fn count_step(&mut self, regularised: bool, mu: f64, mean_complementarity: f64) -> Option<f64> {
        self.unregularised_steps = if regularised { 0 } else { self.unregularised_steps + 1 };
        let ends = regularised && self.in_free_mode;
        self.in_free_mode &= !regularised;
        ends.then(|| initial_monotone_mu(mu, mean_complementarity))
    }
}

/// `μ` of a monotone phase that begins.
fn initial_monotone_mu(mu: f64, mean_complementarity: f64) -> f64 {
    mu.max(mean_complementarity.min(MONOTONE_MU_INIT))
}

/// The mean of the products of slacks and multipliers.
pub(super) fn mean_complementarity<T: Real>(inequalities: &Inequalities<'_, T>) -> f64 {
    let products =
        inequalities.slack.iter().zip(&*inequalities.multiplier).map(|(s, l)| s.to_f64() * l.to_f64());
    products.fold(0.0, |sum, product| sum + product) / inequalities.slack.len().max(1) as f64
}

/// The least `μ`.
pub(super) fn min_mu(tolerance: f64) -> f64 {
    tolerance / 10.0
}

/// `κ_ε`: a barrier problem is solved well enough where its error is below this times `μ`.
const KAPPA_EPSILON: f64 = 10.0;
/// `κ_μ`
const KAPPA_MU: f64 = 0.2;
/// `θ_μ`
const THETA_MU: f64 = 1.5;

/// `E_μ`: the largest residual of the conditions of the barrier problem.
pub(super) fn barrier_error(residuals: &Residuals, complementarity_error: f64) -> f64 {
    let Residuals { stationarity, dynamics, inequalities, .. } = *residuals;
    [stationarity, dynamics, inequalities].into_iter().fold(complementarity_error, nan_max)
}

/// The largest `|s λ − μ|`.
pub(super) fn max_complementarity_error<T: Real>(slacks: &[T], multipliers: &[T], mu: f64) -> f64 {
    let products = slacks.iter().zip(multipliers);
    products.fold(0.0, |m, (&s, &l)| nan_max(m, (s.to_f64() * l.to_f64() - mu).abs()))
}

/// What is left of the sides, and of `s λ = μ`, in the barrier problem itself: there soft bounds
/// are violated a little everywhere.
pub(super) fn barrier_residuals<T: Real>(inequalities: &Inequalities<'_, T>, mu: f64) -> (f64, f64) {
    let all = inequalities.residual.iter().chain(&*inequalities.equation_residual);
    let largest = all.fold(0.0, |m, residual| nan_max(m, residual.abs().to_f64()));
    (largest, max_complementarity_error(inequalities.slack, inequalities.multiplier, mu))
}

/// The next `μ` where the error is small enough for it.
pub(super) fn decrease_mu(mu: f64, error: impl Fn(f64) -> f64, tolerance: f64) -> f64 {
    let (mut mu, min_mu) = (mu, min_mu(tolerance));
    while mu > min_mu && error(mu) <= KAPPA_EPSILON * mu {
        mu = (KAPPA_MU * mu).min(Scalar::powf(mu, THETA_MU)).max(min_mu);
    }
    mu
}

/// `τ`: slacks and multipliers keep `1 − τ` of what they have.
pub(super) fn fraction_to_boundary(mu: f64) -> f64 {
    (1.0 - mu).max(0.99)
}

/// Slacks shorter than half of the distances from their bounds, by no more than what counts, become
/// as long, and their multipliers less: products stay.
///
/// A side gives way to its multiplier (`Sides::compliance`), and a state that dynamics alone
/// determine does not move: that multiplier would go by steps as small as the distance. Others
/// take over its force.
pub(super) fn reset_small_slacks<T: Real>(
    inequalities: &mut Inequalities<'_, T>,
    mu: f64,
    max_residual: f64,
) {
    let small = T::from_f64(max_residual);
    for ((slack, multiplier), residual) in
        inequalities.slack.iter_mut().zip(&mut *inequalities.multiplier).zip(&mut *inequalities.residual)
    {
        if *residual > *slack && *residual <= small {
            let new_slack = *slack + *residual;
            (*multiplier, *slack, *residual) = (*multiplier * *slack / new_slack, new_slack, T::ZERO);
        }
    }
    correct_bound_multipliers(inequalities, mu);
}

/// `κ_Σ`: multipliers stay within this factor of `μ / s`.
const KAPPA_SIGMA: f64 = 1e10;

/// Keeps multipliers within a factor of `μ / s`, and the sum of both multipliers of a soft side
/// what its violation costs.
pub(super) fn correct_bound_multipliers<T: Real>(inequalities: &mut Inequalities<'_, T>, mu: f64) {
    let count = inequalities.counts.sides();
    for (multiplier, &slack) in inequalities.multiplier.iter_mut().zip(&*inequalities.slack).take(count) {
        let centre = mu / slack.to_f64();
        let clamped = multiplier.to_f64().clamp(centre / KAPPA_SIGMA, centre * KAPPA_SIGMA);
        *multiplier = T::from_f64(clamped);
    }
    let costs = inequalities.linear.iter().zip(&*inequalities.quadratic);
    for (j, (&side, (&linear, &quadratic))) in inequalities.soft.iter().zip(costs).enumerate() {
        let (side, other) = (side as usize, count + j);
        let (Some(&violation), Some(&multiplier)) =
            (inequalities.slack.get(other), inequalities.multiplier.get(side))
        else {
            return;
        };
        let force = linear + quadratic * violation;
        let max_multiplier = force - T::from_f64(1e-3) * force.min(T::from_f64(mu) / violation);
        let multiplier = multiplier.min(max_multiplier);
        set(inequalities.multiplier, side, multiplier);
        set(inequalities.multiplier, other, force - multiplier);
    }
}
