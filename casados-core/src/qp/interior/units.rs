//! Units that residuals, slacks and multipliers are measured in; `scaling` finds them.

use crate::scalar::Real;

/// Units of rows, and of the objective.
#[derive(Clone, Copy)]
pub struct Units<'a, T> {
    /// By rows; all one if there are none.
    pub rows: &'a [T],
    pub objective: T,
}

impl<'a, T: Real> Units<'a, T> {
    /// All are one.
    pub const NONE: Self = Units { rows: &[], objective: T::ONE };

    /// That of a row.
    #[inline(always)]
    pub fn of(&self, row: usize) -> T {
        self.rows.get(row).copied().unwrap_or(T::ONE)
    }

    /// The first where all are one, else the second.
    #[inline(always)]
    pub fn choose<V>(&self, own: V, in_units: V) -> V {
        if self.rows.is_empty() { own } else { in_units }
    }

    /// Those from a row on; none if all are one.
    #[inline(always)]
    pub fn from(&self, row: usize) -> &'a [T] {
        self.rows.get(row..).unwrap_or_default()
    }
}
