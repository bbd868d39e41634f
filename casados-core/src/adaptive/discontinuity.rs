//! The branches that a model takes at a point: which conditions of `if`, `max` or `abs` hold there,
//! and which pieces its tables have.

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
    switch_code: f64,
    knot_code: f64,
}

impl Branches {
    /// Those at a point.
    pub fn at_point<M: Dae, S: Lanes>(v: &ArrayV<M, S::Cell>) -> Self {
        let mut numbers = [S::Cell::zeroed(); 2];
        if const { M::BRANCHES > 0 } {
            M::branches::<S>(v, &mut numbers);
        }
        Self { switch_code: S::lane(&numbers[0], 0), knot_code: S::lane(&numbers[1], 0) }
    }

    /// How the model changes in a step that has both.
    pub fn change_to(self, other: Self) -> Option<BranchChange> {
        if self.switch_code != other.switch_code {
            Some(BranchChange::Switch)
        } else {
            (self.knot_code != other.knot_code).then_some(BranchChange::SplineKnot)
        }
    }
}
