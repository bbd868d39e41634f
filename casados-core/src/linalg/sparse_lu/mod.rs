//! Sparse block elimination with a plan: [factors](factor), [forward and back substitution](solve),
//! the [transposed systems](solve_transposed), and the transfer of [panel rows](micro_panel).

pub mod factor;
mod micro_panel;
pub mod solve;
mod solve_transposed;
