//! A quadrotor flies six metres between two columns and turns around on its way.

use crate::quadrotor::Quadrotor;
use casados::ocp::{Constraint, GeneralCost, HeapOcp, HeapSqp, Horizon, Problem};
use casados::prelude::*;
use std::error::Error;

pub const INTERVALS: usize = 40;
/// Seconds.
pub const DURATION: f64 = 2.4;
/// Of each rotor, N; of both, the thrust that holds it in the air is in the middle.
pub const THRUST: [f64; 2] = [0.2, 5.0];
const HOVER: f64 = 9.81 / 4.0;
/// Axes of two columns, m, and their radius with half of the quadrotor.
pub const COLUMNS: [[f64; 2]; 2] = [[2.0, 0.3], [4.0, -0.3]];
pub const RADIUS: f64 = 0.6;
pub const MARGIN: f64 = 0.25;

/// For each second: thrusts that are not those of hovering, and rates.
#[function]
pub fn effort(x: [f64; 12], u: [f64; 4]) -> f64 {
    let mut sum = 0.0;
    for thrust in u {
        let more = thrust - HOVER;
        sum += more * more;
    }
    0.5 * (sum + 0.1 * (x[9] * x[9] + x[10] * x[10] + x[11] * x[11]))
}

/// Squares of distances from the axes of the columns.
#[function]
pub fn distance(x: [f64; 12], _u: [f64; 4]) -> [f64; 2] {
    let (a, b) = (x[0] - COLUMNS[0][0], x[1] - COLUMNS[0][1]);
    let (c, d) = (x[0] - COLUMNS[1][0], x[1] - COLUMNS[1][1]);
    [a * a + b * b, c * c + d * d]
}

pub type Flight = HeapOcp<Problem<Irk<Quadrotor, Gauss<3>>, GeneralCost<Effort>, (), Constraint<Distance>>>;

/// The problem at its guess: a straight line.
pub fn flight() -> Result<Flight, Box<dyn Error>> {
    let square = (RADIUS + MARGIN) * (RADIUS + MARGIN);
    let mut ocp = Problem::new(Irk::<Quadrotor, Gauss<3>>::new(Options::default())?)
        .running_cost(GeneralCost::<Effort>::new())
        .path_constraints(Constraint::<Distance>::new([square; 2], [f64::INFINITY; 2]))
        .on(Horizon::uniform(INTERVALS, DURATION / INTERVALS as f64))?;
    let (mut start, mut end) = ([0.0; 12], [0.0; 12]);
    (start[2], end[0], end[2]) = (1.0, 6.0, 1.0);
    // It arrives with its front to the left.
    end[5] = std::f64::consts::FRAC_PI_2;
    ocp.fix_initial_state(&start)?;
    for (i, value) in end.into_iter().enumerate() {
        ocp.bound(&format!("x[{i}]"), INTERVALS.., value, value)?;
    }
    ocp.bound("u", .., THRUST[0], THRUST[1])?;
    for k in 0..=INTERVALS {
        let part = k as f64 / INTERVALS as f64;
        let x: Vec<f64> = start.iter().zip(end).map(|(a, b)| a + part * (b - a)).collect();
        ocp.guess_stage(k, &x, if k < INTERVALS { &[HOVER; 4] } else { &[] })?;
    }
    Ok(ocp)
}

/// A solver that stops after so many iterations.
pub fn solver(ocp: &Flight, iterations: usize) -> Result<HeapSqp, Box<dyn Error>> {
    let mut sqp = HeapSqp::new(ocp)?;
    sqp.options.max_iterations = iterations;
    Ok(sqp)
}
