//! What is said of a problem that has no solution, and why that is true.

use super::iterate::Iterate;
use super::vector::dot;
use crate::qp::layout::part;
use crate::qp::statistics::larger;
use crate::scalar::{Packed, Real};

/// Of double precision `ε` is below.
const FINE: f64 = 1e-10;

impl<T: Real> Iterate<'_, T> {
    /// Whether the multipliers are a certificate (Farkas' lemma). Without objective the Lagrangian
    /// `L(v) = Σ π (A v + b − v₊) − Σ λ d(v)` is not positive at any point that satisfies all
    /// constraints, and differs from what it is here by its gradient `g` times the distance: where
    /// `g` vanishes and `L` is positive there is none. With a `g` that is small there is none but
    /// where numbers are 1e5 times (of single precision a hundred times) as large as here.
    #[inline(always)]
    pub fn is_infeasible<E: Packed<T>>(&mut self, multipliers: &mut [T]) -> bool {
        let _ = self.evaluate::<E>(multipliers);
        let count = self.sides.counts.sides();
        let (forces, distances) = (part(self.sides.multiplier, 0, count), part(self.sides.scratch, 0, count));
        let mut lagrangian = dot::<T, E>(multipliers, self.dynamics) - dot::<T, E>(forces, distances);
        if let Some(coupling) = &self.coupling {
            lagrangian = lagrangian + dot::<T, E>(coupling.theta, coupling.residual);
        }
        let gradient = self.gradient_size::<E>(self.measure);
        let rounding = T::from_f64(64.0 * T::EPSILON) * self.terms.forces;
        let gradient = larger(gradient * T::from_f64(if T::EPSILON < FINE { 1e5 } else { 1e2 }), rounding);
        lagrangian > gradient * (T::ONE + self.terms.values)
    }
}
