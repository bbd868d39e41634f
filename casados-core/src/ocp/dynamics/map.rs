//! A function as dynamics: discrete time.

use crate::function::{ArrayV, ArrayY, Function};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::free_parameters::FreeParametersView;
use crate::ocp::formulation::functions::dynamics::{
    Dynamics, IntervalResult, Nodes, SecondOrder, Sink, vector,
};
use crate::ocp::formulation::functions::node_evaluation::{
    check_finite_outputs, parameter_index, write_variables,
};
use crate::ocp::formulation::functions::sparsity::DynamicsStructure;
use crate::ocp::formulation::names::Names;
use crate::scalar::Real;
use crate::shape::{Matrix, Outputs, Plain, Shape, plain};
use bytemuck::Zeroable;

/// `x_{k+1} = y(x_k, u_k, p_k, t_k)`: discrete-time dynamics by a [`Function`] with an output for
/// each state.
///
/// ```
/// use casados::ocp::{GeneralCost, HeapSqp, Horizon, Map, Problem};
/// use casados::prelude::*;
///
/// /// A store that is filled and drained.
/// #[function]
/// fn store(x: f64, u: f64) -> f64 { 0.9 * x + u }
/// #[function]
/// fn price(_x: f64, u: f64) -> f64 { u * u }
///
/// let mut ocp = Problem::new(Map::<Store, f64>::new())
///     .stage_cost(GeneralCost::<Price>::new())
///     .on(Horizon::uniform(5, 1.0))?;
/// ocp.fix_initial_state(&[0.0])?.bound("x", 5.., 1.0, 1.0)?.guess(&[0.0], &[0.0])?;
/// assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
/// // u_k is proportional to what is left of it at the end, 0.9^(4 − k).
/// let u = ocp.solution()?.control("u")?.to_vec();
/// assert!((u[3] / u[4] - 0.9).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct Map<F: Function, T: Plain> {
    v: ArrayV<F, T>,
    y: ArrayY<F, T>,
    mu: ArrayY<F, T>,
    jacobian: F::Jacobian<T>,
    hessian: F::Hessian<T>,
    x: <F::Shape as Shape>::VectorX<T>,
    dx: <F::Shape as Shape>::MatrixXX<T>,
    du: <F::Shape as Shape>::MatrixXU<T>,
    dp: <F::Shape as Shape>::MatrixXP<T>,
    h_xx: <F::Shape as Shape>::MatrixXX<T>,
    h_xu: <F::Shape as Shape>::MatrixXU<T>,
    h_uu: <F::Shape as Shape>::MatrixUU<T>,
    h_xp: <F::Shape as Shape>::MatrixXP<T>,
    h_up: <F::Shape as Shape>::MatrixUP<T>,
    h_pp: <F::Shape as Shape>::MatrixPP<T>,
}

plain!([F: Function, T: Plain] Map<F, T> { v, y, mu, jacobian, hessian, x, dx, du, dp, h_xx, h_xu, h_uu, h_xp, h_up, h_pp });

impl<F: Function, T: Real> Map<F, T> {
    /// The map of a function.
    #[must_use]
    pub fn new() -> Self {
        const { assert!(F::Outputs::NY == F::Shape::NX, "a map has one output for each state") };
        let mut map = Self::zeroed();
        F::jacobian_constants::<T>(&mut map.jacobian);
        map
    }

    fn evaluate(
        &mut self,
        nodes: &Nodes<'_, T>,
        with_hessian: bool,
        sink: Sink<'_, T>,
    ) -> Result<(), OcpError> {
        let (nx, nz, nu) = (F::Shape::NX, F::Shape::NZ, F::Shape::NU);
        for (k, interval) in nodes.iter().enumerate() {
            let p: <F::Shape as Shape>::VectorP<T> = interval.parameters();
            write_variables::<F::Shape, T>(
                &mut self.v,
                [interval.x, &[], interval.u, p.as_slice()],
                interval.t,
            );
            F::value_jacobian::<T>(&self.v, &mut self.y, &mut self.jacobian);
            check_finite_outputs::<F, T>(&self.y, k)?;
            self.x = vector(self.y.as_ref());
            for (entry, &value) in self.jacobian.as_ref().iter().enumerate() {
                let Some((row, variable)) = F::STRUCTURE.jacobian.get(entry) else { continue };
                if (nx..2 * nx).contains(&variable) {
                    self.dx[(row, variable - nx)] = value;
                } else if let Some(column) = variable.checked_sub(2 * nx + nz) {
                    match column.checked_sub(nu) {
                        None => self.du[(row, column)] = value,
                        Some(column) if column < F::Shape::NP => self.dp[(row, column)] = value,
                        Some(_) => {}
                    }
                }
            }
            let (mut hessian, mut hessian_p) = ([&[][..]; 3], [&[][..]; 3]);
            if with_hessian {
                crate::qp::copy_common(self.mu.as_mut(), interval.multipliers);
                F::hessian::<T>(&self.v, &self.mu, &mut self.hessian);
                for (entry, &value) in self.hessian.as_ref().iter().enumerate() {
                    let Some((row, column)) = F::STRUCTURE.hessian.get(entry) else { continue };
                    if let (Some(p), Some(q)) =
                        (parameter_index::<F::Shape>(row), parameter_index::<F::Shape>(column))
                    {
                        (self.h_pp[(p, q)], self.h_pp[(q, p)]) = (value, value);
                    }
                    let qp_index = |variable| {
                        FreeParametersView::default().position::<F::Shape>(variable).filter(|&i| i < nx + nu)
                    };
                    let Some(column) = qp_index(column) else { continue };
                    if let Some(p) = parameter_index::<F::Shape>(row) {
                        match column.checked_sub(nx) {
                            None => self.h_xp[(column, p)] = value,
                            Some(column) => self.h_up[(column, p)] = value,
                        }
                    }
                    let Some(row) = qp_index(row) else { continue };
                    match (row.checked_sub(nx), column.checked_sub(nx)) {
                        (None, _) => {
                            self.h_xx[(row, column)] = value;
                            self.h_xx[(column, row)] = value;
                        }
                        (Some(row), None) => self.h_xu[(column, row)] = value,
                        (Some(row), Some(column)) => {
                            self.h_uu[(row, column)] = value;
                            self.h_uu[(column, row)] = value;
                        }
                    }
                }
                hessian = [self.h_xx.as_slice(), self.h_xu.as_slice(), self.h_uu.as_slice()];
                hessian_p = [self.h_xp.as_slice(), self.h_up.as_slice(), self.h_pp.as_slice()];
            }
            let (x, dx, du, dp) =
                (self.x.as_slice(), self.dx.as_slice(), self.du.as_slice(), self.dp.as_slice());
            sink(k, &IntervalResult { x, dx, du, dp, hessian, hessian_p, ..IntervalResult::default() });
        }
        Ok(())
    }
}

impl<F: Function, T: Real> Default for Map<F, T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<F: Function, T: Real> Dynamics<T> for Map<F, T> {
    type Shape = F::Shape;
    const NAMES: Names = {
        let structure = &F::STRUCTURE;
        Names {
            model: structure.name,
            x: structure.x,
            z: structure.z,
            u: structure.u,
            p: structure.p,
            units: F::UNITS,
            duration: None,
            linear: &[],
            degrees: &[],
            integrals: 0,
        }
    };
    const IS_FLOW: bool = false;
    const STRUCTURE: DynamicsStructure = DynamicsStructure::Map(F::STRUCTURE.jacobian, F::STRUCTURE.hessian);

    fn simulate(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        for (k, interval) in nodes.iter().enumerate() {
            let p: <F::Shape as Shape>::VectorP<T> = interval.parameters();
            write_variables::<F::Shape, T>(
                &mut self.v,
                [interval.x, &[], interval.u, p.as_slice()],
                interval.t,
            );
            F::value::<T>(&self.v, &mut self.y);
            check_finite_outputs::<F, T>(&self.y, k)?;
            sink(k, &IntervalResult { x: self.y.as_ref(), ..IntervalResult::default() });
        }
        Ok(())
    }
    fn linearise(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        self.evaluate(nodes, false, sink)
    }
}

impl<F: Function, T: Real> SecondOrder<T> for Map<F, T> {
    fn second_order(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        self.evaluate(nodes, true, sink)
    }
}
