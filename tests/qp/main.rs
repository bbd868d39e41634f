//! Quadratic programs of optimal control: stored ones against their reference solutions, hard ones,
//! mistakes, and random ones against clarabel. Every solution is judged by `residuals`, which is
//! written from the definition of the problem.

#[path = "../runs/mod.rs"]
mod runs;

mod arbitrary_data;
mod batch;
mod chain;
mod classes;
mod coupling;
mod difficult_problems;
mod errors;
mod infeasible;
mod known_solutions;
mod random;
mod side_by_side;
mod units;
mod unstable;

use casados::qp::{
    HeapInteriorPoint, HeapQp, HeapSolution, QpError, QpSolver, QpStart, QpStatistics, Residuals, residuals,
};

type Test = Result<(), Box<dyn std::error::Error>>;

/// A solution to 1e-10, and its residuals.
fn solve(qp: &HeapQp<f64>) -> Result<(HeapSolution<f64>, QpStatistics, Residuals), QpError> {
    solve_to(1e-10, qp)
}

/// A solution to a tolerance that is below what is asserted, and its residuals.
fn solve_to(
    tolerance: f64,
    qp: &HeapQp<f64>,
) -> Result<(HeapSolution<f64>, QpStatistics, Residuals), QpError> {
    let mut solver = HeapInteriorPoint::new();
    solver.options.tolerance = tolerance;
    let mut solution = HeapSolution::new(qp.dims())?;
    let statistics = solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
    let (residuals, objective) = residuals(qp.view(), &solution);
    // Sums of at most some hundred terms of sizes up to 1e2, rounded in a different order; and soft
    // violations are complementary to the tolerance only.
    assert!(residuals.largest() < 10.0 * tolerance, "{residuals}");
    assert!((objective - statistics.objective).abs() <= 1e-8 * (1.0 + objective.abs()));
    Ok((solution, statistics, residuals))
}
