//! A problem with everything that couples stages or gives way: a free duration, a periodic state,
//! soft bounds of controls and of algebraic states, a cost of the first state; and its solution by
//! the interior point of casados.

use casados::casadi::Program;
use casados::ocp::{
    Constraint, Formulation, GeneralCost, HeapIpm, HeapOcp, Horizon, LeastSquaresCost, Problem, SecondOrder,
    Shooting,
};
use casados::prelude::*;
use std::error::Error;

const INTERVALS: usize = 12;

/// Oscillator with a nonlinear spring, in a time of which the second control is the length, and
/// fuel that nothing depends on.
#[dae]
fn voyage(xdot: [f64; 3], x: [f64; 3], u: [f64; 2], z: f64) -> [f64; 4] {
    [
        xdot[0] - u[1] * x[1],
        xdot[1] - u[1] * (u[0] - z),
        xdot[2] - u[1] * u[0] * u[0],
        z + 0.1 * z * z * z - x[0],
    ]
}

#[function]
fn effort(x: [f64; 3], u: [f64; 2], _z: f64) -> [f64; 2] {
    [u[0], x[1]]
}

#[function]
fn duration(_x: [f64; 3], u: [f64; 2], _z: f64) -> f64 {
    u[1] + 0.01 * u[0].powi(4)
}

#[function]
fn strain(x: [f64; 3], u: [f64; 2], z: f64) -> [f64; 2] {
    [z * z, x[1] - 0.2 * u[0]]
}

#[function]
fn destination(x: [f64; 3], _u: [f64; 2], _z: f64) -> [f64; 2] {
    [x[0] - 1.0, x[2]]
}

fn formulate()
-> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>> + Send + use<>>, Box<dyn Error>> {
    let batch = Batch::<Voyage, RadauIIA<2>>::new(Options::default())?;
    let mut ocp = Problem::new(Shooting::new(batch))
        .running_cost((LeastSquaresCost::<Effort>::diagonal(&[0.1, 0.05]), GeneralCost::<Duration>::new()))
        .terminal_cost(LeastSquaresCost::<Destination>::diagonal(&[20.0, 0.1]))
        .path_constraints((
            Constraint::<Strain>::new([f64::NEG_INFINITY, -1.0], [0.6, 0.9]).soft(0.5, 2.0),
            Constraint::<Strain>::new([f64::NEG_INFINITY; 2], [3.0; 2]),
        ))
        .on(Horizon::uniform(INTERVALS, 1.0 / INTERVALS as f64))?;
    ocp.free_initial_state();
    ocp.periodic("x[1]")?.shared("u[1]")?;
    ocp.bound("u[1]", ..1, 0.5, 4.0)?.bound("x[2]", ..1, 0.0, 0.0)?;
    ocp.bound("u[0]", .., -0.7, 0.7)?.soften("u[0]", 2.., 0.1, 1.0)?;
    ocp.bound("x[0]", 3..6, -2.0, 0.1)?.soften("x[0]", 4..5, 0.2, 0.0)?;
    ocp.set_arrival_cost(&[-0.5, 0.3, 0.0], &[8.0, 1.0, 0.0, 1.0, 4.0, 0.0, 0.0, 0.0, 1.0])?;
    ocp.guess(&[0.0, 0.1, 0.0], &[0.2, 2.0])?;
    Ok(ocp)
}

fn program() -> Result<impl Program + 'static, Box<dyn Error>> {
    formulate()
}

casados::casadi::export_problem! { voyage = program }

/// The objective and the states of all stages, by the interior point.
fn solve(to: &mut [f64]) -> Result<(), Box<dyn Error>> {
    let mut ocp = formulate()?;
    let mut ipm = HeapIpm::new(&ocp)?;
    ipm.options.tolerance = 1e-10;
    let outcome = ipm.solve(&mut ocp)?;
    to[0] = if outcome.is_converged() { outcome.objective } else { f64::NAN };
    let states = ocp.iterate().stages().flat_map(|stage| stage.x.to_vec());
    for (to, x) in to[1..].iter_mut().zip(states) {
        *to = x;
    }
    Ok(())
}

/// # Safety
/// The pointer is to 40 numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn own_voyage(to: *mut f64) -> i32 {
    // SAFETY: see above.
    let to = unsafe { core::slice::from_raw_parts_mut(to, 3 * (INTERVALS + 1) + 1) };
    match solve(to) {
        Ok(()) => 0,
        Err(error) => {
            eprintln!("{error}");
            1
        }
    }
}
