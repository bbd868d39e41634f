//! One iterate of the interior point, its residuals, and the step from it.

use super::kernels::{Columns, add_transposed, subtract, symmetric};
use super::riccati::{Equations, First, Riccati};
use super::sides::{Counts, Sides, set};
use super::vector::{
    add_scaled, dot, larger, largest_negative_ratio, largest_product, largest_size,
    shrink,
};
use crate::qp::error::QpError;
use crate::qp::layout::{Place, Places, StageDims, assign, end, pad, part, part_mut, take_mut};
use crate::qp::problem::QpView;
use crate::qp::solution::SolutionView;
use crate::qp::solver::Start;
use crate::qp::statistics::{Residuals, larger as larger_or_nan, positive};
use crate::scalar::{Packed, Piece, Real};
use core::marker::PhantomData;

/// A point, its multipliers and residuals. Vectors over rows are `v` and the values of general constraints of each stage.
///
/// The residuals of linear conditions are not computed again in every iteration: a step of length `α` leaves `1 − α` of
/// them. The multipliers of the dynamics are not needed for that, and come from a recursion at the end.
pub struct Iterate<'a, T> {
    pub qp: QpView<'a, T>,
    pub first: First,
    pub riccati: Riccati<'a, T>,
    pub sides: Sides<'a, T>,
    /// `v` and `C x + D u`
    pub v: &'a mut [T],
    /// `Δ`
    pub step: &'a mut [T],
    /// Gradient of the Lagrangian.
    pub stationarity: &'a mut [T],
    /// Right-hand side of Newton's equations.
    gradient: &'a mut [T],
    /// Weights of rows.
    weights: &'a mut [T],
    /// `A x + B u + b − x₊`
    pub dynamics: &'a mut [T],
    /// The multiplier of a given state at the start.
    pub initial: &'a mut [T],
    /// `Σ s λ` over the number of pairs.
    pub mu: T,
    /// The largest terms of the residuals when they were computed last.
    pub terms: Terms<T>,
}

/// What residuals are sums of.
#[derive(Clone, Copy)]
pub struct Terms<T> {
    /// In gradients: `H v`, `h`, forces of constraints, `π`.
    pub forces: T,
    /// In conditions: `v`, `C x + D u`, `b`.
    pub values: T,
}

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

/// The residuals as a function of its own; the gradient only where there is room for multipliers and the objective.
struct Evaluate<'s, 'a, T, E> {
    iterate: &'s mut Iterate<'a, T>,
    values: bool,
    multipliers: Option<(&'s mut [T], &'s mut T)>,
    register: PhantomData<E>,
}

impl<T: Real, E: Packed<T>> Piece for Evaluate<'_, '_, T, E> {
    #[inline(always)]
    fn run(self) {
        if self.values {
            self.iterate.values::<E>();
        }
        if let Some((multipliers, objective)) = self.multipliers {
            *objective = self.iterate.gradient::<E>(multipliers);
        }
    }
}

const fn first_nx(dims: &[StageDims]) -> usize {
    match dims.first() {
        Some(first) => first.nx,
        None => 0,
    }
}

impl<'a, T: Real> Iterate<'a, T> {
    /// How many numbers it takes.
    pub const fn memory(dims: &[StageDims], counts: &Counts) -> usize {
        let end = end::<T>(dims);
        Riccati::<T>::memory(dims) + counts.numbers() + 5 * end.row + end.dynamics + first_nx(dims)
    }

    /// In memory that is zero.
    pub fn new(qp: QpView<'a, T>, first: First, sides: Sides<'a, T>, numbers: &mut &'a mut [T]) -> Self {
        let (riccati, initial) = (Riccati::new(qp.dims, numbers), first_nx(qp.dims));
        let end = riccati.end;
        Self {
            qp,
            first,
            riccati,
            sides,
            v: take_mut(numbers, end.row),
            step: take_mut(numbers, end.row),
            stationarity: take_mut(numbers, end.row),
            gradient: take_mut(numbers, end.row),
            weights: take_mut(numbers, end.row),
            dynamics: take_mut(numbers, end.dynamics),
            initial: take_mut(numbers, if first == First::Fixed { initial } else { 0 }),
            mu: T::ZERO,
            terms: Terms { forces: T::ZERO, values: T::ZERO },
        }
    }

    /// What sides and equations give way to forces, in the units of the problem.
    pub fn set_compliance(&mut self) {
        let Terms { forces, values } = self.terms;
        let stiffness = T::from_f64(0.01) * forces / values.max(T::ONE);
        self.sides.compliance = T::from_f64(T::EPSILON).sqrt() / stiffness.max(T::ONE);
    }

    /// Computes all residuals from the point: general constraints, dynamics, the multipliers `π` that make the gradient of the
    /// Lagrangian in `x` zero, and the gradient in `u`. Returns the objective.
    pub fn evaluate<E: Packed<T>>(&mut self, multipliers: &mut [T]) -> T {
        self.evaluate_parts::<E>(true, Some(multipliers))
    }

    /// General constraints, dynamics, and what belongs to sides; the distances from the bounds are in `scratch` afterwards.
    pub fn evaluate_values<E: Packed<T>>(&mut self) {
        let _ = self.evaluate_parts::<E>(true, None);
    }

    /// What is left of [`evaluate`](Self::evaluate) after [`evaluate_values`](Self::evaluate_values).
    pub fn evaluate_gradient<E: Packed<T>>(&mut self, multipliers: &mut [T]) {
        let _ = self.evaluate_parts::<E>(false, Some(multipliers));
    }

    #[inline(always)]
    fn evaluate_parts<E: Packed<T>>(&mut self, values: bool, multipliers: Option<&mut [T]>) -> T {
        let (mut objective, register) = (T::ZERO, PhantomData);
        let multipliers = multipliers.map(|multipliers| (multipliers, &mut objective));
        E::vectorize(Evaluate::<T, E> { iterate: self, values, multipliers, register });
        objective
    }

    /// The multipliers `π`, the gradient in `u`, and the objective.
    #[inline(always)]
    fn gradient<E: Packed<T>>(&mut self, multipliers: &mut [T]) -> T {
        let sides = &mut self.sides;
        // Forces of the constraints, by rows.
        let forces = &mut *self.gradient;
        forces.fill(T::ZERO);
        let (lower, upper) = sides.rows.split_at_checked(sides.counts.lower).unwrap_or_default();
        let (of_lower, of_upper) = sides.multiplier.split_at_checked(lower.len()).unwrap_or_default();
        scatter(forces, lower, of_lower, |force, &multiplier| force - multiplier);
        scatter(forces, upper, of_upper, |force, &multiplier| force + multiplier);
        scatter(forces, sides.equations, sides.free, |force, &multiplier| force - multiplier);
        let mut objective = T::ZERO;
        let mut largest = T::ZERO;
        largest = larger::<T, E>(largest, forces);
        for place in Places::<T>::ending(self.qp.dims, self.riccati.end).rev() {
            let Place { nx, n, ng, ld, next, .. } = place;
            let data = part(self.qp.data, place.data, place.data_len());
            let matrix = Columns { data: part(data, 0, place.matrix()), ld };
            let hessian = part(data, place.matrix(), place.hessian());
            let linear = part(data, place.gradient(), ld);
            let g = part_mut(self.stationarity, place.row, ld);
            let v = part(self.v, place.row, ld);
            g.fill(T::ZERO);
            symmetric::<T, E>(g, hessian, ld, v, n);
            largest = larger::<T, E>(largest, g);
            largest = larger::<T, E>(largest, linear);
            for ((g, &linear), &v) in g.iter_mut().zip(linear).zip(v) {
                objective = objective + v * (T::from_f64(0.5) * *g + linear);
                *g = *g + linear;
            }
            let force = part(self.gradient, place.row, place.rows);
            for (g, &force) in g.iter_mut().zip(force) {
                *g = *g + force;
            }
            let minus = &mut *self.riccati.minus;
            for (minus, &pi) in minus.iter_mut().zip(part(multipliers, place.dynamics, next)) {
                *minus = -pi;
            }
            for (minus, &force) in part_mut(minus, next, ng).iter_mut().zip(part(force, ld, ng)) {
                *minus = -force;
            }
            subtract::<T, E>(g, matrix, minus, n, next + ng);
            if place.stage > 0 {
                // π is what makes this part zero.
                let before = place.dynamics.saturating_sub(pad::<T>(nx));
                let pi = part_mut(multipliers, before, nx);
                for (pi, g) in pi.iter_mut().zip(part_mut(g, 0, nx)) {
                    *pi = *g;
                    *g = T::ZERO;
                }
                largest = larger::<T, E>(largest, pi);
            } else if self.first == First::Fixed {
                // What is left is the multiplier of the given state.
                let given = part_mut(g, 0, nx);
                assign(part_mut(self.initial, 0, nx), given);
                given.fill(T::ZERO);
            }
        }
        self.terms.forces = largest;
        objective + self.penalties()
    }

    #[inline(always)]
    fn values<E: Packed<T>>(&mut self) {
        let mut largest = T::ZERO;
        let mut rest = &mut *self.v;
        for place in Places::<T>::new(self.qp.dims) {
            let Place { n, ng, ld, next, .. } = place;
            let data = part(self.qp.data, place.data, place.data_len());
            let matrix = Columns { data: part(data, 0, place.matrix()), ld };
            let (v, general) = take_mut(&mut rest, place.rows).split_at_mut_checked(ld).unwrap_or_default();
            let general = part_mut(general, 0, ng);
            general.fill(T::ZERO);
            add_transposed::<T, E>(general, matrix.skip(next), v, n, ng);
            largest = larger::<T, E>(largest, v);
            largest = larger::<T, E>(largest, general);
            let dynamics = part_mut(self.dynamics, place.dynamics, next);
            let offset = part(data, place.offset(), next);
            largest = larger::<T, E>(largest, offset);
            for ((dynamics, &offset), &coming) in dynamics.iter_mut().zip(offset).zip(&*rest) {
                *dynamics = offset - coming;
            }
            add_transposed::<T, E>(dynamics, matrix, v, n, next);
        }
        self.terms.values = largest;
        let sides = &mut self.sides;
        sides.gather(self.v, |value, bound| value - bound, |value, bound| bound - value);
        for ((residual, &value), &slack) in sides.residual.iter_mut().zip(&*sides.scratch).zip(&*sides.slack)
        {
            *residual = value - slack;
        }
        let (_, violations) = sides.slack.split_at_checked(sides.counts.sides()).unwrap_or_default();
        for (&side, &violation) in sides.soft.iter().zip(violations) {
            if let Some(residual) = sides.residual.get_mut(side as usize) {
                *residual = *residual + violation;
            }
        }
        part_mut(sides.residual, sides.counts.sides(), sides.counts.soft).fill(T::ZERO);
        let equations = sides.equations.iter().zip(&*sides.equation_bound).zip(&mut *sides.equation_residual);
        for ((&row, &bound), residual) in equations {
            *residual = at(self.v, row) - bound;
        }
        self.mu = sides.mu::<E>();
    }

    fn penalties(&self) -> T {
        let sides = &self.sides;
        let (_, violations) = sides.slack.split_at_checked(sides.counts.sides()).unwrap_or_default();
        let costs = sides.linear.iter().zip(&*sides.quadratic).zip(violations);
        costs.fold(T::ZERO, |sum, ((&l, &q), &e)| sum + e * (l + T::from_f64(0.5) * q * e))
    }

    /// The residuals as they are known.
    #[inline(always)]
    pub fn residuals<E: Packed<T>>(&self) -> Largest<T> {
        let sides = &self.sides;
        let inequalities =
            largest_size::<T, E>(sides.residual).max(largest_size::<T, E>(sides.equation_residual));
        Largest {
            stationarity: largest_size::<T, E>(self.stationarity),
            dynamics: largest_size::<T, E>(self.dynamics),
            inequalities,
            complementarity: largest_product::<T, E>(T::ZERO, sides.slack, sides.multiplier),
        }
    }

    /// Newton's step, with `s Δλ + λ Δs = s · target`. Changes of slacks and multipliers are those of pairs afterwards.
    #[inline(always)]
    pub fn newton<E: Packed<T>>(&mut self, factor: bool) -> Result<(), QpError> {
        self.sides.push(factor);
        self.solve::<E>(factor)?;
        self.sides.steps();
        Ok(())
    }

    /// Newton's equations with the weights of the sides, and what they add to the gradient in `scratch`, where the changes of
    /// their distances are afterwards.
    #[inline(always)]
    pub fn solve<E: Packed<T>>(&mut self, factor: bool) -> Result<(), QpError> {
        let weight = T::ONE / self.sides.compliance;
        let sides = &mut self.sides;
        assign(self.gradient, self.stationarity);
        let (lower, upper) = sides.rows.split_at_checked(sides.counts.lower).unwrap_or_default();
        let (of_lower, of_upper) = sides.scratch.split_at_checked(lower.len()).unwrap_or_default();
        scatter(self.gradient, lower, of_lower, |g, &push| g + push);
        scatter(self.gradient, upper, of_upper, |g, &push| g - push);
        scatter(self.gradient, sides.equations, sides.equation_residual, |g, &residual| {
            g + weight * residual
        });
        if factor {
            self.weights.fill(T::ZERO);
            scatter(self.weights, sides.rows, sides.weight, |sum, &weight| sum + weight);
            scatter(self.weights, sides.equations, sides.free, |sum, _| sum + weight);
        }
        let equations = Equations {
            qp: self.qp,
            first: self.first,
            weights: self.weights,
            gradient: self.gradient,
            dynamics: self.dynamics,
        };
        self.riccati.solve::<E>(equations, factor, self.step)?;
        self.sides.gather(self.step, |value, _| value, |value, _| -value);
        Ok(())
    }

    /// Goes a part of the step.
    #[inline(always)]
    pub fn advance<E: Packed<T>>(&mut self, alpha: T) {
        let weight = T::ONE / self.sides.compliance;
        let left = T::ONE - alpha;
        add_scaled(self.v, alpha, self.step);
        shrink(self.stationarity, left);
        shrink(self.dynamics, left);
        let sides = &mut self.sides;
        shrink(sides.residual, left);
        let count = sides.counts.sides();
        add_scaled(part_mut(sides.residual, 0, count), -alpha * sides.compliance, sides.multiplier_step);
        add_scaled(sides.slack, alpha, sides.slack_step);
        add_scaled(sides.multiplier, alpha, sides.multiplier_step);
        let equations = sides.equations.iter().zip(&mut *sides.free).zip(&mut *sides.equation_residual);
        for ((&row, free), residual) in equations {
            let change = at(self.step, row);
            *free = *free - alpha * weight * (change + *residual);
            *residual = *residual + alpha * change;
        }
        if self.riccati.regularised > 0 {
            // A pivot that was made larger is a force that keeps its variable where it is.
            for place in Places::<T>::new(self.qp.dims) {
                let added = self.riccati.added.get(place.v..).unwrap_or_default();
                let step = part(self.step, place.row, place.n);
                let residual = part_mut(self.stationarity, place.row, place.n);
                for ((residual, &added), &step) in residual.iter_mut().zip(added).zip(step) {
                    if added > T::ZERO {
                        *residual = *residual - alpha * added * step;
                    }
                }
            }
        }
        self.mu = self.sides.mu::<E>();
    }
}

impl<T: Real> Sides<'_, T> {
    /// `Σ s λ` over the number of pairs.
    #[inline(always)]
    pub fn mu<E: Packed<T>>(&self) -> T {
        let pairs = self.counts.pairs().max(1);
        dot::<T, E>(self.slack, self.multiplier) / T::from_whole(pairs)
    }

    /// A function of the value of the row and the bound, for every side, into `scratch`.
    #[inline(always)]
    fn gather(&mut self, values: &[T], lower: impl Fn(T, T) -> T, upper: impl Fn(T, T) -> T) {
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

    /// Multipliers of a solution.
    pub fn take_multipliers(&mut self, solution: &SolutionView<'_, T>) {
        let (lower, upper) = self.rows.split_at_checked(self.counts.lower).unwrap_or_default();
        let sides = lower.iter().map(|&row| at(solution.lower, row));
        let sides = sides.chain(upper.iter().map(|&row| at(solution.upper, row)));
        for (multiplier, given) in self.multiplier.iter_mut().zip(sides) {
            *multiplier = given;
        }
        for (free, &row) in self.free.iter_mut().zip(&*self.equations) {
            *free = at(solution.lower, row) - at(solution.upper, row);
        }
    }

    /// Slacks at least this far from zero, with multipliers from a solution or such that all products are equal.
    /// `scratch` has the distances from the bounds.
    pub fn begin(&mut self, start: Start, distance: T, solution: &SolutionView<'_, T>) {
        let sides = self.counts.sides();
        for (slack, &value) in self.slack.iter_mut().zip(&*self.scratch).take(sides) {
            *slack = value.max(distance);
        }
        if start == Start::Warm {
            self.take_multipliers(solution);
        }
        for (multiplier, &slack) in self.multiplier.iter_mut().zip(&*self.slack).take(sides) {
            *multiplier = multiplier.max(distance * distance / slack);
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
            // The gradient with respect to the violation vanishes from the start: λ + ν = linear + quadratic e.
            let violation = (slack - value).max(distance);
            let force = linear + quadratic * violation;
            // Both products are as large as those of the others, or as equal as the force allows.
            let least = T::from_f64(0.01) * force;
            let share = distance * distance / slack;
            let least = if share < least { share } else { least };
            let most = force - least;
            let multiplier = if multiplier < most { multiplier.max(least) } else { most };
            set(self.multiplier, side, multiplier);
            set(self.slack, sides + j, violation);
            set(self.multiplier, sides + j, force - multiplier);
        }
    }

    /// `Σ s λ` over the number of pairs after a part of the predictor.
    #[inline(always)]
    pub fn mu_after<E: Packed<T>>(&self, alpha: T, mu: T) -> T {
        let pairs = self.counts.pairs().max(1);
        let products = dot::<T, E>(self.slack_step, self.multiplier_step) / T::from_whole(pairs);
        (T::ONE - alpha) * mu + alpha * alpha * products
    }

    /// The largest violation of a side, before anything else is in `scratch`.
    #[inline(always)]
    pub fn violation(&self) -> T {
        part(self.scratch, 0, self.counts.sides())
            .iter()
            .fold(T::ZERO, |largest, &distance| (-distance).max(largest))
    }

    /// `s Δλ + λ Δs = μ − s λ`
    #[inline(always)]
    pub fn aim(&mut self, mu: T) {
        let (sides, soft) = (self.counts.sides(), T::ZERO);
        let own = self.compliance;
        let pairs = self.slack.iter().zip(&*self.multiplier);
        for (i, ((inverse, target), (&slack, &multiplier))) in
            self.inverse.iter_mut().zip(&mut *self.target).zip(pairs).enumerate()
        {
            let compliance = if i < sides { own } else { soft };
            *inverse = T::ONE / (slack + compliance * multiplier);
            *target = (mu - slack * multiplier) * *inverse;
        }
    }

    /// The corrector: `s Δλ + λ Δs = σμ − s λ − Δs Δλ` of the predictor.
    #[inline(always)]
    pub fn correct(&mut self, sigma_mu: T) {
        let steps = self.slack_step.iter().zip(&*self.multiplier_step);
        let pairs = self.multiplier.iter().zip(&*self.slack).zip(&*self.inverse);
        for ((target, (&ds, &dl)), ((&multiplier, &slack), &inverse)) in
            self.target.iter_mut().zip(steps).zip(pairs)
        {
            *target = (sigma_mu - ds * dl - slack * multiplier) * inverse;
        }
    }

    /// What the sides add to the gradient of Newton's equations, into `scratch`, and their weights.
    #[inline(always)]
    fn push(&mut self, weights: bool) {
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

    /// Changes of slacks from the changes of rows in `scratch`, and of multipliers.
    #[inline(always)]
    fn steps(&mut self) {
        let (sides, compliance) = (self.counts.sides(), self.compliance);
        let pairs = self.slack.iter().zip(&*self.multiplier).zip(&*self.inverse).zip(&*self.target);
        let steps = self.slack_step.iter_mut().zip(&mut *self.multiplier_step);
        let changes = self.scratch.iter().zip(&*self.residual).take(sides);
        for (((slack_step, multiplier_step), (((&slack, &multiplier), &inverse), &target)), (&change, &residual)) in
            steps.zip(pairs).zip(changes)
        {
            let change = change + residual;
            *slack_step = change * (slack * inverse) + compliance * target;
            *multiplier_step = target - multiplier * inverse * change;
        }
        for (j, &side) in self.soft.iter().enumerate() {
            let Some(soft) = self.soft_side(j, side as usize) else { break };
            let change = at(self.scratch, side) + at(self.residual, side);
            // The change of `s − e`, and their sum written such that it keeps its digits where the slack is small and its
            // weight large.
            let change = change * soft.share + compliance * soft.target;
            let violation = (soft.sum - soft.stiffness * change) * soft.inverse;
            let step = (soft.sum + soft.compliance * change) * soft.inverse;
            set(self.slack_step, side as usize, step);
            set(self.multiplier_step, side as usize, soft.own - soft.stiffness * step);
            set(self.slack_step, sides + j, violation);
            set(self.multiplier_step, sides + j, soft.others - soft.other * violation);
        }
    }

    /// A soft side with its violation eliminated.
    #[inline(always)]
    fn soft_side(&self, j: usize, side: usize) -> Option<Soft<T>> {
        let violation = self.counts.sides() + j;
        let (slack, multiplier) = (*self.slack.get(side)?, *self.multiplier.get(side)?);
        let stiffness = multiplier / slack;
        let other = *self.multiplier.get(violation)? * *self.inverse.get(violation)?;
        let quadratic = *self.quadratic.get(j)?;
        let own = *self.target.get(side)? * (T::ONE + self.compliance * stiffness);
        let others = *self.target.get(violation)?;
        let inverse = T::ONE / (quadratic + stiffness + other);
        let sum = own + others;
        let weight = stiffness * (quadratic + other) * inverse;
        let share = T::ONE / (T::ONE + self.compliance * weight);
        Some(Soft {
            weight: weight * share,
            target: (own - stiffness * sum * inverse) * share,
            compliance: quadratic + other,
            share,
            own,
            others,
            other,
            sum,
            stiffness,
            inverse,
        })
    }

    /// How far the step can go, at most 1, such that slacks and multipliers keep some part of what they have.
    #[inline(always)]
    pub fn longest<E: Packed<T>>(&self, keep: T) -> T {
        let most = T::ONE - keep;
        let ratio = largest_negative_ratio::<T, E>(most, self.slack_step, self.slack);
        most / largest_negative_ratio::<T, E>(ratio, self.multiplier_step, self.multiplier)
    }

    /// The residuals of bounds as [`qp::residuals`](crate::qp::residuals) has them, of distances from them in `scratch`, whatever
    /// slacks and violations are.
    pub fn judge(&mut self) -> (T, T) {
        let (mut inequalities, mut products) = (T::ZERO, T::ZERO);
        for (j, &side) in self.soft.iter().enumerate() {
            let (violation, multiplier) = (positive(-at(self.scratch, side)), at(self.multiplier, side));
            let lacks = at(self.linear, j as u32) + at(self.quadratic, j as u32) * violation - multiplier;
            inequalities = larger_or_nan(inequalities, -lacks);
            products = larger_or_nan(products, violation * positive(lacks));
            let distance = at(self.scratch, side);
            set(self.scratch, side as usize, positive(distance));
        }
        for (&distance, &multiplier) in self.scratch.iter().zip(&*self.multiplier).take(self.counts.sides()) {
            inequalities = larger_or_nan(inequalities, -distance);
            products = larger_or_nan(products, positive(distance) * multiplier);
        }
        for &residual in &*self.equation_residual {
            inequalities = larger_or_nan(inequalities, residual.abs());
        }
        (inequalities, products)
    }
}

/// What a soft side is to the others.
struct Soft<T> {
    weight: T,
    target: T,
    share: T,
    own: T,
    others: T,
    other: T,
    sum: T,
    stiffness: T,
    compliance: T,
    inverse: T,
}

/// An element; zero if there is none.
#[inline(always)]
pub fn at<T: Real>(slice: &[T], index: u32) -> T {
    slice.get(index as usize).copied().unwrap_or(T::ZERO)
}

/// Changes rows by values that belong to them.
#[inline(always)]
fn scatter<T: Real>(target: &mut [T], rows: &[u32], values: &[T], change: impl Fn(T, &T) -> T) {
    for (&row, value) in rows.iter().zip(values) {
        if let Some(target) = target.get_mut(row as usize) {
            *target = change(*target, value);
        }
    }
}
