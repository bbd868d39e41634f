//! Forward sensitivities: the implicit function theorem at the converged stages.
//!
//! ```text
//! J dK = −(f_x,i V_n + f_w,i)        V_{n+1} = V_n + h Σ_i b_i dk_i
//! ```
//!
//! The [`sweep`] takes a step panel by panel: the [right-hand side](right_hand_side), the solution,
//! its [sums](checksum) over all directions, [rows of `D`](stage_rows) for second derivatives, the
//! [output](output) to [matrices] of results, which have the [gradient](gradient) in them. More is
//! [written](write) after the step where it is asked for. Derivatives whose equations have lost
//! digits are [refined](refine); the [dense fallback](dense_fallback) solves column by column.
//! [`memory`] is what a call keeps, in all directions or in [given ones](directional).

pub(super) mod checksum;
mod dense_fallback;
pub(super) mod directional;
pub(super) mod gradient;
mod matrices;
pub(super) mod memory;
pub(super) mod output;
mod refine;
pub(super) mod right_hand_side;
#[cfg(feature = "alloc")]
mod slopes;
pub(super) mod stage_sensitivities;
pub(super) mod sweep;
mod write_outputs;
