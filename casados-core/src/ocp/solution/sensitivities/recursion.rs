//! The Riccati recursion for derivatives of solutions.

use super::active_constraints::ActiveConstraints;
use super::bound_stiffness::BoundStiffness;
use super::factors::SolutionFactors;
use super::kkt_direction::solve_controls;
use crate::linalg::{axpy, dot};
use crate::ocp::formulation::error::OcpError;
use crate::qp::element::{add, get, set};
use crate::qp::{QpError, QpView, Solution, SolutionStage, Stage, StageDims, marked_indices, part, part_mut};
use crate::scalar::Real;

/// Computes `∂V/∂x₀`: the derivative of the Lagrangian with respect to the first state, without the
/// multipliers of its bounds. Periodic states are states of the last stage, too.
pub(super) fn value_gradient<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    qp: QpView<'_, T>,
    iterate: &Solution<T, D, M>,
    result: &mut [T],
) {
    let mut stages = qp.stages().zip(iterate.stages());
    let Some((stage, point)) = stages.next() else { return };
    for (i, slope) in result.iter_mut().enumerate() {
        *slope = lagrangian_derivative(&stage, &point, i);
    }
    let (Some((stage, point)), Some(previous_point)) = (stages.next_back(), iterate.stages().rev().nth(1))
    else {
        return;
    };
    for i in marked_indices(qp.periodic()) {
        let bounds = get(point.x_upper, i) - get(point.x_lower, i);
        add(result, i, lagrangian_derivative(&stage, &point, i) + bounds - get(previous_point.dynamics, i));
    }
}

/// The derivative with respect to a variable of the stage cost, plus its constraints and next state
/// times their multipliers.
fn lagrangian_derivative<T: Real>(stage: &Stage<'_, T>, point: &SolutionStage<'_, T>, i: usize) -> T {
    let view = stage.arrays();
    let v = point.x.iter().chain(point.u);
    let cost_derivative = v.enumerate().fold(get(view.gradient, i), |sum, (j, &v)| {
        sum + get(view.hessian, i.min(j) * view.ld + i.max(j)) * v
    });
    let mu = point.g_upper.iter().zip(point.g_lower).map(|(&upper, &lower)| upper - lower);
    let rows = view.matrix.chunks_exact(view.ld.max(1));
    rows.zip(point.dynamics.iter().copied().chain(mu))
        .fold(cost_derivative, |sum, (row, multiplier)| sum + get(row, i) * multiplier)
}

/// Receives stage and row of an active constraint, its stiffness and its gradient.
pub(in crate::ocp) type ActiveConstraintSink<'a, T> = &'a mut dyn FnMut([usize; 2], T, &[T]);

/// Computes `P_k`, `K_k` and the factors of `M_uu` backward.
///
/// # Errors
/// [`QpError::NotConvex`]
pub(super) fn factorise<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    factors: &mut SolutionFactors<T>,
    qp: QpView<'_, T>,
    iterate: &Solution<T, D, M>,
    stiffness: &mut BoundStiffness<T>,
    on_active: ActiveConstraintSink<'_, T>,
) -> Result<(), OcpError> {
    let [nx, nu, _] = factors.dims;
    let (size, n) = (nx + nu, factors.intervals);
    let mut memory = core::mem::take(&mut factors.work);
    factors.negative_pivots = 0;
    let mut active = core::mem::take(&mut factors.active);
    active.clear();
    let (product, rest) = memory.split_at_mut_checked(nx * size).unwrap_or_default();
    let m = part_mut(rest, 0, size * size);
    let mut result = Ok(());
    for (k, (stage, point)) in qp.stages().zip(iterate.stages()).enumerate().rev() {
        write_stage_hessian(factors, m, [k, size], (&stage, &point), (stiffness, &mut active), on_active);
        if k < n {
            let view = stage.arrays();
            let rows = part_mut(&mut factors.dynamics, k * nx * size, nx * size);
            rows.fill(T::ZERO);
            for (l, row) in rows.chunks_exact_mut(size.max(1)).enumerate().take(view.next) {
                for (j, &value) in part(view.matrix, l * view.ld, view.n).iter().enumerate() {
                    set(row, padded_index(j, point.x.len(), nx), value);
                }
            }
            let next = part(&factors.costs_to_go, (k + 1) * nx * nx, nx * nx);
            let dynamics = part(&factors.dynamics, k * nx * size, nx * size);
            add_cost_to_go(m, product, next, dynamics, [nx, size]);
        }
        factors.bordered_system.extract_shared_control_rows(k, m);
        if k < n {
            let controls = part_mut(&mut factors.control_factors, k * nu * nu, nu * nu);
            let max_negative = factors.bordered_system.condition_count() - factors.negative_pivots;
            match factorise_controls(m, size, [nx, nu], controls, max_negative) {
                Ok(negative) => factors.negative_pivots += negative,
                Err((index, pivot)) => {
                    result = Err(OcpError::Qp(QpError::NotConvex { stage: k, index, pivot }));
                    break;
                }
            }
            let gain = part_mut(&mut factors.gains, k * nu * nx, nu * nx);
            for (state, gain) in gain.chunks_exact_mut(nu.max(1)).enumerate() {
                solve_controls(controls, part(m, state * size + nx, nu), gain);
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
    (factors.work, factors.active) = (memory, active);
    result
}

/// Writes `M = H` plus the stiffness of bounds: the lower triangle, by columns.
fn write_stage_hessian<T: Real>(
    factors: &SolutionFactors<T>,
    m: &mut [T],
    [k, size]: [usize; 2],
    (stage, point): (&Stage<'_, T>, &SolutionStage<'_, T>),
    (stiffness, active): (&mut BoundStiffness<T>, &mut ActiveConstraints<T>),
    on_active: ActiveConstraintSink<'_, T>,
) {
    let view = stage.arrays();
    let (variables, ld, [nx, nu, _]) = (view.n, view.ld, factors.dims);
    let place = |i: usize| padded_index(i, point.x.len(), nx);
    let at = |i: usize, j: usize| place(j) * size + place(i);
    m.fill(T::ZERO);
    for j in 0..variables {
        for i in j..variables {
            set(m, at(i, j), get(view.hessian, j * ld + i));
        }
    }
    if k < factors.intervals {
        // Controls that this stage does not have are zero.
        (nx + point.u.len()..nx + nu).for_each(|i| set(m, i * size + i, T::ONE));
    }
    // A given state is fixed by its equation.
    let is_unknown = |i: usize| k > 0 || factors.bordered_system.is_unknown(i);
    for (i, &x) in point.x.iter().enumerate().filter(|(i, _)| is_unknown(*i)) {
        let multipliers = [get(point.x_lower, i), get(point.x_upper, i)];
        let bounds = stage.x_bounds();
        let spring = stiffness.stiffness_of_bound(&bounds, i, x, multipliers);
        add(m, i * size + i, spring);
        if stiffness.is_active(&bounds, i, spring) {
            active.add_variable(k, i, spring);
        }
    }
    for (i, &u) in point.u.iter().enumerate() {
        let multipliers = [get(point.u_lower, i), get(point.u_upper, i)];
        let place = (nx + i) * (size + 1);
        let bounds = stage.u_bounds();
        let spring = stiffness.stiffness_of_bound(&bounds, i, u, multipliers);
        add(m, place, spring);
        if stiffness.is_active(&bounds, i, spring) {
            active.add_variable(k, nx + i, spring);
        }
    }
    for (row, (&lower, &upper)) in point.g_lower.iter().zip(point.g_upper).enumerate() {
        let c = part(view.matrix, (view.next + row) * ld, variables);
        let (of_x, of_u) = c.split_at_checked(point.x.len()).unwrap_or_default();
        let value = dot(of_x, point.x) + dot(of_u, point.u);
        let row_stiffness = stiffness.stiffness_of_bound(&stage.g_bounds(), row, value, [lower, upper]);
        if row_stiffness == T::ZERO {
            continue;
        }
        for (j, &factor) in c.iter().enumerate() {
            for i in j..variables {
                add(m, at(i, j), row_stiffness * get(c, i) * factor);
            }
        }
        on_active([k, row], row_stiffness, c);
        if stiffness.is_active(&stage.g_bounds(), row, row_stiffness) {
            let elements = c.iter().enumerate().map(|(i, &value)| (place(i), value));
            active.add_row([k, row], row_stiffness, size, elements);
        }
    }
}

/// The index of a variable of a stage with `states` states among `(x, u)` with `nx` states.
pub(in crate::ocp) const fn padded_index(variable: usize, states: usize, nx: usize) -> usize {
    if variable < states { variable } else { nx + variable - states }
}

/// Adds `[A B]ᵀ P [A B]`: `P` is symmetric, and `[A B]` is stored by rows.
fn add_cost_to_go<T: Real>(m: &mut [T], product: &mut [T], p: &[T], dynamics: &[T], [nx, size]: [usize; 2]) {
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

/// Computes the factors `L D Lᵀ` of `M_uu`, and returns the number of negative pivots. The error is
/// a pivot that vanishes, or the first negative one beyond `max_negative`.
fn factorise_controls<T: Real>(
    m: &[T],
    size: usize,
    [nx, nu]: [usize; 2],
    factors: &mut [T],
    max_negative: usize,
) -> Result<usize, (usize, f64)> {
    let at = |i: usize, j: usize| j * nu + i;
    let mut negative = 0;
    for j in 0..nu {
        for i in j..nu {
            set(factors, at(i, j), get(m, (nx + j) * size + nx + i));
        }
    }
    for j in 0..nu {
        let pivot = get(factors, at(j, j));
        negative += usize::from(pivot < T::ZERO);
        let is_allowed = pivot > T::ZERO || (pivot < T::ZERO && negative <= max_negative);
        if !is_allowed {
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
    Ok(negative)
}
