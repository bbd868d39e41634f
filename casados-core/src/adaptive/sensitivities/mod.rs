//! Sensitivities of a run: the exact derivatives of the accepted steps.
//!
//! ```text
//! x_{n+1} = Φ_n(x_n, u, p)        V_{n+1} = ∂Φ_n/∂x V_n + ∂Φ_n/∂(u, p)        λ_n = (∂Φ_n/∂x)ᵀ λ_{n+1}
//! d²(λᵀ x_N)/dw² = Σ_n D_nᵀ ∇²(λ_{n+1}ᵀ Φ_n) D_n        D_n = d(x_n, u, p)/dw
//! ```
//!
//! An integrand takes part in each step: forward with the derivatives of its stages with respect to
//! `(x₀, u, p)`, backward through `λ_n`.

mod step_errors;

use step_errors::with_step_number;

use crate::adaptive::consistent::Consistent;
use crate::adaptive::engine::Engine;
use crate::adaptive::point::ModelPoint;
use crate::adaptive::replay::{StepDifferentiator, StepRecord};
use crate::adaptive::step::{Span, Workspace};
use crate::adaptive::tape::Tape;
use crate::error::Error;
use crate::finite::{check_forward, check_output};
use crate::integrator::chain_rule::{
    FullHessian, StateSensitivities, add_congruence, chain_states, hessian_element, set_identity,
    write_algebraic, write_blocks, write_states,
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
pub struct SensitivityMemory<M: Dae, T: Plain> {
    pub hessian: Hessian<M, T>,
    pub adjoint: Adjoint<M, T>,
    /// `V_n` and `V_{n+1}`.
    step_sensitivities: [StateSensitivities<M, T>; 2],
    lambda: VectorX<M, T>,
    /// The sum of the gradients of all steps.
    gradient_sum: ArrayW<M, T>,
    /// The Hessian of one step times `D`, and the sum over all steps.
    hessian_product: FullHessian<M, T>,
    hessian_sum: FullHessian<M, T>,
}

/// The recorded steps to be differentiated.
pub struct RecordedSteps<'a, M: Dae, T: Real> {
    pub workspace: &'a mut Workspace<M, T>,
    pub consistent: &'a mut Consistent<M, T>,
    pub tape: &'a mut Tape<T>,
    pub span: Span<T>,
    /// Initial guess of `(ẋ, z)`.
    pub start_guess: ArrayK<M, T>,
    /// Whether the steps were chosen for these inputs: each is then replayed from the accepted
    /// state. A sequence of steps solved to rounding deviates from steps solved to a coarse
    /// tolerance if errors are amplified, and the accepted stages would not fit.
    pub steps_were_chosen: bool,
}

impl<M: Dae, T: Real> RecordedSteps<'_, M, T> {
    /// Replays all steps, solved to rounding; `each` replays one step and returns its solution.
    fn replay_steps<B: Engine<M, T>>(
        &mut self,
        state: &mut B::State,
        x0: &VectorX<M, T>,
        mut each: impl FnMut(
            &mut B::Differentiator,
            &StepRecord<'_, M, T>,
            usize,
        ) -> Result<(VectorX<M, T>, VectorZ<M, T>), Error>,
    ) -> Result<(), Error> {
        let mut x = *x0;
        let Workspace { u, parameters, result, start, .. } = &mut *self.workspace;
        *start = self.start_guess;
        let at = ModelPoint { x: x0, u, p: parameters, t: self.span.start };
        if M::Shape::NZ > 0 {
            self.consistent.solve_with_diagnosis(&at, start)?;
        }
        result.z0.as_mut_slice().copy_from_slice(&start.as_ref()[M::Shape::NX..]);
        (result.x, result.z) = (*x0, result.z0);
        self.tape.begin_replay();
        for step in 0..self.tape.entries().len() {
            let Some(entry) = self.tape.entries().get(step).copied() else { break };
            let replays = B::differentiator(state);
            let (start, y) = self.tape.step_numbers(step, M::Shape::NX);
            if self.steps_were_chosen {
                for (x, start) in x.as_mut_slice().iter_mut().zip(start) {
                    *x = *start;
                }
            }
            let at = ModelPoint { x: &x, u, p: parameters, t: entry.t };
            let taken = StepRecord {
                start: at,
                h: entry.h,
                stage_unknowns: y,
                order_index: entry.order_index,
                stages_are_solved: self.steps_were_chosen,
            };
            let (end, z) = each(replays, &taken, step).map_err(|error| with_step_number(error, step))?;
            self.tape.write_replayed_step(x.as_slice(), replays.stages(entry.order_index)?)?;
            (x, result.z) = (end, z);
            result.x = x;
        }
        self.tape.commit_replay();
        if !B::ENDS_ON_STAGE && M::Shape::NZ > 0 {
            let y = self.consistent_end()?;
            self.workspace.result.z.as_mut_slice().copy_from_slice(&y.as_ref()[M::Shape::NX..]);
        }
        Ok(())
    }

    /// Consistent `(ẋ, z)` at the end, from the last stage and the present `z`.
    fn consistent_end(&mut self) -> Result<ArrayK<M, T>, Error> {
        let (nx, Workspace { u, parameters, result, .. }) = (M::Shape::NX, &mut *self.workspace);
        let mut guess = ArrayK::<M, T>::zeroed();
        let (states, algebraic) = guess.as_mut().split_at_mut(nx);
        let (_, y) = self.tape.step_numbers(self.tape.entries().len().saturating_sub(1), nx);
        let stages = (y.len() / M::Shape::NK.max(1)).max(1);
        for (to, k) in states.iter_mut().zip(y.chunks_exact(stages)) {
            *to = k.last().copied().unwrap_or(T::ZERO);
        }
        algebraic.copy_from_slice(result.z.as_slice());
        let x = result.x;
        self.consistent.solve(&ModelPoint { x: &x, u, p: parameters, t: self.span.end }, &mut guess)?;
        Ok(guess)
    }

    /// Computes the solution.
    ///
    /// # Errors
    /// Those of Newton's method.
    pub fn solve<B: Engine<M, T>>(
        &mut self,
        state: &mut B::State,
        x0: &VectorX<M, T>,
        mut integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<(), Error> {
        reset_integrand(&mut integrand);
        self.replay_steps::<B>(state, x0, |replays, taken, _| {
            let mut chained = chain_rule_integrand(&mut integrand, None, false);
            let nominal = replays.solve(taken, dyn_integrand(&mut chained))?;
            Ok((nominal.x, nominal.z))
        })?;
        finish_integrand(&mut integrand)
    }

    /// Computes the solution and its derivatives; `history` receives `V_n` of each step, if given.
    ///
    /// # Errors
    /// Those of Newton's method; a singular matrix; [`Error::Overflow`].
    pub fn forward<B: Engine<M, T>>(
        &mut self,
        state: &mut B::State,
        x0: &VectorX<M, T>,
        memory: &mut SensitivityMemory<M, T>,
        mut history: Option<&mut Vec<T>>,
        mut integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<(), Error> {
        reset_integrand(&mut integrand);
        let second = history.is_some();
        let SensitivityMemory { step_sensitivities: [v, next], hessian, .. } = memory;
        let result = &mut hessian.first.forward;
        set_identity::<M, T>(v);
        let count = self.tape.entries().len();
        self.replay_steps::<B>(state, x0, |replays, taken, step| {
            if let Some(history) = &mut history {
                extend(history, ArrayW::<M, T>::flat(v.as_ref()))?;
            }
            let mut chained = chain_rule_integrand(&mut integrand, Some(v), second);
            let forward = replays.forward(taken, dyn_integrand(&mut chained))?;
            chain_states(forward, v, next);
            if step + 1 == count && B::ENDS_ON_STAGE {
                write_algebraic(forward, v, result);
            }
            *v = *next;
            Ok((forward.nominal.x, forward.nominal.z))
        })?;
        write_states(v, result);
        if const { !B::ENDS_ON_STAGE && M::Shape::NZ > 0 } {
            let y = self.consistent_end()?;
            let (x, Workspace { u, parameters, .. }) = (self.workspace.result.x, &mut *self.workspace);
            let at = ModelPoint { x: &x, u, p: parameters, t: self.span.end };
            write_algebraic(self.consistent.forward(&at, &y)?, v, result);
        }
        if const { M::Shape::NZ > 0 } {
            let Workspace { u, parameters, start, .. } = &mut *self.workspace;
            let at = ModelPoint { x: x0, u, p: parameters, t: self.span.start };
            let forward = self.consistent.forward(&at, start)?;
            (result.dz0_dx0, result.dz0_du, result.dz0_dp) = (forward.dz_dx0, forward.dz_du, forward.dz_dp);
            if count == 0 {
                (result.dz_dx0, result.dz_du, result.dz_dp) = (forward.dz_dx0, forward.dz_du, forward.dz_dp);
            }
        }
        result.nominal = self.workspace.result;
        finish_integrand(&mut integrand)?;
        check_forward(result, count)
    }

    /// Computes the gradient of `λᵀx` after the solution, by a backward sweep over the steps.
    ///
    /// # Errors
    /// Those of Newton's method; a singular matrix; [`Error::Overflow`].
    pub fn adjoint<B: Engine<M, T>>(
        &mut self,
        state: &mut B::State,
        lambda: &VectorX<M, T>,
        memory: &mut SensitivityMemory<M, T>,
        mut along: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<(), Error> {
        let (nx, nu) = (M::Shape::NX, M::Shape::NU);
        let SensitivityMemory { lambda: now, gradient_sum: gradient, adjoint, .. } = memory;
        *now = *lambda;
        gradient.as_mut().fill(T::ZERO);
        let Workspace { u, parameters, result, .. } = &mut *self.workspace;
        for (step, entry) in self.tape.entries().iter().enumerate().rev() {
            let (states, y) = self.tape.step_numbers(step, nx);
            let mut x = VectorX::<M, T>::zeroed();
            x.as_mut_slice().copy_from_slice(states);
            let at = ModelPoint { x: &x, u, p: parameters, t: entry.t };
            let taken = StepRecord {
                start: at,
                h: entry.h,
                stage_unknowns: y,
                order_index: entry.order_index,
                stages_are_solved: true,
            };
            let mut backwards = along.as_mut().map(|integrand| AdjointOnlyIntegrand(&mut **integrand));
            let local = B::differentiator(state).adjoint(&taken, now, dyn_integrand(&mut backwards));
            let local = local.map_err(|error| with_step_number(error, step))?;
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

    /// Computes the gradient and the Hessian of `λᵀx`, after [`RecordedSteps::forward`] with its
    /// history.
    ///
    /// # Errors
    /// Those of Newton's method; a singular matrix; a second derivative that is not finite;
    /// [`Error::Overflow`].
    pub fn hessian<B: Engine<M, T>>(
        &mut self,
        state: &mut B::State,
        lambda: &VectorX<M, T>,
        memory: &mut SensitivityMemory<M, T>,
        history: &[T],
        mut along: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<(), Error> {
        let (nx, nu, np, nw) = (M::Shape::NX, M::Shape::NU, M::Shape::NP, M::Shape::NW);
        let SensitivityMemory {
            lambda: now,
            gradient_sum: gradient,
            hessian,
            hessian_product: product,
            hessian_sum: sum,
            ..
        } = memory;
        *now = *lambda;
        gradient.as_mut().fill(T::ZERO);
        for row in sum.as_mut() {
            row.as_mut().fill(T::ZERO);
        }
        let Workspace { u, parameters, .. } = &mut *self.workspace;
        for (step, entry) in self.tape.entries().iter().enumerate().rev() {
            let (states, y) = self.tape.step_numbers(step, nx);
            let mut x = VectorX::<M, T>::zeroed();
            x.as_mut_slice().copy_from_slice(states);
            let at = ModelPoint { x: &x, u, p: parameters, t: entry.t };
            let taken = StepRecord {
                start: at,
                h: entry.h,
                stage_unknowns: y,
                order_index: entry.order_index,
                stages_are_solved: true,
            };
            let mut backwards = along.as_mut().map(|integrand| AdjointOnlyIntegrand(&mut **integrand));
            let second = B::differentiator(state).hessian(&taken, now, dyn_integrand(&mut backwards));
            let second = second.map_err(|error| with_step_number(error, step))?;
            *now = second.first.grad_x0;
            let parts = second.first.grad_u.as_slice().iter().chain(second.first.grad_p.as_slice());
            for (sum, part) in gradient.as_mut()[nx..].iter_mut().zip(parts) {
                *sum = *sum + *part;
            }
            let v = history.get(step * nx * nw..).unwrap_or_default();
            add_congruence::<M, T>(|r, c| hessian_element(second, r, c), v, [product, sum]);
        }
        if let Some(second) = along.as_ref().and_then(|integrand| integrand.hessian_sum()) {
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

/// The integrand of a step in an interval, or in one of several intervals.
pub(super) fn chain_rule_integrand<'a, M: Dae, T: Real>(
    integrand: &'a mut OptionalIntegrand<'_, '_, M, T>,
    v: Option<&'a StateSensitivities<M, T>>,
    second: bool,
) -> Option<ChainRuleIntegrand<'a, M, T>> {
    integrand.as_mut().map(|inner| ChainRuleIntegrand { inner: &mut **inner, v, with_hessian: second })
}

pub(super) fn dyn_integrand<'a, M: Dae, T: Real, Q: Integrand<M, T> + 'a>(
    integrand: &'a mut Option<Q>,
) -> OptionalIntegrand<'a, 'a, M, T> {
    match integrand {
        Some(integrand) => Some(integrand),
        None => None,
    }
}
