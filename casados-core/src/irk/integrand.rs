//! Evaluates an integrand at the stages of the steps, and adds its source terms to the adjoint; see
//! [`quadrature`](crate::quadrature).
//!
//! With `g_i = h b_i ∇_v φ_i`:
//!
//! ```text
//! Jᵀ μ = h (b ⊗ λ_{n+1}, 0) + (h Σ_i a_ij g_x,i, g_z,j)        λ_n += Σ_i g_x,i        λ_w += Σ_i g_w,i
//! ```

use super::adjoint::AdjointSweep;
use super::directions::ArrayC;
use super::driver::CallContext;
use super::forward::sweep::ForwardSweep;
use super::integrator::Integrator;
use super::workspace::{StageWorkspace, Step};
use crate::error::{Error, Place};
use crate::integrator::With;
use crate::irk::coefficients::Coefficients;
use crate::memory::{Fallback, Memory, WithHessian};
use crate::model::{Dae, VectorU, VectorX, VectorZ};
use crate::quadrature::Integrand;
use crate::result::Hessian;
use crate::scalar::Real;
use crate::shape::{InBounds, Matrix, Shape};

impl<M: Dae, T: Real, const S: usize, F: Fallback> StageWorkspace<M, T, S, F> {
    /// Copies the variables at a stage from `points` to the input of the integrand.
    fn load_stage<'a>(
        &self,
        stage: usize,
        integrand: &'a mut dyn Integrand<M, T>,
    ) -> &'a mut dyn Integrand<M, T> {
        for (to, from) in integrand.stage_variables_mut().0.iter_mut().zip(self.points.as_ref()) {
            if let Some(from) = from.get(stage).in_bounds() {
                *to = *from;
            }
        }
        integrand
    }

    /// Adds the contribution of the stages of a step to the value.
    ///
    /// # Errors
    /// [`Error::NonFiniteFunction`]
    pub(crate) fn add_integrand_value(
        &mut self,
        coefficients: &Coefficients<T, S>,
        n: usize,
        step: &Step<M, T, S>,
        integrand: &mut dyn Integrand<M, T>,
    ) -> Result<(), Error> {
        self.place_stages(coefficients, n, &step.x, &step.y);
        for (stage, b) in coefficients.b.iter().enumerate() {
            let at = Place { step: n, stage, iteration: 0 };
            self.load_stage(stage, integrand).add_value(self.inputs.time.step * *b, at)?;
        }
        Ok(())
    }

    /// Adds the contribution of the stages to the source terms of the adjoint.
    ///
    /// # Errors
    /// [`Error::NonFiniteFunction`]
    pub(crate) fn add_integrand_adjoint<const C: usize>(
        &mut self,
        coefficients: &Coefficients<T, S>,
        n: usize,
        step: &Step<M, T, S>,
        backward: &mut AdjointSweep<M, T, S, C>,
        integrand: &mut dyn Integrand<M, T>,
    ) -> Result<(), Error> {
        let (nx, nz, h) = (M::Shape::NX, M::Shape::NZ, self.inputs.time.step);
        let (stage_source, shift) = (backward.stage_source.as_mut(), backward.end_source.as_mut());
        stage_source.fill([T::ZERO; S]);
        shift.fill(T::ZERO);
        backward.has_source = true;
        self.place_stages(coefficients, n, &step.x, &step.y);
        for (stage, (b, a)) in coefficients.b.iter().zip(&coefficients.a).enumerate() {
            let at = Place { step: n, stage, iteration: 0 };
            let gradient = self.load_stage(stage, integrand).weighted_gradient(h * *b, at)?;
            let states = gradient.get(nx..2 * nx).in_bounds().unwrap_or_default();
            for (source, g) in stage_source.iter_mut().zip(states) {
                for (source, a) in source.iter_mut().zip(a) {
                    *source = *source + h * *a * *g;
                }
            }
            let (algebraic, inputs) = gradient.split_at_checked(2 * nx + nz).unwrap_or_default();
            for (source, g) in stage_source.iter_mut().skip(nx).zip(algebraic.iter().skip(2 * nx)) {
                source[stage] = *g;
            }
            for (shift, g) in shift.iter_mut().zip(states.iter().chain(inputs)) {
                *shift = *shift + *g;
            }
        }
        Ok(())
    }
}

impl<M: Dae, T: Real, const S: usize, F: Fallback> CallContext<'_, M, T, S, F> {
    /// Adds the contribution of the stages of a step to the value and its derivatives, which follow
    /// from the stage derivatives.
    ///
    /// # Errors
    /// [`Error::NonFiniteFunction`]
    pub(crate) fn add_integrand_forward(
        &mut self,
        n: usize,
        step: &Step<M, T, S>,
        sweep: &ForwardSweep<M, T, ArrayC<M, T>, S>,
        with_hessian: bool,
        integrand: &mut dyn Integrand<M, T>,
    ) -> Result<(), Error> {
        let Self { workspace: work, coefficients, .. } = self;
        let h = work.inputs.time.step;
        work.place_stages(coefficients, n, &step.x, &step.y);
        for (stage, b) in coefficients.b.iter().enumerate() {
            let integrand = work.load_stage(stage, integrand);
            let variables = integrand.variables();
            let (_, d) = integrand.stage_variables_mut();
            sweep.write_stage_rows::<F>(coefficients, h, stage, variables, d);
            integrand.add_forward(h * *b, with_hessian, Place { step: n, stage, iteration: 0 })?;
        }
        Ok(())
    }
}

impl<M: Dae, B, const S: usize, T: Real, W: Memory> Integrator<M, B, S, T, W> {
    /// Adds a quadrature: computes the value and the derivatives of `∫ l(x, z, u, p, t) dt`
    /// together with the solution; see [`quadrature`](crate::quadrature).
    pub fn with<'a, 'b, Q: Integrand<M, T> + ?Sized>(
        &'a mut self,
        integrand: &'b mut Q,
    ) -> With<'a, 'b, Self, Q> {
        With { integrator: self, integrand }
    }
}

impl<'a, M: Dae, B, const S: usize, T: Real, W: WithHessian, Q: Integrand<M, T>>
    With<'a, '_, Integrator<M, B, S, T, W>, Q>
{
    /// See [`Integrator::hessian_with_z0`]; gradient and Hessian are those of `λᵀx + νᵀz₀` and the
    /// integral.
    ///
    /// # Errors
    /// See [`Integrator`]; [`Error::NonFiniteFunction`].
    pub fn hessian_with_z0(
        self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        nu: &VectorZ<M, T>,
    ) -> Result<&'a Hessian<M, T>, Error> {
        self.integrator.hessian_with_quadrature(x0, u, h, lambda, nu.as_slice(), Some(self.integrand))
    }
}
