//! Adjoints of intervals.

use super::begin::{Begin, each};
use crate::memory::{WithAdjoint, WithForward};
use crate::model::{Dae, Ode};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::dynamics::{
    Dynamics, IntegralTerms, IntervalResult, Nodes, Sink, vector,
};
use crate::scalar::Real;
use crate::shape::Matrix;
use crate::{erk, irk};

/// Dynamics with adjoints.
///
/// ```
/// use casados::ocp::{Adjoints, Formulation, HeapOcp, HeapSqp, OcpError, Outcome};
///
/// /// A solver that asks for adjoints while steps contract.
/// fn solve<P>(ocp: &mut HeapOcp<P>) -> Result<Outcome, OcpError>
/// where
///     P: Formulation<f64>,
///     P::Dynamics: Adjoints<f64>,
/// {
///     HeapSqp::new(ocp)?.gauss_newton().keep_jacobians().solve(ocp)
/// }
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` has no adjoints",
    note = "integrators of single intervals without integrals have them, and `Shooting` over a batch; one with `Inline` memory needs `mode::All`"
)]
pub trait Adjoints<T: Real>: Dynamics<T> {
    /// The ends of all intervals; and the gradients of `πᵀφ`, with the multipliers `π` of the
    /// interval, as those of their integral costs.
    ///
    /// # Errors
    /// [`OcpError::Integration`]
    fn adjoints(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError>;
}

/// What a sink is given: an end and the gradients of `πᵀφ`.
pub(in crate::ocp) fn step<'a, T: Real>(
    x: &'a [T],
    [of_x, of_u, of_p]: [&'a [T]; 3],
) -> IntervalResult<'a, T> {
    let cost = IntegralTerms { x: of_x, u: of_u, p: of_p, ..IntegralTerms::default() };
    IntervalResult { x, cost, ..IntervalResult::default() }
}

macro_rules! adjoints {
    ($module:ident, $model:ident, $($memory:tt)+) => {
        impl<M: $model, B, const S: usize, T: Real, W: $($memory)+> Adjoints<T>
            for $module::Integrator<M, B, S, T, W>
        {
            fn adjoints(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
                each::<M, T, _>(self, nodes, sink, |integrator, at, x, u| {
                    integrator.begin(at)?;
                    let result = integrator.adjoint(x, u, at.h, &vector(at.multipliers))?;
                    let gradients = [result.grad_x0.as_slice(), result.grad_u.as_slice(), result.grad_p.as_slice()];
                    Ok(step(result.x.as_slice(), gradients))
                })
            }
        }
    };
}

adjoints!(irk, Dae, WithForward + WithAdjoint<1>);
adjoints!(erk, Ode, WithForward);
