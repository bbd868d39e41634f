//! Newton's equations with conditions that tie the state at the end to the state at the start.
//!
//! ```text
//! cost to go of stage k   ½ xᵀPx + xᵀΓθ + ½ θᵀSθ + pᵀx + sᵀθ        Γ_N = −E
//! at the first stage      [P₀  Γ₀ + E] [x₀]     [p₀   ]
//!                         [ ·    S   ] [θ ] = − [s + c]            c = x₀ − x_N
//! ```
//!
//! The multipliers `θ` are parameters of the recursion: each is a further right-hand side on the
//! way back, and the way forth is gone once. `E` has a column for each state that is tied. Inertia
//! adds up (Haynsworth): the step is one of a minimum where pivots of controls and of the border
//! together have as many negative signs as there are conditions.

use super::cholesky::eliminate;
use super::iterate::Iterate;
use super::kernels::{Columns, subtract};
use super::riccati::{Equations, First, Riccati};
use super::symmetric::Symmetric;
use crate::qp::error::QpError;
use crate::qp::layout::{Place, Places, assign, end, pad, part, part_mut, take_mut};
use crate::qp::{QpView, StageDims};
use crate::scalar::{Packed, Piece, Real};
use core::marker::PhantomData;

/// The conditions `x₀[i] = x_N[i]` in memory of their owner.
pub struct Coupling<'a, T> {
    /// For every state, whether it is tied: not zero.
    pub tied: &'a [T],
    /// `x₀ − x_N`
    pub residual: &'a mut [T],
    /// `Δθ`
    pub step: &'a mut [T],
    /// `Γ` at the first stage, column after column.
    gamma: &'a mut [T],
    /// `S`, the lower triangle.
    schur: &'a mut [T],
    /// `s`
    linear: &'a mut [T],
    /// `L⁻¹ M_uθ` of every column, over the variables of all stages.
    eliminated: &'a mut [T],
    /// `p` at the first stage.
    first: &'a mut [T],
    /// The system of the first state and the multipliers.
    matrix: &'a mut [T],
    right: &'a mut [T],
    exchanged: &'a mut [T],
}

impl<'a, T: Real> Coupling<'a, T> {
    /// How many numbers it takes.
    pub const fn memory(dims: &[StageDims], nx: usize) -> usize {
        let end = end::<T>(dims);
        2 * nx + 2 * nx * nx + nx + nx * end.v + nx + 4 * nx * nx + 4 * nx
    }

    /// In memory of that length.
    pub fn new(dims: &[StageDims], tied: &'a [T], memory: &mut &'a mut [T]) -> Self {
        let (end, nx) = (end::<T>(dims), tied.len());
        Self {
            tied,
            residual: take_mut(memory, nx),
            step: take_mut(memory, nx),
            gamma: take_mut(memory, nx * nx),
            schur: take_mut(memory, nx * nx),
            linear: take_mut(memory, nx),
            eliminated: take_mut(memory, nx * end.v),
            first: take_mut(memory, nx),
            matrix: take_mut(memory, 4 * nx * nx),
            right: take_mut(memory, 2 * nx),
            exchanged: take_mut(memory, 2 * nx),
        }
    }

    /// `x₀ − x_N` at a point over the rows.
    pub fn evaluate(&mut self, qp: QpView<'_, T>, rows: &[T]) {
        let last = last_state(qp);
        let at = |row: usize| rows.get(row).copied().unwrap_or(T::ZERO);
        for (i, (residual, &tied)) in self.residual.iter_mut().zip(self.tied).enumerate() {
            *residual = tied * (at(i) - at(last + i));
        }
    }

    /// Adds the forces of `Δθ` to the rows.
    pub fn push(&self, qp: QpView<'_, T>, rows: &mut [T]) {
        let last = last_state(qp);
        for i in self.indices() {
            let step = self.step.get(i).copied().unwrap_or(T::ZERO);
            for (row, force) in [(i, step), (last + i, -step)] {
                if let Some(row) = rows.get_mut(row) {
                    *row = *row + force;
                }
            }
        }
    }

    /// The sum of all gaps.
    pub fn violation(&self) -> f64 {
        self.residual.iter().fold(0.0, |sum, gap| sum + gap.abs().to_f64())
    }

    /// `θᵀ (Δx₀ − Δx_N)`
    pub fn slope(&self, qp: QpView<'_, T>, theta: &[T], step: &[T]) -> T {
        let last = last_state(qp);
        let at = |row: usize| step.get(row).copied().unwrap_or(T::ZERO);
        let terms = self.tied.iter().zip(theta).enumerate();
        terms.fold(T::ZERO, |sum, (i, (&tied, &theta))| sum + tied * theta * (at(i) - at(last + i)))
    }

    /// The states that are tied.
    fn indices(&self) -> impl Iterator<Item = usize> + use<'a, T> {
        let tied = self.tied;
        tied.iter().enumerate().filter(|(_, t)| **t != T::ZERO).map(|(i, _)| i)
    }
}

/// Where the last state begins among the rows.
pub fn last_state<T: Real>(qp: QpView<'_, T>) -> usize {
    Places::<T>::new(qp.dims).next_back().map_or(0, |place| place.row)
}

impl<T: Real> Iterate<'_, T> {
    /// As [`Iterate::newton`], with the conditions of a coupling.
    ///
    /// # Errors
    /// [`QpError::NotConvex`] where the inertia is not that of a minimum.
    #[inline(always)]
    pub fn newton_coupled<E: Packed<T>>(&mut self, coupling: &mut Coupling<'_, T>) -> Result<(), QpError> {
        self.sides.push(true);
        self.assemble(true);
        let mut result = Ok(());
        let register = PhantomData::<E>;
        E::vectorize(Solve { iterate: self, coupling, result: &mut result, register });
        result?;
        self.gather_step();
        self.sides.steps();
        Ok(())
    }
}

/// The solve as a function of its own.
struct Solve<'s, 'a, 'c, T, E> {
    iterate: &'s mut Iterate<'a, T>,
    coupling: &'s mut Coupling<'c, T>,
    result: &'s mut Result<(), QpError>,
    register: PhantomData<E>,
}

impl<T: Real, E: Packed<T>> Piece for Solve<'_, '_, '_, T, E> {
    #[inline(always)]
    fn run(self) {
        let Self { iterate, coupling, result, .. } = self;
        let Iterate { qp, riccati, weights, gradient, dynamics, step, objective, .. } = iterate;
        let equations =
            Equations { qp: *qp, first: First::Tied, objective: *objective, weights, gradient, dynamics };
        *result = riccati.backward::<E>(&equations, true, step);
        if result.is_ok() {
            assign(coupling.first, riccati.g);
            coupling.columns::<E>(*qp, riccati, dynamics);
            *result = coupling.border(riccati);
        }
        if result.is_ok() {
            riccati.forward::<E>(&equations, step);
        }
    }
}

impl<T: Real> Coupling<'_, T> {
    /// `Γ`, `S` and `s` of the cost to go `½ xᵀPx + xᵀΓθ + ½ θᵀSθ + pᵀx + sᵀθ`, column by column.
    #[inline(always)]
    fn columns<E: Packed<T>>(&mut self, qp: QpView<'_, T>, riccati: &mut Riccati<'_, T>, dynamics: &[T]) {
        let nx = self.tied.len();
        let end = riccati.end;
        let last = qp.dims.len().saturating_sub(1);
        self.schur.fill(T::ZERO);
        self.linear.fill(T::ZERO);
        for i in self.indices() {
            let (mut own, mut linear) = (T::ZERO, T::ZERO);
            riccati.minus.fill(T::ZERO);
            for place in Places::<T>::ending(qp.dims, end).rev() {
                let Place { nu, n, ld, next, .. } = place;
                let data = part(qp.data, place.data, place.matrix());
                let g = part_mut(riccati.g, 0, ld);
                g.fill(T::ZERO);
                if place.stage == last {
                    super::set(g, i, -T::ONE);
                }
                subtract::<T, E>(g, Columns { data, ld }, riccati.minus, n, next);
                // `γ₊ᵀ r`
                let r = part(dynamics, place.dynamics, next);
                linear = riccati.minus.iter().zip(r).fold(linear, |sum, (&minus, &r)| sum - minus * r);
                let panel = part(riccati.panels, place.factor, ld * place.pivots);
                let inverse = part(riccati.inverse, place.v + place.nx, nu);
                let (before, here) = self.eliminated.split_at_mut_checked(i * end.v).unwrap_or_default();
                let y = part_mut(here, place.v + place.nx, nu);
                eliminate::<T, E>(g, panel, ld, inverse, y, place.nx);
                let all = part(riccati.y, place.v + place.nx, nu);
                let signed = |a: &[T], b: &[T]| {
                    let products = a.iter().zip(b).zip(inverse);
                    products.fold(
                        T::ZERO,
                        |sum, ((&a, &b), &inverse)| {
                            if inverse < T::ZERO { sum - a * b } else { sum + a * b }
                        },
                    )
                };
                linear = linear - signed(y, all);
                own = own - signed(y, y);
                for j in self.tied.iter().enumerate().take(i).filter(|(_, t)| **t != T::ZERO).map(|(j, _)| j)
                {
                    let other = part(before, j * end.v + place.v + place.nx, nu);
                    if let Some(element) = self.schur.get_mut(j * nx + i) {
                        *element = *element - signed(y, other);
                    }
                }
                for (minus, &g) in riccati.minus.iter_mut().zip(&*g).take(place.nx) {
                    *minus = -g;
                }
            }
            assign(part_mut(self.gamma, i * nx, nx), riccati.g);
            super::set(self.schur, i * nx + i, own);
            super::set(self.linear, i, linear);
        }
    }

    /// The first state and `Δθ` together: `[P₀ Γ₀ + E; · S] (x₀, θ) = −(p₀, s + c)`.
    fn border(&mut self, riccati: &mut Riccati<'_, T>) -> Result<(), QpError> {
        let nx = self.tied.len();
        let count = self.indices().count();
        let n = nx + count;
        let ld = pad::<T>(nx);
        self.matrix.fill(T::ZERO);
        for j in 0..nx {
            for i in j..nx {
                let p = riccati.p.get(j * ld + i).copied().unwrap_or(T::ZERO);
                super::set(self.matrix, j * n + i, p);
            }
            for (row, i) in self.indices().enumerate() {
                let unit = if i == j { T::ONE } else { T::ZERO };
                let gamma = self.gamma.get(i * nx + j).copied().unwrap_or(T::ZERO);
                super::set(self.matrix, j * n + nx + row, gamma + unit);
            }
        }
        for (column, j) in self.indices().enumerate() {
            for (row, i) in self.indices().enumerate().skip(column) {
                let s = self.schur.get(j * nx + i).copied().unwrap_or(T::ZERO);
                super::set(self.matrix, (nx + column) * n + nx + row, s);
            }
        }
        self.solve_border(riccati, [nx, count])
    }

    fn solve_border(&mut self, riccati: &mut Riccati<'_, T>, [nx, count]: [usize; 2]) -> Result<(), QpError> {
        let n = nx + count;
        // The first stage has left the gradient of the cost to go.
        for j in 0..nx {
            let p = self.first.get(j).copied().unwrap_or(T::ZERO);
            super::set(self.right, j, -p);
        }
        for (row, i) in self.indices().enumerate() {
            let value = |values: &[T]| values.get(i).copied().unwrap_or(T::ZERO);
            super::set(self.right, nx + row, -(value(self.linear) + value(self.residual)));
        }
        let noise = T::from_f64(T::EPSILON);
        let factors = Symmetric::factor(self.matrix, n, self.exchanged, noise);
        let negative = factors.negative + riccati.negative;
        if negative > count || negative + factors.vanished < count {
            return Err(QpError::NotConvex { stage: 0, index: 0, pivot: -1.0 });
        }
        factors.solve(part_mut(self.right, 0, n));
        self.step.fill(T::ZERO);
        for (row, i) in
            self.tied.iter().enumerate().filter(|(_, t)| **t != T::ZERO).map(|(i, _)| i).enumerate()
        {
            let theta = self.right.get(nx + row).copied().unwrap_or(T::ZERO);
            super::set(self.step, i, theta);
            let end = riccati.end.v;
            for (y, &own) in riccati.y.iter_mut().zip(part(self.eliminated, i * end, end)) {
                *y = *y + theta * own;
            }
        }
        assign(part_mut(riccati.y, 0, nx), self.right);
        Ok(())
    }
}
