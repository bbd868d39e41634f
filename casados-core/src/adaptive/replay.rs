//! A step that is known is taken again, to rounding, and differentiated: it is an interval of one step for the integrator
//! with steps of equal size.

use super::consistent::At;
use crate::error::Error;
use crate::irk::Integrator;
use crate::memory::Heap;
use crate::model::{Dae, VectorX};
use crate::options::{Options, Start};
use crate::quadrature::Along;
use crate::result::{Adjoint, Forward, Hessian, Nominal};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};
use crate::tableau::Method;

/// Takes steps of given size.
pub trait Replay<M: Dae, T: Real> {
    /// From the unknowns `y` of its stages, or near them.
    ///
    /// # Errors
    /// Those of Newton's method.
    fn solve(
        &mut self,
        at: &At<'_, M, T>,
        h: T,
        y: &[T],
        along: Along<'_, '_, M, T>,
    ) -> Result<&Nominal<M, T>, Error>;
    /// The same with derivatives.
    ///
    /// # Errors
    /// Those of Newton's method; a singular matrix.
    fn forward(
        &mut self,
        at: &At<'_, M, T>,
        h: T,
        y: &[T],
        along: Along<'_, '_, M, T>,
    ) -> Result<&Forward<M, T>, Error>;
    /// The same with second derivatives of `λᵀx` at its end.
    ///
    /// # Errors
    /// Those of Newton's method; a singular matrix.
    fn hessian(
        &mut self,
        at: &At<'_, M, T>,
        h: T,
        y: &[T],
        lambda: &VectorX<M, T>,
        along: Along<'_, '_, M, T>,
    ) -> Result<&Hessian<M, T>, Error>;
    /// The gradient of `λᵀx` at its end with respect to `(x, u, p)`, written one after the other.
    ///
    /// # Errors
    /// Those of Newton's method; a singular matrix.
    fn adjoint(
        &mut self,
        at: &At<'_, M, T>,
        h: T,
        y: &[T],
        lambda: &VectorX<M, T>,
        gradient: &mut [T],
        along: Along<'_, '_, M, T>,
    ) -> Result<(), Error>;
    /// The unknowns of the stages that were found.
    ///
    /// # Errors
    /// [`Error::NoResult`]
    fn stages(&mut self) -> Result<&[T], Error>;
}

/// The integrator of one step of the method `B` with `S` stages.
pub(super) type Single<M, B, T, const S: usize> = Integrator<M, B, S, T, Heap>;

/// # Errors
/// None for methods that have a tableau.
pub(super) fn single<M: Dae, B: Method<S>, T: Real, const S: usize>() -> Result<Single<M, B, T, S>, Error> {
    Integrator::new(Options { steps: 1, start: Start::Warm, ..Options::default() })
}

/// Goes to the start of a step.
fn go<M: Dae, B: Method<S>, T: Real, const S: usize>(
    single: &mut Single<M, B, T, S>,
    at: &At<'_, M, T>,
    y: &[T],
) -> Result<(), Error> {
    if M::Shape::NP > 0 {
        single.set_parameters(at.p)?;
    }
    single.set_time(at.t)?;
    single.set_stages(y)
}

/// A gradient with respect to `(x, u, p)` as one array.
pub(super) fn stack<M: Dae, T: Real>(adjoint: &Adjoint<M, T>, gradient: &mut [T]) {
    let parts = [adjoint.grad_x0.as_slice(), adjoint.grad_u.as_slice(), adjoint.grad_p.as_slice()];
    for (to, from) in gradient.iter_mut().zip(parts.into_iter().flatten()) {
        *to = *from;
    }
}

impl<M: Dae, B: Method<S>, T: Real, const S: usize> Replay<M, T> for Single<M, B, T, S> {
    fn solve(
        &mut self,
        at: &At<'_, M, T>,
        h: T,
        y: &[T],
        along: Along<'_, '_, M, T>,
    ) -> Result<&Nominal<M, T>, Error> {
        go(self, at, y)?;
        Integrator::solve_along(self, at.x, at.u, h, along)
    }

    fn forward(
        &mut self,
        at: &At<'_, M, T>,
        h: T,
        y: &[T],
        along: Along<'_, '_, M, T>,
    ) -> Result<&Forward<M, T>, Error> {
        go(self, at, y)?;
        Integrator::forward_along(self, at.x, at.u, h, along)
    }

    fn hessian(
        &mut self,
        at: &At<'_, M, T>,
        h: T,
        y: &[T],
        lambda: &VectorX<M, T>,
        along: Along<'_, '_, M, T>,
    ) -> Result<&Hessian<M, T>, Error> {
        go(self, at, y)?;
        Integrator::hessian_along(self, at.x, at.u, h, lambda, along)
    }

    fn adjoint(
        &mut self,
        at: &At<'_, M, T>,
        h: T,
        y: &[T],
        lambda: &VectorX<M, T>,
        gradient: &mut [T],
        along: Along<'_, '_, M, T>,
    ) -> Result<(), Error> {
        go(self, at, y)?;
        let adjoint = Integrator::adjoint_along(self, at.x, at.u, h, lambda, along)?;
        stack(adjoint, gradient);
        Ok(())
    }

    fn stages(&mut self) -> Result<&[T], Error> {
        Integrator::stages(self)
    }
}
