//! Updates of the barrier parameter `μ`.

use crate::ocp::nlp::advanced::BarrierOptions;
use crate::qp::element::set;
use crate::qp::interior::Inequalities;
use crate::qp::{Residuals, nan_max};
use crate::scalar::{Real, Scalar};

/// The update rule of the barrier parameter `μ`.
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
    /// Monotone (Fiacco-McCormick): `μ` decreases when the barrier problem is solved accurately
    /// enough. A. Wächter, L. T. Biegler (2006), with a proof of convergence.
    Monotone,
    /// Adaptive: J. Nocedal, A. Wächter, R. A. Waltz, SIAM J. Optim. 19 (2009). In free mode an
    /// affine-scaling step predicts `μ`, and the step has a higher-order correction (S. Mehrotra,
    /// SIAM J. Optim. 2, 1992), three times near feasible points. The mode is monotone while
    /// residuals do not decrease or the reduced Hessian is not positive definite. It remains
    /// monotone after a failed line search, and if [`final_mu`](super::IpmOptions::final_mu) is
    /// positive.
    #[default]
    Adaptive,
}

/// The memory for KKT errors.
const MAX_KKT_ERRORS: usize = 16;

/// State of the adaptive barrier parameter.
#[derive(Clone, Copy, Debug)]
pub(in crate::ocp::nlp) struct AdaptiveMu {
    options: BarrierOptions,
    kkt_errors: [f64; MAX_KKT_ERRORS],
    kkt_error_count: usize,
    /// Whether free mode is possible.
    allows_free_mode: bool,
    /// Whether the mode is free rather than monotone.
    in_free_mode: bool,
    /// Consecutive steps without regularisation.
    unregularised_steps: usize,
}

impl AdaptiveMu {
    /// The state at the start of a run.
    pub fn new(barrier: Barrier, options: BarrierOptions) -> Self {
        let adapts = barrier == Barrier::Adaptive;
        Self {
            options,
            kkt_errors: [0.0; MAX_KKT_ERRORS],
            kkt_error_count: 0,
            allows_free_mode: adapts,
            in_free_mode: adapts,
            unregularised_steps: 0,
        }
    }

    /// Whether free mode is possible.
    pub fn allows_free_mode(&self) -> bool {
        self.allows_free_mode
    }

    /// Whether the mode is free: the next step determines `μ`.
    pub fn is_in_free_mode(&self) -> bool {
        self.in_free_mode
    }

    /// Chooses the mode, and returns the next `μ` of monotone mode, or the given `μ` in free mode.
    /// `error` is the error of the barrier problem as a function of `μ`; `mean_complementarity` is
    /// the mean product of slacks and multipliers.
    pub fn update_mu(
        &mut self,
        mu: f64,
        error: impl Fn(f64) -> f64,
        mean_complementarity: f64,
        tolerance: f64,
    ) -> f64 {
        let options = self.options;
        let (current_error, count) = (error(0.0), options.adaptive_mu_kkterror_red_iters);
        let errors = self.kkt_errors.iter().take(self.kkt_error_count.min(count));
        let largest = errors.fold(0.0, |m: f64, &e| m.max(e));
        let error_decreases =
            self.kkt_error_count < count || current_error <= options.adaptive_mu_kkterror_red_fact * largest;
        let leaves_monotone_mode =
            self.allows_free_mode && self.unregularised_steps >= options.unregularised_steps_before_free_mode;
        if error_decreases && (self.in_free_mode || leaves_monotone_mode) {
            if let Some(error) = self.kkt_errors.get_mut(self.kkt_error_count % count.max(1)) {
                *error = current_error;
            }
            self.kkt_error_count += 1;
            self.in_free_mode = true;
            return mu;
        }
        if self.in_free_mode {
            self.in_free_mode = false;
            return self.initial_monotone_mu(mu, mean_complementarity);
        }
        options.decrease_mu(mu, error, tolerance)
    }

    /// Counts a step. Returns the first `μ` of monotone mode if a regularised step ends free mode.
    pub fn count_step(&mut self, regularised: bool, mu: f64, mean_complementarity: f64) -> Option<f64> {
        self.unregularised_steps = if regularised { 0 } else { self.unregularised_steps + 1 };
        let ends = regularised && self.in_free_mode;
        self.in_free_mode &= !regularised;
        ends.then(|| self.initial_monotone_mu(mu, mean_complementarity))
    }

    /// The first `μ` of monotone mode.
    fn initial_monotone_mu(&self, mu: f64, mean_complementarity: f64) -> f64 {
        mu.max(mean_complementarity.min(self.options.monotone_mu_init))
    }
}

/// The mean product of slacks and multipliers.
pub(super) fn mean_complementarity<T: Real>(inequalities: &Inequalities<'_, T>) -> f64 {
    let products =
        inequalities.slack.iter().zip(&*inequalities.multiplier).map(|(s, l)| s.to_f64() * l.to_f64());
    products.fold(0.0, |sum, product| sum + product) / inequalities.slack.len().max(1) as f64
}

impl BarrierOptions {
    /// The smallest `μ`.
    pub(super) fn min_mu(&self, tolerance: f64) -> f64 {
        tolerance / self.mu_min_fact
    }

    /// Decreases `μ` while the error of its barrier problem is small enough.
    fn decrease_mu(&self, mu: f64, error: impl Fn(f64) -> f64, tolerance: f64) -> f64 {
        let (mut mu, min_mu) = (mu, self.min_mu(tolerance));
        while mu > min_mu && error(mu) <= self.barrier_tol_factor * mu {
            let superlinear = Scalar::powf(mu, self.mu_superlinear_decrease_power);
            mu = (self.mu_linear_decrease_factor * mu).min(superlinear).max(min_mu);
        }
        mu
    }

    /// `τ`: the fraction-to-the-boundary rule keeps at least `1 − τ` of slacks and multipliers.
    pub(super) fn fraction_to_boundary(&self, mu: f64) -> f64 {
        (1.0 - mu).max(self.tau_min)
    }
}

/// `E_μ`: the largest residual of the barrier problem.
pub(super) fn barrier_error(residuals: &Residuals, complementarity_error: f64) -> f64 {
    let Residuals { stationarity, dynamics, inequalities, .. } = *residuals;
    [stationarity, dynamics, inequalities].into_iter().fold(complementarity_error, nan_max)
}

/// The largest `|s λ − μ|`.
pub(super) fn max_complementarity_error<T: Real>(slacks: &[T], multipliers: &[T], mu: f64) -> f64 {
    let products = slacks.iter().zip(multipliers);
    products.fold(0.0, |m, (&s, &l)| nan_max(m, (s.to_f64() * l.to_f64() - mu).abs()))
}

/// Residuals of the inequalities and of `s λ = μ` in the barrier problem, in which every soft bound
/// has a positive violation.
pub(super) fn barrier_residuals<T: Real>(inequalities: &Inequalities<'_, T>, mu: f64) -> (f64, f64) {
    let all = inequalities.residual.iter().chain(&*inequalities.equation_residual);
    let largest = all.fold(0.0, |m, residual| nan_max(m, residual.abs().to_f64()));
    (largest, max_complementarity_error(inequalities.slack, inequalities.multiplier, mu))
}

/// Sets slacks below half of the distance from their bound to that distance, if they differ by at
/// most `max_residual`. Multipliers decrease accordingly: the products `s λ` are unchanged.
///
/// Inequalities are regularised (`Inequalities::compliance`). Where the dynamics alone determine a
/// state, the state does not move, and its multiplier would decrease only by steps as small as the
/// distance.
pub(super) fn reset_small_slacks<T: Real>(
    inequalities: &mut Inequalities<'_, T>,
    (mu, kappa_sigma): (f64, f64),
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
    correct_bound_multipliers(inequalities, mu, kappa_sigma);
}

/// Keeps multipliers within a factor `κ_Σ` of `μ/s`, and the sum of both multipliers of a soft
/// bound equal to the derivative of its penalty.
pub(super) fn correct_bound_multipliers<T: Real>(
    inequalities: &mut Inequalities<'_, T>,
    mu: f64,
    kappa_sigma: f64,
) {
    let count = inequalities.counts.sides();
    for (multiplier, &slack) in inequalities.multiplier.iter_mut().zip(&*inequalities.slack).take(count) {
        let centre = mu / slack.to_f64();
        let clamped = multiplier.to_f64().clamp(centre / kappa_sigma, centre * kappa_sigma);
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
