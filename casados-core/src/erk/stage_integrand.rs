//! An integrand at the stages of the steps; see [`quadrature`](crate::quadrature).

use crate::error::{Error, Place};
use crate::model::{ArrayV, ArrayW, ArrayX, Ode};
use crate::quadrature::OptionalIntegrand;
use crate::scalar::{Lanes, Real};
use crate::shape::{InBounds, Shape};

/// An optional integrand, evaluated at the stages.
pub(crate) trait StageIntegrand<M: Ode, E: Lanes> {
    /// Whether there is an integrand.
    fn is_present(&self) -> bool;
    /// Resets the sums before the first step.
    fn reset(&mut self);
    /// Adds the value at a stage with variables `v`, times `h b`.
    fn add_value(&mut self, v: &[E], weight: [E; 2], at: Place) -> Result<(), Error>;
    /// Adds the value and its derivatives at a stage, with `dξ`.
    fn add_forward(
        &mut self,
        v: &[E],
        dxi: &ArrayX<M, ArrayW<M, E>>,
        weight: [E; 2],
        with_hessian: bool,
        at: Place,
    ) -> Result<(), Error>;
    /// Adds the gradient at a stage, times `h b`.
    fn add_gradient(
        &mut self,
        v: &[E],
        weight: [E; 2],
        gradient: &mut ArrayV<M, [E; 1]>,
        at: Place,
    ) -> Result<(), Error>;
    /// The lower triangle of the second derivatives of the integral; `None` without an integrand.
    fn hessian_sum(&self) -> Option<&[ArrayW<M, E>]>;
    /// Completes the integral after the last step.
    fn finish(&mut self) -> Result<(), Error>;
}

impl<M: Ode, T: Real> StageIntegrand<M, T> for OptionalIntegrand<'_, '_, M, T> {
    fn is_present(&self) -> bool {
        self.is_some()
    }

    fn reset(&mut self) {
        crate::quadrature::reset_integrand(self);
    }

    fn add_value(&mut self, v: &[T], [h, b]: [T; 2], at: Place) -> Result<(), Error> {
        let Some(integrand) = self else { return Ok(()) };
        copy_variables(v, integrand.stage_variables_mut().0);
        integrand.add_value(h * b, at)
    }

    fn add_forward(
        &mut self,
        v: &[T],
        dxi: &ArrayX<M, ArrayW<M, T>>,
        [h, b]: [T; 2],
        with_hessian: bool,
        at: Place,
    ) -> Result<(), Error> {
        let Some(integrand) = self else { return Ok(()) };
        let nx = M::Shape::NX;
        let variables = integrand.variables();
        let (to, d) = integrand.stage_variables_mut();
        copy_variables(v, to);
        for &variable in variables {
            let variable = variable as usize;
            let (Some(row), Some(w)) = (d.get_mut(variable).in_bounds(), variable.checked_sub(nx)) else {
                continue;
            };
            match dxi.as_ref().get(w) {
                Some(dxi) => *row = *dxi,
                None => {
                    row.as_mut().fill(T::ZERO);
                    if let Some(own) = row.as_mut().get_mut(w).in_bounds() {
                        *own = T::ONE;
                    }
                }
            }
        }
        integrand.add_forward(h * b, with_hessian, at)
    }

    fn add_gradient(
        &mut self,
        v: &[T],
        [h, b]: [T; 2],
        gradient: &mut ArrayV<M, [T; 1]>,
        at: Place,
    ) -> Result<(), Error> {
        let Some(integrand) = self else { return Ok(()) };
        // ξ̄_i += h b_i φ_x, λ_w += h b_i φ_w
        copy_variables(v, integrand.stage_variables_mut().0);
        let integrand_gradient = integrand.weighted_gradient(h * b, at)?;
        for (sum, &own) in gradient.as_mut().as_flattened_mut().iter_mut().zip(integrand_gradient) {
            *sum = *sum + own;
        }
        Ok(())
    }

    fn hessian_sum(&self) -> Option<&[ArrayW<M, T>]> {
        self.as_ref().and_then(|integrand| integrand.hessian_sum())
    }

    fn finish(&mut self) -> Result<(), Error> {
        crate::quadrature::finish_integrand(self)
    }
}

/// Copies the variables to the input of an integrand.
fn copy_variables<T: Real>(variables: &[T], to: &mut [T]) {
    for (to, from) in to.iter_mut().zip(variables) {
        *to = *from;
    }
}

/// The absence of an integrand.
pub(crate) struct NoIntegrand;

impl<M: Ode, E: Lanes> StageIntegrand<M, E> for NoIntegrand {
    fn is_present(&self) -> bool {
        false
    }
    fn reset(&mut self) {}
    fn add_value(&mut self, _: &[E], _: [E; 2], _: Place) -> Result<(), Error> {
        Ok(())
    }
    fn add_forward(
        &mut self,
        _: &[E],
        _: &ArrayX<M, ArrayW<M, E>>,
        _: [E; 2],
        _: bool,
        _: Place,
    ) -> Result<(), Error> {
        Ok(())
    }
    fn add_gradient(&mut self, _: &[E], _: [E; 2], _: &mut ArrayV<M, [E; 1]>, _: Place) -> Result<(), Error> {
        Ok(())
    }
    fn hessian_sum(&self) -> Option<&[ArrayW<M, E>]> {
        None
    }
    fn finish(&mut self) -> Result<(), Error> {
        Ok(())
    }
}
