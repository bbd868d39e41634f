//! The Riccati recursion of derivatives, and solutions by its factors.

use super::active::Springs;
use super::factors::SolutionFactors;
use super::{add, get, set, zeros};
use crate::linalg::axpy;
use crate::ocp::error::OcpError;
use crate::ocp::linearise::dot;
use crate::qp::{QpError, QpView, Solution, SolutionStage, Stage, StageDims, assign, part, part_mut};
use crate::scalar::Real;
use alloc::vec::Vec;

/// How many numbers `P [A B]`, `M`, a gradient and a state take.
pub(super) const fn work(nx: usize, nu: usize) -> usize {
    let size = nx + nu;
    nx * size + size * size + size + nx
}

/// A direction: changes of states and controls, and those of the multipliers of the dynamics.
#[derive(Clone, Debug, Default)]
pub(super) struct Column<T> {
    nx: usize,
    nu: usize,
    x: Vec<T>,
    u: Vec<T>,
    pi: Vec<T>,
    work: Vec<T>,
}

impl<T: Real> Column<T> {
    pub fn new([nx, nu, _]: [usize; 3], n: usize) -> Result<Self, OcpError> {
        Ok(Self {
            nx,
            nu,
            x: zeros((n + 1) * nx)?,
            u: zeros(n * nu)?,
            pi: zeros((n + 1) * nx)?,
            work: zeros(2 * nx + nu)?,
        })
    }
    pub fn state(&self, k: usize) -> &[T] {
        part(&self.x, k * self.nx, self.nx)
    }
    pub fn control(&self, k: usize) -> &[T] {
        part(&self.u, k * self.nu, self.nu)
    }
    /// Of what makes `x_k`.
    pub fn multipliers(&self, k: usize) -> &[T] {
        part(&self.pi, k * self.nx, self.nx)
    }
}

/// `∂L/∂x₀`, without the multipliers of the initial state.
pub(super) fn gradient<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    qp: QpView<'_, T>,
    iterate: &Solution<T, D, M>,
    result: &mut [T],
) {
    let (Some(stage), Some(point)) = (qp.stages().next(), iterate.stages().next()) else { return };
    let view = stage.arrays();
    let (all, _) = iterate.vectors();
    let v = part(all, 0, view.n);
    for (i, slope) in result.iter_mut().enumerate() {
        let curved = v.iter().enumerate().fold(get(view.gradient, i), |sum, (j, &v)| {
            sum + get(view.hessian, i.min(j) * view.ld + i.max(j)) * v
        });
        let mu = point.g_upper.iter().zip(point.g_lower).map(|(&upper, &lower)| upper - lower);
        let rows = view.matrix.chunks_exact(view.ld.max(1));
        *slope = rows
            .zip(point.dynamics.iter().copied().chain(mu))
            .fold(curved, |sum, (row, multiplier)| sum + get(row, i) * multiplier);
    }
}

/// `P_k`, `K_k` and the factors of `M_uu`, backwards. With `parameters`, what these change is
/// completed by active constraints.
///
/// # Errors
/// [`QpError::NotConvex`]
pub(super) fn factorise<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    factors: &mut SolutionFactors<T>,
    qp: QpView<'_, T>,
    iterate: &Solution<T, D, M>,
    springs: &mut Springs<T>,
    parameters: bool,
) -> Result<(), OcpError> {
    let [nx, nu, _] = factors.dims;
    let (size, n) = (nx + nu, factors.intervals);
    let mut memory = core::mem::take(&mut factors.work);
    let (product, rest) = memory.split_at_mut_checked(nx * size).unwrap_or_default();
    let m = part_mut(rest, 0, size * size);
    let mut result = Ok(());
    for (k, (stage, point)) in qp.stages().zip(iterate.stages()).enumerate().rev() {
        begin_stage(factors, m, [k, size], (&stage, &point), springs, parameters);
        if k < n {
            let view = stage.arrays();
            for l in 0..nx {
                let row = part_mut(&mut factors.dynamics, (k * nx + l) * size, size);
                assign(row, part(view.matrix, l * view.ld, size));
            }
            let next = part(&factors.costs_to_go, (k + 1) * nx * nx, nx * nx);
            let dynamics = part(&factors.dynamics, k * nx * size, nx * size);
            add_quadratic(m, product, next, dynamics, [nx, size]);
            let controls = part_mut(&mut factors.controls, k * nu * nu, nu * nu);
            if let Err((index, pivot)) = cholesky(m, size, [nx, nu], controls) {
                result = Err(OcpError::Qp(QpError::NotConvex { stage: k, index, pivot }));
                break;
            }
            let gain = part_mut(&mut factors.gains, k * nu * nx, nu * nx);
            for (state, gain) in gain.chunks_exact_mut(nu.max(1)).enumerate() {
                solve(controls, part(m, state * size + nx, nu), gain);
            }
        }
        // P = M_xx + M_xu K
        let gain = if k < n { part(&factors.gains, k * nu * nx, nu * nx) } else { &[] };
        let p = part_mut(&mut factors.costs_to_go, k * nx * nx, nx * nx);
        for j in 0..nx {
            let column = part(gain, j * nu, nu);
            for i in j..nx {
                let value = get(m, j * size + i) + dot(part(m, i * size + nx, column.len()), column);
                set(p, j * nx + i, value);
                set(p, i * nx + j, value);
            }
        }
    }
    factors.work = memory;
    result
}

/// `M = H` and the springs of the bounds, its lower triangle, column after column.
fn begin_stage<T: Real>(
    factors: &mut SolutionFactors<T>,
    m: &mut [T],
    [k, size]: [usize; 2],
    (stage, point): (&Stage<'_, T>, &SolutionStage<'_, T>),
    springs: &mut Springs<T>,
    parameters: bool,
) {
    let view = stage.arrays();
    let (here, ld) = (view.n, view.ld);
    for j in 0..here {
        for i in j..here {
            set(m, j * size + i, get(view.hessian, j * ld + i));
        }
    }
    // The state that is given does not move in this way.
    let states = if k == 0 { &[] } else { point.x };
    for (i, &x) in states.iter().enumerate() {
        let multipliers = [get(point.x_lower, i), get(point.x_upper, i)];
        add(m, i * size + i, springs.both(&stage.x_bounds(), i, x, multipliers));
    }
    for (i, &u) in point.u.iter().enumerate() {
        let multipliers = [get(point.u_lower, i), get(point.u_upper, i)];
        let place = (point.x.len() + i) * (size + 1);
        add(m, place, springs.both(&stage.u_bounds(), i, u, multipliers));
    }
    for (row, (&lower, &upper)) in point.g_lower.iter().zip(point.g_upper).enumerate() {
        let c = part(view.matrix, (view.next + row) * ld, here);
        let (of_x, of_u) = c.split_at_checked(point.x.len()).unwrap_or_default();
        let value = dot(of_x, point.x) + dot(of_u, point.u);
        let stiff = springs.both(&stage.g_bounds(), row, value, [lower, upper]);
        if stiff == T::ZERO {
            continue;
        }
        for (j, &factor) in c.iter().enumerate() {
            for i in j..here {
                add(m, j * size + i, stiff * get(c, i) * factor);
            }
        }
        if parameters {
            factors.problem.constrain([k, row], stiff, c);
        }
    }
}

/// Adds `[A B]ᵀ P [A B]`: `P` is symmetric, and rows of `[A B]` lie side by side.
fn add_quadratic<T: Real>(m: &mut [T], product: &mut [T], p: &[T], dynamics: &[T], [nx, size]: [usize; 2]) {
    product.fill(T::ZERO);
    for (i, row) in product.chunks_exact_mut(size.max(1)).enumerate() {
        for (l, ab) in dynamics.chunks_exact(size.max(1)).enumerate() {
            axpy(get(p, l * nx + i), ab, row);
        }
    }
    for (ab, row) in dynamics.chunks_exact(size.max(1)).zip(product.chunks_exact(size.max(1))) {
        for (j, &factor) in row.iter().enumerate() {
            for i in j..size {
                add(m, j * size + i, get(ab, i) * factor);
            }
        }
    }
}

/// What a parameter changes.
pub(super) fn solve_parameter<T: Real>(factors: &SolutionFactors<T>, p: usize, column: &mut Column<T>) {
    let [nx, nu, _] = factors.dims;
    let problem = &factors.problem;
    let gradient = |k: usize, q: &mut [T]| assign(q, part(problem.gradient(k), p * (nx + nu), nx + nu));
    solve_column(factors, gradient, |k| part(problem.end(k), p * nx, nx), column);
}

/// What a gradient over states and controls changes.
pub(super) fn solve_seed<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    factors: &SolutionFactors<T>,
    seed: &Solution<T, D, M>,
    column: &mut Column<T>,
) {
    let gradient = |k: usize, q: &mut [T]| {
        let Some(stage) = seed.stage(k) else { return };
        q.iter_mut().zip(stage.x.iter().chain(stage.u)).for_each(|(q, &value)| *q = value);
    };
    solve_column(factors, gradient, |_| &[], column);
}

/// The solution for a gradient `q_k` over `(x, u)` and constants `e_k` of the dynamics: with
/// `t = s_{k+1} + P_{k+1} e_k` backwards `q += [A B]ᵀ t`, `κ = −M_uu⁻¹ q_u`, `s_k = q_x + Kᵀ q_u`;
/// then forwards `u = K x + κ`, `x₊ = A x + B u + e`, `π = P x + s`.
fn solve_column<'e, T: Real>(
    factors: &SolutionFactors<T>,
    gradient: impl Fn(usize, &mut [T]),
    end: impl Fn(usize) -> &'e [T],
    column: &mut Column<T>,
) {
    let [nx, nu, _] = factors.dims;
    let (size, n) = (nx + nu, factors.intervals);
    let Column { x, u, pi, work, .. } = column;
    let (q, t) = work.split_at_mut_checked(size).unwrap_or_default();
    let p = |k: usize| part(&factors.costs_to_go, k * nx * nx, nx * nx).chunks_exact(nx.max(1));
    let rows = |k: usize| part(&factors.dynamics, k * nx * size, nx * size).chunks_exact(size.max(1));
    let gains = |k: usize| part(&factors.gains, k * nu * nx, nu * nx);
    for k in (0..=n).rev() {
        q.fill(T::ZERO);
        gradient(k, q);
        if k < n {
            assign(t, part(pi, (k + 1) * nx, nx));
            p(k + 1).zip(end(k)).for_each(|(column, &end)| axpy(end, column, t));
            rows(k).zip(&*t).for_each(|(row, &t)| axpy(t, row, q));
            let controls = part(&factors.controls, k * nu * nu, nu * nu);
            solve(controls, part(q, nx, nu), part_mut(u, k * nu, nu));
        }
        for (j, s) in part_mut(pi, k * nx, nx).iter_mut().enumerate() {
            let of_controls = if k < n { dot(part(gains(k), j * nu, nu), part(q, nx, nu)) } else { T::ZERO };
            *s = get(q, j) + of_controls;
        }
    }
    part_mut(x, 0, nx).fill(T::ZERO);
    for k in 0..n {
        let (before, after) = x.split_at_mut_checked((k + 1) * nx).unwrap_or_default();
        let (here, next) = (part(before, k * nx, nx), part_mut(after, 0, nx));
        let control = part_mut(u, k * nu, nu);
        for (gain, &x) in gains(k).chunks_exact(nu.max(1)).zip(here) {
            axpy(x, gain, control);
        }
        for (i, (next, row)) in next.iter_mut().zip(rows(k)).enumerate() {
            *next = dot(part(row, 0, nx), here) + dot(part(row, nx, nu), control) + get(end(k), i);
        }
        let multipliers = part_mut(pi, (k + 1) * nx, nx);
        p(k + 1).zip(&*next).for_each(|(column, &x)| axpy(x, column, multipliers));
    }
}

/// Cholesky's factors without roots of `M_uu`; the pivot that is not positive, if there is one.
fn cholesky<T: Real>(
    m: &[T],
    size: usize,
    [nx, nu]: [usize; 2],
    factors: &mut [T],
) -> Result<(), (usize, f64)> {
    let at = |i: usize, j: usize| j * nu + i;
    for j in 0..nu {
        for i in j..nu {
            set(factors, at(i, j), get(m, (nx + j) * size + nx + i));
        }
    }
    for j in 0..nu {
        let pivot = get(factors, at(j, j));
        let is_positive = pivot > T::ZERO;
        if !is_positive {
            return Err((j, pivot.to_f64()));
        }
        for i in j + 1..nu {
            let factor = get(factors, at(i, j)) / pivot;
            for l in i..nu {
                add(factors, at(l, i), -(factor * get(factors, at(l, j))));
            }
        }
        for i in j + 1..nu {
            set(factors, at(i, j), get(factors, at(i, j)) / pivot);
        }
    }
    Ok(())
}

/// `x = −M_uu⁻¹ b`
fn solve<T: Real>(factors: &[T], b: &[T], x: &mut [T]) {
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
