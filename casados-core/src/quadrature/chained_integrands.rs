//! Integrands of the steps or parts of an interval, whose sums are those of the whole interval.

use super::{Integrand, sealed};
use crate::error::{Error, Place};
use crate::linalg::axpy;
use crate::model::{ArrayW, ArrayX, Dae};
use crate::scalar::Real;
use crate::shape::{Array, InBounds, Shape};

/// Converts derivatives by `(x_n, u, p)` to derivatives by `(x₀, u, p)`: `D_i V_n`.
pub(crate) struct ChainRuleIntegrand<'a, M: Dae, T: Real> {
    pub inner: &'a mut dyn Integrand<M, T>,
    /// `V_n = dx_n/dw`; `None` for the identity.
    pub v: Option<&'a ArrayX<M, ArrayW<M, T>>>,
    /// Whether to compute second derivatives.
    pub with_hessian: bool,
}

impl<M: Dae, T: Real> sealed::Sealed for ChainRuleIntegrand<'_, M, T> {}

impl<M: Dae, T: Real> Integrand<M, T> for ChainRuleIntegrand<'_, M, T> {
    fn variables(&self) -> &'static [u32] {
        self.inner.variables()
    }

    fn stage_variables_mut(&mut self) -> (&mut [T], &mut [ArrayW<M, T>]) {
        self.inner.stage_variables_mut()
    }

    fn add_value(&mut self, weight: T, at: Place) -> Result<(), Error> {
        self.inner.add_value(weight, at)
    }

    fn add_forward(&mut self, weight: T, _: bool, at: Place) -> Result<(), Error> {
        let nx = M::Shape::NX;
        let Some(v) = self.v.map(|v| v.as_ref()) else {
            return self.inner.add_forward(weight, self.with_hessian, at);
        };
        let variables = self.inner.variables();
        let (_, rows) = self.inner.stage_variables_mut();
        for variable in variables {
            let Some(row) = rows.get_mut(*variable as usize).in_bounds() else { continue };
            let mut sum = ArrayW::<M, T>::from_fn(|w| if w < nx { T::ZERO } else { row[w] });
            for (d, v) in row.as_ref().iter().zip(v) {
                axpy(*d, v.as_ref(), sum.as_mut());
            }
            *row = sum;
        }
        self.inner.add_forward(weight, self.with_hessian, at)
    }

    fn weighted_gradient(&mut self, weight: T, at: Place) -> Result<&[T], Error> {
        self.inner.weighted_gradient(weight, at)
    }
}

/// An integrand in the adjoint sweep only: the forward sweep has computed everything else.
pub(crate) struct AdjointOnlyIntegrand<'a, M: Dae, T: Real>(pub &'a mut dyn Integrand<M, T>);

impl<M: Dae, T: Real> sealed::Sealed for AdjointOnlyIntegrand<'_, M, T> {}

impl<M: Dae, T: Real> Integrand<M, T> for AdjointOnlyIntegrand<'_, M, T> {
    fn variables(&self) -> &'static [u32] {
        &[]
    }

    fn stage_variables_mut(&mut self) -> (&mut [T], &mut [ArrayW<M, T>]) {
        self.0.stage_variables_mut()
    }

    fn add_value(&mut self, _: T, _: Place) -> Result<(), Error> {
        Ok(())
    }

    fn add_forward(&mut self, _: T, _: bool, _: Place) -> Result<(), Error> {
        Ok(())
    }

    fn weighted_gradient(&mut self, weight: T, at: Place) -> Result<&[T], Error> {
        self.0.weighted_gradient(weight, at)
    }
}
