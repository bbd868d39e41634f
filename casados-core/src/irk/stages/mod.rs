//! The stages of a step: the [initial guess](initial_guess), the [model at them](evaluate), and
//! [sums](compensated) that do not round.

pub(super) mod compensated;
pub(super) mod evaluate;
pub(super) mod initial_guess;
