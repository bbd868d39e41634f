//! Second derivatives across events: the derivative of the jump of the sensitivities.
//!
//! An event is the map `S(x⁻, w) = F⁺(−τ, j(F⁻(τ, x⁻)))`: the flow up to `g = 0`, then the jump,
//! then the flow after the jump back to the same time. With `κ = −σ/ġ` and `λ⁻ = j_xᵀ λ⁺ + κ g_x`
//! of the adjoint, all at the event:
//!
//! ```text
//! τ' = −(g_x, g_w)/ġ      Y = (I, 0) + f⁻ τ'      S' = j_x Y + (0, j_w) − f⁺ τ'      D = (S'; 0 I)      E = (Y; 0 I)
//! H⁻ = Dᵀ H⁺ D + Eᵀ ∇²(λ⁺ᵀj + κ g) E + τ'ᵀ e + eᵀ τ' + (b_x f⁻ − c_x f⁺) τ'ᵀ τ'
//! b = λ⁻ᵀ df⁻/d(x, w)      c = λ⁺ᵀ df⁺/d(x, w)      e = b − c_x S' − (0, c_w)
//! ```
//!
//! Nothing here depends on time: models and functions have no second derivatives with respect to
//! it.

use super::evaluate::dot;
use super::{Event, EventLinearisation, Hybrid, HybridAdjoint, HybridForward};
use crate::adaptive::engine::Engine;
use crate::adaptive::point::ModelPoint;
use crate::error::{Argument, Error};
use crate::finite::{check_model_input, find_non_finite};
use crate::integrator::chain_rule::{
    FullHessian, StateSensitivities, add_congruence, fill_matrix, hessian_element, set_identity,
};
use crate::linalg::axpy;
use crate::memory::allocate;
use crate::model::{
    ArrayK, ArrayV, ArrayW, ArrayX, Dae, MatrixPP, MatrixUP, MatrixUU, MatrixXP, MatrixXU, MatrixXX, VectorU,
    VectorX,
};
use crate::scalar::Real;
use crate::shape::{Array, Matrix, Plain, Shape, listed};
use alloc::boxed::Box;
use bytemuck::Zeroable;

/// The solution at the end, its derivatives, and the gradient and the Hessian of `λᵀx`.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A ball that falls: height m, velocity m/s.
/// # #[ode]
/// # fn ball(x: [f64; 2]) -> [f64; 2] { [x[1], -10.0] }
/// # #[function]
/// # fn height(x: [f64; 2]) -> f64 { x[0] }
/// # #[function]
/// # fn bounce(x: [f64; 2]) -> [f64; 2] { [x[0], -0.8 * x[1]] }
/// # let bounces = Event::jump::<Height, Bounce>(Crossing::Falling);
/// # let adaptive = Adaptive::<Ball, Radau>::new(AdaptiveOptions::default())?;
/// # let mut ball = Hybrid::new(adaptive, &[bounces])?;
/// let end = ball.hessian(&vector![5.0, 0.0], &vector![], 1.5, &vector![0.0, 1.0])?;
/// // It hits the ground at τ = √(y/5); afterwards the velocity is 8 τ − 10 (1.5 − τ) = 18 τ − 15.
/// let exact = -18.0 * 0.25 / 25.0; // 18 d²τ/dy² at y = 5
/// assert!((end.h_xx[(0, 0)] - exact).abs() < 1e-8);
/// assert!((end.adjoint.grad_x0[0] - 18.0 * 0.1).abs() < 1e-8);
/// # Ok::<(), casados::Error>(())
/// ```
#[non_exhaustive]
pub struct HybridHessian<M: Dae, T: Real = f64> {
    /// The solution and its derivatives.
    pub forward: HybridForward<M, T>,
    /// The gradient.
    pub adjoint: HybridAdjoint<M, T>,
    /// `∂²(λᵀx)/∂x₀²`
    pub h_xx: MatrixXX<M, T>,
    /// `∂²(λᵀx)/∂x₀∂u`
    pub h_xu: MatrixXU<M, T>,
    /// `∂²(λᵀx)/∂u²`
    pub h_uu: MatrixUU<M, T>,
    /// `∂²(λᵀx)/∂x₀∂p`
    pub h_xp: MatrixXP<M, T>,
    /// `∂²(λᵀx)/∂u∂p`
    pub h_up: MatrixUP<M, T>,
    /// `∂²(λᵀx)/∂p²`
    pub h_pp: MatrixPP<M, T>,
}

listed!([M: Dae, T: Real] HybridHessian<M, T> { forward, adjoint, h_xx, h_xu, h_uu, h_xp, h_up, h_pp });

/// Memory, symmetric matrices in full.
#[derive(Zeroable)]
#[zeroable(bound = "T: Zeroable")]
pub(super) struct SecondOrderMemory<M: Dae, T: Plain> {
    /// The Hessian with respect to the reached state, `u` and `p`, and the next one under
    /// construction.
    hessian: FullHessian<M, T>,
    sum: FullHessian<M, T>,
    product: FullHessian<M, T>,
    /// `S'`, and `E` for all variables.
    jump_sensitivities: [StateSensitivities<M, T>; 2],
    variable_sensitivities: ArrayV<M, ArrayW<M, T>>,
    /// Derivatives of `ẋ`, one row for each direction.
    rate_derivatives: ArrayW<M, ArrayX<M, T>>,
}

impl<M: Dae, B: Engine<M, T>, T: Real> Hybrid<M, B, T> {
    /// Integrates with second derivatives; returns the solution at the end, its derivatives, and
    /// the gradient and Hessian of `λᵀx`.
    ///
    /// Between events second derivatives are those of the accepted steps, at events those of the
    /// solution.
    ///
    /// # Errors
    /// See [`Hybrid`]; [`Error::DependsOnTime`] if the model, the event function or the jump
    /// depends on time at an event: add time as a state (`ẋ = 1`).
    pub fn hessian(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
    ) -> Result<HybridHessian<M, T>, Error> {
        self.requested_span = None;
        check_model_input::<M, T>(Argument::Lambda, lambda.as_slice())?;
        let span = self.integrate_with_events(x0, u, h)?;
        let (forward, moments) = self.forward_sweep(x0, true, None)?;
        let mut second: Box<SecondOrderMemory<M, T>> = match self.second_order.take() {
            Some(there) => there,
            None => allocate()?,
        };
        for row in second.hessian.as_mut() {
            row.as_mut().fill(T::ZERO);
        }
        let mut adjoint = HybridAdjoint {
            solution: self.solution.clone(),
            grad_x0: *lambda,
            grad_u: Zeroable::zeroed(),
            grad_p: Zeroable::zeroed(),
        };
        for k in (0..self.segment_count).rev() {
            if let Some((event, moment)) = moments.get(k) {
                let after = adjoint.grad_x0;
                let kappa = self.adjoint_over_jump(k, *event, moment, T::ZERO, &mut adjoint);
                self.hessian_over_jump(k, *event, moment, [&after, &adjoint.grad_x0], kappa, &mut second)?;
            }
            let Self { integrator, segments, .. } = self;
            let Some(segment) = segments.get_mut(k) else { break };
            let history = core::mem::take(&mut segment.step_sensitivities);
            let (mut frozen, state, memory, v) = segment.load(integrator)?;
            let result = frozen.hessian::<B>(state, &adjoint.grad_x0, memory, &history, None);
            if result.is_ok() {
                let SecondOrderMemory { hessian: h, sum, product, .. } = &mut *second;
                for (r, row) in sum.as_mut().iter_mut().enumerate() {
                    *row = ArrayW::<M, T>::from_fn(|c| hessian_element(&memory.hessian, r, c));
                }
                add_congruence::<M, T>(|r, c| h[r][c], v, [product, &mut *sum]);
                h.as_mut().copy_from_slice(sum.as_ref());
                let gradient = &memory.hessian.first;
                adjoint.grad_x0 = gradient.grad_x0;
                axpy(T::ONE, gradient.grad_u.as_slice(), adjoint.grad_u.as_mut_slice());
                axpy(T::ONE, gradient.grad_p.as_slice(), adjoint.grad_p.as_mut_slice());
            }
            segment.step_sensitivities = history;
            result?;
        }
        adjoint.check()?;
        let (nx, nu, h) = (M::Shape::NX, M::Shape::NU, second.hessian.as_ref());
        if let Some((index, _)) = find_non_finite(ArrayW::<M, T>::flat(h)) {
            return Err(Error::Overflow { step: 0, index });
        }
        // Exactly symmetric: the lower triangle is used, since both differ by rounding.
        let at = |r: usize, c: usize| h[r.max(c)][r.min(c)];
        let mut result = HybridHessian {
            forward,
            adjoint,
            h_xx: Zeroable::zeroed(),
            h_xu: Zeroable::zeroed(),
            h_uu: Zeroable::zeroed(),
            h_xp: Zeroable::zeroed(),
            h_up: Zeroable::zeroed(),
            h_pp: Zeroable::zeroed(),
        };
        fill_matrix(&mut result.h_xx, at);
        fill_matrix(&mut result.h_xu, |r, c| at(r, nx + c));
        fill_matrix(&mut result.h_uu, |r, c| at(nx + r, nx + c));
        fill_matrix(&mut result.h_xp, |r, c| at(r, nx + nu + c));
        fill_matrix(&mut result.h_up, |r, c| at(nx + r, nx + nu + c));
        fill_matrix(&mut result.h_pp, |r, c| at(nx + nu + r, nx + nu + c));
        (self.second_order, self.linearised_events, self.requested_span) =
            (Some(second), moments, Some(span));
        Ok(result)
    }

    /// Replaces `H⁺` by `H⁻`, given `λ⁺` and `λ⁻`.
    fn hessian_over_jump(
        &mut self,
        k: usize,
        event: Event<M, T>,
        moment: &EventLinearisation<M, T>,
        [lambda, before]: [&VectorX<M, T>; 2],
        kappa: T,
        second: &mut SecondOrderMemory<M, T>,
    ) -> Result<(), Error> {
        self.move_to_event(k);
        self.check_autonomous(k, &event, moment)?;
        let (nx, nz, nw) = (M::Shape::NX, M::Shape::NZ, M::Shape::NW);
        let SecondOrderMemory {
            hessian: h,
            sum,
            product,
            jump_sensitivities: s,
            variable_sensitivities: e,
            rate_derivatives: slopes,
        } = second;
        // `S'` and `τ'`, starting from the identity.
        s.iter_mut().for_each(set_identity::<M, T>);
        let [v, next] = s.each_mut().map(|rows| ArrayW::<M, T>::flat_mut(rows.as_mut()));
        let time = self.forward_over_jump(event, moment, v, next)?;
        // Dᵀ H⁺ D
        for row in sum.as_mut() {
            row.as_mut().fill(T::ZERO);
        }
        add_congruence::<M, T>(|r, c| h[r][c], v, [product, &mut *sum]);
        // Eᵀ ∇² E
        for row in e.as_mut() {
            row.as_mut().fill(T::ZERO);
        }
        for (x, row) in e.as_mut()[nx..2 * nx].iter_mut().enumerate() {
            row[x] = T::ONE;
            axpy(moment.derivatives_before[x], time.as_ref(), row.as_mut());
        }
        for (input, row) in e.as_mut()[2 * nx + nz..].iter_mut().enumerate().take(nw - nx) {
            row[nx + input] = T::ONE;
        }
        let e = e.as_ref();
        let mut curve = |r: usize, c: usize, value: T| {
            for (i, row) in sum.as_mut().iter_mut().enumerate() {
                axpy(value * e[r][i], e[c].as_ref(), row.as_mut());
                if r != c {
                    axpy(value * e[c][i], e[r].as_ref(), row.as_mut());
                }
            }
        };
        event.guard.hessian(&self.variables, &[kappa], &mut curve);
        if let Some(jump) = event.jump {
            jump.hessian(&self.variables, lambda.as_slice(), &mut curve);
        }
        // The changes of the slopes.
        let Some(at) = self.solution.occurrences.get(k) else { return Ok(()) };
        let u = self.segments.get(k).map_or_else(Zeroable::zeroed, |segment| segment.u);
        let base = &mut self.integrator.workspace;
        let mut product = |lambda: &VectorX<M, T>, x: &VectorX<M, T>, y: &ArrayK<M, T>| {
            let at = ModelPoint { x, u: &u, p: &base.parameters, t: at.t };
            self.integrator.consistent.rate_derivatives(&at, y, slopes)?;
            let slopes = slopes.as_ref();
            Ok::<_, Error>(ArrayW::<M, T>::from_fn(|w| dot(slopes[w].as_ref(), lambda.as_slice())))
        };
        let mut change = product(before, &at.before, &moment.derivatives_before)?;
        let mut twice = dot(&change.as_ref()[..nx], moment.derivatives_before.as_ref());
        if event.jump.is_some() {
            let after = product(lambda, &at.after, &moment.derivatives_after)?;
            twice = twice - dot(&after.as_ref()[..nx], moment.derivatives_after.as_ref());
            for (c, row) in after.as_ref().iter().zip(v.chunks_exact(nw.max(1))) {
                axpy(-*c, row, change.as_mut());
            }
            axpy(-T::ONE, &after.as_ref()[nx..], &mut change.as_mut()[nx..]);
        }
        for (i, row) in sum.as_mut().iter_mut().enumerate() {
            axpy(time[i], change.as_ref(), row.as_mut());
            axpy(change[i] + twice * time[i], time.as_ref(), row.as_mut());
        }
        h.as_mut().copy_from_slice(sum.as_ref());
        Ok(())
    }

    /// Tests that the model and the functions of an event are autonomous: bitwise equal at other
    /// times.
    ///
    /// # Errors
    /// [`Error::DependsOnTime`]
    fn check_autonomous(
        &mut self,
        k: usize,
        event: &Event<M, T>,
        moment: &EventLinearisation<M, T>,
    ) -> Result<(), Error> {
        let (nx, nk) = (M::Shape::NX, M::Shape::NK);
        let Some(at) = self.solution.occurrences.get(k) else { return Ok(()) };
        let mut v = *self.variables;
        let part = self.segments.get(k).map_or(T::ZERO, |segment| segment.span.end - segment.span.start);
        let part = if part == T::ZERO { T::ONE } else { part };
        let others = [-0.37, 0.11, 0.83].map(|share| at.t + T::from_f64(share) * part);
        let model = |x: &VectorX<M, T>, y: &ArrayK<M, T>, t: T| {
            let (mut point, mut f) = (v, ArrayK::<M, T>::zeroed());
            let numbers = point.as_mut();
            numbers[..nx].copy_from_slice(&y.as_ref()[..nx]);
            numbers[nx..2 * nx].copy_from_slice(x.as_slice());
            numbers[2 * nx..nx + nk].copy_from_slice(&y.as_ref()[nx..]);
            if let Some(time) = numbers.last_mut() {
                *time = t;
            }
            M::residual::<T>(&point, &mut f);
            f
        };
        let sides = [(&at.before, &moment.derivatives_before), (&at.after, &moment.derivatives_after)];
        for (x, y) in sides.into_iter().take(if event.jump.is_some() { 2 } else { 1 }) {
            let there = model(x, y, at.t);
            if others.iter().any(|t| model(x, y, *t) != there) {
                return Err(Error::DependsOnTime { function: "the model" });
            }
        }
        if event.guard.reads_algebraic_states {
            return Err(Error::GuardOfAlgebraicStates { function: event.guard.name });
        }
        let functions = [Some(&event.guard), event.jump.as_ref()];
        for map in functions.into_iter().flatten() {
            let mut value = |t: T| {
                if let Some(time) = v.as_mut().last_mut() {
                    *time = t;
                }
                map.all_outputs(&v)
            };
            let there = value(at.t);
            if others.iter().any(|t| value(*t) != there) {
                return Err(Error::DependsOnTime { function: map.name });
            }
        }
        Ok(())
    }
}
