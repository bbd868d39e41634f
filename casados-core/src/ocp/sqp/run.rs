//! The iterations.

use super::elastic::Worst;
use super::log::{Iteration, Outcome, Status, Times, Watch};
use super::options::Globalisation;
use super::search::{Measure, Search};
use super::{Sqp, fits};
use crate::ocp::error::OcpError;
use crate::ocp::instance::Ocp;
use crate::ocp::linearise::Curvature;
use crate::ocp::problem::Formulation;
use crate::qp::{QpError, QpSolver, Solution, StageDims, Start, Statistics};
use crate::scalar::Real;
use core::ops::ControlFlow;

/// Elastic penalties grow to this multiple of the first.
const LARGEST_PENALTY: f64 = 1e4;
/// A violation that larger penalties do not make smaller than this part of it is there to stay.
const STAYS: f64 = 0.9;

/// What a run remembers from one iteration to the next.
struct State<T> {
    search: Search,
    /// The penalty of elastic mode, if it is on.
    elastic: Option<T>,
    /// The violation where the last penalty led to.
    stationary: f64,
    /// Whether penalties were remembered.
    remembered: bool,
    /// The largest residual of the best iterate.
    best: f64,
    /// That iterate.
    kept: Iteration,
}

/// What a step was.
struct Taken {
    length: f64,
    corrected: bool,
}

impl<S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Sqp<S, C, T, D, M> {
    /// Solves a problem, from its iterate on; afterwards this is the best one, whatever the status.
    ///
    /// # Errors
    /// [`OcpError::Missing`]; [`OcpError::Integration`] and [`OcpError::NonFiniteFunction`] where full steps went to a point at
    /// which something has no value: then the iterate is the best one, too.
    pub fn solve<P: Formulation<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>) -> Result<Outcome, OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        self.solve_observed(ocp, &mut |_| ControlFlow::Continue(()))
    }

    /// As [`Sqp::solve`], with an observer of the iterations that may stop the run.
    ///
    /// # Errors
    /// As [`Sqp::solve`].
    pub fn solve_observed<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        observer: &mut dyn FnMut(&Iteration) -> ControlFlow<()>,
    ) -> Result<Outcome, OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        fits(ocp, self.solution.dims())?;
        ocp.is_uncoupled()?;
        let mut state = State {
            search: Search::new(),
            elastic: None,
            stationary: f64::INFINITY,
            remembered: false,
            best: f64::INFINITY,
            kept: Iteration::default(),
        };
        #[cfg(feature = "alloc")]
        {
            self.log.clear();
            let length = self.options.max_iterations.saturating_add(1);
            let bytes = length.saturating_mul(size_of::<Iteration>());
            self.log.try_reserve(length).map_err(|_| OcpError::OutOfMemory { bytes })?;
        }
        let mut outcome = Outcome {
            status: Status::MaxIterations,
            iterations: 0,
            objective: 0.0,
            residuals: Default::default(),
            qp_iterations: 0,
            times: Times::default(),
        };
        let mut result = Ok(());
        loop {
            let mut row = Iteration { iteration: outcome.iterations, ..Iteration::default() };
            let end = match self.iterate(ocp, &mut state, &mut row) {
                Ok(end) => end,
                Err(error) => {
                    result = Err(error);
                    break;
                }
            };
            outcome.qp_iterations += row.qp_iterations;
            outcome.times.linearise += row.times.linearise;
            outcome.times.qp += row.times.qp;
            outcome.times.search += row.times.search;
            #[cfg(feature = "alloc")]
            self.log.push(row);
            if let Some(status) = end {
                outcome.status = status;
                break;
            }
            if observer(&row).is_break() {
                outcome.status = Status::Stopped;
                break;
            }
            outcome.iterations += 1;
        }
        if state.remembered {
            ocp.set_penalties(self.penalties(ocp), None);
        }
        if outcome.status != Status::Converged && state.best.is_finite() {
            ocp.iterate.copy_from(&self.best);
        }
        outcome.objective = state.kept.objective;
        outcome.residuals = state.kept.residuals;
        result.map(|()| outcome)
    }

    /// One iteration; a status if it is the last one.
    fn iterate<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<T>,
        row: &mut Iteration,
    ) -> Result<Option<Status>, OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        let mut watch = Watch::start();
        ocp.linearise(self.curvature)?;
        let (residuals, objective) = ocp.residuals();
        (row.residuals, row.objective) = (residuals, objective);
        row.elastic = state.elastic.is_some();
        row.times.linearise = watch.lap();
        // In elastic mode, what is violated counts.
        let worst = state.elastic.and_then(|_| ocp.worst(self.penalties(ocp)));
        let violation = worst.map_or(0.0, |worst| worst.violation);
        let size = residuals.largest().max(violation);
        if size < state.best || row.iteration == 0 {
            (state.best, state.kept) = (size, *row);
            self.best.copy_from(&ocp.iterate);
        }
        let tolerance = self.options.tolerance;
        if residuals.largest() <= tolerance {
            match (state.elastic, worst) {
                (Some(penalty), Some(worst)) if violation > tolerance => {
                    // Stationary, and not feasible: only larger penalties can help.
                    let penalty = penalty.to_f64();
                    let stays = violation > STAYS * state.stationary;
                    if stays || penalty >= LARGEST_PENALTY * self.options.elastic_penalty {
                        return Ok(Some(infeasible(ocp, &worst)));
                    }
                    state.stationary = violation;
                    self.set_elastic(ocp, state, 10.0 * penalty);
                }
                _ => return Ok(Some(Status::Converged)),
            }
        }
        if row.iteration >= self.options.max_iterations {
            return Ok(Some(match worst {
                Some(worst) if violation > tolerance => infeasible(ocp, &worst),
                _ => Status::MaxIterations,
            }));
        }
        let start = if self.options.warm_start && row.iteration > 0 { Start::Warm } else { Start::Cold };
        self.qp_solver.relax(self.options.qp_accuracy * residuals.largest());
        let solved = self.solve_qp(ocp, state, start, row);
        row.times.qp = watch.lap();
        if let Err(error) = solved {
            return Ok(Some(match worst {
                // With penalties there is nothing that a QP could not satisfy: it is their size.
                Some(worst) if violation > tolerance => infeasible(ocp, &worst),
                _ => failed(ocp, error),
            }));
        }
        if state.elastic.is_some() {
            row.elastic = true;
        }
        let taken = if self.options.globalisation == Globalisation::FullStep {
            core::mem::swap(&mut ocp.iterate, &mut self.solution);
            Some(Taken { length: 1.0, corrected: false })
        } else {
            self.search(ocp, state, row)?
        };
        row.times.search = watch.lap();
        let Some(taken) = taken else { return Ok(Some(Status::NoProgress)) };
        (row.step, row.corrected) = (taken.length, taken.corrected);
        Ok(None)
    }

    fn penalties<'s, P: Formulation<T>>(&'s self, ocp: &Ocp<P, T, D, M>) -> &'s [T] {
        self.work.as_ref().get(ocp.ends()..).unwrap_or_default()
    }

    /// Penalties in place of hard bounds.
    fn set_elastic<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<T>,
        penalty: f64,
    ) {
        let ends = ocp.ends();
        let memory = self.work.as_mut().get_mut(ends..).unwrap_or_default();
        if !state.remembered {
            ocp.remember_penalties(memory);
            state.remembered = true;
        }
        let penalty = T::from_f64(penalty);
        ocp.set_penalties(memory, Some(penalty));
        // Objectives with other penalties are not to be compared.
        (state.elastic, state.search) = (Some(penalty), Search::new());
    }

    /// The QP at the iterate; in elastic mode if it has no solution otherwise.
    fn solve_qp<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<T>,
        start: Start,
        row: &mut Iteration,
    ) -> Result<(), QpError> {
        let Self { solution, qp_solver, .. } = self;
        solution.copy_from(&ocp.iterate);
        let result = qp_solver.solve(ocp.qp(), start, solution.view_mut());
        let count = |result: &Result<Statistics, QpError>| match result {
            Ok(statistics) => statistics.iterations,
            Err(QpError::MaxIterations { iterations, .. } | QpError::Stalled { iterations, .. }) => {
                *iterations
            }
            Err(_) => 0,
        };
        row.qp_iterations += count(&result);
        let error = match result {
            Ok(_) => {
                // Where nothing is violated any more, bounds are hard again.
                if state.elastic.is_some() {
                    self.leave_elastic(ocp, state);
                }
                return Ok(());
            }
            Err(error) => error,
        };
        let may_help = matches!(
            error,
            QpError::Infeasible { .. } | QpError::MaxIterations { .. } | QpError::Stalled { .. }
        );
        if !may_help {
            return Err(error);
        }
        if start == Start::Warm {
            // It may be where it began that was to blame.
            solution.copy_from(&ocp.iterate);
            let again = qp_solver.solve(ocp.qp(), Start::Cold, solution.view_mut());
            row.qp_iterations += count(&again);
            if again.is_ok() {
                return Ok(());
            }
        }
        if !self.options.elastic || state.elastic.is_some() {
            return Err(error);
        }
        self.set_elastic(ocp, state, self.options.elastic_penalty);
        let Self { solution, qp_solver, .. } = self;
        let again = qp_solver.solve(ocp.qp(), Start::Cold, solution.view_mut());
        row.qp_iterations += count(&again);
        // What made it infeasible says more than what happened afterwards.
        again.map(|_| ()).map_err(|_| error)
    }

    /// Ends elastic mode if the solution of the QP violates nothing.
    fn leave_elastic<P: Formulation<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>, state: &mut State<T>) {
        core::mem::swap(&mut ocp.iterate, &mut self.solution);
        let worst = ocp.worst(self.penalties(ocp)).map_or(0.0, |worst| worst.violation);
        core::mem::swap(&mut ocp.iterate, &mut self.solution);
        if worst <= self.options.tolerance {
            ocp.set_penalties(self.penalties(ocp), None);
            (state.elastic, state.search) = (None, Search::new());
        }
    }

    /// A line search from the iterate towards the solution of its QP. Nothing, if no step is short enough.
    fn search<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<T>,
        row: &mut Iteration,
    ) -> Result<Option<Taken>, OcpError> {
        let Self { options, qp_solver, solution, trial, work, .. } = self;
        let ends_length = ocp.ends();
        let ends = work.as_mut().get_mut(..ends_length).unwrap_or_default();
        trial.copy_from(&ocp.iterate);
        let here = ocp.measure(trial, ends)?;
        let penalties = here.objective - ocp.objective.to_f64();
        let model = ocp.model(solution, penalties);
        state.search.begin(&here, &model);
        let mut length = 1.0;
        while length >= options.shortest_step {
            between(&ocp.iterate, solution, length, trial);
            // A point without a value is one that is not good enough.
            let there = ocp.measure(trial, ends).ok();
            let is_good =
                |search: &mut Search, there: &Measure| search.accepts(options, length, &here, &model, there);
            if there.is_some_and(|there| is_good(&mut state.search, &there)) {
                core::mem::swap(&mut ocp.iterate, trial);
                return Ok(Some(Taken { length, corrected: false }));
            }
            let curved = there.is_some_and(|there| there.violation >= here.violation);
            if length == 1.0 && curved {
                // The constraints bend away: their values at the end of the step say how much.
                ocp.correct(trial, ends);
                trial.copy_from(solution);
                let corrected = qp_solver.solve(ocp.qp(), Start::Warm, trial.view_mut());
                if let Ok(statistics) = corrected {
                    row.qp_iterations += statistics.iterations;
                    let there = ocp.measure(trial, ends).ok();
                    if there.is_some_and(|there| is_good(&mut state.search, &there)) {
                        core::mem::swap(&mut ocp.iterate, trial);
                        return Ok(Some(Taken { length, corrected: true }));
                    }
                }
            }
            length *= 0.5;
        }
        Ok(None)
    }
}

/// `a + length (b − a)` of everything.
fn between<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    a: &Solution<T, D, M>,
    b: &Solution<T, D, M>,
    length: f64,
    target: &mut Solution<T, D, M>,
) {
    let length = T::from_f64(length);
    target.combine(a, b, |a, b| if length == T::ONE { b } else { a + length * (b - a) });
}

pub(in crate::ocp) fn infeasible<
    P: Formulation<T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
>(
    ocp: &Ocp<P, T, D, M>,
    worst: &Worst,
) -> Status {
    let Worst { field, stage, index, side, violation } = *worst;
    Status::Infeasible { constraint: ocp.name(field, stage, index, side), violation }
}

pub(in crate::ocp) fn failed<
    P: Formulation<T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
>(
    ocp: &Ocp<P, T, D, M>,
    error: QpError,
) -> Status {
    match (ocp.infeasible(&error), error) {
        (Some(constraint), QpError::Infeasible { violation, .. }) => {
            Status::InfeasibleQp { constraint, violation }
        }
        _ => Status::QpFailed(error),
    }
}
