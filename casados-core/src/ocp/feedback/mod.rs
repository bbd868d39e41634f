//! Real-time feedback: the controller, its two phases, the contraction test, and closed loops.

#[cfg(feature = "alloc")]
pub(in crate::ocp) mod closed_loop;
#[cfg(feature = "alloc")]
mod closed_record;
pub(in crate::ocp) mod contraction;
pub(in crate::ocp) mod phases;
pub(in crate::ocp) mod real_time;
