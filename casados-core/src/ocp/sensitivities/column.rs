//! Solutions of the conditions of optimality by the factors of the recursion.

use super::factors::SolutionFactors;
use crate::linalg::axpy;
use crate::ocp::error::OcpError;
use crate::ocp::transfer::dot;
use crate::qp::element::{add, get, set};
use crate::qp::{Solution, StageDims, assign, part, part_mut, zeros};
use crate::scalar::Real;
use alloc::vec::Vec;

/// A direction: changes of states and controls, and those of the multipliers of the dynamics.
#[derive(Clone, Debug, Default)]
pub(super) struct Column<T> {
    nx: usize,
    nu: usize,
    x: Vec<T>,
    u: Vec<T>,
    pi: Vec<T>,
    /// The first state, where it is given.
    start: Vec<T>,
    work: Vec<T>,
    /// The unknowns of the border, and what is left of its conditions.
    pub border: Vec<T>,
    pub residual: Vec<T>,
}

impl<T: Real> Column<T> {
    pub fn new([nx, nu, _]: [usize; 3], n: usize) -> Result<Self, OcpError> {
        Ok(Self {
            nx,
            nu,
            x: zeros((n + 1) * nx)?,
            u: zeros(n * nu)?,
            pi: zeros((n + 1) * nx)?,
            start: zeros(nx)?,
            work: zeros(2 * nx + nu)?,
            border: Vec::new(),
            residual: Vec::new(),
        })
    }
    pub fn state(&self, k: usize) -> &[T] {
        part(&self.x, k * self.nx, self.nx)
    }
    pub fn control(&self, k: usize) -> &[T] {
        part(&self.u, k * self.nu, self.nu)
    }
    /// With so many unknowns of the border, all zero.
    pub fn begin(&mut self, border: usize) {
        for values in [&mut self.border, &mut self.residual] {
            values.clear();
            values.resize(border, T::ZERO);
        }
    }
    /// Of what makes `x_k`; at the start of what makes it the first state, given or periodic.
    pub fn multipliers(&self, k: usize) -> &[T] {
        part(&self.pi, k * self.nx, self.nx)
    }
    pub fn multipliers_mut(&mut self, k: usize) -> &mut [T] {
        part_mut(&mut self.pi, k * self.nx, self.nx)
    }
}

/// What the conditions of optimality are solved for: a gradient `q_k` over `(x, u)`, and constants
/// `e_k` of the dynamics.
pub(super) trait Right<T> {
    /// Writes `q_k`, which is zero before.
    fn gradient(&self, k: usize, q: &mut [T]);
    /// `e_k`; empty if there is none.
    fn end(&self, k: usize) -> &[T];
}

/// Nothing.
pub(super) struct Zero;

impl<T> Right<T> for Zero {
    fn gradient(&self, _: usize, _: &mut [T]) {}
    fn end(&self, _: usize) -> &[T] {
        &[]
    }
}

/// What a parameter changes.
struct OfParameter<'a, T>(&'a SolutionFactors<T>, usize);

impl<T: Real> Right<T> for OfParameter<'_, T> {
    fn gradient(&self, k: usize, q: &mut [T]) {
        let [nx, nu, _] = self.0.dims;
        assign(q, part(self.0.problem.gradient(k), self.1 * (nx + nu), q.len()));
    }
    fn end(&self, k: usize) -> &[T] {
        let [nx, _, _] = self.0.dims;
        part(self.0.problem.end(k), self.1 * nx, nx)
    }
}

/// A gradient over states and controls.
struct Seed<'a, T, D, M>(&'a Solution<T, D, M>);

impl<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Right<T> for Seed<'_, T, D, M> {
    fn gradient(&self, k: usize, q: &mut [T]) {
        let Some(stage) = self.0.stage(k) else { return };
        q.iter_mut().zip(stage.x.iter().chain(stage.u)).for_each(|(q, &value)| *q = value);
    }
    fn end(&self, _: usize) -> &[T] {
        &[]
    }
}

/// What an element of the first state changes, where it is given.
pub(super) fn solve_start<T: Real>(factors: &SolutionFactors<T>, element: usize, column: &mut Column<T>) {
    set(&mut column.start, element, T::ONE);
    factors.border.solve(factors, &Zero, column);
    set(&mut column.start, element, T::ZERO);
}

/// What a parameter changes.
pub(super) fn solve_parameter<T: Real>(factors: &SolutionFactors<T>, p: usize, column: &mut Column<T>) {
    factors.border.solve(factors, &OfParameter(factors, p), column);
}

/// What a gradient over states and controls changes.
pub(super) fn solve_seed<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    factors: &SolutionFactors<T>,
    seed: &Solution<T, D, M>,
    column: &mut Column<T>,
) {
    factors.border.solve(factors, &Seed(seed), column);
}

/// The solution where the first state, the multipliers `θ` of periodic states and the shared
/// controls `w` are given, and what is left of the conditions of the border.
///
/// With `t = s_{k+1} + P_{k+1} e_k` backwards `q += [A B]ᵀ t + M_{·w} w`, `κ = −M_uu⁻¹ q_u`,
/// `s_k = q_x + Kᵀ q_u`; then forwards `u = K x + κ`, `x₊ = A x + B u + e`, `π = P x + s`.
pub(super) fn pass<T: Real, R: Right<T>>(factors: &SolutionFactors<T>, right: &R, column: &mut Column<T>) {
    column.residual.fill(T::ZERO);
    backward(factors, right, column);
    forward(factors, right, column);
    factors.border.close(factors.intervals, column);
}

fn backward<T: Real, R: Right<T>>(factors: &SolutionFactors<T>, right: &R, column: &mut Column<T>) {
    let [nx, nu, _] = factors.dims;
    let (size, n) = (nx + nu, factors.intervals);
    let Column { u, pi, work, border: given, residual, .. } = column;
    let (q, t) = work.split_at_mut_checked(size).unwrap_or_default();
    for k in (0..=n).rev() {
        q.fill(T::ZERO);
        if k < n {
            right.gradient(k, q);
            assign(t, part(pi, (k + 1) * nx, nx));
            factors.cost_to_go(k + 1).zip(right.end(k)).for_each(|(column, &end)| axpy(end, column, t));
            factors.rows(k).zip(&*t).for_each(|(row, &t)| axpy(t, row, q));
            factors.border.push(k, given, q, residual);
            let controls = part(&factors.controls, k * nu * nu, nu * nu);
            solve(controls, part(q, nx, nu), part_mut(u, k * nu, nu));
        } else {
            right.gradient(k, part_mut(q, 0, nx));
            factors.border.push_last(given, q);
        }
        for (j, s) in part_mut(pi, k * nx, nx).iter_mut().enumerate() {
            let of_controls = if k < n { dot(factors.gains(k, j), part(q, nx, nu)) } else { T::ZERO };
            *s = get(q, j) + of_controls;
        }
    }
}

fn forward<T: Real, R: Right<T>>(factors: &SolutionFactors<T>, right: &R, column: &mut Column<T>) {
    let [nx, nu, _] = factors.dims;
    let Column { x, u, pi, start, border: given, residual, .. } = column;
    assign(part_mut(x, 0, nx), factors.border.first(start, given));
    for k in 0..=factors.intervals {
        let (before, after) = x.split_at_mut_checked((k + 1) * nx).unwrap_or_default();
        let here = part(before, k * nx, nx);
        let multipliers = part_mut(pi, k * nx, nx);
        factors.cost_to_go(k).zip(here).for_each(|(column, &x)| axpy(x, column, multipliers));
        if k == factors.intervals {
            break;
        }
        let control = part_mut(u, k * nu, nu);
        for (j, &x) in here.iter().enumerate() {
            axpy(x, factors.gains(k, j), control);
        }
        factors.border.steer(k, here, control, given, residual);
        for (i, (next, row)) in part_mut(after, 0, nx).iter_mut().zip(factors.rows(k)).enumerate() {
            *next = dot(part(row, 0, nx), here) + dot(part(row, nx, nu), control) + get(right.end(k), i);
        }
    }
}

/// `x = −M_uu⁻¹ b`
pub(super) fn solve<T: Real>(factors: &[T], b: &[T], x: &mut [T]) {
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
