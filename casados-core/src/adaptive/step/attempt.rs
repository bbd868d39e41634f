//! The parts of a step: its stages, its matrix, its attempt, and what follows when it is accepted.

use super::*;
use crate::adaptive::discontinuity::{BranchChange, Branches};
use crate::adaptive::newton_monitor::Convergence;

/// The estimate of a step in which the highest derivative of a spline jumps is about so many times
/// its error.
const OVER_SPLINE_KNOT: f64 = 3.0;
/// Where the model changes its branch the error is held below the tolerance that was asked for by
/// this: there may be many such steps, and what follows makes more of them.
const OVER_SWITCH: f64 = 6.0;
/// Rounding errors are like jumps: these are looked for where the least error that counts is so
/// many times as large, of `f64` with relative tolerances of 3e-11 and more.
const ABOVE_NOISE: f64 = 1e4;
/// What follows a rough step may be shorter by this and still be a step.
const SHORTEST_AFTER_ROUGH: f64 = 0.01;

impl<M: Dae, T: Real> Run<'_, M, T> {
    /// Changes the number of stages where a new matrix is needed anyway, and sets the start values
    /// of the iteration.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub(super) fn choose_stages<B: Family>(
        &mut self,
        levels: &mut Orders<M, T>,
        state: &mut StepState<T>,
    ) -> Result<(), Error> {
        let ratio = state.accepted.map(|before| (state.h / before).to_f64());
        if state.need >= Need::Factors {
            let level = state.order.level;
            let next = state.order.next(&state.convergence, ratio.unwrap_or(1.0), B::LEVELS);
            if next != level {
                levels.change::<B>(level, next)?;
                state.order.change(next);
                state.controller.forget();
                self.tighten::<B>(levels.get::<B>(next)?.count());
            }
        }
        let stages = levels.get::<B>(state.order.level)?;
        match ratio {
            // The polynomial of the last step may be that of another branch.
            Some(ratio) if M::BRANCHES == 0 || !state.is_unsolved() => {
                stages.continue_from_last(ratio);
            }
            _ => stages.begin(&self.base.point),
        }
        Ok(())
    }

    /// The factors of the matrix of a step as far as they are needed; whether the step can be
    /// tried.
    ///
    /// # Errors
    /// A Jacobian that is not finite; matrices that stay singular.
    pub(super) fn factor<B: Family>(
        &mut self,
        stages: &mut dyn Stages<M, T>,
        state: &mut StepState<T>,
    ) -> Result<bool, Error> {
        if state.need == Need::Jacobian {
            self.linearise(stages, state)?;
        }
        if state.need < Need::Factors {
            return Ok(!state.keeps_matrix(B::LEVELS));
        }
        let mut factored = self.factor_with(stages, state);
        if state.verifies_pivots && !state.pivoted && !stages.factors_hold(&self.base.step(state)) {
            state.pivoted = true;
            factored = self.factor_with(stages, state);
        }
        match factored {
            Ok(planned) => {
                state.singular = 0;
                self.statistics.dense += usize::from(!planned);
                Ok(true)
            }
            Err(unknown) => {
                state.singular += 1;
                if state.singular >= SINGULAR {
                    let at = Place { step: state.tried, stage: 0, iteration: 0 };
                    return Err(Error::Singular { unknown: crate::irk::unknown_name::<M>(unknown), at });
                }
                self.statistics.failed += 1;
                state.refusal = Refusal::Singular;
                state.order.unexpected = true;
                state.again(0.5);
                self.check_step(state.t, state.h, state.refusal)?;
                Ok(false)
            }
        }
    }

    /// Factors by the plan, or with pivots.
    fn factor_with(&mut self, stages: &mut dyn Stages<M, T>, state: &StepState<T>) -> Result<bool, usize> {
        stages.set_pivoted(state.pivoted);
        self.statistics.factorizations += 1;
        stages.factor(&self.base.jacobian, state.h)
    }

    /// Whether an attempt failed because the planned elimination lost its digits: its pivots are
    /// judged before the program runs, and may vanish where it leads. Then the matrix is pivoted,
    /// and the same step is tried again; the factors of later steps are tested before they are
    /// used.
    pub(super) fn blames_pivots(
        &mut self,
        stages: &dyn Stages<M, T>,
        state: &mut StepState<T>,
        attempt: &Result<f64, Failure>,
    ) -> bool {
        let may_be = match attempt {
            Ok(error) => *error >= 1.0,
            Err(failure) => matches!(failure, Failure::Slow(_) | Failure::Diverges | Failure::NotFinite),
        };
        if !may_be || state.pivoted || stages.factors_hold(&self.base.step(state)) {
            return false;
        }
        self.statistics.failed += 1;
        (state.pivoted, state.verifies_pivots) = (true, true);
        state.need = Need::Factors;
        // The rate of this iteration says nothing of the next one.
        (state.convergence.rate, state.convergence.factor) = (THET, Convergence::UNKNOWN);
        true
    }

    /// The Jacobian in the middle of the step, as far as that is foreseen: nearer to all stages
    /// than the start is. Where the step fails, at the start.
    ///
    /// # Errors
    /// A value that is not finite.
    fn linearise(&mut self, stages: &mut dyn Stages<M, T>, state: &mut StepState<T>) -> Result<(), Error> {
        state.current = state.is_careful();
        state.convergence.fresh = true;
        if !state.current {
            let mut middle = self.base.middle;
            stages.predict(&self.base.step(state), &mut middle);
            self.base.middle = middle;
            state.current = self.evaluate_jacobian(true, state.tried).is_err();
        }
        if state.current {
            self.evaluate_jacobian(false, state.tried)?;
        }
        let point = if state.current { &self.base.point } else { &self.base.middle };
        state.convergence.branches = Branches::of::<M, T>(point);
        Ok(())
    }

    /// Solves the stages: the estimated error relative to what is tolerated, of derivatives too if
    /// they take part.
    ///
    /// # Errors
    /// [`Failure`]
    pub(super) fn attempt(
        &mut self,
        stages: &mut dyn Stages<M, T>,
        state: &mut StepState<T>,
    ) -> Result<f64, Failure> {
        let Workspace { point, u, parameters, tolerances, .. } = &*self.base;
        let start = self.base.step(state);
        let residuals = &mut self.statistics.residuals;
        let solved = stages.solve(&start, tolerances.newton, &mut state.convergence, residuals);
        self.statistics.iterations += state.convergence.iterations;
        solved?;
        let again = state.is_careful();
        let error = stages.error(&start, again, residuals)?;
        if !error.is_finite() {
            return Err(Failure::Diverges);
        }
        let error = match &mut self.sensitivities {
            Some(sensitivities) if error < 1.0 => {
                let mut x = VectorX::<M, T>::zeroed();
                x.as_mut_slice().copy_from_slice(&point.as_ref()[M::Shape::NX..2 * M::Shape::NX]);
                let (at, level) = (At { x: &x, u, p: parameters, t: state.t }, state.order.level);
                error.max(sensitivities.implicit(stages, at, level, &start, tolerances, again)?)
            }
            _ => error,
        };
        if error < 1.0 {
            self.refuse_over_branches(stages, state, error)?;
        }
        Ok(error)
    }

    /// Refuses a step in which the model changes its branch where its error would be above the
    /// tolerance that was asked for.
    ///
    /// # Errors
    /// [`Failure::Rough`], and a value that is not finite.
    fn refuse_over_branches(
        &mut self,
        stages: &mut dyn Stages<M, T>,
        state: &StepState<T>,
        error: f64,
    ) -> Result<(), Failure> {
        let start = self.base.step(state);
        let Tolerances { tolerance_ratio, noise, .. } = &self.base.tolerances;
        let over_knot = *tolerance_ratio / OVER_SPLINE_KNOT;
        let Some(change) = stages.change(&start) else { return Ok(()) };
        if ABOVE_NOISE * *noise * over_knot > 1.0 {
            return Ok(());
        }
        let factor = match change {
            BranchChange::Switch => OVER_SWITCH * *tolerance_ratio,
            BranchChange::SplineKnot => over_knot,
        };
        let rough = factor * stages.largest_defect(&start, &mut self.statistics.residuals)?.max(error);
        // A derivative that jumps leaves an error like the fourth power of the step size, or a
        // lower one. Where times are no finer than that, the step is as good as can be.
        let factor = (0.9 * Scalar::powf(rough, -0.25)).clamp(0.1, 0.9);
        let shorter = state.h * T::from_f64(SHORTEST_AFTER_ROUGH * factor);
        if rough >= 1.0 && self.check_step(state.t, shorter, Refusal::Error).is_ok() {
            return Err(Failure::Rough(factor));
        }
        Ok(())
    }

    /// Goes to the end of a step; whether the run is over. `factor` is that of the next step size.
    ///
    /// # Errors
    /// What `after` has; no consistent `(ẋ, z)` at the end.
    pub(super) fn accept(
        &mut self,
        stages: &mut dyn Stages<M, T>,
        state: &mut StepState<T>,
        factor: f64,
        after: After<'_, M, T>,
    ) -> Result<bool, Error> {
        let (t, h, nx) = (state.t, state.h, M::Shape::NX);
        self.statistics.steps += 1;
        state.pivoted = false;
        stages.accept();
        if let Some(sensitivities) = &mut self.sensitivities {
            sensitivities.accept();
        }
        if self.record {
            let x = &self.base.point.as_ref()[nx..2 * nx];
            self.tape.push(t, h, state.order.level, x, stages.accepted())?;
        }
        let end = state.end();
        let Workspace { point, dense, .. } = &mut *self.base;
        let x = &point.as_ref()[nx..2 * nx];
        let mut evaluate = |time: T, dense: &mut Dense<M, T>| {
            interpolate(&*stages, x, stages.accepted(), time - t, h, dense)
        };
        let mut accepted = Accepted { evaluate: &mut evaluate, end, stop: false };
        after(&mut accepted, dense)?;
        if accepted.stop {
            return Ok(true);
        }
        let on_stage = stages.end(h, &mut self.base.point);
        if let Some(time) = self.base.point.as_mut().last_mut() {
            *time = end;
        }
        if !on_stage {
            self.settle(end)?;
        }
        if state.starting {
            // How fast a short step converged says nothing of one that is much longer.
            state.convergence.factor = Convergence::UNKNOWN;
        }
        if state.last {
            self.finish();
            return Ok(true);
        }
        self.measure();
        state.advance(end, factor, state.convergence.rate <= THET);
        Ok(false)
    }
}
