//! Solvers with step-size control, against the exact flow.

use super::casadi::Casadi;
use super::rows::{Measured, Timer, run_in_turn};
use super::{Failure, MeasurementBudget};
use casados::prelude::*;
use casados_benches::case::{Case, Family, Mode};

/// A solver on a problem.
pub struct SolverRow {
    pub problem: String,
    pub nx: usize,
    pub solver: String,
    pub mode: Mode,
    pub measured: Result<Measured, String>,
}

/// CVODES, IDAS and diffsol at a tolerance of 1e-8, and casados with a method of similar accuracy.
pub fn measure_adaptive(casadi: &mut Casadi, effort: MeasurementBudget) -> Result<Vec<SolverRow>, Failure> {
    let mut problems = vec![("pendulum", Case::pendulum(Family::Gauss, 4, 1))];
    for (name, masses) in [("chain 3", 3), ("chain 5", 5), ("chain 7", 7)] {
        problems.push((name, Case::chain(masses, Family::Gauss, 4, 4)));
    }
    problems.push(("awe", Case::awe()?));
    let mut lines = Vec::new();
    for (problem, mut case) in problems {
        let (mut flow, _) = casadi.exact_flow(&case)?;
        let columns = flow.forward.len() / case.nx;
        let product =
            |j| case.lambda.iter().enumerate().map(|(i, l)| l * flow.forward[i * columns + j]).sum();
        flow.adjoint = (0..columns).map(product).collect();
        // The orbit's first interval only: one flow.
        case.reference = Some(("flow", flow.clone()));
        case.single = 1;
        let mut line = |solver: &str, mode, measured: Result<Measured, String>| {
            let (problem, solver) = (problem.to_owned(), solver.to_owned());
            lines.push(SolverRow { problem, nx: case.nx, solver, mode, measured });
        };
        let timers = Mode::ALL_MODES.map(|mode| Timer::new(&case, 1e-8, Start::Zero, mode, 0..1));
        let ours = run_in_turn(timers.into_iter().collect::<Result<_, _>>()?, effort)?;
        for (ours, mode) in ours.into_iter().zip(Mode::ALL_MODES) {
            line(&format!("casados, {}", case.name.rsplit_once(' ').map_or("", |(_, m)| m)), mode, Ok(ours));
        }
        let solvers: &[&str] = if case.model == "awe" { &["idas"] } else { &["cvodes", "idas"] };
        for solver in solvers {
            for mode in Mode::ALL_MODES {
                let measured = casadi.time(&case, solver, mode, effort.seconds, Some(&flow));
                line(&format!("CasADi, {solver}"), mode, measured);
            }
        }
        #[cfg(feature = "diffsol")]
        for (solver, mode, measured) in super::diffsol::measure(&case, &flow, effort) {
            line(&format!("diffsol, {solver}"), mode, measured);
        }
    }
    Ok(lines)
}
