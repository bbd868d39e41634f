//! The branches that a model takes at a point: which conditions of `if`, `max` or `abs` hold there,
//! and which pieces its tables have.

use super::tolerances::ORDER_REDUCTION_RATIO;
use crate::model::{ArrayV, Dae};
use crate::scalar::Lanes;
use bytemuck::Zeroable;

/// How the model changes inside a step, the strongest change last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum BranchChange {
    /// A spline changes its piece: no lower derivative jumps than its highest.
    SplineKnot,
    /// The model changes its branch.
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

    /// How the model changes in a step that has both.
    pub fn change(self, other: Self) -> Option<BranchChange> {
        if self.kinks != other.kinks {
            Some(BranchChange::Switch)
        } else {
            (self.knots != other.knots).then_some(BranchChange::SplineKnot)
        }
    }
}

/// Where steps are refused by much again and again the solution is not smooth: methods have no
/// higher order than their estimates there.
#[derive(Clone, Copy, Debug, Default)]
pub struct RejectionHistory {
    /// Those by much count twice, and accepted steps take one away.
    count: usize,
}

/// An error that is refused by much.
pub(super) const STRONG_REJECTION: f64 = 8.0;

impl RejectionHistory {
    /// Where so much is left, as after refusals of two steps one after the other, the solution is
    /// not smooth.
    const NONSMOOTH_COUNT: usize = 3;
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
        }
    }

    /// A step was accepted.
    pub fn accepted(&mut self) {
        self.count = self.count.saturating_sub(1);
    }
}
