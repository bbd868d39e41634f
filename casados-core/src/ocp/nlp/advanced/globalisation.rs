//! Filter and line search.

use super::options;

options! {
    /// The filter (R. Fletcher, S. Leyffer, Math. Program. 91, 2002; WB, section 2.3).
    ///
    /// ```
    /// use casados::ocp::advanced::FilterOptions;
    ///
    /// assert_eq!(FilterOptions::DEFAULT.gamma_theta, 1e-5);
    /// ```
    FilterOptions {
        /// `γ_θ` (WB (18)): the relative decrease of the violation that the filter requires.
        gamma_theta: f64 = 1e-5, BelowOne;
        /// `γ_φ` (WB (18)): the decrease of the objective that the filter requires, per violation.
        gamma_phi: f64 = 1e-5, BelowOne;
        /// `s_φ` (WB (19)): the exponent of the slope in the switching condition.
        s_phi: f64 = 2.3, AboveOne;
        /// `s_θ` (WB (19)): the exponent of the violation in the switching condition.
        s_theta: f64 = 1.1, AboveOne;
        /// `η_φ` (WB (20)): Armijo's constant. IPOPT: 1e-8.
        eta_phi: f64 = 1e-4, BelowOne;
        /// `θ_max` over the first violation, at least one (WB, section 2.3). Interior point only.
        theta_max_fact: f64 = 1e4, Positive;
        /// `θ_min` over the first violation, at least one (WB, section 2.3). Interior point only.
        theta_min_fact: f64 = 1e-4, Positive;
    }
}

options! {
    /// The line search of the interior point (WB, sections 2.3 and 2.4).
    ///
    /// ```
    /// use casados::ocp::advanced::LineSearchOptions;
    ///
    /// assert_eq!(LineSearchOptions::DEFAULT.max_soc, 4);
    /// ```
    LineSearchOptions {
        /// `γ_α` (WB (23)): the factor of the shortest step.
        alpha_min_frac: f64 = 0.05, Fraction;
        /// The lower bound of the shortest step: the step changes no digit of a variable.
        min_alpha: f64 = 1e-14, Positive;
        /// The factor between trial steps (IPOPT).
        alpha_red_factor: f64 = 0.5, BelowOne;
        /// The largest number of second-order corrections of a step (WB, section 2.4).
        max_soc: usize = 4, Any;
        /// `κ_soc` (WB, section 2.4): a correction that leaves more of the violation is the last.
        kappa_soc: f64 = 0.99, Positive;
        /// The largest ratio of violations after and before a step. The reference is at most the
        /// first violation, or one: a decreasing objective must not lead far from feasible points.
        max_violation_growth: f64 = 10.0, Positive;
        /// Steps up to this many roundoff units of a variable and its unit are tiny (IPOPT's
        /// `tiny_step_tol`).
        tiny_step_tol: f64 = 10.0, NotNegative;
        /// The largest violation with which a step may be tiny (IPOPT, fixed).
        tiny_step_violation: f64 = 1e-4, NotNegative;
        /// Differences of functions up to this many roundoff units are rounding errors (IPOPT: 10).
        rounding_units: f64 = 10.0, Positive;
    }
}
