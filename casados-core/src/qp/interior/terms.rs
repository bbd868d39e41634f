//! What residuals are sums of: what rounding leaves of them is a part of it.

use super::vector::larger;
use crate::qp::statistics;
use crate::scalar::{Packed, Real};

/// What residuals are sums of.
#[derive(Clone, Copy)]
pub struct Terms<T> {
    /// In gradients: `H v`, `h`, forces of constraints, `π`.
    pub forces: T,
    /// In conditions: `v`, `C x + D u`, `b`.
    pub values: T,
}

/// The largest terms in units, and as they are.
#[derive(Clone, Copy)]
pub struct Most<T> {
    pub in_units: T,
    pub own: T,
}

impl<T: Real> Most<T> {
    pub const NONE: Self = Most { in_units: T::ZERO, own: T::ZERO };

    /// Terms that are multiplied by units.
    #[inline(always)]
    pub fn add_forces<E: Packed<T>>(&mut self, all: &[T], units: &[T]) {
        self.add::<E>(all, units, |term, unit| term * unit);
    }

    /// Terms that are divided by units.
    #[inline(always)]
    pub fn add_values<E: Packed<T>>(&mut self, all: &[T], units: &[T]) {
        self.add::<E>(all, units, |term, unit| term / unit);
    }

    #[inline(always)]
    fn add<E: Packed<T>>(&mut self, all: &[T], units: &[T], measure: fn(T, T) -> T) {
        self.own = larger::<T, E>(self.own, all);
        if !units.is_empty() {
            self.measure(all, units, measure);
        }
    }

    #[inline(never)]
    fn measure(&mut self, all: &[T], units: &[T], measure: fn(T, T) -> T) {
        for (term, &unit) in all.iter().zip(units) {
            self.in_units = statistics::larger(self.in_units, measure(term.abs(), unit));
        }
    }
}
