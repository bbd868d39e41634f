//! Models and integrators: roots, derivatives, tables, errors.

use crate::Picture;
use casados::plot::{Curve, Figure, Panel};
use casados::prelude::*;
use casados::tables::{Linear, Spline};
use nalgebra::{Vector1, vector};

/// A vessel that empties through a pipe with a pump.
#[dae]
fn vessel(xdot: f64, x: f64, z: f64) -> [f64; 2] {
    [xdot + 0.1 * z, z * z - 0.5 * z - x]
}

/// The root that Newton's method finds, over its start value.
pub fn roots() -> Picture {
    let mut irk = Irk::<Vessel, RadauIIA<3>>::new(Options::default())?;
    let mut found = Vec::new();
    for i in 0..=60 {
        let start = -1.99 + 0.07 * f64::from(i);
        irk.set_start(&Vector1::new(0.0), &Vector1::new(start))?;
        found.push((start, irk.solve(&Vector1::new(1.1), &vector![], 0.01)?.z0[0]));
    }
    let equation = (0..=60).map(|i| -2.0 + 0.07 * f64::from(i)).map(|z| (z, z * z - 0.5 * z - 1.1));
    Ok(Figure::new()
        .size(760, 340)
        .with(Panel::new("The equation at x = 1.1").x("z").y("z² − z/2 − x").line("", equation).limit(0.0))
        .column(1.0)
        .with(Panel::new("Root over start value").x("start value of z").y("z").dots("", found)))
}

#[ode]
fn oscillator(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u - x[0]]
}

/// The solution of an oscillator and its derivatives, over the length of the step.
pub fn sensitivities() -> Picture {
    let mut irk = Irk::<Oscillator, Gauss<3>>::new(Options { steps: 8, ..Default::default() })?;
    let (x0, u) = (vector![1.0, 0.0], Vector1::new(0.5));
    let (mut position, mut by_start, mut by_rate, mut by_control) = (vec![], vec![], vec![], vec![]);
    for i in 1..=120 {
        let t = 0.05 * f64::from(i);
        let step = irk.forward(&x0, &u, t)?;
        position.push((t, step.x[0]));
        by_start.push((t, step.dx_dx0[(0, 0)]));
        by_rate.push((t, step.dx_dx0[(0, 1)]));
        by_control.push((t, step.dx_du[(0, 0)]));
    }
    Ok(Figure::new()
        .size(760, 340)
        .with(Panel::new("Position x₊[0]").x("length of the step, s").line("", position))
        .column(1.0)
        .with(
            Panel::new("Its derivatives")
                .x("length of the step, s")
                .line("by x₀[0]", by_start)
                .line("by x₀[1]", by_rate)
                .line("by u", by_control),
        ))
}

/// The torque of the chapter by each kind of table.
pub fn tables() -> Picture {
    const SPEEDS: [f64; 5] = [0.0, 1.0, 2.0, 3.0, 4.0];
    const TORQUES: [f64; 5] = [2.0, 2.4, 2.5, 2.1, 1.2];
    const LINEAR: Linear<5> = Linear::new(SPEEDS, TORQUES);
    const NATURAL: Spline<5> = Spline::natural(SPEEDS, TORQUES);
    const NOT_A_KNOT: Spline<5> = Spline::not_a_knot(SPEEDS, TORQUES);
    let speeds = || (0..=200).map(|i| -0.5 + 0.025 * f64::from(i));
    let data = SPEEDS.into_iter().zip(TORQUES);
    Ok(Figure::new()
        .size(860, 360)
        .with(
            Panel::new("Torque")
                .x("speed, 100 rad/s")
                .y("N m")
                .line("Linear", speeds().map(|x| (x, LINEAR.value(x))))
                .line("natural", speeds().map(|x| (x, NATURAL.value(x))))
                .line("not a knot", speeds().map(|x| (x, NOT_A_KNOT.value(x))))
                .dots("data", data),
        )
        .column(1.0)
        .with(
            Panel::new("Its derivative")
                .x("speed, 100 rad/s")
                .y("N m / (100 rad/s)")
                .line("Linear", speeds().map(|x| (x, LINEAR.derivative(x))))
                .line("natural", speeds().map(|x| (x, NATURAL.derivative(x))))
                .line("not a knot", speeds().map(|x| (x, NOT_A_KNOT.derivative(x)))),
        ))
}

#[ode]
fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u - 9.81 * x[0].sin()]
}
/// A ball: x = [height, velocity], p = [gravity, coefficient of restitution].
#[ode]
fn ball(x: [f64; 2], p: [f64; 2]) -> [f64; 2] {
    [x[1], -p[0]]
}
#[function]
fn height(x: [f64; 2], _p: [f64; 2]) -> f64 {
    x[0]
}
#[function]
fn bounce(x: [f64; 2], p: [f64; 2]) -> [f64; 2] {
    [x[0], -p[1] * x[1]]
}

const STEPS: [usize; 7] = [1, 2, 4, 8, 16, 32, 64];

/// Errors of methods over their steps; a ball that bounces.
pub fn integrators() -> Picture {
    let (x0, u, h) = (vector![1.0, 0.0], Vector1::new(0.0), 0.2);
    let precise = AdaptiveOptions { rtol: 1e-13, atol: 1e-13, ..Default::default() };
    let exact = Adaptive::<Pendulum, Radau>::new(precise)?.solve(&x0, &u, h)?.x;
    let (mut rk4, mut radau, mut gauss2, mut gauss3) = (vec![], vec![], vec![], vec![]);
    for steps in STEPS {
        let options = Options { steps, ..Default::default() };
        let x = Erk::<Pendulum, Rk4>::new(options)?.solve(&x0, &u, h)?.x;
        rk4.push((steps as f64, (x - exact).amax()));
        let x = Irk::<Pendulum, RadauIIA<2>>::new(options)?.solve(&x0, &u, h)?.x;
        radau.push((steps as f64, (x - exact).amax()));
        let x = Irk::<Pendulum, Gauss<2>>::new(options)?.solve(&x0, &u, h)?.x;
        gauss2.push((steps as f64, (x - exact).amax()));
        let x = Irk::<Pendulum, Gauss<3>>::new(options)?.solve(&x0, &u, h)?.x;
        gauss3.push((steps as f64, (x - exact).amax()));
    }
    let errors = Panel::new("Error after 0.2 s")
        .x("steps")
        .log_x()
        .log_y()
        .with(Curve::line("RadauIIA<2>, order 3", radau).marked())
        .with(Curve::line("Rk4, order 4", rk4).marked())
        .with(Curve::line("Gauss<2>, order 4", gauss2).marked())
        .with(Curve::line("Gauss<3>, order 6", gauss3).marked());

    let radau = Adaptive::<Ball, Radau>::new(AdaptiveOptions::default())?;
    let mut hybrid = Hybrid::new(radau, &[Event::jump::<Height, Bounce>(Crossing::Falling)])?;
    hybrid.integrator().set_parameters(&vector![9.81, 0.8])?;
    let mut heights = vec![(0.0, 1.0)];
    for i in 1..=200 {
        let t = 0.01 * f64::from(i);
        heights.push((t, hybrid.solve(&vector![1.0, 0.0], &vector![], t)?.nominal.x[0]));
    }
    let ball = Panel::new("A ball that bounces").x("time, s").y("height, m").line("", heights);
    Ok(Figure::new().size(860, 360).with(errors).column(1.0).with(ball))
}
