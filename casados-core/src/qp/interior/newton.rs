//! Newton's step from an iterate, and the way along it.

use super::iterate::{Iterate, at, scaled_proximal_weight, scatter};
use super::riccati::Equations;
use super::vector::{add_scaled, scale_vector};
use crate::qp::error::QpError;
use crate::qp::layout::{Places, copy_common, part, part_mut};
use crate::scalar::{Packed, Real};

impl<T: Real> Iterate<'_, T> {
    /// Newton's step, with `s Δλ + λ Δs = s · target`. Changes of slacks and multipliers are those
    /// of pairs afterwards.
    #[inline(always)]
    pub fn newton<E: Packed<T>>(&mut self, factor: bool) -> Result<(), QpError> {
        self.sides.assemble_weights(factor);
        self.solve::<E>(factor)?;
        self.sides.steps();
        let weight = T::ONE / self.sides.compliance;
        let sides = &mut self.sides;
        let equations = sides.equations.iter().zip(&mut *sides.free_step).zip(&*sides.equation_residual);
        for (((&row, change), &residual), &stiffness) in equations.zip(&*sides.stiffness) {
            *change = *change - weight * stiffness * (at(self.step, row) + residual);
        }
        Ok(())
    }

    /// Newton's equations with the weights of the sides, and what they add to the gradient in
    /// `scratch`, where the changes of their distances are afterwards.
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

    /// Gradient and weights of Newton's equations.
    #[inline(always)]
    pub fn assemble(&mut self, factor: bool) {
        let weight = T::ONE / self.sides.compliance;
        let sides = &mut self.sides;
        copy_common(self.gradient, self.stationarity);
        let (lower, upper) = sides.rows.split_at_checked(sides.counts.lower).unwrap_or_default();
        let (of_lower, of_upper) = sides.scratch.split_at_checked(lower.len()).unwrap_or_default();
        scatter(self.gradient, lower, of_lower, |g, &push| g + push);
        scatter(self.gradient, upper, of_upper, |g, &push| g - push);
        let equations = sides.equations.iter().zip(&*sides.stiffness).zip(&*sides.equation_residual);
        for ((&row, &stiffness), &residual) in equations {
            if let Some(g) = self.gradient.get_mut(row as usize) {
                *g = *g + weight * stiffness * residual;
            }
        }
        scatter(self.gradient, sides.equations, sides.free_step, |g, &change| g - change);
        if factor {
            self.weights.fill(T::ZERO);
            if self.proximal > T::ZERO {
                for place in Places::<T>::new(self.qp.dims) {
                    for (i, weight) in part_mut(self.weights, place.row, place.n).iter_mut().enumerate() {
                        *weight = scaled_proximal_weight(self.proximal, self.units, place.row + i);
                    }
                }
            }
            scatter(self.weights, sides.rows, sides.weight, |sum, &weight| sum + weight);
            scatter(self.weights, sides.equations, sides.stiffness, |sum, &stiffness| {
                sum + weight * stiffness
            });
        }
    }

    /// The changes of the distances of sides, from the step.
    #[inline(always)]
    pub fn side_steps(&mut self) {
        self.sides.evaluate_sides(self.step, |value, _| value, |value, _| -value);
    }

    /// The distances from the bounds, into `scratch`.
    #[inline(always)]
    pub fn evaluate_distances(&mut self) {
        self.sides.evaluate_sides(self.v, |value, bound| value - bound, |value, bound| bound - value);
    }

    /// Goes a part of the step, and another part of that of the multipliers of sides. Residuals
    /// stay as they were.
    pub fn go(&mut self, primal: T, dual: T) {
        add_scaled(self.v, primal, self.step);
        add_scaled(self.sides.slack, primal, self.sides.slack_step);
        self.step_multipliers(dual, primal);
    }

    /// The point and the multipliers after the full step; slacks stay as they are.
    pub fn step_without_slacks(&mut self) {
        add_scaled(self.v, T::ONE, self.step);
        self.step_multipliers(T::ONE, T::ONE);
    }

    fn step_multipliers(&mut self, of_sides: T, of_equations: T) {
        let sides = &mut self.sides;
        add_scaled(sides.multiplier, of_sides, sides.multiplier_step);
        add_scaled(sides.free, of_equations, sides.free_step);
    }

    /// Goes a part of the step.
    #[inline(always)]
    pub fn advance<E: Packed<T>>(&mut self, alpha: T) {
        let weight = T::ONE / self.sides.compliance;
        let left = T::ONE - alpha;
        add_scaled(self.v, alpha, self.step);
        scale_vector(self.stationarity, left);
        scale_vector(self.dynamics, left);
        if let Some(coupling) = &mut self.coupling {
            coupling.take_step(alpha);
        }
        let sides = &mut self.sides;
        scale_vector(sides.residual, left);
        let count = sides.counts.sides();
        let factor = alpha * sides.compliance;
        let steps = sides.multiplier_step.iter().zip(&*sides.softness);
        for (residual, (&step, &softness)) in sides.residual.iter_mut().zip(steps).take(count) {
            *residual = *residual - factor * softness * step;
        }
        add_scaled(sides.slack, alpha, sides.slack_step);
        add_scaled(sides.multiplier, alpha, sides.multiplier_step);
        let equations = sides.equations.iter().zip(&mut *sides.free).zip(&mut *sides.equation_residual);
        for (((&row, free), residual), &stiffness) in equations.zip(&*sides.stiffness) {
            let change = at(self.step, row);
            *free = *free - alpha * weight * stiffness * (change + *residual);
            *residual = *residual + alpha * change;
        }
        let (proximal, units) = (self.proximal, self.units);
        if self.riccati.regularised > 0 || proximal > T::ZERO {
            // What was added to a pivot is a force that keeps its variable where it is.
            for place in Places::<T>::new(self.qp.dims) {
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
        self.mu = self.sides.mu::<E>();
    }

    /// The next solve with the same matrix has other residuals of the dynamics: none, but for
    /// rounding.
    pub fn clear_dynamics_residuals(&mut self) {
        self.riccati.clear_dynamics_residuals();
        if let Some(coupling) = &mut self.coupling {
            coupling.offset.fill(T::ZERO);
        }
    }
}
