//! Multipliers: the first ones, those that the Hessian has, and those that hold slacks.

use super::Ipm;
use super::barrier;
use super::kkt::newton::{evaluate, evaluate_values, kkt_view, kkt_view_of_new_qp, least_squares};
use super::kkt::scaling;
use super::kkt::start::begin_sides;
use super::kkt::work::Work;
use super::restoration::phase;
use super::state::State;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::qp::{StageDims, Store, copy_common};
use crate::scalar::Real;

/// First multipliers that are more units are discarded.
const CONSTR_MULT_INIT_MAX: f64 = 1e3;

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// Slacks and multipliers of the first iteration, or of new penalties.
    pub(super) fn begin<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_>,
    ) -> Result<(), OcpError> {
        // Multipliers of hard bounds say nothing about penalties.
        let warm = self.options.warm_start && state.elastic.is_none();
        // Other penalties have their numbers at other places.
        self.numbers.as_mut().fill(T::ZERO);
        let ends = ocp.ends();
        let (qp, solution) = ocp.qp_and_iterate();
        let mut view = solution.view_mut();
        let mut work = Work::new(ends, &state.capacity, self.work.as_mut());
        let rows = core::mem::take(&mut work.units);
        let rows = &*rows;
        let units = state.lengths.units(rows);
        let mut iterate =
            kkt_view_of_new_qp(qp, &state.lengths, &mut self.numbers, &mut self.indices, units.rows)?;
        iterate.units = units.rows;
        iterate.load_point(&view);
        iterate.load_initial_state();
        evaluate_values(&mut iterate);
        let force = state.lengths.sizes.force;
        begin_sides(&mut iterate, &self.options, warm, state.mu, units, &view);
        if state.lengths.alone {
            phase::centre(&mut iterate.sides, state.mu);
        }
        iterate.store(&mut view);
        if warm {
            copy_common(work.hessian_multipliers, iterate.sides.multiplier);
        } else if least_squares(&mut iterate, &mut work, force).is_ok() {
            let is_small = |(y, unit): (T, T)| (y * unit).abs() <= T::from_f64(CONSTR_MULT_INIT_MAX * force);
            let sides = scaling::of_sides(iterate.sides.rows, work.hessian_multipliers, rows);
            if scaling::of_gaps(iterate.qp.dims, work.pi, rows).chain(sides).all(is_small) {
                copy_common(view.dynamics, work.pi);
            } else {
                view.dynamics.fill(T::ZERO);
                work.hessian_multipliers.fill(T::ZERO);
            }
        }
        state.has_slacks = true;
        Ok(())
    }

    /// Writes the multipliers that the Hessian has.
    pub(super) fn curve<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &State<'_>,
    ) -> Result<(), OcpError> {
        let ends = ocp.ends();
        let (qp, solution) = ocp.qp_and_iterate();
        let mut view = solution.view_mut();
        let mut iterate = kkt_view(qp, &state.lengths, &mut self.numbers, &mut self.indices)?;
        let work = Work::new(ends, &state.capacity, self.work.as_mut());
        copy_common(work.slacks, iterate.sides.multiplier);
        copy_common(iterate.sides.multiplier, work.hessian_multipliers);
        iterate.load_point(&view);
        iterate.store(&mut view);
        copy_common(iterate.sides.multiplier, work.slacks);
        Ok(())
    }

    /// Lets go of multipliers that hold slacks shorter than distances from bounds.
    pub(super) fn reset_small_slacks<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &State<'_>,
    ) -> Result<(), OcpError> {
        let (qp, solution) = ocp.qp_and_iterate();
        let mut iterate = kkt_view(qp, &state.lengths, &mut self.numbers, &mut self.indices)?;
        barrier::reset_small_slacks(&mut iterate.sides, state.mu, self.options.tolerance);
        let mut view = solution.view_mut();
        iterate.store(&mut view);
        evaluate(&mut iterate, &mut view);
        Ok(())
    }
}
