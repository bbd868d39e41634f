//! A pendulum: phase portrait, optimal control, model predictive control.

use crate::Picture;
use casados::ocp::{GeneralCost, HeapRealTime, HeapSqp, Horizon, LeastSquaresCost, Problem};
use casados::plot::{Figure, Panel};
use casados::prelude::*;
use nalgebra::{Vector1, vector};
use std::f64::consts::PI;

/// A pendulum with friction that is pushed: angle from below, rate.
#[ode]
fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u - 9.81 * x[0].sin() - 0.3 * x[1]]
}
/// Where the pendulum goes from several states.
pub fn first_model() -> Picture {
    let mut irk = Irk::<Pendulum, Gauss<3>>::new(Options::default())?;
    let mut phase = Panel::new("Phase portrait of a pendulum with friction")
        .x("angle, rad")
        .y("rate, rad/s")
        .x_range(-4.0..10.5)
        .y_range(-9.0..9.0)
        .field(|x| pendulum(x, 0.0));
    for (name, rate) in [("slow", 3.0), ("nearly around", 6.5), ("around once", 8.0)] {
        let mut x = vector![0.0, rate];
        let mut points = vec![(x[0], x[1])];
        for _ in 0..400 {
            x = irk.solve(&x, &Vector1::new(0.0), 0.02)?.x;
            points.push((x[0], x[1]));
        }
        phase = phase.line(name, points);
    }
    Ok(Figure::new().size(700, 420).with(phase))
}

/// A pendulum, hanging at zero, with a motor too weak to lift it directly.
#[ode]
fn weak(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u - 9.81 * x[0].sin()]
}
#[function]
fn effort(_x: [f64; 2], u: f64) -> f64 {
    0.5 * u * u
}

/// A swing-up with a weak motor.
pub fn ocp() -> Picture {
    const N: usize = 40;
    let mut ocp = Problem::new(Irk::<Weak, Gauss<3>>::new(Options::default())?)
        .running_cost(GeneralCost::<Effort>::new())
        .on(Horizon::uniform(N, 0.1))?;
    ocp.fix_initial_state(&[0.0, 0.0])?;
    ocp.bound("x[0]", N.., PI, PI)?.bound("x[1]", N.., 0.0, 0.0)?.bound("u", .., -4.0, 4.0)?;
    for k in 0..=N {
        let angle = PI * k as f64 / N as f64;
        ocp.guess_stage(k, &[angle, 0.0], if k < N { &[0.0] } else { &[] })?;
    }
    let mut sqp = HeapSqp::new(&ocp)?;
    let outcome = sqp.solve(&mut ocp)?;
    if !outcome.is_converged() {
        return Err(outcome.to_string().into());
    }
    let solution = ocp.dense_solution(3)?;
    let nodes = ocp.solution()?;
    Ok(Figure::new()
        .size(1000, 520)
        .with(Panel::trajectories(&solution, "x")?.title("Swing-up: angle, rate").x("time, s"))
        .with(Panel::trajectories(&nodes, "u")?.title("Push, within 4 1/s²").x("time, s"))
        .column(0.7)
        .with(Panel::convergence(sqp.log())))
}

/// A pendulum that stands at zero.
#[ode]
fn inverted(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u + 9.81 * x[0].sin()]
}
#[function]
fn deviation(x: [f64; 2], u: f64) -> [f64; 3] {
    [x[0], x[1], u]
}
#[function]
fn end(x: [f64; 2], _u: f64) -> [f64; 2] {
    x
}

/// Real-time iterations, with a push after a second.
pub fn mpc() -> Picture {
    const SAMPLE: f64 = 0.05;
    let mut x = vector![0.3, 0.0];
    let mut ocp = Problem::new(Irk::<Inverted, Gauss<2>>::new(Options::default())?)
        .running_cost(LeastSquaresCost::<Deviation>::diagonal(&[10.0, 0.1, 0.01]))
        .terminal_cost(LeastSquaresCost::<End>::diagonal(&[10.0, 1.0]))
        .on(Horizon::uniform(20, SAMPLE))?;
    ocp.fix_initial_state(x.as_slice())?.bound("u", .., -6.0, 6.0)?.guess(&[0.0; 2], &[0.0])?;
    ocp.bound("x[1]", 1.., -2.0, 2.0)?.soften("x[1]", 1.., 100.0, 10.0)?;
    if !HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?.is_converged() {
        return Err("the first plan is no solution".into());
    }
    let mut controller = HeapRealTime::new(ocp)?;
    let mut plant = Irk::<Inverted, Gauss<4>>::new(Options { steps: 2, ..Default::default() })?;
    let (mut angle, mut push) = (Vec::new(), Vec::new());
    for sample in 0..60 {
        let t = f64::from(sample) * SAMPLE;
        let u = Vector1::new(controller.prepare()?.feedback(x.as_slice())?.u[0]);
        angle.push((t, x[0]));
        push.push((t, u[0]));
        x = plant.solve(&x, &u, SAMPLE)?.x;
        if sample == 20 {
            x[1] += 1.0;
        }
        controller.shift();
    }
    if x.norm() > 0.01 {
        return Err(format!("the pendulum does not stand: {x}").into());
    }
    Ok(Figure::new()
        .size(860, 340)
        .with(Panel::new("Angle, with a push after a second").x("time, s").y("rad").line("", angle))
        .column(1.0)
        .with(Panel::new("Control").x("time, s").y("1/s²").steps("", push).limit(6.0).limit(-6.0)))
}
