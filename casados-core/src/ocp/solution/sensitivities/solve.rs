//! Solutions of the conditions of optimality by the factors of the recursion.

use super::border::Border;
use super::column::{Column, Right, solve};
use super::factors::SolutionFactors;
use crate::linalg::{axpy, dot};
use crate::ocp::formulation::error::OcpError;
use crate::qp::element::{get, set};
use crate::qp::{QpError, Solution, StageDims, Symmetric, copy_common, part, part_mut};
use crate::scalar::Real;

impl<T: Real> Border<T> {
    /// Solves for a right-hand side: a pass with all unknowns zero says what these have to be.
    pub fn solve<R: Right<T>>(&self, factors: &SolutionFactors<T>, right: &R, column: &mut Column<T>) {
        column.begin(self.len());
        pass(factors, right, column);
        if self.len() > 0 {
            let (matrix, exchanged) = (&self.matrix, &self.exchanged);
            let Column { border, residual, .. } = &mut *column;
            border.iter_mut().zip(&*residual).for_each(|(unknown, &left)| *unknown = -left);
            Symmetric::new(matrix, self.len(), exchanged).solve(border);
            pass(factors, right, column);
        }
    }

    /// Factorises the system, column after column.
    ///
    /// # Errors
    /// [`QpError::NotConvex`] where the point is no minimum.
    pub fn factorise(factors: &mut SolutionFactors<T>, column: &mut Column<T>) -> Result<(), OcpError> {
        let mut border = core::mem::take(&mut factors.border);
        let n = border.len();
        let mut matrix = core::mem::take(&mut border.matrix);
        factors.border = border;
        column.begin(n);
        for unknown in 0..n {
            set(&mut column.border, unknown, T::ONE);
            pass(factors, &Zero, column);
            set(&mut column.border, unknown, T::ZERO);
            copy_common(part_mut(&mut matrix, unknown * n, n), &column.residual);
        }
        let border = &mut factors.border;
        border.matrix = matrix;
        let noise = T::from_f64(T::EPSILON);
        let pivots = Symmetric::factor(&mut border.matrix, n, &mut border.exchanged, noise);
        let negative = pivots.negative + factors.negative;
        let conditions = border.periodic.len();
        if negative > conditions || negative + pivots.vanished < conditions {
            return Err(OcpError::Qp(QpError::NotConvex { stage: 0, index: 0, pivot: -1.0 }));
        }
        Ok(())
    }
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
        copy_common(q, part(self.0.problem.gradient(k), self.1 * (nx + nu), q.len()));
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
            copy_common(t, part(pi, (k + 1) * nx, nx));
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
    copy_common(part_mut(x, 0, nx), factors.border.first(start, given));
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
