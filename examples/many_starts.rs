//! A swing-up with a weak motor has several local solutions: from many guesses at once the best of
//! those that are found. A picture in `plots/many_starts.svg`.
//!
//! ```text
//! cargo run --release --features parallel --example many_starts [STARTS] [FOLDER]
//! ```

use casados::ocp::{
    BatchOcp, ExactFormulation, GeneralCost, HeapOcp, HeapSqp, Horizon, OcpError, Outcome, Problem,
};
use casados::plot::{Figure, Panel};
use casados::prelude::*;
use std::error::Error;
use std::f64::consts::PI;
use std::path::PathBuf;

/// A pendulum with friction: angle from below rad, rate rad/s; torque.
#[ode]
fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u - 9.81 * x[0].sin() - 0.1 * x[1]]
}
#[function]
fn effort(_x: [f64; 2], u: f64) -> f64 {
    0.5 * u * u
}

const N: usize = 40;

fn problem() -> Result<HeapOcp<impl ExactFormulation<f64> + Send + Sync>, OcpError> {
    let mut ocp = Problem::new(Erk::<Pendulum, Rk4>::new(Options { steps: 2, ..Default::default() })?)
        .running_cost(GeneralCost::<Effort>::new())
        .on(Horizon::uniform(N, 0.1))?;
    ocp.fix_initial_state(&[0.0; 2])?.bound("u", .., -3.5, 3.5)?;
    ocp.bound("x[0]", N.., PI, PI)?.bound("x[1]", N.., 0.0, 0.0)?;
    Ok(ocp)
}

/// Objectives of all starts that end at a solution, the least first, each with its angle.
fn solutions(starts: usize) -> Result<Vec<(f64, Vec<f64>)>, Box<dyn Error>> {
    let ocp = problem()?;
    let mut batch = BatchOcp::new(&ocp, starts, HeapSqp::new(&ocp)?)?;
    for (start, ocp) in batch.instances_mut().iter_mut().enumerate() {
        // Swings of several frequencies, that grow.
        let (frequency, phase) = (1.0 + 0.25 * (start % 12) as f64, 0.5 * (start / 12) as f64);
        for k in 0..=N {
            let part = k as f64 / N as f64;
            let angle = PI * part * (frequency * 2.0 * PI * part + phase).cos();
            ocp.guess_stage(k, &[angle, 0.0], if k < N { &[0.0] } else { &[] })?;
        }
    }
    batch.solve()?;
    let mut found = Vec::new();
    for (ocp, outcome) in batch.instances().iter().zip(batch.outcomes()) {
        if let Some(outcome) = outcome.as_ref().ok().filter(|outcome| Outcome::is_solved(outcome)) {
            found.push((outcome.objective, ocp.iterate().stages().map(|stage| stage.x[0]).collect()));
        }
    }
    found.sort_by(|a: &(f64, Vec<f64>), b| a.0.total_cmp(&b.0));
    Ok(found)
}

/// The first of each group of equal objectives.
fn distinct(found: &[(f64, Vec<f64>)]) -> impl Iterator<Item = &(f64, Vec<f64>)> {
    found.chunk_by(|a, b| (a.0 - b.0).abs() < 1e-4 * a.0).filter_map(<[_]>::first)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let starts = arguments.next().map_or(Ok(120), |count| count.parse())?;
    let folder = PathBuf::from(arguments.next().unwrap_or_else(|| "plots".into()));
    let found = solutions(starts)?;
    println!("{} of {starts} starts end at {} local solutions", found.len(), distinct(&found).count());
    let ranks = found.iter().enumerate().map(|(rank, (objective, _))| (rank as f64, *objective));
    let mut angles = Panel::new("The best three").x("time, s").y("angle, rad").limit(PI);
    for (objective, angle) in distinct(&found).take(3) {
        let points = angle.iter().enumerate().map(|(k, &angle)| (0.1 * k as f64, angle));
        angles = angles.line(format!("{objective:.2}"), points);
    }
    Figure::new()
        .size(900, 320)
        .with(Panel::new("Solutions").x("rank").y("objective").dots("starts", ranks))
        .column(1.0)
        .with(angles)
        .save(folder.join("many_starts.svg"))?;
    Ok(())
}

/// There are several local solutions, and more starts find none that is worse.
#[test]
fn more_starts_are_not_worse() -> Result<(), Box<dyn Error>> {
    let (few, many) = (solutions(2)?, solutions(24)?);
    let best = |found: &[(f64, Vec<f64>)]| found.first().map_or(f64::INFINITY, |first| first.0);
    assert!(best(&many) <= best(&few) && distinct(&many).count() > 1, "{} {}", best(&many), best(&few));
    // From below to above, at rest.
    assert!(many.iter().all(|(_, angle)| angle[0].abs() < 1e-6 && (angle[N] - PI).abs() < 1e-6));
    Ok(())
}
