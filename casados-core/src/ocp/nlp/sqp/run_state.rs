//! State of a run.

use super::acceptance::LineSearchState;
use super::options::{Globalisation, SqpOptions};
use crate::ocp::assembly::units::ProblemScaling;
use crate::ocp::nlp::inertia_correction::InertiaCorrection;
use crate::ocp::solution::log::Iteration;
use crate::ocp::solution::outcome::Status;
use crate::qp::QpError;
use crate::scalar::Scalar;
use core::marker::PhantomData;

/// The attempts at an iterate, in this order until a step is accepted.
#[derive(Clone, Copy, PartialEq)]
pub(in crate::ocp::nlp) enum Attempt {
    /// The QP is solved to an accuracy relative to the residuals.
    First,
    /// The QP is solved to all digits: its error may have exceeded the gain of a step.
    FullAccuracy,
    /// The QP has at least this Levenberg-Marquardt damping.
    Damped(f64),
}

/// State of a run, kept between iterations.
pub(in crate::ocp::nlp) struct RunState<'c, T> {
    /// Returns whether the deadline has passed.
    pub deadline_passed: Option<&'c mut dyn FnMut() -> bool>,
    /// Whether the deadline has passed.
    pub out_of_time: bool,
    /// Whether the run has not evaluated its first iterate.
    pub is_run_start: bool,
    /// Whether the run has restarted.
    pub second_attempt: bool,
    /// The number of simulations with the controls of an iterate.
    pub simulations: usize,
    pub line_search: LineSearchState,
    /// Whether bounds have penalties (elastic mode).
    pub is_elastic: bool,
    pub inertia_correction: InertiaCorrection,
    /// Levenberg-Marquardt damping: the smallest regularisation of the next direction.
    pub damping: f64,
    /// The regularisation of the last short step; it decreases after other steps.
    pub failed_damping: f64,
    /// Whether the last direction was a feasibility step.
    pub is_feasibility_step: bool,
    /// Whether QPs are solved to all digits.
    pub full_qp_accuracy: bool,
    /// Whether the QP of the last direction has been overwritten.
    pub qp_overwritten: bool,
    /// Whether an elastic QP has been solved, and violations remain.
    pub reenter_elastic_mode: bool,
    /// Consecutive elastic steps.
    pub elastic_steps: usize,
    /// The penalty determined by steering; zero at first.
    pub required_penalty: f64,
    /// The number of QP iterations of this iteration at which the present QPs stop.
    pub qp_iteration_budget: usize,
    /// The attempt at this iterate.
    pub attempt: Attempt,
    /// The error of the QP of the last attempt.
    pub qp_failure: Option<QpError>,
    /// Whether short steps may be rejected, since more damping is possible.
    pub may_reject_short_steps: bool,
    /// The largest violation of the guess.
    pub guess_violation: f64,
    /// The largest residual of the best iterate, of both attempts.
    pub best_residual: f64,
    /// The log row of the best iterate.
    pub best_iteration: Iteration,
    /// The largest residual in units.
    pub residual_in_units: f64,
    /// The largest residual, relative to the factors of the tolerance.
    pub nlp_error: f64,
    /// The objective unit and the smallest unit, unless all units are one.
    pub scaling: Option<ProblemScaling>,
    /// Whether the run converged with the objective unit of the guess, and continues with a smaller
    /// one.
    pub has_rescaled_objective: bool,
    /// Short steps with the merit function, without elastic ones, minus full steps.
    pub short_steps: usize,
    /// The status `Infeasible` of contradictory bounds.
    pub contradictory_bounds: Option<Status>,
    pub number_type: PhantomData<T>,
}

/// Steps up to this length increase the damping: by the factor `DAMPING_INCREASE`, or to
/// `κ (α^DAMPING_EXPONENT − 1)` for the step length `α` and the curvature `κ` along the step.
const SHORT_STEP: f64 = 1.0 / 16.0;
const DAMPING_INCREASE: f64 = 4.0;
/// The difference between the numbers of short and of full steps at which the filter replaces the
/// merit function: with strongly curved constraints the merit function accepts only short steps.
const SHORT_STEPS_BEFORE_FILTER: usize = 5;
const DAMPING_EXPONENT: f64 = -1.0 / 3.0;
/// After other steps the damping becomes `max(0.2 damping, √(damping · failed_damping))`, and the
/// failed damping decreases by a factor.
const DAMPING_DECREASE: f64 = 0.2;
const FAILED_DAMPING_DECREASE: f64 = 0.1;
/// The smallest and the largest damping.
const MIN_DAMPING: f64 = 1e-8;
const MAX_DAMPING: f64 = 1e2;

impl<T> RunState<'_, T> {
    /// The state at the start of a run.
    pub fn new(options: &SqpOptions) -> Self {
        let advanced = &options.advanced;
        Self {
            deadline_passed: None,
            out_of_time: false,
            is_run_start: true,
            second_attempt: false,
            simulations: 0,
            line_search: LineSearchState::new(advanced.filter),
            is_elastic: false,
            inertia_correction: InertiaCorrection::new(advanced.inertia),
            damping: 0.0,
            failed_damping: 0.0,
            may_reject_short_steps: false,
            is_feasibility_step: false,
            reenter_elastic_mode: false,
            elastic_steps: 0,
            required_penalty: 0.0,
            qp_iteration_budget: usize::MAX,
            attempt: Attempt::First,
            qp_failure: None,
            full_qp_accuracy: false,
            qp_overwritten: false,
            guess_violation: f64::INFINITY,
            best_residual: f64::INFINITY,
            best_iteration: Iteration::default(),
            residual_in_units: f64::INFINITY,
            nlp_error: f64::INFINITY,
            scaling: None,
            has_rescaled_objective: false,
            short_steps: 0,
            contradictory_bounds: None,
            number_type: PhantomData,
        }
    }

    /// Whether the deadline has passed; does not ask again once it has.
    pub fn is_out_of_time(&mut self) -> bool {
        self.out_of_time = self.out_of_time || self.deadline_passed.as_mut().is_some_and(|over| over());
        self.out_of_time
    }

    /// Whether short steps are replaced by Levenberg-Marquardt damping: with Gauss-Newton Hessians,
    /// and after a restart.
    pub fn uses_levenberg_marquardt(&self, has_exact_hessian: bool) -> bool {
        self.second_attempt || !has_exact_hessian
    }

    /// The unit of the objective.
    pub fn objective_unit(&self) -> f64 {
        self.scaling.map_or(1.0, |sizes| sizes.objective_unit)
    }

    /// The globalisation of the options; the filter after too many short steps with the merit
    /// function.
    pub fn globalisation(&self, options: &SqpOptions) -> Globalisation {
        match options.globalisation {
            Globalisation::Merit if self.short_steps >= SHORT_STEPS_BEFORE_FILTER => Globalisation::Filter,
            given => given,
        }
    }

    /// Counts short steps, minus full steps without correction. Returns whether the filter now
    /// replaces the merit function.
    pub fn update_short_steps(&mut self, log_row: &Iteration, options: &SqpOptions) -> bool {
        if options.globalisation != Globalisation::Merit || self.short_steps >= SHORT_STEPS_BEFORE_FILTER {
            return false;
        }
        if self.is_short_step(log_row) && !log_row.elastic {
            self.short_steps += 1;
        } else if log_row.step == 1.0 && !log_row.corrected {
            self.short_steps = self.short_steps.saturating_sub(1);
        }
        self.short_steps == SHORT_STEPS_BEFORE_FILTER
    }

    /// Whether the step is so short that damping increases.
    pub fn is_short_step(&self, log_row: &Iteration) -> bool {
        log_row.step <= SHORT_STEP
    }

    /// Updates the damping after a step with the given curvature of the QP along it.
    pub fn update_damping(&mut self, log_row: &Iteration, curvature: f64) {
        if self.is_short_step(log_row) {
            let by_curvature = curvature.max(0.0) * (Scalar::powf(log_row.step, DAMPING_EXPONENT) - 1.0);
            self.failed_damping = log_row.regularisation.max(MIN_DAMPING);
            self.damping =
                by_curvature.max(DAMPING_INCREASE * log_row.regularisation).clamp(MIN_DAMPING, MAX_DAMPING);
        } else if self.damping > MIN_DAMPING {
            self.damping =
                (DAMPING_DECREASE * self.damping).max(Scalar::sqrt(self.damping * self.failed_damping));
            self.failed_damping *= FAILED_DAMPING_DECREASE;
        } else {
            self.damping = 0.0;
        }
    }
}

/// An accepted step.
pub(super) struct AcceptedStep {
    pub length: f64,
    pub corrected: bool,
}
