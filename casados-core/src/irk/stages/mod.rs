//! The stages of a step: the [initial guess](initial_guess), the [evaluation](evaluate) of the
//! model, and [compensated sums](compensated).

pub(super) mod compensated;
pub(super) mod evaluate;
pub(super) mod initial_guess;
