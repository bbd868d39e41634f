//! Export of trajectories as comma-separated values.

use super::{Series, Trajectory};
use crate::scalar::Real;
use core::fmt;

/// A trajectory as comma-separated values, for printing or writing:
/// `std::fs::write("solution.csv", solution.csv().to_string())`.
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
/// let text = ocp.solution()?.csv().to_string();
/// assert!(text.starts_with("t,x,u\n0,1,0\n"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Csv<'a, T = f64>(&'a Trajectory<T>);

impl<T: Real> Trajectory<T> {
    /// Returns comma-separated values: a line with `t` and all names, then one line for each time.
    /// A missing value, such as that of a control at the end, is an empty field.
    ///
    /// Numbers have as many digits as required to read the same values again.
    #[must_use]
    pub fn csv(&self) -> Csv<'_, T> {
        Csv(self)
    }
}

impl<T: Real> fmt::Display for Csv<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Trajectory { times, series, .. } = self.0;
        f.write_str("t")?;
        for Series { name, .. } in series {
            write!(f, ",{name}")?;
        }
        for (k, time) in times.iter().enumerate() {
            write!(f, "\n{}", time.to_f64())?;
            for Series { first, values, .. } in series {
                f.write_str(",")?;
                if let Some(value) = k.checked_sub(*first).and_then(|k| values.get(k)) {
                    write!(f, "{}", value.to_f64())?;
                }
            }
        }
        writeln!(f)
    }
}
