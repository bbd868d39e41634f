//! Answers of solvers of optimal control: derivatives of solutions, verdicts on problems that have
//! none or several, errors and what they say.

mod coupled_derivatives;
mod debug;
mod degenerate;
mod distant_solutions;
mod errors;
mod failing_intervals;
mod infeasible;
mod mass;
mod messages;
mod outcomes;
mod print;
mod profiles;
mod remedies;
mod return_map;
mod sensitivities;
mod smoothing;
mod solution_derivatives;
mod verdicts;
mod weights;

type Test = Result<(), Box<dyn std::error::Error>>;
