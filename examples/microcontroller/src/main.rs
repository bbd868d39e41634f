//! An extended Kalman filter: angle and rate of a pendulum from noisy angles, in `f32`.
//!
//! What the filter needs of the model is what `forward` returns: the state after a sample, and its
//! derivative by the state before.
#![no_std]
#![no_main]

use casados::prelude::*;
use casados::{Error, memory::Refusing, mode};
use cortex_m_semihosting::{debug, hprintln};
use nalgebra::{Matrix2, Vector2, vector};
use panic_semihosting as _;

/// A pendulum with friction that is pushed. x = [angle rad, rate rad/s], u = push 1/s².
#[ode]
fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] {
    let [angle, rate] = x;
    [rate, u - 9.81 * angle.sin() - 0.3 * rate]
}

/// Memory for one mode, no heap. What cannot be eliminated as planned is an error, so that a
/// call takes the same time always.
type Predictor = Irk<Pendulum, Gauss<2>, f32, Inline<mode::Forward, 1, Refusing>>;

const SAMPLE: f32 = 0.02; // s
const SAMPLES: u16 = 250;
const NOISE: f32 = 0.02; // rad, standard deviation of a measurement
const DRIFT: f32 = 1e-4; // rad/s, of the rate in a sample

/// Noise of that deviation between ±√3 of it (Knuth's linear congruences).
fn random_noise(seed: &mut u32) -> f32 {
    *seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    NOISE * 1.732 * ((*seed >> 8) as f32 / 8_388_608.0 - 1.0)
}

/// Runs the filter beside a simulated pendulum; whether it ends within four of the deviations
/// that it claims.
fn run() -> Result<bool, Error> {
    // The time of a call is bounded: three iterations of Newton's method, never more.
    let newton = Newton { fixed_iterations: Some(3), ..Default::default() };
    let mut predictor = Predictor::inline(Options { newton, ..Default::default() })?;

    let mut truth = vector![1.0, 0.0];
    let mut x = vector![0.0, 0.0]; // nothing is known at the start
    let mut covariance = Matrix2::from_diagonal(&vector![1.0, 1.0]);
    let process = Matrix2::from_diagonal(&vector![0.0, DRIFT * DRIFT]);
    let mut seed = 1;
    for sample in 0..SAMPLES {
        let push = vector![if sample < 50 { 2.0 } else { 0.0 }];
        truth = predictor.solve(&truth, &push, SAMPLE)?.x;
        let measured = truth[0] + random_noise(&mut seed);

        // Predict.
        let step = predictor.forward(&x, &push, SAMPLE)?;
        x = step.x;
        covariance = step.dx_dx0 * covariance * step.dx_dx0.transpose() + process;

        // Correct by the angle.
        let variance = covariance[(0, 0)] + NOISE * NOISE;
        let gain: Vector2<f32> = covariance.column(0) / variance;
        x += gain * (measured - x[0]);
        covariance -= gain * gain.transpose() * variance;

        if sample % 50 == 49 {
            let time = f32::from(sample + 1) * SAMPLE;
            hprintln!("{:.1} s   angle {:7.4}   of {:7.4} rad", time, x[0], truth[0]);
        }
    }
    let error = truth - x;
    Ok((0..2).all(|i| error[i] * error[i] <= 16.0 * covariance[(i, i)]))
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let status = match run() {
        Ok(true) => debug::EXIT_SUCCESS,
        Ok(false) => {
            hprintln!("the state is not where the filter says");
            debug::EXIT_FAILURE
        }
        Err(error) => {
            hprintln!("{}", error);
            debug::EXIT_FAILURE
        }
    };
    loop {
        debug::exit(status);
    }
}
