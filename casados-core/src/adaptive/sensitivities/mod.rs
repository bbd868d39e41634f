//! Derivatives of a run: the accepted steps are kept as they are, and each is differentiated
//! exactly.
//!
//! ```text
//! x_{n+1} = Φ_n(x_n, u, p)        V_{n+1} = ∂Φ_n/∂x V_n + ∂Φ_n/∂(u, p)        λ_n = (∂Φ_n/∂x)ᵀ λ_{n+1}
//! d²(λᵀ x_N)/dw² = Σ_n D_nᵀ ∇²(λ_{n+1}ᵀ Φ_n) D_n        D_n = d(x_n, u, p)/dw
//! ```
//!
//! An integrand takes part step by step: forwards with the derivatives of its stages by
//! `(x₀, u, p)`, backwards in `λ_n`.

mod blocks;

use blocks::in_step;

use crate::adaptive::consistent::Consistent;
use crate::adaptive::engine::Engine;
use crate::adaptive::point::At;
use crate::adaptive::replay::{AcceptedStep, StepDifferentiator};
use crate::adaptive::step::{Span, Workspace};
use crate::adaptive::tape::Tape;
use crate::error::Error;
use crate::finite::{check_forward, check_output};
use crate::integrator::chain_rule::{
    FullHessian, StateSensitivities, add, chain_states, element, identity, write_algebraic, write_blocks,
    write_states,
};
use crate::linalg::axpy;
use crate::memory::extend;
use crate::model::{ArrayK, ArrayW, Dae, VectorX, VectorZ};
use crate::quadrature::{
    AdjointOnlyIntegrand, ChainRuleIntegrand, Integrand, OptionalIntegrand, finish_integrand, reset_integrand,
};
use crate::result::{Adjoint, Hessian};
use crate::scalar::Real;
use crate::shape::{Array, Matrix, Plain, Shape};
use alloc::vec::Vec;
use bytemuck::Zeroable;

/// Memory of derivatives.
#[derive(Zeroable)]
#[zeroable(bound = "T: Zeroable")]
pub struct Memory<M: Dae, T: Plain> {
    pub hessian: Hessian<M, T>,
    pub adjoint: Adjoint<M, T>,
    /// `V_n`, and `V_{n+1}`.
    v: [StateSensitivities<M, T>; 2],
    lambda: VectorX<M, T>,
    /// The gradient of all steps.
    gradient: ArrayW<M, T>,
    /// The Hessian of one step times `D`, and the sum of all.
    product: FullHessian<M, T>,
    sum: FullHessian<M, T>,
}

/// What derivatives are taken of.
pub struct Frozen<'a, M: Dae, T: Real> {
    pub base: &'a mut Workspace<M, T>,
    pub consistent: &'a mut Consistent<M, T>,
    pub tape: &'a mut Tape<T>,
    pub span: Span<T>,
    /// Start values of `(ẋ, z)`.
    pub given: ArrayK<M, T>,
    /// Whether the steps were chosen for these inputs: then each is taken from where the run took
    /// it. Steps that are solved to rounding one after the other lead elsewhere than those that
    /// were solved to a coarse tolerance, where errors grow by much, and do not fit there.
    pub chosen: bool,
}

impl<M: Dae, T: Real> Frozen<'_, M, T> {
    /// Takes all steps again, to rounding; `each` is called to take one, and returns what it gave.
    fn steps<B: Engine<M, T>>(
        &mut self,
        state: &mut B::State,
        x0: &VectorX<M, T>,
        mut each: impl FnMut(
            &mut B::Replays,
            &AcceptedStep<'_, M, T>,
            usize,
        ) -> Result<(VectorX<M, T>, VectorZ<M, T>), Error>,
    ) -> Result<(), Error> {
        let mut x = *x0;
        let Workspace { u, parameters, result, start, .. } = &mut *self.base;
        *start = self.given;
        let at = At { x: x0, u, p: parameters, t: self.span.start };
        if M::Shape::NZ > 0 {
            self.consistent.solve_from_afar(&at, start)?;
        }
        result.z0.as_mut_slice().copy_from_slice(&start.as_ref()[M::Shape::NX..]);
        (result.x, result.z) = (*x0, result.z0);
        self.tape.rewrite();
        for step in 0..self.tape.entries().len() {
            let Some(entry) = self.tape.entries().get(step).copied() else { break };
            let replays = B::replays(state);
            let (start, y) = self.tape.numbers(step, M::Shape::NX);
            if self.chosen {
                for (x, start) in x.as_mut_slice().iter_mut().zip(start) {
                    *x = *start;
                }
            }
            let at = At { x: &x, u, p: parameters, t: entry.t };
            let taken = AcceptedStep { at, h: entry.h, y, level: entry.level, near: self.chosen };
            let (end, z) = each(replays, &taken, step).map_err(|error| in_step(error, step))?;
            self.tape.write(x.as_slice(), replays.stages(entry.level)?)?;
            (x, result.z) = (end, z);
            result.x = x;
        }
        self.tape.commit();
        if !B::ENDS_ON_STAGE && M::Shape::NZ > 0 {
            let y = self.end()?;
            self.base.result.z.as_mut_slice().copy_from_slice(&y.as_ref()[M::Shape::NX..]);
        }
        Ok(())
    }

    /// Consistent `(ẋ, z)` at the end, from the last stage and the `z` that is there.
    fn end(&mut self) -> Result<ArrayK<M, T>, Error> {
        let (nx, Workspace { u, parameters, result, .. }) = (M::Shape::NX, &mut *self.base);
        let mut guess = ArrayK::<M, T>::zeroed();
        let (states, algebraic) = guess.as_mut().split_at_mut(nx);
        let (_, y) = self.tape.numbers(self.tape.entries().len().saturating_sub(1), nx);
        let stages = (y.len() / M::Shape::NK.max(1)).max(1);
        for (to, k) in states.iter_mut().zip(y.chunks_exact(stages)) {
            *to = k.last().copied().unwrap_or(T::ZERO);
        }
        algebraic.copy_from_slice(result.z.as_slice());
        let x = result.x;
        self.consistent.solve(&At { x: &x, u, p: parameters, t: self.span.end }, &mut guess)?;
        Ok(guess)
    }

    /// The solution alone.
    ///
    /// # Errors
    /// Those of Newton's method.
    pub fn solve<B: Engine<M, T>>(
        &mut self,
        state: &mut B::State,
        x0: &VectorX<M, T>,
        mut along: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<(), Error> {
        reset_integrand(&mut along);
        self.steps::<B>(state, x0, |replays, taken, _| {
            let mut chained = chain(&mut along, None, false);
            let nominal = replays.solve(taken, dynamic(&mut chained))?;
            Ok((nominal.x, nominal.z))
        })?;
        finish_integrand(&mut along)
    }

    /// The solution and its derivatives; `history` takes `V_n` of each step, if it is wanted.
    ///
    /// # Errors
    /// Those of Newton's method; a singular matrix; [`Error::Overflow`].
    pub fn forward<B: Engine<M, T>>(
        &mut self,
        state: &mut B::State,
        x0: &VectorX<M, T>,
        memory: &mut Memory<M, T>,
        mut history: Option<&mut Vec<T>>,
        mut along: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<(), Error> {
        reset_integrand(&mut along);
        let second = history.is_some();
        let Memory { v: [v, next], hessian, .. } = memory;
        let result = &mut hessian.first.forward;
        identity::<M, T>(v);
        let count = self.tape.entries().len();
        self.steps::<B>(state, x0, |replays, taken, step| {
            if let Some(history) = &mut history {
                extend(history, ArrayW::<M, T>::flat(v.as_ref()))?;
            }
            let mut chained = chain(&mut along, Some(v), second);
            let forward = replays.forward(taken, dynamic(&mut chained))?;
            chain_states(forward, v, next);
            if step + 1 == count && B::ENDS_ON_STAGE {
                write_algebraic(forward, v, result);
            }
            *v = *next;
            Ok((forward.nominal.x, forward.nominal.z))
        })?;
        write_states(v, result);
        if const { !B::ENDS_ON_STAGE && M::Shape::NZ > 0 } {
            let y = self.end()?;
            let (x, Workspace { u, parameters, .. }) = (self.base.result.x, &mut *self.base);
            let at = At { x: &x, u, p: parameters, t: self.span.end };
            write_algebraic(self.consistent.forward(&at, &y)?, v, result);
        }
        if const { M::Shape::NZ > 0 } {
            let Workspace { u, parameters, start, .. } = &mut *self.base;
            let at = At { x: x0, u, p: parameters, t: self.span.start };
            let forward = self.consistent.forward(&at, start)?;
            (result.dz0_dx0, result.dz0_du, result.dz0_dp) = (forward.dz_dx0, forward.dz_du, forward.dz_dp);
            if count == 0 {
                (result.dz_dx0, result.dz_du, result.dz_dp) = (forward.dz_dx0, forward.dz_du, forward.dz_dp);
            }
        }
        result.nominal = self.base.result;
        finish_integrand(&mut along)?;
        check_forward(result, count)
    }

    /// The gradient of `λᵀx`, after the solution: backwards over the steps.
    ///
    /// # Errors
    /// Those of Newton's method; a singular matrix; [`Error::Overflow`].
    pub fn adjoint<B: Engine<M, T>>(
        &mut self,
        state: &mut B::State,
        lambda: &VectorX<M, T>,
        memory: &mut Memory<M, T>,
        mut along: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<(), Error> {
        let (nx, nu) = (M::Shape::NX, M::Shape::NU);
        let Memory { lambda: now, gradient, adjoint, .. } = memory;
        *now = *lambda;
        gradient.as_mut().fill(T::ZERO);
        let Workspace { u, parameters, result, .. } = &mut *self.base;
        for (step, entry) in self.tape.entries().iter().enumerate().rev() {
            let (states, y) = self.tape.numbers(step, nx);
            let mut x = VectorX::<M, T>::zeroed();
            x.as_mut_slice().copy_from_slice(states);
            let at = At { x: &x, u, p: parameters, t: entry.t };
            let taken = AcceptedStep { at, h: entry.h, y, level: entry.level, near: true };
            let mut backwards = along.as_mut().map(|integrand| AdjointOnlyIntegrand(&mut **integrand));
            let local = B::replays(state).adjoint(&taken, now, dynamic(&mut backwards));
            let local = local.map_err(|error| in_step(error, step))?;
            now.as_mut_slice().copy_from_slice(local.grad_x0.as_slice());
            let parts = local.grad_u.as_slice().iter().chain(local.grad_p.as_slice());
            for (sum, part) in gradient.as_mut()[nx..].iter_mut().zip(parts) {
                *sum = *sum + *part;
            }
        }
        adjoint.nominal = *result;
        adjoint.grad_x0.as_mut_slice().copy_from_slice(now.as_slice());
        let others = &gradient.as_ref()[nx..];
        adjoint.grad_u.as_mut_slice().copy_from_slice(&others[..nu]);
        adjoint.grad_p.as_mut_slice().copy_from_slice(&others[nu..]);
        check_output(now.as_slice(), 0)?;
        check_output(others, 0)
    }

    /// The gradient and the Hessian of `λᵀx`, after [`Frozen::forward`] with its history.
    ///
    /// # Errors
    /// Those of Newton's method; a singular matrix; a second derivative that is not finite;
    /// [`Error::Overflow`].
    pub fn hessian<B: Engine<M, T>>(
        &mut self,
        state: &mut B::State,
        lambda: &VectorX<M, T>,
        memory: &mut Memory<M, T>,
        history: &[T],
        mut along: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<(), Error> {
        let (nx, nu, np, nw) = (M::Shape::NX, M::Shape::NU, M::Shape::NP, M::Shape::NW);
        let Memory { lambda: now, gradient, hessian, product, sum, .. } = memory;
        *now = *lambda;
        gradient.as_mut().fill(T::ZERO);
        for row in sum.as_mut() {
            row.as_mut().fill(T::ZERO);
        }
        let Workspace { u, parameters, .. } = &mut *self.base;
        for (step, entry) in self.tape.entries().iter().enumerate().rev() {
            let (states, y) = self.tape.numbers(step, nx);
            let mut x = VectorX::<M, T>::zeroed();
            x.as_mut_slice().copy_from_slice(states);
            let at = At { x: &x, u, p: parameters, t: entry.t };
            let taken = AcceptedStep { at, h: entry.h, y, level: entry.level, near: true };
            let mut backwards = along.as_mut().map(|integrand| AdjointOnlyIntegrand(&mut **integrand));
            let second = B::replays(state).hessian(&taken, now, dynamic(&mut backwards));
            let second = second.map_err(|error| in_step(error, step))?;
            *now = second.first.grad_x0;
            let parts = second.first.grad_u.as_slice().iter().chain(second.first.grad_p.as_slice());
            for (sum, part) in gradient.as_mut()[nx..].iter_mut().zip(parts) {
                *sum = *sum + *part;
            }
            let v = history.get(step * nx * nw..).unwrap_or_default();
            add::<M, T>(|r, c| element(second, r, c), v, [product, sum]);
        }
        if let Some(second) = along.as_ref().and_then(|integrand| integrand.second()) {
            for (sum, second) in sum.as_mut().iter_mut().zip(second) {
                axpy(T::ONE, second.as_ref(), sum.as_mut());
            }
        }
        write_blocks(sum, hessian);
        let others = &gradient.as_ref()[nx..];
        hessian.first.grad_x0 = *now;
        hessian.first.grad_u.as_mut_slice().copy_from_slice(&others[..nu]);
        hessian.first.grad_p.as_mut_slice().copy_from_slice(&others[nu..nu + np]);
        check_output(now.as_slice(), 0)?;
        check_output(others, 0)?;
        for row in sum.as_ref() {
            check_output(row.as_ref(), 0)?;
        }
        Ok(())
    }
}

/// The integrand of one step of an interval, or of one of several intervals.
pub(super) fn chain<'a, M: Dae, T: Real>(
    along: &'a mut OptionalIntegrand<'_, '_, M, T>,
    v: Option<&'a StateSensitivities<M, T>>,
    second: bool,
) -> Option<ChainRuleIntegrand<'a, M, T>> {
    along.as_mut().map(|inner| ChainRuleIntegrand { inner: &mut **inner, v, second })
}

pub(super) fn dynamic<'a, M: Dae, T: Real, Q: Integrand<M, T> + 'a>(
    integrand: &'a mut Option<Q>,
) -> OptionalIntegrand<'a, 'a, M, T> {
    match integrand {
        Some(integrand) => Some(integrand),
        None => None,
    }
}
