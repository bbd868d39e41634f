//! Newton's equations of the barrier problem, over the memory of a run.
//!
//! With the QP written at the iterate, one step of the interior point of QPs from there is a step
//! of that of the nonlinear problem: same slacks, same multipliers, exact Hessians.

use super::lengths::{Lengths, reading};
use super::work::Work;
use crate::ocp::assembly::units::Sizes;
use crate::qp::interior::{Inequalities, InitialStateKind, Iterate, at};
use crate::qp::{Places, QpError, QpField, QpView, Residuals, SolutionView, Store, copy_common, take_mut};
use crate::scalar::{Packed, Real, Registers, Scalar, compiled};

/// The iterate of Newton's method in its memory, whose contents stay as they were.
///
/// # Errors
/// [`QpError::OutOfMemory`], [`QpError::Dimension`]
pub(in crate::ocp::nlp::ipm) fn kkt_view<'a, T: Real>(
    qp: QpView<'a, T>,
    lengths: &Lengths,
    numbers: &'a mut impl Store<T>,
    indices: &'a mut impl Store<u32>,
) -> Result<Iterate<'a, T>, QpError> {
    let numbers = numbers.at_least(lengths.numbers, QpField::Numbers)?;
    // Those of sides are of any length: behind the others, all of which are whole registers.
    let counts = lengths.counts;
    let others = lengths.numbers.saturating_sub(counts.numbers() + counts.equations);
    let (mut numbers, mut of_sides) = numbers.split_at_mut_checked(others).unwrap_or_default();
    let mut indices = indices.at_least(counts.indices(), QpField::Indices)?;
    let first = if lengths.fixed { InitialStateKind::Fixed } else { InitialStateKind::Free };
    let mut sides = Inequalities::new(counts, &mut of_sides, &mut indices);
    let Sizes { force, least } = lengths.sizes;
    sides.compliance = T::from_f64(Scalar::sqrt(T::EPSILON) * least * least / force);
    let mut iterate = Iterate::new(qp, &lengths.extent, first, sides, &mut numbers);
    iterate.sides.free_step = take_mut(&mut of_sides, counts.equations);
    Ok(iterate)
}

/// As [`kkt_view`], where the QP is new: sides are listed, with its bounds and penalties. What
/// equations give way is measured in `units` of their rows.
///
/// # Errors
/// As [`kkt_view`].
pub(in crate::ocp::nlp::ipm) fn kkt_view_of_new_qp<'a, T: Real>(
    qp: QpView<'a, T>,
    lengths: &Lengths,
    numbers: &'a mut impl Store<T>,
    indices: &'a mut impl Store<u32>,
    units: &[T],
) -> Result<Iterate<'a, T>, QpError> {
    let mut iterate = kkt_view(qp, lengths, numbers, indices)?;
    iterate.sides.list(qp, &reading(qp));
    let (equations, least) = (&*iterate.sides.equations, T::from_f64(lengths.sizes.least));
    for (stiffness, &row) in iterate.sides.stiffness.iter_mut().zip(equations) {
        let ratio = least / at(units, row);
        *stiffness = ratio * ratio;
    }
    Ok(iterate)
}

/// Evaluates all residuals at a point with its multipliers `π`: the largest of those of the
/// problem, and what violations of soft bounds cost.
pub(in crate::ocp::nlp::ipm) fn evaluate<T: Real>(
    iterate: &mut Iterate<'_, T>,
    at: &mut SolutionView<'_, T>,
) -> (Residuals, f64) {
    iterate.load_point(at);
    iterate.load_initial_state();
    let mut found = Default::default();
    T::compiled::<EvaluateCompiled>(Evaluate { iterate, pi: at.dynamics, found: &mut found });
    found
}

struct Evaluate<'r, 'a, 's, T> {
    iterate: &'r mut Iterate<'a, T>,
    pi: &'s mut [T],
    found: &'s mut (Residuals, f64),
}

compiled!(/// See [`Evaluate`].
EvaluateCompiled: Evaluate<'r, 'a, 's, T>);

impl<T: Real> Registers<T> for Evaluate<'_, '_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let Self { iterate, pi, found } = self;
        iterate.evaluate_with_costates::<E>(pi);
        let penalties = iterate.sides.violation_cost().to_f64();
        *found = (iterate.point_residuals::<E>().into(), penalties);
    }
}

/// Residuals of what is linear in the QP at the iterate, after its constants have changed.
pub(in crate::ocp::nlp::ipm) fn evaluate_values<T: Real>(iterate: &mut Iterate<'_, T>) {
    T::compiled::<EvaluateValuesCompiled>(EvaluateValues { iterate });
}

struct EvaluateValues<'r, 'a, T> {
    iterate: &'r mut Iterate<'a, T>,
}

compiled!(/// See [`EvaluateValues`].
EvaluateValuesCompiled: EvaluateValues<'r, 'a, T>);

impl<T: Real> Registers<T> for EvaluateValues<'_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        self.iterate.evaluate_values::<E>();
    }
}

/// A step towards products of slacks and multipliers that are all `μ`.
///
/// # Errors
/// [`QpError::NotConvex`] where the reduced Hessian, with `δ` on the diagonal, is not positive
/// definite.
pub(in crate::ocp::nlp::ipm) fn step<T: Real>(
    iterate: &mut Iterate<'_, T>,
    mu: T,
    delta: T,
) -> Result<(), QpError> {
    iterate.proximal = delta;
    solve_newton(iterate, mu, false, true)
}

/// The step again with the same factors, towards `μ`; `corrected` for the products of the changes
/// that are there.
///
/// # Errors
/// Those of the recursion.
pub(in crate::ocp::nlp::ipm) fn resolve<T: Real>(
    iterate: &mut Iterate<'_, T>,
    mu: T,
    corrected: bool,
) -> Result<(), QpError> {
    solve_newton(iterate, mu, corrected, false)
}

fn solve_newton<T: Real>(
    iterate: &mut Iterate<'_, T>,
    mu: T,
    corrected: bool,
    factor: bool,
) -> Result<(), QpError> {
    let mut result = Ok(());
    T::compiled::<StepCompiled>(Step { iterate, mu, corrected, factor, result: &mut result });
    result
}

struct Step<'r, 'a, T> {
    iterate: &'r mut Iterate<'a, T>,
    mu: T,
    corrected: bool,
    factor: bool,
    result: &'r mut Result<(), QpError>,
}

compiled!(/// See [`Step`].
StepCompiled: Step<'r, 'a, T>);

impl<T: Real> Registers<T> for Step<'_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let Self { iterate, mu, corrected, factor, result } = self;
        if corrected {
            iterate.sides.corrector_targets(mu);
        } else {
            iterate.sides.centring_targets(mu);
        }
        iterate.sides.free_step.fill(T::ZERO);
        *result = iterate.newton::<E>(factor);
    }
}

/// Solves with the same factors, at most.
const MAX_REFINEMENTS: usize = 3;
/// Another one follows where it leaves this part of what equations lack.
const REFINEMENT_GAIN: f64 = 0.5;

/// What equations give way to their multipliers is taken back: the step is that of the system
/// without dual regularisation, as far as rounding permits, where the same factors are enough for
/// that. Each solve begins at the multipliers of the one before (the proximal method of
/// multipliers).
///
/// # Errors
/// Those of the recursion.
pub(in crate::ocp::nlp::ipm) fn refine<T: Real>(
    iterate: &mut Iterate<'_, T>,
    units: &[T],
) -> Result<(), QpError> {
    let mut last = f64::INFINITY;
    for _ in 0..MAX_REFINEMENTS {
        let left = lack_of_equations(iterate, units);
        if !(left > 0.0 && left <= REFINEMENT_GAIN * last) {
            break;
        }
        last = left;
        let mut result = Ok(());
        T::compiled::<RefineCompiled>(Refine { iterate, result: &mut result });
        result?;
    }
    Ok(())
}

/// The largest residual of an equation after the full step, in units; zero if none is more than
/// rounding.
fn lack_of_equations<T: Real>(iterate: &Iterate<'_, T>, units: &[T]) -> f64 {
    let sides = &iterate.sides;
    let rounding = Scalar::powf(T::EPSILON, 2.0 / 3.0);
    let residuals = sides.equations.iter().zip(&*sides.equation_residual);
    let lacks = residuals.map(|(&row, &residual)| {
        let unit = at(units, row).to_f64();
        let lacks = (residual + at(iterate.step, row)).abs().to_f64();
        if lacks <= rounding * (unit + at(iterate.v, row).abs().to_f64()) { 0.0 } else { lacks / unit }
    });
    lacks.fold(0.0, f64::max)
}

struct Refine<'r, 'a, T> {
    iterate: &'r mut Iterate<'a, T>,
    result: &'r mut Result<(), QpError>,
}

compiled!(/// See [`Refine`].
RefineCompiled: Refine<'r, 'a, T>);

impl<T: Real> Registers<T> for Refine<'_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let Self { iterate, result } = self;
        *result = iterate.newton::<E>(false);
    }
}

/// The multipliers `π` after the full step, into `work.pi`. The point and its multipliers are put
/// back bit by bit.
pub(in crate::ocp::nlp::ipm) fn dynamics_after<T: Real>(
    iterate: &mut Iterate<'_, T>,
    work: &mut Work<'_, T>,
    delta: T,
) {
    copy_common(work.rows, iterate.v);
    copy_common(work.slacks, iterate.sides.multiplier);
    copy_common(work.free_step, iterate.sides.free);
    iterate.proximal = delta;
    T::compiled::<AfterCompiled>(After { iterate, pi: work.pi });
    copy_common(iterate.v, work.rows);
    copy_common(iterate.sides.multiplier, work.slacks);
    copy_common(iterate.sides.free, work.free_step);
}

struct After<'r, 'a, 's, T> {
    iterate: &'r mut Iterate<'a, T>,
    pi: &'s mut [T],
}

compiled!(/// See [`After`].
AfterCompiled: After<'r, 'a, 's, T>);

impl<T: Real> Registers<T> for After<'_, '_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        self.iterate.step_without_slacks();
        self.iterate.closed_loop_costates::<E>(self.pi);
    }
}

/// The weight of the identity in place of the Hessian in [`least_squares`], in units of forces.
const IDENTITY: f64 = 1e8;

/// Multipliers for which the gradient of the Lagrangian is smallest: `π` and those of general
/// constraints, into `work.pi` and `work.hessian_multipliers`; those of bounds of variables are
/// given. These are Newton's equations with a large multiple of the identity for a Hessian, and no
/// residuals of the constraints (Wächter and Biegler, section 3.6).
///
/// # Errors
/// Those of the recursion.
pub(in crate::ocp::nlp::ipm) fn least_squares<T: Real>(
    iterate: &mut Iterate<'_, T>,
    work: &mut Work<'_, T>,
    force: f64,
) -> Result<(), QpError> {
    let identity = T::from_f64(IDENTITY * force);
    copy_common(work.slacks, iterate.sides.multiplier);
    general_multipliers(iterate, |_| T::ZERO);
    let mut result = Ok(());
    T::compiled::<LeastSquaresCompiled>(LeastSquares { iterate, pi: work.pi, identity, result: &mut result });
    result?;
    let sides = &mut iterate.sides;
    copy_common(work.hessian_multipliers, sides.multiplier_step);
    sides.multiplier_step.fill(T::ZERO);
    general_multipliers(iterate, |i| work.hessian_multipliers.get(i).copied().unwrap_or(T::ZERO));
    copy_common(work.rows, iterate.v);
    iterate.proximal = identity;
    T::compiled::<AfterCompiled>(After { iterate, pi: work.pi });
    copy_common(iterate.v, work.rows);
    copy_common(iterate.sides.multiplier, work.slacks);
    Ok(())
}

/// Sets multipliers of sides of general constraints.
fn general_multipliers<T: Real>(iterate: &mut Iterate<'_, T>, value: impl Fn(usize) -> T) {
    let sides = &mut iterate.sides;
    let count = sides.counts.sides();
    let general = is_general::<T>(iterate.qp, sides.rows);
    for (i, (multiplier, general)) in sides.multiplier.iter_mut().zip(general).enumerate().take(count) {
        if general {
            *multiplier = value(i);
        }
    }
}

/// Whether rows, first those of lower and then those of upper sides, belong to general constraints.
pub(in crate::ocp::nlp::ipm) fn is_general<'a, T: Real>(
    qp: QpView<'a, T>,
    rows: &'a [u32],
) -> impl Iterator<Item = bool> + 'a {
    let mut places = Places::<T>::new(qp.dims).peekable();
    let mut last = 0;
    rows.iter().map(move |&row| {
        let row = row as usize;
        if row < last {
            places = Places::<T>::new(qp.dims).peekable();
        }
        last = row;
        while places.next_if(|place| row >= place.row + place.rows).is_some() {}
        places.peek().is_some_and(|place| row >= place.row + place.ld)
    })
}

struct LeastSquares<'r, 'a, 's, T> {
    iterate: &'r mut Iterate<'a, T>,
    pi: &'s mut [T],
    identity: T,
    result: &'r mut Result<(), QpError>,
}

compiled!(/// See [`LeastSquares`].
LeastSquaresCompiled: LeastSquares<'r, 'a, 's, T>);

impl<T: Real> Registers<T> for LeastSquares<'_, '_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let Self { iterate, pi, identity, result } = self;
        pi.fill(T::ZERO);
        iterate.evaluate_with_costates::<E>(pi);
        iterate.dynamics.fill(T::ZERO);
        iterate.proximal = identity;
        let sides = &mut iterate.sides;
        sides.residual.fill(T::ZERO);
        sides.equation_residual.fill(T::ZERO);
        sides.free_step.fill(T::ZERO);
        sides.target.fill(T::ZERO);
        sides.inverse.fill(T::ZERO);
        let general = is_general::<T>(iterate.qp, sides.rows);
        for ((inverse, multiplier), general) in
            sides.inverse.iter_mut().zip(&mut *sides.multiplier).zip(general)
        {
            if general {
                (*inverse, *multiplier) = (T::ONE, identity);
            }
        }
        if let Some(coupling) = &mut iterate.coupling {
            coupling.residual.fill(T::ZERO);
        }
        *result = iterate.newton::<E>(true);
    }
}
