//! The power-optimal periodic orbit of an aircraft on a tether, by multiple shooting and a
//! nonlinear interior point, from each of three guesses.
//!
//! ```text
//! cargo run --release --example awe_orbit
//! ```
//!
//! The second experiment of Frey, De Schutter and Diehl, "Fast integrators with sensitivity
//! propagation for use in CasADi": 40 intervals, Radau IIA with four stages, all 22 physical states
//! periodic, 21 linear and 9 nonlinear path constraints. The reference solution is by CasADi 3.8.2
//! and IPOPT with direct collocation. Its tension at a node solves the equations there; here it is
//! where the integrator's stages continue to, which moves the optimum by 8e-7.

#[path = "../models/awe.rs"]
mod awe;
#[path = "../../tests/data/mod.rs"]
mod data;

use awe::Awe;
use casados::ocp::{
    Constraint, Formulation, GeneralCost, HeapIpm, HeapOcp, Horizon, Problem, SecondOrder, Shooting,
};
use casados::prelude::*;
use casados::qp::residuals;
use data::Record;
use std::error::Error;
use std::process::ExitCode;
use std::time::Instant;

const GUESSES: [&str; 3] = ["guess_dc", "guess_pow", "guess_init"];
/// The interpolated tension moves the objective by 8e-7.
const TOLERANCE: f64 = 2e-6;

/// The nonlinear path constraints, scaled, all at least zero: tension, airspeed, angles of attack
/// and sideslip, angle between tether and aircraft.
#[function]
fn limits(x: [f64; 23], z: [f64; 1], _u: [f64; 4]) -> [f64; 9] {
    const TETHER_SCALE: f64 = 12.499305032751677;
    const LENGTH: f64 = 434.287; // m
    const SPEED: f64 = 41.23105625617661; // m/s
    const DEGREE: f64 = core::f64::consts::PI / 180.0;

    let tension = TETHER_SCALE * z[0] * LENGTH;
    let wind = 10.0 * ((x[2] * x[2] + 1.0).sqrt() / 100.0).powf(0.15);
    let air = [wind - x[3], -x[4], -x[5]];
    let dot = |a: [f64; 3], column: usize| {
        a[0] * x[9 + 3 * column] + a[1] * x[10 + 3 * column] + a[2] * x[11 + 3 * column]
    };
    let speed = (air[0] * air[0] + air[1] * air[1] + air[2] * air[2]).sqrt();
    let (chord, span, up) = (dot(air, 0), dot(air, 1), dot(air, 2));
    let distance = (x[0] * x[0] + x[1] * x[1] + x[2] * x[2]).sqrt();
    [
        (1800.0 - tension) / 1800.0,
        (tension - 50.0) / 50.0,
        1.0 - speed / 32.0,
        speed / 10.0 - 1.0,
        (9.0 * DEGREE * chord - up) / SPEED / (9.0 * DEGREE),
        (up + 6.0 * DEGREE * chord) / SPEED / (6.0 * DEGREE),
        (20.0 * DEGREE * chord - span) / SPEED / (20.0 * DEGREE),
        (span + 20.0 * DEGREE * chord) / SPEED / (20.0 * DEGREE),
        (dot([x[0], x[1], x[2]], 2) - (40.0 * DEGREE).cos() * distance) / 500.0,
    ]
}

/// The last state accumulates the cost.
#[function]
fn accumulated(x: [f64; 23], _z: [f64; 1], _u: [f64; 4]) -> f64 {
    x[22]
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("awe_orbit: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let reference = Record::load("awe/orbit.json")?;
    let objective = reference.number("objective")?;
    println!("guess       iterations  objective      residual     ms  ms/iteration");
    for guess in GUESSES {
        let mut ocp = orbit(reference.number("T")?)?;
        begin(&mut ocp, &reference.record(guess)?)?;
        let mut ipm = HeapIpm::new(&ocp)?;
        let start = Instant::now();
        let outcome = ipm.solve(&mut ocp)?;
        let milliseconds = 1e3 * start.elapsed().as_secs_f64();
        // Judged by code that is not the solver's.
        let (judged, _) = residuals(ocp.qp(), ocp.iterate());
        println!(
            "{guess:10} {:11} {:14.9} {:11.1e} {milliseconds:6.1} {:13.2}",
            outcome.iterations,
            outcome.objective,
            judged.largest(),
            milliseconds / outcome.iterations.max(1) as f64,
        );
        if !outcome.is_converged() || (outcome.objective - objective).abs() > TOLERANCE {
            return Err(format!("{guess}: {outcome}\n{}", ipm.log()).into());
        }
    }
    println!("reference              {objective:14.9}");
    Ok(())
}

/// The problem on its horizon, with all bounds.
fn orbit(h: f64) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Box<dyn Error>> {
    const DEGREE: f64 = core::f64::consts::PI / 180.0;
    let n = 40;
    let batch = Batch::<Awe, RadauIIA<4>>::new(Options { start: Start::Zero, ..Default::default() })?;
    let problem = Problem::new(Shooting::new(batch))
        .terminal_cost(GeneralCost::<Accumulated>::new())
        .path_constraints(Constraint::<Limits>::new([0.0; 9], [f64::INFINITY; 9]));
    let mut ocp = problem.on(Horizon::uniform(n, h))?;
    ocp.free_initial_state();
    for name in ["x.q", "x.dq", "x.omega", "x.r", "x.delta", "x.kappa"] {
        ocp.periodic(name)?;
    }
    // The last state is the first one, and has its bounds there.
    ocp.bound("x.q[2]", ..n, 100.0, f64::INFINITY)?;
    ocp.bound("x.omega", ..n, -50.0 * DEGREE, 50.0 * DEGREE)?;
    for (index, most) in [20.0, 30.0, 30.0].into_iter().enumerate() {
        ocp.bound(&format!("x.delta[{index}]"), ..n, -most * DEGREE, most * DEGREE)?;
    }
    ocp.bound("u.delta", .., -2.0, 2.0)?.bound("u.kappa", .., -100.0, 100.0)?;
    // Nothing is accumulated at the start, whose place on the orbit is where the aircraft turns.
    ocp.bound("x.cost", ..1, 0.0, 0.0)?.bound("x.dq[1]", ..1, 0.0, 0.0)?;
    Ok(ocp)
}

/// A guess as the iterate.
fn begin<P: Formulation<f64>>(ocp: &mut HeapOcp<P>, guess: &Record) -> Result<(), Box<dyn Error>> {
    let (states, controls) = (guess.vectors("x")?, guess.vectors("u")?);
    for k in 0..=ocp.intervals() {
        let mut x = states.get(k % states.len()).cloned().unwrap_or_default();
        x.resize(23, 0.0);
        let u = controls.get(k).map_or(&[][..], |u| u);
        ocp.guess_stage(k, &x, u)?;
    }
    Ok(())
}
