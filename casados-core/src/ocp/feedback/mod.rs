//! Feedback in real time.

pub(in crate::ocp) mod real_time;
