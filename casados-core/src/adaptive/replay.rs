//! Replay of an accepted step, solved to rounding, and its derivatives: an interval of one step for
//! the fixed-step integrator.
//!
//! Calls are statically dispatched: a program contains only the derivatives that it uses.

use super::point::ModelPoint;
use crate::error::Error;
use crate::integrator::Integrator as _;
use crate::irk::Integrator;
use crate::memory::Heap;
use crate::memory::fallback::OneStep;
use crate::model::{ArrayW, ArrayX, Dae, VectorX};
use crate::options::{Options, Start};
use crate::quadrature::OptionalIntegrand;
use crate::result::{Adjoint, Forward, Hessian, Nominal};
use crate::scalar::Real;
use crate::shape::Shape;
use crate::tableau::Method;
use alloc::boxed::Box;

/// An accepted step.
pub struct StepRecord<'a, M: Dae, T: Real> {
    /// The start of the step.
    pub start: ModelPoint<'a, M, T>,
    /// The length of the step.
    pub h: T,
    /// The unknowns of its stages, or an initial guess of them.
    pub stage_unknowns: &'a [T],
    /// The index of its method in the family.
    pub order_index: usize,
    /// Whether the unknowns are those of the step, up to rounding: the step is then differentiated
    /// at them if Newton's method converges elsewhere, and differentiation never fails to converge.
    pub stages_are_solved: bool,
}

/// Differentiates steps of given size.
pub trait StepDifferentiator<M: Dae, T: Real> {
    /// Solves the step.
    ///
    /// # Errors
    /// Those of Newton's method.
    fn solve(
        &mut self,
        step: &StepRecord<'_, M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Nominal<M, T>, Error>;
    /// Solves the step and computes its derivatives.
    ///
    /// # Errors
    /// Those of Newton's method; a singular matrix.
    fn forward(
        &mut self,
        step: &StepRecord<'_, M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Forward<M, T>, Error>;
    /// The derivatives of `Σ_i weight_i k_i` of the last differentiated step with respect to
    /// `(x_n, u, p)`, one row for each direction.
    ///
    /// # Errors
    /// [`Error::NoResult`]
    fn slopes(
        &mut self,
        level: usize,
        weights: &[f64],
        to: &mut ArrayW<M, ArrayX<M, T>>,
    ) -> Result<(), Error>;
    /// Solves the step and computes its derivatives and the second derivatives of `λᵀx` at its end.
    ///
    /// # Errors
    /// Those of Newton's method; a singular matrix.
    fn hessian(
        &mut self,
        step: &StepRecord<'_, M, T>,
        lambda: &VectorX<M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Hessian<M, T>, Error>;
    /// The gradient of `λᵀx` at its end.
    ///
    /// # Errors
    /// Those of Newton's method; a singular matrix.
    fn adjoint(
        &mut self,
        step: &StepRecord<'_, M, T>,
        lambda: &VectorX<M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Adjoint<M, T>, Error>;
    /// The unknowns of the stages of the last step of a method of the family.
    ///
    /// # Errors
    /// [`Error::NoResult`]
    fn stages(&mut self, level: usize) -> Result<&[T], Error>;
}

/// Differentiates a step of any method; programs that do not use it do not contain it.
pub trait DynStepDifferentiator<M: Dae, T: Real>: Send + Sync {
    /// # Errors
    /// Those of Newton's method; a singular matrix.
    fn forward(&mut self, step: &StepRecord<'_, M, T>) -> Result<&Forward<M, T>, Error>;
    /// # Errors
    /// [`Error::NoResult`]
    fn rate_derivatives(
        &mut self,
        level: usize,
        weights: &[f64],
        to: &mut ArrayW<M, ArrayX<M, T>>,
    ) -> Result<(), Error>;
}

/// The integrator of a single step.
type OneStepIntegrator<M, B, T, const S: usize> = Integrator<M, B, S, T, Heap<OneStep>>;

/// The single-step integrator of the method `B` with `S` stages, created by the first call.
pub struct OneMethod<M: Dae, B, T: Real, const S: usize>(Option<Box<OneStepIntegrator<M, B, T, S>>>);

impl<M: Dae, B, T: Real, const S: usize> Default for OneMethod<M, B, T, S> {
    fn default() -> Self {
        Self(None)
    }
}

impl<M: Dae, B: Method<S>, T: Real, const S: usize> OneMethod<M, B, T, S> {
    /// Prepares the integrator at the start of a step.
    fn prepare_step(
        &mut self,
        step: &StepRecord<'_, M, T>,
    ) -> Result<&mut OneStepIntegrator<M, B, T, S>, Error> {
        let single = match &mut self.0 {
            Some(single) => single,
            none => {
                let options = Options { steps: 1, start: Start::Warm, ..Options::default() };
                none.insert(Box::new(Integrator::new(options)?))
            }
        };
        if M::Shape::NP > 0 {
            single.set_parameters(step.start.p)?;
        }
        single.set_time(step.start.t)?;
        single.run.set_stages(step.stage_unknowns)?;
        single.run.set_start_near_solution(step.stages_are_solved)?;
        Ok(single)
    }
}

impl<M: Dae, B: Method<S>, T: Real, const S: usize> StepDifferentiator<M, T> for OneMethod<M, B, T, S> {
    fn solve(
        &mut self,
        step: &StepRecord<'_, M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Nominal<M, T>, Error> {
        self.prepare_step(step)?.solve_with_quadrature(step.start.x, step.start.u, step.h, integrand)
    }

    fn forward(
        &mut self,
        step: &StepRecord<'_, M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Forward<M, T>, Error> {
        self.prepare_step(step)?.forward_refined(step.start.x, step.start.u, step.h, integrand)
    }

    fn hessian(
        &mut self,
        step: &StepRecord<'_, M, T>,
        lambda: &VectorX<M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Hessian<M, T>, Error> {
        self.prepare_step(step)?.hessian_with_quadrature(
            step.start.x,
            step.start.u,
            step.h,
            lambda,
            &[],
            integrand,
        )
    }

    fn adjoint(
        &mut self,
        step: &StepRecord<'_, M, T>,
        lambda: &VectorX<M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Adjoint<M, T>, Error> {
        self.prepare_step(step)?.adjoint_with_quadrature(
            step.start.x,
            step.start.u,
            step.h,
            lambda,
            integrand,
        )
    }

    fn slopes(&mut self, _: usize, weights: &[f64], to: &mut ArrayW<M, ArrayX<M, T>>) -> Result<(), Error> {
        self.0.as_mut().ok_or(Error::NoResult)?.slope_derivatives(weights, to)
    }

    fn stages(&mut self, _: usize) -> Result<&[T], Error> {
        self.0.as_mut().ok_or(Error::NoResult)?.stages()
    }
}

/// A family of three methods.
#[derive(Default)]
pub struct ThreeMethods<A, B, C>(A, B, C);

/// Calls the method of a level.
macro_rules! of_level {
    ($three:ident, $level:expr, $name:ident($($argument:expr),*)) => {
        match $level {
            0 => $three.0.$name($($argument),*),
            1 => $three.1.$name($($argument),*),
            _ => $three.2.$name($($argument),*),
        }
    };
}

impl<M: Dae, T: Real, A: StepDifferentiator<M, T>, B: StepDifferentiator<M, T>, C: StepDifferentiator<M, T>>
    StepDifferentiator<M, T> for ThreeMethods<A, B, C>
{
    fn solve(
        &mut self,
        step: &StepRecord<'_, M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Nominal<M, T>, Error> {
        of_level!(self, step.order_index, solve(step, integrand))
    }

    fn forward(
        &mut self,
        step: &StepRecord<'_, M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Forward<M, T>, Error> {
        of_level!(self, step.order_index, forward(step, integrand))
    }

    fn hessian(
        &mut self,
        step: &StepRecord<'_, M, T>,
        lambda: &VectorX<M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Hessian<M, T>, Error> {
        of_level!(self, step.order_index, hessian(step, lambda, integrand))
    }

    fn adjoint(
        &mut self,
        step: &StepRecord<'_, M, T>,
        lambda: &VectorX<M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Adjoint<M, T>, Error> {
        of_level!(self, step.order_index, adjoint(step, lambda, integrand))
    }

    fn slopes(
        &mut self,
        level: usize,
        weights: &[f64],
        to: &mut ArrayW<M, ArrayX<M, T>>,
    ) -> Result<(), Error> {
        of_level!(self, level, slopes(level, weights, to))
    }

    fn stages(&mut self, level: usize) -> Result<&[T], Error> {
        of_level!(self, level, stages(level))
    }
}
