//! Newton's equations of the barrier problem: dimensions, scaling, initial point and solution.

pub(in crate::ocp::nlp::ipm) mod barrier_function;
pub(in crate::ocp::nlp::ipm) mod dimensions;
pub(in crate::ocp::nlp::ipm) mod initial_point;
pub(in crate::ocp::nlp::ipm) mod newton;
pub(in crate::ocp::nlp::ipm) mod regularisation;
pub(in crate::ocp::nlp::ipm) mod scaling;
pub(in crate::ocp::nlp::ipm) mod workspace;
