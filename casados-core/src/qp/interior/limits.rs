//! Tolerances of residuals.

use super::iterate::Iterate;
use super::options::InteriorPointOptions;
use super::residuals::MaxResiduals;
use super::sides::PenaltyMode;
use super::terms::Terms;
use super::units::Units;
use crate::scalar::Real;

/// Residuals without units must be below this multiple of `ε` times their terms.
const ROUNDING_FACTOR: f64 = 1e6;
/// The fraction of the tolerance for residuals in units, which are estimates.
const SCALED_TOLERANCE_FACTOR: f64 = 0.1;

/// Tolerances of residuals.
pub struct ResidualTolerances<T> {
    absolute: Terms<T>,
    pub relative: T,
    /// The fraction of the tolerance in `absolute`.
    share: T,
}

impl<T: Real> ResidualTolerances<T> {
    /// The tolerances of the options, at least `relaxed`.
    pub fn new(options: &InteriorPointOptions, relaxed: T, penalties: PenaltyMode, scaled: bool) -> Self {
        let values = T::from_f64(options.tolerance).max(relaxed);
        // A certificate of infeasibility requires small gradients.
        let share = if penalties == PenaltyMode::Hard { 0.01 } else { 1.0 };
        // Units are estimates.
        let in_units = if scaled { T::from_f64(SCALED_TOLERANCE_FACTOR) } else { T::ONE };
        let values = values * in_units;
        let absolute = Terms { gradient_terms: values * T::from_f64(share), condition_terms: values };
        Self { absolute, relative: T::from_f64(options.relative_tolerance), share: in_units }
    }

    /// Returns whether residuals without units are small relative to their terms; the terms of
    /// complementarity are products of gradient terms and values.
    pub fn satisfied_relative_to_terms(&self, residuals: MaxResiduals<T>, terms: Terms<T>) -> bool {
        let relative = self.relative.max(T::from_f64((ROUNDING_FACTOR * T::EPSILON).min(1e-5)));
        let products =
            (relative * terms.gradient_terms * terms.condition_terms).max(self.absolute.gradient_terms);
        let others = MaxResiduals { complementarity: T::ZERO, ..residuals };
        residuals.complementarity <= products && Self { relative, ..*self }.satisfied_by(others, terms)
    }

    /// Returns whether residuals without units are below the whole tolerance.
    fn satisfied_unscaled(&self, residuals: MaxResiduals<T>, terms: Terms<T>) -> bool {
        let Terms { gradient_terms: forces, condition_terms: values } = self.absolute;
        let absolute = Terms { gradient_terms: forces / self.share, condition_terms: values / self.share };
        Self { absolute, ..*self }.satisfied_by(residuals, terms)
    }

    /// Returns the tolerances of residuals with these terms.
    pub fn of(&self, terms: Terms<T>) -> Terms<T> {
        Terms {
            gradient_terms: (self.relative * terms.gradient_terms).max(self.absolute.gradient_terms),
            condition_terms: (self.relative * terms.condition_terms).max(self.absolute.condition_terms),
        }
    }

    /// Returns whether residuals with these terms are below the tolerances.
    pub fn satisfied_by(&self, residuals: MaxResiduals<T>, terms: Terms<T>) -> bool {
        let MaxResiduals { stationarity, dynamics, inequalities, complementarity } = residuals;
        let Terms { gradient_terms: forces, condition_terms: values } = self.of(terms);
        stationarity <= forces && complementarity <= forces && dynamics <= values && inequalities <= values
    }
}

impl<T: Real> Iterate<'_, T> {
    /// Returns whether the [`judged`](Self::judged) residuals are small, both in units and, without
    /// units, relative to their terms.
    #[inline(always)]
    pub fn is_converged(&self, judged: MaxResiduals<T>, limits: &ResidualTolerances<T>) -> bool {
        limits.satisfied_by(judged, self.terms)
            && (self.measure.rows.is_empty()
                || limits
                    .satisfied_relative_to_terms(self.residuals_in_units::<T>(Units::NONE), self.own_terms))
    }

    /// Returns whether residuals without units are below the tolerance, which suffices if no step
    /// makes progress.
    pub fn is_converged_unscaled(&self, limits: &ResidualTolerances<T>) -> bool {
        !self.measure.rows.is_empty()
            && limits.satisfied_unscaled(self.residuals_in_units::<T>(Units::NONE), self.own_terms)
    }
}
