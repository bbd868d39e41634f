//! What a run remembers.

use super::acceptance::LineSearchState;
use super::options::{Globalisation, SqpOptions};
use crate::ocp::assembly::units::ProblemScaling;
use crate::ocp::nlp::inertia_correction::InertiaCorrection;
use crate::ocp::solution::log::Iteration;
use crate::ocp::solution::outcome::Status;
use crate::qp::QpError;
use crate::scalar::Scalar;
use core::marker::PhantomData;

/// What a step tries, where no step along the direction before is short enough.
#[derive(Clone, Copy, PartialEq)]
pub(in crate::ocp::nlp) enum Attempt {
    /// The QP to as many digits as the iterate deserves.
    First,
    /// To all of them: it may have been wrong by more than a step gains.
    FullAccuracy,
    /// With at least so much regularisation.
    Damped(f64),
}

/// What a run remembers from one iteration to the next.
pub(in crate::ocp::nlp) struct RunState<'c, T> {
    /// Whether the time is over.
    pub deadline_passed: Option<&'c mut dyn FnMut() -> bool>,
    /// Whether it was.
    pub out_of_time: bool,
    /// Nothing has been done yet.
    pub is_run_start: bool,
    /// The run began again.
    pub second_attempt: bool,
    pub line_search: LineSearchState,
    /// Whether bounds have penalties.
    pub is_elastic: bool,
    pub inertia_correction: InertiaCorrection,
    /// The least regularisation, where steps without were too far from being one of descent.
    pub damping: f64,
    /// The regularisation of the last step that was short, and less after others.
    pub failed_damping: f64,
    /// Whether the last direction was that of the violations alone.
    pub is_feasibility_step: bool,
    /// Whether QPs are solved to as many digits as there are.
    pub full_qp_accuracy: bool,
    /// Whether the QP that the last direction comes from was overwritten.
    pub qp_overwritten: bool,
    /// Whether a QP with penalties was solved, and violations are left.
    pub reenter_elastic_mode: bool,
    /// Steps with penalties in a row.
    pub elastic_steps: usize,
    /// The penalty that violations were found to need; zero at first.
    pub required_penalty: f64,
    /// The iterations of QPs of an iteration after which those at work end.
    pub qp_iteration_budget: usize,
    /// What this iteration tries.
    pub attempt: Attempt,
    /// Why the QP of the last iteration has no solution.
    pub qp_failure: Option<QpError>,
    /// Whether a short step may be refused, because more damping can be tried.
    pub may_reject_short_steps: bool,
    /// The largest violation of the guess.
    pub guess_violation: f64,
    /// The largest residual of the best iterate, of both attempts.
    pub best_residual: f64,
    /// That iterate.
    pub best_iteration: Iteration,
    /// The largest residual in units.
    pub residual_in_units: f64,
    /// The largest residual in what the tolerance is multiplied by.
    pub nlp_error: f64,
    /// Units, unless all of them are one.
    pub scaling: Option<ProblemScaling>,
    /// Whether the run has converged in the units of the guess, and goes on with smaller forces.
    pub has_rescaled_objective: bool,
    /// Short steps of the merit function, but for those with penalties, less full ones.
    pub short_steps: usize,
    /// Infeasible, where bounds contradict each other.
    pub contradictory_bounds: Option<Status>,
    pub number_type: PhantomData<T>,
}

/// Steps that are no longer are followed by more damping: by that factor, or by what would leave
/// of the step along a curvature the cube root of the part that was gone.
const SHORT_STEP: f64 = 1.0 / 16.0;
const DAMPING_INCREASE: f64 = 4.0;
/// After so many short steps more than full ones the merit function gives way to the filter: where
/// constraints bend more than its weights let pass, it creeps along them.
const SHORT_STEPS_BEFORE_FILTER: usize = 5;
const DAMPING_EXPONENT: f64 = -1.0 / 3.0;
/// Other steps are followed by less damping, but not by less than the geometric mean of what there
/// was and of what was too little the last time; that is forgotten by a factor.
const DAMPING_DECREASE: f64 = 0.2;
const FAILED_DAMPING_DECREASE: f64 = 0.1;
/// The least and the most of it.
const MIN_DAMPING: f64 = 1e-8;
const MAX_DAMPING: f64 = 1e2;

impl<T> RunState<'_, T> {
    /// That of a run that begins.
    pub fn new() -> Self {
        Self {
            deadline_passed: None,
            out_of_time: false,
            is_run_start: true,
            second_attempt: false,
            line_search: LineSearchState::new(),
            is_elastic: false,
            inertia_correction: InertiaCorrection::default(),
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

    /// Asks the clock, unless it was late already.
    pub fn is_out_of_time(&mut self) -> bool {
        self.out_of_time = self.out_of_time || self.deadline_passed.as_mut().is_some_and(|over| over());
        self.out_of_time
    }

    /// Whether Levenberg's and Marquardt's method damps steps: those of Gauss's and Newton's
    /// cannot go all the way.
    pub fn uses_levenberg_marquardt(&self, has_exact_hessian: bool) -> bool {
        self.second_attempt || !has_exact_hessian
    }

    /// The unit of forces.
    pub fn objective_unit(&self) -> f64 {
        self.scaling.map_or(1.0, |sizes| sizes.objective_unit)
    }

    /// How far steps go: as options say, but by the filter where the merit function creeps.
    pub fn globalisation(&self, options: &SqpOptions) -> Globalisation {
        match options.globalisation {
            Globalisation::Merit if self.short_steps >= SHORT_STEPS_BEFORE_FILTER => Globalisation::Filter,
            given => given,
        }
    }

    /// Counts short steps, less full ones without a correction. Whether it was the short one after
    /// which the filter decides.
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

    /// Whether a step was so short that damping helps.
    pub fn is_short_step(&self, log_row: &Iteration) -> bool {
        log_row.step <= SHORT_STEP
    }

    /// Damping of the next direction, after a step with such a curvature of the QP along it.
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

/// What a step was.
pub(super) struct AcceptedStep {
    pub length: f64,
    pub corrected: bool,
}
