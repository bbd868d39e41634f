//! Derivatives that take part in the error control.

use super::*;

/// A pendulum, `p = ω²`.
#[casados::ode]
fn swing(x: [f64; 2], p: [f64; 1]) -> [f64; 2] {
    [x[1], -p[0] * x[0].sin()]
}

/// The same with the force as an algebraic state.
#[casados::dae]
fn pulled(xdot: [f64; 2], x: [f64; 2], z: [f64; 1], p: [f64; 1]) -> [f64; 3] {
    [xdot[0] - x[1], xdot[1] + z[0], z[0] - p[0] * x[0].sin()]
}

/// At rest nothing moves, so that the states accept every step, while derivatives swing with `ω`:
/// without control they are those of nine steps at any tolerance. With it the errors of all steps
/// add up to no more than their number times the tolerance of `1 + |V|`, `|V| ≤ ω`, and the
/// condition of the swing, `ω`: found are one to six tolerances.
macro_rules! at_rest {
    ($model:ty, $method:ty) => {{
        let (omega, t, u) = (2.0f64, 5.0, SVector::zeros());
        let (sin, cos) = (omega * t).sin_cos();
        let expected = nalgebra::matrix![cos, sin / omega; -omega * sin, cos];
        for tolerance in [1e-2, 1e-4, 1e-6, 1e-8] {
            let options = AdaptiveOptions { rtol: tolerance, atol: tolerance, ..Default::default() };
            let mut adaptive = Adaptive::<$model, $method>::new(options).expect("valid");
            adaptive.set_parameters(&SVector::from([omega * omega])).expect("finite");
            let without = *adaptive.forward(&SVector::zeros(), &u, t).expect("derivatives");
            assert!((without.dx_dx0 - expected).amax() > 1e-2);
            let fewest = adaptive.statistics().steps;
            adaptive.control_sensitivities(true).expect("memory");
            let with = *adaptive.forward(&SVector::zeros(), &u, t).expect("derivatives");
            let (error, steps) = ((with.dx_dx0 - expected).amax(), adaptive.statistics().steps);
            assert!(error <= steps as f64 * (1.0 + omega) * omega * tolerance, "{error:e}, {steps} steps");
            assert!(error <= 20.0 * tolerance, "{error:e} at {tolerance:e}");
            // The parameter moves nothing, and neither do the states.
            assert_eq!((with.x, with.dx_dp), (SVector::zeros(), SVector::zeros()));
            // All calls choose the same steps, until they are chosen for the states alone again.
            let times: Vec<f64> = adaptive.times().collect();
            adaptive.solve(&SVector::zeros(), &u, t).expect("a solution");
            assert_eq!(adaptive.times().collect::<Vec<_>>(), times);
            adaptive.control_sensitivities(false).expect("nothing");
            adaptive.solve(&SVector::zeros(), &u, t).expect("a solution");
            assert_eq!(adaptive.statistics().steps, fewest);
        }
    }};
}

#[test]
fn sensitivity_control_at_steady_states() {
    at_rest!(Swing, Radau);
    at_rest!(Pulled, Radau);
    at_rest!(Pulled, RadauIIA<5>);
    at_rest!(Swing, Gauss<2>);
    at_rest!(Pulled, Gauss<3>);
    at_rest!(Swing, DormandPrince5);
    at_rest!(Swing, DormandPrince8);
}

/// The largest error of a column of derivatives by `(x₀, p)`, in units of what is tolerated: the
/// root of the mean of the squares of its elements over `atol / s_c + rtol |V_rc|`.
fn oregonator_error(tolerance: f64, controlled: bool) -> f64 {
    let (start, p) = problem("oregonator");
    let reference = references("first", "oregonator").remove(0);
    let mut adaptive = integrator::<Oregonator, 4>(&p, tolerance, tolerance);
    adaptive.control_sensitivities(controlled).expect("memory");
    let t = reference.number("t").expect("t");
    let x0 = SVector::<f64, 3>::from_column_slice(&start);
    let found = *adaptive.forward(&x0, &SVector::zeros(), t).expect("derivatives");
    let by_x0 = reference.matrix::<3, 3>("dx_dx0").expect("a matrix");
    let by_p = reference.matrix::<3, 4>("dx_dp").expect("a matrix");
    let error = |found: &[f64], expected: &[f64], magnitude: f64| {
        let squares = found.iter().zip(expected).map(|(found, expected)| {
            ((found - expected) / (tolerance / magnitude + tolerance * expected.abs())).powi(2)
        });
        (squares.sum::<f64>() / 3.0).sqrt()
    };
    let columns = found.dx_dx0.as_slice().chunks(3).chain(found.dx_dp.as_slice().chunks(3));
    let expected = by_x0.as_slice().chunks(3).chain(by_p.as_slice().chunks(3));
    let magnitudes = start.iter().chain(&p);
    columns.zip(expected).zip(magnitudes).fold(0.0, |worst: f64, ((found, expected), magnitude)| {
        worst.max(error(found, expected, magnitude.abs()))
    })
}

/// Relaxation oscillations amplify errors between their jumps. With control the errors of some
/// hundred steps are those of a few at the tolerance, found 0.2 to 7; without it 30 to 130 at most
/// fine tolerances, since derivatives are steeper than the states.
#[test]
fn sensitivity_control_of_a_relaxation_oscillation() {
    let (mut worst, mut worst_without) = (0.0f64, 0.0f64);
    for exponent in 2..=8 {
        let tolerance = 10f64.powi(-exponent);
        let (with, without) = (oregonator_error(tolerance, true), oregonator_error(tolerance, false));
        (worst, worst_without) = (worst.max(with), worst_without.max(without));
    }
    assert!(worst <= 15.0, "{worst} tolerances");
    assert!(worst_without > 2.0 * worst, "{worst_without} and {worst} tolerances");
}

/// Magnitudes say which changes count: an input whose changes are small beside what is tolerated is
/// not controlled.
#[test]
fn sensitivity_scales() {
    let options = AdaptiveOptions { rtol: 1e-6, atol: 1e-6, ..Default::default() };
    let mut adaptive = Adaptive::<Swing, Radau>::new(options).expect("valid");
    adaptive.set_parameters(&SVector::from([4.0])).expect("finite");
    adaptive.control_sensitivities(true).expect("memory");
    let mut steps = |scale: f64| {
        let (scales, none) = (SVector::repeat(scale), SVector::zeros());
        adaptive.set_sensitivity_scales(&scales, &none, &SVector::zeros()).expect("magnitudes");
        adaptive.solve(&SVector::zeros(), &none, 5.0).expect("a solution");
        adaptive.statistics().steps
    };
    let (default, unit, small) = (steps(0.0), steps(1.0), steps(1e-6));
    assert_eq!(default, unit);
    assert!(small < unit / 2, "{small} of {unit}");
    for scale in [-1.0, f64::NAN, f64::INFINITY] {
        let error =
            adaptive.set_sensitivity_scales(&SVector::zeros(), &SVector::zeros(), &SVector::from([scale]));
        assert!(matches!(error, Err(Error::InvalidOption { .. })));
    }
}
