//! The Riccati recursion of derivatives: `K_k` and what parameters do, backwards; `dx_k` and
//! `du_k`, forwards.

use super::active::{both, weight};
use super::{Sensitivities, add, get, set};
use crate::linalg::axpy;
use crate::ocp::error::OcpError;
use crate::ocp::linearise::dot;
use crate::qp::{QpView, Solution, StageDims, part, part_mut};
use crate::scalar::Real;

/// Parts of the memory.
pub(super) struct Work<'a, T> {
    /// `P` of the next stage.
    p: &'a mut [T],
    /// `P [A B]`, a row for each next state.
    product: &'a mut [T],
    /// The Hessian of a stage with what follows it.
    m: &'a mut [T],
    /// The factors of its block of the controls.
    factors: &'a mut [T],
    /// For each parameter the gradient of what follows, over the next states.
    next: &'a mut [T],
    /// And that of the stage with what follows it.
    gradient: &'a mut [T],
}

impl<'a, T> Work<'a, T> {
    const fn lengths(nx: usize, nu: usize, np: usize) -> [usize; 6] {
        let size = nx + nu;
        [nx * nx, nx * size, size * size, nu * nu, nx * np, size * np]
    }
    pub(super) const fn length(nx: usize, nu: usize, np: usize) -> usize {
        let [a, b, c, d, e, f] = Self::lengths(nx, nu, np);
        a + b + c + d + e + f
    }
    fn split(memory: &'a mut [T], nx: usize, nu: usize, np: usize) -> Self {
        let mut rest = memory;
        let [p, product, m, factors, next, gradient] = Self::lengths(nx, nu, np).map(|length| {
            let (part, behind) = core::mem::take(&mut rest).split_at_mut_checked(length).unwrap_or_default();
            rest = behind;
            part
        });
        Self { p, product, m, factors, next, gradient }
    }
}

/// Gains, and what controls do for parameters where the states stay.
pub(super) fn backward<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    qp: QpView<'_, T>,
    iterate: &Solution<T, D, M>,
    result: &mut Sensitivities<T>,
) -> Result<(), OcpError> {
    let Sensitivities { nx, nu, np, gains, u_p, problem, work, .. } = result;
    let (nx, nu, np) = (*nx, *nu, *np);
    let size = nx + nu;
    let Work { p, product, m, factors, next, gradient } = Work::split(work, nx, nu, np);
    let mut largest = T::ZERO;
    for stage in qp.stages() {
        for &value in stage.arrays().hessian {
            largest = value.abs().max(largest);
        }
    }
    let active = weight::<T>() * if largest > T::ZERO { largest } else { T::ONE };
    let (vectors, _) = iterate.vectors();
    let ld_stage = crate::qp::pad::<T>(size);
    let n = qp.dims().len().saturating_sub(1);
    for (k, (stage, point)) in qp.stages().zip(iterate.stages()).enumerate().rev() {
        let view = stage.arrays();
        let (here, ld) = (view.n, view.ld);
        // M = H + active bounds + [A B]ᵀ P [A B], its lower triangle, column after column.
        for j in 0..here {
            for i in j..here {
                set(m, j * size + i, get(view.hessian, j * ld + i));
            }
        }
        crate::qp::assign(gradient, problem.gradient(k));
        let v = part(vectors, k * ld_stage, here);
        let (x_bounds, u_bounds) = (stage.x_bounds(), stage.u_bounds());
        for (i, &value) in v.iter().enumerate() {
            let stiff = match i.checked_sub(nx) {
                // The state that is given does not move in this way.
                None if k == 0 => T::ZERO,
                None => both(&x_bounds, i, value, get(point.x_lower, i), get(point.x_upper, i), active),
                Some(i) => both(&u_bounds, i, value, get(point.u_lower, i), get(point.u_upper, i), active),
            };
            add(m, i * size + i, stiff);
        }
        for (row, (&lower, &upper)) in point.g_lower.iter().zip(point.g_upper).enumerate() {
            let c = part(view.matrix, (view.next + row) * ld, here);
            let stiff = both(&stage.g_bounds(), row, dot(c, v), lower, upper, active);
            if stiff == T::ZERO {
                continue;
            }
            for (j, &factor) in c.iter().enumerate() {
                for i in j..here {
                    add(m, j * size + i, stiff * get(c, i) * factor);
                }
            }
            for (&slope, gradient) in problem.slope(k, row).iter().zip(gradient.chunks_exact_mut(size.max(1)))
            {
                axpy(stiff * slope, c, gradient);
            }
        }
        if k < n {
            // P [A B]: P is symmetric, and rows of [A B] lie side by side.
            product.fill(T::ZERO);
            for (i, row) in product.chunks_exact_mut(size).enumerate() {
                for l in 0..nx {
                    axpy(get(p, l * nx + i), part(view.matrix, l * ld, here), row);
                }
            }
            for l in 0..nx {
                let (ab, row) = (part(view.matrix, l * ld, here), part(product, l * size, here));
                for (j, &factor) in row.iter().enumerate() {
                    for i in j..here {
                        add(m, j * size + i, get(ab, i) * factor);
                    }
                }
            }
            // What the end changes, and what follows: [A B]ᵀ (P b + s).
            let ends = problem.end(k).chunks_exact(nx.max(1)).zip(next.chunks_exact(nx.max(1)));
            for ((end, next), gradient) in ends.zip(gradient.chunks_exact_mut(size.max(1))) {
                for (l, (&end, &next)) in end.iter().zip(next).enumerate() {
                    axpy(end, part(product, l * size, here), gradient);
                    axpy(next, part(view.matrix, l * ld, here), gradient);
                }
            }
            factor(m, size, [nx, nu], factors).map_err(|(index, pivot)| {
                OcpError::Qp(crate::qp::QpError::NotConvex { stage: k, index, pivot })
            })?;
            let gain = part_mut(gains, k * nu * nx, nu * nx);
            for (state, gain) in gain.chunks_exact_mut(nu.max(1)).enumerate() {
                solve(factors, part(m, state * size + nx, nu), gain);
            }
            let controls = part_mut(u_p, k * nu * np, nu * np).chunks_exact_mut(nu.max(1));
            for (controls, gradient) in controls.zip(gradient.chunks_exact(size.max(1))) {
                solve(factors, part(gradient, nx, nu), controls);
            }
        }
        let gain = if k < n { part(gains, k * nu * nx, nu * nx) } else { &[] };
        // P = M_xx + M_xu K, and s = q_x + Kᵀ q_u.
        for j in 0..nx {
            let column = part(gain, j * nu, nu);
            for i in j..nx {
                let value = get(m, j * size + i) + dot(part(m, i * size + nx, column.len()), column);
                set(p, j * nx + i, value);
                set(p, i * nx + j, value);
            }
        }
        for (next, gradient) in next.chunks_exact_mut(nx.max(1)).zip(gradient.chunks_exact(size.max(1))) {
            for (j, next) in next.iter_mut().enumerate() {
                let column = part(gain, j * nu, nu);
                *next = get(gradient, j) + dot(part(gradient, nx, column.len()), column);
            }
        }
    }
    Ok(())
}

/// States and controls.
pub(super) fn forward<T: Real>(qp: QpView<'_, T>, result: &mut Sensitivities<T>) {
    let Sensitivities { nx, nu, np, gains, x, u, x_p, u_p, problem, .. } = result;
    let (nx, nu, np) = (*nx, *nu, *np);
    let n = qp.dims().len().saturating_sub(1);
    x.fill(T::ZERO);
    u.fill(T::ZERO);
    x_p.fill(T::ZERO);
    (0..nx).for_each(|i| set(x, i * nx + i, T::ONE));
    for (k, stage) in qp.stages().enumerate().take(n) {
        let view = stage.arrays();
        let gain = part(gains, k * nu * nx, nu * nx);
        for (x, u, columns, end) in
            [(&mut *x, &mut *u, nx, &[][..]), (&mut *x_p, &mut *u_p, np, problem.end(k))]
        {
            let (before, after) = x.split_at_mut_checked((k + 1) * nx * columns).unwrap_or_default();
            for direction in 0..columns {
                let du = part_mut(u, (k * columns + direction) * nu, nu);
                let dx = part(before, (k * columns + direction) * nx, nx);
                for (gain, &dx) in gain.chunks_exact(nu.max(1)).zip(dx) {
                    axpy(dx, gain, du);
                }
                let next = part_mut(after, direction * nx, nx);
                for ((i, next), row) in
                    next.iter_mut().enumerate().zip(view.matrix.chunks_exact(view.ld.max(1)))
                {
                    let moved = dot(part(row, 0, nx), dx) + dot(part(row, nx, nu), du);
                    *next = moved + get(end, direction * nx + i);
                }
            }
        }
    }
}

/// Cholesky's factors without roots of `M_uu`; the pivot that is not positive, if there is one.
fn factor<T: Real>(
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
