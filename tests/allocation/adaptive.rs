//! Adaptive integrators allocate in the first call of each kind, and those of several intervals or
//! with events the lists of their results.

use crate::count_allocations;
use crate::models::{Linear, Nonlinear, Shifted};
use casados_core::{Adaptive, AdaptiveOptions, Crossing, Error, Event, Hybrid, Piecewise, Radau};
use nalgebra::vector;

#[test]
fn adaptive_integrators_allocate_once() -> Result<(), Error> {
    let (x0, u, lambda) = (vector![0.4, -0.7], vector![0.9], vector![1.0, 2.0]);
    let mut adaptive = Adaptive::<Nonlinear, Radau>::new(AdaptiveOptions::default())?;
    adaptive.set_parameters(&vector![1.3])?;
    let mut run = || {
        [
            count_allocations(|| _ = adaptive.solve(&x0, &u, 0.5).unwrap()),
            count_allocations(|| _ = adaptive.dense(0.2).unwrap()),
            count_allocations(|| _ = adaptive.forward(&x0, &u, 0.5).unwrap()),
            count_allocations(|| _ = adaptive.adjoint(&x0, &u, 0.5, &lambda).unwrap()),
            count_allocations(|| _ = adaptive.hessian(&x0, &u, 0.5, &lambda).unwrap()),
        ]
    };
    assert!(run()[0] > 0);
    assert_eq!(run(), [0; 5]);
    Ok(())
}

/// Results of several intervals own a list for each quantity that has an element per interval.
#[test]
fn piecewise_integrators_allocate_lists_of_results() -> Result<(), Error> {
    let (x0, lambda) = (vector![0.4, -0.7], vector![1.0, 2.0]);
    let (u, ends) = ([vector![0.9], vector![0.1], vector![-0.3]], [0.2, 0.3, 0.5]);
    let mut adaptive = Adaptive::<Nonlinear, Radau>::new(AdaptiveOptions::default())?;
    adaptive.set_parameters(&vector![1.3])?;
    let mut piecewise = Piecewise::new(adaptive);
    let mut run = || {
        [
            count_allocations(|| _ = piecewise.solve(&x0, &u, &ends).unwrap()),
            count_allocations(|| _ = piecewise.dense(0.25).unwrap()),
            count_allocations(|| _ = piecewise.forward(&x0, &u, &ends).unwrap()),
            count_allocations(|| _ = piecewise.adjoint(&x0, &u, &ends, &lambda).unwrap()),
            count_allocations(|| _ = piecewise.hessian(&x0, &u, &ends, &lambda).unwrap()),
        ]
    };
    assert!(run()[0] > 0);
    // `dx_du` and `dz_du`; `grad_u`; these three, `h_xu`, `h_uu` and `h_up`.
    assert_eq!(run(), [0, 0, 2, 1, 6]);
    Ok(())
}

/// The state rises to zero and is put down by one, again and again.
#[test]
fn hybrid_integrators_allocate_lists_of_results() -> Result<(), Error> {
    let (x0, u, lambda) = (vector![-1.0], vector![2.0], vector![1.0]);
    let mut adaptive = Adaptive::<Linear, Radau>::new(AdaptiveOptions::default())?;
    adaptive.set_parameters(&vector![-1.0])?;
    let mut hybrid = Hybrid::new(adaptive, &[Event::jump::<Shifted<0>, Shifted<-1>>(Crossing::Rising)])?;
    assert!(hybrid.solve(&x0, &u, 2.0)?.occurrences.len() >= 3);
    let mut run = || {
        [
            count_allocations(|| _ = hybrid.solve(&x0, &u, 2.0).unwrap()),
            count_allocations(|| _ = hybrid.dense(1.0).unwrap()),
            count_allocations(|| _ = hybrid.forward(&x0, &u, 2.0).unwrap()),
            count_allocations(|| _ = hybrid.adjoint(&x0, &u, 2.0, &lambda).unwrap()),
            count_allocations(|| _ = hybrid.hessian(&x0, &u, 2.0, &lambda).unwrap()),
        ]
    };
    run();
    // `dx_du` and `dz_du`; `grad_u`; these three.
    assert_eq!(run(), [0, 0, 2, 1, 3]);
    Ok(())
}
