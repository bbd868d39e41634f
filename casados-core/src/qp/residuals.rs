//! Residuals of the optimality conditions at a point.
//!
//! They are evaluated by the definition of the problem, element by element, independently of all
//! solvers.

use super::block::Block;
use super::bounds::Bounds;
use super::coupling::{is_marked, marked_indices};
use super::layout::StageDims;
use super::problem::QpView;
use super::solution::{Solution, SolutionStage};
use super::stage::Stage;
use super::statistics::{Residuals, nan_max, positive};
use crate::scalar::Real;

/// Returns the residuals of the optimality conditions of the QP at a point, and its objective with
/// penalties.
///
/// The variables `e` of soft bounds are eliminated: they are the violations. The multiplier of a
/// violated soft bound must be `linear + quadratic · e`, that of a satisfied one is between zero
/// and `linear`.
///
/// ```
/// use casados::qp::{HeapInteriorPoint, HeapQp, HeapSolution, QpSolver, QpStart, StageDims, residuals};
///
/// let mut dims = [StageDims::new(1, 1, 0); 3];
/// dims[2].nu = 0;
/// let mut qp = HeapQp::<f64>::new(&dims)?;
/// for mut stage in qp.stages_mut() {
///     stage.a_mut().set(0, 0, 1.0);
///     stage.b_mut().set(0, 0, 1.0);
///     stage.q_mut().set(0, 0, 1.0);
///     stage.r_mut().set(0, 0, 1.0);
/// }
/// qp.fix_initial_state(&[1.0])?;
/// let mut solution = HeapSolution::new(&dims)?;
/// HeapInteriorPoint::new().solve(qp.view(), QpStart::Cold, solution.view_mut())?;
/// // The objective is ½ P₀ x₀² with P₀ = 1.6.
/// let (residuals, objective) = residuals(qp.view(), &solution);
/// assert!(residuals.stationarity < 1e-7 && residuals.dynamics < 1e-7);
/// assert!((objective - 0.8).abs() < 1e-7);
/// # Ok::<(), casados::qp::QpError>(())
/// ```
pub fn residuals<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    qp: QpView<'_, T>,
    solution: &Solution<T, D, M>,
) -> (Residuals, f64) {
    let mut result = Residuals::default();
    let mut objective = 0.0;
    // `π_k` and `x_{k+1}`
    let mut arriving: &[T] = &[];
    let mut stages = solution.stages().peekable();
    for (k, data) in qp.stages().enumerate() {
        let Some(point) = stages.next() else { break };
        let next = stages.peek().map_or(&[][..], |next| next.x);
        for i in 0..point.x.len() {
            let (residual, cost) = state_gradient_and_cost(&data, &point, arriving, i);
            objective += cost;
            let is_end = k == 0 || k + 1 == qp.dims().len();
            if !(is_end && is_marked(qp.periodic(), i)) {
                update_largest(&mut result.stationarity, residual);
            }
        }
        for i in 0..point.u.len() {
            let (residual, cost) = control_gradient_and_cost(&data, &point, i);
            objective += cost;
            if !is_marked(qp.shared(), i) {
                update_largest(&mut result.stationarity, residual);
            }
        }
        for (i, &next) in next.iter().enumerate() {
            let mut sum = element_as_f64(data.offset(), i) - next.to_f64();
            sum += row(&data.a(), i, point.x) + row(&data.b(), i, point.u);
            update_largest(&mut result.dynamics, sum);
        }
        let x = |i| element_as_f64(point.x, i);
        let u = |i| element_as_f64(point.u, i);
        let g = |i| row(&data.c(), i, point.x) + row(&data.d(), i, point.u);
        objective += bounds(&data.x_bounds(), x, point.x_lower, point.x_upper, &mut result);
        objective += bounds(&data.u_bounds(), u, point.u_lower, point.u_upper, &mut result);
        objective += bounds(&data.g_bounds(), g, point.g_lower, point.g_upper, &mut result);
        arriving = point.dynamics;
    }
    coupling_residuals(qp, solution, &mut result);
    (result, objective)
}

fn update_largest(of: &mut f64, value: f64) {
    *of = nan_max(*of, value.abs());
}
fn element_as_f64<T: Real>(vector: &[T], index: usize) -> f64 {
    vector.get(index).map_or(0.0, |v| v.to_f64())
}
/// Returns a row times a vector.
fn row<T: Real>(block: &Block<'_, T>, row: usize, x: &[T]) -> f64 {
    x.iter().enumerate().map(|(j, x)| element(block, row, j).to_f64() * x.to_f64()).sum()
}
/// Returns a column times a vector.
fn column<T: Real>(block: &Block<'_, T>, column: usize, y: &[T]) -> f64 {
    y.iter().enumerate().map(|(i, y)| element(block, i, column).to_f64() * y.to_f64()).sum()
}
/// Returns a row of a symmetric matrix, stored by its lower triangle, times a vector.
fn symmetric<T: Real>(block: &Block<'_, T>, row: usize, x: &[T]) -> f64 {
    let lower = |j: usize| element(block, row.max(j), row.min(j)).to_f64();
    x.iter().enumerate().map(|(j, x)| lower(j) * x.to_f64()).sum()
}

/// Returns the gradient of the Lagrangian by a state, and the term of the state in
/// `½ vᵀ H v + hᵀ v`.
fn state_gradient_and_cost<T: Real>(
    data: &Stage<'_, T>,
    point: &SolutionStage<'_, T>,
    arriving: &[T],
    i: usize,
) -> (f64, f64) {
    let quadratic = symmetric(&data.q(), i, point.x) + column(&data.s(), i, point.u);
    let linear = element_as_f64(data.gradient_x(), i);
    let dynamics = column(&data.a(), i, point.dynamics) - element_as_f64(arriving, i);
    let bounds = element_as_f64(point.x_upper, i) - element_as_f64(point.x_lower, i);
    let general = column(&data.c(), i, point.g_upper) - column(&data.c(), i, point.g_lower);
    (
        quadratic + linear + dynamics + bounds + general,
        element_as_f64(point.x, i) * (0.5 * quadratic + linear),
    )
}

/// As [`state_gradient_and_cost`], by a control.
fn control_gradient_and_cost<T: Real>(
    data: &Stage<'_, T>,
    point: &SolutionStage<'_, T>,
    i: usize,
) -> (f64, f64) {
    let quadratic = symmetric(&data.r(), i, point.u) + row(&data.s(), i, point.x);
    let linear = element_as_f64(data.gradient_u(), i);
    let dynamics = column(&data.b(), i, point.dynamics);
    let bounds = element_as_f64(point.u_upper, i) - element_as_f64(point.u_lower, i);
    let general = column(&data.d(), i, point.g_upper) - column(&data.d(), i, point.g_lower);
    (
        quadratic + linear + dynamics + bounds + general,
        element_as_f64(point.u, i) * (0.5 * quadratic + linear),
    )
}

/// Returns whether there are neither bounds nor multipliers, so that there is nothing to check.
#[inline(always)]
fn is_unbounded<T: Real>(bounds: &Bounds<'_, T>, lower: &[T], upper: &[T]) -> bool {
    let infinity = T::from_f64(f64::INFINITY);
    let mut free = true;
    for (&lower, &upper) in bounds.lower.iter().zip(bounds.upper) {
        free &= (lower == -infinity) & (upper == infinity);
    }
    for (&lower, &upper) in lower.iter().zip(upper) {
        free &= (lower == T::ZERO) & (upper == T::ZERO);
    }
    free
}

/// Adds the residuals of bounds, and returns the penalties.
pub(crate) fn bounds<T: Real>(
    bounds: &Bounds<'_, T>,
    value: impl Fn(usize) -> f64,
    lower: &[T],
    upper: &[T],
    residuals: &mut Residuals,
) -> f64 {
    let mut penalties = 0.0;
    if is_unbounded(bounds, lower, upper) {
        return penalties;
    }
    for i in 0..lower.len() {
        let value = value(i);
        let hard = element_as_f64(bounds.lower_linear, i).is_infinite()
            && element_as_f64(bounds.upper_linear, i).is_infinite();
        if hard && element_as_f64(bounds.lower, i) == element_as_f64(bounds.upper, i) {
            // An equation: its multiplier, the difference of two, may have either sign.
            update_largest(&mut residuals.inequalities, value - element_as_f64(bounds.lower, i));
            continue;
        }
        let sides = [
            (
                value - element_as_f64(bounds.lower, i),
                element_as_f64(lower, i),
                element_as_f64(bounds.lower_linear, i),
                element_as_f64(bounds.lower_quadratic, i),
            ),
            (
                element_as_f64(bounds.upper, i) - value,
                element_as_f64(upper, i),
                element_as_f64(bounds.upper_linear, i),
                element_as_f64(bounds.upper_quadratic, i),
            ),
        ];
        for (slack, multiplier, linear, quadratic) in sides {
            update_largest(&mut residuals.inequalities, positive(-multiplier));
            if slack == f64::INFINITY {
                update_largest(&mut residuals.complementarity, multiplier);
            } else if linear == f64::INFINITY {
                update_largest(&mut residuals.inequalities, positive(-slack));
                update_largest(&mut residuals.complementarity, positive(slack) * multiplier);
            } else {
                let violation = positive(-slack);
                let force = linear + quadratic * violation;
                penalties += violation * (linear + 0.5 * quadratic * violation);
                update_largest(&mut residuals.inequalities, positive(multiplier - force));
                update_largest(&mut residuals.complementarity, positive(slack) * multiplier);
                update_largest(&mut residuals.complementarity, violation * positive(force - multiplier));
            }
        }
    }
    penalties
}

fn element<T: Real>(block: &Block<'_, T>, row: usize, column: usize) -> T {
    block.get(row, column).unwrap_or(T::ZERO)
}

/// Adds the residuals of coupled variables: sums of gradients, and differences.
fn coupling_residuals<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    qp: QpView<'_, T>,
    solution: &Solution<T, D, M>,
    result: &mut Residuals,
) {
    type Pair<'a, T> = (Stage<'a, T>, SolutionStage<'a, T>);
    let pairs = || qp.stages().zip(solution.stages());
    let (Some(first), Some(last)): (Option<Pair<'_, T>>, _) = (pairs().next(), pairs().next_back()) else {
        return;
    };
    let arriving = solution.stages().rev().nth(1).map_or(&[][..], |before| before.dynamics);
    for i in marked_indices(qp.periodic()) {
        let sum = state_gradient_and_cost(&first.0, &first.1, &[], i).0
            + state_gradient_and_cost(&last.0, &last.1, arriving, i).0;
        update_largest(&mut result.stationarity, sum);
        let at = |x: &[T]| x.get(i).map_or(0.0, |x| x.to_f64());
        update_largest(&mut result.dynamics, at(first.1.x) - at(last.1.x));
    }
    for j in marked_indices(qp.shared()) {
        let at = |u: &[T]| u.get(j).map(|u| u.to_f64());
        let sum: f64 = pairs()
            .filter(|(_, point)| at(point.u).is_some())
            .map(|(data, point)| control_gradient_and_cost(&data, &point, j).0)
            .sum();
        update_largest(&mut result.stationarity, sum);
        let of_first = at(first.1.u).unwrap_or(0.0);
        pairs()
            .filter_map(|(_, point)| at(point.u))
            .for_each(|u| update_largest(&mut result.dynamics, u - of_first));
    }
}
