//! A problem of optimal control for `nlpsol`, and its solution by the solvers of casados.

use crate::{Pendulum, steps};
use casados::casadi::Program;
use casados::ocp::{
    Constraint, Exact, Formulation, GeneralCost, HeapIpm, HeapOcp, HeapSqp, Horizon, LeastSquaresCost,
    Problem, SecondOrder, Shooting,
};
use casados::prelude::*;
use std::error::Error;

#[function]
fn deviation(x: [f64; 4], u: [f64; 1]) -> [f64; 5] {
    [x[0], x[1], x[2], x[3], u[0]]
}

/// A cost that is no square.
#[function]
fn effort(x: [f64; 4], u: [f64; 1]) -> f64 {
    0.01 * u[0].powi(4) / 4.0 + 0.05 * (1.0 - x[1].cos())
}

/// A path constraint with curvature.
#[function]
fn limit(x: [f64; 4], u: [f64; 1]) -> [f64; 2] {
    [x[2] * x[2] + 0.1 * u[0], x[0] * x[1]]
}

#[function]
fn end(x: [f64; 4], _u: [f64; 1]) -> [f64; 4] {
    x
}

#[function]
fn end_limit(x: [f64; 4], _u: [f64; 1]) -> f64 {
    x[1] + x[3] * x[3]
}

/// From a small angle towards rest.
fn formulate()
-> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>> + Send + use<>>, Box<dyn Error>> {
    let batch = Batch::<Pendulum, Gauss<2>>::new(steps(2))?;
    let mut ocp = Problem::new(Shooting::new(batch))
        .running_cost((
            LeastSquaresCost::<Deviation>::diagonal(&[1.0, 1.0, 0.1, 0.1, 0.02]),
            GeneralCost::<Effort>::new(),
        ))
        .terminal_cost(LeastSquaresCost::<End>::diagonal(&[10.0, 10.0, 1.0, 1.0]))
        .path_constraints(Constraint::<Limit>::new([-0.4, -0.3], [1.5, f64::INFINITY]))
        .terminal_constraints(Constraint::<EndLimit>::new([-0.2], [0.2]))
        .on(Horizon::uniform(25, 0.05))?;
    ocp.fix_initial_state(&[0.2, 0.2, 0.0, 0.0])?.bound("u", .., -6.0, 6.0)?;
    ocp.guess(&[0.0; 4], &[0.0])?;
    Ok(ocp)
}

fn swing() -> Result<impl Program + 'static, Box<dyn Error>> {
    formulate()
}

casados::casadi::export_problem! { swing }

/// Objectives of the sequential quadratic programming and of the interior point of casados, and
/// controls of the latter.
fn solve(to: &mut [f64]) -> Result<(), Box<dyn Error>> {
    let mut ocp = formulate()?;
    let mut sqp = HeapSqp::new(&ocp)?.exact(Exact::default());
    sqp.options.tolerance = 1e-9;
    let outcome = sqp.solve(&mut ocp)?;
    to[0] = if outcome.is_converged() { outcome.objective } else { f64::NAN };
    let mut ocp = formulate()?;
    let mut ipm = HeapIpm::new(&ocp)?;
    ipm.options.tolerance = 1e-10;
    let outcome = ipm.solve(&mut ocp)?;
    to[1] = if outcome.is_converged() { outcome.objective } else { f64::NAN };
    for (to, stage) in to[2..].iter_mut().zip(ocp.iterate().stages()) {
        *to = stage.u[0];
    }
    Ok(())
}

/// # Safety
/// The pointer is to 27 numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn own_solution(to: *mut f64) -> i32 {
    // SAFETY: see above.
    let to = unsafe { core::slice::from_raw_parts_mut(to, 27) };
    match solve(to) {
        Ok(()) => 0,
        Err(error) => {
            eprintln!("{error}");
            1
        }
    }
}
