//! The terms of residuals, whose rounding errors bound the accuracy of the residuals.

use super::vector::largest_magnitude_ignoring_nan;
use crate::qp::statistics;
use crate::scalar::{Packed, Real};

/// The largest terms of residuals.
#[derive(Clone, Copy)]
pub struct Terms<T> {
    /// Terms of gradients: `H v`, `h`, gradients of constraints, `π`.
    pub gradient_terms: T,
    /// Terms of conditions: `v`, `C x + D u`, `b`.
    pub condition_terms: T,
}

/// The largest terms, in units and without units.
#[derive(Clone, Copy)]
pub struct LargestTerms<T> {
    pub in_units: T,
    pub own: T,
}

impl<T: Real> LargestTerms<T> {
    pub const NONE: Self = LargestTerms { in_units: T::ZERO, own: T::ZERO };

    /// Adds terms of gradients, which are multiplied by units.
    #[inline(always)]
    pub fn add_forces<E: Packed<T>>(&mut self, all: &[T], units: &[T]) {
        self.update_both_scalings::<E>(all, units, |term, unit| term * unit);
    }

    /// Adds terms of conditions, which are divided by units.
    #[inline(always)]
    pub fn add_values<E: Packed<T>>(&mut self, all: &[T], units: &[T]) {
        self.update_both_scalings::<E>(all, units, |term, unit| term / unit);
    }

    #[inline(always)]
    fn update_both_scalings<E: Packed<T>>(&mut self, all: &[T], units: &[T], measure: fn(T, T) -> T) {
        self.own = largest_magnitude_ignoring_nan::<T, E>(self.own, all);
        if !units.is_empty() {
            self.update_scaled(all, units, measure);
        }
    }

    #[inline(never)]
    fn update_scaled(&mut self, all: &[T], units: &[T], measure: fn(T, T) -> T) {
        for (term, &unit) in all.iter().zip(units) {
            self.in_units = statistics::nan_max(self.in_units, measure(term.abs(), unit));
        }
    }
}
