//! Feedback in real time: the controller, its two phases, and whether its iterations contract.

pub(in crate::ocp) mod contraction;
pub(in crate::ocp) mod phases;
pub(in crate::ocp) mod real_time;
