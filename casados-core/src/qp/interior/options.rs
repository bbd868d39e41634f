//! What a user can choose.

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
    /// Every one of the four [`Residuals`](crate::qp::Residuals) is to be below this, or below
    /// `relative_tolerance`. Default 1e-8; of single precision 1e-4.
    pub tolerance: f64,
    /// Residuals may be this part of the largest of the terms whose sums they are: stationarity and
    /// complementarity of `H v`, `h`, forces of constraints and multipliers `π`; dynamics and
    /// inequalities of `v`, values of general constraints and `b`. What is asked for is the larger
    /// one of this and `tolerance`. Default 0, absolute; of single precision, where terms have no
    /// more than seven digits, 1e-5.
    pub relative_tolerance: f64,
    /// After so many iterations, attempts at a warm start among them, there is no solution:
    /// [`QpError::MaxIterations`](crate::qp::QpError::MaxIterations). With zero the start has to be
    /// one. Default 50.
    pub max_iterations: usize,
    /// Where the products of slacks and multipliers begin. Default 1.
    pub start_mu: f64,
    /// How many sets of active bounds a warm start tries before slacks and multipliers are moved
    /// away from zero and the interior point begins. Each costs less than one of its iterations,
    /// and counts as one. A cold start tries the solution without bounds, unless zero violates one.
    /// Default 4.
    pub active_sets: usize,
    /// Slacks and multipliers of a warm start are at least this. Default 1e-3.
    pub warm_distance: f64,
    /// Whether a QP that was not solved is tried again, with as many iterations each time: from a
    /// cold start, with proximal terms, and with all bounds soft, to see which of them cannot be
    /// satisfied. Otherwise it is tried again with the iterations that are left. Default true.
    pub locate: bool,
    /// Whether sizes of variables, constraints and the objective are found from the data, and
    /// everything is compared with them: variables in pascal or kilometres are no worse than
    /// others then. Where no size is above 32 or below its inverse there are no units. With them
    /// all residuals in units are below a tenth of `tolerance`, and as they are below the larger
    /// one of that and `1e6 ε` of their largest term, or of single precision 1e-5 of it. Default
    /// true; [`HeapSqp`](crate::ocp::HeapSqp), which solves QPs in units of its own, asks for none.
    pub scaling: bool,
    /// Lower bounds of minus this or less, and upper ones of this or more, mean that there is none.
    /// Default 1e15; of single precision 1e7, where seven digits leave no unit.
    pub no_bound: f64,
}

impl InteriorPointOptions {
    /// For numbers of some precision.
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
