//! Residuals of an iterate, and their terms.

use super::iterate::Iterate;
use super::units::Units;
use super::vector::{largest_product, largest_scaled_magnitude, largest_size};
use crate::qp::layout::{StageOffsetsIter, part};
use crate::qp::marked_indices;
use crate::qp::statistics::{Residuals, nan_max};
use crate::scalar::{Packed, Real};

/// Residuals of the optimality conditions, the largest element of each: see [`Residuals`].
#[derive(Clone, Copy)]
pub struct MaxResiduals<T> {
    pub stationarity: T,
    pub dynamics: T,
    pub inequalities: T,
    pub complementarity: T,
}

impl<T: Real> From<MaxResiduals<T>> for Residuals {
    fn from(largest: MaxResiduals<T>) -> Self {
        let MaxResiduals { stationarity, dynamics, inequalities, complementarity } = largest;
        Self {
            stationarity: stationarity.to_f64(),
            dynamics: dynamics.to_f64(),
            inequalities: inequalities.to_f64(),
            complementarity: complementarity.to_f64(),
        }
    }
}

impl<T: Real> Iterate<'_, T> {
    /// Returns the residuals as [`qp::residuals`](crate::qp::residuals) does, in units, after
    /// [`evaluate`](Self::evaluate), at least the rounding errors of their terms.
    #[inline(always)]
    pub fn evaluated_residuals<E: Packed<T>>(&mut self) -> MaxResiduals<T> {
        let MaxResiduals { stationarity, dynamics, inequalities, complementarity } =
            self.point_residuals::<E>();
        // The recursion for `π` makes gradients zero up to rounding errors; another order of
        // summation has other rounding errors.
        let rounding = |terms| T::from_f64(T::EPSILON) * terms;
        MaxResiduals {
            stationarity: nan_max(stationarity, rounding(self.terms.gradient_terms)),
            dynamics: nan_max(dynamics, rounding(self.terms.condition_terms)),
            inequalities,
            complementarity,
        }
    }

    /// As [`judged`](Self::judged), without the rounding errors.
    #[inline(always)]
    pub fn point_residuals<E: Packed<T>>(&mut self) -> MaxResiduals<T> {
        self.inequalities.split_soft_distances();
        self.residuals_in_units::<E>(self.measure)
    }

    /// Returns the [`judged`](Self::judged) residuals without units.
    pub fn unscaled_residuals(&self, judged: MaxResiduals<T>) -> Residuals {
        if self.measure.rows.is_empty() {
            judged.into()
        } else {
            self.residuals_in_units::<T>(Units::NONE).into()
        }
    }

    #[inline(always)]
    pub fn residuals_in_units<E: Packed<T>>(&self, units: Units<'_, T>) -> MaxResiduals<T> {
        let (inequalities, complementarity) = self.inequalities.residuals(units);
        MaxResiduals {
            stationarity: self.max_gradient::<E>(units),
            dynamics: self.gaps::<E>(units),
            inequalities,
            complementarity,
        }
    }

    /// Returns the largest element of the gradient of the Lagrangian.
    #[inline(always)]
    pub fn max_gradient<E: Packed<T>>(&self, units: Units<'_, T>) -> T {
        if units.rows.is_empty() {
            return largest_size::<T, E>(self.stationarity) / units.objective;
        }
        largest_scaled_magnitude(T::ZERO, self.stationarity, units.rows, |g, unit| g * unit) / units.objective
    }

    /// Returns the largest residual of dynamics and of couplings.
    #[inline(always)]
    pub fn gaps<E: Packed<T>>(&self, units: Units<'_, T>) -> T {
        let over = |gap, unit| gap / unit;
        let gaps = if units.rows.is_empty() {
            largest_size::<T, E>(self.dynamics)
        } else {
            StageOffsetsIter::<T>::new(self.qp.dims).fold(T::ZERO, |most, place| {
                let gaps = part(self.dynamics, place.dynamics, place.next);
                largest_scaled_magnitude(most, gaps, units.from(place.row + place.rows), over)
            })
        };
        let Some(coupling) = &self.coupling else { return gaps };
        let conditions = coupling.residual.iter().zip(marked_indices(coupling.periodic));
        conditions.fold(gaps, |most, (gap, state)| nan_max(most, over(gap.abs(), units.of(state))))
    }

    /// Returns the updated residuals, in units.
    #[inline(always)]
    pub fn residuals<E: Packed<T>>(&self) -> MaxResiduals<T> {
        // Products may lose NaN, but their sum does not.
        let products =
            largest_product::<T, E>(T::ZERO, self.inequalities.slack, self.inequalities.multiplier);
        let products = if self.mu.is_finite() { products } else { self.mu };
        MaxResiduals {
            stationarity: self.max_gradient::<E>(self.measure),
            dynamics: self.gaps::<E>(self.measure),
            inequalities: self.inequalities.max_residual::<E>(self.measure),
            complementarity: products / self.measure.objective,
        }
    }
}
