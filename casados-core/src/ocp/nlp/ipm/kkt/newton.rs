//! Newton's equations of the barrier problem, in the memory of a run.
//!
//! With the QP written at the iterate, one step of the QP's interior point is the Newton step of
//! the nonlinear barrier problem: same slacks, same multipliers, exact Hessians.

use super::dimensions::{KktDimensions, reading_options};
use super::workspace::Workspace;
use crate::ocp::assembly::units::ProblemScaling;
use crate::ocp::nlp::advanced::NewtonOptions;
use crate::qp::interior::{Inequalities, InitialStateKind, Iterate, at};
use crate::qp::{
    QpError, QpField, QpView, Residuals, SolutionView, StageOffsetsIter, Store, copy_common, take_mut,
};
use crate::scalar::{Packed, Real, Registers, Scalar, compiled};

/// Returns the iterate of Newton's method as a view of its memory, whose contents are unchanged.
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
    // Arrays of inequalities have any length: they follow the arrays of whole registers.
    let counts = lengths.counts;
    let length = lengths.number_count.saturating_sub(counts.memory_len() + counts.equations);
    let (mut numbers, mut of_inequalities) = numbers.split_at_mut_checked(length).unwrap_or_default();
    let mut indices = indices.at_least(counts.indices(), QpField::Indices)?;
    let first =
        if lengths.has_fixed_initial_state { InitialStateKind::Fixed } else { InitialStateKind::Free };
    let mut inequalities = Inequalities::new(counts, &mut of_inequalities, &mut indices);
    let ProblemScaling { objective_unit, min_row_unit } = lengths.scaling;
    inequalities.dual_regularisation =
        T::from_f64(Scalar::sqrt(T::EPSILON) * min_row_unit * min_row_unit / objective_unit);
    let mut iterate = Iterate::new(qp, &lengths.extent, first, inequalities, &mut numbers);
    iterate.inequalities.equation_multiplier_steps = take_mut(&mut of_inequalities, counts.equations);
    Ok(iterate)
}

/// Returns the view of [`kkt_view`] for a new QP: lists its inequalities with their bounds and
/// penalties. The dual regularisation of equations is scaled by the `units` of their rows.
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
    iterate.inequalities.list(qp, &reading_options(qp));
    let (equations, min_row_unit) =
        (&*iterate.inequalities.equations, T::from_f64(lengths.scaling.min_row_unit));
    for (stiffness, &row) in iterate.inequalities.stiffness_scale.iter_mut().zip(equations) {
        let ratio = min_row_unit / at(units, row);
        *stiffness = ratio * ratio;
    }
    Ok(iterate)
}

/// Evaluates all residuals at a point with its multipliers `π`. Returns the largest residuals of
/// the problem, and the penalties of violated soft bounds.
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

compiled!(/// See [`EvaluateResiduals`].
EvaluateResidualsCompiled: EvaluateResiduals<'r, 'a, 's, T>);

impl<T: Real> Registers<T> for EvaluateResiduals<'_, '_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let Self { iterate, pi, output: found } = self;
        iterate.evaluate_with_costates::<E>(pi);
        let penalties = iterate.inequalities.violation_cost().to_f64();
        *found = (iterate.point_residuals::<E>().into(), penalties);
    }
}

/// Evaluates the residuals that are linear in the QP at the iterate, after a change of its
/// constants.
pub(in crate::ocp::nlp::ipm) fn evaluate_linear_residuals<T: Real>(iterate: &mut Iterate<'_, T>) {
    T::run_precompiled::<EvaluateLinearResidualsCompiled>(EvaluateLinearResiduals { iterate });
}

struct EvaluateLinearResiduals<'r, 'a, T> {
    iterate: &'r mut Iterate<'a, T>,
}

compiled!(/// See [`EvaluateLinearResiduals`].
EvaluateLinearResidualsCompiled: EvaluateLinearResiduals<'r, 'a, T>);

impl<T: Real> Registers<T> for EvaluateLinearResiduals<'_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        self.iterate.evaluate_values::<E>();
    }
}

/// Factorises, and computes the Newton step towards `s λ = μ`.
///
/// # Errors
/// [`QpError::NotConvex`] if the reduced Hessian, with `δ` on the diagonal, is not positive
/// definite.
pub(in crate::ocp::nlp::ipm) fn newton_step<T: Real>(
    iterate: &mut Iterate<'_, T>,
    mu: T,
    delta: T,
) -> Result<(), QpError> {
    iterate.proximal = delta;
    solve_newton(iterate, mu, false, true)
}

/// Computes the step towards `μ` with the same factors; `corrected` adds the products of the
/// present slack and multiplier steps.
///
/// # Errors
/// The errors of the recursion.
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

compiled!(/// See [`NewtonStep`].
NewtonStepCompiled: NewtonStep<'r, 'a, T>);

impl<T: Real> Registers<T> for NewtonStep<'_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let Self { iterate, mu, corrected, factor, result } = self;
        if corrected {
            iterate.inequalities.corrector_targets(mu);
        } else {
            iterate.inequalities.centring_targets(mu);
        }
        iterate.inequalities.equation_multiplier_steps.fill(T::ZERO);
        *result = iterate.newton::<E>(factor);
    }
}

/// Iterative refinement: removes the dual regularisation of equations from the step, up to a
/// residual of `ε^(2/3)`, with the same factors. Each solve starts from the last multipliers
/// (proximal method of multipliers).
///
/// # Errors
/// The errors of the recursion.
pub(in crate::ocp::nlp::ipm) fn refine_step<T: Real>(
    iterate: &mut Iterate<'_, T>,
    units: &[T],
    options: &NewtonOptions,
) -> Result<(), QpError> {
    let mut last_residual = f64::INFINITY;
    for _ in 0..options.max_refinement_steps {
        let residual = largest_equation_residual(iterate, units, options);
        if !(residual > 0.0 && residual <= options.residual_improvement_factor * last_residual) {
            break;
        }
        last_residual = residual;
        let mut result = Ok(());
        T::run_precompiled::<RefineStepCompiled>(RefineStep { iterate, result: &mut result });
        result?;
    }
    Ok(())
}

/// The residual at which refinement stops, `ε^(2/3)` of the value and unit of an equation.
fn refined_equation_residual<T: Real>(options: &NewtonOptions) -> f64 {
    Scalar::powf(T::EPSILON, options.residual_exponent)
}

/// Returns the residuals that refinement leaves in equations: as a fraction of their values, and as
/// a sum in units. Zero without equations.
pub(in crate::ocp::nlp::ipm) fn equation_residuals_after_step<T: Real>(
    iterate: &Iterate<'_, T>,
    units: &[T],
    options: &NewtonOptions,
) -> (f64, f64) {
    let rows = &*iterate.inequalities.equations;
    let residual = if rows.is_empty() { 0.0 } else { refined_equation_residual::<T>(options) };
    let sizes = rows.iter().map(|&row| 1.0 + (at(iterate.v, row) / at(units, row)).abs().to_f64());
    (residual, residual * sizes.sum::<f64>())
}

/// The largest residual of an equation after the full step, in units; zero if refinement
/// stops.
fn largest_equation_residual<T: Real>(iterate: &Iterate<'_, T>, units: &[T], options: &NewtonOptions) -> f64 {
    let inequalities = &iterate.inequalities;
    let rounding = refined_equation_residual::<T>(options);
    let residuals = inequalities.equations.iter().zip(&*inequalities.equation_residual);
    let remaining_residuals = residuals.map(|(&row, &residual)| {
        let unit = at(units, row).to_f64();
        let residual_after_step = (residual + at(iterate.step, row)).abs().to_f64();
        if residual_after_step <= rounding * (unit + at(iterate.v, row).abs().to_f64()) {
            0.0
        } else {
            residual_after_step / unit
        }
    });
    remaining_residuals.fold(0.0, f64::max)
}

struct RefineStep<'r, 'a, T> {
    iterate: &'r mut Iterate<'a, T>,
    result: &'r mut Result<(), QpError>,
}

compiled!(/// See [`RefineStep`].
RefineStepCompiled: RefineStep<'r, 'a, T>);

impl<T: Real> Registers<T> for RefineStep<'_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let Self { iterate, result } = self;
        *result = iterate.newton::<E>(false);
    }
}

/// Computes the multipliers `π` after the full step into `work.next_costates`. Restores the point
/// and its multipliers bit by bit.
pub(in crate::ocp::nlp::ipm) fn costates_after_step<T: Real>(
    iterate: &mut Iterate<'_, T>,
    work: &mut Workspace<'_, T>,
    delta: T,
) {
    copy_common(work.row_values, iterate.v);
    copy_common(work.trial_slacks, iterate.inequalities.multiplier);
    copy_common(work.saved_equation_multipliers, iterate.inequalities.equation_multipliers);
    iterate.proximal = delta;
    T::run_precompiled::<CostatesAfterStepCompiled>(CostatesAfterStep { iterate, pi: work.next_costates });
    copy_common(iterate.v, work.row_values);
    copy_common(iterate.inequalities.multiplier, work.trial_slacks);
    copy_common(iterate.inequalities.equation_multipliers, work.saved_equation_multipliers);
}

struct CostatesAfterStep<'r, 'a, 's, T> {
    iterate: &'r mut Iterate<'a, T>,
    pi: &'s mut [T],
}

compiled!(/// See [`CostatesAfterStep`].
CostatesAfterStepCompiled: CostatesAfterStep<'r, 'a, 's, T>);

impl<T: Real> Registers<T> for CostatesAfterStep<'_, '_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        self.iterate.step_without_slacks();
        self.iterate.closed_loop_costates::<E>(self.pi);
    }
}

/// Computes least-squares multipliers, which minimise the gradient of the Lagrangian: `π` into
/// `work.next_costates`, those of general constraints into `work.hessian_multipliers`. The
/// multipliers of bounds of variables are given. Solves Newton's equations with a large multiple,
/// `identity`, of the identity as Hessian, and without constraint residuals (Wächter and Biegler,
/// section 3.6).
///
/// # Errors
/// The errors of the recursion.
pub(in crate::ocp::nlp::ipm) fn least_squares_multipliers<T: Real>(
    iterate: &mut Iterate<'_, T>,
    work: &mut Workspace<'_, T>,
    identity: f64,
) -> Result<(), QpError> {
    let identity = T::from_f64(identity);
    copy_common(work.trial_slacks, iterate.inequalities.multiplier);
    set_general_multipliers(iterate, |_| T::ZERO);
    let mut result = Ok(());
    T::run_precompiled::<LeastSquaresMultipliersCompiled>(LeastSquaresMultipliers {
        iterate,
        pi: work.next_costates,
        identity,
        result: &mut result,
    });
    result?;
    let inequalities = &mut iterate.inequalities;
    copy_common(work.hessian_multipliers, inequalities.multiplier_step);
    inequalities.multiplier_step.fill(T::ZERO);
    set_general_multipliers(iterate, |i| work.hessian_multipliers.get(i).copied().unwrap_or(T::ZERO));
    copy_common(work.row_values, iterate.v);
    iterate.proximal = identity;
    T::run_precompiled::<CostatesAfterStepCompiled>(CostatesAfterStep { iterate, pi: work.next_costates });
    copy_common(iterate.v, work.row_values);
    copy_common(iterate.inequalities.multiplier, work.trial_slacks);
    Ok(())
}

/// Sets the multipliers of the inequalities of general constraints.
fn set_general_multipliers<T: Real>(iterate: &mut Iterate<'_, T>, value: impl Fn(usize) -> T) {
    let inequalities = &mut iterate.inequalities;
    let count = inequalities.counts.sides();
    let general = general_constraint_flags::<T>(iterate.qp, inequalities.rows);
    for (i, (multiplier, general)) in inequalities.multiplier.iter_mut().zip(general).enumerate().take(count)
    {
        if general {
            *multiplier = value(i);
        }
    }
}

/// For each row of inequalities (lower bounds, then upper bounds): whether it is a general
/// constraint.
pub(in crate::ocp::nlp::ipm) fn general_constraint_flags<'a, T: Real>(
    qp: QpView<'a, T>,
    rows: &'a [u32],
) -> impl Iterator<Item = bool> + 'a {
    let mut places = StageOffsetsIter::<T>::new(qp.dims).peekable();
    let mut last = 0;
    rows.iter().map(move |&row| {
        let row = row as usize;
        if row < last {
            places = StageOffsetsIter::<T>::new(qp.dims).peekable();
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

compiled!(/// See [`LeastSquaresMultipliers`].
LeastSquaresMultipliersCompiled: LeastSquaresMultipliers<'r, 'a, 's, T>);

impl<T: Real> Registers<T> for LeastSquaresMultipliers<'_, '_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let Self { iterate, pi, identity, result } = self;
        pi.fill(T::ZERO);
        iterate.evaluate_with_costates::<E>(pi);
        iterate.dynamics.fill(T::ZERO);
        iterate.proximal = identity;
        let inequalities = &mut iterate.inequalities;
        inequalities.residual.fill(T::ZERO);
        inequalities.equation_residual.fill(T::ZERO);
        inequalities.equation_multiplier_steps.fill(T::ZERO);
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
