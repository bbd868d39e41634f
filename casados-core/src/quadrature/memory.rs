//! A function at a stage, and the products of its derivatives with those of the variables.

use super::product::CongruenceUpdate;
use crate::error::{Error, Place};
use crate::finite::find_non_finite;
use crate::function::{ArrayV, ArrayY, Function};
use crate::linalg::{axpy, dispatch};
use crate::scalar::Real;
use crate::shape::{InBounds, Plain, Shape, plain};
use bytemuck::Zeroable;

/// `[T; NW]` of a function.
pub(super) type ArrayW<F, T> = <<F as Function>::Shape as Shape>::ArrayW<T>;

/// Memory of a stage.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(super) struct StageMemory<F: Function, T: Plain> {
    /// The variables of the model.
    pub v: ArrayV<F, T>,
    /// Their derivatives `D`.
    pub d: ArrayV<F, ArrayW<F, T>>,
    pub y: ArrayY<F, T>,
    pub jacobian: F::Jacobian<T>,
    /// `dy = y_v D`
    pub dy: ArrayY<F, ArrayW<F, T>>,
    /// Multipliers of the outputs.
    pub mu: ArrayY<F, T>,
    pub gradient: ArrayV<F, T>,
    hessian: F::Hessian<T>,
    entries: F::Hessian<[T; 1]>,
    /// `G = H D`
    g: ArrayV<F, ArrayW<F, T>>,
    /// The sum of `Dᵀ H D`, its lower triangle.
    pub second: ArrayW<F, ArrayW<F, T>>,
}

plain!([F: Function, T: Plain] StageMemory<F, T> { v, d, y, jacobian, dy, mu, gradient, hessian, entries, g, second });

impl<F: Function, T: Real> StageMemory<F, T> {
    pub fn reset(&mut self) {
        F::jacobian_constants::<T>(&mut self.jacobian);
        for row in self.second.as_mut() {
            row.as_mut().fill(T::ZERO);
        }
    }

    /// Evaluates `y`.
    ///
    /// # Errors
    /// [`Error::NonFiniteFunction`]
    pub fn evaluate(&mut self, at: Place) -> Result<(), Error> {
        F::value::<T>(&self.v, &mut self.y);
        self.check_finite(at)
    }

    /// Evaluates `y` and `dy`.
    ///
    /// # Errors
    /// [`Error::NonFiniteFunction`]
    pub fn evaluate_forward(&mut self, at: Place) -> Result<(), Error> {
        let Self { v, y, jacobian, d, dy, .. } = self;
        F::value_jacobian::<T>(v, y, jacobian);
        for row in dy.as_mut() {
            row.as_mut().fill(T::ZERO);
        }
        for (entry, value) in jacobian.as_ref().iter().enumerate() {
            let (output, variable) = F::STRUCTURE.jacobian.at(entry);
            if let (Some(dy), Some(d)) =
                (dy.as_mut().get_mut(output).in_bounds(), d.as_ref().get(variable).in_bounds())
            {
                axpy(*value, d.as_ref(), dy.as_mut());
            }
        }
        self.check_finite(at)
    }

    /// Computes `weight ∇(μᵀy)`.
    pub fn weighted_gradient(&mut self, weight: T) -> &[T] {
        for mu in self.mu.as_mut() {
            *mu = weight * *mu;
        }
        F::adjoint::<T>(&self.v, &self.mu, &mut self.gradient);
        self.gradient.as_ref()
    }

    /// `second += weight Dᵀ ∇²(μᵀy) D`
    pub fn add_second_derivatives(&mut self, weight: T) {
        let Self { v, mu, d, hessian, entries, g, second, .. } = self;
        F::hessian::<T>(v, mu, hessian);
        for (entry, value) in entries.as_mut().iter_mut().zip(hessian.as_ref()) {
            // Negative, since the product below is subtracted.
            *entry = [-(weight * *value)];
        }
        dispatch(CongruenceUpdate {
            pattern: F::STRUCTURE.hessian,
            nonlinear_variables: F::STRUCTURE.variables,
            entries: entries.as_ref(),
            stage: 0,
            d: d.as_ref(),
            g: g.as_mut(),
            sum: second.as_mut(),
        });
    }

    fn check_finite(&self, at: Place) -> Result<(), Error> {
        match find_non_finite(self.y.as_ref()) {
            None => Ok(()),
            Some((output, value)) => {
                Err(Error::NonFiniteFunction { function: F::STRUCTURE.name, output, value, at })
            }
        }
    }
}
