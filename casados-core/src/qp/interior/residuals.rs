//! Residuals of an iterate, and what they are sums of.

use super::iterate::Iterate;
use super::vector::{largest_product, largest_size};
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
    /// The residuals as [`qp::residuals`](crate::qp::residuals) has them, after
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
        let (inequalities, complementarity) = self.sides.judge();
        Largest {
            stationarity: largest_size::<T, E>(self.stationarity),
            dynamics: self.gaps::<E>(),
            inequalities,
            complementarity,
        }
    }

    /// The largest residual of dynamics and of conditions between stages.
    #[inline(always)]
    fn gaps<E: Packed<T>>(&self) -> T {
        let gaps = largest_size::<T, E>(self.dynamics);
        let coupled = self.coupling.as_ref();
        coupled.map_or(gaps, |coupling| larger(gaps, largest_size::<T, E>(coupling.residual)))
    }

    /// The residuals as they are known.
    #[inline(always)]
    pub fn residuals<E: Packed<T>>(&self) -> Largest<T> {
        let sides = &self.sides;
        let inequalities =
            larger(largest_size::<T, E>(sides.residual), largest_size::<T, E>(sides.equation_residual));
        // Products may lose NaN, their sum does not.
        let products = largest_product::<T, E>(T::ZERO, sides.slack, sides.multiplier);
        Largest {
            stationarity: largest_size::<T, E>(self.stationarity),
            dynamics: self.gaps::<E>(),
            inequalities,
            complementarity: if self.mu.is_finite() { products } else { self.mu },
        }
    }
}
