//! A point that is tried: its objective, what is left of its dynamics and constraints, and the QP
//! that has these exactly.

use crate::linalg::dot;
use crate::ocp::assembly::algebraic;
#[cfg(feature = "alloc")]
use crate::ocp::assembly::inside::{Costs, Rows};
use crate::ocp::assembly::linearise::shift_limits;
use crate::ocp::assembly::start::link_start;
use crate::ocp::formulation::arrival;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::constraint::{Constraints, Spot};
use crate::ocp::formulation::functions::cost::Cost;
use crate::ocp::formulation::functions::dynamics::{Dynamics, IntervalResult, Nodes, add_stages};
use crate::ocp::formulation::instance::data::{Layout, Node, path_rows, split};
use crate::ocp::formulation::instance::{Ocp, nodes};
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::ocp::formulation::program::{Parts, Program, intervals_end};
use crate::qp::{Arrays, Solution, StageDims, copy_common, part, part_mut};
use crate::scalar::Real;
use crate::shape::Shape;
use bytemuck::Zeroable;

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// The objective at some point, without penalties; and what is left of its dynamics and
    /// constraints in `ends`: `φ` of every interval, then `g` of every stage, in the layout of
    /// [`Ocp::ends`].
    ///
    /// # Errors
    /// [`OcpError::NonFiniteFunction`], [`OcpError::Integration`]
    pub(in crate::ocp) fn evaluate_functions(
        &mut self,
        at: &Solution<T, D, M>,
        ends: &mut [T],
    ) -> Result<T, OcpError> {
        let layout @ Layout { intervals, .. } = self.layout();
        let (nx, free) = (P::Shape::NX, self.free.view());
        let data = split::<P, T>(self.data.as_mut(), layout);
        let (v, multipliers) = at.variables_and_costates();
        let (mut objective, mut of_stages) = (arrival::cost(data.arrival, at), [T::ZERO; 2]);
        let nodes = nodes::<P::Shape, T>(v, multipliers, &[], (data.p, free), data.times);
        let nodes = Nodes { step_length: self.step_length, ..nodes };
        let mut take = |k: usize, step: &IntervalResult<'_, T>| {
            objective = objective + step.cost.value;
            if P::Dynamics::LIFTED {
                of_stages = add_stages(of_stages, step.stages);
            }
            copy_common(part_mut(ends, k * nx, nx), step.x);
        };
        if self.inner.count() > 0 {
            #[cfg(feature = "alloc")]
            self.simulate_pieces(Some(at), take)?;
        } else {
            self.problem.parts().dynamics.simulate(&nodes, &mut |k, step: &IntervalResult<'_, T>| {
                algebraic::keep::<P::Shape, T>(data.algebraic, free, k, step);
                take(k, step);
            })?;
        }
        let first_part = self.inner.first_part();
        #[cfg(feature = "alloc")]
        let inner = &mut self.inner;
        let (free, data) = (self.free.view(), split::<P, T>(self.data.as_mut(), layout));
        let Problem { stage_cost, terminal_cost, path, terminal, running, .. } = self.problem.parts();
        let values = ends.get_mut(intervals * nx..).unwrap_or_default();
        let mut point = <P::Shape as Shape>::ArrayV::<T>::zeroed();
        for (k, at) in at.stages().enumerate() {
            let node = Node::new::<P>(k, intervals, *running, [data.times, data.p, data.references]);
            let (z, _) = algebraic::at::<P::Shape, T>(data.algebraic, layout, k);
            node.read::<P::Shape>(&mut point, &at, z, free);
            let spot = Spot::new(k, free, part(at.u, 0, P::Terminal::STARTS));
            if k < intervals {
                let factor =
                    if *running { free.duration(at.u) * node.factor * first_part } else { node.factor };
                objective = objective + factor * stage_cost.value(&point, node.reference, k)?;
                let rows = path_rows::<P, T>(layout);
                let values = part_mut(values, k * rows, rows);
                path.value(&point, values, spot)?;
                link_start::<P, T>(&at, k, (values, &mut [], 0));
                #[cfg(feature = "alloc")]
                if layout.inner > 0 || inner.has_costs_at_points() {
                    let costs = Costs {
                        cost: &mut *stage_cost,
                        reference: node.reference,
                        running: *running,
                        exact: false,
                    };
                    let rows = &mut Rows::values(values, at, k);
                    let given = (&*data.times, &*data.p);
                    objective = objective
                        + inner.write_rows::<P>((&mut *path, costs), (z, &[]), given, free, rows)?;
                }
            } else {
                objective = objective + terminal_cost.value(&point, node.reference, k)?;
                terminal.value(
                    &point,
                    part_mut(values, k * path_rows::<P, T>(layout), P::Terminal::ROWS),
                    spot,
                )?;
            }
        }
        self.stages = of_stages;
        Ok(objective)
    }
}

impl<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Constants of the linearised dynamics and constraints such that these are exact at some
    /// point, whose `ends` are given: what a second-order correction solves.
    pub(in crate::ocp) fn correct(&mut self, at: &Solution<T, D, M>, ends: &[T]) {
        let Parts { qp, given, .. } = P::split(self);
        let ((v, _), mut begin, mut row) = (at.variables_and_costates(), 0, 0);
        let (mut ends, values) = ends.split_at_checked(intervals_end(qp.dims())).unwrap_or_default();
        for mut stage in qp.stages_mut() {
            let count = stage.dims().ng;
            let Arrays { n, ld, next, rows, matrix, offset, limits, .. } = stage.arrays();
            let here = part(v, begin, n);
            let (phi, behind) = ends.split_at_checked(next).unwrap_or_default();
            for ((offset, &x), column) in offset.iter_mut().zip(phi).zip(matrix.chunks_exact(ld.max(1))) {
                *offset = x - dot(column, here);
            }
            let columns = matrix.get(next * ld..).unwrap_or_default();
            let (lower, rest) = limits.split_at_mut_checked(rows).unwrap_or_default();
            let (lower, upper) = (part_mut(lower, ld, count), part_mut(rest, ld, count));
            copy_common(lower, part(values, row, count));
            shift_limits(
                columns,
                [n, ld],
                here,
                [lower, upper],
                given.map(|limits| part(limits, row, count)),
            );
            (begin, row, ends) = (begin + ld, row + count, behind);
        }
    }
}
