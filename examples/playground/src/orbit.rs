//! The orbit of most power of an aircraft on a tether: a nonlinear interior point finds it, from a
//! guess.

use crate::awe::Awe;
use crate::awe::awe::{LENGTH, State, TETHER_SCALE, power};
use crate::problem::{self, INTERVALS};
use crate::shared::{One, iterated, now, outcome};
use casados::ocp::{HeapIpm, Outcome, Shooting};
use casados::prelude::*;
use casados::qp::HeapSolution;
use nalgebra::SVector;
use std::error::Error;
use std::ops::ControlFlow;

const NX: usize = 23;
const NU: usize = 4;
/// What is drawn of an interval.
const POINTS: usize = 5;
/// Numbers of a point: position, rotation by columns, power (W), tension (N), airspeed (m/s).
const NUMBERS: usize = 15;

/// The length of an interval (s); states of all nodes of the guess but for the cost, and controls.
static GUESS: One<[f64; 1 + 26 * INTERVALS]> = One::new([0.0; 1 + 26 * INTERVALS]);
/// Whether it converged, iterations, objective, residual, milliseconds.
static RESULT: One<[f64; 5]> = One::new([0.0; 5]);
/// Milliseconds of the integration alone, with first, and with second derivatives.
static TIMES: One<[f64; 3]> = One::new([0.0; 3]);
static CURVE: One<[f64; NUMBERS * POINTS * INTERVALS]> = One::new([0.0; NUMBERS * POINTS * INTERVALS]);

#[unsafe(no_mangle)]
pub extern "C" fn orbit_guess() -> *mut f64 {
    GUESS.place()
}

#[unsafe(no_mangle)]
pub extern "C" fn orbit_result() -> *mut f64 {
    RESULT.place()
}

#[unsafe(no_mangle)]
pub extern "C" fn orbit_times() -> *mut f64 {
    TIMES.place()
}

#[unsafe(no_mangle)]
pub extern "C" fn orbit_curve() -> *mut f64 {
    CURVE.place()
}

/// Points of the curve.
#[unsafe(no_mangle)]
pub extern "C" fn orbit_points() -> usize {
    POINTS * INTERVALS
}

/// Solves the problem from the guess on.
#[unsafe(no_mangle)]
pub extern "C" fn orbit_solve() -> u32 {
    outcome(solve())
}

fn solve() -> Result<(), Box<dyn Error>> {
    let given = *GUESS.get();
    let (states, controls) = given[1..].split_at(22 * INTERVALS);
    let node = |k: usize| {
        let mut x = states[22 * (k % INTERVALS)..][..22].to_vec();
        x.push(0.0);
        x
    };
    let guess = [(0..=INTERVALS).map(node).collect(), controls.chunks(NU).map(<[f64]>::to_vec).collect()];
    let options = Options { start: Start::Zero, ..Default::default() };
    let dynamics = Shooting::new(Batch::<Awe, RadauIIA<4>>::new(options)?);
    let mut ocp = problem::orbit_problem(dynamics, given[0])?;
    problem::set_iterate(&mut ocp, &guess)?;
    let mut ipm = HeapIpm::new(&ocp)?;
    let begin = now();
    let end = ipm.solve_observed(&mut ocp, &mut |row| {
        iterated(row.iteration as f64, row.objective, row.residuals.largest());
        ControlFlow::Continue(())
    })?;
    let took = now() - begin;
    let Outcome { iterations, objective, residuals, .. } = end;
    *RESULT.get() =
        [f64::from(u8::from(end.is_converged())), iterations as f64, objective, residuals.largest(), took];
    // Browsers compile what runs often better: the second time is the one that counts.
    draw(ocp.iterate(), given[0])?;
    draw(ocp.iterate(), given[0])
}

/// The curve between the nodes, and what its integration takes.
fn draw(solution: &HeapSolution, h: f64) -> Result<(), Box<dyn Error>> {
    let mut irk = Irk::<Awe, RadauIIA<4>>::new(Options { start: Start::Zero, ..Default::default() })?;
    let (mut curve, mut times) = (CURVE.get(), TIMES.get());
    *times = [0.0; 3];
    let mut points = curve.chunks_exact_mut(NUMBERS);
    for stage in solution.stages().take(INTERVALS) {
        let (x, u) =
            (SVector::<f64, NX>::from_column_slice(stage.x), SVector::<f64, NU>::from_column_slice(stage.u));
        let lambda = SVector::from_column_slice(stage.dynamics);
        let begin = now();
        irk.hessian(&x, &u, h, &lambda)?;
        times[2] += now() - begin;
        let begin = now();
        irk.forward(&x, &u, h)?;
        times[1] += now() - begin;
        let begin = now();
        irk.solve(&x, &u, h)?;
        times[0] += now() - begin;
        for (point, numbers) in (0..POINTS).zip(&mut points) {
            let dense = irk.dense(h * point as f64 / POINTS as f64)?;
            let state = State::from(dense.x);
            numbers[..3].copy_from_slice(&dense.x.as_slice()[..3]);
            numbers[3..12].copy_from_slice(&dense.x.as_slice()[9..18]);
            let wind = 10.0 * (state.q.z.hypot(1.0) / 100.0).powf(0.15);
            let air = SVector::<f64, 3>::new(wind, 0.0, 0.0) - state.dq;
            numbers[12..].copy_from_slice(&[power(&state), TETHER_SCALE * LENGTH * dense.z[0], air.norm()]);
        }
    }
    Ok(())
}
