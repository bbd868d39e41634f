//! The iterations.

use super::barrier;
use super::direction::Regularisation;
use super::filter::Filter;
use super::line_search::{Accepted, Expected, Room, longest};
use super::measure;
use super::newton::{Lengths, attach, dynamics_after, evaluate, evaluate_values, least_squares};
use super::start::{begin_sides, push_inside, scratch};
use super::Ipm;
use crate::ocp::convexify::Convexification;
use crate::ocp::dynamics::SecondOrder;
use crate::ocp::error::OcpError;
use crate::ocp::instance::Ocp;
use crate::ocp::linearise::Exact;
use crate::ocp::problem::Formulation;
use crate::ocp::sqp::{Iteration, Outcome, Status, Times, Watch, elastic, failed, infeasible};
use crate::ocp::data::split;
use crate::qp::interior::{Coupling, Sides};
use crate::qp::{StageDims, Store, assign, end, take_mut};
use crate::scalar::Real;
use core::ops::ControlFlow;

/// `κ_Σ`: multipliers stay within this factor of `μ / s`.
const MULTIPLIERS: f64 = 1e10;
/// First multipliers of the dynamics that are larger are discarded.
const LARGEST_MULTIPLIER: f64 = 1e3;
/// Elastic penalties grow to this multiple of the first.
const LARGEST_PENALTY: f64 = 1e4;
/// A violation that larger penalties do not make smaller than this part of it is there to stay.
const STAYS: f64 = 0.9;

/// Memory beside that of Newton's equations.
pub(super) struct Work<'a, T> {
    /// Ends of intervals and constraints at a point that is tried.
    pub ends: &'a mut [T],
    /// Values of rows there.
    pub rows: &'a mut [T],
    /// Slacks there.
    pub slacks: &'a mut [T],
    /// The step before corrections.
    pub step: &'a mut [T],
    pub slack_step: &'a mut [T],
    pub multiplier_step: &'a mut [T],
    /// Multipliers `π` after the full step.
    pub pi: &'a mut [T],
    /// Multipliers of sides as the Hessian has them: they go as far as the point does, while those of
    /// the barrier go as far as they stay positive.
    pub curving: &'a mut [T],
    /// Over the variables of a stage.
    pub scratch: &'a mut [T],
    /// Linear penalties as they were given.
    pub penalties: &'a mut [T],
    /// Conditions between the first and the last state.
    pub coupling: Option<Coupling<'a, T>>,
    /// `δ_w` of the step.
    pub delta: f64,
}

impl<'a, T: Real> Work<'a, T> {
    fn length(dims: &[StageDims], ends: usize, pairs: usize) -> usize {
        Self::before_coupling(dims, ends, pairs)
            + first_nx(dims)
            + Coupling::<T>::memory(dims, first_nx(dims))
    }

    fn before_coupling(dims: &[StageDims], ends: usize, pairs: usize) -> usize {
        let end = end::<T>(dims);
        ends + 2 * end.row + 4 * pairs + end.dynamics + scratch::<T>(dims) + elastic::memory(dims)
    }

    fn new(dims: &[StageDims], ends: usize, pairs: usize, mut memory: &'a mut [T]) -> Self {
        let end = end::<T>(dims);
        let rest = &mut memory;
        Self {
            ends: take_mut(rest, ends),
            rows: take_mut(rest, end.row),
            slacks: take_mut(rest, pairs),
            step: take_mut(rest, end.row),
            slack_step: take_mut(rest, pairs),
            multiplier_step: take_mut(rest, pairs),
            pi: take_mut(rest, end.dynamics),
            curving: take_mut(rest, pairs),
            scratch: take_mut(rest, scratch::<T>(dims)),
            penalties: take_mut(rest, elastic::memory(dims)),
            coupling: {
                let tied = &*take_mut(rest, first_nx(dims));
                let coupled = tied.iter().any(|&tied| tied != T::ZERO);
                coupled.then(|| Coupling::new(dims, tied, rest))
            },
            delta: 0.0,
        }
    }
}

fn first_nx(dims: &[StageDims]) -> usize {
    dims.first().map_or(0, |dims| dims.nx)
}

/// What a run remembers from one iteration to the next.
struct State {
    lengths: Lengths,
    mu: f64,
    filter: Filter,
    theta_min: f64,
    regularisation: Regularisation,
    elastic: Option<f64>,
    /// The violation where the last penalty led to.
    stationary: f64,
    acceptable: usize,
    /// The slacks are there.
    begun: bool,
    best: f64,
    kept: Iteration,
}

impl<T, D, M, I> Ipm<T, D, M, I>
where
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]> + Store<T>,
    I: Store<u32>,
{
    /// Solves a problem, from its iterate on; afterwards this is the best one, whatever the status.
    ///
    /// # Errors
    /// [`OcpError::Missing`]; [`OcpError::Integration`] and [`OcpError::NonFiniteFunction`] where a
    /// function has no value at the start.
    pub fn solve<P: Formulation<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>) -> Result<Outcome, OcpError>
    where
        P::Dynamics: SecondOrder<T>,
    {
        self.solve_observed(ocp, &mut |_| ControlFlow::Continue(()))
    }

    /// As [`Ipm::solve`], with an observer of the iterations that may stop the run.
    ///
    /// # Errors
    /// As [`Ipm::solve`].
    pub fn solve_observed<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        observer: &mut dyn FnMut(&Iteration) -> ControlFlow<()>,
    ) -> Result<Outcome, OcpError>
    where
        P::Dynamics: SecondOrder<T>,
    {
        self.options.check()?;
        // Bounds of constraints are in the QP once it is written.
        ocp.linearise(Exact { convexification: Convexification::None })?;
        let lengths = Lengths::of(ocp.qp());
        let all = lengths.all_soft(ocp.qp());
        let length = Work::<T>::length(ocp.qp().dims, ocp.ends(), all.counts.pairs());
        let numbers = all.numbers;
        self.work.at_least(length, crate::qp::Field::Numbers)?.fill(T::ZERO);
        self.numbers.at_least(numbers, crate::qp::Field::Numbers)?.fill(T::ZERO);
        let push = if self.options.warm_start { self.options.warm_push } else { self.options.bound_push };
        {
            let (qp, iterate) = ocp.qp_and_iterate();
            push_inside(qp, lengths.fixed, push, &mut iterate.view_mut());
        }
        {
            // Which states are tied lies behind the penalties.
            let (dims, ends) = (ocp.qp().dims, ocp.ends());
            let begin = Work::<T>::before_coupling(dims, ends, all.counts.pairs());
            let memory = self.work.as_mut().get_mut(begin..).unwrap_or_default();
            let (tied, _) = ocp.coupling();
            assign(memory, tied);
        }
        ocp.remember_penalties(Self::work(&mut self.work, ocp.qp().dims, ocp.ends(), &all).penalties);
        let mut state = State {
            lengths,
            mu: self.options.start_mu,
            filter: Filter::new(f64::INFINITY),
            theta_min: f64::INFINITY,
            regularisation: Regularisation::default(),
            elastic: None,
            stationary: f64::INFINITY,
            acceptable: 0,
            begun: false,
            best: f64::INFINITY,
            kept: Iteration::default(),
        };
        #[cfg(feature = "alloc")]
        self.log.clear();
        let mut outcome = Outcome {
            status: Status::MaxIterations,
            iterations: 0,
            objective: 0.0,
            residuals: Default::default(),
            qp_iterations: 0,
            times: Times::default(),
        };
        let result = loop {
            let mut row = Iteration { iteration: outcome.iterations, ..Iteration::default() };
            let end = match self.iterate(ocp, &all, &mut state, &mut row) {
                Ok(end) => end,
                Err(error) => break Err(error),
            };
            outcome.qp_iterations += row.qp_iterations;
            outcome.times.linearise += row.times.linearise;
            outcome.times.qp += row.times.qp;
            outcome.times.search += row.times.search;
            #[cfg(feature = "alloc")]
            self.log.push(row);
            if let Some(status) = end {
                outcome.status = status;
                break Ok(());
            }
            if observer(&row).is_break() {
                outcome.status = Status::Stopped;
                break Ok(());
            }
            outcome.iterations += 1;
        };
        ocp.set_penalties(Self::work(&mut self.work, ocp.qp().dims, ocp.ends(), &all).penalties, None);
        if outcome.status != Status::Converged && state.best.is_finite() {
            ocp.iterate.copy_from(&self.best);
        }
        outcome.objective = state.kept.objective;
        outcome.residuals = state.kept.residuals;
        result.map(|()| outcome)
    }

    fn work<'w>(memory: &'w mut M, dims: &[StageDims], ends: usize, all: &Lengths) -> Work<'w, T> {
        Work::new(dims, ends, all.counts.pairs(), memory.as_mut())
    }

    /// One iteration; a status if it is the last one.
    fn iterate<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        all: &Lengths,
        state: &mut State,
        row: &mut Iteration,
    ) -> Result<Option<Status>, OcpError>
    where
        P::Dynamics: SecondOrder<T>,
    {
        let mut watch = Watch::start();
        let exact = Exact { convexification: Convexification::None };
        if state.begun {
            self.curve(ocp, all, state)?;
        }
        ocp.linearise(exact)?;
        if !state.begun {
            self.begin(ocp, all, state)?;
            self.curve(ocp, all, state)?;
            // The Hessian has multipliers in it.
            ocp.linearise(exact)?;
        }
        let Self { options, trial, best, numbers, indices, work, .. } = self;
        let mut work = Self::work(work, ocp.qp().dims, ocp.ends(), all);
        {
            let (qp, solution) = ocp.qp_and_iterate();
            let mut iterate = attach(qp, &state.lengths, numbers, indices)?;
            iterate.store(&mut solution.view_mut());
        }
        let (residuals, objective) = ocp.residuals();
        let here = {
            let objective = ocp.objective.to_f64();
            let (qp, solution) = ocp.qp_and_iterate();
            let mut iterate = attach(qp, &state.lengths, numbers, indices)?;
            evaluate(&mut iterate, &mut solution.view_mut());
            let Sides { slack, multiplier, .. } = &iterate.sides;
            let error = |mu| barrier::error(&residuals, barrier::farthest(slack, multiplier, mu));
            let before = state.mu;
            state.mu = barrier::shrink(state.mu, error, options.tolerance);
            if state.mu != before {
                state.filter.clear();
            }
            let mut here = measure::here(&iterate, objective, state.mu);
            if let Some(coupling) = &mut work.coupling {
                coupling.evaluate(iterate.qp, iterate.v);
                here.theta += coupling.violation();
            }
            here
        };
        (row.residuals, row.objective) = (residuals, objective);
        (row.elastic, row.times.linearise) = (state.elastic.is_some(), watch.lap());
        if row.iteration == 0 {
            state.theta_min = 1e-4 * here.theta.max(1.0);
            state.filter = Filter::new(1e4 * here.theta.max(1.0));
        }
        let worst = state.elastic.and_then(|_| ocp.worst(work.penalties));
        let violation = worst.map_or(0.0, |worst| worst.violation);
        let size = residuals.largest().max(violation);
        if size < state.best || row.iteration == 0 {
            (state.best, state.kept) = (size, *row);
            best.copy_from(&ocp.iterate);
        }
        let tolerance = options.tolerance;
        if residuals.largest() <= tolerance {
            let (Some(penalty), Some(worst)) = (state.elastic, worst.filter(|_| violation > tolerance)) else {
                return Ok(Some(Status::Converged));
            };
            let stays = violation > STAYS * state.stationary;
            if stays || penalty >= LARGEST_PENALTY * options.elastic_penalty {
                return Ok(Some(infeasible(ocp, &worst)));
            }
            state.stationary = violation;
            soften(ocp, state, work.penalties, 10.0 * penalty);
            return Ok(None);
        }
        state.acceptable = if size <= options.acceptable_tolerance { state.acceptable + 1 } else { 0 };
        if state.acceptable >= options.acceptable_iterations.max(1) {
            return Ok(Some(Status::Acceptable));
        }
        if row.iteration >= options.max_iterations {
            return Ok(Some(Status::MaxIterations));
        }

        // The search direction.
        let tau = barrier::fraction_to_boundary(state.mu);
        let (expected, alpha_primal, alpha_dual, tiny) = {
            let intervals = ocp.intervals();
            let theta = &*split::<P, T>(ocp.data.as_mut(), intervals).theta;
            let mut iterate = attach(ocp.qp.view(), &state.lengths, numbers, indices)?;
            match state.regularisation.direction(&mut iterate, &mut work.coupling, T::from_f64(state.mu)) {
                Ok(delta) => (work.delta, row.regularisation) = (delta, delta),
                Err(error) => return Ok(Some(failed(ocp, error))),
            }
            let mut slope = measure::slope(&iterate, state.mu, work.scratch);
            if let Some(coupling) = &work.coupling {
                // The gradients of the QP have these terms of the Lagrangian.
                slope -= coupling.slope(iterate.qp, theta, iterate.step).to_f64();
            }
            let expected = Expected { here, slope, theta_min: state.theta_min, mu: state.mu };
            let sides = &iterate.sides;
            let primal = longest(sides.slack, sides.slack_step, tau);
            let dual = longest(sides.multiplier, sides.multiplier_step, tau);
            // Violations with a quadratic cost tie both lengths: `λ + ν = linear + quadratic e`.
            let tied = sides.quadratic.iter().any(|&q| q > T::ZERO);
            let (primal, dual) = if tied { (primal.min(dual), primal.min(dual)) } else { (primal, dual) };
            let is_tiny = |(&d, &v): (&T, &T)| d.abs().to_f64() <= 10.0 * T::EPSILON * (1.0 + v.abs().to_f64());
            let tiny = here.theta <= 1e-4 && iterate.step.iter().zip(&*iterate.v).all(is_tiny);
            (expected, primal, dual, tiny)
        };
        row.barrier = state.mu;
        row.times.qp = watch.lap();

        // The line search.
        let accepted = if tiny {
            Some(Accepted { alpha: alpha_primal, corrected: false })
        } else {
            let mut room = Room { lengths: &state.lengths, numbers, indices, trial, work: &mut work };
            room.search(ocp, &mut state.filter, &expected, alpha_primal, tau)?
        };
        row.times.search = watch.lap();
        let Some(Accepted { alpha, corrected }) = accepted else {
            if state.elastic.is_some() || !options.elastic {
                return Ok(Some(Status::NoProgress));
            }
            soften(ocp, state, work.penalties, options.elastic_penalty);
            return Ok(None);
        };
        (row.step, row.corrected) = (alpha, corrected);
        let mu = state.mu;
        {
            let intervals = ocp.intervals();
            let theta = split::<P, T>(ocp.data.as_mut(), intervals).theta;
            let (qp, solution) = (ocp.qp.view(), &mut ocp.iterate);
            let mut view = solution.view_mut();
            let mut iterate = attach(qp, &state.lengths, numbers, indices)?;
            let tied = iterate.sides.quadratic.iter().any(|&q| q > T::ZERO);
            let dual = if corrected {
                longest(iterate.sides.multiplier, iterate.sides.multiplier_step, tau)
            } else {
                alpha_dual
            };
            let dual = if tied { dual.min(alpha) } else { dual };
            dynamics_after(&mut iterate, &mut work);
            let part = T::from_f64(alpha);
            if let Some(coupling) = &work.coupling {
                for (theta, &step) in theta.iter_mut().zip(&*coupling.step) {
                    *theta = *theta + part * step;
                }
            }
            for (pi, &after) in view.dynamics.iter_mut().zip(&*work.pi) {
                *pi = *pi + part * (after - *pi);
            }
            let full = iterate.sides.multiplier.iter().zip(&*iterate.sides.multiplier_step);
            for (curving, (&multiplier, &step)) in work.curving.iter_mut().zip(full) {
                *curving = *curving + part * (multiplier + step - *curving);
            }
            iterate.go(part, T::from_f64(dual));
            let sides = &mut iterate.sides;
            for (multiplier, &slack) in sides.multiplier.iter_mut().zip(&*sides.slack).take(sides.counts.sides()) {
                let centre = mu / slack.to_f64();
                let clamped = multiplier.to_f64().clamp(centre / MULTIPLIERS, centre * MULTIPLIERS);
                *multiplier = T::from_f64(clamped);
            }
            iterate.store(&mut view);
        }
        if tiny && state.mu <= tolerance {
            return Ok(Some(Status::NoProgress));
        }
        Ok(None)
    }

    /// Slacks and multipliers of the first iteration, or of new penalties.
    fn begin<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        all: &Lengths,
        state: &mut State,
    ) -> Result<(), OcpError> {
        let warm = self.options.warm_start || state.elastic.is_some();
        let ends = ocp.ends();
        let intervals = ocp.intervals();
        let theta = split::<P, T>(ocp.data.as_mut(), intervals).theta;
        let (qp, solution) = (ocp.qp.view(), &mut ocp.iterate);
        let mut view = solution.view_mut();
        let mut iterate = attach(qp, &state.lengths, &mut self.numbers, &mut self.indices)?;
        let mut work = Self::work(&mut self.work, qp.dims, ends, all);
        iterate.take_point(&view);
        iterate.give_initial_state();
        evaluate_values(&mut iterate);
        begin_sides(&mut iterate, &self.options, warm, T::from_f64(state.mu), &view);
        iterate.store(&mut view);
        if warm {
            assign(work.curving, iterate.sides.multiplier);
        } else if least_squares(&mut iterate, &mut work).is_ok() {
            let is_small = |y: &T| y.abs() <= T::from_f64(LARGEST_MULTIPLIER);
            if work.pi.iter().chain(&*work.curving).all(is_small) {
                assign(view.dynamics, work.pi);
                if let Some(coupling) = &work.coupling {
                    for (theta, &step) in theta.iter_mut().zip(&*coupling.step) {
                        *theta = *theta + step;
                    }
                }
            } else {
                view.dynamics.fill(T::ZERO);
                work.curving.fill(T::ZERO);
            }
        }
        state.begun = true;
        Ok(())
    }

    /// Writes the multipliers that the Hessian has.
    fn curve<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        all: &Lengths,
        state: &State,
    ) -> Result<(), OcpError> {
        let ends = ocp.ends();
        let (qp, solution) = ocp.qp_and_iterate();
        let mut view = solution.view_mut();
        let mut iterate = attach(qp, &state.lengths, &mut self.numbers, &mut self.indices)?;
        let work = Self::work(&mut self.work, qp.dims, ends, all);
        assign(work.slacks, iterate.sides.multiplier);
        assign(iterate.sides.multiplier, work.curving);
        iterate.take_point(&view);
        iterate.store(&mut view);
        assign(iterate.sides.multiplier, work.slacks);
        Ok(())
    }
}

/// Penalties in place of hard bounds; slacks begin anew.
fn soften<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    ocp: &mut Ocp<P, T, D, M>,
    state: &mut State,
    given: &[T],
    penalty: f64,
) {
    ocp.set_penalties(given, Some(T::from_f64(penalty)));
    state.lengths = Lengths::of(ocp.qp());
    state.elastic = Some(penalty);
    state.begun = false;
    state.mu = state.mu.max(1e-2);
    state.filter.clear();
}
