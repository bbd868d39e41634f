//! A rod is heated at one end until the other has 80 °C: the heat equation in twenty cells, the
//! flow of heat within its bounds, and the heated end never above 140 °C.
//!
//! ```text
//! cargo run --release --example heat [PICTURE.svg]
//! ```

#[path = "models/heat.rs"]
mod heat;

use casados::ocp::{HeapSqp, Horizon, LeastSquaresCost, Problem};
use casados::plot::{Figure, Panel};
use casados::prelude::*;
use heat::rod::{CONDUCTIVITY, EndAndFlow, LENGTH, Rod, TRANSFER};
use nalgebra::{SVector, vector};
use std::error::Error;
use std::path::PathBuf;

const CELLS: usize = 20;
const AIR: f64 = 20.0; // °C
const TARGET: f64 = 80.0; // °C, of the cold end
const MINUTES: usize = 120;

fn main() -> Result<(), Box<dyn Error>> {
    let path = match std::env::args_os().nth(1) {
        Some(path) => PathBuf::from(path),
        None => PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/plots/heat.svg")),
    };
    println!("{}", Rod::<CELLS>::describe());

    // What flows through a rod at rest leaves it at its end; the last cell is half a cell away.
    let flow =
        1e-3 * TRANSFER * (TARGET - AIR) / (1.0 + 0.5 * TRANSFER * LENGTH / CELLS as f64 / CONDUCTIVITY);
    let mut irk = Irk::<Rod<CELLS>, RadauIIA<3>>::new(Options { steps: 20, ..Default::default() })?;
    irk.set_parameters(&vector![AIR])?;
    let cold = SVector::<f64, CELLS>::repeat(AIR);
    let rest = irk.solve(&cold, &vector![flow], 3.6e5)?.x;
    println!("{flow:.3} kW/m² hold the ends at {:.2} °C and {:.2} °C", rest[0], rest[CELLS - 1]);

    let mut dynamics = Irk::<Rod<CELLS>, RadauIIA<2>>::new(Options::default())?;
    dynamics.set_parameters(&vector![AIR])?;
    let mut ocp = Problem::new(dynamics)
        .running_cost(LeastSquaresCost::<EndAndFlow<CELLS>>::diagonal(&[1.0, 1.0]))
        .on(Horizon::uniform(MINUTES, 60.0))?;
    ocp.set_parameters(.., &[AIR])?.set_reference(.., &[TARGET, flow])?;
    ocp.fix_initial_state(cold.as_slice())?.guess(cold.as_slice(), &[flow])?;
    ocp.bound("u", .., 0.0, 20.0)?.bound("x[0]", .., f64::NEG_INFINITY, 140.0)?;
    let mut sqp = HeapSqp::new(&ocp)?.gauss_newton();
    let outcome = sqp.solve(&mut ocp)?;
    println!("{}{outcome}", sqp.log());
    if !outcome.is_converged() {
        return Err(outcome.to_string().into());
    }
    let end = ocp.stage(MINUTES)?.x[CELLS - 1];
    println!("after {MINUTES} minutes the cold end has {end:.2} °C");

    let solution = ocp.solution()?;
    Figure::new()
        .size(760, 560)
        .with(Panel::trajectories(&solution, "x[0]")?.title("Heated end, °C"))
        .with(Panel::trajectories(&solution, "x[19]")?.title("Cold end, °C").limit(TARGET))
        .with(Panel::trajectories(&solution, "u")?.title("Flow of heat, kW/m²").x("time, s"))
        .save(&path)?;
    println!("{}", path.display());
    Ok(())
}
