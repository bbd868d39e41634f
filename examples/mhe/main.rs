//! Moving-horizon estimation: states and parameters of a pendulum on a cart from noisy
//! measurements of two of its states.
//!
//! ```text
//! cargo run --release --example mhe
//! ```
//!
//! ```text
//! min  ½ ‖x₀ − x̄‖²_{P⁻¹} + ½ Σ_k ‖y_k − (position, angle)_k‖²_{R⁻¹} + ‖w_k‖²_{Q⁻¹}        x_{k+1} = φ(x_k, w_k, force_k)
//! ```
//!
//! over the last 20 samples. Parameters are states that do not change. Mean `x̄` and covariance `P`
//! of the arrival cost go on from sample to sample by the extended Kalman filter (C. V. Rao, J. B.
//! Rawlings, D. Q. Mayne, IEEE Trans. Autom. Control 48, 2003). The interior point keeps the length
//! and the friction positive.

use casados::ocp::{HeapIpm, Horizon, LeastSquaresCost, Problem};
use casados::prelude::*;
use nalgebra::{SMatrix, SVector, Vector2, Vector6, matrix, vector};
use std::error::Error;
use std::process::ExitCode;

/// x = [position m, angle rad, velocity m/s, rate rad/s, length m, friction N s/m], u = [unknown
/// accelerations of cart and angle], p = [force N].
#[ode]
fn cart(x: [f64; 6], u: [f64; 2], p: [f64; 1]) -> [f64; 6] {
    const BALL: f64 = 0.1; // kg; the cart has 1 kg
    const G: f64 = 9.81; // m/s²
    let [_, angle, velocity, omega, length, friction] = x;
    let (sin, cos) = angle.sin_cos();
    let push = p[0] - friction * velocity;
    let mass = 1.0 + BALL - BALL * cos * cos;
    let centrifugal = BALL * length * sin * omega * omega;
    let acceleration = (push - centrifugal + BALL * G * cos * sin) / mass;
    let angular = (push * cos - centrifugal * cos + (1.0 + BALL) * G * sin) / (length * mass);
    [velocity, omega, acceleration + u[0], angular + u[1], 0.0, 0.0]
}

/// What is measured, then the unknown accelerations.
#[function]
fn seen(x: [f64; 6], u: [f64; 2], _p: [f64; 1]) -> [f64; 4] {
    [x[0], x[1], u[0], u[1]]
}
#[function]
fn seen_last(x: [f64; 6], _u: [f64; 2], _p: [f64; 1]) -> [f64; 2] {
    [x[0], x[1]]
}

const SAMPLE: f64 = 0.05; // s
const WINDOW: usize = 20;
const SAMPLES: usize = 200;
/// Standard deviations of measurements, and of the unknown accelerations.
const OF_POSITION: f64 = 5e-3; // m
const OF_ANGLE: f64 = 1e-2; // rad
const OF_ACCELERATION: f64 = 2e-2;
const LENGTH: f64 = 0.8; // m
const FRICTION: f64 = 0.5; // N s/m

type Covariance = SMatrix<f64, 6, 6>;
/// States, and what is measured of them.
type Record = (Vec<Vector6<f64>>, Vec<Vector2<f64>>);

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("mhe: {error}");
            ExitCode::FAILURE
        }
    }
}

fn force(k: usize) -> f64 {
    let t = k as f64 * SAMPLE;
    2.0 * (2.1 * t).sin() + 1.5 * (5.3 * t).cos()
}

/// States at all samples, the pendulum hanging, and what is measured of them.
fn simulate() -> Result<Record, Box<dyn Error>> {
    let mut plant = Erk::<Cart, Rk4>::new(Options { steps: 10, ..Default::default() })?;
    let mut noise = Noise(7);
    let mut x = vector![0.0, 3.0, 0.0, 0.0, LENGTH, FRICTION];
    let (mut states, mut measurements) = (Vec::new(), Vec::new());
    for k in 0..=SAMPLES {
        states.push(x);
        measurements.push(vector![x[0] + OF_POSITION * noise.next(), x[1] + OF_ANGLE * noise.next()]);
        plant.set_parameters(&vector![force(k)])?;
        x = plant.solve(&x, &Vector2::zeros(), SAMPLE)?.x;
    }
    Ok((states, measurements))
}

fn run() -> Result<(), Box<dyn Error>> {
    let (states, measurements) = simulate()?;
    let weights = [OF_POSITION, OF_ANGLE, OF_ACCELERATION, OF_ACCELERATION].map(|s| 1.0 / (s * s));
    let mut filter = Erk::<Cart, Rk4>::new(Options { steps: 2, ..Default::default() })?;
    let model = Erk::<Cart, Rk4>::new(Options { steps: 2, ..Default::default() })?;
    let problem = Problem::new(model)
        .stage_cost(LeastSquaresCost::<Seen>::diagonal(&weights))
        .terminal_cost(LeastSquaresCost::<SeenLast>::diagonal(&[weights[0], weights[1]]));
    let mut ocp = problem.on(Horizon::uniform(WINDOW, SAMPLE))?;
    ocp.free_initial_state().bound("x[4]", .., 0.1, 3.0)?.bound("x[5]", .., 0.0, 5.0)?;
    let mut ipm = HeapIpm::new(&ocp)?;

    // What is known at the start.
    let mut mean = vector![measurements[0][0], measurements[0][1], 0.0, 0.0, 0.5, 0.1];
    let mut covariance = Covariance::from_diagonal(&vector![1e-4, 1e-4, 0.1, 0.1, 0.2, 0.5]);
    ocp.guess(mean.as_slice(), &[0.0; 2])?;
    let (mut iterations, mut squares, mut raw) = (0, 0.0, 0.0);
    println!("time s   length m        friction N s/m  iterations");
    for end in WINDOW..=SAMPLES {
        let begin = end - WINDOW;
        let information = covariance.try_inverse().ok_or("the covariance is singular")?;
        ocp.set_arrival_cost(mean.as_slice(), information.as_slice())?;
        for k in 0..WINDOW {
            let y = measurements[begin + k];
            ocp.set_reference(k..=k, &[y[0], y[1], 0.0, 0.0])?;
            ocp.set_parameters(k..=k, &[force(begin + k)])?;
        }
        ocp.set_parameters(WINDOW.., &[0.0])?;
        ocp.set_terminal_reference(measurements[end].as_slice())?;
        let outcome = ipm.solve(&mut ocp)?;
        if !outcome.is_converged() {
            return Err(format!("sample {end}: {outcome}\n{}", ipm.log()).into());
        }
        iterations += outcome.iterations;
        let estimate = Vector6::from_column_slice(ocp.stage(WINDOW)?.x);
        squares += (estimate[1] - states[end][1]).powi(2);
        raw += (measurements[end][1] - states[end][1]).powi(2);
        if end % 20 == 0 {
            let time = end as f64 * SAMPLE;
            println!(
                "{time:6.2}   {:.4} ({LENGTH})    {:.4} ({FRICTION})    {}",
                estimate[4], estimate[5], outcome.iterations
            );
        }
        // The first state of the next window.
        let first = Vector6::from_column_slice(ocp.stage(0)?.x);
        (mean, covariance) =
            predict(&mut filter, first, mean, covariance, measurements[begin], force(begin))?;
        ocp.shift();
    }
    let windows = (SAMPLES - WINDOW + 1) as f64;
    println!("iterations of a window: {:.1}", iterations as f64 / windows);
    let [estimated, measured] = [squares, raw].map(|sum| (sum / windows).sqrt());
    println!("error of the angle: {estimated:.4} rad estimated, {measured:.4} rad measured");
    let last = Vector6::from_column_slice(ocp.stage(WINDOW)?.x);
    let errors = [(last[4] - LENGTH).abs() / LENGTH, (last[5] - FRICTION).abs() / FRICTION];
    if estimated > 0.7 * measured || errors[0] > 0.02 || errors[1] > 0.1 {
        return Err(format!("the estimate is too far away: {last}").into());
    }
    Ok(())
}

/// Mean and covariance one sample later: a step of the extended Kalman filter, linearised at the
/// smoothed state `at`.
fn predict(
    model: &mut Erk<Cart, Rk4>,
    at: Vector6<f64>,
    mean: Vector6<f64>,
    covariance: Covariance,
    measurement: Vector2<f64>,
    force: f64,
) -> Result<(Vector6<f64>, Covariance), Box<dyn Error>> {
    let c = SMatrix::<f64, 2, 6>::identity();
    let r = matrix![OF_POSITION * OF_POSITION, 0.0; 0.0, OF_ANGLE * OF_ANGLE];
    let innovation = (c * covariance * c.transpose() + r).try_inverse().ok_or("singular")?;
    let gain = covariance * c.transpose() * innovation;
    let corrected = mean + gain * (measurement - c * mean);
    let covariance = covariance - gain * c * covariance;
    model.set_parameters(&vector![force])?;
    let step = model.forward(&at, &Vector2::zeros(), SAMPLE)?;
    let (a, b) = (step.dx_dx0, step.dx_du);
    let mean = step.x + a * (corrected - at);
    let noise = OF_ACCELERATION * OF_ACCELERATION * b * b.transpose();
    // What parameters may drift keeps their covariance away from zero.
    let drift = Covariance::from_diagonal(&SVector::from([0.0, 0.0, 0.0, 0.0, 1e-8, 1e-7]));
    let covariance = a * covariance * a.transpose() + noise + drift;
    Ok((mean, 0.5 * (covariance + covariance.transpose())))
}

/// Gaussian numbers: sums of twelve that are equally distributed.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
    /// Between 0 and 1 (SplitMix: Steele, Lea and Flood, 2014).
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}
