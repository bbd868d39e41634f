//! Explicit pairs for non-stiff models: the method of higher order advances the solution; the
//! difference of the two methods controls the step size.

mod rounding;
mod stepper;

use crate::adaptive::engine::{Engine, MethodState};
use crate::adaptive::pairs::EmbeddedPair;
use crate::adaptive::point::ModelPoint;
use crate::adaptive::replay::{StepDifferentiator, StepRecord};
use crate::adaptive::step::{AcceptedStepOutput, AfterStep, Run, Span, Workspace};
use crate::adaptive::step_size::{ExplicitStep, PiController, first_step_size};
use crate::adaptive::tape::TapeEntry;
use crate::adaptive::tolerances::{Tolerances, norm, root_mean_square};
use crate::erk::Integrator as Erk;
use crate::error::{Error, Refusal};
use crate::integrator::Integrator as _;
use crate::memory::Heap;
use crate::model::{ArrayK, ArrayW, ArrayX, Dae, Ode, VectorX};
use crate::options::Options;
use crate::quadrature::OptionalIntegrand;
use crate::result::{Adjoint, Dense, Forward, Hessian, Nominal};
use crate::scalar::{Real, Scalar};
use crate::shape::{Matrix, Shape};
use crate::tableau::{DormandPrince5, DormandPrince8};
use alloc::boxed::Box;
use bytemuck::Zeroable;
use core::any::Any;
use core::marker::PhantomData;
use stepper::{ExplicitStepper, PairStepper};

/// Safety factor of the proposed tolerance if rounding errors limit the steps: the number of steps
/// is then inversely proportional to the tolerance, and the proposal needs half of `max_steps`.
const TOLERANCE_MARGIN: f64 = 2.0;

/// The method of an explicit pair with `S` stages.
pub struct Steps<M: Dae, B, T: Real, const S: usize> {
    stepper: Option<Box<dyn ExplicitStepper<M, T> + Send + Sync>>,
    /// The fixed-step integrator, which exists for explicit models only.
    fixed_step_integrator: Option<Box<dyn Any + Send + Sync>>,
    method: PhantomData<fn() -> B>,
}

impl<M: Dae, B, T: Real, const S: usize> Default for Steps<M, B, T, S> {
    fn default() -> Self {
        Self { stepper: None, fixed_step_integrator: None, method: PhantomData }
    }
}

impl<M: Ode, B: EmbeddedPair<S>, T: Real, const S: usize> Steps<M, B, T, S> {
    fn fixed_step_erk(&mut self) -> Result<&mut Erk<M, B, S, T, Heap>, Error> {
        if self.fixed_step_integrator.is_none() {
            let erk: Box<Erk<M, B, S, T, Heap>> = Box::new(Erk::new(Options::default())?);
            self.fixed_step_integrator = Some(erk);
        }
        // The model is explicit here, which the type system cannot express.
        let erk = self
            .fixed_step_integrator
            .as_mut()
            .and_then(|replay| replay.downcast_mut::<Erk<M, B, S, T, Heap>>());
        erk.ok_or(Error::NoResult)
    }

    /// Prepares the fixed-step integrator at the start of a step.
    fn prepare_replay(&mut self, step: &StepRecord<'_, M, T>) -> Result<&mut Erk<M, B, S, T, Heap>, Error> {
        let erk = self.fixed_step_erk()?;
        if M::Shape::NP > 0 {
            erk.set_parameters(step.start.p)?;
        }
        erk.set_time(step.start.t)?;
        Ok(erk)
    }
}

impl<M: Ode, B: EmbeddedPair<S>, T: Real, const S: usize> StepDifferentiator<M, T> for Steps<M, B, T, S> {
    fn solve(
        &mut self,
        step: &StepRecord<'_, M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Nominal<M, T>, Error> {
        self.prepare_replay(step)?.solve_with_quadrature(step.start.x, step.start.u, step.h, integrand)
    }

    fn forward(
        &mut self,
        step: &StepRecord<'_, M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Forward<M, T>, Error> {
        self.prepare_replay(step)?.forward_with_quadrature(step.start.x, step.start.u, step.h, integrand)
    }

    fn hessian(
        &mut self,
        step: &StepRecord<'_, M, T>,
        lambda: &VectorX<M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Hessian<M, T>, Error> {
        self.prepare_replay(step)?.hessian_with_quadrature(
            step.start.x,
            step.start.u,
            step.h,
            lambda,
            integrand,
        )
    }

    fn adjoint(
        &mut self,
        step: &StepRecord<'_, M, T>,
        lambda: &VectorX<M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Adjoint<M, T>, Error> {
        self.prepare_replay(step)?.adjoint_with_quadrature(
            step.start.x,
            step.start.u,
            step.h,
            lambda,
            integrand,
        )
    }

    fn slopes(&mut self, _: usize, weights: &[f64], to: &mut ArrayW<M, ArrayX<M, T>>) -> Result<(), Error> {
        self.fixed_step_erk()?.slopes(weights, to)
    }

    fn stages(&mut self, _: usize) -> Result<&[T], Error> {
        Ok(&[])
    }
}

impl<M: Ode, B: EmbeddedPair<S>, T: Real, const S: usize> Steps<M, B, T, S> {
    fn open(&mut self) -> Result<&mut (dyn ExplicitStepper<M, T> + Send + Sync), Error> {
        Ok(match &mut self.stepper {
            Some(engine) => &mut **engine,
            none => &mut **none.insert(Box::new(PairStepper::<M, B, T, S>::new()?)),
        })
    }

    /// Integrates the interval.
    fn integrate(
        &mut self,
        run: &mut Run<'_, M, T>,
        x0: &VectorX<M, T>,
        span: Span<T>,
        after: AfterStep<'_, M, T>,
    ) -> Result<(), Error> {
        run.write_start(x0, &ArrayK::<M, T>::zeroed(), span.start);
        run.begin_sensitivities(x0, span.start)?;
        let nx = M::Shape::NX;
        let step = self.open()?;
        step.go(run.workspace.point.as_ref(), x0.as_slice());
        let result = integrate_steps::<M, B, T, S>(step, run, span, after);
        run.statistics.residuals += step.take_evaluation_count();
        run.workspace.point.as_mut()[nx..2 * nx].copy_from_slice(match &result {
            Ok(end) => end.as_slice(),
            Err(_) => x0.as_slice(),
        });
        result?;
        run.write_result();
        Ok(())
    }
}

/// Takes the steps of an interval; returns the state at its end.
fn integrate_steps<M: Ode, B: EmbeddedPair<S>, T: Real, const S: usize>(
    step: &mut dyn ExplicitStepper<M, T>,
    run: &mut Run<'_, M, T>,
    span: Span<T>,
    after: AfterStep<'_, M, T>,
) -> Result<VectorX<M, T>, Error> {
    let nx = M::Shape::NX;
    let mut x = VectorX::<M, T>::zeroed();
    x.as_mut_slice().copy_from_slice(&run.workspace.point.as_ref()[nx..2 * nx]);
    let length = span.end - span.start;
    let direction = if length < T::ZERO { -1.0 } else { 1.0 };
    let longest = length.to_f64().abs().min(run.options.max_step);
    if length == T::ZERO {
        return Ok(x);
    }
    let rtol = run.workspace.tolerances.rtol.as_ref().iter().map(|rtol| rtol.to_f64());
    let unit = Scalar::powf(rtol.fold(0.0, f64::max), 1.0 / B::CONTROL.order);
    let mut t = span.start;
    let mut h =
        T::from_f64(direction * initial_step_size::<M, B, T, S>(step, run, &x, t, direction, longest)?);
    let mut controller = PiController::new(B::CONTROL);
    let mut refusal = Refusal::Error;
    let (mut rejected, mut tried) = (false, 0);
    loop {
        let last = ((t + h * T::from_f64(1.01) - span.end) * T::from_f64(direction)).to_f64() >= 0.0;
        if last {
            h = span.end - t;
        }
        if tried >= run.options.max_steps {
            return Err(too_many_steps(step, t, tried, (span.end - t) / h));
        }
        run.check_step_size(t, h, refusal)?;
        tried += 1;
        let most = B::GLOBAL_ERROR_FACTOR.evaluate((length / h).to_f64(), unit);
        let [error, of_derivatives] = attempt_step::<M, B, T, S>(step, run, &x, t, h, most);
        if !(error + of_derivatives).is_finite() {
            run.statistics.failed += 1;
            refusal = Refusal::NotFinite;
            h = h * T::from_f64(0.5);
            rejected = true;
            continue;
        }
        let taken = ExplicitStep {
            t: direction * t.to_f64(),
            h: h.to_f64().abs(),
            branch_change: step.branch_change(),
        };
        let error = controller.error_of_difference::<T>(taken, error).max(of_derivatives);
        let factor = controller.step_size_factor(taken, error);
        if error > 1.0 {
            run.statistics.rejected += 1;
            refusal = Refusal::Error;
            h = h * T::from_f64(factor.min(1.0));
            rejected = true;
            continue;
        }
        run.statistics.steps += 1;
        if let Some(sensitivities) = &mut run.sensitivities {
            sensitivities.accept_step();
        }
        if run.record_steps {
            run.tape.push(t, h, 0, x.as_slice(), &[])?;
        }
        let end = if last { span.end } else { t + h };
        let mut evaluate = |time: T, dense: &mut Dense<M, T>| step.interpolate(t, h, (time - t) / h, dense);
        let mut accepted = AcceptedStepOutput { evaluate_dense: &mut evaluate, end, stop: false };
        after(&mut accepted, &mut run.workspace.dense)?;
        if accepted.stop {
            return Ok(x);
        }
        x.as_mut_slice().copy_from_slice(step.end_state());
        step.move_to_end();
        t = end;
        if last {
            return Ok(x);
        }
        let mut next = (h.to_f64().abs() * factor).min(longest);
        if rejected {
            next = next.min(h.to_f64().abs());
        }
        rejected = false;
        h = T::from_f64(direction * next);
    }
}

/// The error of a run that exceeds its number of steps, with the length `left` in units of the
/// present step.
fn too_many_steps<M: Dae, T: Real>(step: &dyn ExplicitStepper<M, T>, t: T, steps: usize, left: T) -> Error {
    let needed = 1.0 + left.to_f64() / steps as f64;
    let rounding = step.is_limited_by_rounding().then_some(TOLERANCE_MARGIN * needed);
    Error::TooManySteps { t: t.to_f64(), steps, stiff: rounding.is_none() && step.is_stiff(), rounding }
}

/// Attempts a step from `x`: the estimated errors of the states and, if they are controlled, of the
/// sensitivities, relative to the tolerance. `most` limits the global error factor. NaN if there is
/// no estimate.
fn attempt_step<M: Ode, B: EmbeddedPair<S>, T: Real, const S: usize>(
    step: &mut dyn ExplicitStepper<M, T>,
    run: &mut Run<'_, M, T>,
    x: &VectorX<M, T>,
    t: T,
    h: T,
    most: f64,
) -> [f64; 2] {
    let error = step.take(t, h).and_then(|()| {
        let (rtol, atol) = (run.workspace.tolerances.rtol.as_ref(), run.workspace.tolerances.atol.as_ref());
        step.estimate_error(t, h, most, rtol, atol)
    });
    let error = error.unwrap_or(f64::NAN);
    match &mut run.sensitivities {
        Some(sensitivities) if error <= 1.0 => {
            let Workspace { point, u, parameters, tolerances: Tolerances { rtol, atol, .. }, .. } =
                &*run.workspace;
            let taken = StepRecord {
                start: ModelPoint { x, u, p: parameters, t },
                h,
                stage_unknowns: &[],
                order_index: 0,
                stages_are_solved: true,
            };
            let tolerances = rtol.as_ref().iter().copied().zip(atol.as_ref().iter().copied());
            let other =
                sensitivities.explicit_error::<B, S>(&taken, step.end_state(), point.as_ref(), tolerances);
            [error, other.unwrap_or(f64::NAN)]
        }
        _ => [error, 0.0],
    }
}

/// The size of the first step.
fn initial_step_size<M: Ode, B: EmbeddedPair<S>, T: Real, const S: usize>(
    step: &mut dyn ExplicitStepper<M, T>,
    run: &mut Run<'_, M, T>,
    x: &VectorX<M, T>,
    t: T,
    direction: f64,
    longest: f64,
) -> Result<f64, Error> {
    let mut slope = VectorX::<M, T>::zeroed();
    slope.as_mut_slice().copy_from_slice(step.slope(t)?);
    if let Some(given) = run.options.initial_step {
        return Ok(given.min(longest));
    }
    let mut scale = VectorX::<M, T>::zeroed();
    let Tolerances { rtol, atol, .. } = &run.workspace.tolerances;
    let tolerances = rtol.as_ref().iter().zip(atol.as_ref());
    for ((scale, (rtol, atol)), x) in scale.as_mut_slice().iter_mut().zip(tolerances).zip(x.as_slice()) {
        *scale = T::ONE / (*atol + *rtol * x.abs());
    }
    let scale = scale.as_slice();
    let (size, speed) = (norm(x.as_slice(), scale), norm(slope.as_slice(), scale));
    let length = first_step_size([size, speed], longest, 1.0 / B::CONTROL.order, |length| {
        let h = T::from_f64(direction * length);
        let mut other = *x;
        for (other, slope) in other.as_mut_slice().iter_mut().zip(slope.as_slice()) {
            *other = *other + h * *slope;
        }
        step.go(run.workspace.point.as_ref(), other.as_slice());
        let mut sum = 0.0;
        if let Ok(second) = step.slope(t + h) {
            for ((second, slope), scale) in second.iter().zip(slope.as_slice()).zip(scale) {
                let change = ((*second - *slope) * *scale).to_f64();
                sum += change * change;
            }
        }
        root_mean_square(sum, scale.len())
    });
    step.go(run.workspace.point.as_ref(), x.as_slice());
    step.slope(t)?;
    Ok(length)
}

macro_rules! explicit {
    ($($method:ty: $stages:literal),*) => {
        $(impl<M: Dae, T: Real> MethodState<M, T> for $method {
            type State = Steps<M, $method, T, $stages>;
        }

        impl<M: Ode, T: Real> Engine<M, T> for $method {
            const ENDS_ON_STAGE: bool = true;
            type Differentiator = Self::State;

            fn integrate(
                state: &mut Self::State,
                run: &mut Run<'_, M, T>,
                x0: &VectorX<M, T>,
                span: Span<T>,
                after: AfterStep<'_, M, T>,
            ) -> Result<(), Error> {
                state.integrate(run, x0, span, after)
            }

            fn interpolate(
                state: &mut Self::State,
                inputs: &[T],
                entry: &TapeEntry<T>,
                numbers: (&[T], &[T]),
                t: T,
                dense: &mut Dense<M, T>,
            ) -> Result<(), Error> {
                let step = state.open()?;
                step.go(inputs, numbers.0);
                step.slope(entry.t)?;
                step.take(entry.t, entry.h)?;
                step.arrive(entry.t, entry.h)?;
                step.interpolate(entry.t, entry.h, (t - entry.t) / entry.h, dense)
            }

            fn differentiator(state: &mut Self::State) -> &mut Self::Differentiator {
                state
            }
        })*
    };
}
explicit!(DormandPrince5: 6, DormandPrince8: 12);
