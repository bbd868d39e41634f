//! Functions of a problem: dynamics, costs and constraints.

pub(in crate::ocp) mod argument_checks;
pub(in crate::ocp) mod boundary;
pub(in crate::ocp) mod constraint;
pub(in crate::ocp) mod convex;
pub(in crate::ocp) mod cost;
pub(in crate::ocp) mod dynamics;
pub(in crate::ocp) mod least_squares;
pub(in crate::ocp) mod node_evaluation;
pub(in crate::ocp) mod result;
pub(in crate::ocp) mod sparsity;
pub(in crate::ocp) mod weights;
