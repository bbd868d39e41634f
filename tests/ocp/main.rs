//! Problems of optimal control: the chain of masses against references, small problems against
//! closed forms, mistakes.

#[path = "../../examples/models/chain.rs"]
#[allow(dead_code)]
mod chain_model;
#[path = "../../examples/models/chain_problem.rs"]
mod chain_problem;
#[path = "../runs/mod.rs"]
mod runs;

mod algebraic;
mod arrival;
mod batch;
mod boundary;
mod boundary_layers;
mod bounds;
mod chain;
mod closed_form;
mod collocation;
mod convex;
mod coupling;
mod curvature;
mod deadlines;
mod estimation;
mod free_end;
mod free_estimates;
mod free_parameters;
mod guesses;
mod inner_points;
mod ipm;
mod lifted;
mod linear_controls_and_integrals;
mod linear_equations;
mod options;
mod phases;
mod polynomial_controls;
mod published;
mod random;
mod real_time;
mod scaling;
mod second_attempt;
mod solution_derivatives;
mod trajectory;
mod verification;
mod warnings;

type Test = Result<(), Box<dyn std::error::Error>>;
