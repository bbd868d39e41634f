//! Derivatives of a call, as users see them: each answers one question, with nothing else computed.

use super::adjoint::{Sweep, Way};
use super::forward::{Seeded, Unit, Variation, write};
use super::hessian::Curvature;
use super::integrator::{AdjointMemory, ForwardMemory, Integrator, finite, write_state};
use super::step::{Base, Grid};
use crate::error::{Argument, Error};
use crate::integrator::Integrator as _;
use crate::memory::{Memory, WithForward, WithHessian};
use crate::model::{ArrayW, MatrixXC, Ode, VectorU, VectorX};
use crate::quadrature::{Along, begin, finish};
use crate::result::{Adjoint, Directional, Forward, ForwardAdjoint, Hessian, Seeds};
use crate::scalar::Real;
use crate::shape::{Array, Matrix, Shape};
use bytemuck::Zeroable;
use core::ops::Range;

impl<M: Ode, B, const S: usize, T: Real, W: Memory> Integrator<M, B, S, T, W> {
    /// The state at the end and its derivatives with respect to `x₀`, `u` and `p`.
    ///
    /// # Errors
    /// As [`Integrator::solve`].
    pub fn forward(&mut self, x0: &VectorX<M, T>, u: &VectorU<M, T>, h: T) -> Result<&Forward<M, T>, Error>
    where
        W: WithForward,
    {
        self.forward_along(x0, u, h, None)
    }

    /// After [`Integrator::forward`]: the derivatives of `Σ_i weight_i k_i` of the last step, a row
    /// for each direction.
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
        let variation = &W::forward(&mut self.forward)?.sweep.forward;
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

    /// The state at the end and its derivatives in the directions of `C` seeds.
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
        finite::<M, T>(seeds.x0.as_slice(), Argument::SeedX)?;
        finite::<M, T>(seeds.u.as_slice(), Argument::SeedU)?;
        finite::<M, T>(seeds.p.as_slice(), Argument::SeedP)?;
        let grid = self.begin(x0, u, h)?;
        let base = W::nominal(&mut self.base)?;
        let variation = &mut W::forward(&mut self.forward)?.sweep.forward;
        let mut result = Directional::zeroed();
        // As many columns at once as the memory of `forward` holds.
        let most = M::Shape::NW.max(1);
        let start = base.x;
        for first in (0..C.max(1)).step_by(most) {
            let columns = most.min(C - first);
            base.x = start;
            let directions = Seeded { seeds, first, columns };
            let run = variation.run(&self.scheme, grid, base, directions, |_, _, _| Ok(()));
            self.counts = base.point.counts;
            run?;
            write(variation.dx.as_ref(), 0..columns, &mut result.dx, first, grid.steps - 1)?;
        }
        write_state(base, &mut result.nominal);
        Ok(result)
    }

    /// The state at the end and the gradient of `λᵀx`.
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
        self.backward(x0, u, h, lambda, None)
    }

    /// The same, with an integrand or without.
    pub(super) fn backward(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        mut along: Along<'_, '_, M, T>,
    ) -> Result<&Adjoint<M, T>, Error> {
        finite::<M, T>(lambda.as_slice(), Argument::Lambda)?;
        let grid = self.begin(x0, u, h)?;
        begin(&mut along);
        let base = W::nominal(&mut self.base)?;
        let AdjointMemory { sweep, result } = W::nominal(&mut self.adjoint)?;
        let records = W::tape(&mut self.trajectory, grid.steps)?;
        sweep.seed(1, |x, _| lambda.as_slice()[x]);
        let way = Way { scheme: &self.scheme, grid, columns: 1 };
        let run = base
            .record(&self.scheme, grid, records, &mut along)
            .and_then(|()| sweep.run(way, &mut base.point, records, None, &mut along));
        self.counts = base.point.counts;
        run?;
        finish(&mut along)?;
        write_gradient(sweep, 0..1, result, 0)?;
        write_state(base, &mut result.nominal);
        Ok(result)
    }

    /// The state at the end and the gradients of `λᵀx` for `C` seeds `λ`, the columns of `lambdas`.
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
        finite::<M, T>(lambdas.as_slice(), Argument::Lambda)?;
        let grid = self.begin(x0, u, h)?;
        let base = W::nominal(&mut self.base)?;
        let sweep = &mut W::forward(&mut self.forward)?.sweep;
        let records = W::tape(&mut self.trajectory, grid.steps)?;
        let mut result = Adjoint::zeroed();
        let run = base.record(&self.scheme, grid, records, &mut None);
        self.counts = base.point.counts;
        run?;
        // As many seeds at once as the memory holds: one row of directions.
        let most = M::Shape::NW.max(1);
        for first in (0..C).step_by(most) {
            let columns = most.min(C - first);
            sweep.seed(columns, |x, column| lambdas[(x, first + column)]);
            let way = Way { scheme: &self.scheme, grid, columns };
            let run = sweep.run(way, &mut base.point, records, None, &mut None);
            self.counts = base.point.counts;
            run?;
            write_gradient(sweep, 0..columns, &mut result, first)?;
        }
        write_state(base, &mut result.nominal);
        Ok(result)
    }

    /// The state at the end, its derivatives, and the gradient of `λᵀx`.
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
        finite::<M, T>(lambda.as_slice(), Argument::Lambda)?;
        let grid = self.begin(x0, u, h)?;
        let base = W::nominal(&mut self.base)?;
        let ForwardMemory { sweep, result } = W::forward(&mut self.forward)?;
        let run = sweep.forward.run(&self.scheme, grid, base, Unit, |_, _, _| Ok(()));
        self.counts = base.point.counts;
        run?;
        write_forward(grid, base, &sweep.forward, &mut result.forward)?;
        // With the Jacobian at hand the gradient is a product.
        let (nx, nu) = (M::Shape::NX, M::Shape::NU);
        for w in 0..M::Shape::NW {
            let mut sum = T::ZERO;
            for (x, &lambda) in lambda.as_slice().iter().enumerate() {
                sum = sum + lambda * sweep.forward.dx[x][w];
            }
            if !sum.is_finite() {
                return Err(Error::Overflow { step: grid.steps - 1, index: w });
            }
            *gradient_element(result, w, nx, nu) = sum;
        }
        Ok(result)
    }

    /// The state at the end, its derivatives, and the gradient and Hessian of `λᵀx`.
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
        self.hessian_along(x0, u, h, lambda, None)
    }
}

pub(super) fn write_forward<M: Ode, T: Real, const S: usize>(
    grid: Grid<T>,
    base: &Base<M, T, S>,
    variation: &Variation<M, T, ArrayW<M, T>, S>,
    result: &mut Forward<M, T>,
) -> Result<(), Error> {
    let (nx, nu, nw) = (M::Shape::NX, M::Shape::NU, M::Shape::NW);
    let (dx, step) = (variation.dx.as_ref(), grid.steps - 1);
    write(dx, 0..nx, &mut result.dx_dx0, 0, step)?;
    write(dx, nx..nx + nu, &mut result.dx_du, 0, step)?;
    write(dx, nx + nu..nw, &mut result.dx_dp, 0, step)?;
    write_state(base, &mut result.nominal);
    Ok(())
}

pub(super) fn write_gradient<M: Ode, T: Real, R: Array<T>, const S: usize, const C: usize>(
    sweep: &Sweep<M, T, R, S>,
    source: Range<usize>,
    result: &mut Adjoint<M, T, C>,
    first: usize,
) -> Result<(), Error> {
    let (nx, nu) = (M::Shape::NX, M::Shape::NU);
    let lambda = sweep.lambda.as_ref();
    write(&lambda[..nx], source.clone(), &mut result.grad_x0, first, 0)?;
    write(&lambda[nx..nx + nu], source.clone(), &mut result.grad_u, first, 0)?;
    write(&lambda[nx + nu..], source, &mut result.grad_p, first, 0)
}

/// Element `w` of the gradient.
pub(super) fn gradient_element<M: Ode, T: Real>(
    result: &mut ForwardAdjoint<M, T>,
    w: usize,
    nx: usize,
    nu: usize,
) -> &mut T {
    if w < nx {
        &mut result.grad_x0.as_mut_slice()[w]
    } else if w < nx + nu {
        &mut result.grad_u.as_mut_slice()[w - nx]
    } else {
        &mut result.grad_p.as_mut_slice()[w - nx - nu]
    }
}

pub(super) fn write_hessian<M: Ode, T: Real>(
    curvature: &mut Curvature<M, T>,
    result: &mut Hessian<M, T>,
) -> Result<(), Error> {
    curvature.mirror();
    let (nx, nu, nw) = (M::Shape::NX, M::Shape::NU, M::Shape::NW);
    let rows = curvature.sum.as_ref();
    let (x, u, p) = (0..nx, nx..nx + nu, nx + nu..nw);
    write(&rows[x.clone()], x.clone(), &mut result.h_xx, 0, 0)?;
    write(&rows[x.clone()], u.clone(), &mut result.h_xu, 0, 0)?;
    write(&rows[u.clone()], u.clone(), &mut result.h_uu, 0, 0)?;
    write(&rows[x], p.clone(), &mut result.h_xp, 0, 0)?;
    write(&rows[u], p.clone(), &mut result.h_up, 0, 0)?;
    write(&rows[p.clone()], p, &mut result.h_pp, 0, 0)
}
