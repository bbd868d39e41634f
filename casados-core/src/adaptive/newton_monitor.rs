//! Convergence monitor of Newton's method in a step: contraction rate, convergence, divergence and
//! failures.
//!
//! E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, section IV.8.

use super::discontinuity::Branches;
use crate::scalar::Scalar;

/// Expected number of iterations with three stages, and the number added for each further stage.
/// Convergence is linear, since the matrix is that of the last Jacobian.
const EXPECTED_ITERATIONS: f64 = 7.0;
const ITERATIONS_PER_STAGE: f64 = 2.5;

/// `THET` of RADAU5: with a contraction rate up to this the Jacobian is reused in the next step.
pub(super) const THET: f64 = 1e-3;

/// Increments below this part of the tolerance that no longer shrink are rounding errors. An
/// equation with large terms can make those of a state near zero larger than Newton's tolerance.
const ROUNDING_INCREMENT: f64 = 0.01;

/// The cause of a failed iteration.
pub enum NewtonFailure {
    /// The predicted number of iterations is too large; the factor for the step size.
    TooSlow(f64),
    /// The iteration diverges.
    Diverges,
    /// A value of the model is not finite.
    NotFinite,
    /// The iteration converges slowly with the Jacobian of an earlier step.
    StaleJacobian,
    /// A discontinuity within the step; the factor for the step size.
    Discontinuity(f64),
}

/// The equation and the unknown that prevent convergence.
#[derive(Clone, Copy, Debug, Default)]
pub struct FailureLocation {
    /// The unknown with the largest increment.
    pub unknown: usize,
    /// The equation with the largest residual relative to its terms.
    pub equation: usize,
    /// This residual.
    pub residual: f64,
}

/// The stages relative to the switching surfaces of the model.
#[derive(Clone, Copy, Debug, Default)]
pub struct SurfaceCrossing {
    /// A stage crossed a switching surface in the last increment.
    pub crossed_last: bool,
    /// A stage is on another branch than the Jacobian.
    pub off_jacobian_branch: bool,
}

/// The convergence of the last iteration.
#[derive(Clone, Copy, Debug)]
pub struct NewtonMonitor {
    /// The number of iterations.
    pub iterations: usize,
    /// The maximum number of iterations.
    pub max_iterations: usize,
    /// The contraction rate `θ` of the increments.
    pub contraction_rate: f64,
    /// `η = θ/(1 − θ)`, which carries over to the next step.
    pub eta: f64,
    /// Whether the Jacobian was evaluated for this step.
    pub jacobian_is_current: bool,
    /// The branches of the model at the Jacobian's point.
    pub jacobian_branches: Branches,
    /// The stages relative to switching surfaces, now and before the last increment.
    crossings: [SurfaceCrossing; 2],
    /// The length of this step.
    step_size: f64,
    /// The length of the last step with a measured rate.
    measured_step_size: f64,
    /// The last increment and the last contraction rate.
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
    /// `η` without a measured rate: the error is estimated by the increment.
    pub(super) const UNKNOWN_ETA: f64 = 1.0;

    /// Begins the iterations of a step with this number of stages and this length.
    pub(super) fn begin_iteration(&mut self, stages: usize, length: f64) {
        self.step_size = length;
        self.max_iterations = (EXPECTED_ITERATIONS + ITERATIONS_PER_STAGE * (stages as f64 - 3.0)) as usize;
        self.eta = Scalar::powf(self.eta.max(f64::EPSILON), 0.8);
        self.contraction_rate = THET;
        self.crossings = [SurfaceCrossing::default(); 2];
        self.last_increment_and_rate = [0.0; 2];
    }

    /// Records the position of the stages after an increment.
    pub(super) fn record_crossing(&mut self, to: SurfaceCrossing) {
        self.crossings = [to, self.crossings[0]];
    }

    /// Tests an increment, relative to the tolerances of the estimate: whether the predicted error
    /// is below `tolerance`.
    ///
    /// # Errors
    /// The iteration diverges, or is too slow.
    pub(super) fn check_increment(&mut self, increment: f64, tolerance: f64) -> Result<bool, NewtonFailure> {
        let (iteration, most, [last, last_rate]) =
            (self.iterations, self.max_iterations, self.last_increment_and_rate);
        if iteration > 1
            && increment <= ROUNDING_INCREMENT
            && 2.0 * increment >= last
            && !self.crossings[0].off_jacobian_branch
        {
            // Slow convergence with the Jacobian of an earlier step; the next step gets a new one,
            // too.
            self.contraction_rate = 2.0 * THET;
            return if self.jacobian_is_current { Ok(true) } else { Err(NewtonFailure::StaleJacobian) };
        }
        if iteration > 1 && iteration < most {
            let rate = increment / last;
            self.contraction_rate = if iteration == 2 { rate } else { Scalar::sqrt(rate * last_rate) };
            self.last_increment_and_rate[1] = rate;
            // NaN, after an increment of zero, is no divergence.
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

    /// Whether a further increment has to follow a small one: a stage has just crossed a switching
    /// surface, beyond which the exact matrix differs.
    pub(super) fn needs_another_iteration(&self, exact: bool) -> bool {
        exact && self.crossings[0].crossed_last && self.iterations < self.max_iterations
    }

    /// Whether the contraction rate is known: the matrix is exact, or two increments were compared,
    /// or the rate of an earlier step applies. That rate grows with the step size and holds on one
    /// side of a switching surface only. `small`: the last increment is below the tolerance.
    pub(super) fn is_rate_known(&self, exact: bool, small: bool) -> bool {
        let [now, before] = self.crossings;
        let here = !now.off_jacobian_branch && !before.off_jacobian_branch;
        let known = small && self.step_size <= self.measured_step_size;
        exact || self.has_comparable_increments() || here && (self.iterations > 1 || known)
    }

    /// Whether there are two increments without a switching surface between them.
    fn has_comparable_increments(&self) -> bool {
        self.iterations > 1 && !self.crossings[1].crossed_last
    }

    /// Ends the iterations of a step.
    pub(super) fn end_iteration(&mut self) {
        if self.has_comparable_increments() {
            self.measured_step_size = self.step_size;
        }
    }

    /// Records the contraction rate that the residual has confirmed.
    pub(super) fn record_confirmed_rate(&mut self, rate: f64) {
        self.eta = self.eta.min(rate);
        self.measured_step_size = self.step_size;
    }
}
