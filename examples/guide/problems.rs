//! Problems of optimal control and estimation.

use crate::Picture;
use casados::ocp::{
    GaussNewton, GeneralCost, HeapIpm, HeapRealTime, HeapSqp, Horizon, LeastSquaresCost, Problem,
    WithIntegral,
};
use casados::plot::{Curve, Figure, Panel};
use casados::prelude::*;
use nalgebra::{Vector1, vector};
use std::f64::consts::PI;

#[ode(linear = u, integrals(work = u * x.speed, heat = u * u))]
mod train {
    pub struct State {
        pub place: f64,
        pub speed: f64,
    }
    pub fn train(x: &State, u: f64) -> State {
        State { place: x.speed, speed: u - 0.1 * x.speed }
    }
    #[function]
    fn total(_x: &State, _u: f64, q: [f64; 2]) -> f64 {
        q[0] + 0.2 * q[1]
    }
    #[function]
    fn jerk(_x: &State, _u: f64, du: f64) -> f64 {
        1e-3 * du * du
    }
}

/// A train with a piecewise linear force and integrals.
pub fn formulations() -> Picture {
    let n = 20;
    let mut ocp = Problem::new(Irk::<Train, Gauss<2>>::new(Options::default())?)
        .running_cost(GeneralCost::<Jerk>::new())
        .terminal_cost(GeneralCost::<Total>::new())
        .on(Horizon::uniform(n, 0.5))?;
    ocp.fix_initial_state(&[0.0, 0.0])?.guess(&[5.0, 1.0], &[0.0])?;
    ocp.bound("x.place", n.., 10.0, 10.0)?.bound("x.speed", n.., 0.0, 0.0)?;
    ocp.bound("u", .., -1.0, 1.0)?;
    ocp.bound("u", ..1, 0.0, 0.0)?.bound("du", .., -0.5, 0.5)?.bound("heat", n.., 0.0, 2.0)?;
    let outcome = HeapIpm::new(&ocp)?.solve(&mut ocp)?;
    if !outcome.is_converged() {
        return Err(outcome.to_string().into());
    }
    let (dense, nodes) = (ocp.dense_solution(3)?, ocp.solution()?);
    let trajectory = |name: &str, title: &str| {
        Ok::<_, Box<dyn std::error::Error>>(Panel::trajectories(&nodes, name)?.title(title).x("time, s"))
    };
    Ok(Figure::new()
        .size(1000, 520)
        .with(Panel::trajectories(&dense, "x")?.title("Place and speed").x("time, s"))
        .with(trajectory("u", "Force, linear in each interval")?)
        .column(1.0)
        .with(trajectory("du", "Rate of the force")?)
        .with(
            Panel::new("Integrals")
                .x("time, s")
                .line("work", over_time(nodes.times(), nodes.integral("work")?))
                .line("heat", over_time(nodes.times(), nodes.integral("heat")?))
                .limit(2.0),
        ))
}

/// The points of a curve over time.
fn over_time(times: &[f64], values: &[f64]) -> Vec<(f64, f64)> {
    times.iter().copied().zip(values.iter().copied()).collect()
}

/// A cart with a force: position, velocity.
#[ode]
fn cart(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u]
}
#[function]
fn effort(_x: [f64; 2], u: f64) -> f64 {
    0.5 * u * u
}

/// A problem without a solution, and with a soft bound.
pub fn trouble() -> Picture {
    let mut ocp = Problem::new(Erk::<Cart, Rk4>::new(Options::default())?)
        .running_cost(GeneralCost::<Effort>::new())
        .on(Horizon::uniform(10, 0.1))?;
    ocp.fix_initial_state(&[0.0; 2])?.bound("u", .., -1.0, 1.0)?.guess(&[0.0; 2], &[0.0])?;
    ocp.bound("x[0]", 10.., 1.0, 1.0)?;
    let mut hard = HeapSqp::new(&ocp)?;
    hard.solve(&mut ocp)?;
    ocp.soften("x[0]", 10.., 1e3, 0.0)?.guess(&[0.0; 2], &[0.0])?;
    let mut soft = HeapIpm::new(&ocp)?;
    let outcome = soft.solve(&mut ocp)?;
    if !outcome.is_converged() {
        return Err(outcome.to_string().into());
    }
    Ok(Figure::new()
        .size(860, 340)
        .with(Panel::convergence(hard.log()).title("Hard bound: locally infeasible"))
        .column(1.0)
        .with(Panel::convergence(soft.log()).title("Soft bound: converged")))
}

/// Decay with an unknown rate: x = [amount, ln rate], p = [weight, sample].
#[ode]
fn decay(x: [f64; 2], _p: [f64; 2]) -> [f64; 2] {
    [-x[1].exp() * x[0], 0.0]
}
#[function]
fn deviation(x: [f64; 2], p: [f64; 2]) -> f64 {
    p[0] * (x[0] - p[1])
}

/// Samples, the estimate, and two standard deviations.
pub fn estimation() -> Picture {
    let cost = || LeastSquaresCost::<Deviation>::diagonal(&[1.0]);
    let mut ocp = Problem::new(Irk::<Decay, Gauss<3>>::new(Options::default())?)
        .stage_cost(cost())
        .terminal_cost(cost())
        .on(Horizon::uniform(10, 0.5))?;
    let sigma = 0.05;
    let mut samples = Vec::new();
    for k in 0..=10 {
        let t = 0.5 * k as f64;
        let sample = 2.0 * (-0.4 * t).exp() + sigma * (7.0 * t).sin();
        let is_missing = k == 3 || k == 4;
        ocp.set_parameters(k..=k, &[if is_missing { 0.0 } else { 1.0 / sigma }, sample])?;
        if !is_missing {
            samples.push((t, sample));
        }
    }
    ocp.free_initial_state().guess(&[1.0, -1.0], &[])?.guess_by_simulation()?;
    let outcome = HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?;
    if !outcome.is_converged() {
        return Err(outcome.to_string().into());
    }
    let covariance = ocp.covariance(GaussNewton::default())?;
    let solution = ocp.solution()?;
    let amounts = over_time(solution.times(), solution.state("x[0]")?);
    let mut band = [Vec::new(), Vec::new()];
    for (k, &(t, amount)) in amounts.iter().enumerate() {
        let deviation = covariance.standard_deviation("x[0]", k)?;
        band[0].push((t, amount - 2.0 * deviation));
        band[1].push((t, amount + 2.0 * deviation));
    }
    // One curve with a gap.
    let band = band.join(&(f64::NAN, f64::NAN));
    let panel = Panel::new("Estimate of the amount")
        .x("time, s")
        .line("estimate", amounts)
        .with(Curve::line("± 2 standard deviations", band).dashed())
        .dots("samples", samples);
    Ok(Figure::new().size(700, 360).with(panel))
}

#[ode]
fn van_der_pol(x: [f64; 2], u: f64) -> [f64; 2] {
    [(1.0 - x[1] * x[1]) * x[0] - x[1] + u, x[0]]
}
#[function]
fn cost(x: [f64; 2], u: f64) -> f64 {
    x[0] * x[0] + x[1] * x[1] + u * u
}

/// The solution of the problem of CasADi's examples.
pub fn casadi() -> Picture {
    let rk4 = Erk::<VanDerPol, Rk4>::new(Options { steps: 4, ..Default::default() })?;
    let mut ocp =
        Problem::new(WithIntegral::new(rk4, Quadrature::<Cost>::new())).on(Horizon::uniform(20, 0.5))?;
    ocp.fix_initial_state(&[0.0, 1.0])?.bound("x[0]", .., -0.25, f64::INFINITY)?;
    ocp.bound("u", .., -1.0, 1.0)?.guess(&[0.0, 0.0], &[0.0])?;
    let outcome = HeapIpm::new(&ocp)?.solve(&mut ocp)?;
    if !outcome.is_converged() {
        return Err(outcome.to_string().into());
    }
    let (dense, nodes) = (ocp.dense_solution(3)?, ocp.solution()?);
    Ok(Figure::new()
        .size(860, 340)
        .with(Panel::trajectories(&dense, "x")?.title("States, x[0] ≥ −0.25").x("time, s"))
        .column(1.0)
        .with(Panel::trajectories(&nodes, "u")?.title("Control, within 1").x("time, s")))
}

/// x = [position m, angle from above rad, velocity m/s, rate rad/s], u = force N.
#[ode]
fn pendulum_on_cart(x: [f64; 4], u: f64) -> [f64; 4] {
    const CART: f64 = 1.0; // kg
    const BALL: f64 = 0.1; // kg
    const L: f64 = 0.8; // m
    const G: f64 = 9.81; // m/s²
    let [_, theta, v, omega] = x;
    let (s, c) = theta.sin_cos();
    let mass = CART + BALL - BALL * c * c;
    [
        v,
        omega,
        (BALL * s * (G * c - L * omega * omega) + u) / mass,
        ((CART + BALL) * G * s + c * (u - BALL * L * s * omega * omega)) / (L * mass),
    ]
}
#[function]
fn output(x: [f64; 4], u: f64) -> [f64; 5] {
    [x[0], x[1], x[2], x[3], u]
}
#[function]
fn output_end(x: [f64; 4], _u: f64) -> [f64; 4] {
    x
}

/// The closed loop of the problem of acados' examples.
pub fn acados() -> Picture {
    const N: usize = 20;
    const SAMPLE: f64 = 1.0 / N as f64;
    let mut ocp = Problem::new(Irk::<PendulumOnCart, Gauss<4>>::new(Options::default())?)
        .running_cost(LeastSquaresCost::<Output>::diagonal(&[2e3, 2e3, 2e-2, 2e-2, 2e-2]))
        .terminal_cost(LeastSquaresCost::<OutputEnd>::diagonal(&[2e3, 2e3, 2e-2, 2e-2]))
        .on(Horizon::uniform(N, SAMPLE))?;
    ocp.fix_initial_state(&[0.0, PI, 0.0, 0.0])?.bound("u", .., -80.0, 80.0)?;
    for k in 0..=N {
        let angle = (PI * (1.0 - 2.0 * k as f64 / N as f64)).max(0.0);
        ocp.guess_stage(k, &[0.0, angle, 0.0, 0.0], if k < N { &[0.0] } else { &[] })?;
    }
    let outcome = HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?;
    if !outcome.is_converged() {
        return Err(outcome.to_string().into());
    }
    let mut controller = HeapRealTime::new(ocp)?;
    let options = Options { steps: 2, ..Default::default() };
    let mut plant = Irk::<PendulumOnCart, Gauss<4>>::new(options)?;
    let mut x = vector![0.0, PI, 0.0, 0.0];
    let (mut position, mut angle, mut force) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..40 {
        let t = SAMPLE * k as f64;
        let u = controller.prepare()?.feedback(x.as_slice())?.u[0];
        position.push((t, x[0]));
        angle.push((t, x[1]));
        force.push((t, u));
        x = plant.solve(&x, &Vector1::new(u), SAMPLE)?.x;
        controller.shift();
    }
    if x.norm() > 0.05 {
        return Err(format!("the pendulum does not stand: {x}").into());
    }
    let states = Panel::new("Position and angle").x("time, s");
    let control = Panel::new("Force").x("time, s").y("N").steps("", force).limit(80.0).limit(-80.0);
    Ok(Figure::new()
        .size(860, 340)
        .with(states.line("position, m", position).line("angle from above, rad", angle))
        .column(1.0)
        .with(control))
}
