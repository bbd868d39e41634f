//! Units of residuals, slacks and multipliers; `scaling` computes them.

use crate::scalar::Real;

/// Units of rows, and of the objective.
#[derive(Clone, Copy)]
pub struct Units<'a, T> {
    /// The units of rows; empty if all are one.
    pub rows: &'a [T],
    pub objective: T,
}

impl<'a, T: Real> Units<'a, T> {
    /// All units are one.
    pub const NONE: Self = Units { rows: &[], objective: T::ONE };

    /// Returns the unit of a row.
    #[inline(always)]
    pub fn of(&self, row: usize) -> T {
        self.rows.get(row).copied().unwrap_or(T::ONE)
    }

    /// Returns `own` if all units are one, otherwise `in_units`.
    #[inline(always)]
    pub fn choose<V>(&self, own: V, in_units: V) -> V {
        if self.rows.is_empty() { own } else { in_units }
    }

    /// Returns the units from a row on; empty if all are one.
    #[inline(always)]
    pub fn from(&self, row: usize) -> &'a [T] {
        self.rows.get(row..).unwrap_or_default()
    }
}
