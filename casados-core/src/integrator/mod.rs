//! The trait of all integrators of one interval.

pub(crate) mod chain_rule;
mod divided;
mod with_quadrature;

pub use divided::Divided;
pub use with_quadrature::With;

use crate::error::Error;
use crate::memory::{Memory, WithAdjoint, WithForward, WithHessian};
use crate::model::{Dae, VectorP, VectorU, VectorX};
use crate::quadrature::{Integrand, OptionalIntegrand};
use crate::result::{Adjoint, Forward, Hessian, Nominal};
use crate::scalar::Real;
use crate::statistics::Statistics;

/// The state of the model of an integrator.
type StateOf<I> = VectorX<<I as Integrator>::Model, <I as Integrator>::Number>;
/// The control of the model of an integrator.
type ControlOf<I> = VectorU<<I as Integrator>::Model, <I as Integrator>::Number>;

/// An integrator of one interval: [`Irk`](crate::Irk), [`Erk`](crate::Erk) or `Adaptive`.
///
/// Calls take the state at the start of the interval, the control, and the length of the interval,
/// and return a reference to results in the memory of the integrator. The integrators have the same
/// functions without the trait, with documentation of their results and errors; functions with
/// derivatives exist if the memory of the integrator supports them.
///
/// ```
/// # use casados_core::{Dae, Error, Heap, Integrator, model::{VectorU, VectorX}};
/// /// How much faster than its inputs a solution changes: `‖∂x/∂x₀‖`.
/// fn growth<I: Integrator<Number = f64, Memory = Heap>>(
///     integrator: &mut I,
///     x0: &VectorX<I::Model, f64>,
///     u: &VectorU<I::Model, f64>,
///     h: f64,
/// ) -> Result<f64, Error> {
///     use casados_core::shape::Matrix;
///     let jacobian = &integrator.forward(x0, u, h)?.dx_dx0;
///     Ok(jacobian.as_slice().iter().map(|entry| entry * entry).sum::<f64>().sqrt())
/// }
/// ```
pub trait Integrator {
    /// The model.
    type Model: Dae;
    /// The number type.
    type Number: Real;
    /// The memory of the integrator.
    type Memory: Memory;

    /// Sets the parameters of all following calls.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]; the last parameters remain valid.
    fn set_parameters(&mut self, p: &VectorP<Self::Model, Self::Number>) -> Result<(), Error>;
    /// Sets the time at the start of the interval for all following calls; the default is zero.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]; the last time remains valid.
    fn set_time(&mut self, t: Self::Number) -> Result<(), Error>;
    /// Discards the warm start, if the integrator has one.
    fn reset(&mut self);
    /// Returns the statistics of the last call; for an adaptive integrator those of the step
    /// selection.
    fn statistics(&self) -> Statistics;

    /// [`solve`](Self::solve) with an optional integrand.
    ///
    /// # Errors
    /// Those of the integrator; [`Error::NonFiniteFunction`].
    fn solve_with_quadrature(
        &mut self,
        x0: &StateOf<Self>,
        u: &ControlOf<Self>,
        h: Self::Number,
        integrand: OptionalIntegrand<'_, '_, Self::Model, Self::Number>,
    ) -> Result<&Nominal<Self::Model, Self::Number>, Error>;
    /// [`forward`](Self::forward) with an optional integrand.
    ///
    /// # Errors
    /// Those of the integrator; [`Error::NonFiniteFunction`].
    fn forward_with_quadrature(
        &mut self,
        x0: &StateOf<Self>,
        u: &ControlOf<Self>,
        h: Self::Number,
        integrand: OptionalIntegrand<'_, '_, Self::Model, Self::Number>,
    ) -> Result<&Forward<Self::Model, Self::Number>, Error>
    where
        Self::Memory: WithForward;
    /// [`adjoint`](Self::adjoint) with an optional integrand.
    ///
    /// # Errors
    /// Those of the integrator; [`Error::NonFiniteFunction`].
    fn adjoint_with_quadrature(
        &mut self,
        x0: &StateOf<Self>,
        u: &ControlOf<Self>,
        h: Self::Number,
        lambda: &StateOf<Self>,
        integrand: OptionalIntegrand<'_, '_, Self::Model, Self::Number>,
    ) -> Result<&Adjoint<Self::Model, Self::Number>, Error>
    where
        Self::Memory: WithAdjoint<1>;
    /// [`hessian`](Self::hessian) with an optional integrand.
    ///
    /// # Errors
    /// Those of the integrator; [`Error::NonFiniteFunction`].
    fn hessian_with_quadrature(
        &mut self,
        x0: &StateOf<Self>,
        u: &ControlOf<Self>,
        h: Self::Number,
        lambda: &StateOf<Self>,
        integrand: OptionalIntegrand<'_, '_, Self::Model, Self::Number>,
    ) -> Result<&Hessian<Self::Model, Self::Number>, Error>
    where
        Self::Memory: WithHessian;

    /// Returns the solution at the end of an interval of length `h`.
    ///
    /// # Errors
    /// Those of the integrator.
    fn solve(
        &mut self,
        x0: &StateOf<Self>,
        u: &ControlOf<Self>,
        h: Self::Number,
    ) -> Result<&Nominal<Self::Model, Self::Number>, Error> {
        self.solve_with_quadrature(x0, u, h, None)
    }
    /// Returns the solution, and its derivatives with respect to `x₀`, `u` and `p`.
    ///
    /// # Errors
    /// Those of the integrator.
    fn forward(
        &mut self,
        x0: &StateOf<Self>,
        u: &ControlOf<Self>,
        h: Self::Number,
    ) -> Result<&Forward<Self::Model, Self::Number>, Error>
    where
        Self::Memory: WithForward,
    {
        self.forward_with_quadrature(x0, u, h, None)
    }
    /// Returns the solution, and the gradient of `λᵀx` with respect to `x₀`, `u` and `p`.
    ///
    /// # Errors
    /// Those of the integrator.
    fn adjoint(
        &mut self,
        x0: &StateOf<Self>,
        u: &ControlOf<Self>,
        h: Self::Number,
        lambda: &StateOf<Self>,
    ) -> Result<&Adjoint<Self::Model, Self::Number>, Error>
    where
        Self::Memory: WithAdjoint<1>,
    {
        self.adjoint_with_quadrature(x0, u, h, lambda, None)
    }
    /// Returns the solution, its derivatives, and the gradient and the Hessian of `λᵀx`.
    ///
    /// # Errors
    /// Those of the integrator.
    fn hessian(
        &mut self,
        x0: &StateOf<Self>,
        u: &ControlOf<Self>,
        h: Self::Number,
        lambda: &StateOf<Self>,
    ) -> Result<&Hessian<Self::Model, Self::Number>, Error>
    where
        Self::Memory: WithHessian,
    {
        self.hessian_with_quadrature(x0, u, h, lambda, None)
    }
    /// Adds a quadrature: computes the value and the derivatives of `∫ l(x, z, u, p, t) dt`
    /// together with the solution; see [`quadrature`](crate::quadrature).
    fn with<'a, 'b, Q: Integrand<Self::Model, Self::Number> + ?Sized>(
        &'a mut self,
        integrand: &'b mut Q,
    ) -> With<'a, 'b, Self, Q>
    where
        Self: Sized,
    {
        With { integrator: self, integrand }
    }
}
