//! The table of an estimate with its standard deviations.

use super::Covariance;
use super::get;
use crate::scalar::Real;
use core::fmt;

/// Writes a row for each state, free parameter and control: its value and its standard deviation
/// at the first stage and at its last one. The unidentifiable directions follow.
///
/// ```text
///         first stage                     last stage
/// x[0]    1.0000e0 ± 5.00e-2              1.0000e0 ± 5.00e-2
/// x[1]    2.0000e0 ± not identifiable     2.0000e0 ± not identifiable
/// ```
impl<T: Real> fmt::Display for Covariance<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [nx, nu, intervals] = self.dims;
        let states = self.names.x.iter().copied();
        let names = states.chain(self.free.iter().copied()).chain(self.names.u.iter().copied());
        let width = names.clone().map(|name| name.chars().count()).max().unwrap_or(0).max(4);
        writeln!(f, "{:width$}  {:30}  last stage", "", "first stage")?;
        for (index, name) in names.enumerate() {
            // The last stage has no controls.
            let last = if index < nx + self.free.len() { intervals } else { intervals.saturating_sub(1) };
            let [first, last] = [0, last].map(|stage| stage * (nx + nu) + index);
            writeln!(f, "{name:width$}  {:30}  {}", self.cell(first), self.cell(last))?;
        }
        for direction in &self.directions {
            writeln!(f, "not identifiable: {direction}")?;
        }
        Ok(())
    }
}

impl<T: Real> Covariance<T> {
    /// The value and the standard deviation of a variable.
    fn cell(&self, place: usize) -> Cell {
        let row = crate::qp::part(&self.rows, place * self.identifiable_count, self.identifiable_count);
        let is_known = !self.is_unidentifiable.get(place).copied().unwrap_or(true);
        let variance = self.variance_factor * crate::linalg::dot(row, row);
        Cell {
            value: get(&self.values, place).to_f64(),
            deviation: is_known.then(|| variance.sqrt().to_f64()),
        }
    }
}

/// A value with its standard deviation.
struct Cell {
    value: f64,
    deviation: Option<f64>,
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { value, deviation } = self;
        let text = match deviation {
            Some(deviation) => alloc::format!("{value:.4e} ± {deviation:.2e}"),
            None => alloc::format!("{value:.4e} ± not identifiable"),
        };
        f.pad(&text)
    }
}
