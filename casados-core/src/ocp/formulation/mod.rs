//! The formulation of a problem: functions, bounds, horizon, and their memory.
//!
//! | | |
//! | --- | --- |
//! | `functions/` | the traits of costs, constraints and dynamics, and costs and constraints |
//! | `problem`, `horizon` | a problem without numbers, and the times of its nodes |
//! | `instance/` | a problem on a horizon, with memory, and points inside of its intervals |
//! | `free`, `declare` | parameters and end times that are found, and how a problem gets them and points inside of intervals |
//! | `bounds`, `limit`, `soften`, `coupling`, `arrival` | its bounds, couplings and arrival cost |
//! | `names`, `labels`, `check`, `error` | refusals by name |
//! | `print` | a problem as mathematics |

pub(in crate::ocp) mod arrival;
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
