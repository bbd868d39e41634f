//! Trial points: objective, ends of intervals and constraints; and the QP of a second-order
//! correction.

use crate::linalg::dot;
use crate::ocp::assembly::algebraic;
use crate::ocp::assembly::initial_state_copies::link_initial_state_copies;
#[cfg(feature = "alloc")]
use crate::ocp::assembly::inner_points::{ConstraintRows, PointCost};
use crate::ocp::assembly::linearise::shift_limits;
use crate::ocp::formulation::arrival;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::constraint::{ConstraintContext, Constraints};
use crate::ocp::formulation::functions::cost::Cost;
use crate::ocp::formulation::functions::dynamics::{Dynamics, IntervalResult, Nodes, add_stage_residuals};
use crate::ocp::formulation::instance::data::{Layout, Node, path_row_count, split_data};
use crate::ocp::formulation::instance::{Ocp, interval_nodes};
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::ocp::formulation::program::{Program, ProgramParts, intervals_end};
use crate::qp::{Arrays, Solution, StageDims, copy_common, part, part_mut};
use crate::scalar::Real;
use crate::shape::Shape;
use bytemuck::Zeroable;

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Returns the objective at a point, without penalties. Writes `φ` of every interval, then `g`
    /// of every stage, to `ends_and_constraints`, in the layout of [`Ocp::ends`].
    ///
    /// # Errors
    /// [`OcpError::NonFiniteFunction`], [`OcpError::Integration`]
    pub(in crate::ocp) fn evaluate_functions(
        &mut self,
        trial_point: &Solution<T, D, M>,
        ends_and_constraints: &mut [T],
    ) -> Result<T, OcpError> {
        let layout @ Layout { intervals, .. } = self.layout();
        let (nx, free) = (P::Shape::NX, self.free.view());
        let data = split_data::<P, T>(self.data.as_mut(), layout);
        let (v, multipliers) = trial_point.variables_and_costates();
        let (mut objective, mut stage_residuals) =
            (arrival::arrival_cost(data.arrival, trial_point), [T::ZERO; 2]);
        let nodes = interval_nodes::<P::Shape, T>(v, multipliers, &[], (data.p, free), data.times);
        let nodes = Nodes { step_length: self.step_length, ..nodes };
        let mut add_interval = |k: usize, step: &IntervalResult<'_, T>| {
            objective = objective + step.cost.value;
            if P::Dynamics::LIFTED {
                stage_residuals = add_stage_residuals(stage_residuals, step.stage_residuals);
            }
            copy_common(part_mut(ends_and_constraints, k * nx, nx), step.x);
        };
        if self.inner_points.count() > 0 {
            #[cfg(feature = "alloc")]
            self.simulate_pieces(Some(trial_point), add_interval)?;
        } else {
            self.problem.parts().dynamics.simulate(&nodes, &mut |k, step: &IntervalResult<'_, T>| {
                algebraic::store_interval::<P::Shape, T>(data.algebraic, free, k, step);
                add_interval(k, step);
            })?;
        }
        let first_part = self.inner_points.node_fraction();
        #[cfg(feature = "alloc")]
        let inner = &mut self.inner_points;
        let (free, data) = (self.free.view(), split_data::<P, T>(self.data.as_mut(), layout));
        let Problem { stage_cost, terminal_cost, path, terminal, running, .. } = self.problem.parts();
        let values = ends_and_constraints.get_mut(intervals * nx..).unwrap_or_default();
        let mut point = <P::Shape as Shape>::ArrayV::<T>::zeroed();
        for (k, stage_point) in trial_point.stages().enumerate() {
            let node = Node::new::<P>(k, intervals, *running, [data.times, data.p, data.references]);
            let (z, _) = algebraic::values_and_jacobian::<P::Shape, T>(data.algebraic, layout, k);
            node.write_variables::<P::Shape>(&mut point, &stage_point, z, free);
            let constraint_context =
                ConstraintContext::new(k, free, part(stage_point.u, 0, P::Terminal::INITIAL_STATE_COPIES));
            if k < intervals {
                let factor = if *running {
                    free.duration(stage_point.u) * node.factor * first_part
                } else {
                    node.factor
                };
                objective = objective + factor * stage_cost.value(&point, node.reference, k)?;
                let rows = path_row_count::<P, T>(layout);
                let values = part_mut(values, k * rows, rows);
                path.value(&point, values, constraint_context)?;
                link_initial_state_copies::<P, T>(&stage_point, k, (values, &mut [], 0));
                #[cfg(feature = "alloc")]
                if layout.inner_rows > 0 || inner.has_costs_at_points() {
                    let costs = PointCost {
                        cost: &mut *stage_cost,
                        reference: node.reference,
                        running: *running,
                        exact: false,
                    };
                    let rows = &mut ConstraintRows::without_derivatives(values, stage_point, k);
                    let times_and_parameters = (&*data.times, &*data.p);
                    objective = objective
                        + inner.write_point_rows::<P>(
                            (&mut *path, costs),
                            (z, &[]),
                            times_and_parameters,
                            free,
                            rows,
                        )?;
                }
            } else {
                objective = objective + terminal_cost.value(&point, node.reference, k)?;
                terminal.value(
                    &point,
                    part_mut(values, k * path_row_count::<P, T>(layout), P::Terminal::ROWS),
                    constraint_context,
                )?;
            }
        }
        self.stage_residuals = stage_residuals;
        Ok(objective)
    }
}

impl<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Second-order correction: sets the constants of the linearised dynamics and constraints so
    /// that these are exact at a point with the given `ends`.
    pub(in crate::ocp) fn set_second_order_correction(
        &mut self,
        trial_point: &Solution<T, D, M>,
        ends: &[T],
    ) {
        let ProgramParts { qp, given, .. } = P::split(self);
        let ((v, _), mut begin, mut row) = (trial_point.variables_and_costates(), 0, 0);
        let (mut ends, values) = ends.split_at_checked(intervals_end(qp.dims())).unwrap_or_default();
        for mut stage in qp.stages_mut() {
            let count = stage.dims().ng;
            let Arrays { n, ld, next, rows, matrix, offset, limits, .. } = stage.arrays();
            let stage_variables = part(v, begin, n);
            let (phi, remaining_ends) = ends.split_at_checked(next).unwrap_or_default();
            for ((offset, &x), column) in offset.iter_mut().zip(phi).zip(matrix.chunks_exact(ld.max(1))) {
                *offset = x - dot(column, stage_variables);
            }
            let columns = matrix.get(next * ld..).unwrap_or_default();
            let (lower, rest) = limits.split_at_mut_checked(rows).unwrap_or_default();
            let (lower, upper) = (part_mut(lower, ld, count), part_mut(rest, ld, count));
            copy_common(lower, part(values, row, count));
            shift_limits(
                columns,
                [n, ld],
                stage_variables,
                [lower, upper],
                given.map(|limits| part(limits, row, count)),
            );
            (begin, row, ends) = (begin + ld, row + count, remaining_ends);
        }
    }
}
