//! Integrals along an adaptive integration; see [`quadrature`](crate::quadrature).

use super::engine::Engine;
use super::events::{Hybrid, HybridAdjoint, HybridForward, Solution};
use super::integrator::Integrator;
use super::piecewise::{Piecewise, PiecewiseAdjoint, PiecewiseForward, PiecewiseHessian, Spanning};
use crate::error::Error;
use crate::integrator::With;
use crate::model::{Dae, VectorU, VectorX};
use crate::quadrature::Integrand;
use crate::result::Nominal;
use crate::scalar::Real;

impl<M: Dae, B: Engine<M, T>, T: Real> Integrator<M, B, T> {
    /// Adds an integrand: the value and the derivatives of `∫ l(x, z, u, p, t) dt`, together with
    /// those of the solution; see [`quadrature`](crate::quadrature).
    ///
    /// The states determine the steps, which are then replayed and solved to rounding: the
    /// derivatives are those of the value.
    pub fn with<'a, 'b, Q: Integrand<M, T> + ?Sized>(
        &'a mut self,
        integrand: &'b mut Q,
    ) -> With<'a, 'b, Self, Q> {
        With { integrator: self, integrand }
    }
}

impl<M: Dae, B: Engine<M, T>, T: Real> Piecewise<M, B, T> {
    /// Adds an integrand: its integral over all intervals and its derivatives, together with those
    /// of the solution; see [`quadrature`](crate::quadrature). The derivatives with respect to all
    /// controls are returned; those within the integrand are zero.
    pub fn with<'a, 'b, Q: Integrand<M, T> + ?Sized>(
        &'a mut self,
        integrand: &'b mut Q,
    ) -> With<'a, 'b, Self, Q> {
        With { integrator: self, integrand }
    }
}

impl<'a, M: Dae, B: Engine<M, T>, T: Real, Q: Integrand<M, T>> With<'a, '_, Piecewise<M, B, T>, Q> {
    /// As [`Piecewise::solve`]; computes the integral over all intervals.
    ///
    /// # Errors
    /// See [`Piecewise`]; [`Error::NonFiniteFunction`].
    pub fn solve(
        self,
        x0: &VectorX<M, T>,
        controls: &[VectorU<M, T>],
        ends: &[T],
    ) -> Result<&'a Nominal<M, T>, Error> {
        self.integrator.solve_with_quadrature(x0, controls, ends, Some(self.integrand))
    }

    /// As [`Piecewise::forward`]; computes the integral over all intervals, and returns its
    /// derivatives.
    ///
    /// # Errors
    /// See [`Piecewise`]; [`Error::NonFiniteFunction`].
    pub fn forward(
        self,
        x0: &VectorX<M, T>,
        controls: &[VectorU<M, T>],
        ends: &[T],
    ) -> Result<(PiecewiseForward<M, T>, Q::Derivatives), Error>
    where
        Q: Spanning<M, T>,
    {
        self.integrator.forward_with_quadrature(x0, controls, ends, self.integrand)
    }

    /// As [`Piecewise::hessian`]; gradient and Hessian are those of `λᵀx` at the end plus the
    /// integral over all intervals. Also returns the derivatives of the integral.
    ///
    /// # Errors
    /// See [`Piecewise`]; [`Error::NonFiniteFunction`].
    pub fn hessian(
        self,
        x0: &VectorX<M, T>,
        controls: &[VectorU<M, T>],
        ends: &[T],
        lambda: &VectorX<M, T>,
    ) -> Result<(PiecewiseHessian<M, T>, Q::Derivatives), Error>
    where
        Q: Spanning<M, T>,
    {
        self.integrator.hessian_with_quadrature(x0, controls, ends, lambda, self.integrand)
    }

    /// As [`Piecewise::adjoint`]; the gradient is that of `λᵀx` at the end plus the integral over
    /// all intervals.
    ///
    /// # Errors
    /// See [`Piecewise`]; [`Error::NonFiniteFunction`].
    pub fn adjoint(
        self,
        x0: &VectorX<M, T>,
        controls: &[VectorU<M, T>],
        ends: &[T],
        lambda: &VectorX<M, T>,
    ) -> Result<PiecewiseAdjoint<M, T>, Error> {
        self.integrator.adjoint_with_quadrature(x0, controls, ends, lambda, Some(self.integrand))
    }
}

impl<M: Dae, B: Engine<M, T>, T: Real> Hybrid<M, B, T> {
    /// Adds an integrand, up to the end and across all events, at which it may jump with the state;
    /// see [`quadrature`](crate::quadrature).
    ///
    /// At events derivatives are those of the solution, as for the state: the integrand before the
    /// event, minus the integrand after it, times the derivative of its time.
    pub fn with<'a, 'b, Q: Integrand<M, T> + ?Sized>(
        &'a mut self,
        integrand: &'b mut Q,
    ) -> With<'a, 'b, Self, Q> {
        With { integrator: self, integrand }
    }
}

impl<'a, M: Dae, B: Engine<M, T>, T: Real, Q: Integrand<M, T>> With<'a, '_, Hybrid<M, B, T>, Q> {
    /// As [`Hybrid::solve`]; computes the integral.
    ///
    /// # Errors
    /// See [`Hybrid`]; [`Error::Grazing`].
    pub fn solve(self, x0: &VectorX<M, T>, u: &VectorU<M, T>, h: T) -> Result<&'a Solution<M, T>, Error> {
        self.integrator.solve_with_quadrature(x0, u, h, Some(self.integrand))
    }

    /// As [`Hybrid::forward`]; computes the integral and its derivatives.
    ///
    /// # Errors
    /// See [`Hybrid`].
    pub fn forward(self, x0: &VectorX<M, T>, u: &VectorU<M, T>, h: T) -> Result<HybridForward<M, T>, Error> {
        self.integrator.forward_with_quadrature(x0, u, h, Some(self.integrand))
    }

    /// As [`Hybrid::adjoint`]; the gradient is that of `λᵀx` plus the integral.
    ///
    /// # Errors
    /// See [`Hybrid`].
    pub fn adjoint(
        self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
    ) -> Result<HybridAdjoint<M, T>, Error> {
        self.integrator.adjoint_with_quadrature(x0, u, h, lambda, Some(self.integrand))
    }
}
