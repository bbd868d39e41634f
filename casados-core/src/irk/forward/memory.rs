//! The forward pass in all directions `w = (x₀, u, p)` side by side, and its memory.

use super::matrices::Split;
use super::sweep::{Linearized, Outputs, Sweep};
use crate::error::Error;
use crate::irk::coefficients::Coefficients;
use crate::irk::directions::{ArrayC, Identity, IdentityOf};
use crate::irk::driver::Parts;
use crate::irk::workspace::{Linearization, Work};
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

/// A pass over the steps, which writes to results elsewhere.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct ForwardPass<M: Dae, T: Plain, const S: usize> {
    pub(crate) sweep: Sweep<M, T, ArrayC<M, T>, S>,
    /// Zero if all derivatives of `z` are finite, else NaN.
    finite: [T; 1],
}

impl<M: Dae, E: Lanes, const S: usize> ForwardPass<M, E, S> {
    /// A step that is linearised, by the factors that were `kept` or are there, as
    /// [`ForwardPass::step`]; whether the derivatives satisfy their equations.
    pub(crate) fn advance<F: Fallback>(
        &mut self,
        work: &mut Work<M, E, S, F>,
        kept: Option<&Linearization<M, E, S, F>>,
        coefficients: &Coefficients<E, S>,
        at: StepOf,
        curved: Option<&mut [E]>,
        to: &mut Forward<M, E>,
    ) -> E::Mask {
        let of = at.linearized(kept, coefficients);
        if at.n == 0 {
            self.sweep.start(of.directions);
        }
        let good = self.sweep.step(work, of, &mut at.outputs::<M, _, F>(curved, to));
        self.collect::<F>(coefficients, at, to);
        good
    }

    /// What a step contributes to derivatives of `z`.
    fn collect<F: Fallback>(
        &mut self,
        coefficients: &Coefficients<E, S>,
        at: StepOf,
        to: &mut Forward<M, E>,
    ) {
        let Self { sweep, finite: [finite] } = self;
        let (plan, all) = (F::plan::<M>(), Identity::of::<M, E, F>());
        if at.n == 0 {
            let to = &mut Split::new(plan, &mut to.dz0_dx0, &mut to.dz0_du, &mut to.dz0_dp);
            *finite = sweep.write_algebraic((plan, all), &coefficients.start, to);
        }
        if at.is_last() {
            let to = &mut Split::new(plan, &mut to.dz_dx0, &mut to.dz_du, &mut to.dz_dp);
            *finite = *finite + sweep.write_algebraic((plan, all), &coefficients.end, to);
        }
    }

    /// What is left to be written after the last step. Zero if all derivatives are finite, else
    /// NaN.
    pub(crate) fn end<F: Fallback>(&self, nominal: &Nominal<M, E>, to: &mut Forward<M, E>) -> E {
        to.nominal = *nominal;
        Split::new(F::plan::<M>(), &mut to.dx_dx0, &mut to.dx_du, &mut to.dx_dp).fill_others();
        let ([of_x], [of_z]) = (self.sweep.finite, self.finite);
        of_x + of_z
    }
}

/// Which step of how many.
#[derive(Clone, Copy)]
pub(crate) struct StepOf {
    pub n: usize,
    pub count: usize,
    /// Whether the result may be in no cache.
    pub distant: bool,
}

impl StepOf {
    pub(crate) fn is_last(self) -> bool {
        self.n + 1 == self.count
    }

    /// The step, which goes through in all directions.
    fn linearized<'a, M: Dae, E: Lanes, const S: usize, F: Fallback>(
        self,
        kept: Option<&'a Linearization<M, E, S, F>>,
        coefficients: &'a Coefficients<E, S>,
    ) -> Linearized<'a, M, E, IdentityOf<M, F>, S, F> {
        Linearized { kept, coefficients, directions: Identity::of::<M, E, F>(), first: self.n == 0 }
    }

    /// What the step writes.
    fn outputs<'a, M: Dae, E: Lanes, F: Fallback>(
        self,
        curved: Option<&'a mut [E]>,
        to: &'a mut Forward<M, E>,
    ) -> Outputs<'a, E, Split<'a, F::Plan<M>, E>> {
        let end =
            self.is_last().then(|| Split::new(F::plan::<M>(), &mut to.dx_dx0, &mut to.dx_du, &mut to.dx_dp));
        Outputs { curved, end, distant: self.distant }
    }
}

impl<M: Dae, T: Real, const S: usize> ForwardPass<M, T, S> {
    /// After a step that is linearised; refined where digits were lost, if that is asked for. The
    /// last one writes derivatives of `x` to the result, the first and the last those of `z`.
    ///
    /// # Errors
    /// [`Error::Singular`]
    pub(crate) fn step<F: Fallback, const REFINED: bool>(
        &mut self,
        parts: &mut Parts<'_, M, T, S, F>,
        at: StepOf,
        mut curved: Option<&mut [T]>,
        to: &mut Forward<M, T>,
    ) -> Result<(), Error> {
        let Parts { work, coefficients, statistics, .. } = parts;
        let good = self.advance(work, None, coefficients, at, curved.as_deref_mut(), to);
        if good && !REFINED {
            return Ok(());
        }
        let of = at.linearized(None, coefficients);
        if !good && work.linear.factors.is_planned() {
            work.factor_dense(coefficients, at.n, 0, statistics)?;
            self.sweep.repeat(work, of, &mut at.outputs::<M, _, F>(curved, to));
        }
        if const { REFINED } {
            self.sweep.refine(work, of, &mut at.outputs::<M, _, F>(None, to));
        }
        self.collect::<F>(coefficients, at, to);
        Ok(())
    }

    /// What is left to be written after the last step.
    ///
    /// # Errors
    /// [`Error::Overflow`]
    pub(crate) fn finish<F: Fallback>(
        &self,
        nominal: &Nominal<M, T>,
        step: usize,
        to: &mut Forward<M, T>,
    ) -> Result<(), Error> {
        // Only where one is not finite it is looked for.
        if self.end::<F>(nominal, to).is_finite() { Ok(()) } else { crate::finite::check_forward(to, step) }
    }
}

impl<M: Dae, T: Real, const S: usize> ForwardMemory<M, T, S> {
    /// Derivatives at a point of the last step.
    pub(crate) fn interpolate<F: Fallback>(&mut self, weights: &[T; S], lagrange: &[T; S]) {
        let Self { dense, pass: ForwardPass { sweep, .. }, .. } = self;
        let (plan, all) = (F::plan::<M>(), Identity::of::<M, T, F>());
        let to = &mut Split::new(plan, &mut dense.dx_dx0, &mut dense.dx_du, &mut dense.dx_dp);
        to.fill_others();
        sweep.write_differential((plan, all), weights, to);
        let to = &mut Split::new(plan, &mut dense.dz_dx0, &mut dense.dz_du, &mut dense.dz_dp);
        sweep.write_algebraic((plan, all), lagrange, to);
    }
}
