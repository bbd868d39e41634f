//! Models of the tests: every kind of integrator, and the calls of Rust beside them.

mod mass_on_table;
mod problem;
mod reference;
mod voyage;

use casados::prelude::*;

/// The pendulum of the example, of which CasADi has a model of its own in the tests.
#[ode]
fn pendulum(x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    let [_, angle, velocity, rate] = x;
    let (s, c) = angle.sin_cos();
    let mass = 1.0 + 0.1 - 0.1 * c * c;
    let acceleration = (u[0] - 0.08 * s * rate * rate + 0.981 * c * s) / mass;
    let angular = (u[0] * c - 0.08 * c * s * rate * rate + 10.791 * s) / (0.8 * mass);
    [velocity, rate, acceleration, angular]
}

/// Oscillator with a nonlinear spring as an algebraic state, a parameter, and a fuel state that
/// nothing depends on.
#[dae]
fn spring(xdot: [f64; 3], x: [f64; 3], u: f64, z: f64, p: [f64; 2]) -> [f64; 4] {
    [xdot[0] - x[1], xdot[1] + z - u, xdot[2] + p[1] * u * u, z + 0.1 * z * z * z - p[0] * x[0]]
}

/// What is integrated along with the oscillator.
#[function]
fn effort(x: [f64; 3], u: f64, z: f64, _p: [f64; 2]) -> [f64; 2] {
    [0.5 * x[0] * x[0] + 0.1 * u * u, z * x[1]]
}

/// States one after the other: each feeds the next one.
#[ode]
fn cascade(x: [f64; 4], u: f64) -> [f64; 4] {
    [u - x[0], x[0] - x[1], x[1] * x[1] - x[2], x[2].sin()]
}

/// It has no solution where `x` is negative.
#[dae(nominal(z = 1.0))]
fn root(xdot: [f64; 1], x: [f64; 1], z: f64) -> [f64; 2] {
    [xdot[0] + x[0], z * z - x[0]]
}

const fn steps(steps: usize) -> Options {
    let newton = casados::options::Newton {
        tolerance: 0.0,
        max_iterations: 50,
        jacobian: casados::options::Jacobian::Auto,
        fixed_iterations: None,
    };
    Options { steps, newton, start: casados::options::Start::Nominal, compensated: false }
}

casados::casadi::export! { pendulum = Irk<Pendulum, Gauss<2>>, interval = 0.05, options = steps(2) }
casados::casadi::export! { pendulum_rk4 = Erk<Pendulum, Rk4>, interval = 0.05, options = steps(3) }
casados::casadi::export! {
    spring = Irk<Spring, RadauIIA<3>>, interval = 0.3, quadrature = Effort, options = steps(2), cache = 4
}
casados::casadi::export! {
    spring_z = Irk<Spring, Gauss<2>>, interval = 0.3, quadrature = Effort, options = steps(2), algebraic = true
}
casados::casadi::export! { cascade_euler = Erk<Cascade, Euler>, interval = 0.1, options = steps(1) }
casados::casadi::export! { cascade = Irk<Cascade, Gauss<3>>, interval = 0.1 }
casados::casadi::export_horizon! {
    pendulums = Batch<Pendulum, Gauss<2>>, interval = 0.05, intervals = 7, options = steps(2)
}
casados::casadi::export_horizon! { roots = Batch<Root, RadauIIA<2>>, interval = 0.1, intervals = 5 }
casados::casadi::export! { root = Irk<Root, RadauIIA<2>>, interval = 0.1 }
casados::casadi::export! {
    adaptive = Adaptive<Pendulum, Radau>, interval = 0.5,
    options = AdaptiveOptions { rtol: 1e-9, atol: 1e-9, ..Default::default() }, steps_at = &[0.0, 0.5, 0.0, 0.0, 1.0]
}
casados::casadi::export! { standing = Irk<Pendulum, Gauss<2>>, interval = 0.0 }
casados::casadi::export_horizon! { standings = Batch<Pendulum, Gauss<2>>, interval = 0.0, intervals = 7 }
casados::casadi::export! { backwards = Irk<Pendulum, Gauss<2>>, interval = -0.05, options = steps(2) }
casados::casadi::export! { broken = Irk<Pendulum, Gauss<2>>, interval = 0.05, options = steps(0) }
casados::casadi::export! { panicking = Irk<Pendulum, Gauss<2>>, interval = panics() }

fn panics() -> f64 {
    panic!("on purpose")
}
