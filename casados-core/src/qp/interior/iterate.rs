//! One iterate of the interior point, and its residuals.

use super::coupling::Coupling;
use super::kernels::{Columns, add_transposed, subtract, symmetric};
use super::riccati::{Extent, InitialStateKind, Riccati};
use super::sides::{Counts, Inequalities};
use super::terms::{LargestTerms, Terms};
use super::units::Units;
use crate::qp::element::get;
use crate::qp::layout::{
    Places, StageDims, StageOffsets, copy_common, end, first_nx, padded_len, part, part_mut, take_mut,
};
use crate::qp::problem::QpView;
use crate::scalar::{Packed, Piece, Real};
use core::marker::PhantomData;

/// A point, its multipliers and residuals. Vectors over rows are `v` and the values of general
/// constraints of each stage.
///
/// The residuals of linear conditions are not computed again in every iteration: a step of length
/// `α` leaves `1 − α` of them. The multipliers of the dynamics are not needed for that, and come
/// from a recursion at the end.
pub struct Iterate<'a, T> {
    pub qp: QpView<'a, T>,
    pub first: InitialStateKind,
    /// Whether there is one: without it a point is sought that violates least.
    pub objective: bool,
    /// What keeps variables near where they are: `½ ρ |Δ|²` of every step.
    pub proximal: T,
    /// The units that `Δ` is measured in there, by rows; all one if there are none.
    pub units: &'a [T],
    /// What everything else is compared with.
    pub measure: Units<'a, T>,
    pub riccati: Riccati<'a, T>,
    pub sides: Inequalities<'a, T>,
    /// What couples stages.
    pub coupling: Option<Coupling<'a, T>>,
    /// `v` and `C x + D u`
    pub v: &'a mut [T],
    /// `Δ`
    pub step: &'a mut [T],
    /// Gradient of the Lagrangian.
    pub stationarity: &'a mut [T],
    /// Right-hand side of Newton's equations.
    pub gradient: &'a mut [T],
    /// Weights of rows.
    pub weights: &'a mut [T],
    /// `A x + B u + b − x₊`
    pub dynamics: &'a mut [T],
    /// The multiplier of a given state at the start.
    pub initial: &'a mut [T],
    /// `Σ s λ` over the number of pairs.
    pub mu: T,
    /// The largest terms of the residuals when they were computed last, in units.
    pub terms: Terms<T>,
    /// The same as they are.
    pub own_terms: Terms<T>,
}

/// Where the multipliers `π` of the dynamics come from when a gradient is computed.
#[derive(Clone, Copy)]
pub enum Costates {
    /// The adjoint recursion of the controlled system, `(A + B K)ᵀ` in place of `Aᵀ`, with the
    /// feedback `K` of the last factors: `Kᵀ` times the gradient in the controls is added, which
    /// vanishes at the solution. Errors decay where the recursion of the dynamics alone lets them
    /// grow. Without factors it is that one.
    Controlled,
    /// The same after a step, with the changes of multipliers of periodic states.
    AfterStep,
    /// They are given. Newton's step does not depend on them.
    Given,
}

/// The residuals as a function of its own; the gradient only where there is room for multipliers
/// and the objective.
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
    /// How many numbers it takes.
    pub const fn memory(dims: &[StageDims], counts: &Counts) -> usize {
        let end = end::<T>(dims);
        Riccati::<T>::memory(dims) + counts.numbers() + 5 * end.row + end.dynamics + first_nx(dims)
    }

    /// How many numbers it takes for a QP.
    pub fn memory_of(qp: QpView<'_, T>, counts: &Counts) -> usize {
        Self::memory(qp.dims, counts) + Coupling::memory_of(qp)
    }

    /// In memory that is zero.
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
            sides,
            v: take_mut(numbers, end.row),
            step: take_mut(numbers, end.row),
            stationarity: take_mut(numbers, end.row),
            gradient: take_mut(numbers, end.row),
            weights: take_mut(numbers, end.row),
            dynamics: take_mut(numbers, end.dynamics),
            initial: take_mut(numbers, if first == InitialStateKind::Fixed { initial } else { 0 }),
            mu: T::ZERO,
            terms: Terms { forces: T::ZERO, values: T::ZERO },
            own_terms: Terms { forces: T::ZERO, values: T::ZERO },
        }
    }

    /// What sides and equations give way to forces, and variables if they are to, in the units of
    /// the problem.
    pub fn set_regularisation(&mut self, proximal: bool) {
        let Terms { forces, values } = self.terms;
        let (small, stiffness) = (T::from_f64(T::EPSILON).sqrt(), forces / values.max(T::ONE));
        self.sides.compliance = small / (T::from_f64(0.01) * stiffness).max(T::ONE);
        let stiffness = self.measure.objective * stiffness.max(T::from_f64(1e-4));
        self.proximal = if proximal { small * stiffness } else { T::ZERO };
    }

    /// Computes all residuals from the point: general constraints, dynamics, the multipliers `π` by
    /// the recursion of the controlled system, and the gradient of the Lagrangian. Returns the
    /// objective.
    pub fn evaluate<E: Packed<T>>(&mut self, multipliers: &mut [T]) -> T {
        self.evaluate_selected::<E>(true, Some(multipliers), Costates::Controlled)
    }

    /// As [`evaluate`](Self::evaluate) with given multipliers `π`: the gradient in the states is
    /// what they leave.
    pub fn evaluate_with_costates<E: Packed<T>>(&mut self, multipliers: &mut [T]) {
        let _ = self.evaluate_selected::<E>(true, Some(multipliers), Costates::Given);
    }

    /// The multipliers `π` after a step, by the recursion of the controlled system.
    pub fn closed_loop_costates<E: Packed<T>>(&mut self, multipliers: &mut [T]) {
        let _ = self.evaluate_selected::<E>(false, Some(multipliers), Costates::AfterStep);
    }

    /// General constraints, dynamics, and what belongs to sides; the distances from the bounds are
    /// in `scratch` afterwards.
    pub fn evaluate_values<E: Packed<T>>(&mut self) {
        let _ = self.evaluate_selected::<E>(true, None, Costates::Given);
    }

    /// What is left of [`evaluate`](Self::evaluate) after
    /// [`evaluate_values`](Self::evaluate_values).
    pub fn evaluate_gradient<E: Packed<T>>(&mut self, multipliers: &mut [T]) {
        let _ = self.evaluate_selected::<E>(false, Some(multipliers), Costates::Controlled);
    }

    /// The same with given multipliers.
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

    /// Forces of the constraints, by rows.
    #[inline(always)]
    fn write_forces(&mut self, after_step: bool) {
        let sides = &mut self.sides;
        let forces = &mut *self.gradient;
        forces.fill(T::ZERO);
        let (lower, upper) = sides.rows.split_at_checked(sides.counts.lower).unwrap_or_default();
        let (of_lower, of_upper) = sides.multiplier.split_at_checked(lower.len()).unwrap_or_default();
        scatter(forces, lower, of_lower, |force, &multiplier| force - multiplier);
        scatter(forces, upper, of_upper, |force, &multiplier| force + multiplier);
        scatter(forces, sides.equations, sides.free, |force, &multiplier| force - multiplier);
        if after_step {
            // What keeps variables near where they are belongs to the step, not to the problem.
            for place in Places::<T>::new(self.qp.dims) {
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

    /// The multipliers `π`, the gradient of the Lagrangian, and the objective.
    #[inline(always)]
    fn gradient<E: Packed<T>>(&mut self, multipliers: &mut [T], costates: Costates) -> T {
        let after_step = matches!(costates, Costates::AfterStep);
        self.write_forces(after_step);
        let units = self.measure;
        let mut objective = T::ZERO;
        let mut largest = LargestTerms::NONE;
        largest.add_forces::<E>(self.gradient, units.rows);
        for place in Places::<T>::with_known_end(self.qp.dims, self.riccati.end).rev() {
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
                // π is what elimination of the controls leaves, g what it takes.
                let left = self.riccati.eliminate_controls::<E>(&place, g);
                let before = place.dynamics.saturating_sub(padded_len::<T>(nx));
                let pi = part_mut(multipliers, before, nx);
                copy_common(pi, left);
                for (g, &pi) in g.iter_mut().zip(&*pi) {
                    *g = *g - pi;
                }
                largest.add_forces::<E>(pi, here);
            } else if self.first == InitialStateKind::Fixed {
                // What is left is the multiplier of the given state.
                let given = part_mut(g, 0, nx);
                copy_common(part_mut(self.initial, 0, nx), given);
                // Zero, or NaN where it is not finite: that is seen among the residuals.
                given.iter_mut().for_each(|g| *g = T::ZERO * *g);
            }
        }
        if let Some(coupling) = self.coupling.as_mut().filter(|_| !after_step) {
            coupling.fold(self.qp, self.stationarity);
            if self.first == InitialStateKind::Fixed {
                // What the last state pushes a given first one with belongs to its multiplier, too.
                for (force, g) in self.initial.iter_mut().zip(&mut *self.stationarity) {
                    *force = *force + *g;
                    *g = T::ZERO * *g;
                }
            }
        }
        self.own_terms.forces = largest.own;
        self.terms.forces = units.choose(largest.own, largest.in_units / units.objective);
        objective + self.penalty_cost()
    }

    #[inline(always)]
    fn values<E: Packed<T>>(&mut self) {
        let units = self.measure;
        let mut largest = LargestTerms::NONE;
        let mut rest = &mut *self.v;
        for place in Places::<T>::new(self.qp.dims) {
            let StageOffsets { n, ng, ld, next, ld_next, .. } = place;
            let data = part(self.qp.data, place.data, place.data_len());
            let matrix = Columns { data: part(data, 0, place.matrix()), ld };
            let (v, general) = take_mut(&mut rest, place.rows).split_at_mut_checked(ld).unwrap_or_default();
            let here = units.from(place.row);
            general.fill(T::ZERO);
            add_transposed::<T, E>(general, matrix.skip(next), v, n, ng);
            largest.add_values::<E>(v, here);
            largest.add_values::<E>(part(general, 0, ng), units.from(place.row + ld));
            let dynamics = part_mut(self.dynamics, place.dynamics, ld_next);
            let offset = part(data, place.offset(), next);
            largest.add_values::<E>(offset, units.from(place.row + place.rows));
            for ((dynamics, &offset), &coming) in dynamics.iter_mut().zip(offset).zip(&*rest) {
                *dynamics = offset - coming;
            }
            add_transposed::<T, E>(dynamics, matrix, v, n, next);
        }
        self.own_terms.values = largest.own;
        self.terms.values = units.choose(largest.own, largest.in_units);
        if let Some(coupling) = &mut self.coupling {
            coupling.evaluate(self.qp, self.v);
        }
        self.evaluate_side_residuals::<E>();
    }

    /// What belongs to sides, of values that are known.
    #[inline(always)]
    pub fn evaluate_side_residuals<E: Packed<T>>(&mut self) {
        self.evaluate_distances();
        let sides = &mut self.sides;
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
        let sides = &self.sides;
        let (_, violations) = sides.slack.split_at_checked(sides.counts.sides()).unwrap_or_default();
        let costs = sides.linear.iter().zip(&*sides.quadratic).zip(violations);
        costs.fold(T::ZERO, |sum, ((&l, &q), &e)| sum + e * (l + T::from_f64(0.5) * q * e))
    }
}

/// What a proximal weight is of a row, whose variable is measured in its unit.
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

/// Changes rows by values that belong to them.
#[inline(always)]
pub fn scatter<T: Real>(target: &mut [T], rows: &[u32], values: &[T], change: impl Fn(T, &T) -> T) {
    for (&row, value) in rows.iter().zip(values) {
        debug_assert!((row as usize) < target.len(), "row {row} of {}", target.len());
        if let Some(target) = target.get_mut(row as usize) {
            *target = change(*target, value);
        }
    }
}
