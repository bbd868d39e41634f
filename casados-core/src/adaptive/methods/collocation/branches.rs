//! Whether a model changes its branch inside of a step: at a stage or at its end, beside its start.
//! Nobody knows what happens between two stages.

use super::*;

impl<M: Dae, T: Real, const S: usize, const G: usize> Collocation<M, T, S, G> {
    /// How the model at a stage or at the end of the step differs from that at its start: by a
    /// branch, or by no more than the pieces of its splines.
    pub(super) fn change(&mut self, start: &StepContext<'_, M, T>) -> Option<BranchChange> {
        if const { M::BRANCHES == 0 } {
            return None;
        }
        let before = Branches::of::<M, T>(start.point);
        let mut point = ArrayV::<M, T>::zeroed();
        let mut change = None;
        for at in &self.memory.branches {
            change = change.max(before.change(*at));
        }
        if self.estimates(start, &mut point) {
            change = change.max(before.change(Branches::of::<M, T>(&point)));
        }
        change
    }

    /// Where the stages are beside borders: since this was asked last, and from where the branches
    /// are those of the `jacobian`.
    pub(super) fn sides(&mut self, jacobian: Branches) -> Sides {
        let mut sides = Sides::default();
        if const { M::BRANCHES == 0 } {
            return sides;
        }
        let mut point = ArrayV::<M, T>::zeroed();
        for stage in 0..S {
            take(self.memory.points[stage / GROUP].as_ref(), stage % GROUP, point.as_mut());
            let at = Branches::of::<M, T>(&point);
            let before = core::mem::replace(&mut self.memory.branches[stage], at);
            sides.passed |= before.change(at) == Some(BranchChange::Switch);
            sides.beyond |= jacobian.change(at) == Some(BranchChange::Switch);
        }
        sides
    }
}
