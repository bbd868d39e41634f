//! The QP at an iterate.

use crate::linalg::dot;
use crate::ocp::assembly::algebraic::{self, ExtendedDerivatives};
use crate::ocp::assembly::convexify::convexify;
use crate::ocp::assembly::initial_state_copies::link_initial_state_copies;
#[cfg(feature = "alloc")]
use crate::ocp::assembly::inner_points::{ConstraintRows, PointCost};
use crate::ocp::assembly::linearised_interval::IntervalContributions;
use crate::ocp::formulation::arrival;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::free_parameters::FreeParametersView;
use crate::ocp::formulation::functions::constraint::{ConstraintContext, Constraints};
use crate::ocp::formulation::functions::cost::{Cost, CostContext};
use crate::ocp::formulation::functions::dynamics::{
    Dynamics, IntervalResult, Nodes, Sink, add_stage_residuals,
};
use crate::ocp::formulation::functions::node_evaluation::QuadraticTerms;
use crate::ocp::formulation::instance::data::{
    Layout, Node, node_row_count, path_row_count, split_data, stage_variable_count,
};
use crate::ocp::formulation::instance::{Ocp, interval_nodes};
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::ocp::formulation::program::curvature::Curvature;
use crate::qp::{Arrays, StageDims, add_symmetric_product, copy_common, padded_len, part, part_mut};
use crate::scalar::Real;
use crate::shape::Shape;
use bytemuck::Zeroable;

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// [`Ocp::linearise`], which also passes every interval to `observer`.
    pub(in crate::ocp) fn linearise_with_observer<C: Curvature<P::Dynamics, T>>(
        &mut self,
        curvature: C,
        observer: Sink<'_, T>,
    ) -> Result<(), OcpError> {
        let intervals = self.intervals();
        let is_free_cost = self.free.view().end_time_index().is_some() && self.problem.parts().running;
        let plain = !C::EXACT && !is_free_cost && !self.inner_points.has_costs_at_points();
        let mut contributions = IntervalContributions { has_node_costs_only: plain, adds_to_costs: false };
        let interval_sums = self.linearise_intervals(curvature, |k, step, (stage, free), at| {
            contributions.write_interval::<P, T>(step, free, stage, at);
            observer(k, step);
        })?;
        let costs =
            self.linearise_functions::<C>(contributions.has_node_costs_only, |k, hessian, gradient| {
                if !(contributions.adds_to_costs && k < intervals) {
                    hessian.fill(T::ZERO);
                    gradient.fill(T::ZERO);
                }
            })?;
        self.complete_gradients(curvature, contributions.has_node_costs_only);
        self.add_arrival_cost(false);
        self.store_objective(interval_sums, costs);
        Ok(())
    }

    /// Linearises dynamics and integral costs of all intervals in one call, and passes each
    /// interval with its stage and the variables at its start to `visit`. Returns the sum of the
    /// costs, and the residuals of lifted stages.
    pub(in crate::ocp) fn linearise_intervals<C: Curvature<P::Dynamics, T>>(
        &mut self,
        curvature: C,
        mut visit: impl FnMut(usize, &IntervalResult<'_, T>, (Arrays<'_, T>, FreeParametersView<'_>), &[T]),
    ) -> Result<IntervalSums<T>, OcpError> {
        self.check()?;
        #[cfg(feature = "alloc")]
        if self.inner_points.count() > 0 {
            return self.linearise_pieces(curvature, visit);
        }
        if C::EXACT {
            self.update_algebraic_weights()?;
        }
        let layout = self.layout();
        let ld = stage_stride::<P::Shape, T>(layout);
        let Self { problem, qp, iterate, data, step_length, free, .. } = self;
        let free = free.view();
        let data = split_data::<P, T>(data.as_mut(), layout);
        let (v, multipliers) = iterate.variables_and_costates();
        let weights = if C::EXACT { &*data.weights } else { &[] };
        let nodes = interval_nodes::<P::Shape, T>(v, multipliers, weights, (data.p, free), data.times);
        let nodes = Nodes { step_length: *step_length, ..nodes };
        let mut stages = qp.stages_mut();
        let (mut objective, mut left) = (T::ZERO, [T::ZERO; 2]);
        let Problem { dynamics, .. } = problem.parts();
        curvature.run(dynamics, &nodes, &mut |k, step: &IntervalResult<'_, T>| {
            let Some(mut stage) = stages.next() else { return };
            algebraic::store_interval::<P::Shape, T>(data.algebraic, free, k, step);
            objective = objective + step.cost.value;
            if P::Dynamics::LIFTED {
                left = add_stage_residuals(left, step.stage_residuals);
            }
            visit(k, step, (stage.arrays(), free), part(v, k * ld, ld));
        })?;
        Ok((objective, left))
    }

    /// Adds the arrival cost to the QP, with its gradient at zero, or `at_iterate`.
    pub(in crate::ocp) fn add_arrival_cost(&mut self, at_iterate: bool) {
        let layout = self.layout();
        let data = split_data::<P, T>(self.data.as_mut(), layout);
        let x0 = self.iterate.stages().next().filter(|_| at_iterate).map_or(&[][..], |first| first.x);
        arrival::add_to_qp(data.arrival, x0, &mut self.qp);
    }

    /// Stores the objective at the iterate: the sum of intervals and of `costs` at nodes.
    pub(in crate::ocp) fn store_objective(&mut self, (objective, stages): IntervalSums<T>, costs: T) {
        let layout = self.layout();
        let data = split_data::<P, T>(self.data.as_mut(), layout);
        self.objective = objective + costs + arrival::arrival_cost(data.arrival, &self.iterate);
        self.stage_residuals = stages;
    }

    /// Adds costs and constraints at nodes, stage by stage, to Hessians and gradients with the
    /// values of `initialise`. Returns the costs. Stages without other terms have
    /// `has_node_costs_only`.
    pub(in crate::ocp) fn linearise_functions<C: Curvature<P::Dynamics, T>>(
        &mut self,
        has_node_costs_only: bool,
        initialise: impl Fn(usize, &mut [T], &mut [T]),
    ) -> Result<T, OcpError> {
        let layout @ Layout { intervals, .. } = self.layout();
        let first_part = self.inner_points.node_fraction();
        #[cfg(feature = "alloc")]
        let inner = &mut self.inner_points;
        let Self { problem, qp, iterate, data, free, .. } = self;
        let free = free.view();
        let data = split_data::<P, T>(data.as_mut(), layout);
        let Problem { stage_cost, terminal_cost, path, terminal, running, .. } = problem.parts();
        let (v, _) = iterate.variables_and_costates();
        let mut objective = T::ZERO;
        let mut point = <P::Shape as Shape>::ArrayV::<T>::zeroed();
        for (k, (mut stage, stage_point)) in qp.stages_mut().zip(iterate.stages()).enumerate() {
            let Arrays { n, ld, next, rows, matrix, hessian, gradient, limits, .. } = stage.arrays();
            initialise(k, hessian, gradient);
            let node = Node::new::<P>(k, intervals, *running, [data.times, data.p, data.references]);
            let (z, dz) = algebraic::values_and_jacobian::<P::Shape, T>(data.algebraic, layout, k);
            node.write_variables::<P::Shape>(&mut point, &stage_point, z, free);
            let mut direct = QuadraticTerms { free, gradient, hessian, ld };
            let columns = matrix.get_mut(next * ld..).unwrap_or_default();
            let stage_variables = part(v, k * stage_stride::<P::Shape, T>(layout), n);
            let from = if has_node_costs_only && writes_qp_gradient::<P, T>(k == intervals, z) {
                stage_variables
            } else {
                &[]
            };
            // With algebraic states, derivatives with respect to them as well.
            let is_extended = !z.is_empty();
            let mut extended = ExtendedDerivatives::new::<P::Shape>(
                if is_extended { &mut *data.extended } else { &mut [] },
                free,
            );
            let (terms, slopes, ld_slopes) = if is_extended {
                let ld = extended.terms.ld;
                (&mut extended.terms, &mut *extended.columns, ld)
            } else {
                (&mut direct, &mut *columns, ld)
            };
            // Values are stored where the lower bounds are written afterwards.
            let (lower, rest) = limits.split_at_mut_checked(rows).unwrap_or_default();
            let values = lower.get_mut(ld..).unwrap_or_default();
            let count = if k < intervals { path_row_count::<P, T>(layout) } else { P::Terminal::ROWS };
            let values = part_mut(values, 0, count);
            // A running cost has the end time as a factor.
            let end_time_index = free.end_time_index().filter(|_| *running && k < intervals);
            let duration = if end_time_index.is_some() { free.duration(stage_point.u) } else { T::ONE };
            let factor = duration * node.factor * if *running && k < intervals { first_part } else { T::ONE };
            let cost_context = CostContext { stage: k, factor, exact: C::EXACT, model_origin: from };
            let constraint_context =
                ConstraintContext::new(k, free, part(stage_point.u, 0, P::Terminal::INITIAL_STATE_COPIES));
            // `μ = λ_upper − λ_lower`, stored where the upper bounds are written afterwards.
            let mu = part_mut(rest, ld, if C::EXACT { count } else { 0 });
            for ((mu, &upper), &lower) in mu.iter_mut().zip(stage_point.g_upper).zip(stage_point.g_lower) {
                *mu = upper - lower;
            }
            if k < intervals {
                let cost = if let Some(w) = end_time_index {
                    let gradient_before = part_mut(data.scratch, 0, terms.gradient.len());
                    copy_common(gradient_before, terms.gradient);
                    let cost = stage_cost.add_derivatives(&point, node.reference, cost_context, terms)?;
                    terms.add_duration_derivatives(
                        w + P::Shape::NX,
                        [cost, duration],
                        gradient_before,
                        C::EXACT,
                    );
                    cost
                } else {
                    stage_cost.add_derivatives(&point, node.reference, cost_context, terms)?
                };
                objective = objective + cost;
                path.linearise(&point, values, slopes, ld_slopes, constraint_context)?;
                if !mu.is_empty() {
                    path.add_hessian(&point, mu, constraint_context, terms);
                }
            } else {
                objective =
                    objective + terminal_cost.add_derivatives(&point, node.reference, cost_context, terms)?;
                terminal.linearise(&point, values, slopes, ld_slopes, constraint_context)?;
                if !mu.is_empty() {
                    terminal.add_hessian(&point, mu, constraint_context, terms);
                }
            }
            if is_extended {
                let node_row_total = if k < intervals { node_row_count::<P, T>() } else { count };
                extended.eliminate_algebraic::<P::Shape>(
                    dz,
                    &mut direct,
                    part_mut(columns, 0, node_row_total * ld),
                    ld,
                );
            }
            #[cfg(feature = "alloc")]
            if k < intervals && (layout.inner_rows > 0 || inner.has_costs_at_points()) {
                let mu = part(rest, ld, if C::EXACT { count } else { 0 });
                let (values, columns) = (&mut *values, &mut *columns);
                let rows = &mut ConstraintRows {
                    values,
                    columns,
                    ld,
                    terms: Some(&mut direct),
                    mu,
                    stage: stage_point,
                    k,
                };
                let costs = PointCost {
                    cost: &mut *stage_cost,
                    reference: node.reference,
                    running: *running,
                    exact: C::EXACT,
                };
                let point_costs = inner.write_point_rows::<P>(
                    (&mut *path, costs),
                    (z, dz),
                    (data.times, data.p),
                    free,
                    rows,
                )?;
                objective = objective + point_costs;
            }
            if k < intervals {
                link_initial_state_copies::<P, T>(&stage_point, k, (values, columns, ld));
            }
            let given_limits = [&*data.lower, &*data.upper]
                .map(|limits| part(limits, k * path_row_count::<P, T>(layout), count));
            shift_limits(
                columns,
                [n, ld],
                stage_variables,
                [values, part_mut(rest, ld, count)],
                given_limits,
            );
        }
        Ok(objective)
    }

    /// Completes the gradients of the QP, `∇f − H v`, and convexifies Hessians, in all stages whose
    /// costs have not done so.
    fn complete_gradients<C: Curvature<P::Dynamics, T>>(&mut self, curvature: C, has_node_costs_only: bool) {
        let layout @ Layout { intervals, .. } = self.layout();
        let Self { qp, iterate, data, .. } = self;
        let data = split_data::<P, T>(data.as_mut(), layout);
        let (v, _) = iterate.variables_and_costates();
        let ld = stage_stride::<P::Shape, T>(layout);
        for (k, mut stage) in qp.stages_mut().enumerate() {
            let (z, _) = algebraic::values_and_jacobian::<P::Shape, T>(data.algebraic, layout, k);
            if has_node_costs_only && writes_qp_gradient::<P, T>(k == intervals, z) {
                continue;
            }
            let Arrays { n, ld: stage_ld, hessian, gradient, .. } = stage.arrays();
            let convex =
                if k < intervals { P::StageCost::CONVEX } else { P::TerminalCost::CONVEX } && !C::EXACT;
            if !convex {
                convexify(curvature.convexification(), hessian, stage_ld, n, data.scratch);
            }
            let product = part_mut(data.scratch, 0, stage_ld);
            product.fill(T::ZERO);
            add_symmetric_product(product, hessian, stage_ld, part(v, k * ld, stage_ld), n);
            for (gradient, &product) in gradient.iter_mut().zip(&*product) {
                *gradient = *gradient - product;
            }
        }
    }
}

impl<P, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Replaces the objective of the QP at the iterate `v̄` by `½ (v − v̄)ᵀ H (v − v̄)`.
    pub(in crate::ocp) fn centre_objective_at_iterate(&mut self) {
        let (v, _) = self.iterate.variables_and_costates();
        let mut begin = 0;
        for mut stage in self.qp.stages_mut() {
            let Arrays { n, ld, hessian, gradient, .. } = stage.arrays();
            gradient.fill(T::ZERO);
            add_symmetric_product(gradient, hessian, ld, part(v, begin, ld), n);
            gradient.iter_mut().for_each(|g| *g = T::ZERO - *g);
            begin += ld;
        }
    }

    /// Adds `½ δ ‖v − v̄‖²` to the objective of the QP at the iterate `v̄`.
    pub(in crate::ocp) fn regularise(&mut self, delta: T) {
        let (v, _) = self.iterate.variables_and_costates();
        let mut begin = 0;
        for mut stage in self.qp.stages_mut() {
            let Arrays { n, ld, hessian, gradient, .. } = stage.arrays();
            let diagonal = hessian.iter_mut().step_by(ld + 1).take(n);
            for ((h, gradient), &v) in diagonal.zip(gradient).zip(part(v, begin, n)) {
                *h = *h + delta;
                *gradient = *gradient - delta * v;
            }
            begin += ld;
        }
    }
}

/// The costs of all intervals, and the residuals of lifted stages.
type IntervalSums<T> = (T, [T; 2]);

/// Whether costs at a node write the gradient of the QP themselves, if there are no other terms.
fn writes_qp_gradient<P: Formulation<T>, T: Real>(is_last: bool, z: &[T]) -> bool {
    let convex = if is_last { P::TerminalCost::CONVEX } else { P::StageCost::CONVEX };
    convex && z.is_empty()
}

/// Writes the bounds of the linearised constraints, `lg − g + [C D] v`, in place of the values `g`.
pub(super) fn shift_limits<T: Real>(
    columns: &[T],
    [n, ld]: [usize; 2],
    v: &[T],
    [lower, upper]: [&mut [T]; 2],
    [given_lower, given_upper]: [&[T]; 2],
) {
    let limits = lower.iter_mut().zip(upper).zip(given_lower.iter().zip(given_upper));
    for (((lower, upper), (&low, &high)), column) in limits.zip(columns.chunks(ld.max(1))) {
        let shift = dot(part(column, 0, n), v) - *lower;
        (*lower, *upper) = (low + shift, high + shift);
    }
}

/// The distance of stages in vectors `v`.
pub(super) const fn stage_stride<S: Shape, T>(layout: Layout) -> usize {
    padded_len::<T>(stage_variable_count::<S>(layout.free_count))
}
