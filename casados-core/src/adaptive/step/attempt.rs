//! The parts of a step: order selection, matrix, attempt, and acceptance.

use super::*;
use crate::adaptive::discontinuity::{BranchChange, Branches};
use crate::adaptive::newton_monitor::NewtonMonitor;

/// Approximate ratio of the estimate and the error of a step across a spline knot, where the
/// highest derivative jumps.
const SPLINE_KNOT_ERROR_FACTOR: f64 = 3.0;
/// Factor of the error of a step across a switching surface, relative to the user's tolerance: a
/// run may have many such steps, and later steps amplify their errors.
const SWITCH_ERROR_FACTOR: f64 = 6.0;

impl<M: Dae, T: Real> Run<'_, M, T> {
    /// Selects the order if a new matrix is needed anyway, and sets the initial guess of the
    /// stages.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub(super) fn choose_order<B: MethodFamily>(
        &mut self,
        levels: &mut MethodsByOrder<M, T>,
        state: &mut StepState<T>,
    ) -> Result<(), Error> {
        let ratio = state.last_step_size.map(|before| (state.h / before).to_f64());
        if state.matrix_update >= MatrixUpdate::Factors {
            let level = state.order.order_index;
            let next = state.order.select_order(&state.newton, ratio.unwrap_or(1.0));
            if next != level {
                levels.transfer_last_step::<B>(level, next)?;
                state.order.order_index = next;
                state.controller.reset();
                self.set_estimator_tolerances::<B>(levels.get::<B>(next)?.stage_count());
            }
        }
        let stages = levels.get::<B>(state.order.order_index)?;
        match ratio {
            // The polynomial of the last step may belong to another branch.
            Some(ratio) if M::BRANCHES == 0 || !state.is_unsolved() => {
                stages.extrapolate_last_step(ratio);
            }
            _ => stages.begin_from_start(&self.workspace.point),
        }
        Ok(())
    }

    /// Updates the factors of the Newton matrix as far as needed; returns whether the step can be
    /// attempted.
    ///
    /// # Errors
    /// A Jacobian that is not finite; matrices that remain singular.
    pub(super) fn prepare_factors(
        &mut self,
        stages: &mut dyn StageSolver<M, T>,
        state: &mut StepState<T>,
    ) -> Result<bool, Error> {
        if state.matrix_update == MatrixUpdate::Jacobian {
            self.evaluate_midpoint_jacobian(stages, state)?;
        }
        if state.matrix_update < MatrixUpdate::Factors {
            return Ok(true);
        }
        let mut factored = self.factor_matrix(stages, state);
        if state.verifies_pivots
            && !state.uses_pivoting
            && !stages.are_factors_accurate(&self.workspace.step_context(state))
        {
            state.uses_pivoting = true;
            factored = self.factor_matrix(stages, state);
        }
        match factored {
            Ok(planned) => {
                state.singular_matrices = 0;
                self.statistics.dense += usize::from(!planned);
                Ok(true)
            }
            Err(unknown) => {
                state.singular_matrices += 1;
                if state.singular_matrices >= MAX_SINGULAR_MATRICES {
                    let at = Place { step: state.attempts, stage: 0, iteration: 0 };
                    return Err(Error::Singular { unknown: crate::irk::unknown_name::<M>(unknown), at });
                }
                self.statistics.failed += 1;
                state.last_refusal = Refusal::Singular;
                state.order.iteration_failed = true;
                state.retry(0.5);
                self.check_step_size(state.t, state.h, state.last_refusal)?;
                Ok(false)
            }
        }
    }

    /// Factorises the matrix, by the plan or with pivoting.
    fn factor_matrix(
        &mut self,
        stages: &mut dyn StageSolver<M, T>,
        state: &StepState<T>,
    ) -> Result<bool, usize> {
        stages.set_pivoted(state.uses_pivoting);
        self.statistics.factorizations += 1;
        stages.factor(&self.workspace.jacobian, state.h)
    }

    /// Whether an attempt failed because the planned pivots, chosen at compile time, are too small.
    /// The matrix is then factorised with pivoting and the same step repeated; later planned
    /// factors are tested before use.
    pub(super) fn retry_with_pivoting(
        &mut self,
        stages: &dyn StageSolver<M, T>,
        state: &mut StepState<T>,
        attempt: &Result<f64, NewtonFailure>,
    ) -> bool {
        let may_be_available = match attempt {
            Ok(error) => *error >= 1.0,
            Err(failure) => matches!(
                failure,
                NewtonFailure::TooSlow(_) | NewtonFailure::Diverges | NewtonFailure::NotFinite
            ),
        };
        if !may_be_available
            || state.uses_pivoting
            || stages.are_factors_accurate(&self.workspace.step_context(state))
        {
            return false;
        }
        self.statistics.failed += 1;
        (state.uses_pivoting, state.verifies_pivots) = (true, true);
        state.matrix_update = MatrixUpdate::Factors;
        // The contraction rate of this iteration does not apply to the next one.
        (state.newton.contraction_rate, state.newton.eta) = (THET, NewtonMonitor::UNKNOWN_ETA);
        true
    }

    /// Evaluates the Jacobian at the predicted middle of the step, close to all stages; in the
    /// first step, after a rejection and if it is not finite, at the start.
    ///
    /// # Errors
    /// A value that is not finite.
    fn evaluate_midpoint_jacobian(
        &mut self,
        stages: &mut dyn StageSolver<M, T>,
        state: &mut StepState<T>,
    ) -> Result<(), Error> {
        state.jacobian_is_current = state.needs_second_estimate();
        state.newton.jacobian_is_current = true;
        if !state.jacobian_is_current {
            let mut middle = self.workspace.midpoint;
            stages.predict_midpoint(&self.workspace.step_context(state), &mut middle);
            self.workspace.midpoint = middle;
            state.jacobian_is_current = self.evaluate_jacobian(true, state.attempts).is_err();
        }
        if state.jacobian_is_current {
            self.evaluate_jacobian(false, state.attempts)?;
        }
        let point = if state.jacobian_is_current { &self.workspace.point } else { &self.workspace.midpoint };
        state.newton.jacobian_branches = Branches::at_point::<M, T>(point);
        Ok(())
    }

    /// Solves the stages; returns the estimated error relative to the tolerance, including
    /// controlled sensitivities.
    ///
    /// # Errors
    /// [`NewtonFailure`]
    pub(super) fn attempt_step(
        &mut self,
        stages: &mut dyn StageSolver<M, T>,
        state: &mut StepState<T>,
    ) -> Result<f64, NewtonFailure> {
        let Workspace { point, u, parameters, tolerances, .. } = &*self.workspace;
        let start = self.workspace.step_context(state);
        let residuals = &mut self.statistics.residuals;
        let solved = stages.solve(&start, tolerances.newton_tolerance, &mut state.newton, residuals);
        self.statistics.iterations += state.newton.iterations;
        solved?;
        let again = state.needs_second_estimate();
        let error = stages.estimate_error(&start, again, residuals)?;
        if !error.is_finite() {
            return Err(NewtonFailure::Diverges);
        }
        let error = match &mut self.sensitivities {
            Some(sensitivities) if error < 1.0 => {
                let mut x = VectorX::<M, T>::zeroed();
                x.as_mut_slice().copy_from_slice(&point.as_ref()[M::Shape::NX..2 * M::Shape::NX]);
                let (at, level) =
                    (ModelPoint { x: &x, u, p: parameters, t: state.t }, state.order.order_index);
                error.max(sensitivities.implicit_error(stages, at, level, &start, tolerances, again)?)
            }
            _ => error,
        };
        if error < 1.0 {
            self.reject_across_branches(stages, state, error)?;
        }
        Ok(error)
    }

    /// Rejects a step in which the model changes its branch, if its error exceeds the user's
    /// tolerance.
    ///
    /// # Errors
    /// [`NewtonFailure::Discontinuity`], and a value that is not finite.
    fn reject_across_branches(
        &mut self,
        stages: &mut dyn StageSolver<M, T>,
        state: &StepState<T>,
        error: f64,
    ) -> Result<(), NewtonFailure> {
        let start = self.workspace.step_context(state);
        let Some(change) = stages.branch_change(&start) else { return Ok(()) };
        let factor = match change {
            BranchChange::Switch => SWITCH_ERROR_FACTOR,
            BranchChange::SplineKnot => 1.0 / SPLINE_KNOT_ERROR_FACTOR,
        } * self.workspace.tolerances.tolerance_ratio;
        let discontinuity_error =
            factor * stages.largest_defect(&start, &mut self.statistics.residuals)?.max(error);
        // If a derivative jumps, the error is proportional to the fourth or a lower power of the
        // step size. A step at the resolution of the time is accepted.
        let factor = (0.9 * Scalar::powf(discontinuity_error, -0.25)).clamp(0.1, 0.9);
        let shorter = state.h * T::from_f64(factor);
        if discontinuity_error >= 1.0 && self.check_step_size(state.t, shorter, Refusal::Error).is_ok() {
            return Err(NewtonFailure::Discontinuity(factor));
        }
        Ok(())
    }

    /// Moves to the end of an accepted step; returns whether the run is finished. `factor` is that
    /// of the next step size.
    ///
    /// # Errors
    /// Those of `after`; no consistent `(ẋ, z)` at the end.
    pub(super) fn accept_step(
        &mut self,
        stages: &mut dyn StageSolver<M, T>,
        state: &mut StepState<T>,
        factor: f64,
        after: AfterStep<'_, M, T>,
    ) -> Result<bool, Error> {
        let (t, h, nx) = (state.t, state.h, M::Shape::NX);
        self.statistics.steps += 1;
        state.uses_pivoting = false;
        stages.accept_step();
        if let Some(sensitivities) = &mut self.sensitivities {
            sensitivities.accept_step();
        }
        if self.record_steps {
            let x = &self.workspace.point.as_ref()[nx..2 * nx];
            self.tape.push(t, h, state.order.order_index, x, stages.accepted_unknowns())?;
        }
        let end = state.end_time();
        let Workspace { point, dense, .. } = &mut *self.workspace;
        let x = &point.as_ref()[nx..2 * nx];
        let mut evaluate = |time: T, dense: &mut Dense<M, T>| {
            interpolate_step(&*stages, x, stages.accepted_unknowns(), time - t, h, dense)
        };
        let mut accepted = AcceptedStepOutput { evaluate_dense: &mut evaluate, end, stop: false };
        after(&mut accepted, dense)?;
        if accepted.stop {
            return Ok(true);
        }
        let on_stage = stages.end_point(h, &mut self.workspace.point);
        if let Some(time) = self.workspace.point.as_mut().last_mut() {
            *time = end;
        }
        if !on_stage {
            self.make_consistent(end)?;
        }
        if state.is_starting {
            // The contraction rate of a short step does not hold for a much longer one.
            state.newton.eta = NewtonMonitor::UNKNOWN_ETA;
        }
        if state.is_last {
            self.write_result();
            return Ok(true);
        }
        self.update_scales();
        state.advance(end, factor, state.newton.contraction_rate <= THET);
        Ok(false)
    }
}
