//! The stages of a step: the [model at them](evaluate), [looked at](view) from one of them on, and
//! [sums](compensated) that do not round.

pub(super) mod compensated;
pub(super) mod evaluate;
pub(super) mod view;
