//! Adjoint sensitivities, computed backwards over the steps.
//!
//! ```text
//! Jᵀ μ = h (b ⊗ λ_{n+1}, 0)        λ_n = λ_{n+1} − Σ_i f_x,iᵀ μ_i        λ_w −= Σ_i f_w,iᵀ μ_i
//! ```
//!
//! For the gradient of `λᵀx_N + νᵀz₀`, with `z₀ = Σ_i ℓ_i(0) z_i` of the first step, the right-hand
//! side of `z_i` in the first step is `ℓ_i(0) ν`.

use super::driver::CallContext;
use super::workspace::{Linearization, StageWorkspace, Step};
use crate::error::Error;
use crate::finite::check_gradient;
use crate::irk::coefficients::Coefficients;
use crate::linalg::{Arithmetic, Kernel, RowVisitor, dispatch, for_each_row, kernels};
use crate::memory::{Fallback, Family};
use crate::model::{ArrayK, ArrayW, ArrayX, Dae, VectorZ};
use crate::plan::{Plan, PlanOf, StructureTable};
use crate::quadrature::OptionalIntegrand;
use crate::result::Adjoint;
use crate::scalar::{Lanes, Real};
use crate::shape::{Aligned, InBounds, Matrix, Plain, Shape};
use bytemuck::Zeroable;
use core::marker::PhantomData;

/// The state of the backward sweep for `C` seeds.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct AdjointSweep<M: Dae, T: Plain, const S: usize, const C: usize> {
    /// `λ_n`
    pub(crate) lambda: ArrayX<M, [T; C]>,
    /// `λ_w`; the first `NX` rows stay zero.
    pub(crate) gradient: ArrayW<M, [T; C]>,
    /// `μ`, one row per slot and stage.
    pub(crate) mu: Aligned<ArrayK<M, [[T; C]; S]>>,
    /// Source terms of the stage unknowns, from an integrand or from `ν`: added to the right-hand
    /// side.
    pub(crate) stage_source: ArrayK<M, [T; S]>,
    /// Source terms of `(λ_n, λ_w)`.
    pub(crate) end_source: ArrayW<M, T>,
    /// Whether there are source terms.
    pub(crate) has_source: bool,
    /// The weights `ν` of `z₀`; valid if `has_nu`.
    nu: VectorZ<M, T>,
    has_nu: bool,
}

impl<M: Dae, E: Lanes, const S: usize, const C: usize> AdjointSweep<M, E, S, C> {
    /// Sets `λ_N` to the seeds, in column-major order, and `ν` to the weights of `z₀`; `nu` may be
    /// empty.
    pub(crate) fn set_seeds(&mut self, seeds: &[E], nu: &[E]) {
        let nx = M::Shape::NX;
        for (state, row) in self.lambda.as_mut().iter_mut().enumerate() {
            let seed = |column| seeds.get(column * nx + state).copied();
            *row = core::array::from_fn(|column| seed(column).unwrap_or(E::from_f64(0.0)));
        }
        self.gradient.as_mut().fill([E::from_f64(0.0); C]);
        self.has_source = false;
        self.has_nu = !nu.is_empty();
        for (to, &from) in self.nu.as_mut_slice().iter_mut().zip(nu) {
            *to = from;
        }
    }

    /// Adds the source term `ℓ_i(0) ν` of the first step, after those of an integrand.
    pub(crate) fn add_z0_weights(&mut self, coefficients: &Coefficients<E, S>) {
        if const { M::Shape::NZ == 0 } || !self.has_nu {
            return;
        }
        if !self.has_source {
            self.stage_source.as_mut().fill([E::from_f64(0.0); S]);
            self.end_source.as_mut().fill(E::from_f64(0.0));
            self.has_source = true;
        }
        let source = self.stage_source.as_mut().get_mut(M::Shape::NX..).in_bounds().unwrap_or_default();
        weigh(self.nu.as_slice(), &coefficients.lagrange_start, source);
    }

    /// Solves for `μ` of a linearised step, with the factors of `stored_linearization` or of the
    /// workspace; returns the lanes in which `μ` satisfies its equations.
    pub(crate) fn solve_and_verify<F: Fallback>(
        &mut self,
        work: &mut StageWorkspace<M, E, S, F>,
        stored_linearization: Option<&Linearization<M, E, S, F>>,
        coefficients: &Coefficients<E, S>,
    ) -> E::Mask {
        self.solve_multipliers(work.linearization(stored_linearization), coefficients, work.inputs.time.step);
        work.verify_adjoint(stored_linearization, self, coefficients)
    }

    /// Solves `Jᵀ μ = h (b ⊗ λ_{n+1}, 0)` plus source terms.
    pub(crate) fn solve_multipliers<F: Fallback>(
        &mut self,
        linear: &Linearization<M, E, S, F>,
        coefficients: &Coefficients<E, S>,
        h: E,
    ) {
        let Self { lambda, mu, stage_source: source, has_source: sourced, .. } = self;
        right_hand_side(lambda.as_ref(), &coefficients.b, h, mu.as_mut());
        if *sourced {
            add_to_all(mu.as_mut().as_flattened_mut(), source.as_ref().as_flattened());
        }
        linear.solve_transposed((coefficients, h), mu);
    }

    /// Updates `λ_{n+1}` to `λ_n`, and `λ_w`, from `μ`.
    pub(crate) fn advance<F: Fallback>(&mut self, linear: &Linearization<M, E, S, F>) {
        let Self { lambda, gradient, mu, end_source: shift, has_source: sourced, .. } = self;
        let (plan, mu) = (F::plan::<M>(), mu.as_ref());
        let jacobian = F::Plan::<M>::jacobian(&linear.jacobian);
        let (lambda, gradient) = (lambda.as_mut(), gradient.as_mut());
        dispatch(Advance { plan, jacobian, mu, lambda: &mut *lambda, gradient: &mut *gradient });
        if *sourced {
            let (states, inputs) = shift.as_ref().split_at_checked(M::Shape::NX).unwrap_or_default();
            add_to_all(lambda, states);
            add_to_all(gradient.get_mut(M::Shape::NX..).in_bounds().unwrap_or_default(), inputs);
        }
    }
}

impl<M: Dae, T: Real, const S: usize, const C: usize> AdjointSweep<M, T, S, C> {
    /// Computes `λ_n` from `λ_{n+1}` over a linearised step, with an optional integrand. If the
    /// stored factors are too inaccurate, copies the stored linearisation to the workspace,
    /// factorises the whole matrix with pivoting, and sets `stored_linearization` to `None`.
    ///
    /// # Errors
    /// [`Error::Singular`]; an integrand that is not finite.
    pub(crate) fn step_backwards<F: Fallback>(
        &mut self,
        context: &mut CallContext<'_, M, T, S, F>,
        stored_linearization: &mut Option<&Linearization<M, T, S, F>>,
        n: usize,
        step: &Step<M, T, S>,
        integrand: &mut OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<(), Error> {
        let CallContext { workspace: work, coefficients, statistics, .. } = context;
        if let Some(integrand) = integrand {
            work.add_integrand_adjoint(coefficients, n, step, self, &mut **integrand)?;
        }
        if n == 0 {
            self.add_z0_weights(coefficients);
        }
        if !self.solve_and_verify(work, *stored_linearization, coefficients)
            && work.linearization(*stored_linearization).factors.is_from_plan()
        {
            if let Some(kept) = stored_linearization.take() {
                work.linearization.copy_from(kept);
            }
            work.factor_dense(coefficients, n, 0, statistics)?;
            self.solve_and_verify(work, None, coefficients);
        }
        self.advance(work.linearization(*stored_linearization));
        Ok(())
    }
}

kernels! {
    /// `μ = h (b ⊗ λ, 0)`
    fn right_hand_side [E: Lanes, const S: usize, const C: usize] [E, S, C] <A>(
        lambda: &'k [[E; C]],
        b: &'k [E; S],
        h: E,
        mu: &'k mut [[[E; C]; S]],
    ) {
        mu.fill([[E::from_f64(0.0); C]; S]);
        for (mu, lambda) in mu.iter_mut().zip(lambda) {
            for (mu, &b) in mu.iter_mut().zip(b) {
                for (mu, &lambda) in mu.iter_mut().zip(lambda) {
                    *mu = h * b * lambda;
                }
            }
        }
    }

    /// Adds the same source term to all seeds.
    fn add_to_all [E: Lanes, const C: usize] [E, C] <A>(to: &'k mut [[E; C]], from: &'k [E]) {
        for (to, &from) in to.iter_mut().zip(from) {
            for to in to {
                *to = *to + from;
            }
        }
    }

    /// `source_i += ℓ_i(0) ν` at every stage.
    fn weigh [E: Lanes, const S: usize] [E, S] <A>(
        nu: &'k [E],
        start: &'k [E; S],
        source: &'k mut [[E; S]],
    ) {
        for (source, &nu) in source.iter_mut().zip(nu) {
            for (source, &start) in source.iter_mut().zip(start) {
                *source = *source + start * nu;
            }
        }
    }
}

/// `λ_n = λ_{n+1} − Σ_i f_x,iᵀ μ_i`, `λ_w −= Σ_i f_w,iᵀ μ_i`
struct Advance<'a, M: Plan, E: Plain, const S: usize, const C: usize> {
    plan: M,
    jacobian: &'a M::Jacobian<[E; S]>,
    mu: &'a [[[E; C]; S]],
    lambda: &'a mut [[E; C]],
    gradient: &'a mut [[E; C]],
}

impl<M: Plan, E: Lanes, const S: usize, const C: usize> Kernel for Advance<'_, M, E, S, C> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(mut self) {
        // Equal lengths, so that the optimiser removes bounds checks.
        let (nx, nk, nw) = (self.plan.nx(), self.plan.nk(), self.plan.nw());
        if self.mu.len() == nk && self.lambda.len() == nx && self.gradient.len() == nw {
            for_each_row::<A, _>(&mut self);
        }
    }
}

impl<M: Plan, E: Lanes, const S: usize, const C: usize> RowVisitor for Advance<'_, M, E, S, C> {
    /// The entries of `f_x`, `f_z`, `f_u` and `f_p`.
    const ROWS: Option<usize> = StructureTable::Entries(1, 5).known_row_count::<M>();
    #[inline(always)]
    fn row_count(&self) -> usize {
        StructureTable::Entries(1, 5).row_count(self.plan.structure())
    }
    const INSTRUCTIONS: usize = 2 + 2 * C * S;
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, row: usize) {
        let (plan, nx, nz) = (self.plan, self.plan.nx(), self.plan.nz());
        let first = plan.structure().blocks[1];
        let Some((r, c, values)) = plan.entry(self.jacobian.as_ref(), first + row) else { return };
        let to = if c < 2 * nx {
            self.lambda.get_mut(c - nx)
        } else if c < 2 * nx + nz {
            return;
        } else {
            self.gradient.get_mut(c - nx - nz)
        };
        if let (Some(to), Some(mu)) = (to, self.mu.get(plan.slot(r)).in_bounds()) {
            subtract_stage_products::<A, E, S, C>(to, values, mu);
        }
    }
}

/// `to −= Σ_i value_i μ_i`
#[inline(always)]
fn subtract_stage_products<A: Arithmetic, E: Lanes, const S: usize, const C: usize>(
    to: &mut [E; C],
    values: &[E; S],
    mu: &[[E; C]; S],
) {
    let mut sum = *to;
    for (&value, mu) in values.iter().zip(mu) {
        for (sum, &mu) in sum.iter_mut().zip(mu) {
            *sum = A::subtract(*sum, value, mu);
        }
    }
    *to = sum;
}

/// Memory of the adjoint of `C` seeds.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct AdjointMemory<M: Dae, T: Plain, const S: usize, const C: usize> {
    pub(crate) result: Adjoint<M, T, C>,
    pub(crate) backward: AdjointSweep<M, T, S, C>,
}

/// The memory of adjoints of any number of seeds.
pub struct Adjoints<M, T, const S: usize>(PhantomData<fn() -> (M, T)>);
impl<M: Dae, T: Real, const S: usize> Family for Adjoints<M, T, S> {
    type Of<const C: usize> = AdjointMemory<M, T, S, C>;
}

impl<M: Dae, E: Lanes, const S: usize, const C: usize> AdjointMemory<M, E, S, C> {
    /// Writes the result, after the sweep has reached the first step.
    pub(crate) fn write_result<F: Fallback>(&mut self, work: &StageWorkspace<M, E, S, F>) {
        let Self { result, backward } = self;
        result.nominal = work.result;
        let nx = M::Shape::NX;
        let nu = M::Shape::NU;
        for column in 0..C {
            for (state, row) in backward.lambda.as_ref().iter().enumerate() {
                result.grad_x0[(state, column)] = row[column];
            }
            for (w, row) in backward.gradient.as_ref().iter().enumerate().skip(nx) {
                if w < nx + nu {
                    result.grad_u[(w - nx, column)] = row[column];
                } else {
                    result.grad_p[(w - nx - nu, column)] = row[column];
                }
            }
        }
    }
}

impl<M: Dae, T: Real, const S: usize, const C: usize> AdjointMemory<M, T, S, C> {
    /// # Errors
    /// [`Error::Overflow`]
    pub(crate) fn finish<F: Fallback>(&mut self, work: &StageWorkspace<M, T, S, F>) -> Result<(), Error> {
        self.write_result(work);
        let result = &self.result;
        check_gradient(result.grad_x0.as_slice(), result.grad_u.as_slice(), result.grad_p.as_slice())
    }
}
