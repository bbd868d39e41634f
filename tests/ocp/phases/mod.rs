//! Problems of several phases: closed forms, published values, the QP by differences, mistakes.

mod bounce;
mod collocated;
mod derivatives;
pub mod kkt;
mod launch;
mod mistakes;
mod program;
mod quadratic;
mod robot;
mod shared;
