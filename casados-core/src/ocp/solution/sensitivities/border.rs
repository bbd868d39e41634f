//! The first state where it is free, the multipliers `θ` of periodic states, and shared controls
//! `w`: unknowns of one small system beside the recursion.
//!
//! ```text
//! π₀ + E θ = 0        x₀ − x_N = 0        Σ_k ∂L/∂u_k[j] = 0
//! ```
//!
//! Each unknown is one column of this system: a pass through the recursion where it is one, and all
//! others are zero. It is symmetric, and inertia adds up (E. V. Haynsworth, Linear Algebra Appl. 1,
//! 1968): the solution is a minimum where pivots of controls and of the border together have as
//! many negative signs as there are periodic states.

use super::column::Column;
use crate::linalg::{axpy, dot};
use crate::ocp::formulation::error::OcpError;
use crate::qp::element::{add, get, set};
use crate::qp::{QpView, marked_indices, part, part_mut, zeros};
use crate::scalar::Real;
use alloc::vec::Vec;

/// The unknowns `(x₀, θ, w)`, of which there may be none.
#[derive(Clone, Debug, Default)]
pub(super) struct Border<T> {
    nx: usize,
    nu: usize,
    /// How many elements of the first state there are: none where it is given.
    free: usize,
    pub(super) periodic: Vec<usize>,
    shared: Vec<usize>,
    /// Rows of `M` of shared controls, of every interval.
    rows: Vec<T>,
    /// Factors of the system.
    pub(super) matrix: Vec<T>,
    pub(super) exchanged: Vec<T>,
}

impl<T: Real> Border<T> {
    /// That of a problem, in memory of the last one where it is the same.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn prepare(
        &mut self,
        qp: QpView<'_, T>,
        is_free: bool,
        [nx, nu, n]: [usize; 3],
    ) -> Result<(), OcpError> {
        let free = if is_free { nx } else { 0 };
        let same = |old: &[usize], marks: &[T]| marked_indices(marks).eq(old.iter().copied());
        if free == self.free && same(&self.periodic, qp.periodic()) && same(&self.shared, qp.shared()) {
            return Ok(());
        }
        (self.nx, self.nu, self.free) = (nx, nu, free);
        self.periodic = marked_indices(qp.periodic()).collect();
        self.shared = marked_indices(qp.shared()).collect();
        self.rows = zeros(n * self.shared.len() * (nx + nu))?;
        self.matrix = zeros(self.len() * self.len())?;
        self.exchanged = zeros(self.len())?;
        Ok(())
    }

    /// How many unknowns there are.
    pub fn len(&self) -> usize {
        self.free + self.periodic.len() + self.shared.len()
    }
    pub fn conditions(&self) -> usize {
        self.periodic.len()
    }
    /// Whether the first state is found.
    pub fn is_free(&self) -> bool {
        self.free > 0
    }

    /// Takes the rows of shared controls out of `M`, so that these are not eliminated.
    pub fn take_rows(&mut self, k: usize, m: &mut [T]) {
        let (nx, size) = (self.nx, self.nx + self.nu);
        let rows = part_mut(&mut self.rows, k * self.shared.len() * size, self.shared.len() * size);
        let at = |i: usize, j: usize| i.min(j) * size + i.max(j);
        for (row, &j) in rows.chunks_exact_mut(size.max(1)).zip(&self.shared) {
            for (i, element) in row.iter_mut().enumerate() {
                *element = get(m, at(i, nx + j));
            }
        }
        for &j in &self.shared {
            (0..size).for_each(|i| set(m, at(i, nx + j), if i == nx + j { T::ONE } else { T::ZERO }));
        }
    }

    fn rows(&self, k: usize) -> impl Iterator<Item = &[T]> {
        let size = self.nx + self.nu;
        part(&self.rows, k * self.shared.len() * size, self.shared.len() * size).chunks_exact(size.max(1))
    }
    /// Shared controls and where they are among the unknowns.
    fn controls(&self) -> impl Iterator<Item = (usize, usize)> {
        let begin = self.free + self.periodic.len();
        self.shared.iter().enumerate().map(move |(c, &j)| (begin + c, j))
    }
    /// Periodic states and where their multipliers are among the unknowns.
    fn multipliers(&self) -> impl Iterator<Item = (usize, usize)> {
        self.periodic.iter().enumerate().map(|(c, &i)| (self.free + c, i))
    }

    /// The first state.
    pub fn first<'a>(&self, start: &'a [T], given: &'a [T]) -> &'a [T] {
        if self.is_free() { given } else { start }
    }

    /// Adds what shared controls do to a gradient, whose elements by them belong to their own
    /// conditions.
    pub fn push(&self, k: usize, given: &[T], q: &mut [T], residual: &mut [T]) {
        for ((unknown, _), row) in self.controls().zip(self.rows(k)) {
            axpy(get(given, unknown), row, q);
        }
        for (condition, j) in self.controls() {
            add(residual, condition, get(q, self.nx + j));
            set(q, self.nx + j, T::ZERO);
        }
    }

    /// Adds what `θ` does to the gradient by the last state.
    pub fn push_last(&self, given: &[T], q: &mut [T]) {
        self.multipliers().for_each(|(unknown, i)| add(q, i, -get(given, unknown)));
    }

    /// Sets shared controls, after what the state and the other controls do to their conditions.
    pub fn steer(&self, k: usize, x: &[T], u: &mut [T], given: &[T], residual: &mut [T]) {
        for ((condition, _), row) in self.controls().zip(self.rows(k)) {
            add(residual, condition, dot(part(row, 0, self.nx), x) + dot(part(row, self.nx, self.nu), u));
        }
        self.controls().for_each(|(unknown, j)| set(u, j, get(given, unknown)));
    }

    /// The conditions of the first state and of periodic ones, at the end of a pass. Multipliers of
    /// the first state contain `θ` from here on.
    pub fn close(&self, n: usize, column: &mut Column<T>) {
        for (condition, i) in self.multipliers() {
            let gap = get(column.state(0), i) - get(column.state(n), i);
            set(&mut column.residual, condition, gap);
            let theta = get(&column.border, condition);
            add(column.multipliers_mut(0), i, theta);
        }
        for i in 0..self.free {
            let value = get(column.multipliers(0), i);
            set(&mut column.residual, i, value);
        }
    }
}
