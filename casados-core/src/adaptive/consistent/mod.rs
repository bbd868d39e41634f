//! Consistent `ẋ` and `z` at a point: the solution of `f(ẋ, x, u, z, p, t) = 0` for given `x`.
//!
//! Implicit models use one step of the explicit Euler method, whose only stage is at the start of
//! the step; explicit models use [`ExplicitRates`].

mod rates;

use crate::adaptive::point::ModelPoint;
use crate::error::Error;
use crate::irk::Integrator;
use crate::memory::Heap;
use crate::memory::fallback::OneStep;
use crate::model::{ArrayK, ArrayV, ArrayW, ArrayX, Dae};
use crate::options::{Options, Start};
use crate::result::Forward;
use crate::scalar::Real;
use crate::shape::Shape;
use crate::tableau::{Custom, Euler, Method};
use alloc::boxed::Box;
use bytemuck::Zeroable;
use rates::ExplicitRates;

/// One stage at the start of the step.
type EulerStep<M, T> = Integrator<M, Custom<1>, 1, T, Heap<OneStep>>;

/// Solves for `(ẋ, z)`.
pub struct Consistent<M: Dae, T: Real> {
    euler_step: Option<EulerStep<M, T>>,
    rates: Option<Box<ExplicitRates<M, T>>>,
}

impl<M: Dae, T: Real> Default for Consistent<M, T> {
    fn default() -> Self {
        Self { euler_step: None, rates: None }
    }
}

impl<M: Dae, T: Real> Consistent<M, T> {
    /// Explicit models need no iteration.
    const IS_EXPLICIT: bool = M::STRUCTURE.is_explicit();

    fn explicit_rates(&mut self) -> Result<&mut ExplicitRates<M, T>, Error> {
        Ok(match &mut self.rates {
            Some(rates) => rates,
            none => none.insert(ExplicitRates::new()?),
        })
    }

    fn euler_step_at(
        &mut self,
        at: &ModelPoint<'_, M, T>,
        y: &ArrayK<M, T>,
    ) -> Result<&mut EulerStep<M, T>, Error> {
        let euler = match &mut self.euler_step {
            Some(euler) => euler,
            none => {
                let options = Options { start: Start::Warm, ..Options::default() };
                none.insert(Integrator::with_tableau(options, Euler::TABLEAU)?)
            }
        };
        if M::Shape::NP > 0 {
            euler.set_parameters(at.p)?;
        }
        euler.set_time(at.t)?;
        euler.run.set_stages(y.as_ref())?;
        Ok(euler)
    }

    /// Solves for `(ẋ, z)` from the initial guess `y`; returns the number of model evaluations.
    ///
    /// # Errors
    /// [`Error::InconsistentStart`]; the errors of Newton's method.
    pub fn solve(&mut self, at: &ModelPoint<'_, M, T>, y: &mut ArrayK<M, T>) -> Result<usize, Error> {
        if const { Self::IS_EXPLICIT } {
            self.explicit_rates()?.evaluate(at, y)?;
            return Ok(1);
        }
        let euler = self.euler_step_at(at, y)?;
        if let Err(error) = euler.solve(at.x, at.u, T::ZERO) {
            return Err(inconsistency_error(euler, error, at.t));
        }
        y.as_mut().copy_from_slice(euler.stages()?);
        let statistics = euler.statistics();
        Ok(statistics.residuals + statistics.jacobians)
    }

    /// As [`Consistent::solve`], for an initial guess by the user: the error reports whether the
    /// guess caused it.
    ///
    /// # Errors
    /// As [`Consistent::solve`]; [`Error::NonFiniteStart`].
    pub fn solve_with_diagnosis(
        &mut self,
        at: &ModelPoint<'_, M, T>,
        y: &mut ArrayK<M, T>,
    ) -> Result<usize, Error> {
        if const { Self::IS_EXPLICIT } {
            return self.solve(at, y);
        }
        let start = *y;
        let solved = self.solve(at, y);
        match (&mut self.euler_step, solved) {
            (Some(euler), Err(error)) => Err(euler.run.explain_with_start(error, start.as_ref())),
            (_, solved) => solved,
        }
    }

    /// The derivatives of `z` at the consistent point `y = (ẋ, z)`.
    ///
    /// # Errors
    /// As [`Consistent::solve`].
    pub fn forward(&mut self, at: &ModelPoint<'_, M, T>, y: &ArrayK<M, T>) -> Result<&Forward<M, T>, Error> {
        self.euler_step_at(at, y)?.forward(at.x, at.u, T::ZERO)
    }
}

impl<M: Dae, T: Real> Consistent<M, T> {
    /// The derivatives of `ẋ` with respect to `(x, u, p)` at the consistent point `(ẋ, z)`, one row
    /// for each direction.
    ///
    /// # Errors
    /// As [`Consistent::solve`].
    pub fn rate_derivatives(
        &mut self,
        at: &ModelPoint<'_, M, T>,
        y: &ArrayK<M, T>,
        to: &mut ArrayW<M, ArrayX<M, T>>,
    ) -> Result<(), Error> {
        if const { Self::IS_EXPLICIT } {
            return self.explicit_rates()?.differentiate(at, to);
        }
        self.forward(at, y)?;
        // The slope of the single stage.
        self.euler_step.as_mut().ok_or(Error::NoResult)?.slope_derivatives(&[1.0], to)
    }
}

/// The error that describes the inconsistency at the last iterate of Newton's method.
fn inconsistency_error<M: Dae, T: Real>(euler: &mut EulerStep<M, T>, error: Error, t: T) -> Error {
    let (unknown, worst) = match error {
        Error::Singular { unknown, .. } => (unknown, None),
        Error::NotConverged { unknown, equation, .. } => (unknown, Some(equation)),
        other => return other,
    };
    let Ok(points) = euler.run.points() else { return error };
    let mut v = ArrayV::<M, T>::zeroed();
    for (v, [point]) in v.as_mut().iter_mut().zip(points.as_ref()) {
        *v = *point;
    }
    let mut f = ArrayK::<M, T>::zeroed();
    M::residual::<T>(&v, &mut f);
    let f = f.as_ref();
    let largest = || (0..f.len()).max_by(|a, b| f[*a].abs().to_f64().total_cmp(&f[*b].abs().to_f64()));
    let equation = worst.or_else(largest).unwrap_or_default();
    let (nx, (x, z)) = (M::Shape::NX, (M::STRUCTURE.x, M::STRUCTURE.z));
    let state = x.iter().position(|name| *name == unknown);
    let algebraic = z.iter().position(|name| *name == unknown).map(|index| 2 * nx + index);
    let value = state.or(algebraic).and_then(|index| v.as_ref().get(index));
    let number = |value: Option<&T>| value.map_or(f64::NAN, |value| value.to_f64());
    Error::InconsistentStart {
        t: t.to_f64(),
        equation,
        residual: number(f.get(equation)),
        unknown,
        value: number(value),
        singular: worst.is_none(),
    }
}
