//! Estimates from guesses with gaps.

use crate::Test;
use casados::ocp::{HeapOcp, HeapSqp, Horizon, LeastSquaresCost, Problem};
use casados::prelude::*;

/// A → B → C: x = [a, b, ln k₁, ln k₂, ln g]; p = [weight, value] of what is seen of `b`.
#[ode]
fn reaction(x: [f64; 5], _p: [f64; 2]) -> [f64; 5] {
    let [a, b, k1, k2, _] = x;
    let (first, second) = (k1.exp() * a, k2.exp() * b);
    [-first, first - second, 0.0, 0.0, 0.0]
}
#[function]
fn deviation(x: [f64; 5], p: [f64; 2]) -> f64 {
    p[0] * (x[4].exp() * x[1] - p[1])
}

/// Of `a = 1.3`, rates of 0.15 and 0.06 and a gain of 0.8, with noise of 0.01; every fourth one is
/// missing.
const SAMPLES: [f64; 31] = [
    -0.01, 0.1766, 0.2763, 0.3504, 0.4119, 0.4629, 0.512, 0.5221, 0.5464, 0.5545, 0.5549, 0.5611, 0.572,
    0.5481, 0.5377, 0.4983, 0.5045, 0.4888, 0.46, 0.4559, 0.4349, 0.4015, 0.4136, 0.3789, 0.3679, 0.3476,
    0.3193, 0.3204, 0.2985, 0.2839, 0.2806,
];
const PRIOR_MEAN: [f64; 5] = [1.0, 0.0, -2.0, -3.0, 0.0];
/// Standard deviations of the mean.
const PRIOR_DEVIATIONS: [f64; 5] = [2.0, 0.2, 2.0, 2.0, 2.0];
/// The minimum, by an implementation that has nothing in common with this one: Gauss's and Newton's
/// steps by dense factorisations in NumPy, on the closed form of the solution of the reaction.
const REFERENCE_MINIMUM: f64 = 7.228_872_257;

type Seen = LeastSquaresCost<Deviation>;
type Estimation = HeapOcp<Problem<Irk<Reaction, Gauss<3>>, Seen, Seen>>;

fn estimation() -> Result<Estimation, Box<dyn std::error::Error>> {
    let times: Vec<f64> = (0..=30).map(|k| f64::from(k) + 0.3 * f64::from(k).sin()).collect();
    let mut ocp = Problem::new(Irk::<Reaction, Gauss<3>>::new(Options::default())?)
        .stage_cost(Seen::diagonal(&[1.0]))
        .terminal_cost(Seen::diagonal(&[1.0]))
        .on(Horizon::nodes(&times))?;
    let mut weight = [0.0; 25];
    for (i, sigma) in PRIOR_DEVIATIONS.iter().enumerate() {
        weight[6 * i] = 1.0 / (sigma * sigma);
    }
    ocp.set_arrival_cost(&PRIOR_MEAN, &weight)?;
    for (k, sample) in SAMPLES.iter().enumerate() {
        ocp.set_parameters(k..=k, &[if k % 4 == 3 { 0.0 } else { 100.0 }, *sample])?;
    }
    ocp.free_initial_state().guess(&PRIOR_MEAN, &[])?;
    Ok(ocp)
}

/// Only the product of amount and gain is seen: on the way from a guess with gaps they shrink with
/// the amount, while the gain grows, and multipliers grow by as much. Short steps stay on that way;
/// damped ones leave it.
#[test]
fn unidentifiable_product() -> Test {
    let mut ocp = estimation()?;
    let mut sqp = HeapSqp::new(&ocp)?.gauss_newton();
    let outcome = sqp.solve(&mut ocp)?;
    println!("{}{outcome}", sqp.log());
    assert!(outcome.is_converged(), "{outcome}");
    // A residual of 1e-6 beside the least curvature, which is that of the mean: 1/4. Integration
    // with three stages adds less.
    assert!((outcome.objective - REFERENCE_MINIMUM).abs() < 1e-5, "{}", outcome.objective);
    Ok(())
}
