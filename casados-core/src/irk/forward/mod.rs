//! Forward sensitivities: the implicit function theorem at the converged stages.
//!
//! ```text
//! J dK = −(f_x,i V_n + f_w,i)        V_{n+1} = V_n + h Σ_i b_i dk_i
//! ```
//!
//! The [`sweep`] takes a step panel by panel: the [right-hand side](right_hand_side), the solution,
//! its [sums](checksum) over all directions, [rows of `D`](stage_rows) for second derivatives, the
//! [output](output). More is [written](write) after the step where it is asked for. Derivatives
//! whose equations have lost digits are [refined](refine). [`memory`] is what a call keeps.

pub(super) mod checksum;
pub(super) mod memory;
pub(super) mod output;
mod refine;
pub(super) mod right_hand_side;
pub(super) mod stage_rows;
pub(super) mod sweep;
mod write;
