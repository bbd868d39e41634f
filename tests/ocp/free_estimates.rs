//! Free parameters that are estimated, and problems of parameters alone: published and closed-form
//! values.

use crate::Test;
use casados::ocp::{
    GaussNewton, GeneralCost, HeapIpm, HeapSqp, Horizon, Kind, LeastSquaresCost, Map, Problem, WithIntegral,
};
use casados::prelude::*;

/// Prey and predators: four rates; measurements and whether there are some.
#[ode]
mod lotka {
    pub struct Sample {
        pub rates: [f64; 4],
        pub measured: [f64; 2],
        pub weight: f64,
    }
    pub fn lotka(x: [f64; 2], p: &Sample) -> [f64; 2] {
        let [a, b, c, d] = p.rates;
        [-a * x[0] + b * x[0] * x[1], c * x[1] - d * x[0] * x[1]]
    }
    #[function]
    fn misfit(x: [f64; 2], p: &Sample) -> f64 {
        let [a, b] = p.measured;
        p.weight * ((x[0] - a) * (x[0] - a) + (x[1] - b) * (x[1] - b))
    }
}

const SAMPLES: [[f64; 2]; 10] = [
    [0.58462429, 1.653802752],
    [1.480323792, 1.898433328],
    [1.941197515, 0.791087389],
    [1.266090393, 0.402385741],
    [0.68499583, 0.435968041],
    [0.435253441, 0.725707829],
    [0.404814065, 1.244405746],
    [0.822427034, 2.052562952],
    [1.771604896, 1.426515341],
    [1.754832745, 0.548344791],
];

/// Four rates from ten measurements (PSOPT, predator): a misfit of 2.753366e-2.
#[test]
fn estimated_rates_of_predators_and_prey() -> Test {
    let erk = Erk::<Lotka, Rk4>::new(Options { steps: 2, ..Options::default() })?;
    let mut ocp = Problem::new(erk)
        .stage_cost(GeneralCost::<Misfit>::new())
        .terminal_cost(GeneralCost::<Misfit>::new())
        .on(Horizon::uniform(40, 0.25))?;
    ocp.fix_initial_state(&[0.4, 1.0])?.guess(&[0.4, 1.0], &[])?.set_parameters(.., &[0.0; 7])?;
    for (i, [a, b]) in SAMPLES.into_iter().enumerate() {
        let at = 4 * (i + 1);
        ocp.set_parameters(at..=at, &[0.0, 0.0, 0.0, 0.0, a, b, 1.0])?;
    }
    ocp.free("p.rates", -1.0..=5.0, 0.8)?.free("p.rates[2]", -1.0..=5.0, 1.5)?;
    let outcome = HeapIpm::new(&ocp)?.solve(ocp.free("p.rates[3]", -1.0..=5.0, 1.5)?)?;
    assert!(outcome.is_converged(), "{outcome}");
    assert!((outcome.objective - 2.753366e-2).abs() < 1e-4 * 2.753366e-2, "{outcome}");
    let solution = ocp.solution()?;
    assert_eq!(solution.series().iter().filter(|series| series.kind == Kind::Parameter).count(), 7);
    Ok(())
}

#[ode]
fn constant_rate(_x: f64, p: f64) -> f64 {
    p
}
#[function]
fn price_of_rates(_x: f64, p: f64) -> f64 {
    0.5 * p * p
}
#[function]
fn price_of_the_end(x: f64, _p: f64) -> f64 {
    2.5 * x * x
}

/// Hull's problem with a constant control: `½ c x₀² / (1 + c T)`, with an integral of
/// the parameter.
#[test]
fn integral_of_a_parameter() -> Test {
    let erk = Erk::<ConstantRate, Rk4>::new(Options::default())?;
    let dynamics = WithIntegral::new(erk, Quadrature::<PriceOfRates>::new());
    let mut ocp = Problem::new(dynamics)
        .terminal_cost(GeneralCost::<PriceOfTheEnd>::new())
        .on(Horizon::uniform(30, 5.0 / 30.0))?;
    ocp.fix_initial_state(&[1.5])?.guess(&[1.5], &[])?.free("p", .., 0.8)?;
    let outcome = HeapSqp::new(&ocp)?.solve(&mut ocp)?;
    let expected = 0.5 * 5.0 * 1.5 * 1.5 / (1.0 + 5.0 * 5.0);
    assert!(outcome.is_converged() && (outcome.objective - expected).abs() < 1e-12, "{outcome}");
    assert!((ocp.solution()?.parameter("p")?[0] + 5.0 * 1.5 / 26.0).abs() < 1e-9);
    Ok(())
}

/// What climbs by a parameter in each step, and its measurements with a standard deviation of 0.1.
#[function]
fn climb(x: f64, p: f64) -> f64 {
    x + p
}
#[function]
fn measured(x: f64, _p: f64) -> f64 {
    10.0 * x
}

/// The variance of a slope is `σ² / Σ k²`, and that of a state follows from it.
#[test]
fn covariances_of_free_parameters() -> Test {
    const N: usize = 5;
    let cost = || LeastSquaresCost::<Measured>::diagonal(&[1.0]);
    let mut ocp = Problem::new(Map::<Climb, f64>::new())
        .stage_cost(cost())
        .terminal_cost(cost())
        .on(Horizon::uniform(N, 1.0))?;
    ocp.fix_initial_state(&[0.0])?.guess(&[0.0], &[])?.free("p", .., 0.0)?;
    for k in 0..N {
        ocp.set_reference(k..=k, &[10.0 * (2.0 * k as f64 + 0.01 * (3.0 * k as f64).sin())])?;
    }
    ocp.set_terminal_reference(&[10.0 * 2.0 * N as f64])?;
    assert!(HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?.is_converged());
    let covariance = ocp.covariance(GaussNewton::default())?;
    let squares: f64 = (0..=N).map(|k| (k * k) as f64).sum();
    let expected = 0.1 / squares.sqrt();
    for stage in [0, 2, N] {
        assert!((covariance.standard_deviation("p", stage)? - expected).abs() < 1e-12);
        let state = covariance.standard_deviation("x", stage)?;
        assert!((state - stage as f64 * expected).abs() < 1e-12);
    }
    let joint = covariance.covariance(("p", 0), ("x", 3))?;
    assert!((joint - 3.0 * expected * expected).abs() < 1e-12);
    assert!(covariance.variance("q", 0).is_err() && covariance.variance("p", N + 1).is_err());
    Ok(())
}
