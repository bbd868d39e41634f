//! The branches that a model takes at a point: which conditions of `if`, `max` or `abs` hold there,
//! and which pieces its tables have.

use super::tolerances::ORDER_REDUCTION_RATIO;
use crate::model::{ArrayV, Dae};
use crate::scalar::{Lanes, Scalar};
use bytemuck::Zeroable;

/// Why the shape of a defect is looked at, the strongest reason last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DefectCheck {
    /// Its size is unusual.
    Suspicious,
    /// The step is watched, whatever its size is.
    AfterRejection,
    /// A spline changes its piece: no lower derivative jumps than its highest.
    SplineKnot,
    /// The model changes its branch: the step is rough, whatever its shape is.
    Switch,
}

/// A number of the conditions and linear tables of a model, and one of its splines.
#[derive(Clone, Copy, Debug, Default, Zeroable)]
pub struct Branches {
    kinks: f64,
    knots: f64,
}

impl Branches {
    /// Those at a point.
    pub fn of<M: Dae, S: Lanes>(v: &ArrayV<M, S::Cell>) -> Self {
        let mut numbers = [S::Cell::zeroed(); 2];
        if const { M::BRANCHES > 0 } {
            M::branches::<S>(v, &mut numbers);
        }
        Self { kinks: S::lane(&numbers[0], 0), knots: S::lane(&numbers[1], 0) }
    }

    /// How a step is to be looked at that has both.
    pub fn change(self, other: Self) -> Option<DefectCheck> {
        if self.kinks != other.kinks {
            Some(DefectCheck::Switch)
        } else {
            (self.knots != other.knots).then_some(DefectCheck::SplineKnot)
        }
    }
}

/// The errors of the last two accepted steps with this number of stages, from which that of the
/// next one is foreseen: of a smooth solution an estimate of order `s` behaves like `h^(s+1)`.
#[derive(Clone, Copy, Debug, Default)]
pub struct ErrorHistory {
    /// Lengths and errors, the last one first.
    last: [Option<(f64, f64)>; 2],
}

impl ErrorHistory {
    /// The error that is foreseen grows by this factor at most from step to step: what stands out
    /// tells of a jump, not of the steps that follow.
    const STEEP: f64 = 20.0;

    /// How many times as large an error of a step of length `h` is as foreseen: one at least, and
    /// where nothing is foreseen.
    pub fn growth(&self, h: f64, error: f64, order: f64) -> f64 {
        // Written so that NaN is one.
        1f64.max(error / self.foreseen(h, order)).min(1e12)
    }

    /// The larger error of those that the last two steps let expect.
    fn foreseen(&self, h: f64, order: f64) -> f64 {
        let [Some(last), Some(before)] = self.last else { return f64::INFINITY };
        let foreseen = |(step, error): (f64, f64)| error * Scalar::powf(h / step, order);
        foreseen(last).max(foreseen(before))
    }

    /// A step was accepted. Errors below `noise` are of rounding and foretell nothing.
    pub fn accepted(&mut self, h: f64, error: f64, order: f64, noise: f64) {
        if error > noise || self.last[1].is_none() {
            let most = Self::STEEP * self.foreseen(h, order);
            self.last = [Some((h, error.min(most))), self.last[0]];
        }
    }

    /// Forgets them: the next step is of another method.
    pub fn forget(&mut self) {
        *self = Self::default();
    }
}

/// Rejections of rough steps from one point. The error of a jump falls with the step size at
/// least; what does not fall are rounding errors, which are rough too.
#[derive(Clone, Copy, Debug, Default)]
pub struct DiscontinuityDetector {
    /// The length and the error of the step that was refused last.
    last: Option<(f64, f64)>,
    /// How often the error did not fall.
    kept: usize,
    /// Errors up to this are of rounding, as far as the run has seen.
    noise: f64,
}

impl DiscontinuityDetector {
    /// So often an error may stay: a jump is elsewhere in the next step.
    const STAGNATIONS: usize = 3;

    /// Whether an error may be that of a jump.
    pub fn may_be(&self, error: f64) -> bool {
        error > self.noise
    }

    /// A step of length `h` with this roughness and this error: whether it is to be refused.
    pub fn refuses(&mut self, h: f64, rough: f64, error: f64) -> bool {
        if !self.may_be(rough) {
            return false;
        }
        let error = rough.max(error);
        if let Some((step, before)) = self.last
            && error >= before * Scalar::sqrt(h / step)
        {
            self.kept += 1;
        }
        if self.kept >= Self::STAGNATIONS {
            self.noise = 2.0 * error;
            self.accepted();
            return false;
        }
        self.last = Some((h, error));
        true
    }

    /// A step was accepted.
    pub fn accepted(&mut self) {
        (self.last, self.kept) = (None, 0);
    }
}

/// Where steps are refused by much again and again the solution is not smooth: methods have no
/// higher order than their estimates there.
#[derive(Clone, Copy, Debug, Default)]
pub struct RejectionHistory {
    /// Those by much count twice, and accepted steps take one away.
    count: usize,
    /// So many steps more are looked at whatever their estimates are.
    after_rejection: usize,
}

/// An error that is refused by much.
pub(super) const STRONG_REJECTION: f64 = 8.0;

impl RejectionHistory {
    /// Where so much is left, as after refusals of two steps one after the other, the solution is
    /// not smooth.
    const NONSMOOTH_COUNT: usize = 3;
    /// So many steps after a refusal by much are watched: those that become shorter until an
    /// estimate is small by chance, and those that become longer behind a jump.
    const STEPS_AFTER_REJECTION: usize = 10;

    /// How often an estimate counts that is asked for this much less than the solution.
    pub fn weight(&self, tolerance_ratio: f64) -> f64 {
        if self.count >= Self::NONSMOOTH_COUNT {
            (tolerance_ratio / ORDER_REDUCTION_RATIO).max(1.0)
        } else {
            1.0
        }
    }

    /// A step with this error was refused.
    pub fn refused(&mut self, error: f64) {
        if error >= STRONG_REJECTION {
            self.count = (self.count + 2).min(2 * Self::NONSMOOTH_COUNT);
            self.after_rejection = Self::STEPS_AFTER_REJECTION;
        }
    }

    /// Whether a small estimate is to be doubted.
    pub fn is_after_rejection(&self) -> bool {
        self.after_rejection > 0
    }

    /// A step was accepted.
    pub fn accepted(&mut self) {
        self.count = self.count.saturating_sub(1);
        self.after_rejection = self.after_rejection.saturating_sub(1);
    }
}
