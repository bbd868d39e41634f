//! The conditions of optimality at a point: those of the problem where the QP was written at this point.

use super::linearise::dot;
use crate::linalg::axpy;
use crate::qp::{
    QpView, Residuals, Solution, StageDims, add_symmetric, assign, bound_residuals, part, part_mut,
};
use crate::scalar::Real;

/// The residuals, and penalties of soft bounds. Residuals as in [`qp::residuals`](crate::qp::residuals), which goes element by
/// element and needs no scratch, here with room for a vector over `(x, u)`.
pub(super) fn residuals<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    qp: QpView<'_, T>,
    at: &Solution<T, D, M>,
    scratch: &mut [T],
) -> (Residuals, f64) {
    let mut residuals = Residuals::default();
    let mut penalties = 0.0;
    let mut arriving: &[T] = &[];
    let (all, _) = at.vectors();
    let mut begin = 0;
    let mut stages = at.stages().peekable();
    for stage in qp.stages() {
        let Some(point) = stages.next() else { break };
        let next = stages.peek().map_or(&[][..], |next| next.x);
        let view = stage.arrays();
        let (n, ld) = (view.n, view.ld);
        let v = part(all, begin, ld);
        begin += ld;
        let sum = part_mut(scratch, 0, ld);
        assign(sum, view.gradient);
        add_symmetric(sum, view.hessian, ld, v, n);
        let (v, sum) = (part(v, 0, n), part_mut(sum, 0, n));
        let mut columns = view.matrix.chunks_exact(ld.max(1));
        let dynamics = point.dynamics.iter().zip(view.offset).zip(next);
        for (((&pi, &offset), &x), column) in dynamics.zip(columns.by_ref()) {
            axpy(pi, column, sum);
            grow(&mut residuals.dynamics, dot(column, v) + offset - x);
        }
        for ((&upper, &lower), column) in point.g_upper.iter().zip(point.g_lower).zip(columns) {
            axpy(upper - lower, column, sum);
        }
        for (sum, &pi) in sum.iter_mut().zip(arriving) {
            *sum = *sum - pi;
        }
        let upper = point.x_upper.iter().chain(point.u_upper);
        let lower = point.x_lower.iter().chain(point.u_lower);
        for ((&sum, &upper), &lower) in sum.iter().zip(upper).zip(lower) {
            grow(&mut residuals.stationarity, sum + upper - lower);
        }
        let value = |values: &[T], i: usize| values.get(i).map_or(0.0, |x| x.to_f64());
        let g = |i: usize| dot(part(view.matrix, (view.next + i) * ld, n), v).to_f64();
        let (x, u) = (|i| value(point.x, i), |i| value(point.u, i));
        penalties += bound_residuals(&stage.x_bounds(), x, point.x_lower, point.x_upper, &mut residuals);
        penalties += bound_residuals(&stage.u_bounds(), u, point.u_lower, point.u_upper, &mut residuals);
        penalties += bound_residuals(&stage.g_bounds(), g, point.g_lower, point.g_upper, &mut residuals);
        arriving = point.dynamics;
    }
    (residuals, penalties)
}

/// The larger size; NaN stays.
#[inline(always)]
fn grow<T: Real>(largest: &mut f64, value: T) {
    let size = value.abs().to_f64();
    if size.is_nan() || size > *largest {
        *largest = size;
    }
}
