//! Rates `ẋ` of an explicit model. Each equation `c ẋ_j + g(x, u, p, t) = 0` is solved by division,
//! which compiles no integrator.

use crate::adaptive::point::{ModelPoint, write_inputs};
use crate::error::{Error, Place, Quantity};
use crate::memory::allocate;
use crate::model::{ArrayK, ArrayV, ArrayW, ArrayX, Dae};
use crate::scalar::Real;
use crate::shape::{InBounds, Matrix, Plain, Shape};
use alloc::boxed::Box;
use bytemuck::Zeroable;

/// Memory of an evaluation.
#[derive(Zeroable)]
#[zeroable(bound = "T: Zeroable")]
pub struct ExplicitRates<M: Dae, T: Plain> {
    variables: ArrayV<M, T>,
    residual: ArrayK<M, T>,
    /// The Jacobian; its first entries are the coefficients `c` of the equations.
    jacobian: M::Jacobian<T>,
}

impl<M: Dae, T: Real> ExplicitRates<M, T> {
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub fn new() -> Result<Box<Self>, Error> {
        let mut rates: Box<Self> = allocate()?;
        M::jacobian_constants::<T>(&mut rates.jacobian);
        Ok(rates)
    }

    /// Evaluates `ẋ` at a point.
    ///
    /// # Errors
    /// [`Error::NonFiniteModel`]
    pub fn evaluate(&mut self, at: &ModelPoint<'_, M, T>, rates: &mut ArrayK<M, T>) -> Result<(), Error> {
        self.write_point(at);
        M::residual::<T>(&self.variables, &mut self.residual);
        let equations = self.residual.as_ref().iter().zip(self.jacobian.as_ref());
        for (equation, (f, c)) in equations.enumerate() {
            let rate = -*f / *c;
            if !rate.is_finite() {
                return Err(non_finite_rate(Quantity::Residual, equation, rate));
            }
            if let Some(to) = rates.as_mut().get_mut(M::STRUCTURE.jacobian.at(equation).1).in_bounds() {
                *to = rate;
            }
        }
        Ok(())
    }

    /// The derivatives of `ẋ` with respect to `(x, u, p)`, one row for each direction.
    ///
    /// # Errors
    /// [`Error::NonFiniteModel`]
    pub fn differentiate(
        &mut self,
        at: &ModelPoint<'_, M, T>,
        to: &mut ArrayW<M, ArrayX<M, T>>,
    ) -> Result<(), Error> {
        self.write_point(at);
        M::residual_jacobian::<T>(&self.variables, &mut self.residual, &mut self.jacobian);
        *to = Zeroable::zeroed();
        let (coefficients, others) = self.jacobian.as_ref().split_at(M::Shape::NX);
        for (entry, value) in others.iter().enumerate() {
            let (equation, variable) = M::STRUCTURE.jacobian.at(M::Shape::NX + entry);
            let Some(c) = coefficients.get(equation).in_bounds() else { continue };
            let derivative = -*value / *c;
            if !derivative.is_finite() {
                return Err(non_finite_rate(Quantity::Jacobian, equation, derivative));
            }
            let row = to.as_mut().get_mut(variable.wrapping_sub(M::Shape::NX));
            let state = M::STRUCTURE.jacobian.at(equation).1;
            if let Some(to) = row.and_then(|row| row.as_mut().get_mut(state).in_bounds()) {
                *to = derivative;
            }
        }
        Ok(())
    }

    fn write_point(&mut self, at: &ModelPoint<'_, M, T>) {
        let (nx, v) = (M::Shape::NX, self.variables.as_mut());
        for (to, from) in v.iter_mut().skip(nx).zip(at.x.as_slice()) {
            *to = *from;
        }
        write_inputs::<M, T>(v, at.u, at.p);
        if let Some(last) = v.last_mut() {
            *last = at.t;
        }
    }
}

fn non_finite_rate<T: Real>(quantity: Quantity, equation: usize, value: T) -> Error {
    let at = Place { step: 0, stage: 0, iteration: 0 };
    Error::NonFiniteModel { quantity, equation, value: value.to_f64(), at }
}
