//! Kinds of problems on which solvers creep: a path equality of controls from guesses where its
//! gradient vanishes or that are far from it, a constraint of third order, swing-ups in many
//! swings, many shared parameters with large data. References are IPOPT's (CasADi 3.8.2, the same
//! discretisation and guess, a tolerance of 1e-10, bounds not relaxed).

use super::ocps::line;
use super::units::fix;
use super::{Test, objective_change_by_residuals};
use casados::ocp::{
    Constraint, Exact, Formulation, GeneralCost, HeapIpm, HeapOcp, HeapSqp, Horizon, LeastSquaresCost,
    Outcome, Problem, SecondOrder,
};
use casados::prelude::*;
use casados::qp::residuals;
use casados::{Erk, Rk4};
use core::f64::consts::PI;

/// By both solvers, with the conditions of optimality judged by code that is not the solvers'.
fn solve_by_both<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
    make: impl Fn() -> Result<HeapOcp<P>, Box<dyn std::error::Error>>,
    force: f64,
    mut judge: impl FnMut(&Outcome, f64) -> Test,
) -> Test {
    for by_ipm in [false, true] {
        let mut ocp = make()?;
        let (outcome, log) = if by_ipm {
            let mut ipm = HeapIpm::new(&ocp)?;
            (ipm.solve(&mut ocp)?, ipm.log().to_string())
        } else {
            let mut sqp = HeapSqp::new(&ocp)?;
            (sqp.solve(&mut ocp)?, sqp.log().to_string())
        };
        println!("{log}{outcome}");
        assert!(outcome.is_converged(), "{outcome}");
        ocp.linearise(Exact::default())?;
        let (judged, _) = residuals(ocp.qp(), ocp.iterate());
        println!("{judged}");
        // The default tolerances are 1e-6 of `Sqp` and 1e-8 of `Ipm`, in units: that of forces is
        // the cost's.
        assert!(judged.largest() <= 1e-6 * force, "{judged}");
        judge(&outcome, 1e-6 * objective_change_by_residuals(&ocp))?;
    }
    Ok(())
}

/// A swimmer of speed one in a vortex.
#[ode]
fn swimmer(x: [f64; 2], u: [f64; 2]) -> [f64; 2] {
    [u[0] + 0.8 * x[1], u[1] - 0.8 * x[0]]
}

#[function]
fn off_the_line(x: [f64; 2], _u: [f64; 2]) -> f64 {
    0.05 * x[1] * x[1]
}

#[function]
fn from_the_buoy(x: [f64; 2], _u: [f64; 2]) -> f64 {
    let (a, b) = (x[0] - 1.5, x[1] - 0.5);
    10.0 * (a * a + b * b)
}

#[function]
fn speed(_x: [f64; 2], u: [f64; 2]) -> f64 {
    u[0] * u[0] + u[1] * u[1]
}

/// `u₁² + u₂² = 1` at all stages: from zero, from beside zero, from outside and from inside.
#[test]
fn unit_headings() -> Test {
    for guess in [[0.0, 0.0], [1e-3, 0.0], [5.0, 5.0], [0.6, 0.8]] {
        println!("{guess:?}");
        let make = || -> Result<_, Box<dyn std::error::Error>> {
            let mut ocp = Problem::new(Erk::<Swimmer, Rk4>::new(Options::default())?)
                .stage_cost(GeneralCost::<OffTheLine>::new())
                .terminal_cost(GeneralCost::<FromTheBuoy>::new())
                .path_constraints(Constraint::<Speed>::new([1.0], [1.0]))
                .on(Horizon::uniform(40, 0.05))?;
            ocp.fix_initial_state(&[-1.0, 0.2])?.guess(&[-1.0, 0.2], &guess)?;
            Ok(ocp)
        };
        solve_by_both(make, 1.0, |outcome, tolerance| {
            assert!((outcome.objective - 0.47500688961161).abs() <= tolerance, "{outcome}, {tolerance:e}");
            Ok(())
        })?;
    }
    Ok(())
}

#[ode]
fn jerked(x: [f64; 3], u: f64) -> [f64; 3] {
    [x[1], x[2], u]
}

#[function]
fn square(_x: [f64; 3], u: f64) -> f64 {
    u * u
}

/// A cart that comes back in a second, with a wall after 0.04 m, whose jerk is the control: the
/// third derivative of the distance. Bounds, which are not active, say how large it is.
#[test]
fn third_order_state_constraint() -> Test {
    for (n, objective) in [(40, 27805.389610683895), (100, 26592.99224375864)] {
        let make = || -> Result<_, Box<dyn std::error::Error>> {
            let mut ocp = Problem::new(Erk::<Jerked, Rk4>::new(Options::default())?)
                .running_cost(GeneralCost::<Square>::new())
                .on(Horizon::uniform(n, 1.0 / n as f64))?;
            ocp.fix_initial_state(&[0.0, 1.0, 0.0])?.bound("x[0]", 1..n, f64::NEG_INFINITY, 0.04)?;
            ocp.bound("u", .., -2e3, 2e3)?;
            fix(&mut ocp, n, &[(0, 0.0), (1, -1.0), (2, 0.0)])?;
            line(&mut ocp, &[0.0, 1.0, 0.0], &[0.0, -1.0, 0.0], &[0.0])?;
            Ok(ocp)
        };
        // The unit of forces is above 1e4, since that of the control is 2e3.
        solve_by_both(make, 1e2, |outcome, tolerance| {
            assert!((outcome.objective - objective).abs() <= tolerance, "{outcome}, {tolerance:e}");
            Ok(())
        })?;
    }
    Ok(())
}

/// A pendulum with a motor that cannot hold it up.
#[ode]
fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], -9.81 * x[0].sin() + u]
}

#[function]
fn effort(_x: [f64; 2], u: f64) -> f64 {
    u * u
}

/// From rest below to rest above, in as many swings as it takes: there are many minima.
#[test]
fn swing_up_of_a_weak_motor() -> Test {
    for (time, most, n) in [(10.0, 3.0, 100), (12.0, 2.0, 150), (15.0, 1.5, 150)] {
        for turns in [false, true] {
            println!("{time} {most} {turns}");
            let make = || -> Result<_, Box<dyn std::error::Error>> {
                let mut ocp = Problem::new(Erk::<Pendulum, Rk4>::new(Options::default())?)
                    .running_cost(GeneralCost::<Effort>::new())
                    .on(Horizon::uniform(n, time / n as f64))?;
                ocp.fix_initial_state(&[0.0, 0.0])?.bound("u", .., -most, most)?;
                fix(&mut ocp, n, &[(0, PI), (1, 0.0)])?;
                line(&mut ocp, &[0.0, 0.0], &[if turns { PI } else { 0.0 }, 0.0], &[0.0])?;
                Ok(ocp)
            };
            solve_by_both(make, 1.0, |_, _| Ok(()))?;
        }
    }
    Ok(())
}

/// Eight compartments in a ring: fifteen rates, of which those ahead saturate.
#[ode]
fn ring(x: [f64; 8], u: [f64; 15], _p: [f64; 8]) -> [f64; 8] {
    let [a, b, c, d, e, f, g, h] = x;
    let ab = u[0] * a / (1.0 + a / 4e4) - u[8] * b;
    let bc = u[1] * b / (1.0 + b / 4e4) - u[9] * c;
    let cd = u[2] * c / (1.0 + c / 4e4) - u[10] * d;
    let de = u[3] * d / (1.0 + d / 4e4) - u[11] * e;
    let ef = u[4] * e / (1.0 + e / 4e4) - u[12] * f;
    let fg = u[5] * f / (1.0 + f / 4e4) - u[13] * g;
    let gh = u[6] * g / (1.0 + g / 4e4) - u[14] * h;
    let ha = u[7] * h / (1.0 + h / 4e4);
    [ha - ab, ab - bc, bc - cd, cd - de, de - ef, ef - fg, fg - gh, gh - ha]
}

#[function]
fn misfits(x: [f64; 8], _u: [f64; 15], p: [f64; 8]) -> [f64; 8] {
    [x[0] - p[0], x[1] - p[1], x[2] - p[2], x[3] - p[3], x[4] - p[4], x[5] - p[5], x[6] - p[6], x[7] - p[7]]
}

const FIRST: [f64; 8] = [2e4, 0.0, 1e4, 0.0, 5e3, 0.0, 0.0, 1e3];

/// Measurements at 41 times: a simulation with known rates, and 200 times a sine for noise.
fn measurements() -> Result<Vec<[f64; 8]>, Box<dyn std::error::Error>> {
    let mut erk = Erk::<Ring, Rk4>::new(Options::default())?;
    let mut rates = [0.0; 15];
    for (i, rate) in rates.iter_mut().enumerate() {
        *rate = if i < 8 { 0.3 + 0.05 * i as f64 } else { 0.1 + 0.02 * (i - 8) as f64 };
    }
    let mut x = FIRST;
    let mut all = Vec::new();
    for k in 0..=40 {
        let noise = |i: usize| 200.0 * (7.0 * k as f64 + 3.0 * i as f64).sin();
        all.push(core::array::from_fn(|i| x[i] + noise(i)));
        erk.set_parameters(&[0.0; 8].into())?;
        let end = erk.solve(&x.into(), &rates.into(), 0.25)?;
        x = core::array::from_fn(|i| end.x[i]);
    }
    Ok(all)
}

/// Values of 1e4, a cost of 3e6 and fifteen parameters that all stages share, from ones.
#[test]
fn parameter_estimation_with_large_data() -> Test {
    let data = measurements()?;
    let make = || -> Result<_, Box<dyn std::error::Error>> {
        let mut ocp = Problem::new(Erk::<Ring, Rk4>::new(Options::default())?)
            .stage_cost(LeastSquaresCost::<Misfits>::diagonal(&[1.0; 8]))
            .terminal_cost(LeastSquaresCost::<Misfits>::diagonal(&[1.0; 8]))
            .on(Horizon::uniform(40, 0.25))?;
        ocp.fix_initial_state(&FIRST)?.shared("u")?.bound("u", .., 0.01, 5.0)?;
        ocp.guess(&FIRST, &[1.0; 15])?;
        for (k, sample) in data.iter().enumerate() {
            ocp.set_parameters(k..=k, sample)?;
        }
        Ok(ocp)
    };
    // Gradients of the cost by rates are 1e7 at the guess. There are other minima than IPOPT's.
    solve_by_both(make, 1e7, |outcome, _| {
        assert!(outcome.objective / 3156330.7334471284 >= 1.0 - 1e-8, "{outcome}");
        Ok(())
    })
}
