//! The search direction, with or without the curvature of dynamics and constraints.

use super::Ipm;
use super::barrier;
use super::kkt::newton::{evaluate_residuals, kkt_view, refine_step, resolve};
use super::kkt::workspace::Workspace;
use super::predictor;
use super::run_state::RunState;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::{Curvature, Exact};
use crate::ocp::solution::log::Iteration;
use crate::qp::{QpError, StageDims, Store};
use crate::scalar::Real;

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// Computes the search direction. Resets the multipliers, and with them the curvature of
    /// dynamics and constraints, if this curvature requires too large a `δ_w` far from a feasible
    /// point.
    pub(super) fn search_direction<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_>,
        log_row: &mut Iteration,
    ) -> Result<Result<bool, QpError>, OcpError>
    where
        Exact: Curvature<P::Dynamics, T>,
    {
        let newton = self.options.advanced.newton;
        let saved = (state.regularisation, state.adaptive_mu, state.mu);
        let direction = self.regularised_direction(ocp, state, log_row);
        let is_regularised = direction.is_err()
            || state.delta_w > newton.multiplier_reset_delta_w * state.dimensions.scaling.objective_unit;
        if !is_regularised || state.violation <= newton.multiplier_reset_violation {
            return Ok(direction);
        }
        (state.regularisation, state.adaptive_mu, state.mu) = saved;
        self.reset_multipliers(ocp, state)?;
        Ok(self.regularised_direction(ocp, state, log_row))
    }

    /// Sets the multipliers of dynamics and constraints in the Hessian to zero, and writes the QP
    /// again. The step depends on these multipliers through the Hessian only.
    fn reset_multipliers<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_>,
    ) -> Result<(), OcpError>
    where
        Exact: Curvature<P::Dynamics, T>,
    {
        ocp.iterate.view_mut().dynamics.fill(T::ZERO);
        Workspace::new(ocp.ends(), &state.max_dimensions, self.workspace.as_mut())
            .hessian_multipliers
            .fill(T::ZERO);
        self.linearise(ocp, state)?;
        let (qp, solution) = ocp.qp_and_iterate();
        let mut iterate = kkt_view(qp, &state.dimensions, &mut self.kkt_numbers, &mut self.kkt_indices)?;
        let mut view = solution.view_mut();
        evaluate_residuals(&mut iterate, &mut view);
        iterate.store(&mut view);
        Ok(())
    }

    /// Computes the regularised Newton step, and `μ` in free mode. Returns whether the step has a
    /// higher-order correction.
    ///
    /// # Errors
    /// The errors of the recursion, if no regularisation suffices.
    fn regularised_direction<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_>,
        log_row: &mut Iteration,
    ) -> Result<bool, QpError> {
        let objective_unit = state.dimensions.scaling.objective_unit;
        let advanced = self.options.advanced;
        let min_mu = advanced.barrier.min_mu(self.options.product_tolerance(state.product_unit));
        let units = Workspace::new(ocp.ends(), &state.max_dimensions, self.workspace.as_mut()).units;
        let mut iterate =
            kkt_view(ocp.qp.view(), &state.dimensions, &mut self.kkt_numbers, &mut self.kkt_indices)?;
        iterate.units = units;
        let in_free_mode = state.adaptive_mu.is_in_free_mode();
        let target_mu = if in_free_mode { 0.0 } else { state.mu };
        state.delta_w = state.regularisation.compute_regularised_step(
            &mut iterate,
            T::from_f64(target_mu),
            objective_unit,
        )?;
        log_row.regularisation = state.delta_w;
        let mean_complementarity = barrier::mean_complementarity(&iterate.inequalities) / objective_unit;
        let monotone_mu = state.adaptive_mu.count_step(
            state.delta_w > 0.0,
            state.mu / objective_unit,
            mean_complementarity,
        );
        let mut is_corrected = false;
        if let Some(mu) = monotone_mu {
            state.mu = mu * objective_unit;
            resolve(&mut iterate, T::from_f64(state.mu), false)?;
        } else if in_free_mode {
            state.mu = predictor::probing_mu(&iterate.inequalities, min_mu);
            let unit_and_violation = (objective_unit, state.violation);
            is_corrected = predictor::corrected_step(&mut iterate, state.mu, unit_and_violation, &advanced)?;
        }
        if in_free_mode {
            state.filter.clear();
        }
        log_row.barrier = state.mu;
        refine_step(&mut iterate, units, &advanced.newton)?;
        Ok(is_corrected)
    }
}
