//! The problem: the most power on a periodic orbit.

use crate::awe::Awe;
use casados::Dae;
use casados::ocp::{Constraint, Formulation, GeneralCost, HeapOcp, Horizon, Problem, SecondOrder};
use casados::prelude::*;
use std::error::Error;

/// Intervals of an orbit.
pub const INTERVALS: usize = 40;

/// The nonlinear path constraints, scaled, all at least zero: tension, airspeed, angles of attack
/// and sideslip, angle between tether and aircraft.
#[function]
pub fn limits(x: [f64; 23], z: [f64; 1], _u: [f64; 4]) -> [f64; 9] {
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
pub fn accumulated(x: [f64; 23], _z: [f64; 1], _u: [f64; 4]) -> f64 {
    x[22]
}

/// The shape of the model.
pub type Shape = <Awe as Dae>::Shape;

/// The orbit over dynamics, with intervals of length `h`.
pub fn orbit_problem<D>(
    dynamics: D,
    h: f64,
) -> Result<HeapOcp<impl Formulation<f64, Dynamics = D, Shape = Shape>>, Box<dyn Error>>
where
    D: SecondOrder<f64, Shape = Shape>,
{
    let mut ocp = flight_problem(dynamics, h)?;
    ocp.free_initial_state();
    for name in ["x.q", "x.dq", "x.omega", "x.r", "x.delta", "x.kappa"] {
        ocp.periodic(name)?;
    }
    // Nothing is accumulated at the start, whose place on the orbit is where the aircraft turns.
    ocp.bound("x.cost", ..1, 0.0, 0.0)?.bound("x.dq[1]", ..1, 0.0, 0.0)?;
    Ok(ocp)
}

/// A flight from anywhere to anywhere, with all limits of states and controls.
pub fn flight_problem<D>(
    dynamics: D,
    h: f64,
) -> Result<HeapOcp<impl Formulation<f64, Dynamics = D, Shape = Shape>>, Box<dyn Error>>
where
    D: SecondOrder<f64, Shape = Shape>,
{
    const DEGREE: f64 = core::f64::consts::PI / 180.0;
    let n = INTERVALS;
    let problem = Problem::new(dynamics)
        .terminal_cost(GeneralCost::<Accumulated>::new())
        .path_constraints(Constraint::<Limits>::new([0.0; 9], [f64::INFINITY; 9]));
    let mut ocp = problem.on(Horizon::uniform(n, h))?;
    // The last state of an orbit is the first one, and has its bounds there.
    ocp.bound("x.q[2]", ..n, 100.0, f64::INFINITY)?;
    ocp.bound("x.omega", ..n, -50.0 * DEGREE, 50.0 * DEGREE)?;
    for (index, most) in [20.0, 30.0, 30.0].into_iter().enumerate() {
        ocp.bound(&format!("x.delta[{index}]"), ..n, -most * DEGREE, most * DEGREE)?;
    }
    ocp.bound("u.delta", .., -2.0, 2.0)?.bound("u.kappa", .., -100.0, 100.0)?;
    Ok(ocp)
}

/// A guess as the iterate.
pub fn set_iterate<P: Formulation<f64>>(
    ocp: &mut HeapOcp<P>,
    [states, controls]: &[Vec<Vec<f64>>; 2],
) -> Result<(), Box<dyn Error>> {
    for (k, x) in states.iter().enumerate() {
        ocp.guess_stage(k, x, controls.get(k).map_or(&[][..], |u| u))?;
    }
    Ok(())
}
