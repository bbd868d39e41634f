//! The power-optimal orbit of an aircraft on a tether.

#[path = "../../../models/awe.rs"]
#[allow(dead_code)]
mod awe;

use crate::{Report, numbers, write};
use awe::Awe;
use casados::casadi::Program;
use casados::ocp::{
    Constraint, Formulation, GeneralCost, HeapIpm, HeapOcp, Horizon, Problem, SecondOrder, Shooting,
};
use casados::prelude::*;
use std::error::Error;
use std::time::Instant;

const INTERVALS: usize = 40;
const SECONDS: f64 = 0.3364093944964951;
const DEGREE: f64 = core::f64::consts::PI / 180.0;

fn options() -> Options {
    Options { start: Start::Zero, ..Default::default() }
}

casados::casadi::export! { awe = Irk<Awe, RadauIIA<4>>, interval = SECONDS, options = options() }
casados::casadi::export_horizon! {
    awes = Batch<Awe, RadauIIA<4>>, interval = SECONDS, intervals = INTERVALS, options = options()
}
casados::casadi::export_problem! { program }

fn program() -> Result<impl Program + 'static, Box<dyn Error>> {
    formulate()
}

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

/// The orbit; the environment has the state and the control of each interval to begin with.
fn formulate()
-> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>> + Send + use<>>, Box<dyn Error>> {
    let numbers = numbers()?;
    let batch = Batch::<Awe, RadauIIA<4>>::new(options())?;
    let mut ocp = Problem::new(Shooting::new(batch))
        .terminal_cost(GeneralCost::<Accumulated>::new())
        .path_constraints(Constraint::<Limits>::new([0.0; 9], [f64::INFINITY; 9]))
        .on(Horizon::uniform(INTERVALS, SECONDS))?;
    ocp.free_initial_state();
    for name in ["x.q", "x.dq", "x.omega", "x.r", "x.delta", "x.kappa"] {
        ocp.periodic(name)?;
    }
    ocp.bound("x.q[2]", ..INTERVALS, 100.0, f64::INFINITY)?;
    ocp.bound("x.omega", ..INTERVALS, -50.0 * DEGREE, 50.0 * DEGREE)?;
    for (index, most) in [20.0, 30.0, 30.0].into_iter().enumerate() {
        ocp.bound(&format!("x.delta[{index}]"), ..INTERVALS, -most * DEGREE, most * DEGREE)?;
    }
    ocp.bound("u.delta", .., -2.0, 2.0)?.bound("u.kappa", .., -100.0, 100.0)?;
    // Nothing is accumulated at the start, whose place on the orbit is where the aircraft turns.
    ocp.bound("x.cost", ..1, 0.0, 0.0)?.bound("x.dq[1]", ..1, 0.0, 0.0)?;
    let intervals: Vec<&[f64]> = numbers.chunks_exact(27).collect();
    for k in 0..=INTERVALS {
        let (x, u) = intervals[k % intervals.len().max(1)].split_at(23);
        ocp.guess_stage(k, x, if k < INTERVALS { u } else { &[] })?;
    }
    Ok(ocp)
}

/// The interior point of casados.
///
/// # Safety
/// The pointer is to a report, which nobody else has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn own(_solver: i32, to: *mut Report) -> i32 {
    // SAFETY: see above.
    let Some(to) = (unsafe { to.as_mut() }) else { return 1 };
    write(to, solve())
}

fn solve() -> Result<Report, Box<dyn Error>> {
    let mut ocp = formulate()?;
    let mut ipm = HeapIpm::new(&ocp)?;
    let begin = Instant::now();
    let outcome = ipm.solve(&mut ocp)?;
    Ok(Report::new(&outcome, begin.elapsed().as_secs_f64()))
}
