//! The power-optimal orbit of an aircraft on a tether.

#[path = "../../../awe_orbit/problem.rs"]
#[allow(dead_code)]
mod problem;

use crate::awe::Awe;
use crate::numbers;
use crate::report::{Report, write};
use casados::casadi::Program;
use casados::ocp::{Formulation, HeapIpm, HeapOcp, SecondOrder, Shooting};
use casados::prelude::*;
use problem::INTERVALS;
use std::error::Error;
use std::time::Instant;

const SECONDS: f64 = 0.3364093944964951;

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

/// The orbit; the environment has the state and the control of each interval to begin with.
fn formulate()
-> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>> + Send + use<>>, Box<dyn Error>> {
    let numbers = numbers()?;
    let batch = Batch::<Awe, RadauIIA<4>>::new(options())?;
    let mut ocp = problem::orbit(Shooting::new(batch), SECONDS)?;
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
