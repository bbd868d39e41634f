//! What can be chosen.

use crate::ocp::formulation::error::OcpError;

/// How far a step goes.
///
/// ```
/// use casados::ocp::{Globalisation, SqpOptions};
///
/// assert_eq!(SqpOptions::new::<f64>().globalisation, Globalisation::Merit);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Globalisation {
    /// All the way, always.
    FullStep,
    /// As far as the merit function `f + Σ ν_i |c_i|` shrinks as it should, with second-order
    /// correction. Each constraint has a weight of its own, which follows its multiplier:
    /// `ν_i ← max(|λ_i|, ½ (ν_i + |λ_i|), 0.01 max |λ|)` (M. J. D. Powell, "A fast algorithm for
    /// nonlinearly constrained optimization calculations", 1978, and a bound from below). Where the
    /// step is no direction of descent all of them grow until it is. A step along which the merit
    /// function shrinks by less than half of what its slope promises is halved as long as that is
    /// better: the least of a parabola is before its end. Near a solution
    /// full steps are what it accepts: the linearisation there is that of the next iteration. With
    /// the Hessian of Gauss and Newton, and after a first attempt that failed, steps of a quarter
    /// or less give way to damped ones while weighted gaps are more than what the objective changes
    /// by. With exact Hessians the filter decides from then on where five steps more were a
    /// sixteenth or less than full ones without a correction.
    #[default]
    Merit,
    /// As far as objective or violation shrink compared to all iterates before, with second-order
    /// correction.
    Filter,
}

/// Options of [`Sqp`](super::Sqp).
///
/// A later version may have more fields: change those of a solver, or write
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
    /// Every one of the four [`Residuals`](crate::qp::Residuals) is to be below; positive. Where
    /// units are above 100 it is this times a hundredth of them, where they are below 0.01 it is
    /// this times the unit ([`scaling`](Self::scaling)). Default 1e-6; of single precision 1e-3.
    pub tolerance: f64,
    /// After so many iterations a run ends with
    /// [`Status::MaxIterations`](crate::ocp::Status::MaxIterations) and the best iterate. With zero
    /// the start is judged alone. Default 200.
    pub max_iterations: usize,
    /// Default [`Globalisation::Merit`].
    pub globalisation: Globalisation,
    /// Whether QPs begin at the solution of the one before. Default true.
    pub warm_start: bool,
    /// QPs are solved to this part of the largest residual, if that is more than the solver's own
    /// tolerance: what the linearisation is off by is more. They are solved to all digits where a
    /// run begins without multipliers and gradients might be wrong by more than 1e-2, where no
    /// step makes progress otherwise, and in a second attempt. From 0 to 1, default 1e-4.
    pub qp_accuracy: f64,
    /// Whether bounds of states and constraints get penalties while a QP is infeasible. Default
    /// true.
    pub elastic: bool,
    /// These penalties, linear; positive. Default 1e3.
    pub elastic_penalty: f64,
    /// Whether constants, tolerances and QPs are in units, found where a run begins, as
    /// [`IpmOptions::scaling`](crate::ocp::IpmOptions::scaling) says; but that of forces is one,
    /// too, from 0.01 to 100, and all are powers of two. The log and residuals are in the units of
    /// the problem. Default true.
    pub scaling: bool,
    /// QPs of an iteration have at most so many iterations, in sum: a third of them with hard
    /// bounds, then with penalties, then for the least violations. Where they are not solved
    /// by then the iterate stays, and the next iteration tries another QP. Default 100; at least 4.
    pub max_qp_iterations: usize,
    /// The shortest step of a line search; above 0, at most 1. Default 1e-6.
    pub shortest_step: f64,
    /// Whether a run begins at a point beside a guess at which the gradient of a violated
    /// constraint vanishes: its linearisation says nothing of where it holds. Default true.
    pub perturb_start: bool,
    /// Whether a run that fails, or leads nowhere for long, begins once more: at a simulation with
    /// the controls of the guess, or beside it where violations are still those of the guess.
    /// Default true.
    pub restart: bool,
}

impl SqpOptions {
    /// For numbers of some precision.
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
        Ok(())
    }
}
