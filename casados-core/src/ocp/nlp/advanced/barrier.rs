//! Barrier parameter and predictor.

use super::options;

options! {
    /// The barrier parameter `μ` (WB, sections 2.1 and 3.3; NWW).
    ///
    /// ```
    /// use casados::ocp::advanced::BarrierOptions;
    ///
    /// assert_eq!(BarrierOptions::DEFAULT.mu_linear_decrease_factor, 0.2);
    /// ```
    BarrierOptions {
        /// `κ_ε` (WB, section 2.1): a barrier problem is solved if its error is at most this times
        /// `μ`.
        barrier_tol_factor: f64 = 10.0, Positive;
        /// `κ_μ` (WB (7)): the linear decrease of `μ`.
        mu_linear_decrease_factor: f64 = 0.2, BelowOne;
        /// `θ_μ` (WB (7)): the exponent of the superlinear decrease of `μ`.
        mu_superlinear_decrease_power: f64 = 1.5, AboveOne;
        /// The ratio of the tolerance to the smallest `μ` (WB (7)).
        mu_min_fact: f64 = 10.0, AboveOne;
        /// `τ_min` (WB (8)): the fraction-to-the-boundary rule keeps `1 − max(τ_min, 1 − μ)`.
        tau_min: f64 = 0.99, BelowOne;
        /// `κ_Σ` (WB (16)): multipliers stay within this factor of `μ/s`.
        kappa_sigma: f64 = 1e10, AboveOne;
        /// The number of KKT errors that free mode remembers (IPOPT, NWW); at most 16.
        adaptive_mu_kkterror_red_iters: usize = 4, AtMost(16);
        /// In free mode the KKT error is at most this fraction of the largest of them (IPOPT, NWW).
        adaptive_mu_kkterror_red_fact: f64 = 0.9999, Fraction;
        /// The number of consecutive steps without regularisation that ends monotone mode.
        unregularised_steps_before_free_mode: usize = 3, Any;
        /// The first `μ` of monotone mode is the mean product, at most this, or the present `μ`.
        monotone_mu_init: f64 = 0.1, Positive;
        /// Complementarity stalls if it is the only residual above the tolerance in so many
        /// consecutive iterations; then slacks far below the distance from their bound are reset.
        complementarity_stall_iterations: usize = 3, Any;
        /// The least ratio of consecutive errors while complementarity stalls.
        stalled_complementarity_ratio: f64 = 0.9, Positive;
    }
}

options! {
    /// Higher-order corrections in free mode (S. Mehrotra, SIAM J. Optim. 2, 1992; T. J. Carpenter,
    /// I. J. Lustig, J. M. Mulvey, D. F. Shanno, SIAM J. Optim. 3, 1993).
    ///
    /// ```
    /// use casados::ocp::advanced::PredictorOptions;
    ///
    /// assert_eq!(PredictorOptions::DEFAULT.max_corrections, 3);
    /// ```
    PredictorOptions {
        /// The largest number of corrections of a step, each for the products of the last step.
        /// Where a slack and its multiplier both vanish, three corrections leave a fifteenth of
        /// their product, one a seventh.
        max_corrections: usize = 3, Any;
        /// The violation above which there is only one correction: the QP is a poor model there.
        multiple_corrections_violation: f64 = 0.3, NotNegative;
        /// The shortest corrected step; shorter ones are replaced by the uncorrected step.
        min_corrected_step: f64 = 0.6, Fraction;
    }
}
