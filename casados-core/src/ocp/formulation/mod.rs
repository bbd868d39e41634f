//! The formulation of a problem: functions, bounds, horizon, and their memory.
//!
//! | | |
//! | --- | --- |
//! | `functions/` | traits of dynamics, costs and constraints; costs and constraints |
//! | `problem`, `horizon` | the functions of a problem, and the times of its nodes |
//! | `instance/` | a problem on a horizon, with memory, and points inside its intervals |
//! | `free_parameters` | free parameters and end times |
//! | `free_parameters_and_points` | adding free parameters, and points inside intervals |
//! | `bounds`, `variable_bounds`, `soften` | bounds and penalties |
//! | `coupling`, `arrival` | couplings and arrival cost |
//! | `bernstein` | values and parts of polynomial controls |
//! | `names`, `labels`, `check`, `error` | errors by name |
//! | `print` | a problem as formulas |

pub(in crate::ocp) mod arrival;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod bernstein;
pub(in crate::ocp) mod bounds;
pub(in crate::ocp) mod check;
pub(in crate::ocp) mod coupling;
pub(in crate::ocp) mod error;
pub(in crate::ocp) mod free_parameters;
#[cfg(feature = "alloc")]
mod free_parameters_and_points;
pub(in crate::ocp) mod functions;
pub(in crate::ocp) mod horizon;
pub(in crate::ocp) mod instance;
pub(in crate::ocp) mod labels;
pub(in crate::ocp) mod names;
pub(in crate::ocp) mod print;
pub(in crate::ocp) mod problem;
pub(in crate::ocp) mod program;
pub(in crate::ocp) mod soften;
pub(in crate::ocp) mod variable_bounds;
