//! One iteration: residuals and barrier parameter, search direction, line search, step.

use super::barrier;
use super::kkt::measure;
use super::kkt::newton::{dynamics_after, evaluate, kkt_view, kkt_view_of_new_qp, refine, resolve};
use super::kkt::scaling::{Relative, relative};
use super::line_search::{Accepted, FilterModel, LineSearch, SearchOutcome, longest};
use super::predictor::{self, needs_equal_steps};
use super::state::State;

use super::Ipm;
use super::kkt::work::Work;
use super::restoration::elastic;
use crate::ocp::assembly::units::of_tolerance;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::dynamics::StageAction;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::Convexification;
use crate::ocp::formulation::program::curvature::{Curvature, Exact};
use crate::ocp::nlp::filter::{Filter, Measure};
use crate::ocp::nlp::solver::{Method, Next};
use crate::ocp::nlp::watch::Watch;
use crate::ocp::solution::log::Iteration;
use crate::ocp::solution::outcome::Status;
use crate::qp::{QpError, StageDims, Store, nan_max};
use crate::scalar::Real;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;

/// A step lets the violation grow to this multiple of it, but to no more than this multiple of what
/// it was at the start, or of one: an objective that becomes less leads no farther away.
const GROWTH: f64 = 10.0;
/// The Hessian of the Lagrangian as it is.
const EXACT: Exact = Exact { convexification: Convexification::None };

/// A search direction, and how far it may be gone.
struct Direction {
    expected: FilterModel,
    tau: f64,
    primal: f64,
    dual: f64,
    /// It moves nothing but rounding errors.
    tiny: bool,
    /// Whether it has the changes of products.
    is_corrected: bool,
}

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// The QP at the iterate. Where slacks are new, multipliers are too, and the Hessian has these.
    pub(super) fn linearise<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_>,
    ) -> Result<(), OcpError>
    where
        Exact: Curvature<P::Dynamics, T>,
    {
        if !state.has_slacks {
            if !core::mem::take(&mut state.is_linearised) {
                P::slopes(ocp)?;
            }
            if state.lengths.alone {
                ocp.forget_gradients();
            }
            self.begin(ocp, state)?;
        }
        self.curve(ocp, state)?;
        ocp.linearise(EXACT)?;
        if state.lengths.alone {
            ocp.forget_gradients();
        }
        let units = Work::new(ocp.ends(), &state.capacity, self.work.as_mut()).units;
        kkt_view_of_new_qp(ocp.qp.view(), &state.lengths, &mut self.numbers, &mut self.indices, units)?;
        Ok(())
    }

    /// Residuals and barrier parameter at the iterate, and the best iterate.
    fn assess<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_>,
        row: &mut Iteration,
    ) -> Result<(), OcpError> {
        let (plain, [_, of_stages]) = (ocp.objective.to_f64(), ocp.stages.map(|left| left.to_f64()));
        let ends = ocp.ends();
        let (qp, solution) = ocp.qp_and_iterate();
        let mut iterate = kkt_view(qp, &state.lengths, &mut self.numbers, &mut self.indices)?;
        let (mut residuals, penalties) = evaluate(&mut iterate, &mut solution.view_mut());
        let mut view = solution.view_mut();
        iterate.store(&mut view);
        let objective = if state.lengths.alone { plain } else { plain + penalties };
        if P::LIFTED {
            residuals.dynamics = nan_max(residuals.dynamics, of_stages);
        }
        if self.options.final_mu > 0.0 {
            (residuals.inequalities, residuals.complementarity) =
                barrier::residuals(&iterate.sides, self.options.final_mu);
        }
        let work = Work::new(ends, &state.capacity, self.work.as_mut());
        let of_stages = if P::LIFTED { of_stages } else { 0.0 };
        let units = state.lengths.units(work.units);
        state.measure_objective(objective);
        let relative =
            relative(&residuals, &iterate, view.dynamics, (units, state.objective_unit), of_stages);
        state.update_barrier(&iterate, &relative, &self.options);
        let Relative { barrier: (barrier, _), error, others } = relative;
        state.judge(error, others, &self.options);
        state.gaps = barrier.dynamics;
        state.violation = nan_max(state.gaps, barrier.inequalities);
        let is_alone = state.lengths.alone;
        if is_alone {
            state.phase.take(&iterate, view.dynamics, state.gaps, units);
        }
        (row.residuals, row.objective) = (residuals, objective);
        (row.elastic, row.barrier) = (state.elastic.is_some(), state.mu);
        let work = Work::new(ocp.ends(), &state.capacity, self.work.as_mut());
        let worst = elastic::worst(ocp, state, (work.penalties, work.units));
        let size = nan_max(state.error, worst.map_or(0.0, |worst| worst.violation));
        // Bounds are what they were given as, whatever their penalties are.
        let hard = elastic::worst(ocp, state, (work.penalties, &[])).map_or(0.0, |worst| worst.violation);
        row.residuals.inequalities = nan_max(row.residuals.inequalities, hard);
        let is_best = size < state.best_residual || state.best_residual.is_nan();
        if !is_alone && is_best || row.iteration == 0 {
            (state.best_residual, state.best_iteration) = (size, *row);
            state.best_violation = state.violation;
            self.best.copy_from(&ocp.iterate);
            ocp.problem.move_stages(StageAction::Remember);
        }
        let acceptable = !is_alone && size <= self.options.acceptable_tolerance;
        state.acceptable = if acceptable { state.acceptable + 1 } else { 0 };
        Ok(())
    }

    /// Barrier function and violation at the iterate.
    ///
    /// # Errors
    /// [`QpError::OutOfMemory`], [`QpError::Dimension`]
    fn here<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_>,
    ) -> Result<Measure, QpError> {
        let lengths = state.lengths;
        let Self { trial, numbers, indices, work, .. } = self;
        let plain = if lengths.alone { 0.0 } else { ocp.objective.to_f64() };
        let iterate = kkt_view(ocp.qp.view(), &lengths, numbers, indices)?;
        let mut work = Work::new(ocp.ends(), &state.capacity, work.as_mut());
        let mut here = measure::here(&iterate, plain, state.mu, lengths.units(work.units));
        if P::LIFTED {
            // The QP has the ends of intervals where the next step would lead to.
            let mut room = LineSearch { lengths: &lengths, numbers, indices, trial, work: &mut work };
            here = room.measure(ocp, state.mu, 0.0).unwrap_or(here);
        }
        if !state.has_filter {
            state.first_violation = here.violation;
            state.small_violation = 1e-4 * here.violation.max(1.0);
            state.filter = Filter::new(1e4 * here.violation.max(1.0));
            state.has_filter = true;
        }
        Ok(here)
    }

    /// What is to be expected along the search direction, and how far it may be gone.
    ///
    /// # Errors
    /// [`QpError::OutOfMemory`], [`QpError::Dimension`]
    fn along<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &State<'_>,
        here: Measure,
        is_corrected: bool,
    ) -> Result<Direction, QpError> {
        let work = Work::new(ocp.ends(), &state.capacity, self.work.as_mut());
        let iterate = kkt_view(ocp.qp.view(), &state.lengths, &mut self.numbers, &mut self.indices)?;
        let first = state.first_violation.max(1.0);
        let noise = T::from_f64(10.0 * T::EPSILON);
        let sizes = iterate.v.iter().zip(&*work.units).map(|(v, &unit)| T::ONE + (*v / unit).abs());
        let rounding = (noise * sizes.fold(T::ZERO, |sum, size| sum + size)).to_f64();
        let force = state.lengths.sizes.force;
        let (slope, terms) = measure::slope(&iterate, state.mu, work.scratch);
        let expected = FilterModel {
            here,
            slope: slope / force,
            // Of the function and of the point.
            noise: 10.0 * f64::EPSILON * (here.objective.abs() + terms / force),
            small_violation: state.small_violation,
            most: (GROWTH * here.violation.min(first)).max(first),
            mu: state.mu,
            delta: state.delta,
            rounding,
        };
        let tau = barrier::fraction_to_boundary(state.mu / force);
        let (primal, dual) = predictor::lengths(&iterate.sides, tau);
        let mut steps = iterate.step.iter().zip(&*iterate.v).zip(&*work.units);
        let is_tiny = |((&d, &v), &unit): ((&T, &T), &T)| d.abs() <= noise * (unit + v.abs());
        let tiny = here.violation <= 1e-4 && steps.all(is_tiny);
        Ok(Direction { expected, tau, primal, dual, tiny, is_corrected })
    }

    /// How far the search direction is gone. A corrected one is gone as far as it may be, or
    /// not at all: then the direction is that without the correction.
    fn search<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_>,
        direction: &mut Direction,
    ) -> Result<SearchOutcome, OcpError> {
        if direction.tiny {
            return Ok(SearchOutcome::Step(Accepted { alpha: direction.primal, corrected: false }));
        }
        let lengths = state.lengths;
        macro_rules! room {
            ($work:ident) => {{
                let Self { trial, numbers, indices, work, .. } = &mut *self;
                $work = Work::new(ocp.ends(), &state.capacity, work.as_mut());
                LineSearch { lengths: &lengths, numbers, indices, trial, work: &mut $work }
            }};
        }
        let mut work;
        if direction.is_corrected {
            let Direction { expected, primal, .. } = direction;
            if room!(work).accepts(ocp, &mut state.filter, expected, *primal) {
                return Ok(SearchOutcome::Step(Accepted { alpha: *primal, corrected: false }));
            }
            let here = direction.expected.here;
            let mut iterate = kkt_view(ocp.qp.view(), &lengths, &mut self.numbers, &mut self.indices)?;
            resolve(&mut iterate, T::from_f64(state.mu), false)?;
            refine(&mut iterate, Work::new(ocp.ends(), &state.capacity, self.work.as_mut()).units)?;
            *direction = self.along(ocp, state, here, false)?;
            self.expand(ocp, state)?;
        }
        let Direction { expected, primal, tau, .. } = direction;
        room!(work).search(ocp, state, expected, *primal, *tau)
    }

    /// Goes the step that was accepted.
    fn accept<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &State<'_>,
        direction: &Direction,
        accepted: Accepted,
    ) -> Result<(), OcpError> {
        let mut work = Work::new(ocp.ends(), &state.capacity, self.work.as_mut());
        let (qp, mut view) = (ocp.qp.view(), ocp.iterate.view_mut());
        let mut iterate = kkt_view(qp, &state.lengths, &mut self.numbers, &mut self.indices)?;
        iterate.units = &*core::mem::take(&mut work.units);
        let (Accepted { alpha, corrected }, mut dual) = (accepted, direction.dual);
        if corrected {
            dual = longest(iterate.sides.multiplier, iterate.sides.multiplier_step, direction.tau);
        }
        if needs_equal_steps(&iterate.sides) {
            dual = dual.min(alpha);
        }
        dynamics_after(&mut iterate, &mut work, T::from_f64(state.delta));
        let part = T::from_f64(alpha);
        for (pi, &after) in view.dynamics.iter_mut().zip(&*work.pi) {
            *pi = *pi + part * (after - *pi);
        }
        let full = iterate.sides.multiplier.iter().zip(&*iterate.sides.multiplier_step);
        for (of_hessian, (&multiplier, &step)) in work.hessian_multipliers.iter_mut().zip(full) {
            *of_hessian = *of_hessian + part * (multiplier + step - *of_hessian);
        }
        iterate.go(part, T::from_f64(dual));
        barrier::keep_near_centre(&mut iterate.sides, state.mu);
        iterate.store(&mut view);
        ocp.problem.move_stages(StageAction::Go(part));
        // The line search ends where it accepts a point; a tiny step has none.
        ocp.has_algebraic = !direction.tiny;
        Ok(())
    }
}

impl<P, T, D, M, I> Method<P, T, D, M> for Ipm<T, D, M, I>
where
    P: Program<T>,
    Exact: Curvature<P::Dynamics, T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: Store<T>,
    I: Store<u32>,
{
    type State<'c> = State<'c>;

    fn evaluate(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_>,
        row: &mut Iteration,
    ) -> Result<(), OcpError> {
        row.perturbed = state.has_perturbed_start && row.iteration == 0;
        self.linearise(ocp, state)?;
        self.assess(ocp, state, row)
    }

    fn test(&mut self, ocp: &mut Ocp<P, T, D, M>, state: &mut State<'_>, row: &Iteration) -> Next {
        if (state.over)() {
            return Next::End(Status::OutOfTime);
        }
        self.next(ocp, state, row)
    }

    fn step(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_>,
        row: &mut Iteration,
        watch: &mut Watch,
    ) -> Result<Option<Status>, OcpError> {
        if state.is_complementarity_stalled() {
            self.reset_small_slacks(ocp, state)?;
        }
        let direction = self.search_direction(ocp, state, row)?.and_then(|is_corrected| {
            let here = self.here(ocp, state)?;
            self.along(ocp, state, here, is_corrected)
        });
        let mut direction = match direction {
            Ok(direction) => direction,
            Err(error @ QpError::NotConvex { .. }) => {
                // A derivative that is not finite is another error.
                ocp.status_of_error(error)?;
                return Ok(self.recover(ocp, state));
            }
            Err(error) => return ocp.status_of_error(error).map(Some),
        };
        self.expand(ocp, state)?;
        row.times.qp = watch.lap();
        if (state.over)() {
            return Ok(Some(Status::OutOfTime));
        }
        if self.is_unbounded(ocp, state) {
            return Ok(Some(Status::Unbounded));
        }
        let found = self.search(ocp, state, &mut direction)?;
        row.times.search = watch.lap();
        let accepted = match found {
            SearchOutcome::Step(accepted) => accepted,
            SearchOutcome::Nothing => return Ok(self.recover(ocp, state)),
            SearchOutcome::OutOfTime => return Ok(Some(Status::OutOfTime)),
        };
        (row.step, row.corrected) = (accepted.alpha, accepted.corrected);
        state.count_stalled(row.step);
        state.regularisation.gone(row.step / direction.primal);
        self.accept(ocp, state, &direction, accepted)?;
        let least = self.options.tolerance * of_tolerance(state.objective_unit);
        let ends = direction.tiny && state.mu <= least.max(self.options.final_mu);
        Ok(ends.then_some(Status::NoProgress))
    }

    fn restart(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_>,
        end: Option<Status>,
        row: &Iteration,
    ) -> bool {
        let begins = self.try_restart(ocp, state, end);
        if !begins && matches!(end, Some(Status::Infeasible { .. })) {
            // That is said of the last iterate.
            state.best_iteration = *row;
        }
        begins
    }

    #[cfg(feature = "alloc")]
    fn log(&mut self) -> &mut Vec<Iteration> {
        &mut self.log
    }
}
