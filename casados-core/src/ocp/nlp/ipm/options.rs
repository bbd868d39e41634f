//! Options of the interior-point method.

use super::barrier::Barrier;
use crate::ocp::assembly::units::tolerance_factor;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::nlp::advanced::AdvancedIpmOptions;
use crate::scalar::{Real, Scalar};

/// Options of [`Ipm`](super::Ipm). Symbols are those of Wächter and Biegler, "On the implementation
/// of an interior-point filter line-search algorithm for large-scale nonlinear programming", Math.
/// Program. 106 (2006).
///
/// Later versions may have more fields: change the options of a solver, or write
/// `..IpmOptions::new::<f64>()`.
///
/// ```
/// use casados::ocp::{Barrier, IpmOptions};
///
/// let options = IpmOptions { tolerance: 1e-10, ..IpmOptions::new::<f64>() };
/// assert_eq!((options.barrier, options.max_iterations), (Barrier::Adaptive, 500));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IpmOptions {
    /// The run converges when all four [`Residuals`](crate::qp::Residuals) are at most this.
    /// Stationarity is divided by `s_d`, complementarity by `s_c`:
    /// `max(1, mean |multiplier| / 100)` of all multipliers, and of those of bounds, in their units
    /// ([`scaling`](Self::scaling)). For units above 100 the tolerance is multiplied by a hundredth
    /// of the unit, for units below one by the unit. At the end of a run the unit of
    /// complementarity is the magnitude of the objective. Default 1e-8, in single precision 1e-3.
    pub tolerance: f64,
    /// A run ends as acceptable after `acceptable_iterations` iterations with residuals up to this,
    /// or if it ends without progress or at the maximum number of iterations and the residuals of
    /// the best iterate are at most this. Default 1e-6, in single precision 1e-2.
    pub acceptable_tolerance: f64,
    /// See [`acceptable_tolerance`](Self::acceptable_tolerance); zero means one. Default 15.
    pub acceptable_iterations: usize,
    /// The largest number of iterations; then the status is
    /// [`Status::MaxIterations`](crate::ocp::Status::MaxIterations). With zero only the start is
    /// tested. Default 500: distant guesses take a few hundred.
    pub max_iterations: usize,
    /// The first barrier parameter `μ`, in units of the objective: at most 1e10. Default 0.1.
    pub start_mu: f64,
    /// The last barrier parameter: with a positive value the barrier problem with this `μ` is
    /// solved, whose solutions are smooth functions of the data. Default 0, the problem itself.
    pub final_mu: f64,
    /// The update rule of the barrier parameter. Default [`Barrier::Adaptive`].
    pub barrier: Barrier,
    /// The distance of the initial point from its bounds, relative to their size and to the
    /// distance between two bounds; at most 0.5. It is at least IPOPT's `slack_move`, `ε^(3/4)`:
    /// 1.8e-12, in single precision 6.4e-6. Default 1e-2.
    pub bound_push: f64,
    /// Whether constants of the algorithm are multiples of units, computed at the start of a run.
    /// The unit of the objective `f` is
    ///
    /// ```text
    /// max over i of  unit_i max(|∂f/∂v_i|, |∂²f/∂v_i²| max(|v_i|, unit_i))
    /// ```
    ///
    /// The unit of a variable is its largest guess, one of its bounds or the distance between them,
    /// whichever is nearest to one; the unit of a path or terminal constraint is its largest
    /// gradient or distance from its bounds; both over all stages. Units from 0.01 to 100 are
    /// replaced by one. Iterates, residuals and the log are in the units of the problem. Without
    /// scaling all units are one. Default true.
    pub scaling: bool,
    /// Whether the initial slacks and multipliers are those of the iterate. Default false.
    pub warm_start: bool,
    /// [`bound_push`](Self::bound_push) of a warm start ([`warm_start`](Self::warm_start)). Default
    /// 1e-6.
    pub warm_push: f64,
    /// Whether a failed line search is followed by a restoration phase, then by elastic mode, for
    /// bounds of states and constraints. Default true.
    pub elastic: bool,
    /// The first linear penalty of elastic mode, in units of the objective over units of the
    /// bounded quantity; it grows by factors of ten up to 1e4 times this. At most 1e10. Default
    /// 1e2.
    pub elastic_penalty: f64,
    /// Whether a guess is perturbed at which the gradient of a violated constraint vanishes, since
    /// its linearisation has no solution. Default true.
    pub perturb_start: bool,
    /// Whether a run that fails or stalls restarts once: from a simulation with the controls of the
    /// guess, or with perturbed controls if the violations are still those of the guess. Default
    /// true.
    pub restart: bool,
    /// The constants of the algorithm.
    pub advanced: AdvancedIpmOptions,
}

impl IpmOptions {
    /// The defaults for a number type.
    #[must_use]
    pub fn new<T: Real>() -> Self {
        let (tolerance, acceptable_tolerance) = if T::EPSILON < 1e-10 { (1e-8, 1e-6) } else { (1e-3, 1e-2) };
        Self {
            tolerance,
            acceptable_tolerance,
            acceptable_iterations: 15,
            max_iterations: 500,
            start_mu: 0.1,
            final_mu: 0.0,
            barrier: Barrier::Adaptive,
            bound_push: 1e-2,
            scaling: true,
            warm_start: false,
            warm_push: 1e-6,
            elastic: true,
            elastic_penalty: 1e2,
            perturb_start: true,
            restart: true,
            advanced: AdvancedIpmOptions::DEFAULT,
        }
    }

    /// The tolerance of products of slacks and multipliers in a unit of products, at least ten
    /// times the last barrier parameter.
    pub(super) fn product_tolerance(&self, product_unit: f64) -> f64 {
        (self.tolerance * tolerance_factor(product_unit)).max(10.0 * self.final_mu)
    }

    /// The relative distance of the initial point from its bounds. Slacks below `slack_move`,
    /// `ε^(3/4)`, are smaller than the rounding error of a step along their bound, and make every
    /// step too short.
    pub(super) fn push<T: Real>(&self, warm: bool) -> T {
        let push = if warm { self.warm_push } else { self.bound_push };
        T::from_f64(push.max(Scalar::powf(T::EPSILON, self.advanced.newton.slack_move_exponent)))
    }

    /// The first barrier parameter, scaled by the objective unit.
    pub(super) fn scaled_start_mu(&self, objective_unit: f64) -> f64 {
        (self.start_mu * objective_unit).clamp(self.final_mu, f64::MAX)
    }

    /// Checks that all values are allowed.
    pub(super) fn validate(&self) -> Result<(), OcpError> {
        let positive = [("tolerance", self.tolerance), ("acceptable_tolerance", self.acceptable_tolerance)];
        for (name, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(OcpError::InvalidOption { name, value, allowed: "above 0 and finite" });
            }
        }
        // Products with units of the problem must be finite.
        for (name, value) in [("start_mu", self.start_mu), ("elastic_penalty", self.elastic_penalty)] {
            if !(value > 0.0 && value <= 1e10) {
                return Err(OcpError::InvalidOption { name, value, allowed: "above 0 and at most 1e10" });
            }
        }
        let last = self.final_mu;
        if !(last >= 0.0 && last <= self.start_mu) {
            let allowed = "from 0 to `start_mu`";
            return Err(OcpError::InvalidOption { name: "final_mu", value: last, allowed });
        }
        // Two bounds push the point from opposite sides.
        for (name, value) in [("bound_push", self.bound_push), ("warm_push", self.warm_push)] {
            if !(value > 0.0 && value <= 0.5) {
                return Err(OcpError::InvalidOption { name, value, allowed: "above 0 and at most 0.5" });
            }
        }
        self.advanced.validate()
    }
}
