//! The order of convergence of an integrator: errors over step sizes.

use core::fmt;
use std::string::String;
use std::vec::Vec;

/// Errors over numbers of steps. Displayed as a table.
///
/// ```
/// use casados::prelude::*;
/// use casados::testing::convergence;
/// use nalgebra::vector;
///
/// #[ode]
/// fn decay(x: f64) -> f64 {
///     -x
/// }
///
/// let report = convergence(&[2, 4, 8, 16], &[f64::exp(-1.0)], 1e-15, |steps| {
///     let mut irk = Irk::<Decay, Gauss<2>>::new(Options { steps, ..Default::default() })?;
///     let end = irk.solve(&vector![1.0], &vector![], 1.0)?;
///     Ok::<_, Error>(vec![end.x[0]])
/// });
/// println!("{report}"); // steps, errors, and orders between them
/// assert!(report.order().is_some_and(|order| (order - 4.0).abs() < 0.1));
/// assert!(report.best() < 1e-6);
/// ```
#[derive(Clone, Debug)]
#[must_use = "a report says whether the check has passed: call `assert_order` or look at `order`"]
pub struct Convergence {
    /// The number of steps and the largest error, in the given order.
    pub rows: Vec<(usize, f64)>,
    /// The error due to rounding; smaller errors do not contribute to the order.
    pub floor: f64,
    /// The failure of the integrator, if any: number of steps and message.
    pub failure: Option<(usize, String)>,
}

/// Runs an integrator with each number of steps and compares with the exact solution; errors are
/// `max |x − exact|` over the states.
///
/// `floor` is the rounding error: usually the condition number of the problem times epsilon.
///
/// ```
/// use casados_core::testing::convergence;
/// // The explicit midpoint rule on ẋ = −x, x(0) = 1, over an interval of length one.
/// let report = convergence(&[8, 16, 32, 64], &[f64::exp(-1.0)], 1e-15, |steps| {
///     let h = 1.0 / steps as f64;
///     let x = (0..steps).fold(1.0, |x, _| x - h * (x - 0.5 * h * x));
///     Ok::<_, &str>(vec![x])
/// });
/// println!("{report}");
/// report.assert_order(2.0);
/// ```
pub fn convergence<E: fmt::Display>(
    steps: &[usize],
    exact: &[f64],
    floor: f64,
    mut integrate: impl FnMut(usize) -> Result<Vec<f64>, E>,
) -> Convergence {
    let mut report = Convergence { rows: Vec::new(), floor, failure: None };
    for &n in steps {
        match integrate(n) {
            Ok(x) if x.len() == exact.len() => {
                // NaN counts as an infinite error.
                let error = x.iter().zip(exact).fold(0.0, |worst, (x, exact)| {
                    let error = (x - exact).abs();
                    if error <= worst {
                        worst
                    } else if error.is_nan() {
                        f64::INFINITY
                    } else {
                        error
                    }
                });
                report.rows.push((n, error));
            }
            Ok(x) => {
                report.failure =
                    Some((n, std::format!("{} states, the exact solution has {}", x.len(), exact.len())));
                break;
            }
            Err(error) => {
                report.failure = Some((n, std::format!("{error}")));
                break;
            }
        }
    }
    report
}

impl Convergence {
    /// Order between two successive rows: `log(e₁/e₂) / log(n₂/n₁)`.
    fn observed_order(a: (usize, f64), b: (usize, f64)) -> f64 {
        (a.1 / b.1).ln() / (b.0 as f64 / a.0 as f64).ln()
    }

    /// The rows with truncation errors, at least ten times above the floor.
    fn rows_above_floor(&self) -> Vec<(usize, f64)> {
        self.rows.iter().copied().filter(|row| row.1 > 10.0 * self.floor && row.1.is_finite()).collect()
    }

    /// The slope of `log error` over `log(1/steps)`, fitted to the last three errors above the
    /// floor, which are closest to the asymptote. `None` with fewer than two.
    #[must_use]
    pub fn order(&self) -> Option<f64> {
        let rows = self.rows_above_floor();
        let rows = &rows[rows.len().saturating_sub(3)..];
        if rows.len() < 2 {
            return None;
        }
        let points: Vec<(f64, f64)> = rows.iter().map(|r| (-(r.0 as f64).ln(), r.1.ln())).collect();
        let n = points.len() as f64;
        let (mx, my) = points.iter().fold((0.0, 0.0), |(sx, sy), (x, y)| (sx + x / n, sy + y / n));
        let (sxy, sxx) = points
            .iter()
            .fold((0.0, 0.0), |(sxy, sxx), (x, y)| (sxy + (x - mx) * (y - my), sxx + (x - mx) * (x - mx)));
        Some(sxy / sxx)
    }

    /// The smallest error.
    #[must_use]
    pub fn best(&self) -> f64 {
        self.rows.iter().fold(f64::INFINITY, |best, row| best.min(row.1))
    }

    /// Panics with the table unless every run succeeded and the fitted order is within a quarter of
    /// `order`: half of the distance to the nearest half order, so that methods of another order
    /// and methods with order reduction fail.
    #[track_caller]
    pub fn assert_order(&self, order: f64) {
        let found = self.order();
        let right = found.is_some_and(|found| (found - order).abs() <= 0.25);
        assert!(self.failure.is_none() && right, "order {order} expected, found {found:?}\n{self}");
    }

    /// Panics with the table unless every run succeeded and the last error is at most `tolerance`.
    #[track_caller]
    pub fn assert_error(&self, tolerance: f64) {
        let last = self.rows.last().map_or(f64::INFINITY, |row| row.1);
        assert!(
            self.failure.is_none() && last <= tolerance,
            "error {last:.2e}, at most {tolerance:.2e} expected\n{self}"
        );
    }
}

impl fmt::Display for Convergence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:>8} {:>12} {:>8}", "steps", "error", "order")?;
        for (i, &(steps, error)) in self.rows.iter().enumerate() {
            write!(f, "{steps:>8} {error:>12.3e}")?;
            if i > 0 && error > self.floor && error.is_finite() {
                write!(f, " {:>8.2}", Self::observed_order(self.rows[i - 1], (steps, error)))?;
            }
            writeln!(f)?;
        }
        writeln!(f, "errors below {:.1e} are rounding", self.floor)?;
        if let Some(order) = self.order() {
            writeln!(f, "fitted order {order:.2}")?;
        }
        if let Some((steps, message)) = &self.failure {
            writeln!(f, "with {steps} steps: {message}")?;
        }
        Ok(())
    }
}
