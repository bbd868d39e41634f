//! Statistics of a solve.

use core::fmt;

/// Residuals of the optimality conditions: the largest element of each of the four.
///
/// ```
/// # use casados::ocp::{HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(10, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// let outcome = HeapSqp::new(&ocp)?.solve(&mut ocp)?;
/// println!("{}", outcome.residuals);
/// assert!(outcome.residuals.largest() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Residuals {
    /// The gradient of the Lagrangian.
    pub stationarity: f64,
    /// `A x + B u + b − x₊`
    pub dynamics: f64,
    /// Violations of bounds and general constraints, and of the signs of multipliers.
    pub inequalities: f64,
    /// Products of slacks and multipliers.
    pub complementarity: f64,
}

impl Residuals {
    /// Returns the largest residual; NaN if one is NaN.
    #[must_use]
    pub fn largest(&self) -> f64 {
        let all = [self.stationarity, self.dynamics, self.inequalities, self.complementarity];
        all.into_iter().fold(0.0, nan_max)
    }
}

/// Returns the larger of two numbers; NaN if one is NaN.
#[inline(always)]
pub(crate) fn nan_max<T: PartialOrd>(a: T, b: T) -> T {
    // Only NaN differs from itself.
    #[allow(clippy::eq_op)]
    let keeps = b <= a || a != a;
    if keeps { a } else { b }
}

/// Returns the number, or zero if it is negative; NaN remains NaN.
#[inline(always)]
pub(crate) fn positive<T: PartialOrd + Default>(a: T) -> T {
    nan_max(T::default(), a)
}

impl fmt::Display for Residuals {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "stationarity {:.1e}, dynamics {:.1e}, inequalities {:.1e}, complementarity {:.1e}",
            self.stationarity, self.dynamics, self.inequalities, self.complementarity
        )
    }
}

/// Statistics of a solve.
///
/// ```
/// # use casados::ocp::{HeapRealTime, HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(10, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// let mut controller = HeapRealTime::new(ocp)?;
/// let statistics = controller.prepare()?.feedback(&[0.8])?.statistics;
/// println!("{} iterations, {}", statistics.iterations, statistics.residuals);
/// assert!(statistics.iterations > 0 && statistics.residuals.largest() < 1e-8);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct QpStatistics {
    /// Newton steps with a new matrix: active sets, and iterations of the interior point.
    pub iterations: usize,
    /// Iterations that tried an active set.
    pub active_sets: usize,
    /// Factorisations.
    pub factorisations: usize,
    /// Solves for iterative refinement, against rounding errors and regularisation.
    pub refinements: usize,
    /// Pivots that were too small and were increased.
    pub regularised: usize,
    /// Residuals of the optimality conditions.
    pub residuals: Residuals,
    /// `½ vᵀ H v + hᵀ v`, with penalties of soft constraints.
    pub objective: f64,
}
