//! A rocket lands with the least fuel: thrust and glide slope are second-order cones, which
//! clarabel takes as they are. The same problem with smooth constraints, by the nonlinear interior
//! point, has the same optimum.
//!
//! ```text
//! cargo run --features clarabel --example rocket_landing
//! ```
//!
//! ```text
//! min ∫ σ dt        r̈ = g + a        ‖a‖ ≤ σ,  1 ≤ σ ≤ 10 m/s²        ‖(r_x, r_y)‖ ≤ r_z tan 80°
//! ```
//!
//! The least acceleration of an engine that burns is no convex constraint; with `σ` in its place
//! nothing is lost, as `‖a‖ = σ` at the optimum (B. Açıkmeşe, S. R. Ploen, "Convex programming
//! approach to powered descent guidance for Mars landing", J. Guid. Control Dyn. 30, 2007).

use casados::ocp::{Constraint, GaussNewton, GeneralCost, HeapIpm, Horizon, Problem};
use casados::prelude::*;
use casados::qp::{Clarabel, QpSolver, QpStart, SecondOrderCone};

/// Of Mars, m/s².
const GRAVITY: f64 = 3.71;
/// tan 80°
const SLOPE: f64 = 5.671281819617709;

/// x = [position m, velocity m/s], u = [acceleration by thrust m/s², its bound σ].
#[ode]
fn rocket(x: [f64; 6], u: [f64; 4]) -> [f64; 6] {
    [x[3], x[4], x[5], u[0], u[1], u[2] - GRAVITY]
}
#[function]
fn fuel(_x: [f64; 6], u: [f64; 4]) -> f64 {
    u[3]
}
/// Rows of two cones: the first is at least the length of the others.
#[function]
fn cones(x: [f64; 6], u: [f64; 4]) -> [f64; 7] {
    [u[3], u[0], u[1], u[2], SLOPE * x[2], x[0], x[1]]
}
/// The same as smooth constraints, from zero on.
#[function]
fn smooth(x: [f64; 6], u: [f64; 4]) -> [f64; 2] {
    [
        u[3] * u[3] - u[0] * u[0] - u[1] * u[1] - u[2] * u[2],
        1e-4 * (SLOPE * SLOPE * x[2] * x[2] - x[0] * x[0] - x[1] * x[1]),
    ]
}

const INTERVALS: usize = 30;
/// s
const STEP: f64 = 2.0;
const START: [f64; 6] = [450.0, -330.0, 2400.0, -40.0, 10.0, -10.0];

macro_rules! problem {
    ($constraint:expr) => {{
        let mut ocp = Problem::new(Irk::<Rocket, Gauss<2>>::new(Options::default())?)
            .running_cost(GeneralCost::<Fuel>::new())
            .path_constraints($constraint)
            .on(Horizon::uniform(INTERVALS, STEP))?;
        ocp.fix_initial_state(&START)?.bound("u[3]", .., 1.0, 10.0)?;
        for i in 0..6 {
            ocp.bound(&format!("x[{i}]"), INTERVALS.., 0.0, 0.0)?;
        }
        for k in 0..=INTERVALS {
            let left = 1.0 - k as f64 / INTERVALS as f64;
            let x = START.map(|x| left * x);
            ocp.guess_stage(k, &x, if k < INTERVALS { &[0.0, 0.0, GRAVITY, 5.0] } else { &[] })?;
        }
        ocp
    }};
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Dynamics are linear: one problem with cones is all there is.
    let mut ocp = problem!(Constraint::<Cones>::new([0.0; 7], [f64::INFINITY; 7]));
    ocp.linearise(GaussNewton::default())?;
    let mut clarabel = Clarabel::new();
    for stage in 0..INTERVALS {
        clarabel.cones.push(SecondOrderCone { stage, first: 0, count: 4 });
        clarabel.cones.push(SecondOrderCone { stage, first: 4, count: 3 });
    }
    let (qp, iterate) = ocp.qp_and_iterate();
    let statistics = clarabel.solve(qp, QpStart::Cold, iterate.view_mut())?;

    let mut other = problem!(Constraint::<Smooth>::new([0.0; 2], [f64::INFINITY; 2]));
    let outcome = HeapIpm::new(&other)?.solve(&mut other)?;

    println!("time s   position m                   thrust m/s²   σ");
    let (mut loss, mut worst) = (0.0_f64, f64::INFINITY);
    for (k, stage) in ocp.iterate().stages().enumerate().take(INTERVALS) {
        let (x, u) = (stage.x, stage.u);
        let thrust = (u[0] * u[0] + u[1] * u[1] + u[2] * u[2]).sqrt();
        if k % 3 == 0 {
            let time = STEP * k as f64;
            println!("{time:>6.0} {:>9.1} {:>9.1} {:>9.1} {thrust:>11.4} {:>8.4}", x[0], x[1], x[2], u[3]);
        }
        loss = loss.max(u[3] - thrust);
        worst = worst.min((SLOPE * x[2] - x[0].hypot(x[1])).min(u[3] - thrust));
    }
    println!("\ncones          {:.7} m/s in {} iterations", statistics.objective, statistics.iterations);
    println!("smooth         {:.7} m/s in {} iterations", outcome.objective, outcome.iterations);
    println!("largest σ − ‖a‖ {loss:.1e}, smallest margin of a cone {worst:.1e}");
    let same = (statistics.objective - outcome.objective).abs() < 1e-5 * statistics.objective;
    if !(outcome.is_converged() && same && worst > -1e-6) {
        return Err(format!("the optima differ: {outcome}").into());
    }
    Ok(())
}
