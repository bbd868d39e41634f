//! Second-order sensitivities: symmetric, in the backward sweep of the adjoint.
//!
//! ```text
//! d²(λᵀ x_N)/dw² = − Σ_n Σ_i D_iᵀ [∇²(μ_iᵀ f)_i] D_i
//! ```
//!
//! with `D_i = d(k_i, ξ_i, z_i, u, p)/dw` from the forward sweep; `products` computes the products.
//! Weights `ν` of `z₀`, a sum of unknowns, enter `μ` only; the result is then
//! `d²(λᵀ x_N + νᵀ z₀)/dw²`.

use super::diagonal::DiagonalUpdate;
use super::matrix_adjoint::{MatrixAdjoint, is_cheaper};
use super::output::HessianTriangle;
use super::products::{CongruenceKernel, G_COLUMNS, StridedMatrix};
use crate::error::{Error, Place, Quantity};
use crate::finite::{check_gradient, check_second_derivatives, find_non_finite};
use crate::irk::adjoint::AdjointSweep;
use crate::irk::coefficients::Coefficients;
use crate::irk::directions::{ArrayC, total_columns};
use crate::irk::driver::CallContext;
use crate::irk::stage_array::StageArray;
use crate::irk::workspace::{Linearization, StageWorkspace, Step};
use crate::linalg::{dispatch, slot};
use crate::memory::{Fallback, fallback::Pivoting};
use crate::model::{ArrayK, ArrayV, ArrayW, Dae};
use crate::quadrature::OptionalIntegrand;
use crate::result::{ForwardAdjoint, Hessian};
use crate::scalar::{Lanes, Real, SideBySide, Strided};
use crate::shape::{Aligned, Array, InBounds, Matrix, Plain, Shape};
use bytemuck::Zeroable;

/// Memory of second-order sensitivities.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct HessianMemory<M: Dae, T: Plain, const S: usize> {
    pub(crate) result: Hessian<M, T>,
    pub(crate) pass: HessianPass<M, T, S>,
}

/// A backward pass over the steps that writes to a result of the caller.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct HessianPass<M: Dae, T: Plain, const S: usize> {
    pub(crate) backward: AdjointSweep<M, T, S, 1>,
    /// `−H D` of `G_COLUMNS` columns at all stages.
    g: Aligned<ArrayV<M, [[T; G_COLUMNS]; S]>>,
    /// The lower triangle of the Hessian over the directions with influence.
    sum: ArrayW<M, ArrayC<M, T>>,
    /// `μ` at all stages, in the order of the equations.
    mu: Aligned<StageArray<ArrayK<M, [T; S]>, T, S>>,
    /// Entries of `∇²(μᵀ f)` at all stages.
    entries: Aligned<StageArray<M::Hessian<[T; S]>, T, S>>,
}

/// The tape entry of a step for the backward pass.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct HessianStep<M: Dae, T: Plain, const S: usize, F: Fallback = Pivoting> {
    linear: Linearization<M, T, S, F>,
    /// The rows of `D` of nonlinear variables at all stages, in panels.
    d: Aligned<ArrayV<M, [ArrayC<M, T>; S]>>,
}

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> HessianStep<M, E, S, F> {
    /// Whether the factors of every step are computed in its tape entry: each step has different
    /// factors, and Newton's method does not leave those at the solution.
    #[cfg(feature = "alloc")]
    pub(crate) const FACTORS_ON_TAPE: bool = {
        let structure = &M::STRUCTURE;
        !(structure.linear_in_state || structure.constant_matrix || !structure.elimination.has_plan())
    };

    /// The memory that the forward pass writes `D` to.
    pub(crate) fn stage_sensitivities_mut(&mut self) -> &mut [E] {
        self.linearization_and_rows().1
    }

    /// The linearisation, and the memory that the forward pass writes `D` to.
    pub(crate) fn linearization_and_rows(&mut self) -> (&mut Linearization<M, E, S, F>, &mut [E]) {
        (&mut self.linear, Array::flat_mut(self.d.as_mut().as_flattened_mut()))
    }

    /// Stores the linearisation during the forward pass.
    pub(crate) fn store_linearization(&mut self, work: &StageWorkspace<M, E, S, F>) {
        self.linear.copy_from(&work.linearization);
    }

    /// The stored linearisation; `None` for the last step, whose linearisation is still in the
    /// workspace.
    pub(crate) fn stored_linearization(&self, is_last: bool) -> Option<&Linearization<M, E, S, F>> {
        (!is_last).then_some(&self.linear)
    }
}

impl<M: Dae, T: Real, const S: usize> HessianPass<M, T, S> {
    /// Runs the backward pass with `λ` and `ν`; the linearisation of the last step is in the
    /// workspace.
    ///
    /// # Errors
    /// A second derivative of the model that is not finite, a singular matrix.
    pub(crate) fn run_backwards<F: Fallback>(
        &mut self,
        mut context: CallContext<'_, M, T, S, F>,
        stored_linearization: &[HessianStep<M, T, S, F>],
        [lambda, nu]: [&[T]; 2],
        prefetch: &[T],
        mut integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<(), Error> {
        self.set_seeds(lambda, nu);
        let steps = context.steps;
        for (n, (step, tape_entry)) in steps.iter().zip(stored_linearization).enumerate().rev() {
            let kept = &mut tape_entry.stored_linearization(n + 1 == steps.len());
            self.backward.step_backwards(&mut context, kept, n, step, &mut integrand)?;
            let CallContext { workspace: work, coefficients, .. } = &mut context;
            self.evaluate_hessian_entries(work, coefficients, n, step);
            if let Some((entry, value)) = find_non_finite(self.entries.as_ref().as_flattened()) {
                return Err(Error::NonFiniteModel {
                    quantity: Quantity::Hessian,
                    equation: M::STRUCTURE.hessian.get(entry / S).map_or(0, |(row, _)| row),
                    value,
                    at: Place { step: n, stage: entry % S, iteration: 0 },
                });
            }
            self.subtract_congruence(work, *kept, coefficients, tape_entry, [n, steps.len()], prefetch);
        }
        Ok(())
    }
}

impl<M: Dae, E: Lanes, const S: usize> HessianPass<M, E, S> {
    /// Sets `λ` and `ν` before the last step; `nu` may be empty.
    pub(crate) fn set_seeds(&mut self, lambda: &[E], nu: &[E]) {
        self.backward.set_seeds(lambda, nu);
    }

    /// Evaluates `∇²(μ_iᵀ f)` at all stages of a step.
    pub(crate) fn evaluate_hessian_entries<F: Fallback>(
        &mut self,
        work: &mut StageWorkspace<M, E, S, F>,
        coefficients: &Coefficients<E, S>,
        n: usize,
        step: &Step<M, E, S>,
    ) {
        let Self { backward, mu, entries, .. } = self;
        for (equation, to) in mu.as_mut().iter_mut().enumerate() {
            if let Some(mu) = backward.mu.as_ref().get(slot::<M>(equation)).in_bounds() {
                *to = mu.map(|[mu]| mu);
            }
        }
        work.place_stages(coefficients, n, &step.x, &step.y);
        if let Err(call) = E::side_by_side(HessianEntries::<M, E, S> { points: &work.points, mu, entries }) {
            let HessianEntries { points, mu, entries } = call;
            for i in 0..S {
                M::hessian::<Strided<E, S>>(
                    points.stage_view(i),
                    mu.stage_view(i),
                    entries.stage_view_mut(i),
                );
            }
        }
    }

    /// `sum −= Σ_i D_iᵀ H_i D_i`, from zero at the last step. The linearisation is
    /// `stored_linearization` or that of the workspace; `prefetch` is the memory of the result,
    /// which is written after the first step.
    pub(crate) fn subtract_congruence<F: Fallback>(
        &mut self,
        work: &mut StageWorkspace<M, E, S, F>,
        stored_linearization: Option<&Linearization<M, E, S, F>>,
        coefficients: &Coefficients<E, S>,
        record: &HessianStep<M, E, S, F>,
        [n, count]: [usize; 2],
        prefetch: &[E],
    ) {
        let last = n + 1 == count;
        let Self { g, sum, entries, .. } = self;
        let (entries, d) = (entries.as_ref(), Array::flat(record.d.as_ref().as_flattened()));
        let (plan, columns, stride) =
            (F::plan::<M>(), const { total_columns::<M, E, F>() }, ArrayC::<M, E>::LEN);
        let elements = ArrayC::<M, E>::flat_mut(sum.as_mut());
        if const { is_cheaper::<M, E, S>() } {
            MatrixAdjoint::<M, E, S> {
                coefficients,
                entries,
                d,
                g,
                sum: StridedMatrix { elements: &mut *elements, stride },
                is_first: n == 0,
                is_last: last,
                prefetch: if n == 0 { prefetch } else { &[] },
            }
            .run(work, stored_linearization);
        } else {
            let g = g.as_mut();
            dispatch(CongruenceKernel {
                plan,
                columns,
                entries,
                d,
                g,
                sum: StridedMatrix { elements: &mut *elements, stride },
                from_zero: last,
            });
        }
        if const { !M::STRUCTURE.diagonal_controls.is_empty() } {
            dispatch(DiagonalUpdate { plan, entries, sum: StridedMatrix { elements, stride } });
        }
    }
}

/// `∇²(μᵀ f)` at all stages in one call.
struct HessianEntries<'a, M: Dae, E: Lanes, const S: usize> {
    points: &'a StageArray<ArrayV<M, [E; S]>, E, S>,
    mu: &'a StageArray<ArrayK<M, [E; S]>, E, S>,
    entries: &'a mut StageArray<M::Hessian<[E; S]>, E, S>,
}

impl<M: Dae, E: Lanes, const S: usize> SideBySide<E, S> for HessianEntries<'_, M, E, S> {
    #[inline(always)]
    fn call<R: Lanes<Cell = [E; S]>>(self) {
        M::hessian::<R>(self.points, self.mu, self.entries);
    }
}

impl<M: Dae, E: Lanes, const S: usize> HessianPass<M, E, S> {
    /// Writes the result after the first step, plus the second derivatives of an integrand. Returns
    /// zero if all of them are finite, otherwise NaN.
    pub(crate) fn write_result<F: Fallback>(
        &mut self,
        integrand_hessian: Option<&[ArrayW<M, E>]>,
        result: &mut Hessian<M, E>,
    ) -> E {
        let nx = M::Shape::NX;
        let Self { backward, sum, .. } = self;
        for (to, [from]) in result.first.grad_x0.as_mut_slice().iter_mut().zip(backward.lambda.as_ref()) {
            *to = *from;
        }
        let mut gradient = backward.gradient.as_ref()[nx..].iter();
        for (to, [from]) in result.first.grad_u.as_mut_slice().iter_mut().zip(&mut gradient) {
            *to = *from;
        }
        for (to, [from]) in result.first.grad_p.as_mut_slice().iter_mut().zip(gradient) {
            *to = *from;
        }
        let rows =
            StridedMatrix { elements: ArrayC::<M, E>::flat_mut(sum.as_mut()), stride: ArrayC::<M, E>::LEN };
        HessianTriangle {
            plan: F::plan::<M>(),
            rows,
            integrand_hessian: integrand_hessian.map(ArrayW::<M, E>::flat),
        }
        .write(result)
    }
}

impl<M: Dae, T: Real, const S: usize> HessianPass<M, T, S> {
    /// Writes the result, as [`HessianPass::write_result`].
    ///
    /// # Errors
    /// [`Error::Overflow`]
    pub(crate) fn finish<F: Fallback>(
        &mut self,
        integrand_hessian: Option<&[ArrayW<M, T>]>,
        result: &mut Hessian<M, T>,
    ) -> Result<(), Error> {
        let finite = self.write_result::<F>(integrand_hessian, result).is_finite();
        let ForwardAdjoint { grad_x0, grad_u, grad_p, .. } = &result.first;
        check_gradient(grad_x0.as_slice(), grad_u.as_slice(), grad_p.as_slice())?;
        // The non-finite value is searched for only if there is one.
        if finite { Ok(()) } else { check_second_derivatives(result) }
    }
}
