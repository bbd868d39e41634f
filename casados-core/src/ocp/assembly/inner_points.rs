//! Constraints at points inside intervals, in the QP.
//!
//! Functions at a point depend on `(x_j, w, u, z_j)`, and through the preceding pieces on
//! `(x, w, u)`, with `M = ∂(x_j, w, u, z_j)/∂(x, w, u)`:
//!
//! ```text
//! ∇g = Mᵀ ∇g_j        ∇² = Mᵀ ∇²(μᵀg_j) M, and what pieces add
//! ```

use crate::ocp::assembly::algebraic::{self, ExtendedDerivatives};
use crate::ocp::assembly::piecewise_integration::PiecewiseIntegration;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::free_parameters::FreeParametersView;
use crate::ocp::formulation::functions::constraint::{ConstraintContext, Constraints};
use crate::ocp::formulation::functions::cost::{Cost, CostContext};
use crate::ocp::formulation::functions::dynamics::{Dynamics, IntervalResult};
use crate::ocp::formulation::functions::node_evaluation::QuadraticTerms;
use crate::ocp::formulation::instance::data::{
    Layout, Node, node_row_count, split_data, stage_variable_count,
};
use crate::ocp::formulation::instance::inner_points::piece_memory::{PieceMemory, PieceSizes, PointSolution};
use crate::ocp::formulation::instance::inner_points::{InnerPoints, check_supports_pieces};
use crate::ocp::formulation::instance::{Ocp, interval_nodes};
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::ocp::formulation::program::curvature::Curvature;
use crate::qp::element::get;
use crate::qp::{Arrays, Solution, SolutionStage, StageDims, part, part_mut};
use crate::scalar::Real;
use crate::shape::Shape;
use bytemuck::Zeroable;

impl<T: Real> InnerPoints<T> {
    fn piecewise_integration<S: Shape>(&mut self) -> PiecewiseIntegration<'_, T> {
        let sizes = PieceSizes::for_points::<S, T>(self);
        let (parts, memory) = self.fractions_and_memory();
        PiecewiseIntegration { sizes, fractions: parts, memory }
    }

    /// The states of a stage at a point.
    pub(in crate::ocp) fn point_solution<S: Shape>(
        &self,
        stage: usize,
        point: usize,
    ) -> PointSolution<'_, T> {
        PieceSizes::for_points::<S, T>(self).point_solution(&self.piece_memory.solutions, stage, point)
    }
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Linearises the intervals piece by piece, like `linearise_intervals`.
    pub(super) fn linearise_pieces<C: Curvature<P::Dynamics, T>>(
        &mut self,
        curvature: C,
        mut visit: impl FnMut(usize, &IntervalResult<'_, T>, (Arrays<'_, T>, FreeParametersView<'_>), &[T]),
    ) -> Result<(T, [T; 2]), OcpError> {
        let layout @ Layout { intervals, .. } = self.layout();
        let Self { problem, iterate, data, free, inner_points: inner, .. } = self;
        let (free, Problem { dynamics, .. }) = (free.view(), problem.parts());
        check_supports_pieces::<P::Dynamics, T>(dynamics)?;
        let parts = split_data::<P, T>(data.as_mut(), layout);
        let (v, multipliers) = iterate.variables_and_costates();
        let iterate_nodes = interval_nodes::<P::Shape, T>(v, multipliers, &[], (parts.p, free), parts.times);
        let mut pieces = inner.piecewise_integration::<P::Shape>();
        pieces.forward(&iterate_nodes, true, &mut |nodes, sink| dynamics.linearise(nodes, sink))?;
        pieces.visit_intervals(intervals, true, false, |k, step| {
            algebraic::store_interval::<P::Shape, T>(parts.algebraic, free, k, step);
        });
        if C::EXACT {
            self.update_algebraic_weights()?;
            self.update_point_weights()?;
            let Self { problem, iterate, data, free, inner_points: inner, .. } = self;
            let Problem { dynamics, .. } = problem.parts();
            let parts = split_data::<P, T>(data.as_mut(), layout);
            let (v, multipliers) = iterate.variables_and_costates();
            let iterate_nodes = interval_nodes::<P::Shape, T>(
                v,
                multipliers,
                parts.weights,
                (parts.p, free.view()),
                parts.times,
            );
            inner
                .piecewise_integration::<P::Shape>()
                .backward(&iterate_nodes, &mut |nodes, sink| curvature.run(dynamics, nodes, sink))?;
        }
        let Self { qp, iterate, inner_points: inner, free, .. } = self;
        let ((v, _), ld, mut objective) =
            (iterate.variables_and_costates(), stage_stride::<P::Shape, T>(layout), T::ZERO);
        let mut stages = qp.stages_mut();
        inner.piecewise_integration::<P::Shape>().visit_intervals(intervals, true, C::EXACT, |k, step| {
            let Some(mut stage) = stages.next() else { return };
            objective = objective + step.cost.value;
            visit(k, step, (stage.arrays(), free.view()), part(v, k * ld, ld));
        });
        Ok((objective, [T::ZERO; 2]))
    }

    /// Simulates all pieces at a point, and visits the intervals.
    ///
    /// # Errors
    /// [`OcpError::Integration`], [`OcpError::Unsupported`]
    pub(in crate::ocp) fn simulate_pieces(
        &mut self,
        at: Option<&Solution<T, D, M>>,
        mut visit: impl FnMut(usize, &IntervalResult<'_, T>),
    ) -> Result<(), OcpError> {
        let layout @ Layout { intervals, .. } = self.layout();
        let Self { problem, iterate, data, free, inner_points: inner, .. } = self;
        let (free, Problem { dynamics, .. }) = (free.view(), problem.parts());
        check_supports_pieces::<P::Dynamics, T>(dynamics)?;
        let data = split_data::<P, T>(data.as_mut(), layout);
        let (v, multipliers) = at.unwrap_or(iterate).variables_and_costates();
        let iterate_nodes = interval_nodes::<P::Shape, T>(v, multipliers, &[], (data.p, free), data.times);
        let mut pieces = inner.piecewise_integration::<P::Shape>();
        pieces.forward(&iterate_nodes, false, &mut |nodes, sink| dynamics.simulate(nodes, sink))?;
        pieces.visit_intervals(intervals, false, false, |k, step| {
            algebraic::store_interval::<P::Shape, T>(data.algebraic, free, k, step);
            visit(k, step);
        });
        Ok(())
    }

    /// Computes the multipliers and weights of constraints at points.
    fn update_point_weights(&mut self) -> Result<(), OcpError> {
        let layout @ Layout { intervals, .. } = self.layout();
        let free = self.free.view();
        let Self { problem, iterate, data, inner_points: inner, .. } = self;
        let data = split_data::<P, T>(data.as_mut(), layout);
        let Problem { stage_cost, path, running, .. } = problem.parts();
        let [nx, nz, n] = [P::Shape::NX, P::Shape::NZ, stage_variable_count::<P::Shape>(free.count())];
        let mut point = <P::Shape as Shape>::ArrayV::<T>::zeroed();
        for (k, stage) in iterate.stages().enumerate().take(intervals) {
            for j in 1..=inner.count() {
                let node = inner.point_node::<P>(k, j, (data.times, data.p));
                let mut extended = core::mem::take(&mut inner.piece_memory.extended_derivatives);
                let solution = inner.point_solution::<P::Shape>(k, j);
                node.write_variables::<P::Shape>(
                    &mut point,
                    &SolutionStage { x: solution.x, ..stage },
                    solution.z,
                    free,
                );
                let ExtendedDerivatives { mut terms, columns } =
                    ExtendedDerivatives::new::<P::Shape>(&mut extended, free);
                let mut linearised =
                    path.linearise(&point, &mut [], columns, terms.ld, ConstraintContext::new(k, free, &[]));
                if inner.has_costs_at_points() {
                    let node_of_stage =
                        Node::new::<P>(k, intervals, *running, [data.times, data.p, data.references]);
                    let factor =
                        node_of_stage.factor * if *running { inner.fraction_to_next(j) } else { T::ONE };
                    let factor = factor * if *running { free.duration(stage.u) } else { T::ONE };
                    let cost_context = CostContext { stage: k, factor, exact: false, model_origin: &[] };
                    let added =
                        stage_cost.add_derivatives(&point, node_of_stage.reference, cost_context, &mut terms);
                    linearised = linearised.and(added.map(|_| ()));
                }
                let point_index = (j - 1) * intervals + k;
                let PieceMemory { weights, constraint_gradients: forces, .. } = &mut inner.piece_memory;
                let (forces, weights) =
                    (part_mut(forces, point_index * nx, nx), part_mut(weights, point_index * nz, nz));
                crate::qp::copy_common(forces, terms.gradient);
                crate::qp::copy_common(weights, part(terms.gradient, n, nz));
                for (row, column) in columns.chunks_exact(terms.ld.max(1)).take(P::Path::ROWS).enumerate() {
                    let mu = multiplier(&stage, node_row_count::<P, T>() + (j - 1) * P::Path::ROWS + row);
                    forces.iter_mut().zip(column).for_each(|(force, &slope)| *force = *force + mu * slope);
                    let algebraic_gradient = part(column, n, nz);
                    weights
                        .iter_mut()
                        .zip(algebraic_gradient)
                        .for_each(|(weight, &slope)| *weight = *weight + mu * slope);
                }
                inner.piece_memory.extended_derivatives = extended;
                linearised?;
                let first_variable_row = node_row_count::<P, T>() + inner.count() * P::Path::ROWS;
                for i in 0..inner.bounded_variables().len() {
                    let Some(&(variable, at)) = inner.bounded_variables().get(i) else { continue };
                    let PieceMemory { weights, constraint_gradients: forces, .. } = &mut inner.piece_memory;
                    let (to, index) = match variable.checked_sub(nx) {
                        None => (part_mut(forces, point_index * nx, nx), variable),
                        Some(z) => (part_mut(weights, point_index * nz, nz), z),
                    };
                    if let Some(to) = to.get_mut(index).filter(|_| at == j) {
                        *to = *to + multiplier(&stage, first_variable_row + i);
                    }
                }
            }
        }
        Ok(())
    }
}

/// `λ_upper − λ_lower`
fn multiplier<T: Real>(stage: &SolutionStage<'_, T>, row: usize) -> T {
    get(stage.g_upper, row) - get(stage.g_lower, row)
}

/// The distance of stages in vectors `v`.
fn stage_stride<S: Shape, T>(layout: Layout) -> usize {
    crate::qp::padded_len::<T>(stage_variable_count::<S>(layout.free_count))
}

/// The rows of a stage that are written.
pub(super) struct ConstraintRows<'a, 'b, 'c, T> {
    pub values: &'a mut [T],
    /// Gradients of the rows, and their distance; empty if only values are required.
    pub columns: &'a mut [T],
    pub ld: usize,
    /// Gradient and Hessian, if required.
    pub terms: Option<&'a mut QuadraticTerms<'c, T>>,
    /// `μ` of all rows, if the Hessian is exact.
    pub mu: &'a [T],
    pub stage: SolutionStage<'b, T>,
    /// The index of the stage.
    pub k: usize,
}

impl<'a, 'b, T: Real> ConstraintRows<'a, 'b, '_, T> {
    /// Rows without derivatives.
    pub fn without_derivatives(values: &'a mut [T], stage: SolutionStage<'b, T>, k: usize) -> Self {
        Self { values, columns: &mut [], ld: 0, terms: None, mu: &[], stage, k }
    }
}

/// Costs of a stage, which are evaluated at points too if controls are piecewise constant.
pub(super) struct PointCost<'a, C, T> {
    pub cost: &'a mut C,
    pub reference: &'a [T],
    pub running: bool,
    pub exact: bool,
}

impl<T: Real> InnerPoints<T> {
    /// The fraction of the interval from a point to the next one.
    fn fraction_to_next(&self, point: usize) -> T {
        self.fraction(point + 1) - self.fraction(point)
    }

    /// Time and parameters at a point.
    fn point_node<'a, P: Formulation<T>>(
        &self,
        k: usize,
        point: usize,
        (times, p): (&'a [T], &'a [T]),
    ) -> Node<'a, T> {
        let [start, end] = [k, k + 1].map(|node| get(times, node));
        let (time, np) = (start + self.fraction(point) * (end - start), P::Shape::NP);
        Node { time, p: part(p, k * np, np), reference: &[], factor: T::ONE }
    }

    /// Writes the rows of a stage, with `z` and `∂z/∂(x, w, u)` at its node. Returns the costs at
    /// points.
    ///
    /// # Errors
    /// [`OcpError::NonFiniteFunction`]
    pub(super) fn write_point_rows<P: Formulation<T>>(
        &mut self,
        (path, mut costs): (&mut P::Path, PointCost<'_, P::StageCost, T>),
        (z, dz): (&[T], &[T]),
        times_and_parameters: (&[T], &[T]),
        free: FreeParametersView<'_>,
        rows: &mut ConstraintRows<'_, '_, '_, T>,
    ) -> Result<T, OcpError> {
        let mut sum = T::ZERO;
        let mut point = <P::Shape as Shape>::ArrayV::<T>::zeroed();
        let first_row = node_row_count::<P, T>();
        for j in 1..=self.count() {
            let node = self.point_node::<P>(rows.k, j, times_and_parameters);
            let first_path_row = first_row + (j - 1) * P::Path::ROWS;
            let mut extended = core::mem::take(&mut self.piece_memory.extended_derivatives);
            let mut product = core::mem::take(&mut self.piece_memory.product);
            let solution = self.point_solution::<P::Shape>(rows.k, j);
            node.write_variables::<P::Shape>(
                &mut point,
                &SolutionStage { x: solution.x, ..rows.stage },
                solution.z,
                free,
            );
            let interval = get(times_and_parameters.0, rows.k + 1) - get(times_and_parameters.0, rows.k);
            let factor = if costs.running { interval * self.fraction_to_next(j) } else { T::ONE };
            let costs = self.has_costs_at_points().then_some((&mut costs, factor));
            let memory = [&mut extended[..], &mut product[..]];
            let written =
                rows.write_point::<P>((&mut *path, costs), &point, (&solution, free), first_path_row, memory);
            (self.piece_memory.extended_derivatives, self.piece_memory.product) = (extended, product);
            sum = sum + written?;
        }
        for i in 0..self.bounded_variables().len() {
            let row = first_row + self.count() * P::Path::ROWS + i;
            let Some(&(variable, at)) = self.bounded_variables().get(i) else { continue };
            let n = stage_variable_count::<P::Shape>(free.count());
            let column = part_mut(rows.columns, row * rows.ld, n);
            let value = match at {
                0 => {
                    let z_index = variable.saturating_sub(P::Shape::NX);
                    column.iter_mut().zip(part(dz, z_index * n, n)).for_each(|(to, &slope)| *to = slope);
                    get(z, z_index)
                }
                point => {
                    let solution = self.point_solution::<P::Shape>(rows.k, point);
                    for (a, to) in column.iter_mut().enumerate() {
                        *to = solution.derivative::<P::Shape>(variable, a, free);
                    }
                    match variable.checked_sub(P::Shape::NX) {
                        None => get(solution.x, variable),
                        Some(z) => get(solution.z, z),
                    }
                }
            };
            crate::qp::element::set(rows.values, row, value);
        }
        Ok(sum)
    }
}

impl<T: Real> PointSolution<'_, T> {
    /// The derivative of a state, or of an algebraic state (index after the states), with respect
    /// to an element of `(x, w, u)`.
    fn derivative<S: Shape>(&self, variable: usize, input: usize, free: FreeParametersView<'_>) -> T {
        let Some(column) = model_input::<S>(input, free) else { return T::ZERO };
        match variable.checked_sub(S::NX) {
            None => get(self.dx, column * S::NX + variable),
            Some(z) => get(self.dz, column * S::NZ + z),
        }
    }
}

/// The index in `(x, u, p)` of a variable in `(x, w, u)`; `None` for copies of the first state.
fn model_input<S: Shape>(variable: usize, free: FreeParametersView<'_>) -> Option<usize> {
    let Some(index_after_states) = variable.checked_sub(S::NX) else { return Some(variable) };
    match index_after_states.checked_sub(free.count()) {
        Some(u) => Some(S::NX + u),
        None => free.model_parameter(index_after_states).map(|p| S::NX + S::NU + p),
    }
}

/// Costs at a point, and their factor.
type PointCostAndFactor<'a, 'c, C, T> = Option<(&'a mut PointCost<'c, C, T>, T)>;

impl<T: Real> ConstraintRows<'_, '_, '_, T> {
    /// Writes the path constraints at a point, starting at a row, and returns the costs there.
    #[allow(clippy::type_complexity)]
    fn write_point<P: Formulation<T>>(
        &mut self,
        (path, costs): (&mut P::Path, PointCostAndFactor<'_, '_, P::StageCost, T>),
        point: &<P::Shape as Shape>::ArrayV<T>,
        (solution, free): (&PointSolution<'_, T>, FreeParametersView<'_>),
        first_row: usize,
        [extended, product]: [&mut [T]; 2],
    ) -> Result<T, OcpError> {
        let count = P::Path::ROWS;
        let (values, spot) =
            (part_mut(self.values, first_row, count), ConstraintContext::new(self.k, free, &[]));
        let (k, duration) = (self.k, free.duration(self.stage.u));
        let Some(terms) = &mut self.terms else {
            path.value(point, values, spot)?;
            let Some((costs, factor)) = costs else { return Ok(T::ZERO) };
            let factor = if costs.running { duration * factor } else { factor };
            return Ok(factor * costs.cost.value(point, costs.reference, k)?);
        };
        let (n, nx) = (stage_variable_count::<P::Shape>(free.count()), P::Shape::NX);
        let (ld, dependent) = (n + P::Shape::NZ, nx + P::Shape::NZ);
        // The index in `(x, w, u, z)` of states and algebraic states of the point.
        let extended_index = |variable: usize| if variable < nx { variable } else { n + variable - nx };
        let derivative = |variable: usize, a: usize| solution.derivative::<P::Shape>(variable, a, free);
        let mut point_derivatives = ExtendedDerivatives::new::<P::Shape>(extended, free);
        path.linearise(point, values, point_derivatives.columns, ld, spot)?;
        let to = part_mut(self.columns, first_row * self.ld, count * self.ld);
        for (to, own_column) in to.chunks_exact_mut(self.ld).zip(point_derivatives.columns.chunks_exact(ld)) {
            for (a, to) in to.iter_mut().enumerate().take(n) {
                let direct = if a < nx { T::ZERO } else { get(own_column, a) };
                *to = (0..dependent)
                    .fold(direct, |sum, i| sum + get(own_column, extended_index(i)) * derivative(i, a));
            }
        }
        let (mu, mut cost) = (part(self.mu, first_row, count), T::ZERO);
        if mu.is_empty() && costs.is_none() {
            return Ok(cost);
        }
        if !mu.is_empty() {
            path.add_hessian(point, mu, spot, &mut point_derivatives.terms);
        }
        if let Some((costs, factor)) = costs {
            let end = free.end_time_index().filter(|_| costs.running);
            let factor = if end.is_some() { duration * factor } else { factor };
            let cost_context = CostContext { stage: k, factor, exact: costs.exact, model_origin: &[] };
            cost = costs.cost.add_derivatives(
                point,
                costs.reference,
                cost_context,
                &mut point_derivatives.terms,
            )?;
            if let Some(w) = end {
                // No other term has a gradient here.
                let zeros = part_mut(product, 0, ld);
                zeros.fill(T::ZERO);
                point_derivatives.terms.add_duration_derivatives(
                    w + nx,
                    [cost, duration],
                    zeros,
                    costs.exact,
                );
            }
        }
        for a in 0..n {
            let direct = if a < nx { T::ZERO } else { get(point_derivatives.terms.gradient, a) };
            let gradient_element = (0..dependent).fold(direct, |sum, i| {
                sum + get(point_derivatives.terms.gradient, extended_index(i)) * derivative(i, a)
            });
            terms.add_gradient(a, gradient_element);
        }
        // Columns of `H M`, then rows of `Mᵀ` times these.
        for (a, product) in product.chunks_exact_mut(ld).enumerate().take(n) {
            for (i, to) in product.iter_mut().enumerate() {
                let direct = if a < nx { T::ZERO } else { point_derivatives.hessian(i, a) };
                *to = (0..dependent).fold(direct, |sum, l| {
                    sum + point_derivatives.hessian(i, extended_index(l)) * derivative(l, a)
                });
            }
            for b in a..n {
                let direct = if b < nx { T::ZERO } else { get(product, b) };
                let value = (0..dependent)
                    .fold(direct, |sum, l| sum + get(product, extended_index(l)) * derivative(l, b));
                terms.add_hessian(b, a, value);
            }
        }
        Ok(cost)
    }
}
