//! Solutions of the KKT system, by the factors of the recursion.

use crate::ocp::formulation::error::OcpError;
use crate::qp::element::{add, get, set};
use crate::qp::{part, part_mut, zeros};
use crate::scalar::Real;
use alloc::vec::Vec;

/// A KKT direction: changes of states, controls and multipliers of the dynamics.
#[derive(Clone, Debug, Default)]
pub(in crate::ocp) struct KktDirection<T> {
    nx: usize,
    nu: usize,
    pub(super) x: Vec<T>,
    pub(super) u: Vec<T>,
    pub(super) pi: Vec<T>,
    /// The change of a given first state.
    pub(super) initial_state: Vec<T>,
    pub(super) work: Vec<T>,
    /// The unknowns of the bordered system, and the residuals of its conditions.
    pub border_unknowns: Vec<T>,
    pub border_residual: Vec<T>,
    /// The forces of active constraints.
    pub constraint_multipliers: Vec<T>,
}

impl<T: Real> KktDirection<T> {
    pub fn new([nx, nu, _]: [usize; 3], n: usize) -> Result<Self, OcpError> {
        Ok(Self {
            nx,
            nu,
            x: zeros((n + 1) * nx)?,
            u: zeros((n + 1) * nu)?,
            pi: zeros((n + 1) * nx)?,
            initial_state: zeros(nx)?,
            work: zeros(2 * nx + nu)?,
            border_unknowns: Vec::new(),
            border_residual: Vec::new(),
            constraint_multipliers: Vec::new(),
        })
    }
    pub fn state(&self, k: usize) -> &[T] {
        part(&self.x, k * self.nx, self.nx)
    }
    pub fn control(&self, k: usize) -> &[T] {
        part(&self.u, k * self.nu, self.nu)
    }
    /// Resets the unknowns of the bordered system to this number of zeros.
    pub fn reset(&mut self, border_count: usize) {
        for values in [&mut self.border_unknowns, &mut self.border_residual] {
            values.clear();
            values.resize(border_count, T::ZERO);
        }
    }
    /// The multipliers of the equation that determines `x_k`; at the start, of the given or
    /// periodic first state.
    pub fn multipliers(&self, k: usize) -> &[T] {
        part(&self.pi, k * self.nx, self.nx)
    }
    pub fn multipliers_mut(&mut self, k: usize) -> &mut [T] {
        part_mut(&mut self.pi, k * self.nx, self.nx)
    }
}

/// The right-hand side of the KKT system: a gradient `q_k` over `(x, u)`, and constants `e_k` of
/// the dynamics.
pub(in crate::ocp) trait RightHandSide<T> {
    /// Writes `q_k`, which is zero before.
    fn gradient(&self, k: usize, q: &mut [T]);
    /// `e_k`; empty if it is zero.
    fn dynamics_constant(&self, k: usize) -> &[T];
    /// The constant `s` of a constraint row of a stage.
    fn constraint_slope(&self, _stage: usize, _row: usize) -> T;
}

/// `x = −M_uu⁻¹ b`
pub(super) fn solve_controls<T: Real>(factors: &[T], b: &[T], x: &mut [T]) {
    let nu = x.len();
    let at = |i: usize, j: usize| j * nu + i;
    for (x, &b) in x.iter_mut().zip(b) {
        *x = -b;
    }
    for j in 0..nu {
        for i in j + 1..nu {
            let product = get(factors, at(i, j)) * get(x, j);
            add(x, i, -product);
        }
    }
    for j in (0..nu).rev() {
        let mut value = get(x, j) / get(factors, at(j, j));
        for i in j + 1..nu {
            value = value - get(factors, at(i, j)) * get(x, i);
        }
        set(x, j, value);
    }
}
