//! Answers of solvers of optimal control: derivatives of solutions, verdicts on problems that have
//! none or several, errors and what they say.

mod coupled_derivatives;
mod debug;
mod degenerate;
mod errors;
mod failing_intervals;
mod far;
mod infeasible;
mod mass;
mod messages;
mod outcomes;
mod print;
mod return_map;
mod sensitivities;
mod smoothing;
mod solution_derivatives;
mod verdicts;
mod ways_out;
mod weights;

type Test = Result<(), Box<dyn std::error::Error>>;
