//! What residuals are to be below.

use super::iterate::Iterate;
use super::options::InteriorPointOptions;
use super::residuals::MaxResiduals;
use super::sides::PenaltyMode;
use super::terms::Terms;
use super::units::Units;
use crate::scalar::Real;

/// Residuals as they are are to be below so many `ε` of their terms.
const ROUNDING_FACTOR: f64 = 1e6;
/// The part of the tolerance that residuals in units are to be below.
const SCALED_TOLERANCE_FACTOR: f64 = 0.1;

/// What residuals are to be below.
pub struct ResidualTolerances<T> {
    absolute: Terms<T>,
    pub relative: T,
    /// The part of the tolerance that `absolute` is.
    share: T,
}

impl<T: Real> ResidualTolerances<T> {
    /// Those of a tolerance.
    pub fn new(options: &InteriorPointOptions, values: T, penalties: PenaltyMode, scaled: bool) -> Self {
        // What multipliers are to prove depends on how well gradients vanish.
        let share = if penalties == PenaltyMode::Hard { 0.01 } else { 1.0 };
        // Units are estimates.
        let in_units = if scaled { T::from_f64(SCALED_TOLERANCE_FACTOR) } else { T::ONE };
        let values = values * in_units;
        let absolute = Terms { forces: values * T::from_f64(share), values };
        Self { absolute, relative: T::from_f64(options.relative_tolerance), share: in_units }
    }

    /// Whether residuals as they are are small beside their terms; those of complementarity are
    /// products of forces and values.
    pub fn satisfied_relative_to_terms(&self, residuals: MaxResiduals<T>, terms: Terms<T>) -> bool {
        let relative = self.relative.max(T::from_f64((ROUNDING_FACTOR * T::EPSILON).min(1e-5)));
        let products = (relative * terms.forces * terms.values).max(self.absolute.forces);
        let others = MaxResiduals { complementarity: T::ZERO, ..residuals };
        residuals.complementarity <= products && Self { relative, ..*self }.satisfied_by(others, terms)
    }

    /// Whether residuals in the units of the user are below the whole tolerance.
    fn satisfied_unscaled(&self, residuals: MaxResiduals<T>, terms: Terms<T>) -> bool {
        let Terms { forces, values } = self.absolute;
        let absolute = Terms { forces: forces / self.share, values: values / self.share };
        Self { absolute, ..*self }.satisfied_by(residuals, terms)
    }

    /// Of residuals with such terms.
    pub fn of(&self, terms: Terms<T>) -> Terms<T> {
        Terms {
            forces: (self.relative * terms.forces).max(self.absolute.forces),
            values: (self.relative * terms.values).max(self.absolute.values),
        }
    }

    /// Whether residuals with such terms are small.
    pub fn satisfied_by(&self, residuals: MaxResiduals<T>, terms: Terms<T>) -> bool {
        let MaxResiduals { stationarity, dynamics, inequalities, complementarity } = residuals;
        let Terms { forces, values } = self.of(terms);
        stationarity <= forces && complementarity <= forces && dynamics <= values && inequalities <= values
    }
}

impl<T: Real> Iterate<'_, T> {
    /// Whether residuals are small that were [`judged`](Self::judged): in units, and as they are
    /// beside their terms.
    #[inline(always)]
    pub fn is_converged(&self, judged: MaxResiduals<T>, limits: &ResidualTolerances<T>) -> bool {
        limits.satisfied_by(judged, self.terms)
            && (self.measure.rows.is_empty()
                || limits
                    .satisfied_relative_to_terms(self.residuals_in_units::<T>(Units::NONE), self.own_terms))
    }

    /// Whether residuals are below the tolerance in the units of the user: enough where no step
    /// makes progress.
    pub fn is_converged_unscaled(&self, limits: &ResidualTolerances<T>) -> bool {
        !self.measure.rows.is_empty()
            && limits.satisfied_unscaled(self.residuals_in_units::<T>(Units::NONE), self.own_terms)
    }
}
