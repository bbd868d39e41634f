//! The conditions of optimality at a point: those of the problem where the QP was written at this
//! point.

use crate::qp::{
    Columns, QpView, Residuals, Solution, StageDims, add_transposed, assign, bound_residuals, dot, larger,
    part, part_mut, scale, subtract, subtract_column, symmetric,
};
use crate::scalar::{Packed, Real, Registers};

/// The residuals, and penalties of soft bounds. Residuals as in
/// [`qp::residuals`](crate::qp::residuals), which goes element by element and needs no scratch,
/// here with room for two vectors over `(x, u)`.
pub(super) fn residuals<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    qp: QpView<'_, T>,
    at: &Solution<T, D, M>,
    scratch: &mut [T],
) -> (Residuals, f64) {
    let mut result = Default::default();
    T::registers(Kkt { qp, at, scratch, result: &mut result });
    result
}

/// See [`residuals`].
struct Kkt<'a, T, D, M> {
    qp: QpView<'a, T>,
    at: &'a Solution<T, D, M>,
    scratch: &'a mut [T],
    result: &'a mut (Residuals, f64),
}

impl<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Registers<T> for Kkt<'_, T, D, M> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        *self.result = conditions::<T, E, D, M>(self.qp, self.at, self.scratch);
    }
}

#[inline(always)]
fn conditions<T: Real, E: Packed<T>, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
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
        // What is padding is zero.
        let (n, ld) = (view.n, view.ld);
        let v = part(all, begin, ld);
        begin += ld;
        let (sum, rest) = scratch.split_at_mut_checked(ld).unwrap_or_default();
        let gap = part_mut(rest, 0, view.next);
        let matrix = Columns { data: view.matrix, ld };
        for ((gap, &offset), &x) in gap.iter_mut().zip(view.offset).zip(next) {
            *gap = offset - x;
        }
        add_transposed::<T, E>(gap, matrix, v, n, view.next);
        for &gap in &*gap {
            grow(&mut residuals.dynamics, gap);
        }
        // The gradient with another sign.
        assign(sum, view.gradient);
        symmetric::<T, E>(sum, view.hessian, ld, v, n);
        scale::<T, E>(sum, -T::ONE);
        subtract::<T, E>(sum, matrix, point.dynamics, n, view.next);
        let columns = view.matrix.chunks_exact(ld.max(1)).skip(view.next);
        for ((&upper, &lower), column) in point.g_upper.iter().zip(point.g_lower).zip(columns) {
            subtract_column::<T, E>(sum, upper - lower, column);
        }
        for (sum, &pi) in sum.iter_mut().zip(arriving) {
            *sum = *sum + pi;
        }
        let upper = point.x_upper.iter().chain(point.u_upper);
        let lower = point.x_lower.iter().chain(point.u_lower);
        for ((&sum, &upper), &lower) in sum.iter().zip(upper).zip(lower) {
            grow(&mut residuals.stationarity, sum + lower - upper);
        }
        let value = |values: &[T], i: usize| values.get(i).map_or(0.0, |x| x.to_f64());
        let g = |i: usize| dot::<T, E>(part(view.matrix, (view.next + i) * ld, ld), v).to_f64();
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
pub(super) fn grow<T: Real>(largest: &mut f64, value: T) {
    *largest = larger(*largest, value.abs().to_f64());
}
