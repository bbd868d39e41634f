//! Whether a model changes its branch inside of a step: at a stage or at its end, beside its start.
//! Nobody knows what happens between two stages.

use super::*;

impl<M: Dae, T: Real, const S: usize, const G: usize> Collocation<M, T, S, G> {
    /// How the model at a stage or at the end of the step differs from that at its start: by a
    /// branch, or by no more than the pieces of its splines.
    pub(super) fn change(&mut self, start: &Start<'_, M, T>) -> Option<Look> {
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

    /// Whether a stage has passed a border since this was asked last; notes whether one is beyond
    /// a border from where the Jacobian was evaluated.
    pub(super) fn compare_branches(&mut self, convergence: &mut Convergence) -> bool {
        let mut passed = false;
        if const { M::BRANCHES == 0 } {
            return passed;
        }
        let mut point = ArrayV::<M, T>::zeroed();
        convergence.elsewhere = false;
        for stage in 0..S {
            take(self.memory.points[stage / GROUP].as_ref(), stage % GROUP, point.as_mut());
            let at = Branches::of::<M, T>(&point);
            let before = core::mem::replace(&mut self.memory.branches[stage], at);
            passed |= before.change(at) == Some(Look::Branch);
            convergence.elsewhere |= convergence.branches.change(at) == Some(Look::Branch);
        }
        passed
    }
}
