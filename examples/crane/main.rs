//! The fastest way of an overhead crane from rest to rest, by the nonlinear interior point: the
//! duration is a control that all stages share.
//!
//! ```text
//! cargo run --release --example crane
//! ```

use casados::ocp::{GeneralCost, HeapIpm, Horizon, Problem, Shooting};
use casados::prelude::*;
use std::error::Error;
use std::process::ExitCode;

/// A trolley and a load on a cable of 2 m, in time from 0 to 1. x = [position m, velocity m/s,
/// angle rad, rate rad/s], u = [acceleration m/s², duration s].
#[ode]
fn crane(x: [f64; 4], u: [f64; 2]) -> [f64; 4] {
    const CABLE: f64 = 2.0;
    const G: f64 = 9.81;
    let [_, velocity, angle, rate] = x;
    let [acceleration, duration] = u;
    let swing = -(G * angle.sin() + acceleration * angle.cos()) / CABLE;
    [duration * velocity, duration * acceleration, duration * rate, duration * swing]
}

#[function]
fn duration(_x: [f64; 4], u: [f64; 2]) -> f64 {
    u[1]
}

const DISTANCE: f64 = 5.0; // m
const MAX_ACCELERATION: f64 = 1.5; // m/s²
const N: usize = 60;

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("crane: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    println!("swing at most   duration s   iterations   accelerations, one letter each three intervals");
    // Without its load the trolley is there after `2 √(d/a)`.
    let trolley = 2.0 * (DISTANCE / MAX_ACCELERATION).sqrt();
    let mut last = f64::INFINITY;
    for degrees in [3.0f64, 6.0, 12.0, 60.0] {
        let batch = Batch::<Crane, Gauss<2>>::new(Options::default())?;
        let mut ocp = Problem::new(Shooting::new(batch))
            .running_cost(GeneralCost::<Duration>::new())
            .on(Horizon::uniform(N, 1.0 / N as f64))?;
        ocp.shared("u[1]")?.bound("u[1]", ..1, 1.0, 20.0)?.bound(
            "u[0]",
            ..,
            -MAX_ACCELERATION,
            MAX_ACCELERATION,
        )?;
        let swing = degrees.to_radians();
        ocp.fix_initial_state(&[0.0; 4])?.bound("x[2]", 1..N, -swing, swing)?;
        for (i, end) in [DISTANCE, 0.0, 0.0, 0.0].into_iter().enumerate() {
            ocp.bound(&format!("x[{i}]"), N.., end, end)?;
        }
        for k in 0..=N {
            let (u, x) = ([0.0, 2.0 * trolley], [DISTANCE * k as f64 / N as f64, 0.0, 0.0, 0.0]);
            ocp.guess_stage(k, &x, if k < N { &u } else { &[] })?;
        }
        let mut ipm = HeapIpm::new(&ocp)?;
        let outcome = ipm.solve(&mut ocp)?;
        let letters: String = ocp
            .iterate()
            .stages()
            .step_by(3)
            .filter_map(|stage| stage.u.first().copied())
            .map(|a| {
                if a > 0.95 * MAX_ACCELERATION {
                    '+'
                } else if a < -0.95 * MAX_ACCELERATION {
                    '-'
                } else {
                    '.'
                }
            })
            .collect();
        println!("{degrees:11}°   {:10.4}   {:10}   {letters}", outcome.objective, outcome.iterations);
        // Less swing takes longer, and nothing is faster than the trolley alone.
        if !outcome.is_converged() || outcome.objective > last + 1e-6 || outcome.objective < trolley - 1e-6 {
            return Err(format!("{outcome}\n{}", ipm.log()).into());
        }
        last = outcome.objective;
    }
    println!("the trolley alone {trolley:8.4}");
    Ok(())
}
