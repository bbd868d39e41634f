//! Algebraic states at nodes: functions of `(x, u, z)` depend on `(x, u)` through the integrator,
//! `z = ζ(x, u, p)`.
//!
//! With `L = l + μᵀg` and `ν = ∂L/∂z`:
//!
//! ```text
//! ∇L = L_v + Zᵀν        ∇²L = [I; Z]ᵀ L'' [I; Z] + Σ_j ν_j ∇²ζ_j        v = (x, u), Z = ∂ζ/∂v
//! ```
//!
//! The integrator computes the last term from the weights `ν`, like that of the dynamics from `π`.

use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::free_parameters::FreeParametersView;
use crate::ocp::formulation::functions::constraint::{ConstraintContext, Constraints};
use crate::ocp::formulation::functions::cost::{Cost, CostContext};
use crate::ocp::formulation::functions::dynamics::{Dynamics, IntervalResult, Nodes};
#[cfg(feature = "alloc")]
use crate::ocp::formulation::functions::node_evaluation::ParameterDerivatives;
use crate::ocp::formulation::functions::node_evaluation::QuadraticTerms;
use crate::ocp::formulation::instance::data::{
    Layout, Node, algebraic_len, depends_on_algebraic, node_row_count, split_data, stage_variable_count,
    variable_and_algebraic_counts,
};
use crate::ocp::formulation::instance::{Ocp, interval_nodes};
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::qp::element::get;
use crate::qp::{StageDims, part, part_mut};
use crate::scalar::Real;
use crate::shape::Shape;
use bytemuck::Zeroable;

/// Stores the algebraic states at the start of an interval, and their Jacobian.
pub(in crate::ocp) fn store_interval<S: Shape, T: Real>(
    storage: &mut [T],
    free: FreeParametersView<'_>,
    k: usize,
    step: &IntervalResult<'_, T>,
) {
    let [n, nz] = variable_and_algebraic_counts::<S>(free.count());
    if nz == 0 {
        return;
    }
    let (z, rows) =
        part_mut(storage, k * (nz + nz * n), nz + nz * n).split_at_mut_checked(nz).unwrap_or_default();
    crate::qp::copy_common(z, step.z);
    let [dx, du, dp] = step.dz;
    let parameter_columns = free.free_columns(dp, nz).map(|(w, column)| (S::NX + w, column));
    let state_columns = dx.chunks_exact(nz).enumerate();
    let control_columns = (S::NX + free.count()..).zip(du.chunks_exact(nz));
    for (j, column) in state_columns.chain(control_columns).chain(parameter_columns) {
        for (i, &value) in column.iter().enumerate() {
            if let Some(element) = rows.get_mut(i * n + j) {
                *element = value;
            }
        }
    }
}

/// The stored values and Jacobian of a stage; empty for the last stage.
pub(in crate::ocp) fn values_and_jacobian<S: Shape, T>(
    storage: &[T],
    layout: Layout,
    k: usize,
) -> (&[T], &[T]) {
    let stage_len = algebraic_len::<S>(layout.free_count);
    part(storage, k * stage_len, stage_len).split_at_checked(S::NZ).unwrap_or_default()
}

/// Derivatives of a stage with respect to `(x, u, z)`.
pub(in crate::ocp) struct ExtendedDerivatives<'a, T> {
    pub(in crate::ocp) terms: QuadraticTerms<'a, T>,
    /// Gradients of the constraints, at the same distance `ld` as columns of the Hessian.
    pub(in crate::ocp) columns: &'a mut [T],
}

impl<'a, T: Real> ExtendedDerivatives<'a, T> {
    /// Derivatives of zero, in given memory.
    pub(in crate::ocp) fn new<S: Shape>(memory: &'a mut [T], free: FreeParametersView<'a>) -> Self {
        memory.fill(T::ZERO);
        let [n, nz] = variable_and_algebraic_counts::<S>(free.count());
        let ld = n + nz;
        let (gradient, rest) = memory.split_at_mut_checked(ld).unwrap_or_default();
        let (hessian, columns) = rest.split_at_mut_checked(ld * ld).unwrap_or_default();
        Self { terms: QuadraticTerms { free, gradient, hessian, ld }, columns }
    }

    /// An element of the symmetric Hessian.
    pub(in crate::ocp) fn hessian(&self, i: usize, j: usize) -> T {
        get(self.terms.hessian, i.min(j) * self.terms.ld + i.max(j))
    }

    /// Eliminates `z` by `dz`, the rows of `∂z/∂(x, u)`: adds the total derivatives to gradient and
    /// Hessian with respect to `(x, u)`, and writes the gradients of the constraints.
    pub(in crate::ocp) fn eliminate_algebraic<S: Shape>(
        &self,
        dz: &[T],
        to: &mut QuadraticTerms<'_, T>,
        columns: &mut [T],
        ld: usize,
    ) {
        let [n, _] = variable_and_algebraic_counts::<S>(self.terms.free.count());
        let rows = || dz.chunks_exact(n.max(1)).enumerate();
        // `a_j + Σ_i a_zi ∂z_i/∂v_j`
        let total_derivative = |a: &dyn Fn(usize) -> T, j: usize| {
            rows().fold(a(j), |sum, (i, row)| sum + a(n + i) * get(row, j))
        };
        for j in 0..n {
            to.add_gradient(j, total_derivative(&|i| get(self.terms.gradient, i), j));
            for i in j..n {
                // Column j of `H [I; Z]`, then row i of `[I Zᵀ]` times it.
                let column = |row: usize| total_derivative(&|l| self.hessian(row, l), j);
                to.add_hessian(i, j, total_derivative(&column, i));
            }
        }
        let own_columns = self.columns.chunks_exact(self.terms.ld.max(1));
        for (own_column, column) in own_columns.zip(columns.chunks_exact_mut(ld.max(1))) {
            for (j, element) in column.iter_mut().enumerate().take(n) {
                *element = total_derivative(&|i| get(own_column, i), j);
            }
        }
    }

    /// Adds the derivatives with respect to parameters: `dz` as in
    /// [`ExtendedDerivatives::eliminate_algebraic`], `dp` the columns of `∂z/∂p`, `direct` the
    /// mixed derivatives with respect to `(x, u, z)` for constant `z`, and `slopes` the rows of
    /// `∂g/∂p`.
    #[cfg(feature = "alloc")]
    pub(in crate::ocp) fn eliminate_algebraic_for_parameters<S: Shape>(
        &self,
        [dz, dp]: [&[T]; 2],
        direct: &[T],
        to: &mut ParameterDerivatives<'_, T>,
        slopes: &mut [T],
    ) {
        let [n, nz] = variable_and_algebraic_counts::<S>(self.terms.free.count());
        let parameters = || direct.chunks_exact((n + nz).max(1)).zip(dp.chunks_exact(nz.max(1))).enumerate();
        for (p, (direct, dp)) in parameters() {
            let total_mixed = |i: usize| {
                dp.iter().enumerate().fold(get(direct, i), |sum, (l, &dp)| sum + self.hessian(i, n + l) * dp)
            };
            for (l, &slope) in dp.iter().enumerate() {
                to.add_gradient(p, get(self.terms.gradient, n + l) * slope);
            }
            for (q, (other, dq)) in parameters() {
                let products = dq.iter().zip(dp).enumerate();
                let sum = products.fold(T::ZERO, |sum, (l, (&dq, &dp))| {
                    sum + dq * total_mixed(n + l) + get(other, n + l) * dp
                });
                to.add_hessian(q, p, sum);
            }
            for j in 0..n {
                let rows = dz.chunks_exact(n.max(1)).enumerate();
                to.add_mixed(
                    j,
                    p,
                    rows.fold(total_mixed(j), |sum, (i, row)| sum + total_mixed(n + i) * get(row, j)),
                );
            }
            let own_columns = self.columns.chunks_exact(self.terms.ld.max(1));
            for (own_column, slopes) in own_columns.zip(slopes.chunks_exact_mut(S::NP.max(1))) {
                if let Some(slope) = slopes.get_mut(p) {
                    *slope =
                        dp.iter().enumerate().fold(*slope, |sum, (l, &dp)| sum + get(own_column, n + l) * dp);
                }
            }
        }
    }
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Computes the weights `ν` of second derivatives of algebraic states, for [`interval_nodes`].
    /// Simulates the algebraic states unless the line search has done so. Does nothing if no
    /// function depends on them.
    ///
    /// # Errors
    /// [`OcpError::NonFiniteFunction`], [`OcpError::Integration`]
    pub(in crate::ocp) fn update_algebraic_weights(&mut self) -> Result<(), OcpError> {
        let layout @ Layout { intervals, free_count: free, has_algebraic_bounds: bounds_algebraic, .. } =
            self.layout();
        if !(const { depends_on_algebraic::<P, T>() } || bounds_algebraic) {
            return Ok(());
        }
        let (n, nz) = (stage_variable_count::<P::Shape>(free), P::Shape::NZ);
        let free = self.free.view();
        let data = split_data::<P, T>(self.data.as_mut(), layout);
        let Problem { dynamics, stage_cost, path, running, .. } = self.problem.parts();
        let (v, multipliers) = self.iterate.variables_and_costates();
        let nodes = interval_nodes::<P::Shape, T>(v, multipliers, &[], (data.p, free), data.times);
        let nodes = Nodes { step_length: self.step_length, ..nodes };
        let has_points = self.inner_points.count() > 0;
        if !core::mem::take(&mut self.algebraic_is_current) && !has_points {
            dynamics.simulate(&nodes, &mut |k, step| {
                store_interval::<P::Shape, T>(data.algebraic, free, k, step)
            })?;
        }
        let mut point = <P::Shape as Shape>::ArrayV::<T>::zeroed();
        for (k, stage) in self.iterate.stages().enumerate().take(intervals) {
            let node_data = Node::new::<P>(k, intervals, *running, [data.times, data.p, data.references]);
            let (z, _) = values_and_jacobian::<P::Shape, T>(data.algebraic, layout, k);
            node_data.write_variables::<P::Shape>(&mut point, &stage, z, free);
            let ExtendedDerivatives { mut terms, columns } =
                ExtendedDerivatives::new::<P::Shape>(data.extended, free);
            let node_fraction = self.inner_points.node_fraction();
            let factor = if *running {
                free.duration(stage.u) * node_data.factor * node_fraction
            } else {
                node_data.factor
            };
            let cost_context = CostContext { stage: k, factor, exact: false, model_origin: &[] };
            stage_cost.add_derivatives(&point, node_data.reference, cost_context, &mut terms)?;
            path.linearise(&point, &mut [], columns, terms.ld, ConstraintContext::new(k, free, &[]))?;
            for (j, nu) in part_mut(data.weights, k * nz, nz).iter_mut().enumerate() {
                *nu = get(terms.gradient, n + j);
                let mu = stage.g_upper.iter().zip(stage.g_lower);
                for ((&upper, &lower), column) in mu.zip(columns.chunks_exact(terms.ld.max(1))) {
                    *nu = *nu + (upper - lower) * get(column, n + j);
                }
                for (i, &variable) in self.inner_points.bounded_variables().iter().enumerate() {
                    if bounds_algebraic && variable == (P::Shape::NX + j, 0) {
                        let row = node_row_count::<P, T>() + self.inner_points.count() * P::Path::ROWS + i;
                        *nu = *nu + get(stage.g_upper, row) - get(stage.g_lower, row);
                    }
                }
            }
        }
        Ok(())
    }
}
