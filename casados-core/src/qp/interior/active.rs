//! Warm starts by active sets: Newton's method on `min(s, λ) = 0` instead of `s λ = μ` (M.
//! Hintermüller, K. Ito, K. Kunisch, "The primal-dual active set strategy as a semismooth Newton
//! method", SIAM J. Optim. 13, 2002).
//!
//! The active set of a QP that resembles the last one is mostly known from the multipliers. One
//! factorisation solves the QP with these bounds as equations; then violated bounds become active,
//! and bounds with negative multipliers inactive. An interior point, which must leave the boundary
//! first, takes several times as many iterations. If the active sets do not settle the interior
//! point follows, so that the result does not depend on them.
//!
//! With the distance `d = σ (c v − bound)`, a weight `W`, and the penalty `l e + ½ q e²` of a
//! violation `e`:
//!
//! ```text
//! inactive   λ = 0           until d < 0
//! active     λ₊ = λ − W d₊   until λ < 0, or, of a soft side, λ > l        (augmented Lagrangian: d₊ = (λ − λ₊) / W)
//! violated   λ = l − q d     until d > 0
//! ```

use super::iterate::{Iterate, at};
use super::limits::ResidualTolerances;
use super::sides::Inequalities;
use super::terms::Terms;
use super::units::Units;
use crate::qp::element::set;
use crate::qp::layout::{copy_common, part_mut};
use crate::qp::solution::SolutionView;
use crate::qp::solver::QpStart;
use crate::qp::statistics::QpStatistics;
use crate::scalar::{Packed, Real};

/// The activity of a side.
const INACTIVE: u32 = 0;
const ACTIVE: u32 = 1;
const VIOLATED: u32 = 2;

/// The maximum number of solves with the same factors.
const MAX_REFINEMENTS: usize = 3;

impl<T: Real> Iterate<'_, T> {
    /// Solves the QP by active sets, from a point and its multipliers, in at most `tries` active
    /// sets. Returns the statistics as an error if the sets do not settle or a pivot vanishes. A
    /// cold start tries the solution without active bounds, unless the zero point violates one.
    #[inline(always)]
    pub fn by_active_sets<E: Packed<T>>(
        &mut self,
        (start, tries): (QpStart, usize),
        limits: &ResidualTolerances<T>,
        over: &mut dyn FnMut() -> bool,
        solution: &mut SolutionView<'_, T>,
    ) -> Result<QpStatistics, QpStatistics> {
        let mut statistics = QpStatistics::default();
        if tries == 0 {
            return Err(statistics);
        }
        self.load_point(solution);
        self.load_initial_state();
        self.evaluate_values::<E>();
        self.inequalities.load_multipliers(solution);
        self.inequalities.guess();
        if start == QpStart::Cold && (!self.inequalities.is_active_set_empty() || over()) {
            return Err(statistics);
        }
        self.first_gradient::<E>(limits, solution.dynamics);
        self.set_regularisation(false);
        let (mut factor, mut changes) = (true, usize::MAX);
        loop {
            if factor {
                statistics.iterations += 1;
                statistics.active_sets += 1;
                statistics.factorisations += 1;
            } else {
                statistics.refinements += 1;
            }
            if !self.active_step::<E>(factor) {
                return Err(statistics);
            }
            let before = changes;
            // Violations and multipliers below the tolerance change no side.
            let Terms { gradient_terms: forces, condition_terms: values } = limits.of(self.terms);
            let half = T::from_f64(0.5);
            changes = self.inequalities.update_active_set(
                Terms { gradient_terms: half * forces, condition_terms: half * values },
                self.measure,
            );
            factor = changes > 0;
            if factor {
                // Converging sets have a non-increasing number of changes.
                if statistics.iterations >= tries || changes > before {
                    return Err(statistics);
                }
                continue;
            }
            self.inequalities.clip_to_feasible_signs();
            let objective = self.evaluate::<E>(solution.dynamics);
            let residuals = self.evaluated_residuals::<E>();
            if objective.is_finite() && self.is_converged(residuals, limits) {
                (statistics.objective, statistics.residuals) =
                    (objective.to_f64(), self.unscaled_residuals(residuals));
                return Ok(statistics);
            }
            if statistics.refinements >= MAX_REFINEMENTS {
                return Err(QpStatistics { refinements: 0, ..statistics });
            }
            self.inequalities.restore_signed_distances();
            self.clear_dynamics_residuals();
        }
    }

    /// Takes a Newton step with the current active set; returns whether it succeeded.
    #[inline(always)]
    fn active_step<E: Packed<T>>(&mut self, factor: bool) -> bool {
        let weight = T::ONE / self.inequalities.dual_regularisation;
        self.inequalities.assemble_active_weights();
        if self.solve::<E>(factor).is_err() || self.riccati.regularised > 0 {
            return false;
        }
        for (v, &step) in self.v.iter_mut().zip(&*self.step) {
            *v = *v + step;
        }
        // A full step removes these residuals.
        self.stationarity.fill(T::ZERO);
        self.dynamics.fill(T::ZERO);
        if let Some(coupling) = &mut self.coupling {
            coupling.take_step(T::ONE);
        }
        let sides = &mut self.inequalities;
        let equations =
            sides.equations.iter().zip(&mut *sides.equation_multipliers).zip(&mut *sides.equation_residual);
        for (((&row, free), residual), &stiffness) in equations.zip(&*sides.stiffness_scale) {
            *residual = *residual + at(self.step, row);
            *free = *free - weight * stiffness * *residual;
        }
        sides.update_after_active_step();
        true
    }
}

/// In these functions `slack` is the distance `d`, which may be negative, and `target` the
/// multiplier that the gradient contains.
impl<T: Real> Inequalities<'_, T> {
    /// Returns whether there are neither active sides nor equations.
    fn is_active_set_empty(&self) -> bool {
        self.equations.is_empty() && self.activity.iter().all(|&activity| activity == INACTIVE)
    }

    /// Returns `l − q d`, the multiplier of a violated side.
    #[inline(always)]
    fn penalty(&self, j: usize, distance: T) -> T {
        at(self.linear, j as u32) - at(self.quadratic, j as u32) * distance
    }

    /// Guesses the active set from distances in `scratch` and multipliers.
    fn guess(&mut self) {
        let count = self.counts.sides();
        copy_common(part_mut(self.slack, 0, count), self.scratch);
        for (((activity, &distance), &multiplier), &softness) in
            self.activity.iter_mut().zip(&*self.slack).zip(&*self.multiplier).zip(&*self.regularisation_scale)
        {
            *activity = if multiplier * softness > distance { ACTIVE } else { INACTIVE };
        }
        for (j, &side) in self.soft.iter().enumerate() {
            let (distance, multiplier) = (at(self.slack, side), at(self.multiplier, side));
            let force = self.penalty(j, distance);
            // The violation and the difference of the penalty's slope and the multiplier are
            // complementary.
            let softness = at(self.regularisation_scale, side);
            if distance < T::ZERO && -distance > (force - multiplier) * softness {
                set(self.activity, side as usize, VIOLATED);
                set(self.multiplier, side as usize, force);
            }
        }
        for (&activity, multiplier) in self.activity.iter().zip(&mut *self.multiplier) {
            if activity == INACTIVE {
                *multiplier = T::ZERO;
            }
        }
        copy_common(part_mut(self.target, 0, count), self.multiplier);
    }

    /// Computes weights, and in `scratch` the gradient of the sides beyond what the gradient
    /// contains.
    #[inline(always)]
    fn assemble_active_weights(&mut self) {
        let weight = T::ONE / self.dual_regularisation;
        for ((&activity, side_weight), &softness) in
            self.activity.iter().zip(&mut *self.weight).zip(&*self.regularisation_scale)
        {
            *side_weight = if activity == ACTIVE { weight / softness } else { T::ZERO };
        }
        let forces = self.multiplier.iter().zip(&*self.target).zip(self.weight.iter().zip(&*self.slack));
        for (scratch, ((&force, &known), (&weight, &distance))) in self.scratch.iter_mut().zip(forces) {
            *scratch = known - force + weight * distance;
        }
        for (&side, &quadratic) in self.soft.iter().zip(&*self.quadratic) {
            if self.activity.get(side as usize) == Some(&VIOLATED) {
                set(self.weight, side as usize, quadratic);
            }
        }
    }

    /// Updates distances and multipliers after a step; `scratch` has the changes of the rows.
    #[inline(always)]
    fn update_after_active_step(&mut self) {
        for (distance, &change) in self.slack.iter_mut().zip(&*self.scratch).take(self.counts.sides()) {
            *distance = *distance + change;
        }
        let sides = self.activity.iter().zip(&*self.slack).zip(&*self.weight);
        for (multiplier, ((&activity, &distance), &weight)) in self.multiplier.iter_mut().zip(sides) {
            *multiplier = *multiplier - if activity == ACTIVE { weight * distance } else { T::ZERO };
        }
        for (j, &side) in self.soft.iter().enumerate() {
            if self.activity.get(side as usize) == Some(&VIOLATED) {
                set(self.multiplier, side as usize, self.penalty(j, at(self.slack, side)));
            }
        }
        copy_common(part_mut(self.target, 0, self.counts.sides()), self.multiplier);
    }

    /// Updates the active set by distances and multipliers. Returns the number of changes.
    #[inline(always)]
    fn update_active_set(&mut self, tolerance: Terms<T>, units: Units<'_, T>) -> usize {
        let Terms { gradient_terms: forces, condition_terms: values } = tolerance;
        let mut changes = 0;
        let sides = self.activity.iter_mut().zip(&*self.slack).zip(&*self.rows);
        for (((activity, &distance), &row), multiplier) in sides.zip(&mut *self.multiplier) {
            let unit = units.of(row as usize);
            let (forces, values) = (forces * units.objective / unit, values * unit);
            if *activity == ACTIVE && *multiplier < -forces {
                (*activity, *multiplier) = (INACTIVE, T::ZERO);
                changes += 1;
            } else if *activity == INACTIVE && distance < -values {
                *activity = ACTIVE;
                changes += 1;
            }
        }
        for (j, &side) in self.soft.iter().enumerate() {
            let (distance, multiplier) = (at(self.slack, side), at(self.multiplier, side));
            let (linear, whole) = (at(self.linear, j as u32), self.penalty(j, distance));
            let unit = self.rows.get(side as usize).map_or(T::ONE, |&row| units.of(row as usize));
            let (forces, values) = (forces * units.objective / unit, values * unit);
            let Some(activity) = self.activity.get_mut(side as usize) else { break };
            // Without a linear penalty a side is either inactive or violated.
            let between = linear > T::ZERO;
            match *activity {
                ACTIVE if !between || multiplier > linear + forces => {
                    *activity = VIOLATED;
                    set(self.multiplier, side as usize, whole);
                    changes += usize::from(between);
                }
                VIOLATED if distance > values => {
                    *activity = if between { ACTIVE } else { INACTIVE };
                    set(self.multiplier, side as usize, if between { linear } else { T::ZERO });
                    changes += 1;
                }
                _ => {}
            }
        }
        changes
    }

    /// Converts to slacks, violations and multipliers of an interior point, which are nonnegative.
    #[inline(always)]
    fn clip_to_feasible_signs(&mut self) {
        let count = self.counts.sides();
        for (j, &side) in self.soft.iter().enumerate() {
            let violated = self.activity.get(side as usize) == Some(&VIOLATED);
            let lacks = at(self.linear, j as u32) - at(self.multiplier, side);
            let (violation, other) =
                if violated { (-at(self.slack, side), T::ZERO) } else { (T::ZERO, lacks) };
            set(self.slack, count + j, violation.max(T::ZERO));
            set(self.multiplier, count + j, other.max(T::ZERO));
        }
        let sides = self.slack.iter_mut().zip(&mut *self.multiplier);
        for ((slack, multiplier), &activity) in sides.zip(&*self.activity) {
            *slack = if activity == INACTIVE { slack.max(T::ZERO) } else { T::ZERO };
            *multiplier = multiplier.max(T::ZERO);
        }
    }

    /// Restores signed distances from the residuals of a settled point.
    #[inline(always)]
    fn restore_signed_distances(&mut self) {
        let count = self.counts.sides();
        for (distance, &residual) in self.slack.iter_mut().zip(&*self.residual).take(count) {
            *distance = *distance + residual;
        }
        for (j, &side) in self.soft.iter().enumerate() {
            let (violation, distance) = (at(self.slack, (count + j) as u32), at(self.slack, side));
            set(self.slack, side as usize, distance - violation);
        }
        copy_common(part_mut(self.target, 0, count), self.multiplier);
    }
}
