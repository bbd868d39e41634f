//! Newton's equations with conditions that tie the state at the end to the state at the start.
//!
//! ```text
//! [K  B] [Δv]     [g]           K⁻¹B column by column: further right-hand sides of the recursion
//! [Bᵀ 0] [Δθ] = − [c]           (Bᵀ K⁻¹ B) Δθ = c − Bᵀ K⁻¹ g
//! ```
//!
//! `B` has a column `e_i` at the first stage and `−e_i` at the last one for each state `i` that is tied.
//! With `K` positive definite on the dynamics so is `Bᵀ K⁻¹ B`, unless conditions depend on each other.

use super::newton::Iterate;
use super::riccati::Equations;
use super::vector::add_scaled;
use crate::qp::error::QpError;
use crate::qp::layout::{Places, assign, end, part, part_mut, take_mut};
use crate::qp::{QpView, StageDims};
use crate::scalar::{Packed, Real};

/// The conditions `x₀[i] = x_N[i]` in memory of their owner.
pub struct Coupling<'a, T> {
    /// For every state, whether it is tied: not zero.
    pub tied: &'a [T],
    /// `x₀ − x_N`
    pub residual: &'a mut [T],
    /// `Δθ`
    pub step: &'a mut [T],
    /// `K⁻¹B`, column after column.
    columns: &'a mut [T],
    /// `Bᵀ K⁻¹ B`
    matrix: &'a mut [T],
    /// The step without the conditions.
    first: &'a mut [T],
    /// Dynamics of further right-hand sides.
    zeros: &'a mut [T],
}

impl<'a, T: Real> Coupling<'a, T> {
    /// How many numbers it takes.
    pub const fn memory(dims: &[StageDims], nx: usize) -> usize {
        let end = end::<T>(dims);
        2 * nx + (nx + 1) * end.row + nx * nx + end.dynamics
    }

    /// In memory of that length.
    pub fn new(dims: &[StageDims], tied: &'a [T], memory: &mut &'a mut [T]) -> Self {
        let (end, nx) = (end::<T>(dims), tied.len());
        Self {
            tied,
            residual: take_mut(memory, nx),
            step: take_mut(memory, nx),
            columns: take_mut(memory, nx * end.row),
            matrix: take_mut(memory, nx * nx),
            first: take_mut(memory, end.row),
            zeros: take_mut(memory, end.dynamics),
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
    Places::<T>::new(qp.dims).last().map_or(0, |place| place.row)
}

impl<T: Real> Iterate<'_, T> {
    /// As [`Iterate::newton`], with the conditions of a coupling.
    ///
    /// # Errors
    /// [`QpError::NotConvex`], of the recursion; of the conditions with stage zero.
    #[inline(always)]
    pub fn newton_coupled<E: Packed<T>>(&mut self, coupling: &mut Coupling<'_, T>) -> Result<(), QpError> {
        self.sides.push(true);
        self.solve::<E>(true)?;
        let last = last_state(self.qp);
        let difference = |step: &[T], i: usize| {
            let at = |row: usize| step.get(row).copied().unwrap_or(T::ZERO);
            at(i) - at(last + i)
        };
        let rows = self.step.len();
        for i in coupling.indices() {
            let gap = coupling.residual.get(i).copied().unwrap_or(T::ZERO) + difference(self.step, i);
            super::set(coupling.step, i, gap);
        }
        assign(coupling.first, self.step);
        self.riccati.no_dynamics();
        for i in coupling.indices() {
            self.gradient.fill(T::ZERO);
            super::set(self.gradient, i, T::ONE);
            super::set(self.gradient, last + i, -T::ONE);
            let column = part_mut(coupling.columns, i * rows, rows);
            let equations = Equations {
                qp: self.qp,
                first: self.first,
                weights: self.weights,
                gradient: self.gradient,
                dynamics: coupling.zeros,
            };
            self.riccati.solve::<E>(equations, false, column)?;
        }
        let nx = coupling.tied.len();
        for j in coupling.indices() {
            let column = part(coupling.columns, j * rows, rows);
            for i in coupling.indices() {
                super::set(coupling.matrix, j * nx + i, -difference(column, i));
            }
        }
        solve_symmetric(coupling)?;
        assign(self.step, coupling.first);
        for i in coupling.indices() {
            let factor = coupling.step.get(i).copied().unwrap_or(T::ZERO);
            add_scaled(self.step, factor, part(coupling.columns, i * rows, rows));
        }
        self.gather_step();
        self.sides.steps();
        Ok(())
    }
}

/// `S Δθ = r` by Cholesky's factorisation over the states that are tied; directions in which `S`
/// vanishes do not move.
fn solve_symmetric<T: Real>(coupling: &mut Coupling<'_, T>) -> Result<(), QpError> {
    let nx = coupling.tied.len();
    let get = |matrix: &[T], row: usize, column: usize| matrix.get(column * nx + row).copied().unwrap_or(T::ZERO);
    let mut largest = T::ZERO;
    for i in coupling.indices() {
        largest = get(coupling.matrix, i, i).abs().max(largest);
    }
    let noise = T::from_f64(T::EPSILON).sqrt() * largest;
    for k in coupling.indices() {
        let mut pivot = get(coupling.matrix, k, k);
        for j in coupling.indices().take_while(|&j| j < k) {
            let l = get(coupling.matrix, k, j);
            pivot = pivot - l * l;
        }
        if pivot < -noise {
            return Err(QpError::NotConvex { stage: 0, index: k, pivot: pivot.to_f64() });
        }
        // Redundant: its multiplier stays.
        let dependent = pivot <= T::from_f64(T::EPSILON * 100.0) * largest;
        let diagonal = if dependent { T::from_f64(f64::INFINITY) } else { pivot.sqrt() };
        super::set(coupling.matrix, k * nx + k, diagonal);
        for i in coupling.indices().filter(|&i| i > k) {
            let mut value = get(coupling.matrix, i, k);
            for j in coupling.indices().take_while(|&j| j < k) {
                value = value - get(coupling.matrix, i, j) * get(coupling.matrix, k, j);
            }
            super::set(coupling.matrix, k * nx + i, if dependent { T::ZERO } else { value / diagonal });
        }
    }
    for k in coupling.indices() {
        let mut value = coupling.step.get(k).copied().unwrap_or(T::ZERO);
        for j in coupling.indices().take_while(|&j| j < k) {
            value = value - get(coupling.matrix, k, j) * coupling.step.get(j).copied().unwrap_or(T::ZERO);
        }
        super::set(coupling.step, k, value / get(coupling.matrix, k, k));
    }
    for k in (0..nx).rev().filter(|&k| coupling.tied.get(k).is_some_and(|&t| t != T::ZERO)) {
        let mut value = coupling.step.get(k).copied().unwrap_or(T::ZERO);
        for i in coupling.indices().filter(|&i| i > k) {
            value = value - get(coupling.matrix, i, k) * coupling.step.get(i).copied().unwrap_or(T::ZERO);
        }
        super::set(coupling.step, k, value / get(coupling.matrix, k, k));
    }
    Ok(())
}
