//! What can be chosen.

use super::barrier::Barrier;
use crate::ocp::assembly::units::tolerance_factor;
use crate::ocp::formulation::error::OcpError;
use crate::scalar::{Real, Scalar};

/// IPOPT's `slack_move`, as a power of the accuracy of numbers.
const SLACK_MOVE: f64 = 0.75;

/// Options of [`Ipm`](super::Ipm). Letters are those of Wächter and Biegler, "On the implementation
/// of an interior-point filter line-search algorithm for large-scale nonlinear programming", Math.
/// Program. 106 (2006).
///
/// A later version may have more fields: change those of a solver, or write
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
    /// Every one of the four [`Residuals`](crate::qp::Residuals) is to be below: the stationarity
    /// over `s_d` and the complementarity over `s_c`, which are `max(1, mean |multiplier| / 100)`
    /// of all multipliers and of those of bounds in their units ([`scaling`](Self::scaling)).
    /// Complementarity is judged in units of the objective where a run would end.
    /// Where units are above 100 the tolerance is this times a hundredth of them, where they are
    /// below one it is this times the unit. Default 1e-8; of single precision 1e-3.
    pub tolerance: f64,
    /// A point whose residuals stay below this for `acceptable_iterations` is accepted where the
    /// tolerance is not reached, as is the best one where no more steps are gone. Default
    /// 1e-6; of single precision 1e-2.
    pub acceptable_tolerance: f64,
    /// See [`acceptable_tolerance`](Self::acceptable_tolerance); zero is as one. Default 15.
    pub acceptable_iterations: usize,
    /// After so many iterations a run ends with
    /// [`Status::MaxIterations`](crate::ocp::Status::MaxIterations). With zero the start is judged
    /// alone. Default 500: from starts far away a few hundred are taken.
    pub max_iterations: usize,
    /// The first barrier parameter `μ`, in units of forces: at most 1e10. Default 0.1.
    pub start_mu: f64,
    /// The last one: what is solved is the barrier problem with this `μ`, whose solutions are
    /// smooth functions of the data. Default 0, the problem itself.
    pub final_mu: f64,
    /// What it follows. Default [`Barrier::Adaptive`].
    pub barrier: Barrier,
    /// Bounds are left by this at the start, relative to their size and to the room between them;
    /// at most 0.5. A push below IPOPT's `slack_move`, `ε^(3/4)` (1.8e-12; 6.4e-6 in single
    /// precision), is that. Default 1e-2.
    pub bound_push: f64,
    /// Whether constants of the algorithm are multiples of units, found where a run begins. That of
    /// forces is
    ///
    /// ```text
    /// max over i of  unit_i max(|∂f/∂v_i|, |∂²f/∂v_i²| max(|v_i|, unit_i))
    /// ```
    ///
    /// of the objective `f`. The unit of a variable is its largest guess, one of its bounds or the
    /// room between them, whichever is nearest to one, and that of a path or terminal constraint
    /// its largest gradient or distance from the bounds, over all stages; from 0.01 to 100 it is
    /// one. Iterates, residuals and the log are in the units of the problem. Without this all
    /// units are one. Default true.
    pub scaling: bool,
    /// Whether slacks and multipliers begin at those of the iterate. Default false.
    pub warm_start: bool,
    /// As [`bound_push`](Self::bound_push), where the start is warm
    /// ([`warm_start`](Self::warm_start)). Default 1e-6.
    pub warm_push: f64,
    /// Whether violations of bounds of states and constraints alone are made small where no step
    /// makes progress, and then get penalties beside the objective. Default true.
    pub elastic: bool,
    /// The first of these penalties, linear, in units of forces over those of what is bounded; they
    /// grow by factors of ten up to ten thousand times that. At most 1e10. Default 1e2.
    pub elastic_penalty: f64,
    /// Whether a run begins at a point beside a guess at which the gradient of a violated
    /// constraint vanishes: its linearisation says nothing of where it holds. Default true.
    pub perturb_start: bool,
    /// Whether a run that fails, or leads nowhere for long, begins once more: at a simulation with
    /// the controls of the guess, or beside it where violations are still those of the guess.
    /// Default true.
    pub restart: bool,
}

impl IpmOptions {
    /// For numbers of some precision.
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
        }
    }

    /// What products of slacks and multipliers have to be below, by the unit of the objective, or
    /// what the last barrier parameter leaves of them.
    pub(super) fn product_tolerance(&self, product_unit: f64) -> f64 {
        (self.tolerance * tolerance_factor(product_unit)).max(10.0 * self.final_mu)
    }

    /// How far bounds are left at the start. A slack of less than `slack_move`, `ε^(3/4)`, is
    /// smaller than what rounding leaves of a step along its bound, and lets no step go far enough.
    pub(super) fn push<T: Real>(&self, warm: bool) -> T {
        let push = if warm { self.warm_push } else { self.bound_push };
        T::from_f64(push.max(Scalar::powf(T::EPSILON, SLACK_MOVE)))
    }

    /// The first barrier parameter.
    pub(super) fn scaled_start_mu(&self, objective_unit: f64) -> f64 {
        (self.start_mu * objective_unit).clamp(self.final_mu, f64::MAX)
    }

    /// Finds values that no run can have.
    pub(super) fn validate(&self) -> Result<(), OcpError> {
        let positive = [("tolerance", self.tolerance), ("acceptable_tolerance", self.acceptable_tolerance)];
        for (name, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(OcpError::InvalidOption { name, value, allowed: "above 0 and finite" });
            }
        }
        // Products with units of the problem are finite.
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
        // Two bounds push from both sides.
        for (name, value) in [("bound_push", self.bound_push), ("warm_push", self.warm_push)] {
            if !(value > 0.0 && value <= 0.5) {
                return Err(OcpError::InvalidOption { name, value, allowed: "above 0 and at most 0.5" });
            }
        }
        Ok(())
    }
}
