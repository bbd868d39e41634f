//! Problems of optimal control.

#[path = "../../examples/models/chain.rs"]
#[allow(dead_code)]
mod chain_model;
#[path = "../data/mod.rs"]
mod data;

mod chain;

type Test = Result<(), Box<dyn std::error::Error>>;
