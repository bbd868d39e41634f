//! The iterations.

use super::Ipm;
use super::direction::Regularisation;
use super::filter::Filter;
use super::newton::Lengths;
use super::start::push_inside;
use super::work::Work;
use crate::ocp::convexify::Convexification;
use crate::ocp::dynamics::SecondOrder;
use crate::ocp::error::OcpError;
use crate::ocp::instance::Ocp;
use crate::ocp::linearise::Exact;
use crate::ocp::problem::Formulation;
use crate::ocp::sqp::{Iteration, Outcome, Status, Times};
use crate::qp::{Field, StageDims, Store, assign};
use crate::scalar::Real;
use core::ops::ControlFlow;

/// What a run remembers from one iteration to the next.
pub(super) struct State {
    pub lengths: Lengths,
    /// The barrier parameter.
    pub mu: f64,
    pub filter: Filter,
    /// Below this violation the barrier function may decide.
    pub theta_min: f64,
    pub regularisation: Regularisation,
    /// `δ_w` of the step.
    pub delta: f64,
    /// The penalty, if bounds are soft.
    pub elastic: Option<f64>,
    /// The violation where the last penalty led to.
    pub stationary: f64,
    /// Iterations one after the other whose residuals are acceptable.
    pub acceptable: usize,
    /// Slacks are there.
    pub begun: bool,
    /// The filter knows the violation that the slacks began with.
    pub measured: bool,
    /// The largest residual of the best iterate.
    pub best: f64,
    /// That iterate.
    pub kept: Iteration,
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
        let (lengths, all) = self.prepare(ocp)?;
        let mut state = State {
            lengths,
            mu: self.options.start_mu,
            filter: Filter::new(f64::INFINITY),
            theta_min: f64::INFINITY,
            regularisation: Regularisation::default(),
            delta: 0.0,
            elastic: None,
            stationary: f64::INFINITY,
            acceptable: 0,
            begun: false,
            measured: false,
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
        let work = Work::new(ocp.qp().dims, ocp.ends(), &all, self.work.as_mut());
        ocp.set_penalties(work.penalties, None);
        if outcome.status != Status::Converged && state.best.is_finite() {
            ocp.iterate.copy_from(&self.best);
        }
        outcome.objective = state.kept.objective;
        outcome.residuals = state.kept.residuals;
        result.map(|()| outcome)
    }

    /// Memory for all that may come, a point inside of the bounds, and what is remembered of the
    /// problem.
    fn prepare<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
    ) -> Result<(Lengths, Lengths), OcpError> {
        let lengths = Lengths::of(ocp.qp());
        let all = lengths.all_soft(ocp.qp());
        let length = Work::<T>::length(ocp.qp().dims, ocp.ends(), &all);
        self.work.at_least(length, Field::Numbers)?.fill(T::ZERO);
        self.numbers.at_least(all.numbers, Field::Numbers)?.fill(T::ZERO);
        let push = if self.options.warm_start { self.options.warm_push } else { self.options.bound_push };
        let (qp, iterate) = ocp.qp_and_iterate();
        push_inside(qp, lengths.fixed, push, &mut iterate.view_mut());
        // Which states are tied lies behind the penalties.
        let begin = Work::<T>::before_coupling(ocp.qp().dims, ocp.ends(), all.counts.pairs());
        let (tied, _) = ocp.coupling();
        assign(self.work.as_mut().get_mut(begin..).unwrap_or_default(), tied);
        let work = Work::new(ocp.qp().dims, ocp.ends(), &all, self.work.as_mut());
        ocp.remember_penalties(work.penalties);
        Ok((lengths, all))
    }
}
