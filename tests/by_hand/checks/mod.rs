//! Tests of the checks themselves.

mod example;
mod integrators;
mod models;
mod scalars;
