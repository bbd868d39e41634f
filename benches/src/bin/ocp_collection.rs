//! The twenty problems of `examples/models/ocps` from plain guesses with default options and exact
//! Hessians, beside IPOPT with the same discretisation (CasADi, where `CASADOS_PYTHON` or `python3`
//! has it).
//!
//! ```text
//! cargo run --release --manifest-path benches/Cargo.toml --bin ocp_collection
//! ```

#[path = "../../../examples/models/ocps/mod.rs"]
mod ocps;

use casados::ocp::{Exact, Formulation, HeapOcp, HeapSqp, SecondOrder, Status};
use casados_benches::peer::Peer;
use ocps::Failure;
use serde_json::json;

/// Iterations of both, where both solve it.
#[derive(Default)]
struct Sums {
    mine: usize,
    theirs: u64,
}

/// A row of the table.
fn row<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
    name: &str,
    mut ocp: HeapOcp<P>,
    ipopt: &mut Option<Peer>,
    sums: &mut Sums,
) -> Result<(), Failure> {
    let mut sqp = HeapSqp::new(&ocp)?.exact(Exact::default());
    let outcome = sqp.solve(&mut ocp)?;
    let status = match outcome.status {
        Status::Converged => "solved".into(),
        Status::Infeasible { constraint, violation } => {
            format!("infeasible: {constraint} by {violation:.2}")
        }
        other => other.to_string(),
    };
    print!("| {name} | {status} | {} | {:.7} | ", outcome.iterations, outcome.objective);
    let answer = ipopt.as_mut().map(|ipopt| ipopt.ask(&json!({ "problem": name })));
    let theirs = match answer {
        None => " | | ".into(),
        Some(Err(error)) => format!("{error} | | "),
        Some(Ok(answer)) => {
            let solved = answer["status"] == "Solve_Succeeded";
            let iterations = answer["iterations"].as_u64().unwrap_or(0);
            if solved && outcome.is_converged() {
                sums.mine += outcome.iterations;
                sums.theirs += iterations;
            }
            let status = if solved { "solved" } else { answer["status"].as_str().unwrap_or("") };
            let objective = answer["objective"].as_f64().unwrap_or(f64::NAN);
            format!("{} | {iterations} | {objective:.7} ", status.replace('_', " "))
        }
    };
    println!("{theirs}|");
    Ok(())
}

fn main() -> Result<(), Failure> {
    let mut ipopt = Peer::start("casadi_collection.py", |command| command).ok();
    let mut sums = Sums::default();
    println!("| problem | casados | iterations | objective | IPOPT | iterations | objective |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    macro_rules! rows {
        ($($theme:ident::$name:ident),* $(,)?) => {$(
            row(stringify!($name), ocps::$theme::$name()?, &mut ipopt, &mut sums)?;
        )*};
    }
    ocps::each_ocp!(rows);
    let Sums { mine, theirs } = sums;
    println!("| in sum | | {mine} | | | {theirs} | |");
    row("car_without_time", ocps::vehicles::car_within(1.0)?, &mut ipopt, &mut Sums::default())?;
    row("walls", ocps::vehicles::walls()?, &mut ipopt, &mut Sums::default())
}
