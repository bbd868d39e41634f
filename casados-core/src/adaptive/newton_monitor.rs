//! Newton's method in a step: its rate, when it has converged, when it is given up and why.
//!
//! E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, section IV.8.

use super::discontinuity::Branches;
use crate::scalar::Scalar;

/// The Newton matrix is that of the last Jacobian, so that the iteration converges linearly. It is
/// expected to take no more than this many iterations, and this many more with each stage above
/// three.
const EXPECTED_ITERATIONS: f64 = 7.0;
const ITERATIONS_PER_STAGE: f64 = 2.5;

/// `THET` of RADAU5: an iteration with this rate, or that is over at once, keeps its Jacobian for
/// the next step.
pub(super) const THET: f64 = 1e-3;

/// Increments that shrink no more are rounding errors, if they are this small beside what is
/// tolerated: of a state near zero that follows from large ones by an equation, they may be above
/// the tolerance of the iteration.
const ROUNDING_INCREMENT: f64 = 0.01;

/// How an iteration ended that did not converge.
pub enum NewtonFailure {
    /// It converges, but not soon enough: the factor by which a shorter step would.
    TooSlow(f64),
    /// It does not converge.
    Diverges,
    /// The model has a value that is not finite.
    NotFinite,
    /// It converges slowly, with the Jacobian of an earlier step.
    StaleJacobian,
    /// A force jumps in the step, or its derivatives: the factor by which it has to be shorter.
    Discontinuity(f64),
}

/// What keeps an iteration from converging.
#[derive(Clone, Copy, Debug, Default)]
pub struct FailureLocation {
    /// The unknown with the largest increment.
    pub unknown: usize,
    /// The equation with the largest residual relative to its terms,
    pub equation: usize,
    /// and this residual.
    pub residual: f64,
}

/// Where the stages are, beside borders between branches of the model.
#[derive(Clone, Copy, Debug, Default)]
pub struct SurfaceCrossing {
    /// One has passed a border by the last increment.
    pub crossed_last: bool,
    /// One is beyond a border from where the Jacobian was evaluated.
    pub off_jacobian_branch: bool,
}

/// What is known about the convergence of the last iteration.
#[derive(Clone, Copy, Debug)]
pub struct NewtonMonitor {
    /// How many iterations it took.
    pub iterations: usize,
    /// How many it might have taken.
    pub max_iterations: usize,
    /// By what the increments shrank.
    pub contraction_rate: f64,
    /// `θ/(1 − θ)`, which carries over to the next step.
    pub eta: f64,
    /// Whether the Jacobian was evaluated for this step, and not kept from an earlier one.
    pub jacobian_is_current: bool,
    /// The branches of the model where that was.
    pub jacobian_branches: Branches,
    /// Where the stages are now, and where they were before the last increment.
    crossings: [SurfaceCrossing; 2],
    /// The length of this step,
    step_size: f64,
    /// and that of the last one whose rate was measured.
    measured_step_size: f64,
    /// The last increment and the last rate.
    last_increment_and_rate: [f64; 2],
}

impl Default for NewtonMonitor {
    fn default() -> Self {
        let (most, factor, last) = (EXPECTED_ITERATIONS as usize, Self::UNKNOWN_ETA, [0.0; 2]);
        Self {
            iterations: 0,
            max_iterations: most,
            contraction_rate: 0.0,
            eta: factor,
            jacobian_is_current: false,
            jacobian_branches: Branches::default(),
            crossings: [SurfaceCrossing::default(); 2],
            step_size: 0.0,
            measured_step_size: 0.0,
            last_increment_and_rate: last,
        }
    }
}

impl NewtonMonitor {
    /// The factor where no step tells: an increment counts as what is left after it.
    pub(super) const UNKNOWN_ETA: f64 = 1.0;

    /// Before an iteration for so many stages, in a step of this length.
    pub(super) fn begin_iteration(&mut self, stages: usize, length: f64) {
        self.step_size = length;
        self.max_iterations = (EXPECTED_ITERATIONS + ITERATIONS_PER_STAGE * (stages as f64 - 3.0)) as usize;
        self.eta = Scalar::powf(self.eta.max(f64::EPSILON), 0.8);
        self.contraction_rate = THET;
        self.crossings = [SurfaceCrossing::default(); 2];
        self.last_increment_and_rate = [0.0; 2];
    }

    /// The stages were moved.
    pub(super) fn record_crossing(&mut self, to: SurfaceCrossing) {
        self.crossings = [to, self.crossings[0]];
    }

    /// After an increment relative to what is tolerated: whether what is left is below the
    /// tolerance.
    ///
    /// # Errors
    /// It does not converge, or not soon enough.
    pub(super) fn check_increment(&mut self, increment: f64, tolerance: f64) -> Result<bool, NewtonFailure> {
        let (iteration, most, [last, last_rate]) =
            (self.iterations, self.max_iterations, self.last_increment_and_rate);
        if iteration > 1
            && increment <= ROUNDING_INCREMENT
            && 2.0 * increment >= last
            && !self.crossings[0].off_jacobian_branch
        {
            // So does what converges slowly with the Jacobian of an earlier step: the next one gets
            // its own, too.
            self.contraction_rate = 2.0 * THET;
            return if self.jacobian_is_current { Ok(true) } else { Err(NewtonFailure::StaleJacobian) };
        }
        if iteration > 1 && iteration < most {
            let rate = increment / last;
            self.contraction_rate = if iteration == 2 { rate } else { Scalar::sqrt(rate * last_rate) };
            self.last_increment_and_rate[1] = rate;
            // Written so that NaN, after an increment of zero, is no divergence.
            if self.contraction_rate >= 0.99 {
                return Err(NewtonFailure::Diverges);
            }
            if self.contraction_rate.is_finite() {
                self.eta = self.contraction_rate / (1.0 - self.contraction_rate);
                let left = (most - 1 - iteration) as i32;
                let expected = self.eta * increment * Scalar::powi(self.contraction_rate, left) / tolerance;
                if expected >= 1.0 {
                    let excess = expected.min(20.0);
                    return Err(NewtonFailure::TooSlow(
                        0.8 * Scalar::powf(excess, -1.0 / (4.0 + f64::from(left))),
                    ));
                }
            }
        }
        self.last_increment_and_rate[0] = increment.max(f64::EPSILON);
        Ok(self.eta * increment <= tolerance)
    }

    /// Whether another increment is to follow a small one: an exact matrix is that of one side of a
    /// border, and a stage has just passed one.
    pub(super) fn needs_another_iteration(&self, exact: bool) -> bool {
        exact && self.crossings[0].crossed_last && self.iterations < self.max_iterations
    }

    /// Whether it is known how fast the iteration converges, whose last increment is `small` or
    /// not: the matrix is exact, or two increments were compared. The rate of an earlier step holds
    /// on its side of a border, and for steps that are no longer: it grows with their length.
    pub(super) fn is_rate_known(&self, exact: bool, small: bool) -> bool {
        let [now, before] = self.crossings;
        let here = !now.off_jacobian_branch && !before.off_jacobian_branch;
        let known = small && self.step_size <= self.measured_step_size;
        exact || self.has_comparable_increments() || here && (self.iterations > 1 || known)
    }

    /// Whether there are two increments that no border is between.
    fn has_comparable_increments(&self) -> bool {
        self.iterations > 1 && !self.crossings[1].crossed_last
    }

    /// The iteration is over.
    pub(super) fn end_iteration(&mut self) {
        if self.has_comparable_increments() {
            self.measured_step_size = self.step_size;
        }
    }

    /// The last increment was small, and has left this part of the residual.
    pub(super) fn record_confirmed_rate(&mut self, rate: f64) {
        self.eta = self.eta.min(rate);
        self.measured_step_size = self.step_size;
    }
}
