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
const NOISE: f64 = 0.01;

/// How an iteration ended that did not converge.
pub enum Failure {
    /// It converges, but not soon enough: the factor by which a shorter step would.
    Slow(f64),
    /// It does not converge.
    Diverges,
    /// The model has a value that is not finite.
    NotFinite,
    /// It converges slowly, with the Jacobian of an earlier step.
    Stale,
    /// A force jumps in the step, or its derivatives: the factor by which it has to be shorter.
    Rough(f64),
}

/// What keeps an iteration from converging.
#[derive(Clone, Copy, Debug, Default)]
pub struct Culprit {
    /// The unknown with the largest increment.
    pub unknown: usize,
    /// The equation with the largest residual relative to its terms,
    pub equation: usize,
    /// and this residual.
    pub residual: f64,
}

/// Where the stages are, beside borders between branches of the model.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sides {
    /// One has passed a border by the last increment.
    pub passed: bool,
    /// One is beyond a border from where the Jacobian was evaluated.
    pub beyond: bool,
}

/// What is known about the convergence of the last iteration.
#[derive(Clone, Copy, Debug)]
pub struct Convergence {
    /// How many iterations it took.
    pub iterations: usize,
    /// How many it might have taken.
    pub most: usize,
    /// By what the increments shrank.
    pub rate: f64,
    /// `θ/(1 − θ)`, which carries over to the next step.
    pub factor: f64,
    /// Whether the Jacobian was evaluated for this step, and not kept from an earlier one.
    pub fresh: bool,
    /// The branches of the model where that was.
    pub branches: Branches,
    /// Where the stages are now, and where they were before the last increment.
    sides: [Sides; 2],
    /// The length of this step,
    length: f64,
    /// and that of the last one whose rate was measured.
    measured_length: f64,
    /// The last increment and the last rate.
    last: [f64; 2],
}

impl Default for Convergence {
    fn default() -> Self {
        let (most, factor, last) = (EXPECTED_ITERATIONS as usize, Self::UNKNOWN, [0.0; 2]);
        Self {
            iterations: 0,
            most,
            rate: 0.0,
            factor,
            fresh: false,
            branches: Branches::default(),
            sides: [Sides::default(); 2],
            length: 0.0,
            measured_length: 0.0,
            last,
        }
    }
}

impl Convergence {
    /// The factor where no step tells: an increment counts as what is left after it.
    pub(super) const UNKNOWN: f64 = 1.0;

    /// Before an iteration for so many stages, in a step of this length.
    pub(super) fn begin(&mut self, stages: usize, length: f64) {
        self.length = length;
        self.most = (EXPECTED_ITERATIONS + ITERATIONS_PER_STAGE * (stages as f64 - 3.0)) as usize;
        self.factor = Scalar::powf(self.factor.max(f64::EPSILON), 0.8);
        self.rate = THET;
        self.sides = [Sides::default(); 2];
        self.last = [0.0; 2];
    }

    /// The stages were moved.
    pub(super) fn moved(&mut self, to: Sides) {
        self.sides = [to, self.sides[0]];
    }

    /// After an increment relative to what is tolerated: whether what is left is below the
    /// tolerance.
    ///
    /// # Errors
    /// It does not converge, or not soon enough.
    pub(super) fn after(&mut self, increment: f64, tolerance: f64) -> Result<bool, Failure> {
        let (iteration, most, [last, last_rate]) = (self.iterations, self.most, self.last);
        if iteration > 1 && increment <= NOISE && 2.0 * increment >= last && !self.sides[0].beyond {
            // So does what converges slowly with the Jacobian of an earlier step: the next one gets
            // its own, too.
            self.rate = 2.0 * THET;
            return if self.fresh { Ok(true) } else { Err(Failure::Stale) };
        }
        if iteration > 1 && iteration < most {
            let rate = increment / last;
            self.rate = if iteration == 2 { rate } else { Scalar::sqrt(rate * last_rate) };
            self.last[1] = rate;
            // Written so that NaN, after an increment of zero, is no divergence.
            if self.rate >= 0.99 {
                return Err(Failure::Diverges);
            }
            if self.rate.is_finite() {
                self.factor = self.rate / (1.0 - self.rate);
                let left = (most - 1 - iteration) as i32;
                let expected = self.factor * increment * Scalar::powi(self.rate, left) / tolerance;
                if expected >= 1.0 {
                    let excess = expected.min(20.0);
                    return Err(Failure::Slow(0.8 * Scalar::powf(excess, -1.0 / (4.0 + f64::from(left)))));
                }
            }
        }
        self.last[0] = increment.max(f64::EPSILON);
        Ok(self.factor * increment <= tolerance)
    }

    /// Whether another increment is to follow a small one: an exact matrix is that of one side of a
    /// border, and a stage has just passed one.
    pub(super) fn goes_on(&self, exact: bool) -> bool {
        exact && self.sides[0].passed && self.iterations < self.most
    }

    /// Whether it is known how fast the iteration converges, whose last increment is `small` or
    /// not: the matrix is exact, or two increments were compared. The rate of an earlier step holds
    /// on its side of a border, and for steps that are no longer: it grows with their length.
    pub(super) fn is_measured(&self, exact: bool, small: bool) -> bool {
        let [now, before] = self.sides;
        let here = !now.beyond && !before.beyond;
        let known = small && self.length <= self.measured_length;
        exact || self.is_compared() || here && (self.iterations > 1 || known)
    }

    /// Whether there are two increments that no border is between.
    fn is_compared(&self) -> bool {
        self.iterations > 1 && !self.sides[1].passed
    }

    /// The iteration is over.
    pub(super) fn end(&mut self) {
        if self.is_compared() {
            self.measured_length = self.length;
        }
    }

    /// The last increment was small, and has left this part of the residual.
    pub(super) fn confirmed(&mut self, rate: f64) {
        self.factor = self.factor.min(rate);
        self.measured_length = self.length;
    }
}
