//! Slacks and multipliers of all inequalities: their steps, products and distances.
//!
//! Inequalities have a dual regularisation `δ`: `σ (c v − bound) + e + δ (λ − λ₊) = s`, by the
//! proximal method of multipliers (R. T. Rockafellar, "Augmented Lagrangians and applications of
//! the proximal point algorithm", Math. Oper. Res. 1, 1976; S. Pougkakiotis, J. Gondzio, "An
//! interior point-proximal method of multipliers for convex quadratic programming", Comput. Optim.
//! Appl. 78, 2021). The weight `λ / (s + δ λ)` is therefore below `1 / δ` for every slack, and the
//! digits of the Hessian are preserved.

use super::iterate::at;
use super::sides::Inequalities;
use super::units::Units;
use super::vector::{dot, largest_negative_ratio, largest_size};
use crate::qp::element::set;
use crate::qp::solution::SolutionView;
use crate::qp::solver::QpStart;
use crate::qp::statistics::{nan_max, positive};
use crate::scalar::{Packed, Real};

impl<T: Real> Inequalities<'_, T> {
    /// Returns `Σ s λ` over the number of pairs.
    #[inline(always)]
    pub fn mu<E: Packed<T>>(&self) -> T {
        let pairs = self.counts.pair_count().max(1);
        dot::<T, E>(self.slack, self.multiplier) / T::from_whole(pairs)
    }

    /// Writes a function of the value of the row and the bound of every side to `scratch`.
    #[inline(always)]
    pub fn evaluate_sides(&mut self, values: &[T], lower: impl Fn(T, T) -> T, upper: impl Fn(T, T) -> T) {
        let count = self.counts.lower;
        let (lower_rows, upper_rows) = self.rows.split_at_checked(count).unwrap_or_default();
        let (lower_bounds, upper_bounds) = self.bound.split_at_checked(count).unwrap_or_default();
        let (lower_values, upper_values) = self.scratch.split_at_mut_checked(count).unwrap_or_default();
        for ((target, &row), &bound) in lower_values.iter_mut().zip(lower_rows).zip(lower_bounds) {
            *target = lower(at(values, row), bound);
        }
        for ((target, &row), &bound) in upper_values.iter_mut().zip(upper_rows).zip(upper_bounds) {
            *target = upper(at(values, row), bound);
        }
    }

    /// Reads the multipliers of a solution.
    pub fn load_multipliers(&mut self, solution: &SolutionView<'_, T>) {
        let (lower, upper) = self.rows.split_at_checked(self.counts.lower).unwrap_or_default();
        let sides = lower.iter().map(|&row| at(solution.lower, row));
        let sides = sides.chain(upper.iter().map(|&row| at(solution.upper, row)));
        for (multiplier, given) in self.multiplier.iter_mut().zip(sides) {
            *multiplier = given;
        }
        for (free, &row) in self.equation_multipliers.iter_mut().zip(&*self.equations) {
            *free = at(solution.lower, row) - at(solution.upper, row);
        }
    }

    /// Initialises slacks, at least `distance` units from zero, and multipliers, from a solution or
    /// such that all products are equal. `scratch` has the distances from the bounds.
    pub fn initialise(
        &mut self,
        start: QpStart,
        distance: T,
        units: Units<'_, T>,
        solution: &SolutionView<'_, T>,
    ) {
        let (sides, product) = (self.counts.sides(), distance * distance * units.objective);
        for ((slack, &value), &row) in self.slack.iter_mut().zip(&*self.scratch).zip(&*self.rows) {
            *slack = value.max(distance * units.of(row as usize));
        }
        if start == QpStart::Warm {
            self.load_multipliers(solution);
        }
        for (multiplier, &slack) in self.multiplier.iter_mut().zip(&*self.slack).take(sides) {
            *multiplier = multiplier.max(product / slack);
        }
        for (j, &side) in self.soft.iter().enumerate() {
            let side = side as usize;
            let (Some(&linear), Some(&quadratic)) = (self.linear.get(j), self.quadratic.get(j)) else {
                break;
            };
            let (Some(&value), Some(slack), Some(multiplier)) =
                (self.scratch.get(side), self.slack.get(side).copied(), self.multiplier.get(side).copied())
            else {
                break;
            };
            // The gradient with respect to the violation vanishes: `λ + ν = linear + quadratic e`.
            let unit = self.rows.get(side).map_or(T::ONE, |&row| units.of(row as usize));
            let violation = (slack - value).max(distance * unit);
            let force = linear + quadratic * violation;
            // Both products are equal to those of other pairs, as far as the sum `λ + ν` allows.
            let least = T::from_f64(0.01) * force;
            let share = product / slack;
            let least = if share < least { share } else { least };
            let most = force - least;
            let multiplier = if multiplier < most { multiplier.max(least) } else { most };
            set(self.multiplier, side, multiplier);
            set(self.slack, sides + j, violation);
            set(self.multiplier, sides + j, force - multiplier);
        }
    }

    /// Returns `Σ s λ` over the number of pairs after the fraction `alpha` of the predictor.
    #[inline(always)]
    pub fn mu_after<E: Packed<T>>(&self, alpha: T, mu: T) -> T {
        let pairs = self.counts.pair_count().max(1);
        let products = dot::<T, E>(self.slack_step, self.multiplier_step) / T::from_whole(pairs);
        (T::ONE - alpha) * mu + alpha * alpha * products
    }

    /// Returns the largest violation of a side in units; `scratch` must still have the distances.
    #[inline(always)]
    pub fn violation(&self, units: Units<'_, T>) -> T {
        let distances = self.scratch.iter().zip(&*self.rows);
        distances.fold(T::ZERO, |most, (&distance, &row)| (-distance / units.of(row as usize)).max(most))
    }

    /// Returns the largest residual of a side or an equation in units.
    #[inline(always)]
    pub fn max_residual<E: Packed<T>>(&self, units: Units<'_, T>) -> T {
        if units.rows.is_empty() {
            let of_sides = largest_size::<T, E>(self.residual);
            return nan_max(of_sides, largest_size::<T, E>(self.equation_residual));
        }
        let sides = self.residual.iter().zip(&*self.rows);
        let equations = self.equation_residual.iter().zip(&*self.equations);
        sides
            .chain(equations)
            .fold(T::ZERO, |most, (residual, &row)| nan_max(most, residual.abs() / units.of(row as usize)))
    }

    /// Sets the targets `s Δλ + λ Δs = μ − s λ`.
    #[inline(always)]
    pub fn centring_targets(&mut self, mu: T) {
        let own = self.dual_regularisation;
        let mut pairs = self.slack.iter().zip(&*self.multiplier);
        let mut targets = self.inverse.iter_mut().zip(&mut *self.target);
        for ((&softness, (&slack, &multiplier)), (inverse, target)) in
            self.regularisation_scale.iter().zip(&mut pairs).zip(&mut targets)
        {
            *inverse = T::ONE / (slack + own * softness * multiplier);
            *target = (mu - slack * multiplier) * *inverse;
        }
        // Violations have no dual regularisation.
        for ((&slack, &multiplier), (inverse, target)) in pairs.zip(targets) {
            *inverse = T::ONE / slack;
            *target = (mu - slack * multiplier) * *inverse;
        }
    }

    /// Sets the targets of the corrector, `s Δλ + λ Δs = σμ − s λ − Δs Δλ`, with the products of
    /// the predictor.
    #[inline(always)]
    pub fn corrector_targets(&mut self, sigma_mu: T) {
        let steps = self.slack_step.iter().zip(&*self.multiplier_step);
        let pairs = self.multiplier.iter().zip(&*self.slack).zip(&*self.inverse);
        for ((target, (&ds, &dl)), ((&multiplier, &slack), &inverse)) in
            self.target.iter_mut().zip(steps).zip(pairs)
        {
            *target = (sigma_mu - ds * dl - slack * multiplier) * inverse;
        }
    }

    /// Writes the gradient terms of the sides in Newton's equations to `scratch`, and computes
    /// their weights.
    #[inline(always)]
    pub fn assemble_weights(&mut self, weights: bool) {
        if weights {
            for ((weight, &multiplier), &inverse) in
                self.weight.iter_mut().zip(&*self.multiplier).zip(&*self.inverse)
            {
                *weight = multiplier * inverse;
            }
        }
        let pairs = self.target.iter().zip(&*self.residual);
        for ((push, &weight), (&target, &residual)) in self.scratch.iter_mut().zip(&*self.weight).zip(pairs) {
            *push = weight * residual - target;
        }
        for (j, &side) in self.soft.iter().enumerate() {
            let Some(soft) = self.soft_side(j, side as usize) else { break };
            if weights {
                set(self.weight, side as usize, soft.weight);
            }
            let residual = at(self.residual, side);
            set(self.scratch, side as usize, soft.weight * residual - soft.target);
        }
    }

    /// Computes the changes of slacks, from the changes of rows in `scratch`, and of multipliers.
    #[inline(always)]
    pub fn steps(&mut self) {
        let (sides, compliance) = (self.counts.sides(), self.dual_regularisation);
        let pairs = self.slack.iter().zip(&*self.multiplier).zip(&*self.inverse).zip(&*self.target);
        let steps = self.slack_step.iter_mut().zip(&mut *self.multiplier_step);
        let changes = self.scratch.iter().zip(&*self.residual).zip(&*self.regularisation_scale);
        for (
            ((slack_step, multiplier_step), (((&slack, &multiplier), &inverse), &target)),
            ((&change, &residual), &softness),
        ) in steps.zip(pairs).zip(changes)
        {
            let change = change + residual;
            *slack_step = change * (slack * inverse) + compliance * softness * target;
            *multiplier_step = target - multiplier * inverse * change;
        }
        for (j, &side) in self.soft.iter().enumerate() {
            let Some(soft) = self.soft_side(j, side as usize) else { break };
            let change = at(self.scratch, side) + at(self.residual, side);
            // The change of `s − e`, and their sum, in a form without cancellation for small slacks
            // with large weights.
            let change = change * soft.share + soft.own_compliance * soft.target;
            let violation = (soft.sum - soft.stiffness * change) * soft.inverse;
            let step = (soft.sum + soft.compliance * change) * soft.inverse;
            set(self.slack_step, side as usize, step);
            set(self.multiplier_step, side as usize, soft.own - soft.stiffness * step);
            set(self.slack_step, sides + j, violation);
            set(self.multiplier_step, sides + j, soft.others - soft.other * violation);
        }
    }

    /// Eliminates the violation of a soft side.
    #[inline(always)]
    fn soft_side(&self, j: usize, side: usize) -> Option<CondensedSoftSide<T>> {
        let violation = self.counts.sides() + j;
        let (slack, multiplier) = (*self.slack.get(side)?, *self.multiplier.get(side)?);
        let stiffness = multiplier / slack;
        let other = *self.multiplier.get(violation)? * *self.inverse.get(violation)?;
        let quadratic = *self.quadratic.get(j)?;
        let own_compliance = self.dual_regularisation * *self.regularisation_scale.get(side)?;
        let own = *self.target.get(side)? * (T::ONE + own_compliance * stiffness);
        let others = *self.target.get(violation)?;
        let inverse = T::ONE / (quadratic + stiffness + other);
        let sum = own + others;
        let weight = stiffness * (quadratic + other) * inverse;
        let share = T::ONE / (T::ONE + own_compliance * weight);
        Some(CondensedSoftSide {
            weight: weight * share,
            target: (own - stiffness * sum * inverse) * share,
            compliance: quadratic + other,
            own_compliance,
            share,
            own,
            others,
            other,
            sum,
            stiffness,
            inverse,
        })
    }

    /// Returns the largest step length, at most 1, after which slacks and multipliers keep the
    /// fraction `keep` of their values.
    #[inline(always)]
    pub fn step_to_boundary<E: Packed<T>>(&self, boundary_fraction: T) -> T {
        let most = T::ONE - boundary_fraction;
        let ratio = largest_negative_ratio::<T, E>(most, self.slack_step, self.slack);
        most / largest_negative_ratio::<T, E>(ratio, self.multiplier_step, self.multiplier)
    }

    /// Returns the penalties of the violations, for distances in `scratch`.
    pub fn violation_cost(&self) -> T {
        let costs = self.soft.iter().zip(self.linear.iter().zip(&*self.quadratic));
        costs.fold(T::ZERO, |sum, (&side, (&linear, &quadratic))| {
            let violation = positive(-at(self.scratch, side));
            sum + violation * (linear + T::from_f64(0.5) * quadratic * violation)
        })
    }

    /// Splits the distances of soft sides in `scratch` into nonnegative distances and violations.
    pub fn split_soft_distances(&mut self) {
        let sides = self.counts.sides();
        for (j, &side) in self.soft.iter().enumerate() {
            let distance = at(self.scratch, side);
            set(self.scratch, sides + j, positive(-distance));
            set(self.scratch, side as usize, positive(distance));
        }
    }

    /// Returns the residuals of inequalities and complementarity in units as
    /// [`qp::residuals`](crate::qp::residuals) does, from the distances and violations in
    /// `scratch`, independently of the slacks.
    pub fn residuals(&self, units: Units<'_, T>) -> (T, T) {
        let (mut inequalities, mut products) = (T::ZERO, T::ZERO);
        let force = units.objective;
        let (distances, violations) = self.scratch.split_at_checked(self.counts.sides()).unwrap_or_default();
        let soft = self.soft.iter().zip(violations).zip(self.linear.iter().zip(&*self.quadratic));
        for ((&side, &violation), (&linear, &quadratic)) in soft {
            let lacks = linear + quadratic * violation - at(self.multiplier, side);
            let unit = self.rows.get(side as usize).map_or(T::ONE, |&row| units.of(row as usize));
            inequalities = nan_max(inequalities, -lacks * unit / force);
            products = nan_max(products, violation * positive(lacks) / force);
        }
        let sides = distances.iter().zip(&*self.multiplier).zip(&*self.rows);
        for ((&distance, &multiplier), &row) in sides {
            inequalities = nan_max(inequalities, -distance / units.of(row as usize));
            products = nan_max(products, positive(distance) * multiplier / force);
        }
        for (residual, &row) in self.equation_residual.iter().zip(&*self.equations) {
            inequalities = nan_max(inequalities, residual.abs() / units.of(row as usize));
        }
        (inequalities, products)
    }
}

/// A soft side after elimination of its violation.
struct CondensedSoftSide<T> {
    weight: T,
    target: T,
    share: T,
    own: T,
    others: T,
    other: T,
    sum: T,
    stiffness: T,
    compliance: T,
    own_compliance: T,
    inverse: T,
}
