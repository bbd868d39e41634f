//! The forward pass in all directions `w = (x₀, u, p)`, and its memory.

use super::matrices::DerivativeMatrices;
use super::sweep::{ForwardSweep, LinearizedStep, StepOutputs};
use crate::error::Error;
use crate::irk::coefficients::Coefficients;
use crate::irk::directions::{ArrayC, IdentityDirections, IdentityDirectionsOf};
use crate::irk::driver::CallContext;
use crate::irk::workspace::{Linearization, StageWorkspace};
use crate::memory::Fallback;
use crate::model::Dae;
use crate::result::{DenseForward, Forward, ForwardAdjoint, Nominal};
use crate::scalar::{Lanes, Real};
use crate::shape::Plain;
use bytemuck::Zeroable;

/// Memory of forward sensitivities.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct ForwardMemory<M: Dae, T: Plain, const S: usize> {
    pub(crate) result: ForwardAdjoint<M, T>,
    pub(crate) dense: DenseForward<M, T>,
    pub(crate) pass: ForwardPass<M, T, S>,
}

/// A pass over the steps that writes to a result of the caller.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct ForwardPass<M: Dae, T: Plain, const S: usize> {
    pub(crate) sweep: ForwardSweep<M, T, ArrayC<M, T>, S>,
    /// Zero if all derivatives of `z` are finite, otherwise NaN.
    finite_indicator: [T; 1],
}

impl<M: Dae, E: Lanes, const S: usize> ForwardPass<M, E, S> {
    /// Differentiates a linearised step with the factors of `stored_linearization` or of the
    /// workspace, as [`ForwardPass::step`]; returns the lanes in which the derivatives satisfy
    /// their equations.
    pub(crate) fn differentiate_step<F: Fallback>(
        &mut self,
        work: &mut StageWorkspace<M, E, S, F>,
        stored_linearization: Option<&Linearization<M, E, S, F>>,
        coefficients: &Coefficients<E, S>,
        at: StepIndex,
        stage_sensitivities: Option<&mut [E]>,
        to: &mut Forward<M, E>,
    ) -> E::Mask {
        let linearized = at.linearized(stored_linearization, coefficients);
        if at.n == 0 {
            self.sweep.set_initial_directions(linearized.directions);
        }
        let valid = self.sweep.step(work, linearized, &mut at.outputs::<M, _, F>(stage_sensitivities, to));
        self.write_algebraic_outputs::<F>(coefficients, at, to);
        valid
    }

    /// Writes the derivatives of `z` that a step determines.
    fn write_algebraic_outputs<F: Fallback>(
        &mut self,
        coefficients: &Coefficients<E, S>,
        at: StepIndex,
        to: &mut Forward<M, E>,
    ) {
        let Self { sweep, finite_indicator: [finite] } = self;
        let (plan, directions) = (F::plan::<M>(), IdentityDirections::for_model::<M, E, F>());
        if at.n == 0 {
            let to = &mut DerivativeMatrices::new(plan, &mut to.dz0_dx0, &mut to.dz0_du, &mut to.dz0_dp);
            *finite = sweep.write_algebraic((plan, directions), &coefficients.lagrange_start, to);
        }
        if at.is_last() {
            let to = &mut DerivativeMatrices::new(plan, &mut to.dz_dx0, &mut to.dz_du, &mut to.dz_dp);
            *finite = *finite + sweep.write_algebraic((plan, directions), &coefficients.lagrange_end, to);
        }
    }

    /// Writes the remaining derivatives after the last step. Returns zero if all derivatives are
    /// finite, otherwise NaN.
    pub(crate) fn finish_unchecked<F: Fallback>(&self, nominal: &Nominal<M, E>, to: &mut Forward<M, E>) -> E {
        to.nominal = *nominal;
        DerivativeMatrices::new(F::plan::<M>(), &mut to.dx_dx0, &mut to.dx_du, &mut to.dx_dp)
            .fill_inactive_columns();
        let ([of_x], [of_z]) = (self.sweep.finite_indicator, self.finite_indicator);
        of_x + of_z
    }
}

/// The index of a step and the number of steps.
#[derive(Clone, Copy)]
pub(crate) struct StepIndex {
    pub n: usize,
    pub count: usize,
    /// Whether the memory of the result may be in no cache.
    pub prefetch_output: bool,
}

impl StepIndex {
    pub(crate) fn is_last(self) -> bool {
        self.n + 1 == self.count
    }

    /// The linearised step with all directions.
    fn linearized<'a, M: Dae, E: Lanes, const S: usize, F: Fallback>(
        self,
        stored_linearization: Option<&'a Linearization<M, E, S, F>>,
        coefficients: &'a Coefficients<E, S>,
    ) -> LinearizedStep<'a, M, E, IdentityDirectionsOf<M, F>, S, F> {
        LinearizedStep {
            stored_linearization,
            coefficients,
            directions: IdentityDirections::for_model::<M, E, F>(),
            is_first: self.n == 0,
        }
    }

    /// The outputs of the step.
    fn outputs<'a, M: Dae, E: Lanes, F: Fallback>(
        self,
        stage_sensitivities: Option<&'a mut [E]>,
        to: &'a mut Forward<M, E>,
    ) -> StepOutputs<'a, E, DerivativeMatrices<'a, F::Plan<M>, E>> {
        let end = self
            .is_last()
            .then(|| DerivativeMatrices::new(F::plan::<M>(), &mut to.dx_dx0, &mut to.dx_du, &mut to.dx_dp));
        StepOutputs { stage_sensitivities, result: end, prefetch_output: self.prefetch_output }
    }
}

impl<M: Dae, T: Real, const S: usize> ForwardPass<M, T, S> {
    /// Differentiates a linearised step; with `REFINED`, refines derivatives that lost digits. The
    /// last step writes the derivatives of `x` to the result, the first and the last step those of
    /// `z`.
    ///
    /// # Errors
    /// [`Error::Singular`]
    pub(crate) fn step<F: Fallback, const REFINED: bool>(
        &mut self,
        context: &mut CallContext<'_, M, T, S, F>,
        at: StepIndex,
        mut stage_sensitivities: Option<&mut [T]>,
        to: &mut Forward<M, T>,
    ) -> Result<(), Error> {
        let CallContext { workspace: work, coefficients, statistics, .. } = context;
        let valid =
            self.differentiate_step(work, None, coefficients, at, stage_sensitivities.as_deref_mut(), to);
        if valid && !REFINED {
            return Ok(());
        }
        let linearized = at.linearized(None, coefficients);
        if !valid && work.linearization.factors.is_from_plan() {
            work.factor_dense(coefficients, at.n, 0, statistics)?;
            self.sweep.repeat_step(work, linearized, &mut at.outputs::<M, _, F>(stage_sensitivities, to));
        }
        if const { REFINED } {
            self.sweep.refine(work, linearized, &mut at.outputs::<M, _, F>(None, to));
        }
        self.write_algebraic_outputs::<F>(coefficients, at, to);
        Ok(())
    }

    /// Writes the remaining derivatives after the last step.
    ///
    /// # Errors
    /// [`Error::Overflow`]
    pub(crate) fn finish<F: Fallback>(
        &self,
        nominal: &Nominal<M, T>,
        step: usize,
        to: &mut Forward<M, T>,
    ) -> Result<(), Error> {
        // The non-finite value is searched for only if there is one.
        if self.finish_unchecked::<F>(nominal, to).is_finite() {
            Ok(())
        } else {
            crate::finite::check_forward(to, step)
        }
    }
}

impl<M: Dae, T: Real, const S: usize> ForwardMemory<M, T, S> {
    /// Computes derivatives at a point of the last step.
    pub(crate) fn interpolate<F: Fallback>(&mut self, weights: &[T; S], lagrange: &[T; S]) {
        let Self { dense, pass: ForwardPass { sweep, .. }, .. } = self;
        let (plan, directions) = (F::plan::<M>(), IdentityDirections::for_model::<M, T, F>());
        let to = &mut DerivativeMatrices::new(plan, &mut dense.dx_dx0, &mut dense.dx_du, &mut dense.dx_dp);
        to.fill_inactive_columns();
        sweep.write_differential((plan, directions), weights, to);
        let to = &mut DerivativeMatrices::new(plan, &mut dense.dz_dx0, &mut dense.dz_du, &mut dense.dz_dp);
        sweep.write_algebraic((plan, directions), lagrange, to);
    }
}
