//! Bergman's minimal model of glucose and insulin: parameters from the intravenous glucose
//! tolerance test of G. Pacini, R. N. Bergman, "MINMOD", Comput. Methods Programs Biomed. 23
//! (1986), from a guess by simulation; against an implementation that has nothing in common with
//! this one.

use crate::Test;
use casados::ocp::{GaussNewton, HeapOcp, HeapSqp, Horizon, LeastSquaresCost, OcpError, Problem};
use casados::prelude::*;
use nalgebra::{Matrix4, Vector4};

/// Minutes, glucose in mg/dl, insulin in µU/ml.
const SAMPLES: [[f64; 3]; 24] = [
    [0.0, 92.0, 11.0],
    [2.0, 350.0, 26.0],
    [4.0, 287.0, 130.0],
    [6.0, 251.0, 85.0],
    [8.0, 240.0, 51.0],
    [10.0, 216.0, 49.0],
    [12.0, 211.0, 45.0],
    [14.0, 205.0, 41.0],
    [16.0, 196.0, 35.0],
    [19.0, 192.0, 30.0],
    [22.0, 172.0, 30.0],
    [27.0, 163.0, 27.0],
    [32.0, 142.0, 30.0],
    [42.0, 124.0, 22.0],
    [52.0, 105.0, 15.0],
    [62.0, 92.0, 15.0],
    [72.0, 84.0, 11.0],
    [82.0, 77.0, 10.0],
    [92.0, 82.0, 8.0],
    [102.0, 81.0, 11.0],
    [122.0, 82.0, 7.0],
    [142.0, 82.0, 8.0],
    [162.0, 85.0, 8.0],
    [182.0, 90.0, 7.0],
];
const BASAL: [f64; 2] = [92.0, 11.0];
/// mg/dl
const SIGMA: f64 = 5.0;

/// x = [glucose mg/dl, insulin action 1/min, ln p₁, ln p₂, ln p₃]; p = [weight, sample, insulin
/// above its basal value].
#[ode]
fn minimal(x: [f64; 5], p: [f64; 3]) -> [f64; 5] {
    let [glucose, action, p1, p2, p3] = x;
    [p1.exp() * (92.0 - glucose) - action * glucose, p3.exp() * p[2] - p2.exp() * action, 0.0, 0.0, 0.0]
}
#[function]
fn deviation(x: [f64; 5], p: [f64; 3]) -> f64 {
    p[0] * (x[0] - p[1])
}

type Seen = LeastSquaresCost<Deviation>;
type Estimation = HeapOcp<Problem<Irk<Minimal, Gauss<3>>, Seen, Seen>>;

/// The mean insulin of an interval.
fn insulin(k: usize) -> f64 {
    let next = (k + 1).min(SAMPLES.len() - 1);
    0.5 * (SAMPLES[k][2] + SAMPLES[next][2]) - BASAL[1]
}
/// Before eight minutes glucose has not spread: these samples do not count.
fn weight(k: usize) -> f64 {
    if SAMPLES[k][0] < 8.0 { 0.0 } else { 1.0 / SIGMA }
}

fn problem() -> Result<Estimation, Box<dyn std::error::Error>> {
    let times = SAMPLES.map(|sample| sample[0]);
    let mut ocp = Problem::new(Irk::<Minimal, Gauss<3>>::new(Options { steps: 2, ..Default::default() })?)
        .stage_cost(Seen::diagonal(&[1.0]))
        .terminal_cost(Seen::diagonal(&[1.0]))
        .on(Horizon::nodes(&times))?;
    for (k, sample) in SAMPLES.iter().enumerate() {
        ocp.set_parameters(k..=k, &[weight(k), sample[1], insulin(k)])?;
    }
    // Insulin acts from zero on.
    ocp.free_initial_state().bound("x[1]", ..=0, 0.0, 0.0)?;
    Ok(ocp)
}

/// Glucose 300 mg/dl, rates of 0.03, 0.03 and 1e-5.
fn start() -> [f64; 5] {
    [300.0, 0.0, 0.03_f64.ln(), 0.03_f64.ln(), 1e-5_f64.ln()]
}

/// Weighted residuals by Runge and Kutta's method with steps of a fiftieth of an interval.
fn residuals(unknown: &Vector4<f64>) -> Vec<f64> {
    let (p1, p2, p3) = (unknown[1].exp(), unknown[2].exp(), unknown[3].exp());
    let mut x = [unknown[0], 0.0];
    let mut all = Vec::new();
    for (k, sample) in SAMPLES.iter().enumerate() {
        all.push(weight(k) * (x[0] - sample[1]));
        let Some(next) = SAMPLES.get(k + 1) else { break };
        let h = (next[0] - sample[0]) / 50.0;
        let f = |x: [f64; 2]| [p1 * (92.0 - x[0]) - x[1] * x[0], p3 * insulin(k) - p2 * x[1]];
        for _ in 0..50 {
            let add = |x: [f64; 2], h: f64, d: [f64; 2]| [x[0] + h * d[0], x[1] + h * d[1]];
            let k1 = f(x);
            let k2 = f(add(x, 0.5 * h, k1));
            let k3 = f(add(x, 0.5 * h, k2));
            let k4 = f(add(x, h, k3));
            x = add(x, h / 6.0, [0, 1].map(|i| k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
        }
    }
    all
}

/// The minimum by Levenberg's and Marquardt's method with central differences, and `(JᵀJ)⁻¹`.
fn reference() -> Result<(f64, Vector4<f64>, Matrix4<f64>), &'static str> {
    let start = start();
    let mut unknown = Vector4::new(start[0], start[2], start[3], start[4]);
    let cost = |unknown: &Vector4<f64>| 0.5 * residuals(unknown).iter().map(|r| r * r).sum::<f64>();
    let (mut damping, mut information) = (1e-2, Matrix4::zeros());
    for _ in 0..200 {
        let columns: Vec<Vec<f64>> = (0..4)
            .map(|i| {
                let h = if i == 0 { 1e-3 } else { 1e-5 };
                let at = |side: f64| {
                    let mut other = unknown;
                    other[i] += side * h;
                    residuals(&other)
                };
                at(1.0).iter().zip(at(-1.0)).map(|(a, b)| (a - b) / (2.0 * h)).collect()
            })
            .collect();
        let here = residuals(&unknown);
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        information = Matrix4::from_fn(|i, j| product(&columns[i], &columns[j]));
        let gradient = Vector4::from_fn(|i, _| product(&columns[i], &here));
        let mut damped = information;
        (0..4).for_each(|i| damped[(i, i)] *= 1.0 + damping);
        let step = damped.cholesky().ok_or("not definite")?.solve(&gradient);
        if cost(&(unknown - step)) < cost(&unknown) {
            (unknown, damping) = (unknown - step, damping / 4.0);
        } else {
            damping *= 4.0;
        }
    }
    Ok((cost(&unknown), unknown, information.cholesky().ok_or("not definite")?.inverse()))
}

#[test]
fn parameters_from_a_simulated_guess() -> Test {
    let mut ocp = problem()?;
    ocp.guess(&start(), &[])?.guess_by_simulation()?;
    // The guess has no gaps.
    ocp.linearise(GaussNewton::default())?;
    assert!(ocp.residuals().0.dynamics < 1e-9, "{}", ocp.residuals().0);
    let mut sqp = HeapSqp::new(&ocp)?;
    let outcome = sqp.solve(&mut ocp)?;
    println!("{}{outcome}", sqp.log());
    let (minimum, unknown, dense) = reference()?;
    println!("{minimum} {unknown}");
    assert!(outcome.is_converged(), "{outcome}");
    // Both integrate to 1e-8; a residual of 1e-6 is squared beside curvatures of one.
    assert!((outcome.objective - minimum).abs() < 1e-5 * minimum, "{} {minimum}", outcome.objective);
    let covariance = ocp.covariance(GaussNewton::default())?;
    assert!(covariance.is_identifiable());
    let found = ocp.stage(0)?.x;
    for (i, (name, index)) in [("x[0]", 0), ("x[2]", 2), ("x[3]", 3), ("x[4]", 4)].into_iter().enumerate() {
        let deviation = dense[(i, i)].sqrt();
        println!("{name} {} ± {} {deviation}", found[index], covariance.standard_deviation(name, 0)?);
        assert!((found[index] - unknown[i]).abs() < 1e-3 * deviation, "{name}");
        // Central differences of 1e-5 leave eight digits, the condition of `JᵀJ` takes four.
        assert!((covariance.standard_deviation(name, 0)? / deviation - 1.0).abs() < 1e-3, "{name}");
    }
    Ok(())
}

/// A simulation that has no end says where, and what is large there.
#[test]
fn divergent_simulations() -> Test {
    let mut ocp = problem()?;
    let mut wild = start();
    // A sensitivity to insulin that is no number.
    wild[4] = 709.5;
    ocp.guess(&wild, &[])?;
    let error = ocp.guess_by_simulation().err().ok_or("it has an end")?;
    println!("{error}");
    assert!(matches!(error, OcpError::Simulation { interval: 0, .. }), "{error:?}");
    let mut adaptive = Adaptive::<Minimal, Radau>::new(AdaptiveOptions::default())?;
    ocp.guess(&start(), &[])?.guess_by_simulation_with(&mut adaptive)?;
    let by_adaptive = ocp.stage(23)?.x.to_vec();
    ocp.guess(&start(), &[])?.guess_by_simulation()?;
    let by_own = ocp.stage(23)?.x;
    assert!(by_own.iter().zip(&by_adaptive).all(|(a, b)| (a - b).abs() < 1e-3 * (1.0 + a.abs())));
    Ok(())
}

/// All starts with one call: the best outcome first, what has no value last.
#[test]
fn solve_from_many_guesses() -> Test {
    let mut ocp = problem()?;
    let rates = [0.1, f64::NAN, 0.03, 0.01];
    let found = ocp.multi_start(
        rates.len(),
        |ocp, i| {
            let mut x = start();
            x[3] = rates[i].ln();
            ocp.guess(&x, &[])?.guess_by_simulation().map(|_| ())
        },
        |ocp| {
            let mut sqp = HeapSqp::new(ocp)?;
            Ok(move |ocp: &mut Estimation| sqp.solve(ocp))
        },
    )?;
    let (minimum, ..) = reference()?;
    let best = found.best().ok_or("a solution")?;
    assert!((best.objective - minimum).abs() < 1e-5 * minimum, "{best}");
    assert_eq!(found.ranked.len(), 4);
    let last = &found.ranked[3];
    assert!(last.start == 1 && matches!(last.outcome, Err(OcpError::InvalidValue { .. })));
    let objectives: Vec<_> = found
        .ranked
        .iter()
        .flat_map(|start| &start.outcome)
        .filter(|o| o.is_solved())
        .map(|o| o.objective)
        .collect();
    assert!(objectives.is_sorted());
    assert_eq!(ocp.stage(0)?.x, found.ranked[0].solution.stage(0).ok_or("a stage")?.x);
    Ok(())
}
