//! Feedback in real time: the controller, its two phases, whether its iterations contract, and
//! closed loops.

#[cfg(feature = "alloc")]
pub(in crate::ocp) mod closed_loop;
#[cfg(feature = "alloc")]
mod closed_record;
pub(in crate::ocp) mod contraction;
pub(in crate::ocp) mod phases;
pub(in crate::ocp) mod real_time;
