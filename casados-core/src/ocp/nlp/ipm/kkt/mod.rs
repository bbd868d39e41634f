//! Newton's equations of the barrier problem: their memory, scaling, first point and solution.

pub(in crate::ocp::nlp::ipm) mod lengths;
pub(in crate::ocp::nlp::ipm) mod measure;
pub(in crate::ocp::nlp::ipm) mod newton;
pub(in crate::ocp::nlp::ipm) mod regularisation;
pub(in crate::ocp::nlp::ipm) mod scaling;
pub(in crate::ocp::nlp::ipm) mod start;
pub(in crate::ocp::nlp::ipm) mod work;
