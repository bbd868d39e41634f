//! Increments of the simplified Newton method that are not made.
//!
//! With the Jacobian `J` of an earlier iterate the next increment is `J⁻¹ f(y − Δ)`, which natural
//! monotonicity asks to be no larger than `Δ` (P. Deuflhard, Newton Methods for Nonlinear Problems,
//! 2004, section 3.3). Where an unknown's is larger, the Jacobian says too little about where the
//! iteration is: Newton's method would go elsewhere, at times to another root. So the increment is
//! taken back, and the Jacobian renewed where it led from. With factors of the step before the
//! first increment is to be doubted as well, and the step begins again at its start values.
//!
//! It is asked unknown by unknown: linear ones are corrected at once, and would outweigh the
//! growing increments of a nonlinear one.

use crate::irk::workspace::StageWorkspace;
use crate::memory::Fallback;
use crate::model::{ArrayK, Dae};
use crate::scalar::Lanes;

/// An increment that grows by less than this part of its unknown may follow from those of others.
const MAX_GROWTH: f64 = 1.0 / 1024.0;

/// Whether the increments of an unknown grow, in any lane, by what
/// [`Update`](super::increment::Update) says of the `next` one.
#[inline(always)]
pub(super) fn exceeds_growth_bound<E: Lanes>(next: E) -> bool {
    E::any(E::lt(E::from_f64(1.0 + MAX_GROWTH), next))
}

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> StageWorkspace<M, E, S, F> {
    /// Takes back the increment in lanes where it grows, unless their residual is a rounding error;
    /// whether there are any. Without factors of this step `y` is left where it is.
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
