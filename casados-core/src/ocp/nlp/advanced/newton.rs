//! Newton's equations: scaling, refinement, inertia correction, damping.

use super::options;

options! {
    /// Newton's equations of the barrier problem.
    ///
    /// ```
    /// use casados::ocp::advanced::NewtonOptions;
    ///
    /// assert_eq!(NewtonOptions::DEFAULT.s_max, 100.0);
    /// ```
    NewtonOptions {
        /// `s_max` (WB (6)): larger means of multipliers scale residuals down.
        s_max: f64 = 100.0, Positive;
        /// The unit of a state's gap is at least this fraction of the state.
        min_relative_gap_unit: f64 = 1e-5, NotNegative;
        /// The largest number of refinements with the same factors (IPOPT's `max_refinement_steps`,
        /// 10).
        max_refinement_steps: usize = 3, Any;
        /// Refinement continues while it leaves at most this fraction of the residual (IPOPT's
        /// `residual_improvement_factor`).
        residual_improvement_factor: f64 = 0.5, Fraction;
        /// Refinement stops at this power of the unit roundoff, of values and units of equations
        /// (IPOPT's `residual_ratio_max`, 1e-10).
        residual_exponent: f64 = 2.0 / 3.0, Fraction;
        /// Initial slacks are at least this power of the unit roundoff (IPOPT's `slack_move`).
        slack_move_exponent: f64 = 0.75, Fraction;
        /// The largest least-squares multiplier at the start; otherwise all are zero (WB, section
        /// 3.6).
        constr_mult_init_max: f64 = 1e3, NotNegative;
        /// The multiple of the identity that replaces the Hessian for least-squares multipliers: so
        /// large that steps vanish beside multipliers.
        identity_hessian_weight: f64 = 1e8, Positive;
        /// Multipliers are reset if `δ_w` exceeds this far from a feasible point: their curvature
        /// leaves steps of the size of rounding errors, and they grow with `δ_w`.
        multiplier_reset_delta_w: f64 = 10.0, Positive;
        /// With violations and gaps up to this one, multipliers are kept.
        multiplier_reset_violation: f64 = 1.0, NotNegative;
    }
}

options! {
    /// The inertia correction (WB, section 3.1, algorithm IC): `δ_w` in units of the objective over
    /// squares of units of variables. [`Sqp`](crate::ocp::Sqp) has the constants of
    /// [`QUADRATIC_PROGRAM`](Self::QUADRATIC_PROGRAM).
    ///
    /// ```
    /// use casados::ocp::advanced::InertiaOptions;
    ///
    /// assert_eq!(InertiaOptions::DEFAULT.first_hessian_perturbation, 1e-4);
    /// assert_eq!(InertiaOptions::QUADRATIC_PROGRAM.first_hessian_perturbation, 1e-6);
    /// ```
    InertiaOptions {
        /// The first `δ_w`.
        first_hessian_perturbation: f64 = 1e-4, Positive;
        /// The smallest positive `δ_w`.
        min_hessian_perturbation: f64 = 1e-20, Positive;
        /// The largest `δ_w`; the inertia correction fails beyond it.
        max_hessian_perturbation: f64 = 1e20, Positive;
        /// The growth of `δ_w` in the first inertia correction of a run.
        perturb_inc_fact_first: f64 = 100.0, AboveOne;
        /// The growth of `δ_w` in later ones.
        perturb_inc_fact: f64 = 8.0, AboveOne;
        /// The ratio of the first `δ_w` of an iteration to the last `δ_w`.
        perturb_dec_fact: f64 = 1.0 / 3.0, BelowOne;
        /// The smallest `δ_w` with which directions of vanishing pivots are acceptable.
        vanishing_pivot_perturbation: f64 = 1e-6, NotNegative;
        /// The largest number of increases of `δ_w` after QPs that failed for an unknown reason.
        max_unsolved_qps: usize = 1, Any;
    }
}

impl InertiaOptions {
    /// The defaults of sequential quadratic programming.
    pub const QUADRATIC_PROGRAM: Self = Self {
        first_hessian_perturbation: 1e-6,
        min_hessian_perturbation: 1e-8,
        max_hessian_perturbation: 1e10,
        perturb_inc_fact_first: 4.0,
        perturb_inc_fact: 4.0,
        perturb_dec_fact: 0.25,
        ..Self::DEFAULT
    };
}

options! {
    /// Damping: a lower bound of `δ_w` after short steps. With curved constraints and a nearly
    /// singular reduced Hessian full steps leave the constraints, and the line search makes them
    /// very short; damped directions allow longer steps, as in a trust region.
    ///
    /// ```
    /// use casados::ocp::advanced::DampingOptions;
    ///
    /// assert_eq!(DampingOptions::DEFAULT.short_steps_before_damping, 8);
    /// ```
    DampingOptions {
        /// Steps up to this fraction of the step to the boundary are short.
        short_step_fraction: f64 = 0.1, NotNegative;
        /// The number of consecutive short steps after which steps are damped.
        short_steps_before_damping: usize = 8, Any;
        /// The first damping.
        first_damping: f64 = 1e-3, Positive;
        /// The largest damping; damping is dropped above it.
        max_damping: f64 = 1e2, Positive;
        /// The growth of damping after a short step.
        damping_inc_fact: f64 = 8.0, AboveOne;
        /// The factor by which damping decreases after a full step.
        damping_dec_fact: f64 = 3.0, AboveOne;
    }
}
