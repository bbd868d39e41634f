//! The public interface to derivatives.

use super::adjoint::{AdjointProblem, AdjointSweep};
use super::engine::write_state;
use super::forward::{SeedDirections, copy_to_columns};
use super::forward_sweep::AllColumns;
use super::integrator::{Integrator, check_finite_input};
use super::non_finite::NonFiniteLanes;
use super::stage_integrand::NoIntegrand;
use crate::error::{Argument, Error};
use crate::integrator::Integrator as _;
use crate::memory::{Memory, WithForward, WithHessian};
#[cfg(feature = "alloc")]
use crate::model::ArrayW;
use crate::model::{MatrixXC, Ode, VectorU, VectorX};
use crate::quadrature::OptionalIntegrand;
use crate::result::{Adjoint, Directional, Forward, ForwardAdjoint, Hessian, Seeds};
use crate::scalar::Real;
use crate::shape::{Array, Matrix, Shape};
use bytemuck::Zeroable;
use core::ops::Range;

impl<M: Ode, B, const S: usize, T: Real, W: Memory> Integrator<M, B, S, T, W> {
    /// Returns the final state and its derivatives with respect to `x₀`, `u` and `p`.
    ///
    /// # Errors
    /// As [`Integrator::solve`].
    pub fn forward(&mut self, x0: &VectorX<M, T>, u: &VectorU<M, T>, h: T) -> Result<&Forward<M, T>, Error>
    where
        W: WithForward,
    {
        self.forward_with_quadrature(x0, u, h, None)
    }

    /// Returns the derivatives of `Σ_i weight_i k_i` of the last step after
    /// [`Integrator::forward`], one row per direction.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    #[cfg(feature = "alloc")]
    pub(crate) fn slopes(
        &mut self,
        weights: &[f64],
        to: &mut ArrayW<M, crate::model::ArrayX<M, T>>,
    ) -> Result<(), Error>
    where
        W: WithForward,
    {
        let variation = &W::forward(&mut self.engine.forward)?.sweep.forward;
        for (w, to) in to.as_mut().iter_mut().enumerate() {
            to.as_mut().fill(T::ZERO);
            for (weight, dk) in weights.iter().zip(&variation.dk).filter(|(weight, _)| **weight != 0.0) {
                for (to, row) in to.as_mut().iter_mut().zip(dk.as_ref()) {
                    *to = *to + T::from_f64(*weight) * row.as_ref()[w];
                }
            }
        }
        Ok(())
    }

    /// Returns the final state and its derivatives in the directions of `C` seeds.
    ///
    /// # Errors
    /// As [`Integrator::solve`].
    pub fn directional<const C: usize>(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        seeds: &Seeds<M, T, C>,
    ) -> Result<Directional<M, T, C>, Error>
    where
        W: WithForward,
    {
        check_finite_input::<M, T>(seeds.x0.as_slice(), Argument::SeedX)?;
        check_finite_input::<M, T>(seeds.u.as_slice(), Argument::SeedU)?;
        check_finite_input::<M, T>(seeds.p.as_slice(), Argument::SeedP)?;
        let grid = self.begin_call(x0, u, h)?;
        let workspace = W::nominal(&mut self.engine.workspace)?;
        let variation = &mut W::forward(&mut self.engine.forward)?.sweep.forward;
        let mut result = Directional::zeroed();
        // The memory of `forward` limits the number of columns per sweep.
        let max_columns = M::Shape::NW.max(1);
        let start = workspace.x;
        for first in (0..C.max(1)).step_by(max_columns) {
            let columns = max_columns.min(C - first);
            workspace.x = start;
            let directions = SeedDirections { seeds, first, columns };
            let outcome =
                variation.integrate(&self.engine.scheme, &grid, workspace, directions, |_, _, _| Ok(()));
            self.engine.counts = workspace.point.counts;
            outcome?;
            let non_finite = &mut workspace.point.non_finite;
            copy_to_columns(
                variation.dx.as_ref(),
                0..columns,
                &mut result.dx,
                first,
                grid.steps - 1,
                non_finite,
            )?;
        }
        write_state(workspace, &mut result.nominal);
        Ok(result)
    }

    /// Returns the final state and the gradient of `λᵀx₊`.
    ///
    /// # Errors
    /// As [`Integrator::solve`].
    pub fn adjoint(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
    ) -> Result<&Adjoint<M, T>, Error> {
        self.solve_adjoint(x0, u, h, lambda, None)
    }

    /// [`Integrator::adjoint`] with an optional integrand.
    pub(super) fn solve_adjoint(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        mut integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Adjoint<M, T>, Error> {
        check_finite_input::<M, T>(lambda.as_slice(), Argument::Lambda)?;
        let grid = self.begin_call(x0, u, h)?;
        Ok(self.engine.adjoint(&grid, lambda.as_slice(), &mut integrand)?.1)
    }

    /// Returns the final state and the gradients of `λᵀx₊` for `C` seeds `λ`, the columns of
    /// `lambdas`.
    ///
    /// # Errors
    /// As [`Integrator::solve`].
    pub fn adjoint_many<const C: usize>(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambdas: &MatrixXC<M, T, C>,
    ) -> Result<Adjoint<M, T, C>, Error>
    where
        W: WithForward,
    {
        check_finite_input::<M, T>(lambdas.as_slice(), Argument::Lambda)?;
        let grid = self.begin_call(x0, u, h)?;
        let workspace = W::nominal(&mut self.engine.workspace)?;
        let sweep = &mut W::forward(&mut self.engine.forward)?.sweep;
        let records = W::tape(&mut self.engine.trajectory, grid.steps)?;
        let mut result = Adjoint::zeroed();
        let outcome = workspace.record_steps(&self.engine.scheme, &grid, records, &mut NoIntegrand);
        self.engine.counts = workspace.point.counts;
        outcome?;
        // A row of directions in memory limits the number of seeds per sweep.
        let max_columns = M::Shape::NW.max(1);
        for first in (0..C).step_by(max_columns) {
            let columns = max_columns.min(C - first);
            sweep.set_seeds(columns, |x, column| lambdas[(x, first + column)]);
            let problem = AdjointProblem { scheme: &self.engine.scheme, grid: &grid, columns };
            let outcome =
                sweep.integrate_backwards(problem, &mut workspace.point, records, None, &mut NoIntegrand);
            self.engine.counts = workspace.point.counts;
            outcome?;
            write_gradient(sweep, 0..columns, &mut result, first, &mut workspace.point.non_finite)?;
        }
        write_state(workspace, &mut result.nominal);
        Ok(result)
    }

    /// Returns the final state, its derivatives, and the gradient of `λᵀx₊`.
    ///
    /// # Errors
    /// As [`Integrator::solve`].
    pub fn forward_adjoint(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
    ) -> Result<&ForwardAdjoint<M, T>, Error>
    where
        W: WithForward,
    {
        check_finite_input::<M, T>(lambda.as_slice(), Argument::Lambda)?;
        let grid = self.begin_call(x0, u, h)?;
        Ok(self.engine.forward_adjoint(&grid, lambda.as_slice(), &mut AllColumns)?.1)
    }

    /// Returns the final state, its derivatives, and the gradient and Hessian of `λᵀx₊`.
    ///
    /// # Errors
    /// As [`Integrator::solve`].
    pub fn hessian(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
    ) -> Result<&Hessian<M, T>, Error>
    where
        W: WithHessian,
    {
        self.hessian_with_quadrature(x0, u, h, lambda, None)
    }
}

fn write_gradient<M: Ode, T: Real, R: Array<T>, const S: usize, const C: usize>(
    sweep: &AdjointSweep<M, T, R, S>,
    source: Range<usize>,
    result: &mut Adjoint<M, T, C>,
    first: usize,
    non_finite: &mut NonFiniteLanes<T>,
) -> Result<(), Error> {
    let (nx, nu) = (M::Shape::NX, M::Shape::NU);
    let lambda = sweep.lambda.as_ref();
    copy_to_columns(&lambda[..nx], source.clone(), &mut result.grad_x0, first, 0, non_finite)?;
    copy_to_columns(&lambda[nx..nx + nu], source.clone(), &mut result.grad_u, first, 0, non_finite)?;
    copy_to_columns(&lambda[nx + nu..], source, &mut result.grad_p, first, 0, non_finite)
}
