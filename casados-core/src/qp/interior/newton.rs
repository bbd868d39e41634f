//! The Newton step from an iterate, and its update.

use super::iterate::{Iterate, at, scaled_proximal_weight, scatter};
use super::riccati::Equations;
use super::vector::{add_scaled, scale_vector};
use crate::qp::error::QpError;
use crate::qp::layout::{StageOffsetsIter, copy_common, part, part_mut};
use crate::scalar::{Packed, Real};

impl<T: Real> Iterate<'_, T> {
    /// Computes the Newton step with `s Δλ + λ Δs = (s + δ λ) · target`; the pairs then have the
    /// changes of slacks and multipliers.
    #[inline(always)]
    pub fn newton<E: Packed<T>>(&mut self, factor: bool) -> Result<(), QpError> {
        self.inequalities.assemble_weights(factor);
        self.solve::<E>(factor)?;
        self.inequalities.steps();
        let weight = T::ONE / self.inequalities.dual_regularisation;
        let sides = &mut self.inequalities;
        let equations =
            sides.equations.iter().zip(&mut *sides.equation_multiplier_steps).zip(&*sides.equation_residual);
        for (((&row, change), &residual), &stiffness) in equations.zip(&*sides.stiffness_scale) {
            *change = *change - weight * stiffness * (at(self.step, row) + residual);
        }
        Ok(())
    }

    /// Solves Newton's equations with the weights of the sides and their gradient terms in
    /// `scratch`; leaves the changes of their distances in `scratch`.
    #[inline(always)]
    pub fn solve<E: Packed<T>>(&mut self, factor: bool) -> Result<(), QpError> {
        self.assemble(factor);
        let equations = Equations {
            qp: self.qp,
            first: self.first,
            objective: self.objective,
            indefinite: self.coupling.as_ref().is_some_and(|coupling| coupling.conditions > 0),
            weights: self.weights,
            gradient: self.gradient,
            dynamics: self.dynamics,
        };
        match &mut self.coupling {
            None => self.riccati.solve::<E>(equations, factor, self.step)?,
            Some(coupling) => {
                let system = (equations, self.measure);
                super::border::solve::<T, E>(coupling, &mut self.riccati, system, factor, self.step)?;
            }
        }
        self.side_steps();
        Ok(())
    }

    /// Assembles the gradient and the weights of Newton's equations.
    #[inline(always)]
    pub fn assemble(&mut self, factor: bool) {
        let weight = T::ONE / self.inequalities.dual_regularisation;
        let sides = &mut self.inequalities;
        copy_common(self.gradient, self.stationarity);
        let (lower, upper) = sides.rows.split_at_checked(sides.counts.lower).unwrap_or_default();
        let (of_lower, of_upper) = sides.scratch.split_at_checked(lower.len()).unwrap_or_default();
        scatter(self.gradient, lower, of_lower, |g, &push| g + push);
        scatter(self.gradient, upper, of_upper, |g, &push| g - push);
        let equations = sides.equations.iter().zip(&*sides.stiffness_scale).zip(&*sides.equation_residual);
        for ((&row, &stiffness), &residual) in equations {
            if let Some(g) = self.gradient.get_mut(row as usize) {
                *g = *g + weight * stiffness * residual;
            }
        }
        scatter(self.gradient, sides.equations, sides.equation_multiplier_steps, |g, &change| g - change);
        if factor {
            self.weights.fill(T::ZERO);
            if self.proximal > T::ZERO {
                for place in StageOffsetsIter::<T>::new(self.qp.dims) {
                    for (i, weight) in part_mut(self.weights, place.row, place.n).iter_mut().enumerate() {
                        *weight = scaled_proximal_weight(self.proximal, self.units, place.row + i);
                    }
                }
            }
            scatter(self.weights, sides.rows, sides.weight, |sum, &weight| sum + weight);
            scatter(self.weights, sides.equations, sides.stiffness_scale, |sum, &stiffness| {
                sum + weight * stiffness
            });
        }
    }

    /// Computes the changes of the distances of the sides from the step.
    #[inline(always)]
    pub fn side_steps(&mut self) {
        self.inequalities.evaluate_sides(self.step, |value, _| value, |value, _| -value);
    }

    /// Takes the fraction `primal` of the step, and `dual` of the step of the multipliers of the
    /// sides. Residuals are unchanged.
    pub fn step_point(&mut self, primal: T, dual: T) {
        add_scaled(self.v, primal, self.step);
        add_scaled(self.inequalities.slack, primal, self.inequalities.slack_step);
        self.step_multipliers(dual, primal);
    }

    /// Takes the full step of the point and the multipliers; slacks are unchanged.
    pub fn step_without_slacks(&mut self) {
        add_scaled(self.v, T::ONE, self.step);
        self.step_multipliers(T::ONE, T::ONE);
    }

    fn step_multipliers(&mut self, of_sides: T, of_equations: T) {
        let sides = &mut self.inequalities;
        add_scaled(sides.multiplier, of_sides, sides.multiplier_step);
        add_scaled(sides.equation_multipliers, of_equations, sides.equation_multiplier_steps);
    }

    /// Takes the fraction `alpha` of the step, and updates the residuals.
    #[inline(always)]
    pub fn take_step<E: Packed<T>>(&mut self, alpha: T) {
        let weight = T::ONE / self.inequalities.dual_regularisation;
        let left = T::ONE - alpha;
        add_scaled(self.v, alpha, self.step);
        scale_vector(self.stationarity, left);
        scale_vector(self.dynamics, left);
        if let Some(coupling) = &mut self.coupling {
            coupling.take_step(alpha);
        }
        let sides = &mut self.inequalities;
        scale_vector(sides.residual, left);
        let count = sides.counts.sides();
        let factor = alpha * sides.dual_regularisation;
        let steps = sides.multiplier_step.iter().zip(&*sides.regularisation_scale);
        for (residual, (&step, &softness)) in sides.residual.iter_mut().zip(steps).take(count) {
            *residual = *residual - factor * softness * step;
        }
        add_scaled(sides.slack, alpha, sides.slack_step);
        add_scaled(sides.multiplier, alpha, sides.multiplier_step);
        let equations =
            sides.equations.iter().zip(&mut *sides.equation_multipliers).zip(&mut *sides.equation_residual);
        for (((&row, free), residual), &stiffness) in equations.zip(&*sides.stiffness_scale) {
            let change = at(self.step, row);
            *free = *free - alpha * weight * stiffness * (change + *residual);
            *residual = *residual + alpha * change;
        }
        let (proximal, units) = (self.proximal, self.units);
        if self.riccati.regularised > 0 || proximal > T::ZERO {
            // An increase of a pivot acts as a proximal term of its variable.
            for place in StageOffsetsIter::<T>::new(self.qp.dims) {
                let added = self.riccati.added.get(place.v..).unwrap_or_default();
                let step = part(self.step, place.row, place.n);
                let residual = part_mut(self.stationarity, place.row, place.n);
                for (i, ((residual, &added), &step)) in residual.iter_mut().zip(added).zip(step).enumerate() {
                    let proximal = scaled_proximal_weight(proximal, units, place.row + i);
                    *residual = *residual - alpha * (proximal + added) * step;
                }
            }
        }
        if let Some(coupling) = &mut self.coupling {
            coupling.fold(self.qp, self.stationarity);
        }
        self.mu = self.inequalities.mu::<E>();
    }

    /// Sets the dynamics residuals of the next solve with the same matrix to zero.
    pub fn clear_dynamics_residuals(&mut self) {
        self.riccati.clear_dynamics_residuals();
        if let Some(coupling) = &mut self.coupling {
            coupling.offset.fill(T::ZERO);
        }
    }
}
