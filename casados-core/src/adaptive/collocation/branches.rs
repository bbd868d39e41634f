//! Whether a model changes its branch inside of a step: whether a condition of an `if`, a `max` or
//! an `abs` is another one at a stage than at the start, or the piece of a table. Nobody knows what
//! happens between two stages.

use super::*;

impl<M: Dae, T: Real, const S: usize, const G: usize> Collocation<M, T, S, G> {
    /// How the model at a stage or at the end of the step differs from that at its start: by a
    /// branch, or by no more than the pieces of its splines.
    pub(super) fn change(&mut self, start: &Start<'_, M, T>) -> Option<Look> {
        if const { M::BRANCHES == 0 } {
            return None;
        }
        let before = branches_at::<M, T>(start.point);
        let mut point = ArrayV::<M, T>::zeroed();
        let mut change = None;
        for stage in 0..S {
            take(self.memory.points[stage / GROUP].as_ref(), stage % GROUP, point.as_mut());
            change = change.max(difference(before, branches_at::<M, T>(&point)));
        }
        if self.estimates(start, &mut point) {
            change = change.max(difference(before, branches_at::<M, T>(&point)));
        }
        change
    }
}

fn difference<T: Real>([kinks, knots]: [T; 2], other: [T; 2]) -> Option<Look> {
    if kinks != other[0] { Some(Look::Branch) } else { (knots != other[1]).then_some(Look::Knot) }
}

fn branches_at<M: Dae, T: Real>(point: &ArrayV<M, T>) -> [T; 2] {
    let mut branches = [T::ZERO; 2];
    M::branches::<T>(point, &mut branches);
    branches
}
