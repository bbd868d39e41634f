//! Contradictory hard bounds of coupled variables, found before any function is evaluated.

use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::solution::outcome::Status;
use crate::qp::{Bounds, QpField, Side, StageDims, marked_indices};
use crate::scalar::Real;

/// The largest hard lower bound and the smallest hard upper bound, each with its stage.
#[derive(Clone, Copy)]
struct BoundIntersection {
    lower: (f64, usize),
    upper: (f64, usize),
}

impl BoundIntersection {
    const UNBOUNDED: Self = Self { lower: (f64::NEG_INFINITY, 0), upper: (f64::INFINITY, 0) };

    fn intersect<T: Real>(&mut self, bounds: &Bounds<'_, T>, index: usize, stage: usize) {
        let is_hard = |penalties: &[T]| penalties.get(index).is_some_and(|p| !p.is_finite());
        let number = |values: &[T]| values.get(index).map(|value| value.to_f64());
        if let Some(lower) = number(bounds.lower).filter(|&lower| lower > self.lower.0)
            && is_hard(bounds.lower_linear)
        {
            self.lower = (lower, stage);
        }
        if let Some(upper) = number(bounds.upper).filter(|&upper| upper < self.upper.0)
            && is_hard(bounds.upper_linear)
        {
            self.upper = (upper, stage);
        }
    }
}

impl<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Returns [`Status::Infeasible`] if the intersection of the hard bounds is empty: of a shared
    /// control over all stages, or of a periodic state over both ends. The violation is the
    /// distance between the largest lower and the smallest upper bound.
    pub(in crate::ocp) fn contradictory_bounds(&self, tolerance: f64) -> Option<Status> {
        let (qp, last) = (self.qp.view(), self.intervals());
        let controls = marked_indices(qp.shared()).map(|index| {
            let mut common = BoundIntersection::UNBOUNDED;
            for (k, stage) in qp.stages().enumerate() {
                common.intersect(&stage.u_bounds(), index, k);
            }
            (QpField::ControlBounds, index, common)
        });
        let states = marked_indices(qp.periodic()).map(|index| {
            let mut common = BoundIntersection::UNBOUNDED;
            for (k, stage) in qp.stages().enumerate().filter(|&(k, _)| k == 0 || k == last) {
                common.intersect(&stage.x_bounds(), index, k);
            }
            (QpField::StateBounds, index, common)
        });
        controls.chain(states).find_map(|(field, index, BoundIntersection { lower, upper })| {
            let violation = lower.0 - upper.0;
            let is_violated = violation > tolerance * lower.0.abs().max(1.0);
            let constraint = self.name(field, lower.1, index, Side::Lower);
            is_violated.then_some(Status::Infeasible { constraint, violation })
        })
    }
}
