//! Detection of discontinuities: compares the branches of the model at the stages and at the end of
//! a step with those at its start. Changes between two stages are invisible.

use super::*;

impl<M: Dae, T: Real, const S: usize, const G: usize> Collocation<M, T, S, G> {
    /// The strongest change of branches between the start of the step and its stages or end.
    pub(super) fn branch_change(&mut self, start: &StepContext<'_, M, T>) -> Option<BranchChange> {
        if const { M::BRANCHES == 0 } {
            return None;
        }
        let before = Branches::at_point::<M, T>(start.start_point);
        let mut point = ArrayV::<M, T>::zeroed();
        let mut change = None;
        for at in &self.memory.stage_branches {
            change = change.max(before.change_to(*at));
        }
        if self.estimate_point(start, &mut point) {
            change = change.max(before.change_to(Branches::at_point::<M, T>(&point)));
        }
        change
    }

    /// Whether stages have crossed a switching surface since the last call, and whether they are on
    /// another branch than the `jacobian`.
    pub(super) fn update_surface_crossing(&mut self, jacobian: Branches) -> SurfaceCrossing {
        let mut sides = SurfaceCrossing::default();
        if const { M::BRANCHES == 0 } {
            return sides;
        }
        let mut point = ArrayV::<M, T>::zeroed();
        for stage in 0..S {
            copy_lane(
                self.memory.stage_points[stage / STAGES_PER_GROUP].as_ref(),
                stage % STAGES_PER_GROUP,
                point.as_mut(),
            );
            let at = Branches::at_point::<M, T>(&point);
            let before = core::mem::replace(&mut self.memory.stage_branches[stage], at);
            sides.crossed_last |= before.change_to(at) == Some(BranchChange::Switch);
            sides.off_jacobian_branch |= jacobian.change_to(at) == Some(BranchChange::Switch);
        }
        sides
    }
}
