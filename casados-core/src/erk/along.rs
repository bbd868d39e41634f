//! An integrand at the stages of the steps; see [`quadrature`](crate::quadrature).

use crate::error::{Error, Place};
use crate::model::{ArrayV, ArrayW, ArrayX, Ode};
use crate::quadrature::OptionalIntegrand;
use crate::scalar::{Lanes, Real};
use crate::shape::Shape;

/// What is beside the states at the stages: an integrand, if there is one.
pub(crate) trait Beside<M: Ode, E: Lanes> {
    /// Whether there is one.
    fn is_any(&self) -> bool;
    /// Before the first step.
    fn begin(&mut self);
    /// Adds the value at a stage with these variables, times `h b`.
    fn value(&mut self, v: &[E], weight: [E; 2], at: Place) -> Result<(), Error>;
    /// Adds what a stage adds to the value and its derivatives, with `dξ`.
    fn forward(
        &mut self,
        v: &[E],
        dxi: &ArrayX<M, ArrayW<M, E>>,
        weight: [E; 2],
        second: bool,
        at: Place,
    ) -> Result<(), Error>;
    /// Adds the gradient at a stage, times `h b`.
    fn adjoint(
        &mut self,
        v: &[E],
        weight: [E; 2],
        gradient: &mut ArrayV<M, [E; 1]>,
        at: Place,
    ) -> Result<(), Error>;
    /// The lower triangle of its second derivatives, if there is one.
    fn second(&self) -> Option<&[ArrayW<M, E>]>;
    /// After the last step.
    fn finish(&mut self) -> Result<(), Error>;
}

impl<M: Ode, T: Real> Beside<M, T> for OptionalIntegrand<'_, '_, M, T> {
    fn is_any(&self) -> bool {
        self.is_some()
    }

    fn begin(&mut self) {
        crate::quadrature::reset_integrand(self);
    }

    fn value(&mut self, v: &[T], [h, b]: [T; 2], at: Place) -> Result<(), Error> {
        let Some(integrand) = self else { return Ok(()) };
        show(v, integrand.point().0);
        integrand.value(h * b, at)
    }

    fn forward(
        &mut self,
        v: &[T],
        dxi: &ArrayX<M, ArrayW<M, T>>,
        [h, b]: [T; 2],
        second: bool,
        at: Place,
    ) -> Result<(), Error> {
        let Some(integrand) = self else { return Ok(()) };
        let nx = M::Shape::NX;
        let variables = integrand.variables();
        let (to, d) = integrand.point();
        show(v, to);
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
        integrand.forward(h * b, second, at)
    }

    fn adjoint(
        &mut self,
        v: &[T],
        [h, b]: [T; 2],
        gradient: &mut ArrayV<M, [T; 1]>,
        at: Place,
    ) -> Result<(), Error> {
        let Some(integrand) = self else { return Ok(()) };
        // ξ̄_i += h b_i φ_x, λ_w += h b_i φ_w
        show(v, integrand.point().0);
        let own = integrand.adjoint(h * b, at)?;
        for (sum, &own) in gradient.as_mut().as_flattened_mut().iter_mut().zip(own) {
            *sum = *sum + own;
        }
        Ok(())
    }

    fn second(&self) -> Option<&[ArrayW<M, T>]> {
        self.as_ref().and_then(|integrand| integrand.second())
    }

    fn finish(&mut self) -> Result<(), Error> {
        crate::quadrature::finish_integrand(self)
    }
}

/// The variables to where an integrand takes them from.
fn show<T: Real>(variables: &[T], to: &mut [T]) {
    for (to, from) in to.iter_mut().zip(variables) {
        *to = *from;
    }
}

/// Nothing at all.
pub(crate) struct Nothing;

impl<M: Ode, E: Lanes> Beside<M, E> for Nothing {
    fn is_any(&self) -> bool {
        false
    }
    fn begin(&mut self) {}
    fn value(&mut self, _: &[E], _: [E; 2], _: Place) -> Result<(), Error> {
        Ok(())
    }
    fn forward(
        &mut self,
        _: &[E],
        _: &ArrayX<M, ArrayW<M, E>>,
        _: [E; 2],
        _: bool,
        _: Place,
    ) -> Result<(), Error> {
        Ok(())
    }
    fn adjoint(&mut self, _: &[E], _: [E; 2], _: &mut ArrayV<M, [E; 1]>, _: Place) -> Result<(), Error> {
        Ok(())
    }
    fn second(&self) -> Option<&[ArrayW<M, E>]> {
        None
    }
    fn finish(&mut self) -> Result<(), Error> {
        Ok(())
    }
}
