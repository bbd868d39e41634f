//! Whether data makes sense, and how well a point satisfies the conditions of optimality.
//!
//! Written from the definition of the problem, element by element: independent of every solver.

use super::block::Block;
use super::coupling::{self, is_marked};
use super::error::{Field, QpError};
use super::layout::StageDims;
use super::problem::{Bounds, QpView, Stage};
use super::solution::{Solution, SolutionStage};
use super::statistics::{Residuals, larger, positive};
use crate::scalar::Real;

/// Finds numbers that make no sense.
///
/// # Errors
/// [`QpError::InvalidValue`], [`QpError::CrossedBounds`]
pub fn check<T: Real>(qp: QpView<'_, T>) -> Result<(), QpError> {
    for (k, stage) in qp.stages().enumerate() {
        let blocks = [
            (Field::A, stage.a(), false),
            (Field::B, stage.b(), false),
            (Field::C, stage.c(), false),
            (Field::D, stage.d(), false),
            (Field::Q, stage.q(), true),
            (Field::R, stage.r(), true),
            (Field::S, stage.s(), false),
        ];
        for (field, block, symmetric) in blocks {
            let (rows, columns) = block.shape();
            for column in 0..columns {
                for row in if symmetric { column } else { 0 }..rows {
                    finite(field, k, column * rows + row, element(&block, row, column))?;
                }
            }
        }
        let vectors = [
            (Field::Offset, stage.offset()),
            (Field::GradientX, stage.gradient_x()),
            (Field::GradientU, stage.gradient_u()),
        ];
        for (field, vector) in vectors {
            for (i, &value) in vector.iter().enumerate() {
                finite(field, k, i, value)?;
            }
        }
    }
    check_all_bounds(qp)
}

/// Finds bounds and penalties that make no sense.
pub(super) fn check_all_bounds<T: Real>(qp: QpView<'_, T>) -> Result<(), QpError> {
    for (k, stage) in qp.stages().enumerate() {
        // Only where some make none they are looked for.
        if !make_sense(&stage.all_bounds()) {
            find_bounds(Field::StateBounds, k, &stage.x_bounds())?;
            find_bounds(Field::ControlBounds, k, &stage.u_bounds())?;
            find_bounds(Field::GeneralBounds, k, &stage.g_bounds())?;
        }
    }
    Ok(())
}

fn finite<T: Real>(field: Field, stage: usize, index: usize, value: T) -> Result<(), QpError> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(QpError::InvalidValue { field, stage, index, value: value.to_f64() })
    }
}

/// Whether there are numbers between two bounds.
#[inline(always)]
fn is_range<T: Real>(lower: T, upper: T) -> bool {
    let infinity = T::from_f64(f64::INFINITY);
    (lower <= upper) & (lower < infinity) & (upper > -infinity)
}

/// A linear penalty may be infinite: then the bound is hard.
#[inline(always)]
fn is_linear_penalty<T: Real>(penalty: T) -> bool {
    penalty >= T::ZERO
}

#[inline(always)]
fn is_quadratic_penalty<T: Real>(penalty: T) -> bool {
    (penalty >= T::ZERO) & (penalty < T::from_f64(f64::INFINITY))
}

/// Whether all bounds and penalties make sense, without a branch for each.
fn make_sense<T: Real>(bounds: &Bounds<'_, T>) -> bool {
    let mut good = true;
    for (&lower, &upper) in bounds.lower.iter().zip(bounds.upper) {
        good &= is_range(lower, upper);
    }
    for (&lower, &upper) in bounds.lower_linear.iter().zip(bounds.upper_linear) {
        good &= is_linear_penalty(lower) & is_linear_penalty(upper);
    }
    for (&lower, &upper) in bounds.lower_quadratic.iter().zip(bounds.upper_quadratic) {
        good &= is_quadratic_penalty(lower) & is_quadratic_penalty(upper);
    }
    good
}

/// The first that does not.
fn find_bounds<T: Real>(field: Field, stage: usize, bounds: &Bounds<'_, T>) -> Result<(), QpError> {
    for (index, (&lower, &upper)) in bounds.lower.iter().zip(bounds.upper).enumerate() {
        if is_range(lower, upper) {
            continue;
        }
        let (l, u) = (lower.to_f64(), upper.to_f64());
        return Err(if l.is_nan() || l == f64::INFINITY {
            QpError::InvalidValue { field, stage, index, value: l }
        } else if u.is_nan() || u == f64::NEG_INFINITY {
            QpError::InvalidValue { field, stage, index, value: u }
        } else {
            QpError::CrossedBounds { field, stage, index, lower: l, upper: u }
        });
    }
    let linear =
        [bounds.lower_linear, bounds.upper_linear].map(|all| (all, is_linear_penalty as fn(T) -> bool));
    let quadratic = [bounds.lower_quadratic, bounds.upper_quadratic]
        .map(|all| (all, is_quadratic_penalty as fn(T) -> bool));
    for (penalties, is_penalty) in linear.into_iter().chain(quadratic) {
        if let Some((index, penalty)) =
            penalties.iter().enumerate().find(|(_, penalty)| !is_penalty(**penalty))
        {
            return Err(QpError::InvalidValue {
                field: Field::Penalty,
                stage,
                index,
                value: penalty.to_f64(),
            });
        }
    }
    Ok(())
}

/// How well a point satisfies the conditions of optimality of the QP, and its objective with
/// penalties.
///
/// The variables `e` of soft bounds are eliminated: they are the violations, and the multiplier of
/// a violated soft bound must be `linear + quadratic · e`; of one that is not violated it may be
/// anything from zero to that.
pub fn residuals<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    qp: QpView<'_, T>,
    solution: &Solution<T, D, M>,
) -> (Residuals, f64) {
    let mut result = Residuals::default();
    let mut objective = 0.0;
    // π_k, and x_{k+1}
    let mut arriving: &[T] = &[];
    let mut stages = solution.stages().peekable();
    for (k, data) in qp.stages().enumerate() {
        let Some(point) = stages.next() else { break };
        let next = stages.peek().map_or(&[][..], |next| next.x);
        for i in 0..point.x.len() {
            let (residual, cost) = of_state(&data, &point, arriving, i);
            objective += cost;
            let is_end = k == 0 || k + 1 == qp.dims().len();
            if !(is_end && is_marked(qp.periodic(), i)) {
                largest(&mut result.stationarity, residual);
            }
        }
        for i in 0..point.u.len() {
            let (residual, cost) = of_control(&data, &point, i);
            objective += cost;
            if !is_marked(qp.shared(), i) {
                largest(&mut result.stationarity, residual);
            }
        }
        for (i, &next) in next.iter().enumerate() {
            let mut sum = at(data.offset(), i) - next.to_f64();
            sum += row(&data.a(), i, point.x) + row(&data.b(), i, point.u);
            largest(&mut result.dynamics, sum);
        }
        let x = |i| at(point.x, i);
        let u = |i| at(point.u, i);
        let g = |i| row(&data.c(), i, point.x) + row(&data.d(), i, point.u);
        objective += bounds(&data.x_bounds(), x, point.x_lower, point.x_upper, &mut result);
        objective += bounds(&data.u_bounds(), u, point.u_lower, point.u_upper, &mut result);
        objective += bounds(&data.g_bounds(), g, point.g_lower, point.g_upper, &mut result);
        arriving = point.dynamics;
    }
    coupling::residuals(qp, solution, &mut result);
    (result, objective)
}

pub(super) fn largest(of: &mut f64, value: f64) {
    *of = larger(*of, value.abs());
}
fn at<T: Real>(vector: &[T], index: usize) -> f64 {
    vector.get(index).map_or(0.0, |v| v.to_f64())
}
fn element<T: Real>(block: &Block<'_, T>, row: usize, column: usize) -> T {
    block.get(row, column).unwrap_or(T::ZERO)
}
/// A row times a vector.
fn row<T: Real>(block: &Block<'_, T>, row: usize, x: &[T]) -> f64 {
    x.iter().enumerate().map(|(j, x)| element(block, row, j).to_f64() * x.to_f64()).sum()
}
/// A column times a vector.
fn column<T: Real>(block: &Block<'_, T>, column: usize, y: &[T]) -> f64 {
    y.iter().enumerate().map(|(i, y)| element(block, i, column).to_f64() * y.to_f64()).sum()
}
/// A row of a symmetric matrix, of which the lower triangle is there, times a vector.
fn symmetric<T: Real>(block: &Block<'_, T>, row: usize, x: &[T]) -> f64 {
    let lower = |j: usize| element(block, row.max(j), row.min(j)).to_f64();
    x.iter().enumerate().map(|(j, x)| lower(j) * x.to_f64()).sum()
}

/// The gradient of the Lagrangian in a state, and its part of `½ vᵀ H v + hᵀ v`.
pub(super) fn of_state<T: Real>(
    data: &Stage<'_, T>,
    point: &SolutionStage<'_, T>,
    arriving: &[T],
    i: usize,
) -> (f64, f64) {
    let quadratic = symmetric(&data.q(), i, point.x) + column(&data.s(), i, point.u);
    let linear = at(data.gradient_x(), i);
    let dynamics = column(&data.a(), i, point.dynamics) - at(arriving, i);
    let bounds = at(point.x_upper, i) - at(point.x_lower, i);
    let general = column(&data.c(), i, point.g_upper) - column(&data.c(), i, point.g_lower);
    (quadratic + linear + dynamics + bounds + general, at(point.x, i) * (0.5 * quadratic + linear))
}

/// As [`of_state`], in a control.
pub(super) fn of_control<T: Real>(data: &Stage<'_, T>, point: &SolutionStage<'_, T>, i: usize) -> (f64, f64) {
    let quadratic = symmetric(&data.r(), i, point.u) + row(&data.s(), i, point.x);
    let linear = at(data.gradient_u(), i);
    let dynamics = column(&data.b(), i, point.dynamics);
    let bounds = at(point.u_upper, i) - at(point.u_lower, i);
    let general = column(&data.d(), i, point.g_upper) - column(&data.d(), i, point.g_lower);
    (quadratic + linear + dynamics + bounds + general, at(point.u, i) * (0.5 * quadratic + linear))
}

/// Whether there are neither bounds nor multipliers: nothing can be wrong with either.
#[inline(always)]
fn is_free<T: Real>(bounds: &Bounds<'_, T>, lower: &[T], upper: &[T]) -> bool {
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

/// Adds to the residuals of bounds, and returns the penalties.
pub(crate) fn bounds<T: Real>(
    bounds: &Bounds<'_, T>,
    value: impl Fn(usize) -> f64,
    lower: &[T],
    upper: &[T],
    residuals: &mut Residuals,
) -> f64 {
    let mut penalties = 0.0;
    if is_free(bounds, lower, upper) {
        return penalties;
    }
    for i in 0..lower.len() {
        let value = value(i);
        let hard = at(bounds.lower_linear, i).is_infinite() && at(bounds.upper_linear, i).is_infinite();
        if hard && at(bounds.lower, i) == at(bounds.upper, i) {
            // An equation: its multiplier, the difference of two, has no sign and no slack.
            largest(&mut residuals.inequalities, value - at(bounds.lower, i));
            continue;
        }
        let sides = [
            (
                value - at(bounds.lower, i),
                at(lower, i),
                at(bounds.lower_linear, i),
                at(bounds.lower_quadratic, i),
            ),
            (
                at(bounds.upper, i) - value,
                at(upper, i),
                at(bounds.upper_linear, i),
                at(bounds.upper_quadratic, i),
            ),
        ];
        for (slack, multiplier, linear, quadratic) in sides {
            largest(&mut residuals.inequalities, positive(-multiplier));
            if slack == f64::INFINITY {
                largest(&mut residuals.complementarity, multiplier);
            } else if linear == f64::INFINITY {
                largest(&mut residuals.inequalities, positive(-slack));
                largest(&mut residuals.complementarity, positive(slack) * multiplier);
            } else {
                let violation = positive(-slack);
                let force = linear + quadratic * violation;
                penalties += violation * (linear + 0.5 * quadratic * violation);
                largest(&mut residuals.inequalities, positive(multiplier - force));
                largest(&mut residuals.complementarity, positive(slack) * multiplier);
                largest(&mut residuals.complementarity, violation * positive(force - multiplier));
            }
        }
    }
    penalties
}
