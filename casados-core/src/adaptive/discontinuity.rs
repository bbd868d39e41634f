//! The branches of a model at a point: the outcomes of the conditions of `if`, `max` or `abs`, and
//! the pieces of its tables.

use crate::model::{ArrayV, Dae};
use crate::scalar::Lanes;
use bytemuck::Zeroable;

/// The change of branches within a step, in ascending order of strength.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum BranchChange {
    /// A spline knot: only the highest derivative of the spline jumps.
    SplineKnot,
    /// A switch between two branches of the model.
    Switch,
}

/// One number that identifies the conditions and pieces of linear tables, and one that identifies
/// the pieces of splines.
#[derive(Clone, Copy, Debug, Default, Zeroable)]
pub struct Branches {
    switch_code: f64,
    knot_code: f64,
}

impl Branches {
    /// The branches at a point.
    pub fn at_point<M: Dae, S: Lanes>(v: &ArrayV<M, S::Cell>) -> Self {
        let mut numbers = [S::Cell::zeroed(); 2];
        if const { M::BRANCHES > 0 } {
            M::branches::<S>(v, &mut numbers);
        }
        Self { switch_code: S::lane(&numbers[0], 0), knot_code: S::lane(&numbers[1], 0) }
    }

    /// The strongest change from `self` to `other`.
    pub fn change_to(self, other: Self) -> Option<BranchChange> {
        if self.switch_code != other.switch_code {
            Some(BranchChange::Switch)
        } else {
            (self.knot_code != other.knot_code).then_some(BranchChange::SplineKnot)
        }
    }
}
