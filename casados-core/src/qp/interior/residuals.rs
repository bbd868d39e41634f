//! Residuals of an iterate, and what they are sums of.

use super::iterate::Iterate;
use super::units::Units;
use super::vector::{largest_of, largest_product, largest_size};
use crate::qp::layout::{Places, part};
use crate::qp::marked;
use crate::qp::statistics::{Residuals, larger};
use crate::scalar::{Packed, Real};

/// The residuals of the conditions of optimality, the largest element of each: see [`Residuals`].
#[derive(Clone, Copy)]
pub struct Largest<T> {
    pub stationarity: T,
    pub dynamics: T,
    pub inequalities: T,
    pub complementarity: T,
}

impl<T: Real> From<Largest<T>> for Residuals {
    fn from(largest: Largest<T>) -> Self {
        let Largest { stationarity, dynamics, inequalities, complementarity } = largest;
        Self {
            stationarity: stationarity.to_f64(),
            dynamics: dynamics.to_f64(),
            inequalities: inequalities.to_f64(),
            complementarity: complementarity.to_f64(),
        }
    }
}

impl<T: Real> Iterate<'_, T> {
    /// The residuals as [`qp::residuals`](crate::qp::residuals) has them, in units, after
    /// [`evaluate`](Self::evaluate).
    #[inline(always)]
    pub fn judged<E: Packed<T>>(&mut self) -> Largest<T> {
        let Largest { stationarity, dynamics, inequalities, complementarity } = self.at_point::<E>();
        // The multipliers of the dynamics make gradients zero but for rounding, which is a part of
        // the terms; in another order the sums of values are rounded otherwise.
        let rounding = |terms| T::from_f64(T::EPSILON) * terms;
        Largest {
            stationarity: larger(stationarity, rounding(self.terms.forces)),
            dynamics: larger(dynamics, rounding(self.terms.values)),
            inequalities,
            complementarity,
        }
    }

    /// As [`judged`](Self::judged), without what rounding may be.
    #[inline(always)]
    pub fn at_point<E: Packed<T>>(&mut self) -> Largest<T> {
        self.sides.split_violations();
        self.measured::<E>(self.measure)
    }

    /// Residuals that were [`judged`](Self::judged), in the units of the user.
    pub fn told(&self, judged: Largest<T>) -> Residuals {
        if self.measure.rows.is_empty() { judged.into() } else { self.measured::<T>(Units::NONE).into() }
    }

    #[inline(always)]
    pub fn measured<E: Packed<T>>(&self, units: Units<'_, T>) -> Largest<T> {
        let (inequalities, complementarity) = self.sides.judge(units);
        Largest {
            stationarity: self.gradient_size::<E>(units),
            dynamics: self.gaps::<E>(units),
            inequalities,
            complementarity,
        }
    }

    /// The largest element of the gradient of the Lagrangian.
    #[inline(always)]
    pub fn gradient_size<E: Packed<T>>(&self, units: Units<'_, T>) -> T {
        if units.rows.is_empty() {
            return largest_size::<T, E>(self.stationarity) / units.objective;
        }
        largest_of(T::ZERO, self.stationarity, units.rows, |g, unit| g * unit) / units.objective
    }

    /// The largest residual of dynamics and of conditions between stages.
    #[inline(always)]
    pub fn gaps<E: Packed<T>>(&self, units: Units<'_, T>) -> T {
        let over = |gap, unit| gap / unit;
        let gaps = if units.rows.is_empty() {
            largest_size::<T, E>(self.dynamics)
        } else {
            Places::<T>::new(self.qp.dims).fold(T::ZERO, |most, place| {
                let gaps = part(self.dynamics, place.dynamics, place.next);
                largest_of(most, gaps, units.from(place.row + place.rows), over)
            })
        };
        let Some(coupling) = &self.coupling else { return gaps };
        let conditions = coupling.residual.iter().zip(marked(coupling.periodic));
        conditions.fold(gaps, |most, (gap, state)| larger(most, over(gap.abs(), units.of(state))))
    }

    /// The residuals as they are known, in units.
    #[inline(always)]
    pub fn residuals<E: Packed<T>>(&self) -> Largest<T> {
        // Products may lose NaN, their sum does not.
        let products = largest_product::<T, E>(T::ZERO, self.sides.slack, self.sides.multiplier);
        let products = if self.mu.is_finite() { products } else { self.mu };
        Largest {
            stationarity: self.gradient_size::<E>(self.measure),
            dynamics: self.gaps::<E>(self.measure),
            inequalities: self.sides.residual_size::<E>(self.measure),
            complementarity: products / self.measure.objective,
        }
    }
}
