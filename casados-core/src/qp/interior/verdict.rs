//! Certificates of infeasibility.

use super::iterate::Iterate;
use super::limits::ResidualTolerances;
use super::residuals::MaxResiduals;
use super::vector::dot;
use crate::qp::element::set;
use crate::qp::layout::{copy_common, part};
use crate::qp::statistics::nan_max;
use crate::scalar::{Packed, Real};

/// An upper bound of `ε` of double precision.
const DOUBLE_PRECISION_EPSILON: f64 = 1e-10;

/// The growth of multipliers from which a certificate is tested, while violations persist.
const GROWTH: f64 = 10.0;
/// The factor of the size of the iterate up to which a suspicion excludes feasible points.
const SUSPICION_FACTOR: f64 = 1e2;
/// The number of iterations before the first test.
const MIN_ITERATIONS_BEFORE_TEST: usize = 3;

impl<T: Real> Iterate<'_, T> {
    /// Returns whether the multipliers of a run with the objective are nearly a certificate: the
    /// multipliers of an infeasible problem grow without bound in the direction of a certificate,
    /// since the gradient of the objective is bounded. `known` is the initial size of gradient
    /// terms.
    #[inline(always)]
    pub fn suspects_infeasibility<E: Packed<T>>(
        &mut self,
        iterations: usize,
        initial_multiplier_size: T,
        (residuals, limits): (MaxResiduals<T>, &ResidualTolerances<T>),
        multipliers: &mut [T],
    ) -> bool {
        let values = limits.of(self.terms).condition_terms;
        let violates = residuals.inequalities > values || residuals.dynamics > values;
        if iterations < MIN_ITERATIONS_BEFORE_TEST
            || !violates
            || self.largest_multiplier() < T::from_f64(GROWTH) * initial_multiplier_size
        {
            return false;
        }
        // Soft bounds are no part of a certificate: their multipliers belong to the objective.
        let sides = &mut self.inequalities;
        copy_common(sides.multiplier_step, sides.multiplier);
        for &side in &*sides.soft {
            set(sides.multiplier, side as usize, T::ZERO);
        }
        let objective = core::mem::replace(&mut self.objective, false);
        let suspicious = self.is_certificate::<E>(T::from_f64(SUSPICION_FACTOR), multipliers);
        self.objective = objective;
        copy_common(self.inequalities.multiplier, self.inequalities.multiplier_step);
        if !suspicious {
            let _ = self.evaluate::<E>(multipliers);
        }
        suspicious
    }

    /// Returns the largest multiplier of a side or an equation in units.
    fn largest_multiplier(&self) -> T {
        let sides = &self.inequalities;
        let of_sides = sides.multiplier.iter().zip(&*sides.rows);
        let of_equations = sides.equation_multipliers.iter().zip(&*sides.equations);
        let forces = of_sides.chain(of_equations);
        let unit = |row: u32| self.measure.of(row as usize);
        let most = forces.fold(T::ZERO, |most, (force, &row)| (force.abs() * unit(row)).max(most));
        most / self.measure.objective
    }

    /// Returns whether the multipliers are a certificate (Farkas' lemma). Without the objective the
    /// Lagrangian `L(v) = Σ π (A v + b − v₊) − Σ λ d(v)` is not positive at any feasible point, and
    /// its gradient `g` is constant: if `g` vanishes and `L` is positive at one point, there is no
    /// feasible point. If `g` is small, feasible points must be larger than the iterate by a factor
    /// of 1e5 (100 in single precision).
    #[inline(always)]
    pub fn proves_infeasibility<E: Packed<T>>(&mut self, multipliers: &mut [T]) -> bool {
        self.is_certificate::<E>(
            T::from_f64(if T::EPSILON < DOUBLE_PRECISION_EPSILON { 1e5 } else { 1e2 }),
            multipliers,
        )
    }

    /// The same test for points up to `far` times as large as the iterate.
    #[cfg_attr(feature = "std", inline(always))]
    #[cfg_attr(not(feature = "std"), inline(never))]
    fn is_certificate<E: Packed<T>>(&mut self, size_factor: T, multipliers: &mut [T]) -> bool {
        let _ = self.evaluate::<E>(multipliers);
        let count = self.inequalities.counts.sides();
        let (forces, distances) =
            (part(self.inequalities.multiplier, 0, count), part(self.inequalities.scratch, 0, count));
        let mut lagrangian = dot::<T, E>(multipliers, self.dynamics)
            - dot::<T, E>(forces, distances)
            - dot::<T, E>(self.inequalities.equation_multipliers, self.inequalities.equation_residual);
        if let Some(coupling) = &self.coupling {
            lagrangian = lagrangian + dot::<T, E>(coupling.theta, coupling.residual);
        }
        let gradient = self.max_gradient::<E>(self.measure);
        let rounding = T::from_f64(64.0 * T::EPSILON) * self.terms.gradient_terms;
        let gradient = nan_max(gradient * size_factor, rounding);
        lagrangian > gradient * (T::ONE + self.terms.condition_terms)
    }
}
