//! Newton's equations of the barrier problem, over the memory of a run.
//!
//! With the QP written at the iterate, one step of the interior point of QPs from there is a step
//! of that of the nonlinear problem: same slacks, same multipliers, exact Hessians.

use super::dimensions::{KktDimensions, reading_options};
use super::workspace::Workspace;
use crate::ocp::assembly::units::ProblemScaling;
use crate::qp::interior::{Inequalities, InitialStateKind, Iterate, at};
use crate::qp::{Places, QpError, QpField, QpView, Residuals, SolutionView, Store, copy_common, take_mut};
use crate::scalar::{Packed, Real, Registers, Scalar, compiled};

/// The iterate of Newton's method in its memory, whose contents stay as they were.
///
/// # Errors
/// [`QpError::OutOfMemory`], [`QpError::Dimension`]
pub(in crate::ocp::nlp::ipm) fn kkt_view<'a, T: Real>(
    qp: QpView<'a, T>,
    lengths: &KktDimensions,
    numbers: &'a mut impl Store<T>,
    indices: &'a mut impl Store<u32>,
) -> Result<Iterate<'a, T>, QpError> {
    let numbers = numbers.at_least(lengths.number_count, QpField::Numbers)?;
    // Those of inequalities are of any length: behind the others, all of which are whole registers.
    let counts = lengths.counts;
    let others = lengths.number_count.saturating_sub(counts.numbers() + counts.equations);
    let (mut numbers, mut inequality_numbers) = numbers.split_at_mut_checked(others).unwrap_or_default();
    let mut indices = indices.at_least(counts.indices(), QpField::Indices)?;
    let first =
        if lengths.has_fixed_initial_state { InitialStateKind::Fixed } else { InitialStateKind::Free };
    let mut inequalities = Inequalities::new(counts, &mut inequality_numbers, &mut indices);
    let ProblemScaling { objective_unit: force, min_row_unit: least } = lengths.scaling;
    inequalities.compliance = T::from_f64(Scalar::sqrt(T::EPSILON) * least * least / force);
    let mut iterate = Iterate::new(qp, &lengths.extent, first, inequalities, &mut numbers);
    iterate.sides.free_step = take_mut(&mut inequality_numbers, counts.equations);
    Ok(iterate)
}

/// As [`kkt_view`], where the QP is new: sides are listed, with its bounds and penalties. What
/// equations give way is measured in `units` of their rows.
///
/// # Errors
/// As [`kkt_view`].
pub(in crate::ocp::nlp::ipm) fn kkt_view_of_new_qp<'a, T: Real>(
    qp: QpView<'a, T>,
    lengths: &KktDimensions,
    numbers: &'a mut impl Store<T>,
    indices: &'a mut impl Store<u32>,
    units: &[T],
) -> Result<Iterate<'a, T>, QpError> {
    let mut iterate = kkt_view(qp, lengths, numbers, indices)?;
    iterate.sides.list(qp, &reading_options(qp));
    let (equations, least) = (&*iterate.sides.equations, T::from_f64(lengths.scaling.min_row_unit));
    for (stiffness, &row) in iterate.sides.stiffness.iter_mut().zip(equations) {
        let ratio = least / at(units, row);
        *stiffness = ratio * ratio;
    }
    Ok(iterate)
}

/// Evaluates all residuals at a point with its multipliers `π`: the largest of those of the
/// problem, and what violations of soft bounds cost.
pub(in crate::ocp::nlp::ipm) fn evaluate_residuals<T: Real>(
    iterate: &mut Iterate<'_, T>,
    at: &mut SolutionView<'_, T>,
) -> (Residuals, f64) {
    iterate.load_point(at);
    iterate.load_initial_state();
    let mut found = Default::default();
    T::run_precompiled::<EvaluateResidualsCompiled>(EvaluateResiduals {
        iterate,
        pi: at.dynamics,
        output: &mut found,
    });
    found
}

struct EvaluateResiduals<'r, 'a, 's, T> {
    iterate: &'r mut Iterate<'a, T>,
    pi: &'s mut [T],
    output: &'s mut (Residuals, f64),
}

compiled!(/// See [`Evaluate`].
EvaluateResidualsCompiled: EvaluateResiduals<'r, 'a, 's, T>);

impl<T: Real> Registers<T> for EvaluateResiduals<'_, '_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let Self { iterate, pi, output: found } = self;
        iterate.evaluate_with_costates::<E>(pi);
        let penalties = iterate.sides.violation_cost().to_f64();
        *found = (iterate.point_residuals::<E>().into(), penalties);
    }
}

/// Residuals of what is linear in the QP at the iterate, after its constants have changed.
pub(in crate::ocp::nlp::ipm) fn evaluate_linear_residuals<T: Real>(iterate: &mut Iterate<'_, T>) {
    T::run_precompiled::<EvaluateLinearResidualsCompiled>(EvaluateLinearResiduals { iterate });
}

struct EvaluateLinearResiduals<'r, 'a, T> {
    iterate: &'r mut Iterate<'a, T>,
}

compiled!(/// See [`EvaluateValues`].
EvaluateLinearResidualsCompiled: EvaluateLinearResiduals<'r, 'a, T>);

impl<T: Real> Registers<T> for EvaluateLinearResiduals<'_, '_, T> {
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
pub(in crate::ocp::nlp::ipm) fn newton_step<T: Real>(
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
    T::run_precompiled::<NewtonStepCompiled>(NewtonStep {
        iterate,
        mu,
        corrected,
        factor,
        result: &mut result,
    });
    result
}

struct NewtonStep<'r, 'a, T> {
    iterate: &'r mut Iterate<'a, T>,
    mu: T,
    corrected: bool,
    factor: bool,
    result: &'r mut Result<(), QpError>,
}

compiled!(/// See [`Step`].
NewtonStepCompiled: NewtonStep<'r, 'a, T>);

impl<T: Real> Registers<T> for NewtonStep<'_, '_, T> {
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
pub(in crate::ocp::nlp::ipm) fn refine_step<T: Real>(
    iterate: &mut Iterate<'_, T>,
    units: &[T],
) -> Result<(), QpError> {
    let mut last_residual = f64::INFINITY;
    for _ in 0..MAX_REFINEMENTS {
        let residual = largest_equation_residual(iterate, units);
        if !(residual > 0.0 && residual <= REFINEMENT_GAIN * last_residual) {
            break;
        }
        last_residual = residual;
        let mut result = Ok(());
        T::run_precompiled::<RefineStepCompiled>(RefineStep { iterate, result: &mut result });
        result?;
    }
    Ok(())
}

/// The largest residual of an equation after the full step, in units; zero if none is more than
/// rounding.
fn largest_equation_residual<T: Real>(iterate: &Iterate<'_, T>, units: &[T]) -> f64 {
    let inequalities = &iterate.sides;
    let rounding = Scalar::powf(T::EPSILON, 2.0 / 3.0);
    let residuals = inequalities.equations.iter().zip(&*inequalities.equation_residual);
    let lacks = residuals.map(|(&row, &residual)| {
        let unit = at(units, row).to_f64();
        let residual_after_step = (residual + at(iterate.step, row)).abs().to_f64();
        if residual_after_step <= rounding * (unit + at(iterate.v, row).abs().to_f64()) {
            0.0
        } else {
            residual_after_step / unit
        }
    });
    lacks.fold(0.0, f64::max)
}

struct RefineStep<'r, 'a, T> {
    iterate: &'r mut Iterate<'a, T>,
    result: &'r mut Result<(), QpError>,
}

compiled!(/// See [`Refine`].
RefineStepCompiled: RefineStep<'r, 'a, T>);

impl<T: Real> Registers<T> for RefineStep<'_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let Self { iterate, result } = self;
        *result = iterate.newton::<E>(false);
    }
}

/// The multipliers `π` after the full step, into `work.pi`. The point and its multipliers are put
/// back bit by bit.
pub(in crate::ocp::nlp::ipm) fn costates_after_step<T: Real>(
    iterate: &mut Iterate<'_, T>,
    work: &mut Workspace<'_, T>,
    delta: T,
) {
    copy_common(work.row_values, iterate.v);
    copy_common(work.trial_slacks, iterate.sides.multiplier);
    copy_common(work.saved_free_step, iterate.sides.free);
    iterate.proximal = delta;
    T::run_precompiled::<CostatesAfterStepCompiled>(CostatesAfterStep { iterate, pi: work.next_costates });
    copy_common(iterate.v, work.row_values);
    copy_common(iterate.sides.multiplier, work.trial_slacks);
    copy_common(iterate.sides.free, work.saved_free_step);
}

struct CostatesAfterStep<'r, 'a, 's, T> {
    iterate: &'r mut Iterate<'a, T>,
    pi: &'s mut [T],
}

compiled!(/// See [`After`].
CostatesAfterStepCompiled: CostatesAfterStep<'r, 'a, 's, T>);

impl<T: Real> Registers<T> for CostatesAfterStep<'_, '_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        self.iterate.step_without_slacks();
        self.iterate.closed_loop_costates::<E>(self.pi);
    }
}

/// The weight of the identity in place of the Hessian in [`least_squares`], in units of forces.
const IDENTITY_HESSIAN_WEIGHT: f64 = 1e8;

/// Multipliers for which the gradient of the Lagrangian is smallest: `π` and those of general
/// constraints, into `work.pi` and `work.hessian_multipliers`; those of bounds of variables are
/// given. These are Newton's equations with a large multiple of the identity for a Hessian, and no
/// residuals of the constraints (Wächter and Biegler, section 3.6).
///
/// # Errors
/// Those of the recursion.
pub(in crate::ocp::nlp::ipm) fn least_squares_multipliers<T: Real>(
    iterate: &mut Iterate<'_, T>,
    work: &mut Workspace<'_, T>,
    objective_unit: f64,
) -> Result<(), QpError> {
    let identity = T::from_f64(IDENTITY_HESSIAN_WEIGHT * objective_unit);
    copy_common(work.trial_slacks, iterate.sides.multiplier);
    set_general_multipliers(iterate, |_| T::ZERO);
    let mut result = Ok(());
    T::run_precompiled::<LeastSquaresMultipliersCompiled>(LeastSquaresMultipliers {
        iterate,
        pi: work.next_costates,
        identity,
        result: &mut result,
    });
    result?;
    let inequalities = &mut iterate.sides;
    copy_common(work.hessian_multipliers, inequalities.multiplier_step);
    inequalities.multiplier_step.fill(T::ZERO);
    set_general_multipliers(iterate, |i| work.hessian_multipliers.get(i).copied().unwrap_or(T::ZERO));
    copy_common(work.row_values, iterate.v);
    iterate.proximal = identity;
    T::run_precompiled::<CostatesAfterStepCompiled>(CostatesAfterStep { iterate, pi: work.next_costates });
    copy_common(iterate.v, work.row_values);
    copy_common(iterate.sides.multiplier, work.trial_slacks);
    Ok(())
}

/// Sets multipliers of sides of general constraints.
fn set_general_multipliers<T: Real>(iterate: &mut Iterate<'_, T>, value: impl Fn(usize) -> T) {
    let inequalities = &mut iterate.sides;
    let count = inequalities.counts.sides();
    let general = general_constraint_flags::<T>(iterate.qp, inequalities.rows);
    for (i, (multiplier, general)) in inequalities.multiplier.iter_mut().zip(general).enumerate().take(count)
    {
        if general {
            *multiplier = value(i);
        }
    }
}

/// Whether rows, first those of lower and then those of upper sides, belong to general constraints.
pub(in crate::ocp::nlp::ipm) fn general_constraint_flags<'a, T: Real>(
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

struct LeastSquaresMultipliers<'r, 'a, 's, T> {
    iterate: &'r mut Iterate<'a, T>,
    pi: &'s mut [T],
    identity: T,
    result: &'r mut Result<(), QpError>,
}

compiled!(/// See [`LeastSquares`].
LeastSquaresMultipliersCompiled: LeastSquaresMultipliers<'r, 'a, 's, T>);

impl<T: Real> Registers<T> for LeastSquaresMultipliers<'_, '_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let Self { iterate, pi, identity, result } = self;
        pi.fill(T::ZERO);
        iterate.evaluate_with_costates::<E>(pi);
        iterate.dynamics.fill(T::ZERO);
        iterate.proximal = identity;
        let inequalities = &mut iterate.sides;
        inequalities.residual.fill(T::ZERO);
        inequalities.equation_residual.fill(T::ZERO);
        inequalities.free_step.fill(T::ZERO);
        inequalities.target.fill(T::ZERO);
        inequalities.inverse.fill(T::ZERO);
        let general = general_constraint_flags::<T>(iterate.qp, inequalities.rows);
        for ((inverse, multiplier), general) in
            inequalities.inverse.iter_mut().zip(&mut *inequalities.multiplier).zip(general)
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
