//! An aeroplane that climbs in the shortest time, in units of engineers.

use super::Test;
use super::ocps::line;
use super::units::{assert_solved, fix};
use casados::ocp::{Formulation, GeneralCost, HeapIpm, HeapOcp, Horizon, Problem, SecondOrder};
use casados::prelude::*;
use casados::{Erk, Rk4};

/// Over `τ ∈ [0, 1]`: altitude in metres, speed in metres per second, flight path angle, mass in
/// kilogrammes, and the time that everything takes; the angle of attack. An atmosphere that thins
/// exponentially, drag that rises at the speed of sound: the problem of A. E. Bryson, M. N. Desai,
/// W. C. Hoffman, J. Aircraft 6 (1969), with formulas for their tables.
#[ode]
fn aeroplane(x: [f64; 5], u: [f64; 1]) -> [f64; 5] {
    let ([altitude, speed, path, mass, t], attack) = (x, u[0]);
    let mach = speed / (340.0 - 0.0035 * altitude);
    let thrust = 1.8e5 * (-altitude / 15000.0).exp() * (0.6 + 0.35 * mach);
    let pressure = 0.5 * 1.225 * (-altitude / 7254.0).exp() * speed * speed * 49.24;
    let coefficient = 3.44 * attack;
    let of_sound = 0.013 + 0.027 / (1.0 + (-20.0 * (mach - 1.0)).exp());
    let drag = pressure * (of_sound + 0.6 * coefficient * attack);
    let ((s, c), (sp, cp)) = (attack.sin_cos(), path.sin_cos());
    [
        t * speed * sp,
        t * ((thrust * c - drag) / mass - 9.81 * sp),
        t * ((thrust * s + pressure * coefficient) / (mass * speed) - 9.81 * cp / speed),
        -t * thrust / (9.81 * 1600.0),
        0.0,
    ]
}

#[function]
fn takes(x: [f64; 5], _u: [f64; 1]) -> f64 {
    x[4]
}

fn climb() -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Box<dyn std::error::Error>> {
    let n = 60;
    let erk = Erk::<Aeroplane, Rk4>::new(Options { steps: 2, ..Options::default() })?;
    let mut ocp = Problem::new(erk)
        .terminal_cost(GeneralCost::<Takes>::new())
        .on(Horizon::uniform(n, 1.0 / n as f64))?;
    ocp.free_initial_state();
    ocp.bound("x[0]", .., 0.0, 21000.0)?.bound("x[1]", .., 50.0, 600.0)?.bound("x[2]", .., -1.5, 1.5)?;
    ocp.bound("x[3]", .., 10000.0, 19100.0)?.bound("x[4]", .., 10.0, 1000.0)?.bound("u", .., -0.35, 0.35)?;
    fix(&mut ocp, 0, &[(0, 100.0), (1, 129.0), (2, 0.0), (3, 19050.0)])?;
    fix(&mut ocp, n, &[(0, 19990.0), (1, 295.0), (2, 0.0)])?;
    let (start, end) = ([100.0, 129.0, 0.0, 19050.0, 300.0], [19990.0, 295.0, 0.0, 16500.0, 300.0]);
    line(&mut ocp, &start, &end, &[0.05])?;
    Ok(ocp)
}

/// IPOPT's (CasADi 3.8.2, the same discretisation and guess), which takes 50 iterations.
const MINIMUM: f64 = 206.62707671;

/// Damping that is too little leaves steps of 1/128, and much more of it hardly moves: it is as
/// much as the curvature of the step that was short asks for.
#[test]
fn climb_by_sequential_programming() -> Test {
    assert_solved(&mut climb()?, MINIMUM, 50)
}

#[test]
fn climb_by_interior_point() -> Test {
    let mut ocp = climb()?;
    let outcome = HeapIpm::new(&ocp)?.solve(&mut ocp)?;
    assert!(outcome.is_converged() && outcome.iterations <= 50, "{outcome}");
    assert!((outcome.objective - MINIMUM).abs() <= 1e-7 * MINIMUM, "{outcome}");
    Ok(())
}
