//! The search direction of an iteration, with or without the curvature that multipliers give.

use super::Ipm;
use super::barrier;
use super::kkt::newton::{evaluate, kkt_view, refine, resolve};
use super::kkt::work::Work;
use super::predictor;
use super::state::State;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::{Curvature, Exact};
use crate::ocp::solution::log::Iteration;
use crate::qp::{QpError, StageDims, Store};
use crate::scalar::Real;

/// Curvature that needs a larger `δ_w` than this, in units, is that of multipliers on the way to a
/// feasible point: it leaves steps of the size of rounding errors, and the multipliers that these
/// have grow with it.
const MOST_REGULARISATION: f64 = 10.0;
/// Where violations and gaps are no more than this, in units, multipliers are those of a solution.
const CLOSE: f64 = 1.0;

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// The search direction; without the curvature of dynamics and constraints where that needs too
    /// much regularisation, far from a feasible point.
    pub(super) fn search_direction<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_>,
        row: &mut Iteration,
    ) -> Result<Result<bool, QpError>, OcpError>
    where
        Exact: Curvature<P::Dynamics, T>,
    {
        let before = (state.regularisation, state.progress, state.mu);
        let direction = self.regularised_direction(ocp, state, row);
        let is_regularised =
            direction.is_err() || state.delta > MOST_REGULARISATION * state.lengths.sizes.force;
        if !is_regularised || state.violation <= CLOSE {
            return Ok(direction);
        }
        (state.regularisation, state.progress, state.mu) = before;
        self.forget_curvature(ocp, state)?;
        Ok(self.regularised_direction(ocp, state, row))
    }

    /// The QP at the iterate without multipliers of dynamics and constraints, on which no step
    /// depends but by the curvature that they give to the Hessian.
    fn forget_curvature<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_>,
    ) -> Result<(), OcpError>
    where
        Exact: Curvature<P::Dynamics, T>,
    {
        ocp.iterate.view_mut().dynamics.fill(T::ZERO);
        Work::new(ocp.ends(), &state.capacity, self.work.as_mut()).hessian_multipliers.fill(T::ZERO);
        self.linearise(ocp, state)?;
        let (qp, solution) = ocp.qp_and_iterate();
        let mut iterate = kkt_view(qp, &state.lengths, &mut self.numbers, &mut self.indices)?;
        let mut view = solution.view_mut();
        evaluate(&mut iterate, &mut view);
        iterate.store(&mut view);
        Ok(())
    }

    /// The regularised Newton step, and the barrier parameter if that follows it; whether it is
    /// corrected.
    ///
    /// # Errors
    /// Those of the recursion, where no regularisation helps.
    fn regularised_direction<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_>,
        row: &mut Iteration,
    ) -> Result<bool, QpError> {
        let force = state.lengths.sizes.force;
        let least = barrier::least(self.options.least_product(state.objective_unit));
        let units = Work::new(ocp.ends(), &state.capacity, self.work.as_mut()).units;
        let mut iterate = kkt_view(ocp.qp.view(), &state.lengths, &mut self.numbers, &mut self.indices)?;
        iterate.units = units;
        let probes = state.progress.is_free();
        let aim = if probes { 0.0 } else { state.mu };
        state.delta = state.regularisation.direction(&mut iterate, T::from_f64(aim), force)?;
        row.regularisation = state.delta;
        let mean = barrier::mean(&iterate.sides) / force;
        let monotone = state.progress.count(state.delta > 0.0, state.mu / force, mean);
        let mut is_corrected = false;
        if let Some(mu) = monotone {
            state.mu = mu * force;
            resolve(&mut iterate, T::from_f64(state.mu), false)?;
        } else if probes {
            state.mu = predictor::probe(&iterate.sides, least);
            is_corrected = predictor::correct(&mut iterate, state.mu, force, state.violation)?;
        }
        if probes {
            state.filter.clear();
        }
        row.barrier = state.mu;
        refine(&mut iterate, units)?;
        Ok(is_corrected)
    }
}
