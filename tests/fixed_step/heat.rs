//! The heat equation in cells, against closed forms: what a method makes of each of its modes, the
//! exponential, and the series of the equation without cells.
//!
//! The matrix of `ẋ = A x + b u` is tridiagonal. Its eigenvectors are `cos(θ (i + ½))`, its
//! eigenvalues `−2 a (1 − cos θ)` with `a = k / (ρc Δ²)`, where the last cell, with the share `β`
//! of a conductance to the air, asks for `2 sin(Nθ) sin(θ/2) = β cos((N − ½) θ)`: one root in each
//! of the intervals `(j π/N, (j + ½) π/N)`.

use crate::interval::{check_interval, options};
use crate::models::heat::rod::{self, Rod};
use casados::prelude::*;
use nalgebra::{SMatrix, SVector, vector};
use std::f64::consts::PI;

type Test = Result<(), Box<dyn std::error::Error>>;

const AIR: f64 = 20.0;

/// The zero of an increasing function between these ends.
fn bisection(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        *(if f(middle) < 0.0 { &mut low } else { &mut high }) = middle;
    }
    0.5 * (low + high)
}

/// Eigenvalues, and eigenvectors of length one as columns.
fn modes<const N: usize>() -> (SVector<f64, N>, SMatrix<f64, N, N>) {
    let n = N as f64;
    let rate = rod::conductance(N) / (rod::CAPACITY * rod::LENGTH / n);
    let beta = rod::loss(N) / rod::conductance(N);
    let of = |t: f64| 2.0 * (n * t).sin() * (0.5 * t).sin() - beta * ((n - 0.5) * t).cos();
    let (mut values, mut vectors) = (SVector::<f64, N>::zeros(), SMatrix::<f64, N, N>::zeros());
    for j in 0..N {
        let (low, high) = (j as f64 * PI / n, (j as f64 + 0.5) * PI / n);
        let sign = -of(low).signum();
        let theta = bisection(low, high, |t| sign * of(t));
        // 1 − cos θ loses digits where θ is small.
        values[j] = -4.0 * rate * (0.5 * theta).sin().powi(2);
        let column = SVector::<f64, N>::from_fn(|i, _| (theta * (i as f64 + 0.5)).cos());
        vectors.set_column(j, &column.normalize());
    }
    (values, vectors)
}

/// Where the rod rests under a flow in kW/m².
fn steady_state<const N: usize>(u: f64) -> SVector<f64, N> {
    let flow = 1e3 * u;
    SVector::from_fn(|i, _| AIR + flow / rod::loss(N) + flow * (N - 1 - i) as f64 / rod::conductance(N))
}

/// The stability function of Radau IIA of two stages.
fn radau_stability_function(z: f64) -> f64 {
    (1.0 + z / 3.0) / (1.0 - z * (2.0 / 3.0) + z * z / 6.0)
}

#[test]
fn rod_sensitivities() {
    let x0 = SVector::<f64, 5>::from_fn(|i, _| 80.0 - 7.0 * i as f64);
    let (u, p) = (vector![4.0], vector![AIR]);
    check_interval::<Rod<5>, _, 5, 1, 1>(
        Irk::<Rod<5>, RadauIIA<3>>::new(options(2)).expect("valid"),
        &x0,
        &u,
        &p,
        60.0,
    );
}

/// Each mode is multiplied by the stability function of the method: state and derivatives are known
/// to rounding, from modes that decay within a hundredth of a step to those that hardly move.
#[test]
fn modal_solution_of_a_rod() -> Test {
    const N: usize = 20;
    const STEPS: usize = 4;
    let (h, u) = (600.0, 6.0);
    let (values, vectors) = modes::<N>();
    let factors = values.map(|lambda| radau_stability_function(h / STEPS as f64 * lambda).powi(STEPS as i32));
    let transition = vectors * SMatrix::from_diagonal(&factors) * vectors.transpose();
    // Of a flow: the state at rest under one, less what the start is off by it.
    let one = steady_state::<N>(1.0).add_scalar(-AIR);
    let by_flow = one - transition * one;
    let x0 = SVector::<f64, N>::from_fn(|i, _| 90.0 + 30.0 * (i as f64).cos());
    let end = steady_state::<N>(u) + transition * (x0 - steady_state::<N>(u));

    let mut irk = Irk::<Rod<N>, RadauIIA<2>>::new(options(STEPS))?;
    irk.set_parameters(&vector![AIR])?;
    let forward = irk.forward(&x0, &vector![u], h)?;
    // The matrix of a step, I − hA/3 or so, has a condition of at most 1 + h |λ|; the modes are
    // summed from N terms each, with vectors whose angles are off by N roundings.
    let condition = 1.0 + h / STEPS as f64 * values.amax();
    let tolerance = (condition + (N * N) as f64) * f64::EPSILON;
    assert!(condition > 50.0 && tolerance < 1e-12, "{condition} {tolerance}");
    for (what, off) in [
        ("state", (forward.x - end).amax() / end.amax()),
        ("by the start", (forward.dx_dx0 - transition).amax()),
        ("by the flow", (forward.dx_du - by_flow).amax() / by_flow.amax()),
    ] {
        println!("{what}: {off:e} of {tolerance:e}");
        assert!(off <= tolerance, "{what} {off:e} {tolerance:e}");
    }
    Ok(())
}

/// With a method of order nine, what is left beside the exponential of the matrix is rounding.
#[test]
fn exponential_solution_of_a_rod() -> Test {
    const N: usize = 10;
    let (h, u) = (60.0, 6.0);
    let (values, vectors) = modes::<N>();
    let exponential = vectors * SMatrix::from_diagonal(&values.map(|l| (h * l).exp())) * vectors.transpose();
    let x0 = SVector::<f64, N>::from_fn(|i, _| 90.0 + 30.0 * (i as f64).cos());
    let end = steady_state::<N>(u) + exponential * (x0 - steady_state::<N>(u));
    let mut irk = Irk::<Rod<N>, RadauIIA<5>>::new(options(40))?;
    irk.set_parameters(&vector![AIR])?;
    let forward = irk.forward(&x0, &vector![u], h)?;
    // |eᶻ − R(z)| ≤ c |z|¹⁰ with c = 5! 4! / (9! 10!) in each step, for z ≤ 0; and rounding: of
    // sums of N terms by vectors that are off by N units, and of each step.
    let z = h / 40.0 * values.amax();
    let tolerance = 40.0 * 2.2e-9 * z.powi(10) + ((N * N) as f64 + 40.0) * f64::EPSILON;
    let state = (forward.x - end).amax() / end.amax();
    let matrix = (forward.dx_dx0 - exponential).amax();
    println!("z = {z}: {state:e}, {matrix:e} of {tolerance:e}");
    assert!(tolerance < 1e-13 && state <= tolerance && matrix <= tolerance);
    Ok(())
}

/// The mean temperature under a flow in kW/m² from the temperature of the air on, without cells:
/// `cos(θ y/L)` with `θ tan θ = H L/k` are the modes.
fn mean(t: f64, u: f64) -> f64 {
    let (flow, length, k) = (1e3 * u, rod::LENGTH, rod::CONDUCTIVITY);
    let biot = rod::TRANSFER * length / k;
    let mut mean = AIR + flow / rod::TRANSFER + 0.5 * flow * length / k;
    for j in 0..50 {
        let low = f64::from(j) * PI;
        let theta =
            bisection(low, low + 0.5 * PI, |t| f64::from(1 - 2 * (j % 2)) * (t * t.sin() - biot * t.cos()));
        let part = flow * length / (k * theta * theta) / (0.5 + 0.25 * (2.0 * theta).sin() / theta);
        let decay = (-k / rod::CAPACITY * (theta / length).powi(2) * t).exp();
        mean -= part * decay * theta.sin() / theta;
    }
    mean
}

/// How far the mean of cells is from that of the equation without cells.
fn error<const N: usize, M>(t: f64, u: f64) -> Result<f64, casados::Error>
where
    M: Dae,
    M::Shape: casados::Shape<
            VectorX<f64> = SVector<f64, N>,
            VectorU<f64> = SVector<f64, 1>,
            VectorP<f64> = SVector<f64, 1>,
        >,
{
    let mut irk = Irk::<M, RadauIIA<5>>::new(options(20))?;
    irk.set_parameters(&vector![AIR])?;
    Ok((irk.solve(&SVector::repeat(AIR), &vector![u], t)?.x.mean() - mean(t, u)).abs())
}

/// Cells of half the width have a quarter of the error.
#[test]
fn order_of_the_spatial_discretisation() -> Test {
    // Nothing has flowed yet: the series is the state at rest, to its 50 terms.
    assert!((mean(0.0, 6.0) - AIR).abs() < 1e-3);
    let errors = [
        error::<5, Rod<5>>(1200.0, 6.0)?,
        error::<10, Rod<10>>(1200.0, 6.0)?,
        error::<20, Rod<20>>(1200.0, 6.0)?,
    ];
    println!("{errors:?}");
    for pair in errors.windows(2) {
        assert!((pair[0] / pair[1] - 4.0).abs() < 0.2, "{errors:?}");
    }
    Ok(())
}
