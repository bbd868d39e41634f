//! What integrators have in common: the calls of one interval.

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

/// `x` of the model of an integrator.
type StateOf<I> = VectorX<<I as Integrator>::Model, <I as Integrator>::Number>;
/// `u` of the model of an integrator.
type ControlOf<I> = VectorU<<I as Integrator>::Model, <I as Integrator>::Number>;

/// An integrator of one interval, whichever it is: [`Irk`](crate::Irk), [`Erk`](crate::Erk) or
/// `Adaptive`.
///
/// Calls take the state at the start of the interval, the control, and the length of the interval,
/// and return a reference to results in the memory of the integrator. What each of them does and
/// which errors it has is said at the integrators, which have the same calls without the trait;
/// those with derivatives exist where the memory of the integrator has a place for them.
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
    /// The model that is integrated.
    type Model: Dae;
    /// What it is computed with.
    type Number: Real;
    /// Where results are.
    type Memory: Memory;

    /// Parameters of all later calls.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]: then the last parameters stay.
    fn set_parameters(&mut self, p: &VectorP<Self::Model, Self::Number>) -> Result<(), Error>;
    /// The time at the start of the interval of all later calls; zero if never set.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]: then the last time stays.
    fn set_time(&mut self, t: Self::Number) -> Result<(), Error>;
    /// Forgets the warm start, of an integrator that has one.
    fn reset(&mut self);
    /// What the last call did; of an adaptive integrator what it did to choose its steps.
    fn statistics(&self) -> Statistics;

    /// As [`solve`](Self::solve), with an integrand or without.
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
    /// As [`forward`](Self::forward), with an integrand or without.
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
    /// As [`adjoint`](Self::adjoint), with an integrand or without.
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
    /// As [`hessian`](Self::hessian), with an integrand or without.
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

    /// The solution at the end of an interval of length `h`.
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
    /// The solution, and its derivatives with respect to `x₀`, `u` and `p`.
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
    /// The solution, and the gradient of `λᵀx` with respect to `x₀`, `u` and `p`.
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
    /// The solution, its derivatives, and the gradient and the Hessian of `λᵀx`.
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
    /// Takes an integrand along: the value and the derivatives of `∫ l(x, z, u, p, t) dt` with
    /// those of the solution; see [`quadrature`](crate::quadrature).
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
