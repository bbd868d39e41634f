//! A second attempt, from a simulation with the controls of the guess.

use super::phase::exit;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::{Curvature, Exact};
use crate::ocp::nlp::ipm::Ipm;
use crate::ocp::nlp::ipm::kkt::work::Work;
use crate::ocp::nlp::ipm::state::State;
use crate::ocp::nlp::ipm::violations::Phase;
use crate::ocp::nlp::simulation::{
    MAX_SIMULATED_VIOLATION, RESTART_AFTER, RESTART_GAIN, SecondStart, VIOLATION_OF_GUESS,
};
use crate::ocp::solution::outcome::Status;
use crate::qp::{StageDims, Store};
use crate::scalar::Real;

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// Whether a run begins again that failed, or whose steps have been short, or of a phase for
    /// violations, for long: once, where a simulation with the controls of the guess violates
    /// bounds by less than the point that it is at. Over unstable dynamics gaps may be what leads
    /// astray, and violations that stay there say nothing of the problem. A run that ended
    /// with the violations of the guess begins again at a simulation with controls beside its.
    pub(in crate::ocp::nlp::ipm) fn try_restart<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_>,
        end: Option<Status>,
    ) -> bool
    where
        Exact: Curvature<P::Dynamics, T>,
    {
        let stalls = end.is_none() && state.stalled_iterations == RESTART_AFTER;
        let failed = matches!(end, Some(Status::Infeasible { .. } | Status::NoProgress));
        if !(failed || stalls) || !self.options.restart || state.second_attempt || P::LIFTED {
            return false;
        }
        let work = Work::new(ocp.ends(), &state.capacity, self.work.as_mut());
        let here = ocp.worst(work.penalties, work.units).0.map_or(0.0, |worst| worst.violation);
        let left = match end {
            Some(Status::NoProgress) => state.best_violation,
            Some(_) => here,
            None => state.violation.max(here),
        };
        // Where nothing was gained from the guess it may be a maximum of violations.
        let is_infeasible = matches!(end, Some(Status::Infeasible { .. })) && state.contradiction.is_none();
        let mut is_that_of_guess = false;
        for start in [SecondStart::Simulated, SecondStart::Perturbed] {
            let most = match start {
                SecondStart::Simulated => RESTART_GAIN,
                SecondStart::Perturbed if is_infeasible && is_that_of_guess => MAX_SIMULATED_VIOLATION,
                SecondStart::Perturbed => break,
            };
            self.trial.copy_from(&self.guess);
            let work = Work::new(ocp.ends(), &state.capacity, self.work.as_mut());
            if !ocp.simulate_guess(&mut self.trial, work.ends, start) {
                continue;
            }
            let is_linearised = P::slopes(ocp).is_ok();
            let found = ocp.worst(work.penalties, work.units).0.map_or(0.0, |worst| worst.violation);
            if is_linearised && found < most * left {
                exit(ocp, state, work.penalties, &self.options);
                (state.phase, state.is_linearised, state.second_attempt) = (Phase::default(), true, true);
                return true;
            }
            is_that_of_guess = found <= VIOLATION_OF_GUESS * left;
            core::mem::swap(&mut ocp.iterate, &mut self.trial);
            state.is_linearised = false;
        }
        false
    }
}
