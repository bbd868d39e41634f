//! Block elimination by a plan that was made before the program runs: [factors](factor), and
//! right-hand sides by them, [forward and back](solve) and [transposed](solve_transposed),
//! [micro-panel](micro_panel) by micro-panel.

pub mod factor;
mod micro_panel;
pub mod solve;
mod solve_transposed;
