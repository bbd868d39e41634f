//! The arrival cost: moving-horizon estimation of a linear system is Kalman's filter.

use crate::Test;
use casados::ocp::{HeapIpm, HeapSqp, Horizon, LeastSquaresCost, Map, OcpError, Part, Problem};
use casados::prelude::*;
use nalgebra::{Matrix1, Matrix1x2, Matrix2, Vector2, matrix, vector};

/// `x₊ = A x + w`, where the noise `w` is what is found.
#[function]
fn walk(x: [f64; 2], u: [f64; 2]) -> [f64; 2] {
    [x[0] + 0.2 * x[1] + u[0], -0.1 * x[0] + 0.95 * x[1] + u[1]]
}

/// What is measured, then the noise.
#[function]
fn seen(x: [f64; 2], u: [f64; 2]) -> [f64; 3] {
    [x[0], u[0], u[1]]
}

#[function]
fn seen_last(x: [f64; 2], _u: [f64; 2]) -> f64 {
    x[0]
}

const N: usize = 12;

/// Covariances of the noise, of measurements, and of the first state.
fn covariances() -> (Matrix2<f64>, f64, Matrix2<f64>) {
    (matrix![0.04, 0.0; 0.0, 0.09], 0.25, matrix![0.5, 0.2; 0.2, 0.8])
}

fn measurement(k: usize) -> f64 {
    1.0 + (1.7 * k as f64).sin() + 0.1 * k as f64
}

/// The estimate of the last state from all measurements.
fn kalman_filter(mean: Vector2<f64>) -> Result<Vector2<f64>, &'static str> {
    let (noise, variance, mut covariance) = covariances();
    let (a, c) = (matrix![1.0, 0.2; -0.1, 0.95], Matrix1x2::new(1.0, 0.0));
    let mut x = mean;
    for k in 0..=N {
        let innovation = c * covariance * c.transpose() + Matrix1::new(variance);
        let gain = covariance * c.transpose() * innovation.try_inverse().ok_or("singular")?;
        x += gain * (Matrix1::new(measurement(k)) - c * x);
        covariance -= gain * c * covariance;
        if k < N {
            x = a * x;
            covariance = a * covariance * a.transpose() + noise;
        }
    }
    Ok(x)
}

#[test]
fn kalman_filter_estimates() -> Test {
    let (noise, variance, covariance) = covariances();
    let mean = vector![0.7, -0.4];
    let expected = kalman_filter(mean)?;
    for by_ipm in [true, false] {
        let weights = [1.0 / variance, 1.0 / noise[(0, 0)], 1.0 / noise[(1, 1)]];
        let problem = Problem::new(Map::<Walk, f64>::new())
            .stage_cost(LeastSquaresCost::<Seen>::diagonal(&weights))
            .terminal_cost(LeastSquaresCost::<SeenLast>::diagonal(&[1.0 / variance]));
        let mut ocp = problem.on(Horizon::uniform(N, 1.0))?;
        let weight = covariance.try_inverse().ok_or("singular")?;
        ocp.free_initial_state().set_arrival_cost(mean.as_slice(), weight.as_slice())?;
        for k in 0..N {
            ocp.set_reference(k..=k, &[measurement(k), 0.0, 0.0])?;
        }
        ocp.set_terminal_reference(&[measurement(N)])?.guess(&[0.0; 2], &[0.0; 2])?;
        let outcome = if by_ipm {
            HeapIpm::new(&ocp)?.solve(&mut ocp)?
        } else {
            HeapSqp::new(&ocp)?.solve(&mut ocp)?
        };
        assert!(outcome.is_converged() && outcome.iterations <= 2, "{outcome}");
        let found = Vector2::from_column_slice(ocp.stage(N)?.x);
        // The condition of the problem is below 1e3.
        assert!((found - expected).amax() < 1e-9, "{by_ipm} {found} {expected}");
        // The objective has the arrival cost: by hand.
        let first = Vector2::from_column_slice(ocp.stage(0)?.x) - mean;
        let mut sum = 0.5 * (first.transpose() * weight * first)[(0, 0)];
        for k in 0..=N {
            let stage = ocp.stage(k)?;
            sum += 0.5 * weights[0] * (stage.x[0] - measurement(k)).powi(2);
            sum += stage.u.iter().zip(&weights[1..]).map(|(w, weight)| 0.5 * weight * w * w).sum::<f64>();
        }
        assert!((outcome.objective - sum).abs() < 1e-10 * sum, "{outcome} {sum}");
    }
    Ok(())
}

#[test]
fn invalid_arguments() -> Test {
    let mut ocp = Problem::new(Map::<Walk, f64>::new()).on(Horizon::uniform(2, 1.0))?;
    let short = ocp.set_arrival_cost(&[0.0; 2], &[1.0; 3]).err();
    assert!(matches!(short, Some(OcpError::Length { part: Part::Arrival, expected: 4, found: 3, .. })));
    let skew = ocp.set_arrival_cost(&[0.0; 2], &[1.0, 0.5, 0.4, 1.0]).err();
    let expected = ["x[1]", "x[0]"];
    assert!(matches!(skew, Some(OcpError::InvalidArrivalWeight { states, .. }) if states == expected));
    let saddle = ocp.set_arrival_cost(&[0.0; 2], &[1.0, 2.0, 2.0, 1.0]).err();
    assert!(matches!(saddle, Some(OcpError::InvalidArrivalWeight { states: ["x[1]", "x[1]"], .. })));
    let nan = ocp.set_arrival_cost(&[0.0; 2], &[f64::NAN, 0.0, 0.0, 1.0]).err();
    assert!(matches!(nan, Some(OcpError::InvalidArrivalWeight { states: ["x[0]", "x[0]"], .. })));
    let infinite = ocp.set_arrival_cost(&[f64::NAN, 0.0], &[1.0, 0.0, 0.0, 1.0]).err();
    assert!(matches!(infinite, Some(OcpError::InvalidValue { part: Part::InitialState, .. })));
    Ok(())
}
