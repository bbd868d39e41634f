//! What is said of a problem that has no solution, and why that is true.

use super::iterate::Iterate;
use super::limits::ResidualTolerances;
use super::residuals::MaxResiduals;
use super::vector::dot;
use crate::qp::element::set;
use crate::qp::layout::{copy_common, part};
use crate::qp::statistics::nan_max;
use crate::scalar::{Packed, Real};

/// Of double precision `ε` is below.
const DOUBLE_PRECISION_EPSILON: f64 = 1e-10;

/// Multipliers that have grown so much, where violations stay, may be a certificate.
const GROWTH: f64 = 10.0;
/// Numbers of feasible points that are not ruled out, over those of the iterate: enough for a
/// suspicion.
const SUSPICION_FACTOR: f64 = 1e2;
/// The iterations before the first test.
const MIN_ITERATIONS_BEFORE_TEST: usize = 3;

impl<T: Real> Iterate<'_, T> {
    /// Whether multipliers of the run with the objective are nearly a certificate: where no point
    /// satisfies all constraints they grow without bound in its direction, since what the objective
    /// adds to the gradient is bounded. `known` is how large forces were at first.
    #[inline(always)]
    pub fn suspects_infeasibility<E: Packed<T>>(
        &mut self,
        iterations: usize,
        known: T,
        (residuals, limits): (MaxResiduals<T>, &ResidualTolerances<T>),
        multipliers: &mut [T],
    ) -> bool {
        let values = limits.of(self.terms).values;
        let violates = residuals.inequalities > values || residuals.dynamics > values;
        if iterations < MIN_ITERATIONS_BEFORE_TEST
            || !violates
            || self.largest_multiplier() < T::from_f64(GROWTH) * known
        {
            return false;
        }
        // Soft bounds contradict nothing: their forces belong to the objective.
        let sides = &mut self.sides;
        copy_common(sides.multiplier_step, sides.multiplier);
        for &side in &*sides.soft {
            set(sides.multiplier, side as usize, T::ZERO);
        }
        // Weights are those of the next step, which is still to come: until then the gradient with
        // the objective is kept in their place. Of the dynamics and of bounds residuals are known.
        copy_common(self.weights, self.stationarity);
        let (objective, terms, own_terms) = (self.objective, self.terms, self.own_terms);
        self.objective = false;
        self.evaluate_gradient::<E>(multipliers);
        self.evaluate_distances();
        let suspicious = self.is_certificate::<E>(T::from_f64(SUSPICION_FACTOR), multipliers);
        (self.objective, self.terms, self.own_terms) = (objective, terms, own_terms);
        copy_common(self.stationarity, self.weights);
        copy_common(self.sides.multiplier, self.sides.multiplier_step);
        if !suspicious && self.coupling.is_some() {
            // Multipliers of couplings are what the gradient without the objective has left.
            let _ = self.evaluate::<E>(multipliers);
        }
        suspicious
    }

    /// The largest multiplier of a side or an equation in units.
    fn largest_multiplier(&self) -> T {
        let sides = &self.sides;
        let of_sides = sides.multiplier.iter().zip(&*sides.rows);
        let of_equations = sides.free.iter().zip(&*sides.equations);
        let forces = of_sides.chain(of_equations);
        let unit = |row: u32| self.measure.of(row as usize);
        let most = forces.fold(T::ZERO, |most, (force, &row)| (force.abs() * unit(row)).max(most));
        most / self.measure.objective
    }

    /// Whether the multipliers are a certificate (Farkas' lemma). Without objective the Lagrangian
    /// `L(v) = Σ π (A v + b − v₊) − Σ λ d(v)` is not positive at any point that satisfies all
    /// constraints, and differs from what it is here by its gradient `g` times the distance: where
    /// `g` vanishes and `L` is positive there is none. With a `g` that is small there is none but
    /// where numbers are 1e5 times (of single precision a hundred times) as large as here.
    #[inline(always)]
    pub fn proves_infeasibility<E: Packed<T>>(&mut self, multipliers: &mut [T]) -> bool {
        let _ = self.evaluate::<E>(multipliers);
        self.is_certificate::<E>(
            T::from_f64(if T::EPSILON < DOUBLE_PRECISION_EPSILON { 1e5 } else { 1e2 }),
            multipliers,
        )
    }

    /// The same of an iterate that was evaluated, where numbers may be `far` times as large.
    #[cfg_attr(feature = "std", inline(always))]
    #[cfg_attr(not(feature = "std"), inline(never))]
    fn is_certificate<E: Packed<T>>(&self, far: T, multipliers: &[T]) -> bool {
        let count = self.sides.counts.sides();
        let (forces, distances) = (part(self.sides.multiplier, 0, count), part(self.sides.scratch, 0, count));
        let mut lagrangian = dot::<T, E>(multipliers, self.dynamics)
            - dot::<T, E>(forces, distances)
            - dot::<T, E>(self.sides.free, self.sides.equation_residual);
        if let Some(coupling) = &self.coupling {
            lagrangian = lagrangian + dot::<T, E>(coupling.theta, coupling.residual);
        }
        let gradient = self.max_gradient::<E>(self.measure);
        let rounding = T::from_f64(64.0 * T::EPSILON) * self.terms.forces;
        let gradient = nan_max(gradient * far, rounding);
        lagrangian > gradient * (T::ONE + self.terms.values)
    }
}
