//! Optimal control of a mechanism that is written with its constraint: a crane whose load hangs on
//! a rope of fixed length, beside its form by the angle.

use casados::__private::Array;
use casados::ocp::{
    Collocation, Constraint, GeneralCost, HeapIpm, HeapSqp, Horizon, Problem, SecondOrder, Shooting,
};
use casados::prelude::*;
use casados::{Constrained, Divided, Integrator, Projected};
use nalgebra::vector;

const ROPE: f64 = 2.0;

/// A trolley with position and velocity, and the load with its coordinates and velocities; the
/// control is the trolley's acceleration, `z` the force of the rope over its length and the mass.
#[dae(index_reduction(baumgarte = [1.0, 1.0]))]
fn crane(xdot: [f64; 6], x: [f64; 6], u: f64, z: f64) -> [f64; 7] {
    let [s, v, qx, qy, vx, vy] = x;
    [
        xdot[0] - v,
        xdot[1] - u,
        xdot[2] - vx,
        xdot[3] - vy,
        xdot[4] + z * (qx - s),
        xdot[5] + z * qy + 9.81,
        (qx - s) * (qx - s) + qy * qy - 4.0,
    ]
}

/// By the angle of the rope.
#[ode]
fn by_angle(x: [f64; 4], u: f64) -> [f64; 4] {
    let [_, v, angle, rate] = x;
    [v, u, rate, -(9.81 * angle.sin() + u * angle.cos()) / 2.0]
}

#[function]
fn effort(_x: [f64; 6], u: f64, _z: f64) -> f64 {
    u * u
}

#[function]
fn effort_by_angle(_x: [f64; 4], u: f64) -> f64 {
    u * u
}

/// The optimum of a problem, with conditions that hold to 1e-9.
macro_rules! optimum {
    ($ocp:ident) => {{
        let mut sqp = HeapSqp::new(&$ocp).unwrap();
        sqp.options.tolerance = 1e-9;
        sqp.qp_solver.options.tolerance = 1e-10;
        let outcome = sqp.solve(&mut $ocp).unwrap();
        assert!(outcome.is_converged(), "{outcome}");
        outcome.objective
    }};
}

const N: usize = 20;
const DURATION: f64 = 5.0;
const DISTANCE: f64 = 3.0;

/// From rest to rest with the least effort: both forms have the same optimum, but for the error of
/// their steps.
#[test]
fn crane_in_both_coordinates() {
    let horizon = || Horizon::uniform(N, DURATION / N as f64);
    let mut ocp = Problem::new(by_rope()).running_cost(GeneralCost::<Effort>::new()).on(horizon()).unwrap();
    ocp.fix_initial_state(&[0.0, 0.0, 0.0, -ROPE, 0.0, 0.0]).unwrap();
    // What is left of the load's state follows from the constraint.
    for (name, end) in [("x[0]", DISTANCE), ("x[1]", 0.0), ("x[2]", DISTANCE), ("x[4]", 0.0)] {
        ocp.bound(name, N.., end, end).unwrap();
    }
    for k in 0..=N {
        let at = DISTANCE * k as f64 / N as f64;
        ocp.guess_stage(k, &[at, 0.0, at, -ROPE, 0.0, 0.0], if k < N { &[0.0] } else { &[] }).unwrap();
    }
    let objective = optimum!(ocp);
    let by_rope: Vec<f64> = ocp.iterate().stages().filter_map(|stage| stage.u.first().copied()).collect();
    let outcome = HeapIpm::new(&ocp).unwrap().solve(&mut ocp).unwrap();
    assert!(outcome.is_converged() && (outcome.objective - objective).abs() < 1e-6, "{outcome}");

    let mut ocp =
        Problem::new(without_rope()).running_cost(GeneralCost::<EffortByAngle>::new()).on(horizon()).unwrap();
    ocp.fix_initial_state(&[0.0; 4]).unwrap();
    for (name, end) in [("x[0]", DISTANCE), ("x[1]", 0.0), ("x[2]", 0.0), ("x[3]", 0.0)] {
        ocp.bound(name, N.., end, end).unwrap();
    }
    let expected = optimum!(ocp);
    // Steps of 1/16 of order eight: what is left is the tolerance of the solver.
    assert!((expected - objective).abs() < 1e-7, "{expected} {objective}");
    for (stage, by_rope) in ocp.iterate().stages().zip(&by_rope) {
        assert!(stage.u.iter().all(|u| (u - by_rope).abs() < 1e-6), "{:?} {by_rope}", stage.u);
    }
}

fn options() -> Options {
    Options { steps: 4, ..Default::default() }
}

fn by_rope() -> Shooting<Irk<Crane, Gauss<4>>> {
    Shooting::new(Batch::<Crane, Gauss<4>>::new(options()).unwrap())
}

fn without_rope() -> Shooting<Irk<ByAngle, Gauss<4>>> {
    Shooting::new(Batch::<ByAngle, Gauss<4>>::new(options()).unwrap())
}

/// Projected after every step.
fn projected_dynamics() -> Divided<Projected<Irk<ProjectedCrane, Gauss<4>>>, 4> {
    Divided::new(Projected::new(Irk::<ProjectedCrane, Gauss<4>>::new(Options::default()).unwrap()))
}

/// From rest at the left, where the load may hang at an angle, to rest at the right with the least
/// effort: that angle is found. The constraint and its derivative are imposed where it starts.
fn crane_from_an_angle<D, F>(dynamics: D) -> f64
where
    D: SecondOrder<f64, Shape = <Crane as Dae>::Shape>,
    F: Function<Shape = D::Shape>,
{
    let free = Constraint::<F>::new(Array::from_fn(|_| f64::NEG_INFINITY), Array::from_fn(|_| f64::INFINITY));
    let mut ocp = Problem::new(dynamics)
        .running_cost(GeneralCost::<Effort>::new())
        .path_constraints(free)
        .on(Horizon::uniform(N, DURATION / N as f64))
        .unwrap();
    ocp.free_initial_state();
    ocp.set_path_bounds(..1, &[0.0; 2], &[0.0; 2]).unwrap();
    for name in ["x[0]", "x[1]", "x[4]"] {
        ocp.bound(name, ..1, 0.0, 0.0).unwrap();
    }
    for (name, end) in [("x[0]", DISTANCE), ("x[1]", 0.0), ("x[2]", DISTANCE), ("x[4]", 0.0)] {
        ocp.bound(name, N.., end, end).unwrap();
    }
    for k in 0..=N {
        let at = DISTANCE * k as f64 / N as f64;
        ocp.guess_stage(k, &[at, 0.0, at, -ROPE, 0.0, 0.0], if k < N { &[0.0] } else { &[] }).unwrap();
    }
    let objective = optimum!(ocp);
    let start = ocp.stage(0).unwrap();
    let (x, y) = (start.x[2], start.x[3]);
    assert!((x.hypot(y) - ROPE).abs() < 1e-8 && start.x[5].abs() < 1e-7 && x.abs() > 0.1, "{:?}", start.x);
    objective
}

#[test]
fn invariants_at_the_initial_state() {
    let mut ocp = Problem::new(without_rope())
        .running_cost(GeneralCost::<EffortByAngle>::new())
        .on(Horizon::uniform(N, DURATION / N as f64))
        .unwrap();
    ocp.free_initial_state();
    for (name, end) in [("x[0]", DISTANCE), ("x[1]", 0.0), ("x[2]", 0.0), ("x[3]", 0.0)] {
        ocp.bound(name, N.., end, end).unwrap();
        if name != "x[2]" {
            ocp.bound(name, ..1, 0.0, 0.0).unwrap();
        }
    }
    let objective = optimum!(ocp);
    let found = crane_from_an_angle::<_, <Crane as Constrained>::Invariants>(by_rope());
    assert!((found - objective).abs() < 1e-7, "{found} {objective}");
    let found = crane_from_an_angle::<_, <ProjectedCrane as Constrained>::Invariants>(projected_dynamics());
    assert!((found - objective).abs() < 1e-7, "{found} {objective}");
}

/// The load follows a wave, with some effort.
#[function]
fn following(x: [f64; 6], u: f64, _z: f64, t: f64) -> f64 {
    let away = x[2] - (2.0 * core::f64::consts::PI * t / 5.0).sin();
    away * away + 0.01 * u * u
}

#[function]
fn following_by_angle(x: [f64; 4], u: f64, t: f64) -> f64 {
    let away = x[0] + 2.0 * x[2].sin() - (2.0 * core::f64::consts::PI * t / 5.0).sin();
    away * away + 0.01 * u * u
}

/// Periodic in all states: what the constraint is off by would decay in a period, and so is zero.
fn periodic_orbit<D: SecondOrder<f64, Shape = <Crane as Dae>::Shape>>(dynamics: D, interior: bool) -> f64 {
    let mut ocp = Problem::new(dynamics)
        .running_cost(GeneralCost::<Following>::new())
        .on(Horizon::uniform(N, DURATION / N as f64))
        .unwrap();
    ocp.free_initial_state();
    ocp.periodic("x").unwrap();
    for k in 0..=N {
        let u: &[f64] = if k < N { &[0.0] } else { &[] };
        ocp.guess_stage(k, &[0.0, 0.0, 0.0, -1.02 * ROPE, 0.0, 0.0], u).unwrap();
    }
    let objective = if interior {
        let outcome = HeapIpm::new(&ocp).unwrap().solve(&mut ocp).unwrap();
        assert!(outcome.is_converged(), "{outcome}");
        outcome.objective
    } else {
        optimum!(ocp)
    };
    for stage in ocp.iterate().stages() {
        assert!(((stage.x[2] - stage.x[0]).hypot(stage.x[3]) - ROPE).abs() < 1e-8, "{:?}", stage.x);
    }
    objective
}

#[test]
fn invariants_of_periodic_orbits() {
    let mut ocp = Problem::new(without_rope())
        .running_cost(GeneralCost::<FollowingByAngle>::new())
        .on(Horizon::uniform(N, DURATION / N as f64))
        .unwrap();
    ocp.free_initial_state();
    ocp.periodic("x").unwrap();
    let objective = optimum!(ocp);
    let collocation = Collocation::new(Irk::<Crane, Gauss<4>>::new(options()).unwrap()).unwrap();
    for found in [
        periodic_orbit(by_rope(), false),
        periodic_orbit(projected_dynamics(), false),
        periodic_orbit(collocation, true),
    ] {
        assert!((found - objective).abs() < 1e-7, "{found} {objective}");
    }
}

/// The length of the rope holds to rounding under controls that jump.
#[test]
fn length_of_a_projected_rope() {
    let irk = Irk::<ProjectedCrane, RadauIIA<2>>::new(Options::default()).unwrap();
    let mut projected = Projected::new(irk);
    let mut x = vector![0.0, 0.0, 0.0, -ROPE, 0.0, 0.0];
    for step in 0..400 {
        x = projected.solve(&x, &vector![(0.05 * f64::from(step)).sin()], 0.05).unwrap().x;
        let rope = (x[2] - x[0]).hypot(x[3]);
        assert!((rope - ROPE).abs() < 8.0 * f64::EPSILON, "{step}: {rope}");
    }
}

/// The same crane, to be projected.
#[dae(index_reduction(projection))]
fn projected_crane(xdot: [f64; 6], x: [f64; 6], u: f64, z: f64) -> [f64; 7] {
    let [s, v, qx, qy, vx, vy] = x;
    [
        xdot[0] - v,
        xdot[1] - u,
        xdot[2] - vx,
        xdot[3] - vy,
        xdot[4] + z * (qx - s),
        xdot[5] + z * qy + 9.81,
        (qx - s) * (qx - s) + qy * qy - 4.0,
    ]
}
