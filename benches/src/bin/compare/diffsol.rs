//! The solvers of diffsol with step-size control, on the models that are explicit equations.

use super::MeasurementBudget;
use super::rows::Measured;
use casados_benches::case::{Case, Mode, Values};
use casados_benches::time::measure as sample;
use diffsol::{
    MatrixCommon, NalgebraLU, NalgebraMat, OdeBuilder, OdeSolverMethod, SensitivitiesOdeSolverMethod,
};

type Matrix = NalgebraMat<f64>;
type Solver = NalgebraLU<f64>;

const TOLERANCE: f64 = 1e-8;

/// `ẋ = g(x, u)` and its derivative in a direction `(δx, δu)`, written by hand.
#[derive(Clone, Copy)]
struct Model {
    right_hand_side: fn(x: &[f64], u: &[f64], dx: &mut [f64]),
    derivative: fn(x: &[f64], u: &[f64], vx: &[f64], vu: &[f64], dv: &mut [f64]),
}

/// Times and errors of simulation and forward sensitivities; empty for a model that is not
/// explicit.
pub fn measure(
    case: &Case,
    flow: &Values,
    effort: MeasurementBudget,
) -> Vec<(&'static str, Mode, Result<Measured, String>)> {
    let model = match case.model {
        "pendulum" => Model { right_hand_side: pendulum, derivative: pendulum_derivative },
        "chain" => Model { right_hand_side: chain, derivative: chain_derivative },
        _ => return Vec::new(),
    };
    let one = |mode: Mode, solve: &dyn Fn() -> Result<Values, String>| -> Result<Measured, String> {
        let error = solve()?.relative_error(flow, mode);
        let time = sample(effort.budget(), || solve().map(drop))?;
        Ok(Measured { time, error, ..Default::default() })
    };
    let mut lines = Vec::new();
    for name in ["BDF", "ESDIRK34", "TR-BDF2"] {
        lines.push((
            name,
            Mode::Simulation,
            simulate(case, model, name, &|solve| one(Mode::Simulation, solve)),
        ));
        lines.push((name, Mode::Forward, forward(case, model, name, &|solve| one(Mode::Forward, solve))));
    }
    lines
}

type Timed<'a> = &'a dyn Fn(&dyn Fn() -> Result<Values, String>) -> Result<Measured, String>;

/// The state alone. The problem is built once; a call makes a solver and integrates.
fn simulate(case: &Case, model: Model, name: &str, timed: Timed) -> Result<Measured, String> {
    let (x0, u) = case.inputs[0].clone();
    let (nx, nu, t) = (x0.len(), u.len(), case.t);
    let zero = vec![0.0; nu];
    let problem = OdeBuilder::<Matrix>::new()
        .rtol(TOLERANCE)
        .atol([TOLERANCE])
        .p(u)
        .rhs_implicit(
            move |x, p, _, y| (model.right_hand_side)(x, p, y),
            move |x, p, _, v, y| (model.derivative)(x, p, v, &zero, y),
        )
        .init(move |_, _, y| y.copy_from_slice(&x0), nx)
        .build()
        .map_err(|e| e.to_string())?;
    macro_rules! run {
        ($solver:ident) => {
            timed(&|| {
                let mut solver = problem.$solver::<Solver>().map_err(|e| e.to_string())?;
                let (x, _) = solver.solve_dense(&[t]).map_err(|e| e.to_string())?;
                Ok(Values { x: x.inner().as_slice().to_vec(), ..Default::default() })
            })
        };
    }
    match name {
        "BDF" => run!(bdf),
        "ESDIRK34" => run!(esdirk34),
        _ => run!(tr_bdf2),
    }
}

/// With the derivatives by `(x0, u)`, which are parameters here.
fn forward(case: &Case, model: Model, name: &str, timed: Timed) -> Result<Measured, String> {
    let (x0, u) = case.inputs[0].clone();
    let (nx, t) = (x0.len(), case.t);
    let still = vec![0.0; u.len()];
    let fixed = vec![0.0; nx];
    let problem = OdeBuilder::<Matrix>::new()
        .rtol(TOLERANCE)
        .atol([TOLERANCE])
        .sens_rtol(TOLERANCE)
        .sens_atol([TOLERANCE])
        .p([x0, u].concat())
        .rhs_sens_implicit(
            move |x, p, _, y| (model.right_hand_side)(x, &p[nx..], y),
            move |x, p, _, v, y| (model.derivative)(x, &p[nx..], v, &still, y),
            move |x, p, _, v, y| (model.derivative)(x, &p[nx..], &fixed, &v[nx..], y),
        )
        .init_sens(
            move |p, _, y| y.copy_from_slice(&p[..nx]),
            move |_, _, v, y| y.copy_from_slice(&v[..nx]),
            nx,
        )
        .build()
        .map_err(|e| e.to_string())?;
    macro_rules! run {
        ($solver:ident) => {
            timed(&|| {
                let mut solver = problem.$solver::<Solver>().map_err(|e| e.to_string())?;
                let (x, columns, _) = solver.solve_dense_sensitivities(&[t]).map_err(|e| e.to_string())?;
                let columns: Vec<_> = columns.iter().map(|column| column.inner().as_slice()).collect();
                let forward = (0..nx).flat_map(|i| columns.iter().map(move |column| column[i])).collect();
                Ok(Values { x: x.inner().as_slice().to_vec(), forward, ..Default::default() })
            })
        };
    }
    match name {
        "BDF" => run!(bdf_sens),
        "ESDIRK34" => run!(esdirk34_sens),
        _ => run!(tr_bdf2_sens),
    }
}

const CART: f64 = 1.0;
const BALL: f64 = 0.1;
const ROD: f64 = 0.8;
const G: f64 = 9.81;

fn pendulum(x: &[f64], u: &[f64], dx: &mut [f64]) {
    let (s, c) = x[1].sin_cos();
    let mass = CART + BALL - BALL * c * c;
    let centrifugal = BALL * ROD * s * x[3] * x[3];
    dx[0] = x[2];
    dx[1] = x[3];
    dx[2] = (u[0] - centrifugal + BALL * G * c * s) / mass;
    dx[3] = (u[0] * c - centrifugal * c + (CART + BALL) * G * s) / (ROD * mass);
}

fn pendulum_derivative(x: &[f64], u: &[f64], vx: &[f64], vu: &[f64], dv: &mut [f64]) {
    let (s, c) = x[1].sin_cos();
    let (ds, dc) = (c * vx[1], -s * vx[1]);
    let mass = CART + BALL - BALL * c * c;
    let dmass = -2.0 * BALL * c * dc;
    let centrifugal = BALL * ROD * s * x[3] * x[3];
    let dcentrifugal = BALL * ROD * (ds * x[3] * x[3] + 2.0 * s * x[3] * vx[3]);
    let (a, b) = (u[0] - centrifugal + BALL * G * c * s, u[0] * c - centrifugal * c + (CART + BALL) * G * s);
    let da = vu[0] - dcentrifugal + BALL * G * (dc * s + c * ds);
    let db = vu[0] * c + (u[0] - centrifugal) * dc - dcentrifugal * c + (CART + BALL) * G * ds;
    dv[0] = vx[2];
    dv[1] = vx[3];
    dv[2] = (da - a * dmass / mass) / mass;
    dv[3] = (db - b * dmass / mass) / (ROD * mass);
}

const STIFFNESS: f64 = 1.0 / 0.033; // 1/s²: of a spring over a mass
const LENGTH: f64 = 0.033; // m

/// From mass i−1 to mass i.
fn spring(x: &[f64], i: usize) -> [f64; 3] {
    std::array::from_fn(|axis| x[3 * i + axis] - if i > 0 { x[3 * i - 3 + axis] } else { 0.0 })
}

fn chain(x: &[f64], u: &[f64], dx: &mut [f64]) {
    let free = (x.len() - 3) / 6;
    let velocities = 3 * free + 3;
    dx[..3 * free].copy_from_slice(&x[velocities..]);
    dx[3 * free..velocities].copy_from_slice(u);
    dx[velocities..].fill(0.0);
    for i in 0..free {
        dx[velocities + 3 * i + 2] = -G;
    }
    for i in 0..=free {
        let d = spring(x, i);
        let factor = STIFFNESS * (1.0 - LENGTH / d.iter().map(|d| d * d).sum::<f64>().sqrt());
        for (axis, d) in d.iter().enumerate() {
            if i < free {
                dx[velocities + 3 * i + axis] -= factor * d;
            }
            if i > 0 {
                dx[velocities + 3 * i - 3 + axis] += factor * d;
            }
        }
    }
}

fn chain_derivative(x: &[f64], _: &[f64], vx: &[f64], vu: &[f64], dv: &mut [f64]) {
    let free = (x.len() - 3) / 6;
    let velocities = 3 * free + 3;
    dv[..3 * free].copy_from_slice(&vx[velocities..]);
    dv[3 * free..velocities].copy_from_slice(vu);
    dv[velocities..].fill(0.0);
    for i in 0..=free {
        let (d, v) = (spring(x, i), spring(vx, i));
        let norm = d.iter().map(|d| d * d).sum::<f64>().sqrt();
        let along = d.iter().zip(v).map(|(d, v)| d * v).sum::<f64>() / (norm * norm * norm);
        for axis in 0..3 {
            let change = STIFFNESS * ((1.0 - LENGTH / norm) * v[axis] + LENGTH * along * d[axis]);
            if i < free {
                dv[velocities + 3 * i + axis] -= change;
            }
            if i > 0 {
                dv[velocities + 3 * i - 3 + axis] += change;
            }
        }
    }
}
