//! Residuals of the optimality conditions at the point where the QP was written: those of the
//! problem.

use crate::qp::{
    Columns, QpView, Residuals, Solution, StageDims, add_transposed, bound_residuals, copy_common, dot,
    is_marked, marked_indices, nan_max, padded_len, part, part_mut, scale, subtract, subtract_column,
    symmetric,
};
use crate::scalar::{Packed, Real, Registers, compiled};

/// Returns the residuals, and the penalties of soft bounds. The residuals are those of
/// [`qp::residuals`](crate::qp::residuals), which computes them by elements and without scratch
/// memory; `scratch` has memory for three vectors over `(x, u)`.
pub(in crate::ocp) fn residuals<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    qp: QpView<'_, T>,
    iterate: &Solution<T, D, M>,
    scratch: &mut [T],
) -> (Residuals, f64) {
    let mut result = Default::default();
    T::run_precompiled::<KktResidualsCompiled>(KktResiduals {
        qp,
        iterate: iterate.borrowed(),
        scratch,
        result: &mut result,
    });
    result
}

/// A point in borrowed memory.
type BorrowedSolution<'a, T> = Solution<T, &'a [StageDims], &'a [T]>;

/// See [`residuals`].
struct KktResiduals<'a, T: Real> {
    qp: QpView<'a, T>,
    iterate: BorrowedSolution<'a, T>,
    scratch: &'a mut [T],
    result: &'a mut (Residuals, f64),
}

compiled! {
    /// See [`residuals`].
    KktResidualsCompiled: KktResiduals<'r, T>
}

impl<T: Real> Registers<T> for KktResiduals<'_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        *self.result = compute_residuals::<T, E>(self.qp, &self.iterate, self.scratch);
    }
}

#[inline(always)]
fn compute_residuals<T: Real, E: Packed<T>>(
    qp: QpView<'_, T>,
    iterate: &BorrowedSolution<'_, T>,
    scratch: &mut [T],
) -> (Residuals, f64) {
    let mut residuals = Residuals::default();
    let mut penalties = 0.0;
    let mut previous_costates: &[T] = &[];
    let (periodic, shared) = (qp.periodic(), qp.shared());
    let last = qp.dims().len().saturating_sub(1);
    let ld = padded_len::<T>(qp.dims().iter().map(|stage| stage.nx + stage.nu).max().unwrap_or(0));
    let (scratch, joint) = scratch.split_at_mut_checked(2 * ld).unwrap_or_default();
    let joint = part_mut(joint, 0, ld);
    joint.fill(T::ZERO);
    let (all, _) = iterate.variables_and_costates();
    let mut stage_start = 0;
    let mut stages = iterate.stages().peekable();
    for (k, stage) in qp.stages().enumerate() {
        let Some(point) = stages.next() else { break };
        let next = stages.peek().map_or(&[][..], |next| next.x);
        let view = stage.arrays();
        // Padding is zero.
        let (n, ld) = (view.n, view.ld);
        let v = part(all, stage_start, ld);
        stage_start += ld;
        let (sum, rest) = scratch.split_at_mut_checked(ld).unwrap_or_default();
        let gap = part_mut(rest, 0, view.next);
        let matrix = Columns { data: view.matrix, ld };
        for ((gap, &offset), &x) in gap.iter_mut().zip(view.offset).zip(next) {
            *gap = offset - x;
        }
        add_transposed::<T, E>(gap, matrix, v, n, view.next);
        for &gap in &*gap {
            update_max(&mut residuals.dynamics, gap);
        }
        // The negative gradient.
        copy_common(sum, view.gradient);
        symmetric::<T, E>(sum, view.hessian, ld, v, n);
        scale::<T, E>(sum, -T::ONE);
        subtract::<T, E>(sum, matrix, point.dynamics, n, view.next);
        let columns = view.matrix.chunks_exact(ld.max(1)).skip(view.next);
        for ((&upper, &lower), column) in point.g_upper.iter().zip(point.g_lower).zip(columns) {
            subtract_column::<T, E>(sum, upper - lower, column);
        }
        for (sum, &pi) in sum.iter_mut().zip(previous_costates) {
            *sum = *sum + pi;
        }
        let upper = point.x_upper.iter().chain(point.u_upper);
        let lower = point.x_lower.iter().chain(point.u_lower);
        let nx = point.x.len();
        for (i, ((&sum, &upper), &lower)) in sum.iter().zip(upper).zip(lower).enumerate() {
            let residual = sum + lower - upper;
            // Coupled variables have the sum of their stationarity residuals.
            let is_coupled = match i.checked_sub(nx) {
                None => (k == 0 || k == last) && is_marked(periodic, i),
                Some(j) => is_marked(shared, j),
            };
            match joint.get_mut(i).filter(|_| is_coupled) {
                None => update_max(&mut residuals.stationarity, residual),
                Some(joint) => *joint = *joint + residual,
            }
        }
        let value = |values: &[T], i: usize| values.get(i).map_or(0.0, |x| x.to_f64());
        let g = |i: usize| dot::<T, E>(part(view.matrix, (view.next + i) * ld, ld), v).to_f64();
        let (x, u) = (|i| value(point.x, i), |i| value(point.u, i));
        penalties += bound_residuals(&stage.x_bounds(), x, point.x_lower, point.x_upper, &mut residuals);
        penalties += bound_residuals(&stage.u_bounds(), u, point.u_lower, point.u_upper, &mut residuals);
        penalties += bound_residuals(&stage.g_bounds(), g, point.g_lower, point.g_upper, &mut residuals);
        previous_costates = point.dynamics;
    }
    if qp.is_coupled() {
        coupled_residuals(qp, iterate, joint, &mut residuals);
    }
    (residuals, penalties)
}

/// Residuals of coupled variables, from the sums of their gradients.
fn coupled_residuals<T: Real>(
    qp: QpView<'_, T>,
    iterate: &BorrowedSolution<'_, T>,
    joint: &[T],
    residuals: &mut Residuals,
) {
    let mut stages = iterate.stages();
    let (Some(first), last) = (stages.next(), stages.next_back()) else { return };
    joint.iter().for_each(|&sum| update_max(&mut residuals.stationarity, sum));
    let get = |values: &[T], i: usize| values.get(i).copied().unwrap_or(T::ZERO);
    for i in marked_indices(qp.periodic()) {
        update_max(&mut residuals.dynamics, get(first.x, i) - last.map_or(T::ZERO, |last| get(last.x, i)));
    }
    for j in marked_indices(qp.shared()) {
        for &u in iterate.stages().filter_map(|stage| stage.u.get(j)) {
            update_max(&mut residuals.dynamics, u - get(first.u, j));
        }
    }
}

/// The larger absolute value; NaN propagates.
#[inline(always)]
pub(in crate::ocp) fn update_max<T: Real>(largest: &mut f64, value: T) {
    *largest = nan_max(*largest, value.abs().to_f64());
}
