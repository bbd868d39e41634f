//! Entry points, initialisation and end of a run.

use super::Ipm;
use super::kkt::dimensions::KktDimensions;
use super::kkt::initial_point::push_inside_bounds;
use super::kkt::workspace::Workspace;
use super::run_state::RunState;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::{Curvature, Exact};
use crate::ocp::nlp::solver_loop;
use crate::ocp::solution::log::Iteration;
use crate::ocp::solution::outcome::{Outcome, Status};
use crate::qp::{QpField, StageDims, Store};
use crate::scalar::Real;
use core::ops::ControlFlow;

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// Solves a problem from its iterate. Afterwards the iterate is the best one, whatever the
    /// status, or the last one after `Converged` and `Infeasible`.
    ///
    /// # Errors
    /// [`OcpError::Length`] if the memory is that of another problem; [`OcpError::Missing`],
    /// [`OcpError::InvalidOption`]; [`OcpError::Integration`] and [`OcpError::NonFiniteFunction`]
    /// if a function is not finite at the start.
    pub fn solve<P: Program<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>) -> Result<Outcome, OcpError>
    where
        Exact: Curvature<P::Dynamics, T>,
    {
        self.run(ocp, &mut |_| ControlFlow::Continue(()), &mut || false)
    }

    /// [`Ipm::solve`] with a deadline: `over` is called after each evaluation of the problem,
    /// factorisation and trial point, and may read a clock or a counter of cycles. When it returns
    /// true the status is [`Status::OutOfTime`], and the iterate the best one so far.
    ///
    /// # Errors
    /// As [`Ipm::solve`].
    ///
    /// # Example
    /// ```
    /// use casados::ocp::{HeapIpm, Horizon, LeastSquaresCost, Map, Problem, Status};
    /// use casados::prelude::*;
    /// use std::time::{Duration, Instant};
    ///
    /// #[function]
    /// fn push(x: f64, u: f64) -> f64 { x + u }
    /// #[function]
    /// fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
    ///
    /// let mut ocp = Problem::new(Map::<Push, f64>::new())
    ///     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
    ///     .on(Horizon::uniform(10, 0.1))?;
    /// ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
    /// let deadline = Instant::now() + Duration::from_secs(60);
    /// let mut ipm = HeapIpm::new(&ocp)?;
    /// assert!(ipm.solve_until(&mut ocp, &mut || Instant::now() > deadline)?.is_converged());
    /// assert_eq!(ipm.solve_until(&mut ocp, &mut || true)?.status, Status::OutOfTime);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn solve_until<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        over: &mut dyn FnMut() -> bool,
    ) -> Result<Outcome, OcpError>
    where
        Exact: Curvature<P::Dynamics, T>,
    {
        self.run(ocp, &mut |_| ControlFlow::Continue(()), over)
    }

    /// [`Ipm::solve`] with an observer of the iterations, which may stop the run.
    ///
    /// # Errors
    /// As [`Ipm::solve`].
    pub fn solve_observed<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        observer: &mut dyn FnMut(&Iteration) -> ControlFlow<()>,
    ) -> Result<Outcome, OcpError>
    where
        Exact: Curvature<P::Dynamics, T>,
    {
        self.run(ocp, observer, &mut || false)
    }

    fn run<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        observer: &mut dyn FnMut(&Iteration) -> ControlFlow<()>,
        deadline_passed: &mut dyn FnMut() -> bool,
    ) -> Result<Outcome, OcpError>
    where
        Exact: Curvature<P::Dynamics, T>,
    {
        ocp.check_dimensions(self.trial_point.dims())?;
        self.options.validate()?;
        ocp.initialise_stages(self.options.warm_start)?;
        // The QP contains the bounds of constraints only after it is written.
        let perturbation = self.options.perturb_start.then_some(self.options.advanced.start);
        let perturbed = ocp.linearise_guess(P::slopes, &mut self.trial_point, perturbation)?;
        let (lengths, capacity, is_linearised) = self.initialise(ocp)?;
        let mut state = RunState::new(deadline_passed, (lengths, capacity), is_linearised, &self.options);
        state.has_perturbed_start = perturbed;
        state.initial_objective = ocp.objective.to_f64();
        state.contradictory_bounds = ocp.contradictory_bounds(self.options.tolerance);
        state.diverging_iterates_tol =
            self.options.advanced.unbounded.diverging_iterates_tol * ocp.largest_magnitude();
        #[cfg(feature = "alloc")]
        self.log.clear();
        let mut outcome = Outcome::new();
        let result = solver_loop::iterate(self, ocp, &mut state, observer, &mut outcome);
        let work = Workspace::new(ocp.ends(), &capacity, self.workspace.as_mut());
        ocp.set_penalties(work.saved_penalties, None, &[]);
        let is_last = matches!(outcome.status, Status::Converged | Status::Infeasible { .. });
        if !(is_last && result.is_ok()) && state.best_residual.is_finite() {
            ocp.restore_best_iterate(&self.best_iterate);
        }
        (ocp.step_length, ocp.algebraic_is_current) = (None, false);
        let is_stuck =
            matches!(outcome.status, Status::NoProgress | Status::QpFailed(_) | Status::MaxIterations);
        if is_stuck && state.best_residual <= self.options.acceptable_tolerance {
            outcome.status = Status::Acceptable;
        }
        ocp.complete_outcome(&mut outcome);
        outcome.objective = state.best_iteration.objective;
        outcome.residuals = state.best_iteration.residuals;
        result.map(|()| outcome)
    }

    /// Initialises memory, units and the point inside the bounds. Returns the dimensions, the
    /// largest dimensions, and whether the point is still that of the linearisation.
    fn initialise<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
    ) -> Result<(KktDimensions, KktDimensions, bool), OcpError> {
        let mut lengths = KktDimensions::from_qp(ocp.qp());
        let mut capacity = lengths.with_all_bounds_soft(ocp.qp());
        let length = Workspace::<T>::length(ocp.qp().dims, ocp.ends(), &capacity.counts);
        self.workspace.at_least(length, QpField::Numbers)?.fill(T::ZERO);
        self.kkt_numbers.at_least(capacity.number_count, QpField::Numbers)?.fill(T::ZERO);
        let work = Workspace::new(ocp.ends(), &capacity, self.workspace.as_mut());
        work.units.fill(T::ONE);
        if self.options.scaling {
            lengths.scaling = ocp.compute_units(work.units, work.scratch, false);
            capacity.scaling = lengths.scaling;
        }
        let push = self.options.push::<T>(self.options.warm_start);
        let (qp, iterate) = ocp.qp_and_iterate();
        self.trial_point.copy_from(iterate);
        push_inside_bounds(qp, lengths.has_fixed_initial_state, push, work.units, &mut iterate.view_mut());
        ocp.equalise_shared_controls();
        self.guess.copy_from(&ocp.iterate);
        let is_unchanged =
            self.trial_point.variables_and_costates().0 == ocp.iterate.variables_and_costates().0;
        let work = Workspace::new(ocp.ends(), &capacity, self.workspace.as_mut());
        ocp.save_penalties(work.saved_penalties);
        Ok((lengths, capacity, is_unchanged))
    }
}
