//! Options of the interior point.

use crate::qp::error::QpError;
use crate::scalar::Real;

/// Options of the interior point.
///
/// ```
/// # use casados::ocp::{HeapRealTime, HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
/// # use casados::prelude::*;
/// use casados::qp::InteriorPointOptions;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(10, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// let mut controller = HeapRealTime::new(ocp)?;
/// // A sample takes so long at most.
/// controller.qp_solver.options =
///     InteriorPointOptions { max_iterations: 20, locate: false, ..InteriorPointOptions::new::<f64>() };
/// assert!(controller.prepare()?.feedback(&[0.8])?.statistics.iterations <= 20);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InteriorPointOptions {
    /// The tolerance of each of the four [`Residuals`](crate::qp::Residuals); `relative_tolerance`
    /// may allow more. Default 1e-8; in single precision 1e-4.
    pub tolerance: f64,
    /// The tolerance of residuals relative to the largest of their terms: for stationarity and
    /// complementarity `H v`, `h`, gradients of constraints and multipliers `π`; for dynamics and
    /// inequalities `v`, values of general constraints and `b`. The larger of this and `tolerance`
    /// holds. Default 0; in single precision, whose terms have seven digits, 1e-5.
    pub relative_tolerance: f64,
    /// The maximum number of iterations, including active sets of a warm start; then the error is
    /// [`QpError::MaxIterations`](crate::qp::QpError::MaxIterations). With zero the start must be a
    /// solution. Default 50.
    pub max_iterations: usize,
    /// The initial barrier parameter `mu`, the product of slacks and multipliers. Default 1.
    pub start_mu: f64,
    /// The maximum number of active sets of a warm start, before slacks and multipliers are moved
    /// away from zero and the interior point starts. Each costs less than an iteration of the
    /// interior point, and counts as one. A cold start tries the solution without active bounds,
    /// unless the zero point violates one. Default 4.
    pub active_sets: usize,
    /// The smallest slack and multiplier of a warm start. Default 1e-3.
    pub warm_distance: f64,
    /// Whether an unsolved QP is tried again with `max_iterations` for each attempt: from a cold
    /// start, with proximal terms, and with all bounds soft, to locate constraints that cannot be
    /// satisfied. Otherwise it is tried again with the remaining iterations. Default true.
    pub locate: bool,
    /// Whether sizes of variables, constraints and the objective are computed from the data as
    /// units of all tolerances: the units of variables (pascal, kilometres) then do not matter. If
    /// no size is above 32 or below its inverse, all units are one. Otherwise all residuals in
    /// units must be below a tenth of `tolerance`, and without units below the larger of
    /// `tolerance` and `1e6 ε` of their largest term, in single precision 1e-5 of it. Default true;
    /// [`HeapSqp`](crate::ocp::HeapSqp), which scales QPs itself, disables it.
    pub scaling: bool,
    /// Lower bounds of at most minus this and upper bounds of at least this are no bounds. Default
    /// 1e15; in single precision 1e7, where seven digits leave no unit.
    pub no_bound: f64,
}

impl InteriorPointOptions {
    /// The default options for a precision.
    #[must_use]
    pub fn new<T: Real>() -> Self {
        let (tolerance, relative_tolerance) = if T::EPSILON < 1e-10 { (1e-8, 0.0) } else { (1e-4, 1e-5) };
        Self {
            tolerance,
            relative_tolerance,
            max_iterations: 50,
            start_mu: 1.0,
            active_sets: 4,
            warm_distance: 1e-3,
            locate: true,
            scaling: true,
            no_bound: if T::EPSILON < 1e-10 { 1e15 } else { 1e7 },
        }
    }

    /// # Errors
    /// [`QpError::InvalidOption`]
    pub(super) fn check<T: Real>(&self) -> Result<(), QpError> {
        let infinity = T::from_f64(f64::INFINITY);
        let positive = |value: T| value > T::ZERO && value < infinity;
        let (absolute, relative) = (T::from_f64(self.tolerance), T::from_f64(self.relative_tolerance));
        let tolerance = absolute >= T::ZERO && absolute < infinity;
        let none = !(absolute > T::ZERO || relative > T::ZERO);
        let all = [
            (
                "tolerance",
                self.tolerance,
                tolerance && !none,
                "at least 0 and finite, and above 0 if `relative_tolerance` is 0",
            ),
            (
                "relative_tolerance",
                self.relative_tolerance,
                relative >= T::ZERO && relative < T::ONE,
                "at least 0 and below 1",
            ),
            ("start_mu", self.start_mu, positive(T::from_f64(self.start_mu)), "above 0 and finite"),
            (
                "warm_distance",
                self.warm_distance,
                positive(T::from_f64(self.warm_distance)),
                "above 0 and finite",
            ),
            (
                "no_bound",
                self.no_bound,
                T::from_f64(self.no_bound) > T::ZERO,
                "above 0, or inf if all bounds count",
            ),
        ];
        for (name, value, is_valid, allowed) in all {
            if !is_valid {
                return Err(QpError::InvalidOption { name, value, allowed });
            }
        }
        Ok(())
    }
}
