//! Default options from plain guesses: straight lines between where a manoeuvre begins and ends.

use crate::Test;
use casados::ocp::{
    Constraint, Formulation, GeneralCost, Globalisation, HeapOcp, HeapSqp, Horizon, Map, OcpError, Outcome,
    Part, Problem, SecondOrder, SqpOptions, Status,
};
use casados::prelude::*;
use casados::qp::Side;

/// A kinematic car over `τ ∈ [0, 1]`: position, heading, speed, steering angle, acceleration, and
/// the time that everything takes; controls are the rates of steering and acceleration.
#[ode]
fn car(x: [f64; 7], u: [f64; 2]) -> [f64; 7] {
    let [_, _, heading, speed, steering, acceleration, time] = x;
    [
        time * speed * heading.cos(),
        time * speed * heading.sin(),
        time * speed * steering.tan() / 2.7,
        time * acceleration,
        time * u[0],
        time * u[1],
        0.0,
    ]
}

#[function]
fn car_time(x: [f64; 7], _u: [f64; 2]) -> f64 {
    x[6]
}

#[function]
fn car_effort(_x: [f64; 7], u: [f64; 2]) -> f64 {
    1e-3 * (u[0] * u[0] + u[1] * u[1])
}

const CAR_STAGES: usize = 40;

/// From rest to rest, 50 m ahead and 20 m to the left, in not more than some time.
macro_rules! car {
    ($most:expr) => {{
        let n = CAR_STAGES;
        let mut ocp = Problem::new(Erk::<Car, Rk4>::new(Options::default())?)
            .running_cost(GeneralCost::<CarEffort>::new())
            .terminal_cost(GeneralCost::<CarTime>::new())
            .on(Horizon::uniform(n, 1.0 / n as f64))?;
        ocp.free_initial_state();
        ocp.bound("x[3]", .., -1.0, 20.0)?.bound("x[4]", .., -0.6, 0.6)?.bound("x[5]", .., -5.0, 3.0)?;
        ocp.bound("x[6]", .., 0.1, $most)?;
        ocp.bound("u[0]", .., -1.0, 1.0)?.bound("u[1]", .., -10.0, 10.0)?;
        let end: [f64; 6] = [50.0, 20.0, 0.0, 0.0, 0.0, 0.0];
        for (name, &end) in ["x[0]", "x[1]", "x[2]", "x[3]", "x[4]", "x[5]"].iter().zip(&end) {
            ocp.bound(name, 0..1, 0.0, 0.0)?.bound(name, n..=n, end, end)?;
        }
        for k in 0..=n {
            let part = k as f64 / n as f64;
            let stage = ocp.iterate_mut().stage_mut(k).ok_or("no stage")?;
            let line = [50.0 * part, 20.0 * part, 0.0, 5.0, 0.0, 0.0, f64::min(10.0, $most)];
            stage.x.copy_from_slice(&line);
        }
        ocp
    }};
}

fn solve<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
    ocp: &mut HeapOcp<P>,
) -> Result<Outcome, Box<dyn std::error::Error>> {
    let mut sqp = HeapSqp::new(ocp)?;
    let outcome = sqp.solve(ocp)?;
    println!("{}{outcome}", sqp.log());
    // The bounds are as hard as they were, whatever happened.
    let linear = |b: casados::qp::Bounds<'_, f64>| b.lower_linear.iter().all(|p| p.is_infinite());
    assert!(ocp.qp().stages().all(|stage| linear(stage.x_bounds()) && linear(stage.u_bounds())));
    Ok(outcome)
}

/// The last step needs no regularisation, and leaves less than a hundredth of the residuals.
fn is_quadratic(log: &[casados::ocp::Iteration]) -> bool {
    let [.., before, last] = log else { return false };
    last.regularisation == 0.0 && last.residuals.largest() < 1e-2 * before.residuals.largest()
}

/// The reference is IPOPT 3.14 on the same discretisation (CasADi 3.8.2, Runge-Kutta of order four,
/// tolerance 1e-10, bounds not relaxed).
#[test]
fn time_optimal_car() -> Test {
    let mut ocp = car!(50.0);
    let outcome = solve(&mut ocp)?;
    assert!(outcome.is_converged() && outcome.iterations <= 40, "{outcome}");
    // Stationary up to 1e-6, with multipliers of order one and steps of the last iteration below
    // 1e-3.
    assert!((outcome.objective - CAR_TIME).abs() < 1e-5, "{}", outcome.objective);
    let end = ocp.stage(CAR_STAGES)?;
    assert!((end.x[0] - 50.0).abs() < 1e-6);
    Ok(())
}
const CAR_TIME: f64 = 8.042163245;

/// One second is not enough for 50 m from rest: the end is missed, and it is said by how much at
/// the iterate that is handed back.
#[test]
fn car_without_time() -> Test {
    let mut ocp = car!(1.0);
    let outcome = solve(&mut ocp)?;
    let Status::Infeasible { constraint, violation } = outcome.status else {
        return Err(outcome.to_string().into());
    };
    assert!(outcome.iterations < 50);
    assert_eq!((constraint.part, constraint.stage), (Part::StateBounds, CAR_STAGES));
    assert_eq!(constraint.side, Side::Lower);
    // With an acceleration of 3 m/s² at most, the way in a second is below 1.5 m.
    assert_eq!(constraint.name, "x[0]");
    assert!((violation - (50.0 - ocp.stage(CAR_STAGES)?.x[0])).abs() < 1e-12);
    assert!(violation > 48.5 && violation <= 50.0, "{violation}");
    Ok(())
}

/// A car that turns and accelerates, over a given time: position, heading, speed.
#[ode]
fn unicycle(x: [f64; 4], u: [f64; 2]) -> [f64; 4] {
    [x[3] * x[2].cos(), x[3] * x[2].sin(), u[0], u[1]]
}

#[function]
fn unicycle_effort(_x: [f64; 4], u: [f64; 2]) -> f64 {
    0.5 * (u[0] * u[0] + u[1] * u[1])
}

/// Walls on opposite sides, three stages or 0.75 s apart: 3 m at a speed of 2 m/s at most.
#[test]
fn walls_on_opposite_sides() -> Test {
    let n = 40;
    let mut ocp = Problem::new(Erk::<Unicycle, Rk4>::new(Options::default())?)
        .running_cost(GeneralCost::<UnicycleEffort>::new())
        .on(Horizon::uniform(n, 0.25))?;
    ocp.fix_initial_state(&[0.0, 0.0, 0.0, 1.0])?;
    ocp.bound("x[3]", .., 0.0, 2.0)?.bound("u[0]", .., -2.0, 2.0)?.bound("u[1]", .., -1.0, 1.0)?;
    ocp.bound("x[1]", 20..=20, 1.5, 1e2)?.bound("x[1]", 23..=23, -1e2, -1.5)?;
    ocp.bound("x[0]", n..=n, 10.0, 10.0)?.bound("x[1]", n..=n, 0.0, 0.0)?;
    for k in 0..=n {
        let stage = ocp.iterate_mut().stage_mut(k).ok_or("no stage")?;
        stage.x.copy_from_slice(&[10.0 * k as f64 / n as f64, 0.0, 0.0, 1.0]);
    }
    let outcome = solve(&mut ocp)?;
    let Status::Infeasible { violation, .. } = outcome.status else {
        return Err(outcome.to_string().into());
    };
    assert!(outcome.iterations < 50);
    // Both walls together are missed by 1.5 m at least, one of them by half of that.
    assert!(violation > 0.75 - 1e-3, "{violation}");
    Ok(())
}

/// The limit of iterations proves nothing.
#[test]
fn limits_of_iterations_are_no_infeasibility() -> Test {
    for most in [50.0, 1.0] {
        for limit in [0, 1, 2] {
            let mut ocp = car!(most);
            let mut sqp = HeapSqp::new(&ocp)?;
            sqp.options.max_iterations = limit;
            let status = sqp.solve(&mut ocp)?.status;
            assert_eq!(status, Status::MaxIterations);
            assert!(status.to_string().contains("options.max_iterations"));
        }
    }
    Ok(())
}

/// A quadrotor over `τ ∈ [0, 1]`: position, quaternion, velocity, rates, and the time that
/// everything takes; four thrusts.
#[ode]
fn quadrotor(x: [f64; 14], u: [f64; 4]) -> [f64; 14] {
    let (w, a, b, c) = (x[3], x[4], x[5], x[6]);
    let (p, q, r, time) = (x[10], x[11], x[12], x[13]);
    let thrust = u[0] + u[1] + u[2] + u[3];
    [
        time * x[7],
        time * x[8],
        time * x[9],
        -0.5 * time * (a * p + b * q + c * r),
        0.5 * time * (w * p + b * r - c * q),
        0.5 * time * (w * q + c * p - a * r),
        0.5 * time * (w * r + a * q - b * p),
        2.0 * time * (a * c + w * b) * thrust,
        2.0 * time * (b * c - w * a) * thrust,
        time * ((w * w - a * a - b * b + c * c) * thrust - 9.81),
        time * (0.2 * (u[1] - u[3]) - 0.01 * q * r) / 0.01,
        time * (0.2 * (u[2] - u[0]) + 0.01 * p * r) / 0.01,
        time * 0.02 * (u[0] - u[1] + u[2] - u[3]) / 0.02,
        0.0,
    ]
}

#[function]
fn quadrotor_time(x: [f64; 14], _u: [f64; 4]) -> f64 {
    x[13]
}

#[function]
fn quadrotor_effort(x: [f64; 14], u: [f64; 4]) -> f64 {
    let hover = 9.81 / 4.0;
    let (a, b, c, d) = (u[0] - hover, u[1] - hover, u[2] - hover, u[3] - hover);
    1e-2 * (a * a + b * b + c * c + d * d + x[10] * x[10] + x[11] * x[11] + x[12] * x[12])
}

/// Squares of distances from the axes of two cylinders, less those of their radii.
#[function]
fn cylinders(x: [f64; 14], _u: [f64; 4]) -> [f64; 2] {
    let (a, b) = (x[0] - 2.0, x[1] - 0.2);
    let (c, d) = (x[0] - 4.0, x[1] + 0.3);
    [a * a + b * b - 0.64, c * c + d * d - 0.64]
}

#[test]
fn quadrotor_between_cylinders() -> Test {
    let n = 30;
    let infinity = f64::INFINITY;
    let soft = Constraint::<Cylinders>::new([0.0; 2], [infinity; 2]).soft(100.0, 0.0);
    let mut ocp = Problem::new(Erk::<Quadrotor, Rk4>::new(Options::default())?)
        .running_cost(GeneralCost::<QuadrotorEffort>::new())
        .terminal_cost(GeneralCost::<QuadrotorTime>::new())
        .path_constraints(soft)
        .on(Horizon::uniform(n, 1.0 / n as f64))?;
    ocp.free_initial_state();
    ocp.bound("x[1]", .., -1.5, 1.5)?.bound("x[13]", .., 0.3, 20.0)?.bound("u", .., 0.0, 6.0)?;
    let start = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    for (i, &value) in start.iter().enumerate() {
        let name = format!("x[{i}]");
        ocp.bound(&name, 0..1, value, value)?;
        let end = if i == 0 { 6.0 } else { value };
        if i != 3 {
            ocp.bound(&name, n..=n, end, end)?;
        }
    }
    for k in 0..=n {
        let stage = ocp.iterate_mut().stage_mut(k).ok_or("no stage")?;
        stage.x[..13].copy_from_slice(&start);
        (stage.x[0], stage.x[7], stage.x[13]) = (6.0 * k as f64 / n as f64, 2.0, 3.0);
        stage.u.fill(9.81 / 4.0);
    }
    let mut sqp = HeapSqp::new(&ocp)?;
    let outcome = sqp.solve(&mut ocp)?;
    println!("{}{outcome}", sqp.log());
    assert!(outcome.is_converged() && outcome.iterations <= 40, "{outcome}");
    // There are several minima, that differ by how it turns about its axis: this is as good as
    // another method's.
    assert!(outcome.objective < 1.01 * QUADROTOR_COST, "{}", outcome.objective);
    assert!(is_quadratic(sqp.log().0));
    Ok(())
}

/// The reference is that of the car's.
const QUADROTOR_COST: f64 = 2.210274588;

#[function]
fn step(x: [f64; 1], u: [f64; 1]) -> [f64; 1] {
    [x[0] + u[0]]
}

/// Smallest at one.
#[function]
fn barrier(x: [f64; 1], _u: [f64; 1]) -> f64 {
    x[0] - x[0].ln()
}

/// Newton's step from three goes to `3 - 3 (3 - 1) = -3`, where there is no logarithm: a line
/// search shortens it.
#[test]
fn full_steps_to_nowhere_are_shortened() -> Test {
    for globalisation in [Globalisation::FullStep, Globalisation::Merit, Globalisation::Filter] {
        let mut ocp = Problem::new(Map::<Step, f64>::new())
            .terminal_cost(GeneralCost::<Barrier>::new())
            .on(Horizon::uniform(1, 1.0))?;
        ocp.fix_initial_state(&[3.0])?.guess(&[3.0], &[0.0])?;
        let mut sqp = HeapSqp::new(&ocp)?;
        assert_eq!(sqp.options.globalisation, Globalisation::Merit);
        sqp.options.globalisation = globalisation;
        match sqp.solve(&mut ocp) {
            Err(OcpError::NonFiniteFunction { .. }) if globalisation == Globalisation::FullStep => {}
            Ok(outcome) if globalisation != Globalisation::FullStep => {
                println!("{}{outcome}", sqp.log());
                assert!(outcome.is_converged() && sqp.log().0[0].step < 1.0);
                // The second derivative there is one.
                assert!((ocp.stage(1)?.x[0] - 1.0).abs() < 1.1e-6);
            }
            other => return Err(format!("{globalisation:?}: {other:?}").into()),
        }
    }
    Ok(())
}

/// What makes no sense is refused by its name.
#[test]
fn options_are_validated() -> Test {
    type Change = fn(&mut SqpOptions, f64);
    let bad: [(&str, Change, &[f64]); 4] = [
        ("tolerance", |o, v| o.tolerance = v, &[f64::NAN, -1.0, 0.0, f64::INFINITY]),
        ("qp_accuracy", |o, v| o.qp_accuracy = v, &[f64::NAN, -1e-3, 2.0]),
        ("elastic_penalty", |o, v| o.elastic_penalty = v, &[f64::NAN, -1.0, 0.0, f64::INFINITY]),
        ("shortest_step", |o, v| o.shortest_step = v, &[f64::NAN, -1.0, 0.0, 1.5]),
    ];
    let mut ocp = car!(50.0);
    for (expected, change, values) in bad {
        for &wrong in values {
            let mut sqp = HeapSqp::new(&ocp)?.gauss_newton();
            change(&mut sqp.options, wrong);
            match sqp.solve(&mut ocp) {
                Err(error @ OcpError::InvalidOption { name, value, .. }) => {
                    assert_eq!((name, value.to_bits()), (expected, wrong.to_bits()));
                    assert!(error.to_string().contains(expected));
                }
                other => return Err(format!("{expected} {wrong}: {other:?}").into()),
            }
        }
    }
    Ok(())
}

/// The log grows with what happens, not with what may.
#[test]
fn any_number_of_iterations_is_a_limit() -> Test {
    let mut ocp = car!(50.0);
    let mut sqp = HeapSqp::new(&ocp)?;
    sqp.options.max_iterations = usize::MAX;
    assert!(sqp.solve(&mut ocp)?.is_converged());
    Ok(())
}
