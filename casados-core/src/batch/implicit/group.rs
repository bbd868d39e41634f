//! Groups of intervals for implicit methods: one interval in each SIMD lane, computed by the engine
//! of a single interval.
//!
//! Every lane has its own convergence status and its own check of derivatives. Lanes do not mix, so
//! that a failing lane does not affect the others.

use crate::batch::intervals::Interval;
use crate::batch::lanes::{MAX_LANES, MaskedResult, Unpack, all_lanes_true, pack};
use crate::batch::single::{self, gather};
use crate::error::Error;
use crate::irk::{
    self, AdjointMemory, Coefficients, ForwardMemory, HessianMemory, HessianStep, InitialGuess,
    Linearization, StageEquations, StageWorkspace, Step, StepIndex, gradient_product,
};
use crate::linalg::dispatch;
use crate::memory::{Heap, Memory, WithForward, WithHessian, fallback::Pivoting};
use crate::model::{ArrayK, ArrayX, Dae, VectorZ};
use crate::options::{Options, Start};
use crate::result::{Adjoint, Forward, ForwardAdjoint, Hessian, Nominal};
use crate::scalar::{Lanes, Real};
use crate::shape::{Matrix, Shape};
use crate::statistics::Statistics;
use crate::tableau::Tableau;
use core::slice::{from_mut, from_ref};

type CallStorage<V> = <Heap as Memory>::Nominal<V>;
type TapeStorage<V> = <Heap as Memory>::Tape<V>;

/// A group of intervals and its memory.
pub struct Group<M: Dae, E: Lanes, const S: usize> {
    options: Options,
    coefficients: Coefficients<E, S>,
    statistics: Statistics,
    work: CallStorage<StageWorkspace<M, E, S>>,
    steps: TapeStorage<Step<M, E, S>>,
    /// Whether the user gave start values.
    given: bool,
    /// The stages of a warm start, or of solutions.
    record: TapeStorage<Step<M, E, S>>,
    /// Whether all lanes have stages of earlier calls; `solved` is whether these are solutions.
    warm: bool,
    solved: bool,
    lambda: CallStorage<ArrayX<M, E>>,
    /// Weights of the initial algebraic states; valid if `has_nu`.
    nu: CallStorage<VectorZ<M, E>>,
    has_nu: bool,
    forward: CallStorage<ForwardMemory<M, E, S>>,
    adjoint: CallStorage<AdjointMemory<M, E, S, 1>>,
    hessian: CallStorage<HessianMemory<M, E, S>>,
    tape: TapeStorage<HessianStep<M, E, S>>,
}

/// The data of a pass over the steps.
struct StepPass<'a, M: Dae, E: Lanes, const S: usize> {
    options: &'a Options,
    coefficients: &'a Coefficients<E, S>,
    statistics: &'a mut Statistics,
    work: &'a mut StageWorkspace<M, E, S>,
    steps: &'a mut [Step<M, E, S>],
    from: InitialGuess<'a, M, E, S>,
}

/// Borrows the data of a pass.
macro_rules! pass {
    ($group:ident) => {{
        $group.statistics = Statistics::default();
        let count = $group.options.steps;
        let from = match $group.options.start {
            _ if $group.solved => InitialGuess::Solution(<Heap>::tape(&mut $group.record, count)?),
            Start::Warm if $group.warm => InitialGuess::Previous(<Heap>::tape(&mut $group.record, count)?),
            Start::Zero => InitialGuess::Zero,
            _ if $group.given => InitialGuess::Given,
            _ => InitialGuess::Nominal,
        };
        StepPass {
            options: &$group.options,
            coefficients: &$group.coefficients,
            statistics: &mut $group.statistics,
            work: <Heap>::nominal(&mut $group.work)?,
            steps: <Heap>::tape(&mut $group.steps, count)?,
            from,
        }
    }};
}
impl<M: Dae, E: Lanes, const S: usize> Group<M, E, S> {
    fn differentiate(&mut self, adjoint: bool) -> MaskedResult<'_, E, ForwardAdjoint<M, E>> {
        let mut step_pass = pass!(self);
        let ForwardMemory { result, pass: forward, .. } = <Heap>::forward(&mut self.forward)?;
        let count = step_pass.steps.len();
        let converged = step_pass.integrate(&mut [], |pass, n, step, exact, _| {
            pass.linearize(None, n, step, exact);
            forward.differentiate_step(
                pass.work,
                None,
                pass.coefficients,
                StepIndex { n, count, prefetch_output: false },
                None,
                &mut result.forward,
            )
        });
        let converged = E::and(
            converged,
            forward.finish_unchecked::<Pivoting>(&step_pass.work.result, &mut result.forward).is_finite(),
        );
        if adjoint {
            gradient_product(result, <Heap>::nominal(&mut self.lambda)?.as_ref());
        }
        Ok((converged, result))
    }
}

impl<M: Dae, B, T: Real, E: Lanes<Cell: AsRef<[T]> + AsMut<[T]>>, const S: usize>
    single::Group<irk::Integrator<M, B, S, T, Heap>, E> for Group<M, E, S>
{
    fn new(options: &Options, tableau: &Tableau<S>) -> Self {
        Self {
            options: *options,
            coefficients: Coefficients::new(*tableau, true),
            statistics: Statistics::default(),
            work: Default::default(),
            steps: Default::default(),
            given: false,
            record: Default::default(),
            warm: false,
            solved: false,
            lambda: Default::default(),
            nu: Default::default(),
            has_nu: false,
            forward: Default::default(),
            adjoint: Default::default(),
            hessian: Default::default(),
            tape: Default::default(),
        }
    }

    fn load_intervals(
        &mut self,
        intervals: &[&Interval<'_, M, T>],
        given: Option<[&[T]; 2]>,
        stages: Option<&[&[ArrayK<M, [T; S]>]; MAX_LANES]>,
        solved: bool,
    ) -> Result<(), Error> {
        let count = self.options.steps;
        let work = <Heap>::nominal(&mut self.work)?;
        work.write_constants();
        let time = &mut work.inputs.time;
        gather(intervals, work.x.as_mut(), |interval| interval.x0.as_slice());
        gather(intervals, work.inputs.u.as_mut_slice(), |interval| interval.u);
        gather(intervals, work.inputs.p.as_mut_slice(), |interval| interval.p);
        gather(intervals, from_mut(&mut time.interval), |interval| from_ref(&interval.h));
        gather(intervals, from_mut(&mut time.start), |interval| from_ref(&interval.t0));
        time.step = time.interval / E::from_f64(count as f64);
        self.given = given.is_some();
        let (xdot, z) = work.start_values.as_mut().split_at_mut(M::Shape::NX);
        for (given, to) in given.iter().flatten().zip([xdot, z]) {
            pack(&[*given; MAX_LANES], to);
        }
        gather(intervals, <Heap>::nominal(&mut self.lambda)?.as_mut(), |interval| interval.lambda);
        // Either all intervals have weights, or none.
        self.has_nu = intervals.iter().all(|interval| !interval.nu.is_empty());
        if self.has_nu {
            gather(intervals, <Heap>::nominal(&mut self.nu)?.as_mut_slice(), |interval| interval.nu);
        }
        <Heap>::tape(&mut self.steps, count)?;
        (self.warm, self.solved) = (stages.is_some(), stages.is_some() && solved);
        let Some(stages) = stages else { return Ok(()) };
        for (n, step) in <Heap>::tape(&mut self.record, count)?.iter_mut().enumerate() {
            let initial_guess =
                stages.map(|stages| stages.get(n).map_or(&[][..], |y| y.as_ref().as_flattened()));
            pack(&initial_guess, step.y.as_mut().as_flattened_mut());
        }
        Ok(())
    }

    fn copy_stages(&mut self, lane: usize, stages: &mut [ArrayK<M, [T; S]>]) -> Result<(), Error> {
        for (y, step) in stages.iter_mut().zip(<Heap>::tape(&mut self.steps, self.options.steps)?) {
            let mut to: [&mut [T]; MAX_LANES] = Default::default();
            if let Some(to) = to.get_mut(lane) {
                *to = y.as_mut().as_flattened_mut();
            }
            dispatch(Unpack { from: step.y.as_ref().as_flattened(), to: &mut to });
        }
        Ok(())
    }

    fn statistics(&self) -> Statistics {
        self.statistics
    }

    fn solve(&mut self) -> MaskedResult<'_, E, Nominal<M, E>> {
        let mut step_pass = pass!(self);
        let converged = step_pass.integrate(&mut [], |_, _, _, _, _| all_lanes_true::<E>());
        Ok((converged, &step_pass.work.result))
    }

    fn forward(&mut self) -> MaskedResult<'_, E, Forward<M, E>> {
        let (converged, result) = self.differentiate(false)?;
        Ok((converged, &result.forward))
    }

    fn forward_adjoint(&mut self) -> MaskedResult<'_, E, ForwardAdjoint<M, E>> {
        self.differentiate(true)
    }

    fn adjoint(&mut self) -> MaskedResult<'_, E, Adjoint<M, E>> {
        let mut step_pass = pass!(self);
        let adjoint = <Heap>::nominal(&mut self.adjoint)?;
        let lambda = <Heap>::nominal(&mut self.lambda)?;
        let count = step_pass.steps.len();
        // The forward pass linearises only the last step, where the backward pass begins.
        let mut converged = step_pass.integrate(&mut [], |pass, n, step, exact, _| {
            if n + 1 == count {
                pass.linearize(None, n, step, exact);
            }
            all_lanes_true::<E>()
        });
        adjoint.backward.set_seeds(lambda.as_ref(), &[]);
        let StepPass { steps, coefficients, work, statistics, .. } = step_pass;
        for (n, step) in steps.iter().enumerate().rev() {
            if n + 1 < count {
                work.linearize_planned(coefficients, None, n, step, false, statistics);
            }
            converged = E::and(converged, adjoint.backward.solve_and_verify(work, None, coefficients));
            adjoint.backward.advance(&work.linearization);
        }
        adjoint.write_result(work);
        Ok((converged, &adjoint.result))
    }

    fn hessian(&mut self) -> MaskedResult<'_, E, Hessian<M, E>> {
        let mut step_pass = pass!(self);
        let forward = &mut <Heap>::forward(&mut self.forward)?.pass;
        let HessianMemory { result, pass: hessian } = <Heap>::hessian(&mut self.hessian)?;
        let lambda = <Heap>::nominal(&mut self.lambda)?;
        let nu = if self.has_nu { <Heap>::nominal(&mut self.nu)?.as_slice() } else { &[] };
        let count = step_pass.steps.len();
        let records = <Heap>::hessian_tape(&mut self.tape, count)?;
        let mut converged = step_pass.integrate(records, |pass, n, step, exact, record| {
            let Some(record) = record else { return all_lanes_true::<E>() };
            let at = StepIndex { n, count, prefetch_output: false };
            let last = at.is_last();
            let (linear, _) = record.linearization_and_rows();
            pass.linearize(
                (HessianStep::<M, E, S>::FACTORS_ON_TAPE && !last).then_some(linear),
                n,
                step,
                exact,
            );
            // The backward pass finds the linearisation of the last step in the workspace.
            if !(HessianStep::<M, E, S>::FACTORS_ON_TAPE || last) {
                record.store_linearization(pass.work);
            }
            let (linear, curved) = record.linearization_and_rows();
            let stored_linearization = (!last).then_some(&*linear);
            let to = &mut result.first.forward;
            forward.differentiate_step(
                pass.work,
                stored_linearization,
                pass.coefficients,
                at,
                Some(curved),
                to,
            )
        });
        let finite = forward.finish_unchecked::<Pivoting>(&step_pass.work.result, &mut result.first.forward);
        let StepPass { steps, coefficients, work, .. } = step_pass;
        hessian.set_seeds(lambda.as_ref(), nu);
        for (n, (step, record)) in steps.iter().zip(records).enumerate().rev() {
            let stored_linearization = record.stored_linearization(n + 1 == count);
            if n == 0 {
                hessian.backward.add_z0_weights(coefficients);
            }
            converged = E::and(
                converged,
                hessian.backward.solve_and_verify(work, stored_linearization, coefficients),
            );
            hessian.backward.advance(work.linearization(stored_linearization));
            hessian.evaluate_hessian_entries(work, coefficients, n, step);
            hessian.subtract_congruence(work, stored_linearization, coefficients, record, [n, count], &[]);
        }
        let finite = hessian.write_result::<Pivoting>(None, result) + finite;
        Ok((E::and(converged, finite.is_finite()), result))
    }
}

impl<M: Dae, E: Lanes, const S: usize> StepPass<'_, M, E, S> {
    /// Integrates over the steps of the interval; calls `after_step` after each, with its record if
    /// there is one. Returns the lanes in which all steps succeeded.
    fn integrate(
        &mut self,
        records: &mut [HessianStep<M, E, S>],
        mut after_step: impl FnMut(
            &mut StepPass<'_, M, E, S>,
            usize,
            &Step<M, E, S>,
            bool,
            Option<&mut HessianStep<M, E, S>>,
        ) -> E::Mask,
    ) -> E::Mask {
        self.work.begin_call();
        let (mut converged, count) = (all_lanes_true::<E>(), self.steps.len());
        for n in 0..count {
            let Self { options, coefficients, statistics, work, steps, from } = self;
            let (earlier_steps, rest) = steps.split_at_mut(n);
            let (previous_step, Some(step)) = (earlier_steps.last(), rest.first_mut()) else { break };
            step.x = work.x;
            work.set_initial_guess(coefficients, from, n, previous_step, &mut step.y);
            let Step { x, y } = &mut *step;
            let (earlier_records, record) = records.split_at_mut_checked(n).unwrap_or_default();
            let stored_linearization =
                if HessianStep::<M, E, S>::FACTORS_ON_TAPE { earlier_records.last() } else { None };
            let stored_linearization =
                stored_linearization.and_then(|record| record.stored_linearization(false));
            let equations = StageEquations { coefficients, stored_linearization, n, x };
            let mut factors_at_solution = false;
            if !matches!(from, InitialGuess::Solution(_)) {
                let mut newton_result = work.newton(equations, options, y, statistics);
                if newton_result.needs_restart {
                    work.set_initial_guess(coefficients, from, n, previous_step, y);
                    newton_result = work.newton(equations, options, y, statistics);
                }
                converged = E::and(converged, newton_result.converged);
                factors_at_solution = newton_result.factors_at_solution;
            }
            work.advance(coefficients, options.compensated, step, n, count);
            let mut step_pass = StepPass {
                options,
                coefficients,
                statistics,
                work,
                steps: &mut [],
                from: InitialGuess::Zero,
            };
            converged = E::and(
                converged,
                after_step(&mut step_pass, n, step, factors_at_solution, record.first_mut()),
            );
            self.statistics.steps += 1;
        }
        converged
    }

    fn linearize(
        &mut self,
        to: Option<&mut Linearization<M, E, S>>,
        n: usize,
        step: &Step<M, E, S>,
        factors_at_solution: bool,
    ) {
        self.work.linearize_planned(self.coefficients, to, n, step, factors_at_solution, self.statistics);
    }
}
