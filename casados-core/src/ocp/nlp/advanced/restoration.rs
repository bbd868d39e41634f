//! Restoration phase, elastic mode, test for unboundedness.

use super::options;

options! {
    /// Restoration phase (WB, section 3.3; J. Nocedal, S. J. Wright, "Numerical Optimization",
    /// section 18.6) and elastic mode.
    ///
    /// ```
    /// use casados::ocp::advanced::RestorationOptions;
    ///
    /// assert_eq!(RestorationOptions::DEFAULT.max_restoration_phases, 4);
    /// ```
    RestorationOptions {
        /// The largest number of restoration phases in a run.
        max_restoration_phases: usize = 4, Any;
        /// The ratio of the objective unit in the phase to that of the problem: it makes the
        /// curvature of the objective, which is the proximal term, small.
        resto_penalty_scaling: f64 = 1e3, Positive;
        /// With violations up to this one, the first recovery is a monotone barrier.
        monotone_retry_violation: f64 = 1e-2, NotNegative;
        /// Violations and gaps up to which the phase ends.
        small_violation: f64 = 1e-4, Positive;
        /// Violations are stationary if, to first order, no step reduces them by more than this.
        stationary_decrease_ratio: f64 = 1e-4, Positive;
        /// Gaps relative to violations up to which violations may be stationary.
        closed_gap_ratio: f64 = 1e-5, Positive;
        /// The growth of penalties in elastic mode.
        penalty_inc_fact: f64 = 10.0, AboveOne;
        /// The largest ratio of penalties to the first ones.
        max_penalty_factor: f64 = 1e4, Positive;
        /// A violation is stationary if a larger penalty leaves more than this fraction of it.
        stationary_elastic_ratio: f64 = 0.9, Fraction;
        /// The first barrier parameter of both, in units of the objective.
        elastic_mu: f64 = 0.1, Positive;
    }
}

options! {
    /// The test for unboundedness.
    ///
    /// ```
    /// use casados::ocp::advanced::UnboundedOptions;
    ///
    /// assert_eq!(UnboundedOptions::DEFAULT.diverging_iterates_tol, 1e12);
    /// ```
    UnboundedOptions {
        /// Variables above this multiple of the largest magnitude in the data are diverging (IPOPT:
        /// 1e20, absolute); the recession direction decides.
        diverging_iterates_tol: f64 = 1e12, Positive;
        /// The growth of variables between two tests.
        ray_retry_growth: f64 = 1e3, AboveOne;
        /// The ratio of the lengths of consecutive points of the ray.
        ray_length_ratio: f64 = 1e4, AboveOne;
        /// The number of points of the ray: to 1e36, to detect a distant minimum.
        ray_points: usize = 10, Any;
    }
}
