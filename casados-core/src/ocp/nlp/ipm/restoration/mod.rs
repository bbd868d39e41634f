//! Restoration: violations alone, penalties of bounds, a second attempt, and verdicts.

pub(in crate::ocp::nlp::ipm) mod again;
pub(in crate::ocp::nlp::ipm) mod elastic;
pub(in crate::ocp::nlp::ipm) mod feasibility;
pub(in crate::ocp::nlp::ipm) mod verdict;
