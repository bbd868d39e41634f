//! Multipliers: least-squares multipliers, multipliers of the Hessian, and the reset of small
//! slacks.

use super::Ipm;
use super::barrier;
use super::kkt::initial_point::initialise_inequalities;
use super::kkt::newton::{
    evaluate_linear_residuals, evaluate_residuals, kkt_view, kkt_view_of_new_qp, least_squares_multipliers,
};
use super::kkt::scaling;
use super::kkt::workspace::Workspace;
use super::restoration::phase;
use super::run_state::RunState;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::qp::{StageDims, Store, copy_common};
use crate::scalar::Real;

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// Initialises slacks and multipliers in the first iteration, or for new penalties.
    pub(super) fn initialise_slacks_and_multipliers<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_>,
    ) -> Result<(), OcpError> {
        // Multipliers of hard bounds are not those of penalties.
        let warm = self.options.warm_start && state.elastic_penalty.is_none();
        // New penalties change the layout of the memory.
        self.kkt_numbers.as_mut().fill(T::ZERO);
        let ends = ocp.ends();
        let (qp, solution) = ocp.qp_and_iterate();
        let mut view = solution.view_mut();
        let mut work = Workspace::new(ends, &state.max_dimensions, self.workspace.as_mut());
        let rows = core::mem::take(&mut work.units);
        let rows = &*rows;
        let units = state.dimensions.units(rows);
        let mut iterate = kkt_view_of_new_qp(
            qp,
            &state.dimensions,
            &mut self.kkt_numbers,
            &mut self.kkt_indices,
            units.rows,
        )?;
        iterate.units = units.rows;
        iterate.load_point(&view);
        iterate.load_initial_state();
        evaluate_linear_residuals(&mut iterate);
        let objective_unit = state.dimensions.scaling.objective_unit;
        let newton = self.options.advanced.newton;
        let identity = newton.identity_hessian_weight * objective_unit;
        initialise_inequalities(&mut iterate, &self.options, warm, state.mu, units, &view);
        if state.dimensions.in_restoration {
            phase::start_on_central_path(&mut iterate.inequalities, state.mu);
        }
        iterate.store(&mut view);
        if warm {
            copy_common(work.hessian_multipliers, iterate.inequalities.multiplier);
        } else if least_squares_multipliers(&mut iterate, &mut work, identity).is_ok() {
            let largest = T::from_f64(newton.constr_mult_init_max * objective_unit);
            let is_small = |(y, unit): (T, T)| (y * unit).abs() <= largest;
            let sides =
                scaling::row_values_with_units(iterate.inequalities.rows, work.hessian_multipliers, rows);
            if scaling::gaps_with_units(iterate.qp.dims, work.next_costates, rows).chain(sides).all(is_small)
            {
                copy_common(view.dynamics, work.next_costates);
            } else {
                view.dynamics.fill(T::ZERO);
                work.hessian_multipliers.fill(T::ZERO);
            }
        }
        state.slacks_are_current = true;
        Ok(())
    }

    /// Writes the multipliers of the Hessian into the iterate.
    pub(super) fn load_hessian_multipliers<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &RunState<'_>,
    ) -> Result<(), OcpError> {
        let ends = ocp.ends();
        let (qp, solution) = ocp.qp_and_iterate();
        let mut view = solution.view_mut();
        let mut iterate = kkt_view(qp, &state.dimensions, &mut self.kkt_numbers, &mut self.kkt_indices)?;
        let work = Workspace::new(ends, &state.max_dimensions, self.workspace.as_mut());
        copy_common(work.trial_slacks, iterate.inequalities.multiplier);
        copy_common(iterate.inequalities.multiplier, work.hessian_multipliers);
        iterate.load_point(&view);
        iterate.store(&mut view);
        copy_common(iterate.inequalities.multiplier, work.trial_slacks);
        Ok(())
    }

    /// Resets slacks that are shorter than the distances from their bounds.
    pub(super) fn reset_small_slacks<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &RunState<'_>,
    ) -> Result<(), OcpError> {
        let (qp, solution) = ocp.qp_and_iterate();
        let mut iterate = kkt_view(qp, &state.dimensions, &mut self.kkt_numbers, &mut self.kkt_indices)?;
        let kappa_sigma = self.options.advanced.barrier.kappa_sigma;
        let tolerance = self.options.tolerance;
        barrier::reset_small_slacks(&mut iterate.inequalities, (state.mu, kappa_sigma), tolerance);
        let mut view = solution.view_mut();
        iterate.store(&mut view);
        evaluate_residuals(&mut iterate, &mut view);
        Ok(())
    }
}
