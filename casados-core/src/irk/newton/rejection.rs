//! Rejection of growing increments of the simplified Newton method.
//!
//! With the Jacobian `J` of an earlier iterate the next increment is `J⁻¹ f(y − Δ)`. Natural
//! monotonicity requires that it is no larger than `Δ` (P. Deuflhard, Newton Methods for Nonlinear
//! Problems, 2004, section 3.3). If the increment of an unknown grows, the Jacobian does not
//! approximate that at the iterate, and Newton's method would take another direction, possibly to
//! another root. The increment is then undone, and the Jacobian is updated at the preceding
//! iterate. With factors of the preceding step the first increment is unreliable too, so that the
//! step restarts from its initial guess.
//!
//! The test is applied to each unknown: linear unknowns are exact after one iteration, and would
//! hide the growth of a nonlinear one in a norm.

use crate::irk::workspace::StageWorkspace;
use crate::memory::Fallback;
use crate::model::{ArrayK, Dae};
use crate::scalar::Lanes;

/// Growth of an increment, relative to its unknown, that increments of other unknowns may cause.
const MAX_GROWTH: f64 = 1.0 / 1024.0;

/// Whether the increments of an unknown grow in any lane; `next` is the second result of
/// [`UpdateUnknowns`](super::increment::UpdateUnknowns).
#[inline(always)]
pub(super) fn exceeds_growth_bound<E: Lanes>(next: E) -> bool {
    E::any(E::lt(E::from_f64(1.0 + MAX_GROWTH), next))
}

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> StageWorkspace<M, E, S, F> {
    /// Undoes growing increments, except in lanes whose residual is a rounding error; returns
    /// whether there are any. If the Jacobian was not updated in this step, `y` is left unchanged,
    /// since the step restarts.
    #[cold]
    #[inline(never)]
    pub(super) fn reject_growing_increments(
        &mut self,
        y: &mut ArrayK<M, [E; S]>,
        next: E,
        renewed_in_step: bool,
    ) -> bool {
        let grows = E::lt(E::from_f64(1.0 + MAX_GROWTH), next);
        let rejected = E::and(grows, E::not(self.residual_is_rounding()));
        if renewed_in_step {
            for (y, increment) in y.as_mut().iter_mut().zip(self.increment.as_ref()) {
                for (y, [delta]) in y.iter_mut().zip(increment) {
                    *y = E::select(rejected, *y + *delta, *y);
                }
            }
        }
        E::any(rejected)
    }
}
