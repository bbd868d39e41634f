//! Recovery from failed steps: restoration phase, elastic mode, restart; and verdicts.

pub(in crate::ocp::nlp::ipm) mod convergence;
pub(in crate::ocp::nlp::ipm) mod elastic_mode;
pub(in crate::ocp::nlp::ipm) mod phase;
pub(in crate::ocp::nlp::ipm) mod restart;
pub(in crate::ocp::nlp::ipm) mod unbounded;
