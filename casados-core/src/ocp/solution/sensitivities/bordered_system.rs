//! The bordered system: its unknowns are outside the recursion, namely free elements of the first
//! state, the multipliers `θ` of periodic states, and shared controls `w`, which free parameters
//! are.
//!
//! ```text
//! π₀ + E θ = 0        x₀ − x_N = 0        Σ_k ∂L/∂u_k[j] = 0
//! ```
//!
//! Each column is a pass through the recursion with one unknown set to one and all others to zero.
//! The system is symmetric, and inertia is additive (E. V. Haynsworth, Linear Algebra Appl. 1,
//! 1968): the solution is a minimum if the pivots of controls and of the bordered system together
//! have as many negative signs as there are periodic states.

use super::kkt_direction::KktDirection;
use crate::linalg::{axpy, dot};
use crate::ocp::formulation::error::OcpError;
use crate::qp::element::{add, get, set};
use crate::qp::{QpView, copy_common, marked_indices, part, part_mut, zeros};
use crate::scalar::Real;
use alloc::vec::Vec;
use core::ops::Range;

/// The bordered system with the unknowns `(x₀, θ, w)`, each of which may be absent.
#[derive(Clone, Debug, Default)]
pub(super) struct BorderedSystem<T> {
    nx: usize,
    nu: usize,
    /// The free elements of the first state.
    free_initial_states: Range<usize>,
    pub(super) periodic_states: Vec<usize>,
    shared_controls: Vec<usize>,
    /// The rows of `M` of shared controls, for every interval.
    shared_control_rows: Vec<T>,
    /// The factors of the system.
    pub(super) factors: Vec<T>,
    pub(super) pivot_exchanges: Vec<T>,
}

impl<T: Real> BorderedSystem<T> {
    /// Prepares the system of a problem; keeps the memory if the unknowns are unchanged.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn prepare(
        &mut self,
        qp: QpView<'_, T>,
        free: Range<usize>,
        [nx, nu, n]: [usize; 3],
    ) -> Result<(), OcpError> {
        let is_unchanged = |old: &[usize], marks: &[T]| marked_indices(marks).eq(old.iter().copied());
        if free == self.free_initial_states
            && is_unchanged(&self.periodic_states, qp.periodic())
            && is_unchanged(&self.shared_controls, qp.shared())
        {
            return Ok(());
        }
        (self.nx, self.nu, self.free_initial_states) = (nx, nu, free);
        self.periodic_states = marked_indices(qp.periodic()).collect();
        self.shared_controls = marked_indices(qp.shared()).collect();
        self.shared_control_rows = zeros((n + 1) * self.shared_controls.len() * (nx + nu))?;
        self.factors = zeros(self.unknown_count() * self.unknown_count())?;
        self.pivot_exchanges = zeros(self.unknown_count())?;
        Ok(())
    }

    /// The number of unknowns.
    pub fn unknown_count(&self) -> usize {
        self.free_initial_states.len() + self.periodic_states.len() + self.shared_controls.len()
    }
    pub fn condition_count(&self) -> usize {
        self.periodic_states.len()
    }
    /// Whether an element of the first state is an unknown.
    pub fn is_unknown(&self, state: usize) -> bool {
        self.free_initial_states.contains(&state)
    }
    /// The number of given elements of the first state, in front of the free ones.
    pub fn given_initial_states(&self, nx: usize) -> usize {
        if self.free_initial_states.is_empty() { nx } else { self.free_initial_states.start }
    }

    /// Moves the rows of shared controls out of `M`, so that shared controls are not eliminated.
    pub fn extract_shared_control_rows(&mut self, k: usize, m: &mut [T]) {
        let (nx, size) = (self.nx, self.nx + self.nu);
        let rows = part_mut(
            &mut self.shared_control_rows,
            k * self.shared_controls.len() * size,
            self.shared_controls.len() * size,
        );
        let at = |i: usize, j: usize| i.min(j) * size + i.max(j);
        for (row, &j) in rows.chunks_exact_mut(size.max(1)).zip(&self.shared_controls) {
            for (i, element) in row.iter_mut().enumerate() {
                *element = get(m, at(i, nx + j));
            }
        }
        for &j in &self.shared_controls {
            (0..size).for_each(|i| set(m, at(i, nx + j), if i == nx + j { T::ONE } else { T::ZERO }));
        }
    }

    fn shared_control_rows(&self, k: usize) -> impl Iterator<Item = &[T]> {
        let size = self.nx + self.nu;
        part(
            &self.shared_control_rows,
            k * self.shared_controls.len() * size,
            self.shared_controls.len() * size,
        )
        .chunks_exact(size.max(1))
    }
    /// Shared controls with their indices among the unknowns.
    fn shared_control_unknowns(&self) -> impl Iterator<Item = (usize, usize)> {
        let begin = self.free_initial_states.len() + self.periodic_states.len();
        self.shared_controls.iter().enumerate().map(move |(c, &j)| (begin + c, j))
    }
    /// Periodic states with the indices of their multipliers among the unknowns.
    fn periodic_multiplier_unknowns(&self) -> impl Iterator<Item = (usize, usize)> {
        self.periodic_states.iter().enumerate().map(|(c, &i)| (self.free_initial_states.len() + c, i))
    }

    /// Writes the first state: its given elements, and the unknowns.
    pub fn write_initial_state(&self, start: &[T], unknowns: &[T], x: &mut [T]) {
        copy_common(x, start);
        let free = x.get_mut(self.free_initial_states.clone()).unwrap_or_default();
        copy_common(free, unknowns);
    }

    /// Adds the contribution of shared controls to a gradient, and moves the elements of shared
    /// controls to the residuals of their conditions.
    pub fn add_shared_control_gradient(&self, k: usize, unknowns: &[T], q: &mut [T], residual: &mut [T]) {
        for ((unknown, _), row) in self.shared_control_unknowns().zip(self.shared_control_rows(k)) {
            axpy(get(unknowns, unknown), row, q);
        }
        for (condition, j) in self.shared_control_unknowns() {
            add(residual, condition, get(q, self.nx + j));
            set(q, self.nx + j, T::ZERO);
        }
    }

    /// Adds the contribution of `θ` to the gradient with respect to the last state.
    pub fn add_periodic_multipliers(&self, unknowns: &[T], q: &mut [T]) {
        self.periodic_multiplier_unknowns().for_each(|(unknown, i)| add(q, i, -get(unknowns, unknown)));
    }

    /// Sets the shared controls, and adds the contributions of the state and the other controls to
    /// the residuals of their conditions.
    pub fn set_shared_controls(&self, k: usize, x: &[T], u: &mut [T], unknowns: &[T], residual: &mut [T]) {
        for ((condition, _), row) in self.shared_control_unknowns().zip(self.shared_control_rows(k)) {
            add(residual, condition, dot(part(row, 0, self.nx), x) + dot(part(row, self.nx, self.nu), u));
        }
        self.shared_control_unknowns().for_each(|(unknown, j)| set(u, j, get(unknowns, unknown)));
    }

    /// Evaluates the conditions of the first state and of periodic states at the end of a pass. The
    /// multipliers of the first state contain `θ` afterwards.
    pub fn evaluate_conditions(&self, n: usize, direction: &mut KktDirection<T>) {
        for (condition, i) in self.periodic_multiplier_unknowns() {
            let gap = get(direction.state(0), i) - get(direction.state(n), i);
            set(&mut direction.border_residual, condition, gap);
            let theta = get(&direction.border_unknowns, condition);
            add(direction.multipliers_mut(0), i, theta);
        }
        for (condition, i) in self.free_initial_states.clone().enumerate() {
            let value = get(direction.multipliers(0), i);
            set(&mut direction.border_residual, condition, value);
        }
    }
}
