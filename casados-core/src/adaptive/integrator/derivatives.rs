//! Calls with derivatives.

use super::*;

impl<M: Dae, B: Engine<M, T>, T: Real> Integrator<M, B, T> {
    /// The solution, and its derivatives with respect to `x₀`, `u` and `p`: of the steps that were
    /// taken, exactly.
    ///
    /// The steps are chosen as in [`Integrator::solve`], then kept, and their stages solved to
    /// rounding, each from where the run took it.
    ///
    /// # Errors
    /// See [`Integrator`]; those of Newton's method with steps that are kept.
    pub fn forward(&mut self, x0: &VectorX<M, T>, u: &VectorU<M, T>, h: T) -> Result<&Forward<M, T>, Error> {
        self.forward_with_quadrature(x0, u, h, None)
    }

    /// The solution, and the gradient of `λᵀx` with respect to `x₀`, `u` and `p`; as
    /// [`Integrator::forward`].
    ///
    /// # Errors
    /// As [`Integrator::forward`].
    pub fn adjoint(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
    ) -> Result<&Adjoint<M, T>, Error> {
        self.adjoint_with_quadrature(x0, u, h, lambda, None)
    }

    /// The solution, its derivatives, and the gradient and the Hessian of `λᵀx`; as
    /// [`Integrator::forward`].
    ///
    /// # Errors
    /// As [`Integrator::forward`].
    pub fn hessian(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
    ) -> Result<&Hessian<M, T>, Error> {
        self.hessian_with_quadrature(x0, u, h, lambda, None)
    }
}
