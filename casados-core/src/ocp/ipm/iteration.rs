//! One iteration: residuals and barrier parameter, search direction, line search, step.

use super::barrier::{self, Barrier};
use super::lengths::Lengths;
use super::line_search::{Accepted, Expected, Found, Room, longest};
use super::measure;
use super::newton::{attach, attach_to_new, dynamics_after, evaluate};
use super::state::{MARGIN, State};
use super::work::Work;
use super::{Ipm, IpmOptions, elastic};
use crate::ocp::convexify::Convexification;
use crate::ocp::curvature::Exact;
use crate::ocp::dynamics::{Dynamics, SecondOrder, StageAction};
use crate::ocp::error::OcpError;
use crate::ocp::filter::{Filter, Measure};
use crate::ocp::instance::Ocp;
use crate::ocp::log::{Iteration, Status};
use crate::ocp::problem::Formulation;
use crate::ocp::watch::Watch;
use crate::qp::interior::{Iterate, Sides, set};
use crate::qp::{QpError, Residuals, StageDims, Store};
use crate::scalar::Real;

/// `κ_Σ`: multipliers stay within this factor of `μ / s`.
const MULTIPLIERS: f64 = 1e10;
/// Variables that are larger have no end.
const UNBOUNDED: f64 = 1e12;
/// The Hessian of the Lagrangian as it is.
const EXACT: Exact = Exact { convexification: Convexification::None };

/// What follows the residuals of an iteration.
enum Next {
    /// A search direction.
    Direction,
    /// Another iteration: bounds have other penalties.
    NewPenalties,
    /// The end of the run.
    End(Status),
}

/// A search direction, and how far it may be gone.
struct Direction {
    expected: Expected,
    tau: f64,
    primal: f64,
    dual: f64,
    /// It moves nothing but rounding errors.
    tiny: bool,
}

impl<T, D, M, I> Ipm<T, D, M, I>
where
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]> + Store<T>,
    I: Store<u32>,
{
    /// One iteration; a status if it is the last one.
    pub(super) fn iterate<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        capacity: &Lengths,
        state: &mut State<'_>,
        row: &mut Iteration,
    ) -> Result<Option<Status>, OcpError>
    where
        P::Dynamics: SecondOrder<T>,
    {
        let mut watch = Watch::start();
        self.linearise(ocp, capacity, state)?;
        let here = self.assess(ocp, capacity, state, row)?;
        row.times.linearise = watch.lap();
        if (state.over)() {
            return Ok(Some(Status::OutOfTime));
        }
        match self.next(ocp, capacity, state, row) {
            Next::Direction => {}
            Next::NewPenalties => return Ok(None),
            Next::End(status) => return Ok(Some(status)),
        }
        let direction = match self.direction(ocp, capacity, state, here, row) {
            Ok(direction) => direction,
            Err(error) => return ocp.status_of_error(error).map(Some),
        };
        self.expand(ocp, state)?;
        row.times.qp = watch.lap();
        if (state.over)() {
            return Ok(Some(Status::OutOfTime));
        }
        let Self { options, trial, best, numbers, indices, work, .. } = self;
        let mut work = Work::new(ocp.qp().dims, ocp.ends(), capacity, work.as_mut());
        let accepted = if direction.tiny {
            Some(Accepted { alpha: direction.primal, corrected: false })
        } else {
            let lengths = state.lengths;
            let mut room = Room { lengths: &lengths, numbers, indices, trial, work: &mut work };
            let Direction { expected, primal, tau, .. } = &direction;
            let found = room.search(ocp, state, expected, *primal, *tau)?;
            if matches!(found, Found::OutOfTime) {
                return Ok(Some(Status::OutOfTime));
            }
            found.accepted()
        };
        row.times.search = watch.lap();
        let Some(accepted) = accepted else {
            if state.elastic.is_some() || !options.elastic {
                return Ok(Some(Status::NoProgress));
            }
            // Where no step made progress is no place to begin.
            ocp.recall(best);
            elastic::soften(ocp, state, work.penalties, options.elastic_penalty);
            return Ok(None);
        };
        (row.step, row.corrected) = (accepted.alpha, accepted.corrected);
        self.accept(ocp, capacity, state, &direction, accepted)?;
        let ends = direction.tiny && state.mu <= self.options.tolerance.max(self.options.final_mu);
        Ok(ends.then_some(Status::NoProgress))
    }

    /// The QP at the iterate. Where slacks are new, multipliers are too, and the Hessian has these.
    fn linearise<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        capacity: &Lengths,
        state: &mut State<'_>,
    ) -> Result<(), OcpError>
    where
        P::Dynamics: SecondOrder<T>,
    {
        if !state.has_slacks {
            ocp.linearise(EXACT)?;
            self.begin(ocp, capacity, state)?;
        }
        self.curve(ocp, capacity, state)?;
        ocp.linearise(EXACT)?;
        let (qp, solution) = ocp.qp_and_iterate();
        let mut iterate = attach_to_new(qp, &state.lengths, &mut self.numbers, &mut self.indices)?;
        iterate.take_point(&solution.view_mut());
        iterate.store(&mut solution.view_mut());
        Ok(())
    }

    /// Residuals and barrier parameter at the iterate, barrier function and violation, and the best
    /// iterate.
    fn assess<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        capacity: &Lengths,
        state: &mut State<'_>,
        row: &mut Iteration,
    ) -> Result<Measure, OcpError> {
        let (mut residuals, objective) = ocp.residuals();
        let plain = ocp.objective.to_f64();
        let (qp, solution) = ocp.qp_and_iterate();
        let mut iterate = attach(qp, &state.lengths, &mut self.numbers, &mut self.indices)?;
        evaluate(&mut iterate, &mut solution.view_mut());
        if self.options.final_mu > 0.0 {
            (residuals.inequalities, residuals.complementarity) =
                barrier::residuals(&iterate.sides, self.options.final_mu);
        }
        update_barrier(state, &iterate, &residuals, &self.options);
        let mut here = measure::here(&iterate, plain, state.mu);
        if P::Dynamics::LIFTED {
            // The QP has the ends of intervals where the next step would lead to.
            let lengths = state.lengths;
            let Self { trial, numbers, indices, work, .. } = self;
            let mut work = Work::new(ocp.qp().dims, ocp.ends(), capacity, work.as_mut());
            let mut room = Room { lengths: &lengths, numbers, indices, trial, work: &mut work };
            here = room.measure(ocp, state.mu, 0.0).unwrap_or(here);
        }
        if !state.has_filter {
            state.small_violation = 1e-4 * here.violation.max(1.0);
            state.filter = Filter::new(MARGIN, 1e4 * here.violation.max(1.0));
            state.has_filter = true;
        }
        (row.residuals, row.objective) = (residuals, objective);
        (row.elastic, row.barrier) = (state.elastic.is_some(), state.mu);
        let work = Work::new(ocp.qp().dims, ocp.ends(), capacity, self.work.as_mut());
        let violation = elastic::worst(ocp, state, work.penalties).map_or(0.0, |worst| worst.violation);
        let size = residuals.largest().max(violation);
        if size < state.best_residual || row.iteration == 0 {
            (state.best_residual, state.best_iteration) = (size, *row);
            self.best.copy_from(&ocp.iterate);
            ocp.problem.parts().dynamics.move_stages(StageAction::Remember);
        }
        let acceptable = size <= self.options.acceptable_tolerance;
        state.acceptable = if acceptable { state.acceptable + 1 } else { 0 };
        Ok(here)
    }

    /// What follows the residuals of an iteration.
    fn next<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        capacity: &Lengths,
        state: &mut State<'_>,
        row: &Iteration,
    ) -> Next {
        let work = Work::new(ocp.qp().dims, ocp.ends(), capacity, self.work.as_mut());
        if row.residuals.largest() <= self.options.tolerance {
            let end = elastic::verdict(ocp, state, work.penalties, &self.options);
            return end.map_or(Next::NewPenalties, Next::End);
        }
        if state.acceptable >= self.options.acceptable_iterations.max(1) {
            return Next::End(Status::Acceptable);
        }
        let is_feasible = row.residuals.dynamics.max(row.residuals.inequalities) <= self.options.tolerance;
        let (v, _) = ocp.iterate.vectors();
        if is_feasible && state.elastic.is_none() && v.iter().any(|v| v.abs().to_f64() > UNBOUNDED) {
            return Next::End(Status::Unbounded);
        }
        if row.iteration >= self.options.max_iterations {
            return Next::End(Status::MaxIterations);
        }
        Next::Direction
    }

    /// The search direction.
    ///
    /// # Errors
    /// Those of the recursion, where no regularisation helps.
    fn direction<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        capacity: &Lengths,
        state: &mut State<'_>,
        here: Measure,
        row: &mut Iteration,
    ) -> Result<Direction, QpError> {
        let work = Work::new(ocp.qp().dims, ocp.ends(), capacity, self.work.as_mut());
        let mut iterate = attach(ocp.qp.view(), &state.lengths, &mut self.numbers, &mut self.indices)?;
        let mu = T::from_f64(state.mu);
        state.delta = state.regularisation.direction(&mut iterate, mu)?;
        row.regularisation = state.delta;
        let slope = measure::slope(&iterate, state.mu, work.scratch);
        let expected = Expected {
            here,
            slope,
            small_violation: state.small_violation,
            mu: state.mu,
            delta: state.delta,
        };
        let tau = barrier::fraction_to_boundary(state.mu);
        let sides = &iterate.sides;
        let mut primal = longest(sides.slack, sides.slack_step, tau);
        let mut dual = longest(sides.multiplier, sides.multiplier_step, tau);
        if needs_equal_steps(sides) {
            (primal, dual) = (primal.min(dual), primal.min(dual));
        }
        let is_tiny = |(&d, &v): (&T, &T)| d.abs().to_f64() <= 10.0 * T::EPSILON * (1.0 + v.abs().to_f64());
        let tiny = here.violation <= 1e-4 && iterate.step.iter().zip(&*iterate.v).all(is_tiny);
        Ok(Direction { expected, tau, primal, dual, tiny })
    }

    /// Goes the step that was accepted.
    fn accept<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        capacity: &Lengths,
        state: &State<'_>,
        direction: &Direction,
        accepted: Accepted,
    ) -> Result<(), OcpError> {
        let mut work = Work::new(ocp.qp().dims, ocp.ends(), capacity, self.work.as_mut());
        let (qp, mut view) = (ocp.qp.view(), ocp.iterate.view_mut());
        let mut iterate = attach(qp, &state.lengths, &mut self.numbers, &mut self.indices)?;
        let Accepted { alpha, corrected } = accepted;
        let mut dual = direction.dual;
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
        keep_near_centre(&mut iterate.sides, state.mu);
        iterate.store(&mut view);
        ocp.problem.parts().dynamics.move_stages(StageAction::Go(part));
        // The line search ends where it accepts a point; a tiny step has none.
        ocp.has_algebraic = !direction.tiny;
        Ok(())
    }
}

/// The next barrier parameter; another one has another filter.
fn update_barrier<T: Real>(
    state: &mut State<'_>,
    iterate: &Iterate<'_, T>,
    residuals: &Residuals,
    options: &IpmOptions,
) {
    let Sides { slack, multiplier, .. } = &iterate.sides;
    let error = |mu| barrier::error(residuals, barrier::farthest(slack, multiplier, mu));
    let before = state.mu;
    let tolerance = options.tolerance.max(10.0 * options.final_mu);
    state.mu = match options.barrier {
        Barrier::Monotone => barrier::shrink(before, error, tolerance),
        Barrier::Adaptive => state.progress.next(before, error, [slack, multiplier], tolerance),
    };
    if state.mu != before {
        state.filter.clear();
    }
}

/// Keeps multipliers within a factor of `μ / s`, and the sum of both multipliers of a soft side
/// what its violation costs.
fn keep_near_centre<T: Real>(sides: &mut Sides<'_, T>, mu: f64) {
    let count = sides.counts.sides();
    for (multiplier, &slack) in sides.multiplier.iter_mut().zip(&*sides.slack).take(count) {
        let centre = mu / slack.to_f64();
        let clamped = multiplier.to_f64().clamp(centre / MULTIPLIERS, centre * MULTIPLIERS);
        *multiplier = T::from_f64(clamped);
    }
    let costs = sides.linear.iter().zip(&*sides.quadratic);
    for (j, (&side, (&linear, &quadratic))) in sides.soft.iter().zip(costs).enumerate() {
        let (side, other) = (side as usize, count + j);
        let (Some(&violation), Some(&multiplier)) = (sides.slack.get(other), sides.multiplier.get(side))
        else {
            return;
        };
        let force = linear + quadratic * violation;
        let most = force - T::from_f64(1e-3) * force.min(T::from_f64(mu) / violation);
        let multiplier = multiplier.min(most);
        set(sides.multiplier, side, multiplier);
        set(sides.multiplier, other, force - multiplier);
    }
}

/// Violations with a quadratic cost tie the lengths of both steps: `λ + ν = linear + quadratic e`.
fn needs_equal_steps<T: Real>(sides: &Sides<'_, T>) -> bool {
    sides.quadratic.iter().any(|&quadratic| quadratic > T::ZERO)
}
