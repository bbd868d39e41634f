//! Calls with derivatives.

use super::*;

impl<M: Dae, B: Engine<M, T>, T: Real> Integrator<M, B, T> {
    /// The solution and its derivatives with respect to `x₀`, `u` and `p`: exact derivatives of the
    /// accepted steps.
    ///
    /// The steps are chosen as in [`Integrator::solve`]; then their stages are solved to rounding,
    /// each step from the accepted state, and differentiated.
    ///
    /// # Errors
    /// See [`Integrator`]; the errors of Newton's method in the repeated steps.
    pub fn forward(&mut self, x0: &VectorX<M, T>, u: &VectorU<M, T>, h: T) -> Result<&Forward<M, T>, Error> {
        self.forward_with_quadrature(x0, u, h, None)
    }

    /// The solution and the gradient of `λᵀx` with respect to `x₀`, `u` and `p`, of the steps as in
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

    /// The solution, its derivatives, and the gradient and Hessian of `λᵀx`, of the steps as in
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
