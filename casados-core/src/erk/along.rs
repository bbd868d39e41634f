//! An integrand at the stages of the steps; see [`quadrature`](crate::quadrature).

use super::integrator::Integrator;
use super::step::Point;
use crate::error::{Error, Place};
use crate::integrator::With;
use crate::memory::Memory;
use crate::model::{ArrayW, ArrayX, Ode};
use crate::quadrature::{Along, Integrand};
use crate::scalar::Real;
use crate::shape::Shape;

/// What a stage adds to the value and its derivatives, with `dξ`.
pub(super) fn forward<M: Ode, T: Real>(
    along: &mut Along<'_, '_, M, T>,
    point: &Point<M, T>,
    dxi: &ArrayX<M, ArrayW<M, T>>,
    weight: T,
    second: bool,
    at: Place,
) -> Result<(), Error> {
    let Some(integrand) = along else { return Ok(()) };
    let nx = M::Shape::NX;
    let variables = integrand.variables();
    let (v, d) = integrand.point();
    for (to, from) in v.iter_mut().zip(point.v.as_ref()) {
        *to = *from;
    }
    for &variable in variables {
        let variable = variable as usize;
        let (Some(row), Some(w)) = (d.get_mut(variable), variable.checked_sub(nx)) else { continue };
        match dxi.as_ref().get(w) {
            Some(dxi) => *row = *dxi,
            None => {
                row.as_mut().fill(T::ZERO);
                if let Some(own) = row.as_mut().get_mut(w) {
                    *own = T::ONE;
                }
            }
        }
    }
    integrand.forward(weight, second, at)
}

impl<M: Ode, B, const S: usize, T: Real, W: Memory> Integrator<M, B, S, T, W> {
    /// Takes an integrand along: the value and the derivatives of `∫ l(x, u, p, t) dt` with those
    /// of the solution; see [`quadrature`](crate::quadrature).
    pub fn with<'a, 'b, Q: Integrand<M, T> + ?Sized>(
        &'a mut self,
        integrand: &'b mut Q,
    ) -> With<'a, 'b, Self, Q> {
        With { integrator: self, integrand }
    }
}
