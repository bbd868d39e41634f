//! Adaptive integration with piecewise constant controls, one interval after the other, and the
//! derivatives over all intervals.
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

/// An adaptive integrator over successive intervals, each with its own control.
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
/// The first interval starts at the time of [`Integrator::set_time`], each other one at the end of
/// the preceding one. Steps end at the ends of intervals. `ends` and the argument of
/// [`dense`](Self::dense) are times of the model, not lengths.
///
/// Repeated calls of one kind allocate only the lists that results of derivatives own and the sums
/// of an integrand.
///
/// # Errors
/// Every call: the errors of [`Integrator`]; [`Error::Intervals`] if the number of controls is not
/// that of the intervals; [`Error::Unordered`] if the ends are not in order;
/// [`Error::OutsideInterval`] if they differ from those of frozen steps.
pub struct Piecewise<M: Dae, B: Engine<M, T>, T: Real> {
    integrator: Integrator<M, B, T>,
    segments: Vec<Segment<M, T>>,
    /// The number of intervals, and whether the last call succeeded.
    interval_count: usize,
    solved: bool,
    /// Repeats the frozen steps. A function pointer: programs that freeze no steps do not contain
    /// it.
    frozen: Option<FrozenReplay<M, B, T>>,
    statistics: AdaptiveStatistics,
    nominal: Nominal<M, T>,
    /// `V_k` and `V_{k+1}`.
    sensitivities: [Vec<T>; 2],
    /// The Hessian with respect to all directions, and an intermediate product.
    second_derivatives: [Vec<T>; 2],
}

type FrozenReplay<M, B, T> = fn(&mut Piecewise<M, B, T>, &VectorX<M, T>) -> Result<(), Error>;

impl<M: Dae, B: Engine<M, T>, T: Real> Piecewise<M, B, T> {
    /// Takes an integrator, which keeps its options, tolerances, parameters and start time.
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

    /// Statistics of the step selection of the last call, over all intervals.
    #[must_use]
    pub fn statistics(&self) -> &AdaptiveStatistics {
        &self.statistics
    }

    /// Integrates; returns `x` and `z` at the end, and the consistent `z` at the start.
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

    /// As [`Piecewise::solve`], with an integrand: the steps are replayed, solved to rounding.
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

    /// The solution at the model's time `t` within the intervals of the last call; where two
    /// intervals meet, that of the first one.
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

    /// Integrates; returns the solution at the end and its derivatives with respect to `x₀`, all
    /// controls and `p`.
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

    /// Integrates; returns the solution at the end and the gradient of `λᵀx` with respect to `x₀`,
    /// all controls and `p`.
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
        // The gradients with respect to `x₀` and each control belong to one interval, which has
        // checked them.
        check_output(result.grad_p.as_slice(), 0)?;
        self.solved = true;
        Ok(result)
    }

    /// Integrates; returns the solution at the end, its derivatives, and the gradient and Hessian
    /// of `λᵀx`.
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

    /// Computes the gradient and the Hessian after [`Piecewise::forward_sweep`], with the
    /// contributions of an integrand to `sum`.
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

    /// Freezes the steps of the last successful call: later calls repeat them for all inputs and
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

    /// Ends the effect of [`freeze`](Self::freeze): later calls choose their steps.
    pub fn thaw(&mut self) {
        self.frozen = None;
    }
}

/// Copies the result at the end of interval `k`.
fn collect_end<M: Dae, T: Real>(nominal: &mut Nominal<M, T>, interval: &Nominal<M, T>, k: usize) {
    if k == 0 {
        nominal.z0 = interval.z0;
    }
    (nominal.x, nominal.z) = (interval.x, interval.z);
}
