//! Derivatives of the optimality conditions with respect to parameters.

use crate::linalg::{axpy, dot};
use crate::ocp::assembly::algebraic::{self, ExtendedDerivatives};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::free_parameters::FreeParametersView;
use crate::ocp::formulation::functions::constraint::{ConstraintContext, Constraints};
use crate::ocp::formulation::functions::cost::{Cost, CostContext};
use crate::ocp::formulation::functions::dynamics::IntervalResult;
use crate::ocp::formulation::functions::node_evaluation::ParameterDerivatives;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::instance::data::{Node, split_data, stage_variable_count};
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::qp::element::{get, set};
use crate::qp::{SolutionStage, StageDims, copy_common, part, part_mut, zeros};
use crate::scalar::Real;
use crate::shape::Shape;
use alloc::vec::Vec;
use bytemuck::Zeroable;

/// Derivatives with respect to `p`, by stages.
#[derive(Clone, Debug, Default)]
pub(in crate::ocp) struct KktParameterDerivatives<T> {
    /// `NX`, free parameters and `NU`, `NP`
    dims: [usize; 3],
    /// The number of free parameters.
    free: usize,
    /// The number of path constraints of a stage except the last, and of terminal constraints.
    rows: usize,
    terminal_rows: usize,
    intervals: usize,
    /// `∂φ/∂p`, by columns.
    end_jacobians: Vec<T>,
    /// `∂²L/∂(x, u)∂p`, by columns.
    gradient_jacobians: Vec<T>,
    /// `∂g/∂p`, by rows.
    constraint_jacobians: Vec<T>,
    /// `∂L/∂p`, the gradient of the optimal value, and `∂²L/∂p²`: sums over all stages.
    pub(in crate::ocp) value_gradient: Vec<T>,
    pub(in crate::ocp) value_hessian: Vec<T>,
    /// `∂z/∂p`, by columns.
    algebraic_jacobians: Vec<T>,
    /// `∂²L/∂(x, u, z)∂p` of a stage for constant `z`.
    extended_gradient_jacobian: Vec<T>,
    /// Workspace for gradients over `(x, w, u, z)` or `p`.
    cost_gradient: Vec<T>,
    /// `μ` of the constraints of a stage, and their values.
    mu: Vec<T>,
    values: Vec<T>,
}

impl<T: Real> KktParameterDerivatives<T> {
    pub(in crate::ocp) fn new<P: Formulation<T>>(free: usize, n: usize) -> Result<Self, OcpError> {
        let dims @ [nx, nu, np] = [P::Shape::NX, free + P::Shape::NU, P::Shape::NP];
        Ok(Self {
            dims,
            free,
            rows: P::Path::ROWS,
            terminal_rows: P::Terminal::ROWS,
            intervals: n,
            end_jacobians: zeros(n * nx * np)?,
            gradient_jacobians: zeros((n + 1) * (nx + nu) * np)?,
            constraint_jacobians: zeros((n * P::Path::ROWS + P::Terminal::ROWS) * np)?,
            value_gradient: zeros(np)?,
            value_hessian: zeros(np * np)?,
            algebraic_jacobians: zeros(n * P::Shape::NZ * np)?,
            extended_gradient_jacobian: zeros((nx + nu + P::Shape::NZ) * np)?,
            cost_gradient: zeros((nx + nu + P::Shape::NZ).max(np))?,
            mu: zeros(P::Path::ROWS.max(P::Terminal::ROWS))?,
            values: zeros(P::Path::ROWS)?,
        })
    }

    /// `∂φ/∂p` of an interval.
    pub(in crate::ocp) fn end_jacobian(&self, k: usize) -> &[T] {
        let [nx, _, np] = self.dims;
        part(&self.end_jacobians, k * nx * np, nx * np)
    }
    /// `∂²L/∂(x, u)∂p` of a stage.
    pub(in crate::ocp) fn gradient_jacobian(&self, k: usize) -> &[T] {
        let [nx, nu, np] = self.dims;
        part(&self.gradient_jacobians, k * (nx + nu) * np, (nx + nu) * np)
    }
    /// The derivatives of the functions of a stage, for terms to be added.
    pub(in crate::ocp) fn stage_derivatives<'a>(
        &'a mut self,
        k: usize,
        free: FreeParametersView<'a>,
    ) -> ParameterDerivatives<'a, T> {
        let [nx, nu, np] = self.dims;
        ParameterDerivatives {
            free,
            mixed_columns: part_mut(&mut self.gradient_jacobians, k * (nx + nu) * np, (nx + nu) * np),
            ld: nx + nu,
            gradient: &mut self.value_gradient,
            hessian: &mut self.value_hessian,
        }
    }
    /// Adds the stiffness of a constraint with the gradient `c` over `(x, u)`.
    pub(in crate::ocp) fn add_constraint(&mut self, [k, row]: [usize; 2], stiffness: T, c: &[T]) {
        let [nx, nu, np] = self.dims;
        if row >= self.row_count(k) {
            return;
        }
        let size = nx + nu;
        let slopes = part(&self.constraint_jacobians, (k * self.rows + row) * np, np);
        for (p, &slope) in slopes.iter().enumerate() {
            axpy(stiffness * slope, c, part_mut(&mut self.gradient_jacobians, (k * np + p) * size, c.len()));
            axpy(stiffness * slope, slopes, part_mut(&mut self.value_hessian, p * np, np));
        }
    }

    /// The derivative of a constraint row by a parameter.
    pub(in crate::ocp) fn constraint_slope(&self, stage: usize, row: usize, p: usize) -> T {
        let [_, _, np] = self.dims;
        if row < self.row_count(stage) {
            get(&self.constraint_jacobians, (stage * self.rows + row) * np + p)
        } else {
            T::ZERO
        }
    }

    /// The number of rows of a stage that depend on parameters: path or terminal constraints.
    fn row_count(&self, k: usize) -> usize {
        if k < self.intervals { self.rows } else { self.terminal_rows }
    }

    /// Clears the derivatives with respect to free parameters, whose values are results.
    pub(in crate::ocp) fn clear_free_parameters(&mut self, free: FreeParametersView<'_>) {
        let [nx, nu, np] = self.dims;
        for p in (0..np).filter(|&p| free.index_of(p).is_some()) {
            for (list, rows) in [(&mut self.end_jacobians, nx), (&mut self.gradient_jacobians, nx + nu)] {
                list.chunks_exact_mut(rows.max(1))
                    .skip(p)
                    .step_by(np)
                    .for_each(|column| column.fill(T::ZERO));
            }
            self.constraint_jacobians.iter_mut().skip(p).step_by(np).for_each(|slope| *slope = T::ZERO);
            set(&mut self.value_gradient, p, T::ZERO);
            for q in 0..np {
                set(&mut self.value_hessian, p * np + q, T::ZERO);
                set(&mut self.value_hessian, q * np + p, T::ZERO);
            }
        }
    }

    /// Resets all sums before the first interval.
    pub(in crate::ocp) fn reset(&mut self) {
        self.value_gradient.fill(T::ZERO);
        self.value_hessian.fill(T::ZERO);
        self.constraint_jacobians.fill(T::ZERO);
    }

    /// Adds `πᵀ ∂φ/∂p + μᵀ ∂g/∂p` of all stages to the gradient of the value.
    fn add_value_gradient<'a>(&mut self, stages: impl Iterator<Item = SolutionStage<'a, T>>)
    where
        T: 'a,
    {
        let [nx, _, np] = self.dims;
        for (k, stage_point) in stages.enumerate() {
            let rows = self.row_count(k);
            let columns = part(&self.end_jacobians, k * nx * np, nx * np).chunks_exact(nx.max(1));
            for (column, value_slope) in columns.zip(&mut self.value_gradient) {
                *value_slope = *value_slope + dot(column, stage_point.dynamics);
            }
            for (row, (&upper, &lower)) in
                stage_point.g_upper.iter().zip(stage_point.g_lower).enumerate().take(rows)
            {
                let slopes = part(&self.constraint_jacobians, (k * self.rows + row) * np, np);
                axpy(upper - lower, slopes, &mut self.value_gradient);
            }
        }
    }

    /// Adds an interval.
    pub(in crate::ocp) fn add_interval(
        &mut self,
        k: usize,
        step: &IntervalResult<'_, T>,
        view: FreeParametersView<'_>,
    ) {
        let [nx, nu, np] = self.dims;
        let (size, nz) = (nx + nu, step.z.len());
        copy_common(part_mut(&mut self.algebraic_jacobians, k * nz * np, nz * np), step.dz[2]);
        copy_common(part_mut(&mut self.end_jacobians, k * nx * np, nx * np), step.dp);
        let columns = part_mut(&mut self.gradient_jacobians, k * size * np, size * np);
        columns.fill(T::ZERO);
        let (slopes, square) = (&mut *self.value_gradient, &mut *self.value_hessian);
        let mut cross = ParameterDerivatives {
            free: view,
            mixed_columns: columns,
            ld: size,
            gradient: slopes,
            hessian: square,
        };
        cross.add_blocks([nx, nu - self.free], step.hessian_p);
        cross.add_blocks([nx, nu - self.free], step.cost.hessian_p);
        step.cost.p.iter().enumerate().for_each(|(p, &slope)| cross.add_gradient(p, slope));
    }
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Adds costs and constraints, after the intervals.
    pub(in crate::ocp) fn differentiate_functions(
        &mut self,
        exact: bool,
        result: &mut KktParameterDerivatives<T>,
    ) -> Result<(), OcpError> {
        let intervals = self.intervals();
        let (layout, free) = (self.layout(), self.free.view());
        let (np, size) = (P::Shape::NP, stage_variable_count::<P::Shape>(layout.free_count));
        if np == 0 {
            return Ok(());
        }
        let data = split_data::<P, T>(self.data.as_mut(), layout);
        let Problem { stage_cost, terminal_cost, path, terminal, running, .. } = self.problem.parts();
        let KktParameterDerivatives {
            gradient_jacobians: gradients,
            constraint_jacobians: slopes,
            algebraic_jacobians: dz_dp,
            extended_gradient_jacobian: extended,
            mu,
            values,
            cost_gradient,
            rows,
            value_gradient: of_value,
            value_hessian: square,
            ..
        } = &mut *result;
        let mut point = <P::Shape as Shape>::ArrayV::<T>::zeroed();
        for (k, stage_point) in self.iterate.stages().enumerate() {
            let node = Node::new::<P>(k, intervals, *running, [data.times, data.p, data.references]);
            let (z, dz) = algebraic::values_and_jacobian::<P::Shape, T>(data.algebraic, layout, k);
            node.write_variables::<P::Shape>(&mut point, &stage_point, z, free);
            let columns = part_mut(gradients, k * size * np, size * np);
            if k == intervals {
                columns.fill(T::ZERO);
            }
            let mut cross = ParameterDerivatives {
                free,
                mixed_columns: columns,
                ld: size,
                gradient: of_value,
                hessian: square,
            };
            for ((mu, &upper), &lower) in mu.iter_mut().zip(stage_point.g_upper).zip(stage_point.g_lower) {
                *mu = upper - lower;
            }
            let mu = exact.then_some(&**mu);
            let slopes = slopes.get_mut(k * *rows * np..).unwrap_or_default();
            let copies = part(stage_point.u, 0, P::Terminal::INITIAL_STATE_COPIES);
            let constraint_context = ConstraintContext::new(k, free, copies);
            let end_time = free.end_time_index().filter(|_| *running && k < intervals);
            let end_time = end_time.map(|w| (P::Shape::NX + w, free.duration(stage_point.u)));
            let factor = end_time.map_or(T::ONE, |(_, duration)| duration) * node.factor;
            let context = CostContext { stage: k, factor, exact, model_origin: &[] };
            if k == intervals {
                terminal_cost.add_parameter_derivatives(&point, node.reference, context, &mut cross)?;
                terminal.add_parameter_derivatives(&point, mu, constraint_context, slopes, &mut cross);
                continue;
            }
            let mut target = StageDerivatives { extended, cost_gradient, end_time };
            if z.is_empty() {
                target.add_cost::<P::Shape, P::StageCost>(
                    stage_cost,
                    (&point, node.reference),
                    context,
                    &mut cross,
                )?;
                path.add_parameter_derivatives(&point, mu, constraint_context, slopes, &mut cross);
                continue;
            }
            target.add_direct::<P>(
                (stage_cost, path),
                (&point, node.reference, mu),
                (context, constraint_context),
                &mut cross,
                slopes,
            )?;
            let ExtendedDerivatives { mut terms, columns } =
                ExtendedDerivatives::new::<P::Shape>(data.extended, free);
            stage_cost.add_derivatives(&point, node.reference, context, &mut terms).map(|cost| {
                let before = part_mut(target.cost_gradient, 0, terms.gradient.len());
                before.fill(T::ZERO);
                if let Some((w, duration)) = target.end_time {
                    terms.add_duration_derivatives(w, [cost, duration], before, exact);
                }
            })?;
            path.linearise(&point, values, columns, terms.ld, constraint_context)?;
            if let Some(mu) = mu {
                path.add_hessian(&point, mu, constraint_context, &mut terms);
            }
            let dp = part(dz_dp, k * z.len() * np, z.len() * np);
            ExtendedDerivatives { terms, columns }.eliminate_algebraic_for_parameters::<P::Shape>(
                [dz, dp],
                target.extended,
                &mut cross,
                slopes,
            );
        }
        result.add_value_gradient(self.iterate.stages());
        Ok(())
    }
}

/// The variables of a stage, its reference, and the multipliers of its path constraints.
type StageArguments<'a, S, T> = (&'a <S as Shape>::ArrayV<T>, &'a [T], Option<&'a [T]>);

/// Derivatives of the functions of a stage with respect to parameters.
struct StageDerivatives<'a, T> {
    /// `∂²L/∂(x, w, u, z)∂p` for constant `z`.
    extended: &'a mut [T],
    /// Workspace for gradients.
    cost_gradient: &'a mut [T],
    /// The index of the end time among the variables and its value, where it is a factor of the
    /// cost.
    end_time: Option<(usize, T)>,
}

impl<T: Real> StageDerivatives<'_, T> {
    /// Adds a cost `T l`, with `∂l/∂p` in the row of the end time `T`.
    fn add_cost<S: Shape, C: Cost<S, T>>(
        &mut self,
        cost: &mut C,
        (point, reference): (&S::ArrayV<T>, &[T]),
        context: CostContext<'_, T>,
        cross: &mut ParameterDerivatives<'_, T>,
    ) -> Result<(), OcpError> {
        let before = part_mut(self.cost_gradient, 0, cross.gradient.len());
        copy_common(before, cross.gradient);
        cost.add_parameter_derivatives(point, reference, context, cross)?;
        if let Some((row, duration)) = self.end_time.filter(|_| context.exact) {
            for (p, &before) in before.iter().enumerate() {
                let slope = (get(cross.gradient, p) - before) / duration;
                cross.add_mixed(row, p, slope);
            }
        }
        Ok(())
    }

    /// Writes the derivatives of cost and path constraints for constant algebraic states.
    fn add_direct<P: Formulation<T>>(
        &mut self,
        (cost, path): (&mut P::StageCost, &mut P::Path),
        (point, reference, mu): StageArguments<'_, P::Shape, T>,
        (context, constraint_context): (CostContext<'_, T>, ConstraintContext<'_, T>),
        cross: &mut ParameterDerivatives<'_, T>,
        slopes: &mut [T],
    ) -> Result<(), OcpError> {
        let Self { extended, cost_gradient, end_time } = self;
        extended.fill(T::ZERO);
        let ParameterDerivatives { free, ld, gradient, hessian, .. } = cross;
        let mut direct = ParameterDerivatives {
            free: *free,
            mixed_columns: extended,
            ld: *ld + P::Shape::NZ,
            gradient,
            hessian,
        };
        let mut target = StageDerivatives { extended: &mut [], cost_gradient, end_time: *end_time };
        target.add_cost::<P::Shape, P::StageCost>(cost, (point, reference), context, &mut direct)?;
        path.add_parameter_derivatives(point, mu, constraint_context, slopes, &mut direct);
        Ok(())
    }
}
