//! Linearisation for external solvers of nonlinear programs, and constraint values of solutions.

use crate::ocp::assembly::algebraic;
use crate::ocp::assembly::inner_points::{ConstraintRows, PointCost};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::constraint::{ConstraintContext, Constraints};
#[cfg(feature = "casadi")]
use crate::ocp::formulation::functions::dynamics::Sink;
#[cfg(feature = "casadi")]
use crate::ocp::formulation::functions::node_evaluation::QuadraticTerms;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::instance::data::{Layout, Node, path_row_count, split_data};
use crate::ocp::formulation::problem::{Formulation, Problem};
#[cfg(feature = "casadi")]
use crate::ocp::formulation::program::curvature::Curvature;
#[cfg(feature = "casadi")]
use crate::qp::Arrays;
use crate::qp::{StageDims, part, part_mut};
use crate::scalar::Real;
use crate::shape::Shape;
use bytemuck::Zeroable;

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Linearises at the iterate: passes derivatives of intervals to `observer`, and writes those
    /// of costs and constraints to the QP, with `∇f` as its gradient. `clear_hessian` sets the
    /// Hessian of a stage to zero.
    ///
    /// # Errors
    /// The errors of [`Ocp::linearise`].
    #[cfg(feature = "casadi")]
    pub(crate) fn linearise_separately<C: Curvature<P::Dynamics, T>>(
        &mut self,
        curvature: C,
        clear_hessian: &dyn Fn(usize, &mut [T]),
        observer: Sink<'_, T>,
    ) -> Result<(), OcpError> {
        for (k, mut stage) in self.qp.stages_mut().enumerate() {
            let Arrays { hessian, gradient, .. } = stage.arrays();
            clear_hessian(k, hessian);
            gradient.fill(T::ZERO);
        }
        let interval_sums = self.linearise_intervals(
            curvature,
            |k, step, (Arrays { ld, hessian, gradient, .. }, free), _| {
                observer(k, step);
                // The Hessian of the quadrature is part of the interval's Hessian.
                let (mut terms, slopes) =
                    (QuadraticTerms { free, gradient, hessian, ld }, step.cost.x.iter().chain(step.cost.u));
                slopes.enumerate().for_each(|(i, &slope)| terms.add_gradient(i, slope));
            },
        )?;
        let costs = self.linearise_functions::<C>(false, |_, _, _| {})?;
        self.add_arrival_cost(true);
        self.store_objective(interval_sums, costs);
        Ok(())
    }

    /// Writes `g` of every stage to `values`. Returns the objective without penalties, which is
    /// current after [`Ocp::linearise`]. Algebraic states and points inside intervals must be those
    /// of the iterate.
    ///
    /// # Errors
    /// [`OcpError::NonFiniteFunction`]
    pub(crate) fn evaluate_constraints(&mut self, values: &mut [T]) -> Result<T, OcpError> {
        let layout @ Layout { intervals, .. } = self.layout();
        let free = self.free.view();
        let data = split_data::<P, T>(self.data.as_mut(), layout);
        let inner = &mut self.inner_points;
        let Problem { stage_cost, path, terminal, running, .. } = self.problem.parts();
        let mut point = <P::Shape as Shape>::ArrayV::<T>::zeroed();
        for (k, stage_point) in self.iterate.stages().enumerate() {
            let node = Node::new::<P>(k, intervals, *running, [data.times, data.p, data.references]);
            let (z, _) = algebraic::values_and_jacobian::<P::Shape, T>(data.algebraic, layout, k);
            node.write_variables::<P::Shape>(&mut point, &stage_point, z, free);
            let values = values.get_mut(k * path_row_count::<P, T>(layout)..).unwrap_or_default();
            let constraint_context =
                ConstraintContext::new(k, free, part(stage_point.u, 0, P::Terminal::INITIAL_STATE_COPIES));
            if k < intervals {
                path.value(&point, part_mut(values, 0, P::Path::ROWS), constraint_context)?;
                if layout.inner_rows > 0 {
                    let costs = PointCost {
                        cost: &mut *stage_cost,
                        reference: node.reference,
                        running: *running,
                        exact: false,
                    };
                    let rows = &mut ConstraintRows::without_derivatives(values, stage_point, k);
                    let times_and_parameters = (&*data.times, &*data.p);
                    inner.write_point_rows::<P>(
                        (&mut *path, costs),
                        (z, &[]),
                        times_and_parameters,
                        free,
                        rows,
                    )?;
                }
            } else {
                terminal.value(&point, part_mut(values, 0, P::Terminal::ROWS), constraint_context)?;
            }
        }
        Ok(self.objective)
    }
}
