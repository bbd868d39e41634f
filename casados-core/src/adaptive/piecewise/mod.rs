//! Integration over controls that are piecewise constant: an adaptive integration for each
//! interval, one after the other, and the derivatives of all of them together.
//!
//! With `x_{k+1} = Φ_k(x_k, u_k, p)` and `W = (x₀, u₀, …, u_{N−1}, p)`:
//!
//! ```text
//! V_{k+1} = ∂Φ_k/∂x V_k + ∂Φ_k/∂(u_k, p)        λ_k = (∂Φ_k/∂x)ᵀ λ_{k+1}
//! d²(λᵀ x_N)/dW² = Σ_k D_kᵀ ∇²(λ_{k+1}ᵀ Φ_k) D_k        D_k = d(x_k, u_k, p)/dW
//! ```

mod direction_layout;
mod integrals;
mod results;
mod steps;

pub use results::{PiecewiseAdjoint, PiecewiseForward, PiecewiseHessian};

use crate::adaptive::engine::Engine;
use crate::adaptive::integrator::{Integrator, is_inside_interval};
use crate::adaptive::segment::{Segment, dense_at, filled_vec, push_segment, refill_vec};
use crate::adaptive::sensitivities::{chain_rule_integrand, dyn_integrand};
use crate::adaptive::statistics::AdaptiveStatistics;
use crate::adaptive::step::Span;
use crate::error::{Argument, Error};
use crate::finite::{check_input, check_model_input, check_output};
use crate::integrator::chain_rule::{fill_matrix, hessian_element};
use crate::linalg::axpy;
use crate::model::{Dae, MatrixXU, MatrixZU, VectorP, VectorU, VectorX};
use crate::quadrature::{
    AdjointOnlyIntegrand, OptionalIntegrand, finish_integrand, reborrow, reset_integrand,
};
use crate::result::{Dense, Nominal};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};
use alloc::vec::Vec;
use bytemuck::Zeroable;
use direction_layout::DirectionLayout;
use integrals::{HessianBlocks, QuadratureSums};

pub use integrals::{PiecewiseLeastSquares, PiecewiseQuadrature, Spanning};

/// An adaptive integrator over intervals, each with a control of its own.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] { [x[1], u[0]] }
/// let mut horizon = Piecewise::new(Adaptive::<Cart, Radau>::new(AdaptiveOptions::default())?);
/// let end = horizon.forward(&vector![0.0, 0.0], &[vector![2.0], vector![-1.0]], &[1.0, 3.0])?;
/// assert!((end.nominal.x - vector![3.0, 0.0]).norm() < 1e-12);
/// assert!((end.dx_du[0] - vector![2.5, 1.0]).norm() < 1e-12);
/// # Ok::<(), casados::Error>(())
/// ```
///
/// The first interval begins at the time that was set ([`Integrator::set_time`]), each of the
/// others at the end of the one before. Steps end where intervals end. `ends` are times as the
/// model sees them, not lengths, and so is that of [`dense`](Self::dense).
///
/// Later calls of a kind do not allocate, but for the lists that results of derivatives own and the
/// sums of an integrand.
///
/// # Errors
/// Of every call: those of [`Integrator`]; [`Error::Intervals`] if there is not one control for
/// each interval; [`Error::Unordered`] if the ends are not in order, [`Error::OutsideInterval`] if
/// they are not those of the steps that are kept.
pub struct Piecewise<M: Dae, B: Engine<M, T>, T: Real> {
    integrator: Integrator<M, B, T>,
    segments: Vec<Segment<M, T>>,
    /// How many of them there are, and whether the last call succeeded with them.
    interval_count: usize,
    solved: bool,
    /// Steps that are kept are taken by this. Programs that keep none have no integrator for that.
    frozen: Option<FrozenReplay<M, B, T>>,
    statistics: AdaptiveStatistics,
    nominal: Nominal<M, T>,
    /// `V_k` and `V_{k+1}`.
    sensitivities: [Vec<T>; 2],
    /// Second derivatives of all columns, and a product on the way there.
    second_derivatives: [Vec<T>; 2],
}

type FrozenReplay<M, B, T> = fn(&mut Piecewise<M, B, T>, &VectorX<M, T>) -> Result<(), Error>;

impl<M: Dae, B: Engine<M, T>, T: Real> Piecewise<M, B, T> {
    /// Of an integrator, which keeps its options, tolerances, parameters and start time.
    #[must_use]
    pub fn new(integrator: Integrator<M, B, T>) -> Self {
        let nominal = Nominal::zeroed();
        let statistics = AdaptiveStatistics::default();
        Self {
            integrator,
            segments: Vec::new(),
            interval_count: 0,
            solved: false,
            frozen: None,
            statistics,
            nominal,
            sensitivities: Default::default(),
            second_derivatives: Default::default(),
        }
    }

    /// The integrator, to set its parameters or its start time.
    pub fn integrator(&mut self) -> &mut Integrator<M, B, T> {
        &mut self.integrator
    }

    /// What the last call did to choose its steps, in all intervals.
    #[must_use]
    pub fn statistics(&self) -> &AdaptiveStatistics {
        &self.statistics
    }

    /// `x` and `z` at the end, and the consistent `z` at the start.
    ///
    /// # Errors
    /// See [`Piecewise`].
    pub fn solve(
        &mut self,
        x0: &VectorX<M, T>,
        controls: &[VectorU<M, T>],
        ends: &[T],
    ) -> Result<&Nominal<M, T>, Error> {
        self.prepare_steps(x0, controls, ends)?;
        if let Some(again) = self.frozen {
            again(self, x0)?;
        }
        self.solved = true;
        Ok(&self.nominal)
    }

    /// As [`Piecewise::solve`], with an integrand: the steps are taken again, to rounding.
    pub(super) fn solve_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        controls: &[VectorU<M, T>],
        ends: &[T],
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Nominal<M, T>, Error> {
        self.prepare_steps(x0, controls, ends)?;
        self.replay_steps(x0, integrand)?;
        self.solved = true;
        Ok(&self.nominal)
    }

    /// The solution at the time `t`, as the model sees it, inside the intervals of the last call;
    /// where two of them meet, that of the first.
    ///
    /// # Errors
    /// [`Error::NoResult`], also if that call failed; [`Error::OutsideInterval`],
    /// [`Error::NonFiniteInput`].
    pub fn dense(&mut self, t: T) -> Result<&Dense<M, T>, Error> {
        if !self.solved {
            return Err(Error::NoResult);
        }
        let Self { integrator, segments, interval_count: count, nominal, .. } = self;
        dense_at(integrator, segments.get_mut(..*count).unwrap_or_default(), nominal, t)
    }

    /// The solution at the end, and its derivatives with respect to `x₀`, all controls and `p`.
    ///
    /// # Errors
    /// See [`Piecewise`].
    pub fn forward(
        &mut self,
        x0: &VectorX<M, T>,
        controls: &[VectorU<M, T>],
        ends: &[T],
    ) -> Result<PiecewiseForward<M, T>, Error> {
        self.prepare_steps(x0, controls, ends)?;
        let forward = self.forward_sweep(x0, false, None, None)?;
        self.solved = true;
        Ok(forward)
    }

    /// As [`Piecewise::forward`], with an integrand.
    pub(super) fn forward_with_quadrature<Q: Spanning<M, T>>(
        &mut self,
        x0: &VectorX<M, T>,
        controls: &[VectorU<M, T>],
        ends: &[T],
        integrand: &mut Q,
    ) -> Result<(PiecewiseForward<M, T>, Q::Derivatives), Error> {
        self.prepare_steps(x0, controls, ends)?;
        let mut sums = QuadratureSums::new(self.interval_count, integrand, false)?;
        let forward = self.forward_sweep(x0, false, Some(integrand), Some(&mut sums))?;
        let derivatives = Q::derivatives(&sums)?;
        self.solved = true;
        Ok((forward, derivatives))
    }

    /// As [`Piecewise::hessian`], with an integrand.
    pub(super) fn hessian_with_quadrature<Q: Spanning<M, T>>(
        &mut self,
        x0: &VectorX<M, T>,
        controls: &[VectorU<M, T>],
        ends: &[T],
        lambda: &VectorX<M, T>,
        integrand: &mut Q,
    ) -> Result<(PiecewiseHessian<M, T>, Q::Derivatives), Error> {
        self.solved = false;
        check_model_input::<M, T>(Argument::Lambda, lambda.as_slice())?;
        self.prepare_steps(x0, controls, ends)?;
        let mut sums = QuadratureSums::new(self.interval_count, integrand, true)?;
        let forward = self.forward_sweep(x0, true, Some(&mut *integrand), Some(&mut sums))?;
        let derivatives = Q::derivatives(&sums)?;
        Ok((self.adjoint_sweep(forward, lambda, &mut sums.second_derivatives, Some(integrand))?, derivatives))
    }

    /// The solution at the end, and the gradient of `λᵀx` with respect to `x₀`, all controls and
    /// `p`.
    ///
    /// # Errors
    /// See [`Piecewise`].
    pub fn adjoint(
        &mut self,
        x0: &VectorX<M, T>,
        controls: &[VectorU<M, T>],
        ends: &[T],
        lambda: &VectorX<M, T>,
    ) -> Result<PiecewiseAdjoint<M, T>, Error> {
        self.adjoint_with_quadrature(x0, controls, ends, lambda, None)
    }

    /// As [`Piecewise::adjoint`], with an integrand.
    pub(super) fn adjoint_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        controls: &[VectorU<M, T>],
        ends: &[T],
        lambda: &VectorX<M, T>,
        mut integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<PiecewiseAdjoint<M, T>, Error> {
        self.solved = false;
        check_model_input::<M, T>(Argument::Lambda, lambda.as_slice())?;
        self.prepare_steps(x0, controls, ends)?;
        self.replay_steps(x0, reborrow(&mut integrand))?;
        let Self { integrator, segments, interval_count: count, nominal, .. } = self;
        let mut result = PiecewiseAdjoint {
            nominal: *nominal,
            grad_x0: *lambda,
            grad_u: filled_vec(*count, VectorU::<M, T>::zeroed())?,
            grad_p: VectorP::<M, T>::zeroed(),
        };
        for (segment, grad_u) in segments.iter_mut().zip(&mut result.grad_u).rev() {
            let (mut frozen, state, memory, _) = segment.load(integrator)?;
            frozen.adjoint::<B>(state, &result.grad_x0, memory, reborrow(&mut integrand))?;
            result.grad_x0.as_mut_slice().copy_from_slice(memory.adjoint.grad_x0.as_slice());
            grad_u.as_mut_slice().copy_from_slice(memory.adjoint.grad_u.as_slice());
            axpy(T::ONE, memory.adjoint.grad_p.as_slice(), result.grad_p.as_mut_slice());
        }
        // Those by `x₀` and each control are of one interval, which has looked at them.
        check_output(result.grad_p.as_slice(), 0)?;
        self.solved = true;
        Ok(result)
    }

    /// The solution at the end, its derivatives, and the gradient and the Hessian of `λᵀx`.
    ///
    /// # Errors
    /// See [`Piecewise`].
    pub fn hessian(
        &mut self,
        x0: &VectorX<M, T>,
        controls: &[VectorU<M, T>],
        ends: &[T],
        lambda: &VectorX<M, T>,
    ) -> Result<PiecewiseHessian<M, T>, Error> {
        self.solved = false;
        check_model_input::<M, T>(Argument::Lambda, lambda.as_slice())?;
        self.prepare_steps(x0, controls, ends)?;
        let forward = self.forward_sweep(x0, true, None, None)?;
        let at = DirectionLayout::<M> { intervals: self.interval_count, model: core::marker::PhantomData };
        let mut sum = core::mem::take(&mut self.second_derivatives[0]);
        refill_vec(&mut sum, at.column_count() * at.column_count(), T::ZERO)?;
        let result = self.adjoint_sweep(forward, lambda, &mut sum, None);
        self.second_derivatives[0] = sum;
        result
    }

    /// The gradient and the Hessian after [`Piecewise::sweep`], with what an integrand has added to
    /// `sum`.
    fn adjoint_sweep(
        &mut self,
        forward: PiecewiseForward<M, T>,
        lambda: &VectorX<M, T>,
        sum: &mut [T],
        mut along: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<PiecewiseHessian<M, T>, Error> {
        let Self {
            integrator,
            segments,
            interval_count: count,
            nominal,
            second_derivatives: [_, product],
            ..
        } = self;
        let at = DirectionLayout::<M> { intervals: *count, model: core::marker::PhantomData };
        let mut adjoint = PiecewiseAdjoint {
            nominal: *nominal,
            grad_x0: *lambda,
            grad_u: filled_vec(*count, VectorU::<M, T>::zeroed())?,
            grad_p: VectorP::<M, T>::zeroed(),
        };
        refill_vec(product, M::Shape::NW * at.column_count(), T::ZERO)?;
        for (k, segment) in segments.iter_mut().enumerate().take(*count).rev() {
            let history = core::mem::take(&mut segment.step_sensitivities);
            let (mut frozen, state, memory, v) = segment.load(integrator)?;
            let mut part = along.as_mut().map(|integrand| AdjointOnlyIntegrand(&mut **integrand));
            frozen.hessian::<B>(state, &adjoint.grad_x0, memory, &history, dyn_integrand(&mut part))?;
            let hessian = &memory.hessian;
            adjoint.grad_x0 = hessian.first.grad_x0;
            if let Some(grad_u) = adjoint.grad_u.get_mut(k) {
                *grad_u = hessian.first.grad_u;
            }
            axpy(T::ONE, hessian.first.grad_p.as_slice(), adjoint.grad_p.as_mut_slice());
            at.add_projected_hessian(k, |r, c| hessian_element(hessian, r, c), v, product, sum);
            segment.step_sensitivities = history;
        }
        check_output(adjoint.grad_p.as_slice(), 0)?;
        check_output(sum, 0)?;
        let HessianBlocks { h_xx, h_xu, h_uu, h_xp, h_up, h_pp } = at.hessian_blocks(sum)?;
        let result = PiecewiseHessian { forward, adjoint, h_xx, h_xu, h_uu, h_xp, h_up, h_pp };
        self.solved = true;
        Ok(result)
    }

    /// Following calls take the steps of the last successful one, whatever they are given, and
    /// solve them to rounding.
    ///
    /// # Errors
    /// [`Error::NoResult`], also if that call failed.
    pub fn freeze(&mut self) -> Result<(), Error> {
        if !self.solved {
            return Err(Error::NoResult);
        }
        for segment in &mut self.segments {
            segment.steps_were_chosen = false;
        }
        self.frozen = Some(|piecewise, x0| piecewise.replay_steps(x0, None));
        Ok(())
    }

    /// Following calls choose their steps again.
    pub fn thaw(&mut self) {
        self.frozen = None;
    }
}

/// The result at the end of interval `k`.
fn collect_end<M: Dae, T: Real>(nominal: &mut Nominal<M, T>, interval: &Nominal<M, T>, k: usize) {
    if k == 0 {
        nominal.z0 = interval.z0;
    }
    (nominal.x, nominal.z) = (interval.x, interval.z);
}
