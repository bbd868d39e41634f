//! An iterate of the interior point, and its residuals.

use super::cholesky::eliminate;
use super::coupling::Coupling;
use super::kernels::{Columns, add_transposed, subtract, symmetric};
use super::riccati::{Extent, InitialStateKind, Riccati};
use super::sides::{Counts, Inequalities};
use super::terms::{LargestTerms, Terms};
use super::units::Units;
use crate::qp::element::get;
use crate::qp::layout::{
    StageDims, StageOffsets, StageOffsetsIter, copy_common, end, first_nx, padded_len, part, part_mut,
    take_mut,
};
use crate::qp::problem::QpView;
use crate::scalar::{Packed, Piece, Real};
use core::marker::PhantomData;

/// A point, its multipliers and residuals. Vectors over rows have `v` and the values of general
/// constraints of each stage.
///
/// Residuals of linear conditions are not evaluated in every iteration: a step of length `α` leaves
/// `1 − α` of them. This does not require the multipliers of the dynamics, which a recursion
/// computes at the end.
pub struct Iterate<'a, T> {
    pub qp: QpView<'a, T>,
    pub first: InitialStateKind,
    /// Whether the objective counts; without it the violation is minimised.
    pub objective: bool,
    /// The weight `ρ` of the proximal term `½ ρ |Δ|²` of every step.
    pub proximal: T,
    /// The units of `Δ` in the proximal term, by rows; empty if all are one.
    pub units: &'a [T],
    /// The units of residuals.
    pub measure: Units<'a, T>,
    pub riccati: Riccati<'a, T>,
    pub inequalities: Inequalities<'a, T>,
    /// Couplings of stages.
    pub coupling: Option<Coupling<'a, T>>,
    /// `v` and `C x + D u`
    pub v: &'a mut [T],
    /// `Δ`
    pub step: &'a mut [T],
    /// The gradient of the Lagrangian.
    pub stationarity: &'a mut [T],
    /// The right-hand side of Newton's equations.
    pub gradient: &'a mut [T],
    /// Weights of rows.
    pub weights: &'a mut [T],
    /// `A x + B u + b − x₊`
    pub dynamics: &'a mut [T],
    /// The multiplier of a fixed initial state.
    pub initial: &'a mut [T],
    /// `Σ s λ` over the number of pairs.
    pub mu: T,
    /// The largest terms of the residuals at their last evaluation, in units.
    pub terms: Terms<T>,
    /// The same terms without units.
    pub own_terms: Terms<T>,
}

/// The origin of the multipliers `π` of the dynamics in the evaluation of a gradient.
#[derive(Clone, Copy)]
pub enum Costates {
    /// The adjoint recursion of the closed-loop system, with `(A + B K)ᵀ` in place of `Aᵀ` and the
    /// feedback `K` of the last factors. It adds `Kᵀ` times the gradient by the controls, which
    /// vanishes at the solution. Errors decay even if the dynamics are unstable. Without factors it
    /// is the open-loop recursion.
    Controlled,
    /// As `Controlled` after a step, with the changes of multipliers of periodic states.
    AfterStep,
    /// Given multipliers. The Newton step does not depend on them.
    Given,
}

/// The arguments of the evaluation of residuals; the gradient is evaluated only with `multipliers`.
struct EvaluateResiduals<'s, 'a, T, E> {
    iterate: &'s mut Iterate<'a, T>,
    values: bool,
    multipliers: Option<(&'s mut [T], &'s mut T)>,
    costates: Costates,
    register: PhantomData<E>,
}

impl<T: Real, E: Packed<T>> Piece for EvaluateResiduals<'_, '_, T, E> {
    #[inline(always)]
    fn run(self) {
        if self.values {
            self.iterate.values::<E>();
        }
        if let Some((multipliers, objective)) = self.multipliers {
            *objective = self.iterate.gradient::<E>(multipliers, self.costates);
        }
    }
}

impl<'a, T: Real> Iterate<'a, T> {
    /// Returns the length of the memory.
    pub const fn memory(dims: &[StageDims], counts: &Counts) -> usize {
        let end = end::<T>(dims);
        Riccati::<T>::memory(dims) + counts.memory_len() + 5 * end.row + end.dynamics + first_nx(dims)
    }

    /// Returns the length of the memory for a QP.
    pub fn memory_of(qp: QpView<'_, T>, counts: &Counts) -> usize {
        Self::memory(qp.dims, counts) + Coupling::memory_of(qp)
    }

    /// An iterate in memory that is zero.
    pub fn new(
        qp: QpView<'a, T>,
        extent: &Extent,
        first: InitialStateKind,
        sides: Inequalities<'a, T>,
        numbers: &mut &'a mut [T],
    ) -> Self {
        let (riccati, initial) = (Riccati::new(extent, numbers), first_nx(qp.dims));
        let end = extent.end;
        let coupling = Coupling::new(qp, extent, first, numbers);
        let found = if coupling.is_some() { InitialStateKind::Coupled } else { InitialStateKind::Free };
        let first = if first == InitialStateKind::Fixed { first } else { found };
        Self {
            qp,
            first,
            coupling,
            objective: true,
            proximal: T::ZERO,
            units: &[],
            measure: Units::NONE,
            riccati,
            inequalities: sides,
            v: take_mut(numbers, end.row),
            step: take_mut(numbers, end.row),
            stationarity: take_mut(numbers, end.row),
            gradient: take_mut(numbers, end.row),
            weights: take_mut(numbers, end.row),
            dynamics: take_mut(numbers, end.dynamics),
            initial: take_mut(numbers, if first == InitialStateKind::Fixed { initial } else { 0 }),
            mu: T::ZERO,
            terms: Terms { gradient_terms: T::ZERO, condition_terms: T::ZERO },
            own_terms: Terms { gradient_terms: T::ZERO, condition_terms: T::ZERO },
        }
    }

    /// Sets the dual regularisation `δ` and, if requested, the proximal weight, in the units of the
    /// problem.
    pub fn set_regularisation(&mut self, proximal: bool) {
        let Terms { gradient_terms: forces, condition_terms: values } = self.terms;
        let (small, stiffness) = (T::from_f64(T::EPSILON).sqrt(), forces / values.max(T::ONE));
        self.inequalities.dual_regularisation = small / (T::from_f64(0.01) * stiffness).max(T::ONE);
        let stiffness = self.measure.objective * stiffness.max(T::from_f64(1e-4));
        self.proximal = if proximal { small * stiffness } else { T::ZERO };
    }

    /// Evaluates all residuals at the point: general constraints, dynamics, the multipliers `π` by
    /// the closed-loop recursion, and the gradient of the Lagrangian. Returns the objective.
    pub fn evaluate<E: Packed<T>>(&mut self, multipliers: &mut [T]) -> T {
        self.evaluate_selected::<E>(true, Some(multipliers), Costates::Controlled)
    }

    /// As [`evaluate`](Self::evaluate), with given multipliers `π`, whose residuals are the
    /// gradient by the states.
    pub fn evaluate_with_costates<E: Packed<T>>(&mut self, multipliers: &mut [T]) {
        let _ = self.evaluate_selected::<E>(true, Some(multipliers), Costates::Given);
    }

    /// Computes the multipliers `π` after a step, by the closed-loop recursion.
    pub fn closed_loop_costates<E: Packed<T>>(&mut self, multipliers: &mut [T]) {
        let _ = self.evaluate_selected::<E>(false, Some(multipliers), Costates::AfterStep);
    }

    /// Evaluates general constraints, dynamics, and residuals of the sides; leaves the distances
    /// from the bounds in `scratch`.
    pub fn evaluate_values<E: Packed<T>>(&mut self) {
        let _ = self.evaluate_selected::<E>(true, None, Costates::Given);
    }

    /// Evaluates the rest of [`evaluate`](Self::evaluate) after
    /// [`evaluate_values`](Self::evaluate_values).
    pub fn evaluate_gradient<E: Packed<T>>(&mut self, multipliers: &mut [T]) {
        let _ = self.evaluate_selected::<E>(false, Some(multipliers), Costates::Controlled);
    }

    /// As [`evaluate_gradient`](Self::evaluate_gradient), with given multipliers `π`.
    pub fn gradient_with_costates<E: Packed<T>>(&mut self, multipliers: &mut [T]) {
        let _ = self.evaluate_selected::<E>(false, Some(multipliers), Costates::Given);
    }

    #[inline(always)]
    fn evaluate_selected<E: Packed<T>>(
        &mut self,
        values: bool,
        multipliers: Option<&mut [T]>,
        costates: Costates,
    ) -> T {
        let (mut objective, register) = (T::ZERO, PhantomData);
        let multipliers = multipliers.map(|multipliers| (multipliers, &mut objective));
        E::vectorize(EvaluateResiduals::<T, E> { iterate: self, values, multipliers, costates, register });
        objective
    }

    /// Writes the gradient terms of the constraints, by rows.
    #[inline(always)]
    fn write_forces(&mut self, after_step: bool) {
        let sides = &mut self.inequalities;
        let forces = &mut *self.gradient;
        forces.fill(T::ZERO);
        let (lower, upper) = sides.rows.split_at_checked(sides.counts.lower).unwrap_or_default();
        let (of_lower, of_upper) = sides.multiplier.split_at_checked(lower.len()).unwrap_or_default();
        scatter(forces, lower, of_lower, |force, &multiplier| force - multiplier);
        scatter(forces, upper, of_upper, |force, &multiplier| force + multiplier);
        scatter(forces, sides.equations, sides.equation_multipliers, |force, &multiplier| force - multiplier);
        if after_step {
            // The proximal term belongs to the step, not to the problem.
            for place in StageOffsetsIter::<T>::new(self.qp.dims) {
                let step = part(self.step, place.row, place.n);
                let forces = part_mut(forces, place.row, place.n);
                for (i, (force, &step)) in forces.iter_mut().zip(step).enumerate() {
                    *force = *force + scaled_proximal_weight(self.proximal, self.units, place.row + i) * step;
                }
            }
        }
        if let Some(coupling) = &self.coupling {
            coupling.add_multiplier_forces(self.qp, after_step, forces);
        }
    }

    /// Computes the multipliers `π` and the gradient of the Lagrangian; returns the objective.
    #[inline(always)]
    fn gradient<E: Packed<T>>(&mut self, multipliers: &mut [T], costates: Costates) -> T {
        let after_step = matches!(costates, Costates::AfterStep);
        self.write_forces(after_step);
        let units = self.measure;
        let mut objective = T::ZERO;
        let mut largest = LargestTerms::NONE;
        largest.add_forces::<E>(self.gradient, units.rows);
        for place in StageOffsetsIter::<T>::with_known_end(self.qp.dims, self.riccati.end).rev() {
            let StageOffsets { nx, n, ng, ld, next, .. } = place;
            let data = part(self.qp.data, place.data, place.data_len());
            let matrix = Columns { data: part(data, 0, place.matrix()), ld };
            let hessian = part(data, place.matrix(), place.hessian());
            let linear = part(data, place.gradient(), ld);
            let here = units.from(place.row);
            let g = part_mut(self.stationarity, place.row, ld);
            let v = part(self.v, place.row, ld);
            g.fill(T::ZERO);
            if self.objective {
                symmetric::<T, E>(g, hessian, ld, v, n);
                largest.add_forces::<E>(g, here);
                largest.add_forces::<E>(linear, here);
                for ((g, &linear), &v) in g.iter_mut().zip(linear).zip(v) {
                    objective = objective + v * (T::from_f64(0.5) * *g + linear);
                    *g = *g + linear;
                }
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
            if place.stage > 0 && matches!(costates, Costates::Given) {
                let before = place.dynamics.saturating_sub(padded_len::<T>(nx));
                let pi = part(multipliers, before, nx);
                for (g, &pi) in g.iter_mut().zip(pi) {
                    *g = *g - pi;
                }
                largest.add_forces::<E>(pi, here);
            } else if place.stage > 0 {
                // `π` is the gradient after elimination of the controls, `g` the remainder.
                let panel = part(self.riccati.panels, place.factor, ld * place.pivots);
                let inverse = part(self.riccati.inverse, place.v + nx, place.nu);
                let y = part_mut(self.riccati.y, place.v + nx, place.nu);
                let left = part_mut(self.riccati.g, 0, ld);
                copy_common(left, g);
                eliminate::<T, E>(left, panel, ld, inverse, y, nx);
                let before = place.dynamics.saturating_sub(padded_len::<T>(nx));
                let pi = part_mut(multipliers, before, nx);
                copy_common(pi, left);
                for (g, &pi) in g.iter_mut().zip(&*pi) {
                    *g = *g - pi;
                }
                largest.add_forces::<E>(pi, here);
            } else if self.first == InitialStateKind::Fixed {
                // The remainder is the multiplier of the fixed initial state.
                let given = part_mut(g, 0, nx);
                copy_common(part_mut(self.initial, 0, nx), given);
                // Zero, or NaN if it is not finite, which the residuals then show.
                given.iter_mut().for_each(|g| *g = T::ZERO * *g);
            }
        }
        if let Some(coupling) = self.coupling.as_mut().filter(|_| !after_step) {
            coupling.fold(self.qp, self.stationarity);
            if self.first == InitialStateKind::Fixed {
                // The coupling term of the last state at a fixed first state belongs to its
                // multiplier, too.
                for (force, g) in self.initial.iter_mut().zip(&mut *self.stationarity) {
                    *force = *force + *g;
                    *g = T::ZERO * *g;
                }
            }
        }
        self.own_terms.gradient_terms = largest.own;
        self.terms.gradient_terms = units.choose(largest.own, largest.in_units / units.objective);
        objective + self.penalty_cost()
    }

    #[inline(always)]
    fn values<E: Packed<T>>(&mut self) {
        let units = self.measure;
        let mut largest = LargestTerms::NONE;
        let mut rest = &mut *self.v;
        for place in StageOffsetsIter::<T>::new(self.qp.dims) {
            let StageOffsets { n, ng, ld, next, .. } = place;
            let data = part(self.qp.data, place.data, place.data_len());
            let matrix = Columns { data: part(data, 0, place.matrix()), ld };
            let (v, general) = take_mut(&mut rest, place.rows).split_at_mut_checked(ld).unwrap_or_default();
            let (general, here) = (part_mut(general, 0, ng), units.from(place.row));
            general.fill(T::ZERO);
            add_transposed::<T, E>(general, matrix.skip(next), v, n, ng);
            largest.add_values::<E>(v, here);
            largest.add_values::<E>(general, units.from(place.row + ld));
            let dynamics = part_mut(self.dynamics, place.dynamics, next);
            let offset = part(data, place.offset(), next);
            largest.add_values::<E>(offset, units.from(place.row + place.rows));
            for ((dynamics, &offset), &coming) in dynamics.iter_mut().zip(offset).zip(&*rest) {
                *dynamics = offset - coming;
            }
            add_transposed::<T, E>(dynamics, matrix, v, n, next);
        }
        self.own_terms.condition_terms = largest.own;
        self.terms.condition_terms = units.choose(largest.own, largest.in_units);
        if let Some(coupling) = &mut self.coupling {
            coupling.evaluate(self.qp, self.v);
        }
        self.evaluate_side_residuals::<E>();
    }

    /// Evaluates the residuals of the sides from the values of the rows.
    #[inline(always)]
    pub fn evaluate_side_residuals<E: Packed<T>>(&mut self) {
        let sides = &mut self.inequalities;
        sides.evaluate_sides(self.v, |value, bound| value - bound, |value, bound| bound - value);
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

    fn penalty_cost(&self) -> T {
        let sides = &self.inequalities;
        let (_, violations) = sides.slack.split_at_checked(sides.counts.sides()).unwrap_or_default();
        let costs = sides.linear.iter().zip(&*sides.quadratic).zip(violations);
        costs.fold(T::ZERO, |sum, ((&l, &q), &e)| sum + e * (l + T::from_f64(0.5) * q * e))
    }
}

/// Returns the proximal weight of a row, whose variable has a unit.
#[inline(always)]
pub fn scaled_proximal_weight<T: Real>(proximal: T, units: &[T], row: usize) -> T {
    units.get(row).map_or(proximal, |&unit| proximal / (unit * unit))
}

/// `slice[index]`
#[inline(always)]
#[cfg_attr(debug_assertions, track_caller)]
pub fn at<T: Real>(slice: &[T], index: u32) -> T {
    get(slice, index as usize)
}

/// Changes the rows of `target` by these values.
#[inline(always)]
pub fn scatter<T: Real>(target: &mut [T], rows: &[u32], values: &[T], change: impl Fn(T, &T) -> T) {
    for (&row, value) in rows.iter().zip(values) {
        debug_assert!((row as usize) < target.len(), "row {row} of {}", target.len());
        if let Some(target) = target.get_mut(row as usize) {
            *target = change(*target, value);
        }
    }
}
