//! The calls of an integrator for the checks, with results as flat arrays.

use crate::error::Error;
use crate::integrator::Integrator;
use crate::memory::{WithAdjoint, WithHessian};
use crate::model::{Dae, VectorP, VectorU, VectorX};
use crate::result::{Forward, Nominal};
use crate::shape::{Matrix, Shape};
use bytemuck::Zeroable;
use nalgebra::DMatrix;
use std::vec::Vec;

/// One interval: `w = (x₀, u, p)` and its length.
#[derive(Clone, Debug)]
pub(super) struct CheckedInterval {
    pub w: Vec<f64>,
    pub h: f64,
}

impl CheckedInterval {
    pub fn new<M: Dae>(x0: &VectorX<M, f64>, u: &VectorU<M, f64>, p: &VectorP<M, f64>, h: f64) -> Self {
        Self { w: [x0.as_slice(), u.as_slice(), p.as_slice()].concat(), h }
    }

    /// Sets the parameters, resets the warm start, and returns `x₀` and `u`.
    #[allow(clippy::type_complexity)]
    fn prepare<M: Dae>(
        &self,
        integrator: &mut impl Integrator<Model = M, Number = f64, Memory: WithHessian + WithAdjoint<1>>,
    ) -> Result<(VectorX<M, f64>, VectorU<M, f64>), Error> {
        let (nx, nu) = (M::Shape::NX, M::Shape::NU);
        if M::Shape::NP > 0 {
            integrator.set_parameters(&vector_from(&self.w[nx + nu..]))?;
        }
        integrator.reset();
        Ok((vector_from(&self.w[..nx]), vector_from(&self.w[nx..nx + nu])))
    }

    /// `(x, z, z0)`
    pub fn solve<M: Dae>(
        &self,
        integrator: &mut impl Integrator<Model = M, Number = f64, Memory: WithHessian + WithAdjoint<1>>,
    ) -> Result<Vec<f64>, Error> {
        let (x0, u) = self.prepare(integrator)?;
        Ok(states_of(integrator.solve(&x0, &u, self.h)?))
    }

    /// `(x, z, z0)` and its derivatives with respect to `w`.
    pub fn forward<M: Dae>(
        &self,
        integrator: &mut impl Integrator<Model = M, Number = f64, Memory: WithHessian + WithAdjoint<1>>,
    ) -> Result<(Vec<f64>, DMatrix<f64>), Error> {
        let (x0, u) = self.prepare(integrator)?;
        let forward = integrator.forward(&x0, &u, self.h)?;
        Ok((states_of(forward), matrix_of_forward(forward)))
    }

    /// `(x, z, z0)` and the gradient with respect to `w`.
    pub fn adjoint<M: Dae>(
        &self,
        integrator: &mut impl Integrator<Model = M, Number = f64, Memory: WithHessian + WithAdjoint<1>>,
        lambda: &[f64],
    ) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let (x0, u) = self.prepare(integrator)?;
        let adjoint = integrator.adjoint(&x0, &u, self.h, &vector_from(lambda))?;
        let gradient = [adjoint.grad_x0.as_slice(), adjoint.grad_u.as_slice(), adjoint.grad_p.as_slice()];
        Ok((states_of(adjoint), gradient.concat()))
    }

    /// All results in one call.
    pub fn hessian<M: Dae>(
        &self,
        integrator: &mut impl Integrator<Model = M, Number = f64, Memory: WithHessian + WithAdjoint<1>>,
        lambda: &[f64],
    ) -> Result<CallResults, Error> {
        let (x0, u) = self.prepare(integrator)?;
        let result = integrator.hessian(&x0, &u, self.h, &vector_from(lambda))?;
        let gradient = [result.grad_x0.as_slice(), result.grad_u.as_slice(), result.grad_p.as_slice()];
        let (nx, nu, nw) = (M::Shape::NX, M::Shape::NU, M::Shape::NW);
        // The upper blocks are given; the diagonal blocks have both triangles.
        let element =
            |i: usize, j: usize| match (block_and_position(i, nx, nu), block_and_position(j, nx, nu)) {
                ((0, i), (0, j)) => result.h_xx[(i, j)],
                ((0, i), (1, j)) => result.h_xu[(i, j)],
                ((0, i), (_, j)) => result.h_xp[(i, j)],
                ((1, i), (1, j)) => result.h_uu[(i, j)],
                ((1, i), (_, j)) => result.h_up[(i, j)],
                ((_, i), (_, j)) => result.h_pp[(i, j)],
            };
        let below =
            |i: usize, j: usize| i > j && block_and_position(i, nx, nu).0 != block_and_position(j, nx, nu).0;
        Ok(CallResults {
            states: states_of(result),
            derivatives: matrix_of_forward(result),
            gradient: gradient.concat(),
            hessian: DMatrix::from_fn(nw, nw, |i, j| if below(i, j) { element(j, i) } else { element(i, j) }),
        })
    }
}

/// All results of an integrator for an interval.
#[derive(Clone, Debug)]
pub(super) struct CallResults {
    /// `(x, z, z0)`
    pub states: Vec<f64>,
    /// `∂(x, z, z0)/∂w`
    pub derivatives: DMatrix<f64>,
    /// `∇(λᵀx)`
    pub gradient: Vec<f64>,
    /// `∇²(λᵀx)`
    pub hessian: DMatrix<f64>,
}

/// The block of a direction of `w`, and its position in the block.
const fn block_and_position(i: usize, nx: usize, nu: usize) -> (usize, usize) {
    if i < nx {
        (0, i)
    } else if i < nx + nu {
        (1, i - nx)
    } else {
        (2, i - nx - nu)
    }
}

fn vector_from<V: Matrix<f64> + Zeroable>(values: &[f64]) -> V {
    let mut vector = V::zeroed();
    vector.as_mut_slice().copy_from_slice(values);
    vector
}

fn states_of<M: Dae>(nominal: &Nominal<M>) -> Vec<f64> {
    [nominal.x.as_slice(), nominal.z.as_slice(), nominal.z0.as_slice()].concat()
}

fn matrix_of_forward<M: Dae>(f: &Forward<M>) -> DMatrix<f64> {
    let (nx, nz, nu) = (M::Shape::NX, M::Shape::NZ, M::Shape::NU);
    DMatrix::from_fn(nx + 2 * nz, M::Shape::NW, |row, column| {
        match (block_and_position(row, nx, nz), block_and_position(column, nx, nu)) {
            ((0, i), (0, j)) => f.dx_dx0[(i, j)],
            ((0, i), (1, j)) => f.dx_du[(i, j)],
            ((0, i), (_, j)) => f.dx_dp[(i, j)],
            ((1, i), (0, j)) => f.dz_dx0[(i, j)],
            ((1, i), (1, j)) => f.dz_du[(i, j)],
            ((1, i), (_, j)) => f.dz_dp[(i, j)],
            ((_, i), (0, j)) => f.dz0_dx0[(i, j)],
            ((_, i), (1, j)) => f.dz0_du[(i, j)],
            ((_, i), (_, j)) => f.dz0_dp[(i, j)],
        }
    })
}
