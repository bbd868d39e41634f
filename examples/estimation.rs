//! Rates of a reaction A → B → C from samples that are irregular and partly missing: weights by
//! stage, standard deviations from the factorised conditions of optimality, and what the data
//! cannot tell.
//!
//! ```text
//! cargo run --example estimation
//! ```
//!
//! A spectrometer sees `g b` with an unknown gain `g`; now and then a laboratory measures `a`.
//! Without the laboratory nobody can tell much substance from a small gain.
//!
//! ```text
//! min  ½ ‖x₀ − x̄‖²_{P⁻¹} + ½ Σ_k ‖w_k (y_k − ŷ(x_k))‖²        x_{k+1} = φ(x_k)
//! ```
//!
//! The optimal value as a function of the first state, `V(x₀)`, has the Hessian `∂²V/∂x₀²`: with
//! weights `w = 1/σ` this is the information about `x₀`, its inverse the covariance.

use casados::ocp::{
    GaussNewton, HeapOcp, HeapSqp, Horizon, LeastSquaresCost, OcpError, Problem, SolutionFactors,
};
use casados::prelude::*;
use nalgebra::{SMatrix, SVector, SymmetricEigen};
use std::error::Error;

/// x = [a, b, ln k₁, ln k₂, ln g] (rates 1/min), p = [weight and value of the spectrometer, weight
/// and value of the laboratory].
#[ode]
fn reaction(x: [f64; 5], _p: [f64; 4]) -> [f64; 5] {
    let [a, b, k1, k2, _] = x;
    let (first, second) = (k1.exp() * a, k2.exp() * b);
    [-first, first - second, 0.0, 0.0, 0.0]
}
/// Samples that are missing have the weight zero.
#[function]
fn deviation(x: [f64; 5], p: [f64; 4]) -> [f64; 2] {
    [p[0] * (x[4].exp() * x[1] - p[1]), p[2] * (x[0] - p[3])]
}

const NX: usize = 5;
const NAMES: [&str; NX] = ["a", "b", "ln k1", "ln k2", "ln g"];
type Vector = SVector<f64, NX>;
type Matrix = SMatrix<f64, NX, NX>;
type Estimation =
    HeapOcp<Problem<Irk<Reaction, Gauss<3>>, LeastSquaresCost<Deviation>, LeastSquaresCost<Deviation>>>;

/// Standard deviations of both instruments.
const NOISE: [f64; 2] = [0.01, 0.02];
/// What is known before: a mean with standard deviations.
const PRIOR_MEAN: [f64; NX] = [1.0, 0.0, -2.0, -3.0, 0.0];
const PRIOR_DEVIATIONS: [f64; NX] = [2.0, 0.2, 2.0, 2.0, 2.0];
/// Repetitions with other noise.
const REPETITIONS: usize = 400;

fn true_parameters() -> Vector {
    Vector::from([1.3, 0.0, 0.15_f64.ln(), 0.06_f64.ln(), 0.8_f64.ln()])
}

/// Times of samples in minutes: not evenly spread.
fn times() -> Vec<f64> {
    (0..=30).map(|k| f64::from(k) + 0.3 * f64::from(k).sin()).collect()
}

/// The states at all nodes from a first one on.
fn simulate(first: Vector) -> Result<Vec<Vector>, casados::Error> {
    let mut plant = Irk::<Reaction, Gauss<3>>::new(Options { steps: 2, ..Default::default() })?;
    plant.set_parameters(&Default::default())?;
    let mut states = vec![first];
    for pair in times().windows(2) {
        let last = states[states.len() - 1];
        states.push(plant.solve(&last, &Default::default(), pair[1] - pair[0])?.x);
    }
    Ok(states)
}

/// Weights and values at each node: every fourth sample of the spectrometer is missing, and there
/// are three of the laboratory, or none.
fn measure(states: &[Vector], laboratory: bool, noise: &mut Noise) -> Vec<[f64; 4]> {
    let sample = |(k, x): (usize, &Vector)| {
        let seen = x[4].exp() * x[1] + NOISE[0] * noise.next();
        let weight = if k % 4 == 3 { 0.0 } else { 1.0 / NOISE[0] };
        let analysed = x[0] + NOISE[1] * noise.next();
        let other = if laboratory && [2, 8, 20].contains(&k) { 1.0 / NOISE[1] } else { 0.0 };
        [weight, seen, other, analysed]
    };
    states.iter().enumerate().map(sample).collect()
}

fn problem() -> Result<Estimation, Box<dyn Error>> {
    let cost = || LeastSquaresCost::<Deviation>::diagonal(&[1.0, 1.0]);
    let mut ocp = Problem::new(Irk::<Reaction, Gauss<3>>::new(Options::default())?)
        .stage_cost(cost())
        .terminal_cost(cost())
        .on(Horizon::nodes(&times()))?;
    let weight = Matrix::from_diagonal(&Vector::from(PRIOR_DEVIATIONS.map(|s| 1.0 / (s * s))));
    ocp.set_arrival_cost(&PRIOR_MEAN, weight.as_slice())?;
    Ok(ocp)
}

/// The estimate of the first state, and the information about it.
fn estimate(ocp: &mut Estimation, samples: &[[f64; 4]]) -> Result<(Vector, Matrix), Box<dyn Error>> {
    for (k, sample) in samples.iter().enumerate() {
        ocp.set_parameters(k..=k, sample)?;
    }
    // Where the mean from before leads to is a guess without gaps.
    ocp.free_initial_state();
    for (k, x) in simulate(PRIOR_MEAN.into())?.iter().enumerate() {
        ocp.guess_stage(k, x.as_slice(), &[])?;
    }
    let mut sqp = HeapSqp::new(ocp)?;
    let outcome = sqp.solve(ocp)?;
    if !outcome.is_converged() {
        return Err(format!("{outcome}\n{}", sqp.log()).into());
    }
    let x0 = Vector::from_column_slice(ocp.stage(0)?.x);
    Ok((x0, information(ocp, &x0)?))
}

/// `∂²V/∂x₀²` at the estimate.
fn information(ocp: &mut Estimation, x0: &Vector) -> Result<Matrix, OcpError> {
    let mut factors = SolutionFactors::new(ocp)?;
    ocp.fix_initial_state(x0.as_slice())?.factorise(GaussNewton::default(), &mut factors)?;
    Ok(Matrix::from_column_slice(factors.value_hessian().xx))
}

/// The direction about which least was learned: by how much its variance is smaller than before,
/// and what it is made of. A factor of one means that the data say nothing.
fn least_identifiable_direction(information: &Matrix) -> (f64, Vector) {
    let before = Matrix::from_diagonal(&Vector::from(PRIOR_DEVIATIONS));
    let eigen = SymmetricEigen::new(before * information * before);
    let least = eigen.eigenvalues.imin();
    let direction = before * eigen.eigenvectors.column(least);
    (eigen.eigenvalues[least], direction / direction.amax())
}

fn main() -> Result<(), Box<dyn Error>> {
    let states = simulate(true_parameters())?;
    let mut ocp = problem()?;
    let mut noise = Noise(7);
    for laboratory in [false, true] {
        println!(
            "\n{}",
            if laboratory { "With three samples of the laboratory" } else { "Spectrometer alone" }
        );
        let (x0, information) = estimate(&mut ocp, &measure(&states, laboratory, &mut noise))?;
        let covariance = information.try_inverse().ok_or("the information is singular")?;
        let (factor, direction) = least_identifiable_direction(&information);
        println!("            truth   estimate   standard deviation");
        for i in 0..NX {
            println!(
                "{:6} {:10.4} {:10.4} {:12.4}",
                NAMES[i],
                true_parameters()[i],
                x0[i],
                covariance[(i, i)].sqrt()
            );
        }
        if factor < 10.0 {
            let parts = (0..NX).filter(|&i| direction[i].abs() > 0.05);
            let text: Vec<String> = parts.map(|i| format!("{:+.2} {}", direction[i], NAMES[i])).collect();
            println!("not identifiable: along {} the variance is that from before", text.join(" "));
        } else {
            println!(
                "all of it is identifiable: variances are at least {factor:.0} times smaller than before"
            );
        }
        if (factor < 10.0) == laboratory {
            return Err(format!("what is learned is not what was expected: {factor}").into());
        }
    }
    compare_spread(&mut ocp, &states, &mut noise)
}

/// Standard deviations that are predicted, beside the spread of estimates with other noise.
fn compare_spread(ocp: &mut Estimation, states: &[Vector], noise: &mut Noise) -> Result<(), Box<dyn Error>> {
    let (mut sum, mut squares, mut predicted) = (Vector::zeros(), Vector::zeros(), Vector::zeros());
    for _ in 0..REPETITIONS {
        let (x0, information) = estimate(ocp, &measure(states, true, noise))?;
        let covariance = information.try_inverse().ok_or("the information is singular")?;
        let error = x0 - true_parameters();
        sum += error;
        squares += error.component_mul(&error);
        predicted += covariance.diagonal().map(f64::sqrt) / REPETITIONS as f64;
    }
    let mean = sum / REPETITIONS as f64;
    let spread = (squares / REPETITIONS as f64 - mean.component_mul(&mean)).map(f64::sqrt);
    println!("\n{REPETITIONS} times with other noise: standard deviations as predicted, and their spread");
    for i in 0..NX {
        println!("{:6} {:10.4} {:10.4}", NAMES[i], predicted[i], spread[i]);
        // Of 400 the spread is good to 3.5 %.
        if (spread[i] / predicted[i] - 1.0).abs() > 0.15 {
            return Err(format!("the spread of {} is {}, not {}", NAMES[i], spread[i], predicted[i]).into());
        }
    }
    Ok(())
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
