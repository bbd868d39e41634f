//! Options of sequential quadratic programming.

use crate::ocp::formulation::error::OcpError;
use crate::ocp::nlp::advanced::AdvancedSqpOptions;

/// The choice of the step length.
///
/// ```
/// use casados::ocp::{Globalisation, SqpOptions};
///
/// assert_eq!(SqpOptions::new::<f64>().globalisation, Globalisation::Merit);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Globalisation {
    /// Full steps, without globalisation.
    FullStep,
    /// Line search with the merit function `f + Σ ν_i |c_i|`, and second-order correction.
    ///
    /// Each constraint has its own weight, `ν_i ← max(|λ_i|, ½ (ν_i + |λ_i|), 0.01 max |λ|)` (M. J.
    /// D. Powell, "A fast algorithm for nonlinearly constrained optimization calculations", 1978,
    /// with a lower bound). All weights grow until the step is a descent direction. A step whose
    /// decrease is less than half of the slope's prediction is halved while that decreases the
    /// merit function further. Near a solution full steps are accepted, and evaluated by the
    /// linearisation of the next iteration.
    ///
    /// With Gauss-Newton Hessians, and after a restart, steps of at most a quarter are replaced by
    /// damped ones while weighted violations exceed the slope of the objective. With exact Hessians
    /// the filter replaces the merit function when steps of at most 1/16 outnumber full steps
    /// without correction by five.
    #[default]
    Merit,
    /// Line search with a filter: objective or violation must decrease relative to all earlier
    /// iterates. With second-order correction.
    Filter,
}

/// Options of [`Sqp`](super::Sqp).
///
/// Later versions may have more fields: change the options of a solver, or write
/// `..SqpOptions::new::<f64>()`.
///
/// ```
/// use casados::ocp::{Globalisation, SqpOptions};
///
/// let options = SqpOptions { globalisation: Globalisation::Filter, ..SqpOptions::new::<f64>() };
/// assert_eq!((options.tolerance, options.max_iterations), (1e-6, 200));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SqpOptions {
    /// The run converges when all four [`Residuals`](crate::qp::Residuals) are at most this;
    /// positive. For units above 100 the tolerance is multiplied by a hundredth of the unit, for
    /// units below 0.01 by the unit ([`scaling`](Self::scaling)). Default 1e-6, in single precision
    /// 1e-3.
    pub tolerance: f64,
    /// The largest number of iterations; then the status is
    /// [`Status::MaxIterations`](crate::ocp::Status::MaxIterations), with the best iterate. With
    /// zero only the start is tested. Default 200.
    pub max_iterations: usize,
    /// The choice of the step length. Default [`Globalisation::Merit`].
    pub globalisation: Globalisation,
    /// Whether QPs start from the solution of the last QP. Default true.
    pub warm_start: bool,
    /// The accuracy of QPs relative to the largest residual, if that is coarser than the tolerance
    /// of the QP solver; the error of the linearisation is larger. QPs are solved to all digits in
    /// the first iteration without multipliers if the error of the gradient could exceed 1e-2,
    /// after a failed step, and after a restart. From 0 to 1, default 1e-4.
    pub qp_accuracy: f64,
    /// Whether elastic mode is on: penalties of bounds of states and constraints while the QP is
    /// infeasible. Default true.
    pub elastic: bool,
    /// The linear penalty of elastic mode; positive. Default 1e3.
    pub elastic_penalty: f64,
    /// Whether constants, tolerances and QPs are in units, computed at the start of a run as
    /// described at [`IpmOptions::scaling`](crate::ocp::IpmOptions::scaling); but the unit of the
    /// objective, too, is one from 0.01 to 100, and all units are powers of two. The log and
    /// residuals are in the units of the problem. Default true.
    pub scaling: bool,
    /// The largest number of QP iterations in one iteration: a third for the QP with hard bounds,
    /// then for the elastic QP and for the feasibility step. If no QP is solved the iterate is
    /// unchanged, and the next iteration tries another QP. Default 100; at least 4.
    pub max_qp_iterations: usize,
    /// The shortest step length of a line search; above 0, at most 1. Default 1e-6.
    pub shortest_step: f64,
    /// Whether a guess is perturbed at which the gradient of a violated constraint vanishes, since
    /// its linearisation has no solution. Default true.
    pub perturb_start: bool,
    /// Whether a run that fails or stalls restarts once: from a simulation with the controls of the
    /// guess, or with perturbed controls if the violations are still those of the guess. Default
    /// true.
    pub restart: bool,
    /// The constants of the algorithm.
    pub advanced: AdvancedSqpOptions,
}

impl SqpOptions {
    /// The defaults for a number type.
    #[must_use]
    pub fn new<T: crate::scalar::Real>() -> Self {
        Self {
            tolerance: if T::EPSILON < 1e-10 { 1e-6 } else { 1e-3 },
            max_iterations: 200,
            globalisation: Globalisation::default(),
            warm_start: true,
            qp_accuracy: 1e-4,
            elastic: true,
            elastic_penalty: 1e3,
            scaling: true,
            shortest_step: 1e-6,
            max_qp_iterations: 100,
            perturb_start: true,
            restart: true,
            advanced: AdvancedSqpOptions::DEFAULT,
        }
    }

    /// # Errors
    /// [`OcpError::InvalidOption`]
    pub(super) fn validate(&self) -> Result<(), OcpError> {
        let positive = |value: f64| value > 0.0 && value.is_finite();
        let (accuracy, step) = (self.qp_accuracy, self.shortest_step);
        for (name, value, is_valid, allowed) in [
            ("tolerance", self.tolerance, positive(self.tolerance), "above 0 and finite"),
            ("qp_accuracy", accuracy, (0.0..=1.0).contains(&accuracy), "from 0 to 1"),
            ("elastic_penalty", self.elastic_penalty, positive(self.elastic_penalty), "above 0 and finite"),
            ("shortest_step", step, step > 0.0 && step <= 1.0, "above 0 and at most 1"),
        ] {
            if !is_valid {
                return Err(OcpError::InvalidOption { name, value, allowed });
            }
        }
        if self.max_qp_iterations < 4 {
            let (name, value) = ("max_qp_iterations", self.max_qp_iterations as f64);
            return Err(OcpError::InvalidOption { name, value, allowed: "at least 4" });
        }
        self.advanced.validate()
    }
}
