//! Derivatives of solutions and of the optimal value with respect to references.

use super::factors::SolutionFactors;
use crate::ocp::assembly::algebraic;
use crate::ocp::formulation::error::{OcpError, Part};
use crate::ocp::formulation::functions::cost::{Cost, CostContext};
use crate::ocp::formulation::functions::node_evaluation::write_variables;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::instance::data::{Node, split_data};
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::qp::{StageDims, part_mut, take_mut};
use crate::scalar::Real;
use crate::shape::Shape;
use bytemuck::Zeroable;

/// The number of references of a problem: those of the stages, then that of the terminal cost.
pub(in crate::ocp) fn reference_count<P: Formulation<T>, T: Real>(intervals: usize) -> usize {
    intervals * P::StageCost::REFERENCES + P::TerminalCost::REFERENCES
}

/// The differentiated quantity.
#[derive(Clone, Copy)]
enum DifferentiatedQuantity<'a, T> {
    Value,
    Adjoint(&'a SolutionFactors<T>),
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Computes `λᵀ dw/dr` of the last [`SolutionFactors::adjoint`], for the references `r` of all
    /// stages, then of the terminal cost, of [`LeastSquaresCost`](crate::ocp::LeastSquaresCost) and
    /// [`ConvexCost`](crate::ocp::ConvexCost).
    ///
    /// # Errors
    /// [`OcpError::Length`] if `to` has another length; [`OcpError::NonFiniteFunction`]
    ///
    /// # Example
    /// ```
    /// use casados::ocp::{Exact, HeapSqp, Horizon, LeastSquaresCost, Map, Problem, SolutionFactors};
    /// use casados::prelude::*;
    /// # #[function]
    /// # fn push(x: f64, u: f64) -> f64 { x + u }
    /// # #[function]
    /// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
    /// let mut ocp = Problem::new(Map::<Push, f64>::new())
    ///     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
    ///     .on(Horizon::uniform(2, 1.0))?;
    /// ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
    /// HeapSqp::new(&ocp)?.solve(&mut ocp)?;
    /// let mut factors = SolutionFactors::new(&ocp)?;
    /// ocp.factorise(Exact::default(), &mut factors)?;
    /// let mut seed = casados::qp::HeapSolution::new(ocp.qp().dims())?;
    /// seed.stage_mut(0).ok_or("a stage")?.u[0] = 1.0;
    /// factors.adjoint(&seed)?;
    /// let mut by_references = [0.0; 4];
    /// ocp.adjoint_by_references(&factors, &mut by_references)?;
    /// // min ½ (u₀ − r₁)² + ½ (x₁ − r₂)² with x₁ = 1 + u₀: u₀ = (r₁ + r₂ − 1) / 2.
    /// let expected = [0.0, 0.5, 0.5, 0.0];
    /// assert!(by_references.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn adjoint_by_references(
        &mut self,
        factors: &SolutionFactors<T>,
        to: &mut [T],
    ) -> Result<(), OcpError> {
        self.differentiate_by_references(DifferentiatedQuantity::Adjoint(factors), to)
    }

    /// Computes `∂V/∂r` of the optimal value at the iterate, which must be a solution, in the order
    /// of [`Ocp::adjoint_by_references`].
    ///
    /// # Errors
    /// The errors of [`Ocp::adjoint_by_references`].
    pub fn value_gradient_by_references(&mut self, to: &mut [T]) -> Result<(), OcpError> {
        self.differentiate_by_references(DifferentiatedQuantity::Value, to)
    }

    fn differentiate_by_references(
        &mut self,
        quantity: DifferentiatedQuantity<'_, T>,
        mut to: &mut [T],
    ) -> Result<(), OcpError> {
        let (intervals, free) = (self.intervals(), self.free.view());
        let (expected, found) = (reference_count::<P, T>(intervals), to.len());
        if expected != found {
            return Err(OcpError::Length { part: Part::Reference, stage: 0, expected, found });
        }
        to.fill(T::ZERO);
        let layout = self.layout();
        let data = split_data::<P, T>(self.data.as_mut(), layout);
        let Problem { stage_cost, terminal_cost, running, .. } = self.problem.parts();
        let mut point = <P::Shape as Shape>::ArrayV::<T>::zeroed();
        for (k, stage_point) in self.iterate.stages().enumerate() {
            let node = Node::new::<P>(k, intervals, *running, [data.times, data.p, data.references]);
            let (z, dz) = algebraic::values_and_jacobian::<P::Shape, T>(data.algebraic, layout, k);
            node.write_variables::<P::Shape>(&mut point, &stage_point, z, free);
            let mut direction = <P::Shape as Shape>::ArrayV::<T>::zeroed();
            if let DifferentiatedQuantity::Adjoint(factors) = quantity {
                let (x, variables) = (factors.direction.state(k), factors.direction.control(k));
                let (w, u) = variables.split_at_checked(free.count()).unwrap_or_default();
                write_variables::<P::Shape, T>(&mut direction, [x, &[], u, &[]], T::ZERO);
                let of_p = 2 * P::Shape::NX + P::Shape::NZ + P::Shape::NU;
                free.scatter_step(part_mut(direction.as_mut(), of_p, P::Shape::NP), w);
                let n = x.len() + variables.len();
                let of_z = direction.as_mut().get_mut(2 * P::Shape::NX..).unwrap_or_default();
                for (of_z, row) in of_z.iter_mut().zip(dz.chunks_exact(n.max(1))) {
                    let products = row.iter().zip(x.iter().chain(variables)).map(|(&a, &b)| a * b);
                    *of_z = products.fold(T::ZERO, |sum, product| sum + product);
                }
            }
            let cost_context = CostContext { stage: k, factor: node.factor, exact: true, model_origin: &[] };
            let direction = matches!(quantity, DifferentiatedQuantity::Adjoint(_)).then_some(&direction);
            if k < intervals {
                let to = take_mut(&mut to, P::StageCost::REFERENCES);
                stage_cost.add_reference_derivatives(
                    (&point, direction),
                    node.reference,
                    cost_context,
                    to,
                )?;
            } else {
                terminal_cost.add_reference_derivatives(
                    (&point, direction),
                    node.reference,
                    cost_context,
                    to,
                )?;
                break;
            }
        }
        Ok(())
    }
}
