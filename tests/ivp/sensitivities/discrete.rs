//! Derivatives of the map that an adaptive run is, at any tolerance.

use super::*;

/// All derivatives at a coarse tolerance are those of one discrete map, exactly: the adjoint is the
/// product with the forward derivatives, and both follow the frozen map by complex or real
/// differences.
#[test]
fn derivatives_of_frozen_steps() {
    let (x0, p) = problem("akzo_nobel");
    let x0 = SVector::<f64, 5>::from_column_slice(&x0) + SVector::repeat(0.01);
    let (u, t) = (SVector::zeros(), 20.0);
    let mut adaptive = integrator::<AkzoNobel, 9>(&p, 1e-4, 1e-8);
    let lambda = SVector::<f64, 5>::from([1.0, -2.0, 0.5, 3.0, 1.5]);
    let run = *adaptive.hessian(&x0, &u, t, &lambda).expect("second derivatives");
    adaptive.freeze().expect("steps are remembered");
    let times: Vec<f64> = adaptive.times().collect();
    assert!(times.len() > 5);
    // Before, each step was taken from where the run was, which had solved its equations to a part
    // of the tolerance.
    let hessian = *adaptive.hessian(&x0, &u, t, &lambda).expect("second derivatives");
    for (run, frozen) in [
        (run.grad_x0.as_slice(), &hessian.grad_x0.as_slice()),
        (run.grad_p.as_slice(), &hessian.grad_p.as_slice()),
    ] {
        let size = frozen.iter().fold(0.0_f64, |size, value| size.max(value.abs()));
        assert!(run.iter().zip(*frozen).all(|(a, b)| (a - b).abs() <= 1e-4 * size));
    }

    // Rounding of Newton's method, ε, times the condition of sums of a few dozen terms.
    let forward = *adaptive.forward(&x0, &u, t).expect("derivatives");
    let adjoint = *adaptive.adjoint(&x0, &u, t, &lambda).expect("a gradient");
    let same = |a: f64, b: f64, size: f64| assert!((a - b).abs() <= 1e-12 * size, "{a} {b}");
    for w in 0..5 {
        let column = forward.dx_dx0.column(w);
        let size = column.component_mul(&lambda).abs().sum();
        same(adjoint.grad_x0[w], lambda.dot(&column), size);
        same(hessian.grad_x0[w], adjoint.grad_x0[w], size);
    }
    for w in 0..9 {
        let column = forward.dx_dp.column(w);
        let size = column.component_mul(&lambda).abs().sum();
        same(adjoint.grad_p[w], lambda.dot(&column), size);
        same(hessian.grad_p[w], adjoint.grad_p[w], size);
    }

    // Central differences of the frozen map: the error is δ² times a third derivative, and ε/δ.
    let delta = 1e-4;
    for w in 0..5 {
        let mut step = SVector::<f64, 5>::zeros();
        step[w] = delta * x0[w];
        let above = *adaptive.hessian(&(x0 + step), &u, t, &lambda).expect("the frozen map");
        assert_eq!(adaptive.times().collect::<Vec<_>>(), times);
        let below = *adaptive.hessian(&(x0 - step), &u, t, &lambda).expect("the frozen map");
        let width = 2.0 * step[w];
        let difference = (above.x - below.x) / width;
        let error = (difference - forward.dx_dx0.column(w)).amax();
        assert!(error <= 1e-6 * forward.dx_dx0.column(w).amax(), "x0[{w}]: {error:e}");
        let error = ((above.z - below.z) / width - forward.dz_dx0.column(w)).amax();
        assert!(error <= 1e-6 * forward.dz_dx0.column(w).amax().max(1e-3), "x0[{w}]: {error:e} of z");
        let difference = (above.z0 - below.z0) / width;
        let error = (difference - forward.dz0_dx0.column(w)).amax();
        assert!(error <= 1e-6 * forward.dz0_dx0.column(w).amax().max(1e-3), "x0[{w}]: {error:e} of z0");
        let difference = (above.grad_x0 - below.grad_x0) / width;
        let error = (difference - hessian.h_xx.column(w)).amax();
        assert!(error <= 1e-5 * hessian.h_xx.amax(), "x0[{w}]: {error:e} of the gradient");
        let difference = (above.grad_p - below.grad_p) / width;
        let error = (difference - hessian.h_xp.row(w).transpose()).amax();
        assert!(error <= 1e-5 * hessian.h_xp.amax(), "x0[{w}]: {error:e} of the gradient by p");
    }

    // Another interval is not that of the steps.
    assert!(matches!(adaptive.solve(&x0, &u, 21.0), Err(Error::OutsideInterval { .. })));
    adaptive.thaw();
    assert!(adaptive.solve(&x0, &u, 21.0).is_ok());
}

/// The same of an explicit pair: adjoint and forward derivatives agree, and follow the frozen map.
#[test]
fn derivatives_of_frozen_explicit_steps() {
    let x0 = SVector::from([2.0, 0.5]);
    let (u, t, lambda) = (SVector::zeros(), 3.0, SVector::from([1.0, -2.0]));
    let options = AdaptiveOptions { rtol: 1e-5, atol: 1e-5, ..Default::default() };
    let mut adaptive = Adaptive::<VanDerPol, DormandPrince5>::new(options).expect("valid");
    adaptive.set_parameters(&SVector::from([2.0])).expect("finite");
    let solved = *adaptive.solve(&x0, &u, t).expect("a solution");
    let hessian = *adaptive.hessian(&x0, &u, t, &lambda).expect("second derivatives");
    // The steps are explicit: taking them again gives the same, but for the order of sums.
    assert!((solved.x - hessian.x).amax() <= 1e-13);
    adaptive.freeze().expect("steps are remembered");
    let adjoint = *adaptive.adjoint(&x0, &u, t, &lambda).expect("a gradient");
    assert!((adjoint.grad_x0 - hessian.dx_dx0.transpose() * lambda).amax() <= 1e-12 * hessian.dx_dx0.amax());
    assert!((adjoint.grad_p - hessian.dx_dp.transpose() * lambda).amax() <= 1e-12 * hessian.dx_dp.amax());
    let delta = 1e-5;
    for w in 0..2 {
        let mut step = SVector::<f64, 2>::zeros();
        step[w] = delta;
        let above = *adaptive.adjoint(&(x0 + step), &u, t, &lambda).expect("the frozen map");
        let below = *adaptive.adjoint(&(x0 - step), &u, t, &lambda).expect("the frozen map");
        let error = ((above.x - below.x) / (2.0 * delta) - hessian.dx_dx0.column(w)).amax();
        assert!(error <= 1e-7 * hessian.dx_dx0.amax(), "{error:e}");
        let error = ((above.grad_x0 - below.grad_x0) / (2.0 * delta) - hessian.h_xx.column(w)).amax();
        assert!(error <= 1e-6 * hessian.h_xx.amax(), "{error:e}");
    }
}

/// At any tolerance derivatives are those of the run that was made: jumps, which amplify by a
/// million, do not lead elsewhere what is taken again.
#[test]
fn derivatives_at_coarse_tolerances() {
    let (x0, p) = problem("van_der_pol_1e3");
    let (x0, t) = (SVector::<f64, 2>::from_column_slice(&x0), 2000.0);
    let references = references("first", "van_der_pol_1e3");
    let reference = references.iter().find(|r| r.number("t").is_ok_and(|at| at == t)).expect("the end");
    let expected = reference.matrix::<2, 1>("dx_dp").expect("derivatives")[0];
    for rtol in [1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 1e-6] {
        let mut adaptive = integrator::<VanDerPol, 1>(&p, rtol, rtol);
        let solved = adaptive.solve(&x0, &SVector::zeros(), t).expect("a solution").x;
        let forward = *adaptive.forward(&x0, &SVector::zeros(), t).expect("derivatives");
        // The last step begins within the tolerance of where it began.
        let apart = (forward.x[0] - solved[0]).abs();
        let error = (forward.dx_dp[0] - expected).abs();
        println!("{rtol:e}: {apart:e} {error:e}");
        assert!(apart <= 3.0 * rtol * (1.0 + solved[0].abs()), "{rtol:e}: {} {}", forward.x[0], solved[0]);
        // As of states; at the coarsest two the period itself is wrong.
        assert!(rtol > 1e-2 || error <= 30.0 * rtol, "{rtol:e}: {error:e}");
    }
}

/// Wherever a run ends well it has derivatives, however coarsely its stages were solved.
#[test]
fn existence_of_derivatives_at_coarse_tolerances() {
    let (x0, p) = problem("van_der_pol_1e3");
    let (x0, u, t) = (SVector::<f64, 2>::from_column_slice(&x0), SVector::zeros(), 2000.0);
    for k in 0..=30 {
        let rtol = 10f64.powf(-1.0 - f64::from(k) / 10.0);
        let mut adaptive = integrator::<VanDerPol, 1>(&p, rtol, rtol);
        let solved = adaptive.solve(&x0, &u, t).expect("a solution").x;
        let end = adaptive.forward(&x0, &u, t).expect("derivatives").x;
        // The last step begins within the tolerance of where it began.
        assert!((end[0] - solved[0]).abs() <= 3.0 * rtol * (1.0 + solved[0].abs()), "{rtol:e}");
        adaptive.adjoint(&x0, &u, t, &SVector::from([1.0, 0.0])).expect("a gradient");
    }
}

#[casados::function]
fn level(x: [f64; 2], _p: f64) -> f64 {
    x[0] - 1.8
}

#[casados::function]
fn unchanged(x: [f64; 2], _p: f64) -> [f64; 2] {
    x
}

/// So are those over events on the slow branch, and over intervals one after the other, and both
/// ways to a gradient give the same. Other steps have other errors, which the jumps amplify by a
/// million: found are up to 83 tolerances.
#[test]
fn derivatives_over_events_and_intervals() {
    let (x0, p) = problem("van_der_pol_1e3");
    let (x0, t) = (SVector::<f64, 2>::from_column_slice(&x0), 2000.0);
    let references = references("first", "van_der_pol_1e3");
    let reference = references.iter().find(|r| r.number("t").is_ok_and(|at| at == t)).expect("the end");
    let expected = reference.matrix::<2, 1>("dx_dp").expect("derivatives")[0];
    let (u, lambda) = (SVector::zeros(), SVector::from([1.0, 0.0]));
    for rtol in [3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 1e-6] {
        let event = Event::jump::<Level, Unchanged>(Crossing::Falling);
        let mut hybrid = Hybrid::new(integrator::<VanDerPol, 1>(&p, rtol, rtol), &[event]).expect("memory");
        let forward = hybrid.forward(&x0, &u, t).expect("derivatives");
        let adjoint = hybrid.adjoint(&x0, &u, t, &lambda).expect("a gradient");
        assert_eq!(forward.solution.occurrences.len(), 2);
        let mut piecewise = Piecewise::new(integrator::<VanDerPol, 1>(&p, rtol, rtol));
        let (controls, ends) = ([u; 3], [500.0, 1500.0, t]);
        let parts = piecewise.forward(&x0, &controls, &ends).expect("derivatives");
        let backwards = piecewise.adjoint(&x0, &controls, &ends, &lambda).expect("a gradient");
        for (found, gradient) in
            [(forward.dx_dp[0], adjoint.grad_p[0]), (parts.dx_dp[0], backwards.grad_p[0])]
        {
            let error = (found - expected).abs();
            println!("{rtol:e}: {error:e}");
            assert!(error <= 100.0 * rtol, "{rtol:e}: {error:e}");
            // Rounding, which the jumps amplify: 4.5e-9 of a derivative, see above.
            assert!((gradient - found).abs() <= 4.5e-9 * found.abs(), "{rtol:e}: {found:e} {gradient:e}");
        }
    }
}

/// An interval without length: the identity.
#[test]
fn intervals_of_zero_length() {
    let (x0, p) = problem("akzo_nobel");
    let x0 = SVector::<f64, 5>::from_column_slice(&x0);
    let mut adaptive = integrator::<AkzoNobel, 9>(&p, 1e-6, 1e-9);
    let lambda = SVector::<f64, 5>::repeat(2.0);
    let result = adaptive.hessian(&x0, &SVector::zeros(), 0.0, &lambda).expect("nothing to do");
    assert_eq!(result.x, x0);
    assert_eq!(result.dx_dx0, SMatrix::<f64, 5, 5>::identity());
    assert_eq!(result.grad_x0, lambda);
    assert_eq!(result.h_xx, SMatrix::<f64, 5, 5>::zeros());
    // z = Ks y1 y4
    assert!((result.dz_dx0[(0, 0)] - p[6] * x0[3]).abs() <= 1e-14);
    assert_eq!(result.dz_dx0, result.dz0_dx0);
}
