//! Violated bounds of a trajectory, by name.

use super::Trajectory;
use super::series::bound_at;
use crate::qp::Side;
use crate::scalar::Real;
use alloc::vec::Vec;
use core::cmp::Ordering;
use core::fmt;

/// A violated bound of a trajectory.
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(20, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// ocp.bound("x", 5.., -1.0, 0.25)?;
/// // The guess, before anything is solved.
/// let solution = ocp.solution()?;
/// let violations = solution.violations(1e-6);
/// assert_eq!(violations.len(), 16);
/// assert_eq!(violations[0].to_string(), "the upper bound of `x` at stage 5 is violated by 7.50e-1");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Violation<'a, T = f64> {
    /// The name of the state, control or output of a constraint.
    pub name: &'a str,
    /// The index of the time; for a solution the stage.
    pub stage: usize,
    /// The violated side.
    pub side: Side,
    /// The amount of the violation.
    pub amount: T,
}

impl<T: Real> fmt::Display for Violation<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, stage, side, amount } = *self;
        let side = match side {
            Side::Lower => "lower",
            Side::Upper => "upper",
        };
        let amount = amount.to_f64();
        write!(f, "the {side} bound of `{name}` at stage {stage} is violated by {amount:.2e}")
    }
}

impl<T: Real> Trajectory<T> {
    /// Returns the violations above a threshold, largest first. After a run that did not converge
    /// these bounds may contradict each other.
    #[must_use]
    pub fn violations(&self, above: T) -> Vec<Violation<'_, T>> {
        let mut found = Vec::new();
        for series in &self.series {
            for (k, &value) in series.values.iter().enumerate() {
                let below_lower = bound_at(&series.lower, k).map(|bound| (Side::Lower, bound - value));
                let above_upper = bound_at(&series.upper, k).map(|bound| (Side::Upper, value - bound));
                for (side, amount) in
                    below_lower.into_iter().chain(above_upper).filter(|(_, amount)| *amount > above)
                {
                    found.push(Violation { name: &series.name, stage: series.first + k, side, amount });
                }
            }
        }
        found.sort_by(|a, b| b.amount.partial_cmp(&a.amount).unwrap_or(Ordering::Equal));
        found
    }
}
