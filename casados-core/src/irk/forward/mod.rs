//! Forward sensitivities: the implicit function theorem at the converged stages.
//!
//! ```text
//! J dK = −(f_x,i V_n + f_w,i)        V_{n+1} = V_n + h Σ_i b_i dk_i
//! ```
//!
//! The [`sweep`] takes a step panel by panel: the [right-hand side](right_hand_side), the solution,
//! its [checksums](checksum) over all directions, [rows of `D`](stage_sensitivities) for second
//! derivatives, and the [output](output) to the [matrices] of results, from which the
//! [gradient](gradient) is computed. Further outputs of a step are [written](write_outputs) on
//! demand. Derivatives that lost digits are [refined](refine); the [dense fallback](dense_fallback)
//! solves column by column. [`memory`] holds a call in all directions, [`directional`] in given
//! ones.

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
