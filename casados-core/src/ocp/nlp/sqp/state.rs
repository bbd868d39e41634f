//! What a run remembers.

use super::acceptance::Search;
use super::options::{Globalisation, SqpOptions};
use crate::ocp::assembly::units::Sizes;
use crate::ocp::nlp::inertia::InertiaCorrection;
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
    Exact,
    /// With at least so much regularisation.
    Damped(f64),
}

/// What a run remembers from one iteration to the next.
pub(in crate::ocp::nlp) struct State<'c, T> {
    /// Whether the time is over.
    pub over: Option<&'c mut dyn FnMut() -> bool>,
    /// Whether it was.
    pub late: bool,
    /// Nothing has been done yet.
    pub begins: bool,
    /// The run began again.
    pub second_attempt: bool,
    pub search: Search,
    /// Whether bounds have penalties.
    pub elastic: bool,
    pub inertia: InertiaCorrection,
    /// The least regularisation, where steps without were too far from being one of descent.
    pub damping: f64,
    /// The regularisation of the last step that was short, and less after others.
    pub failed: f64,
    /// Whether the last direction was that of the violations alone.
    pub feasibility_step: bool,
    /// Whether QPs are solved to as many digits as there are.
    pub exact: bool,
    /// Whether the QP that the last direction comes from was overwritten.
    pub rewritten: bool,
    /// Whether a QP with penalties was solved, and violations are left.
    pub stays_elastic: bool,
    /// Steps with penalties in a row.
    pub elastic_steps: usize,
    /// The penalty that violations were found to need; zero at first.
    pub penalty: f64,
    /// The iterations of QPs of an iteration after which those at work end.
    pub most_qp_iterations: usize,
    /// What this iteration tries.
    pub attempt: Attempt,
    /// Why the QP of the last iteration has no solution.
    pub failure: Option<QpError>,
    /// Whether a short step may be refused, because more damping can be tried.
    pub may_reject_short_steps: bool,
    /// The largest violation of the guess.
    pub violation_of_guess: f64,
    /// The largest residual of the best iterate, of both attempts.
    pub best_residual: f64,
    /// That iterate.
    pub best_iteration: Iteration,
    /// The largest residual in units.
    pub residual: f64,
    /// The largest residual in what the tolerance is multiplied by.
    pub error: f64,
    /// Units, unless all of them are one.
    pub sizes: Option<Sizes>,
    /// Whether the run has converged in the units of the guess, and goes on with smaller forces.
    pub has_tightened: bool,
    /// Short steps of the merit function, but for those with penalties, less full ones.
    pub short_steps: usize,
    /// Infeasible, where bounds contradict each other.
    pub contradiction: Option<Status>,
    pub number: PhantomData<T>,
}

/// Steps that are no longer are followed by more damping: by that factor, or by what would leave
/// of the step along a curvature the cube root of the part that was gone.
const SHORT_STEP: f64 = 1.0 / 16.0;
const DAMPING_FACTOR: f64 = 4.0;
/// After so many short steps more than full ones the merit function gives way to the filter: where
/// constraints bend more than its weights let pass, it creeps along them.
const SHORT_STEPS_BEFORE_FILTER: usize = 5;
const DAMPING_EXPONENT: f64 = -1.0 / 3.0;
/// Other steps are followed by less damping, but not by less than the geometric mean of what there
/// was and of what was too little the last time; that is forgotten by a factor.
const DAMPING_DECREASE: f64 = 0.2;
const FAILED_DECREASE: f64 = 0.1;
/// The least and the most of it.
const MIN_DAMPING: f64 = 1e-8;
const MAX_DAMPING: f64 = 1e2;

impl<T> State<'_, T> {
    /// That of a run that begins.
    pub fn new() -> Self {
        Self {
            over: None,
            late: false,
            begins: true,
            second_attempt: false,
            search: Search::new(),
            elastic: false,
            inertia: InertiaCorrection::default(),
            damping: 0.0,
            failed: 0.0,
            may_reject_short_steps: false,
            feasibility_step: false,
            stays_elastic: false,
            elastic_steps: 0,
            penalty: 0.0,
            most_qp_iterations: usize::MAX,
            attempt: Attempt::First,
            failure: None,
            exact: false,
            rewritten: false,
            violation_of_guess: f64::INFINITY,
            best_residual: f64::INFINITY,
            best_iteration: Iteration::default(),
            residual: f64::INFINITY,
            error: f64::INFINITY,
            sizes: None,
            has_tightened: false,
            short_steps: 0,
            contradiction: None,
            number: PhantomData,
        }
    }

    /// Asks the clock, unless it was late already.
    pub fn is_over(&mut self) -> bool {
        self.late = self.late || self.over.as_mut().is_some_and(|over| over());
        self.late
    }

    /// Whether Levenberg's and Marquardt's method damps steps: those of Gauss's and Newton's
    /// cannot go all the way.
    pub fn damps(&self, exact: bool) -> bool {
        self.second_attempt || !exact
    }

    /// The unit of forces.
    pub fn force(&self) -> f64 {
        self.sizes.map_or(1.0, |sizes| sizes.force)
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
    pub fn switches_to_filter(&mut self, row: &Iteration, options: &SqpOptions) -> bool {
        if options.globalisation != Globalisation::Merit || self.short_steps >= SHORT_STEPS_BEFORE_FILTER {
            return false;
        }
        if self.is_short(row) && !row.elastic {
            self.short_steps += 1;
        } else if row.step == 1.0 && !row.corrected {
            self.short_steps = self.short_steps.saturating_sub(1);
        }
        self.short_steps == SHORT_STEPS_BEFORE_FILTER
    }

    /// Whether a step was so short that damping helps.
    pub fn is_short(&self, row: &Iteration) -> bool {
        row.step <= SHORT_STEP
    }

    /// Damping of the next direction, after a step with such a curvature of the QP along it.
    pub fn damp(&mut self, row: &Iteration, curvature: f64) {
        if self.is_short(row) {
            let by_curvature = curvature.max(0.0) * (Scalar::powf(row.step, DAMPING_EXPONENT) - 1.0);
            self.failed = row.regularisation.max(MIN_DAMPING);
            self.damping =
                by_curvature.max(DAMPING_FACTOR * row.regularisation).clamp(MIN_DAMPING, MAX_DAMPING);
        } else if self.damping > MIN_DAMPING {
            self.damping = (DAMPING_DECREASE * self.damping).max(Scalar::sqrt(self.damping * self.failed));
            self.failed *= FAILED_DECREASE;
        } else {
            self.damping = 0.0;
        }
    }
}

/// What a step was.
pub(super) struct Taken {
    pub length: f64,
    pub corrected: bool,
}
