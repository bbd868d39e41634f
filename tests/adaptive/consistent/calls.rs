//! What calls of all integrators have in common: lengths and times, and what is left of a call that
//! failed.

use casados::prelude::*;
use casados::{Erk, Error};
use nalgebra::{SVector, Vector1, vector};

/// `x = x₀ e^{(t² − t₀²)/2}`, which is no function of `t − t₀`.
#[ode]
fn growth(x: f64, t: f64) -> f64 {
    t * x
}

/// Beyond the end, when it is ahead.
#[function]
fn far(x: f64) -> f64 {
    x - 1e6
}

/// `u` falls off; no value below zero.
#[ode]
fn falling(x: f64, u: f64) -> f64 {
    x.sqrt() - u
}

#[function]
fn floor(x: f64, u: f64) -> f64 {
    x - 0.25 + 0.0 * u
}

/// The last argument of a call is a length, whatever the time at the start is; `dense` takes a
/// time.
#[test]
fn interval_lengths_and_solution_times() {
    let none = SVector::<f64, 0>::zeros();
    let exact = |t: f64| (0.5 * (t * t - 1.0)).exp();
    let options = AdaptiveOptions { rtol: 1e-10, atol: 1e-10, ..Default::default() };
    let steps = Options { steps: 8, ..Default::default() };
    let close =
        |value: f64, t: f64| assert!((value - exact(t)).abs() <= 1e-7, "{value} at {t}: {}", exact(t));
    macro_rules! check {
        ($integrator:expr $(, dense: $dense:literal)?) => {
            for h in [0.5, -0.5] {
                let mut integrator = $integrator;
                integrator.set_time(1.0).unwrap();
                close(integrator.solve(&vector![1.0], &none, h).unwrap().x[0], 1.0 + h);
                $(
                    assert!($dense);
                    close(integrator.dense(1.0 + 0.25 * h).unwrap().x[0], 1.0 + 0.25 * h);
                    assert!(matches!(integrator.dense(1.0 - 0.25 * h), Err(Error::OutsideInterval { .. })));
                )?
                close(integrator.forward(&vector![1.0], &none, h).unwrap().dx_dx0[0], 1.0 + h);
                close(integrator.adjoint(&vector![1.0], &none, h, &vector![1.0]).unwrap().grad_x0[0], 1.0 + h);
                close(integrator.hessian(&vector![1.0], &none, h, &vector![1.0]).unwrap().grad_x0[0], 1.0 + h);
            }
        };
    }
    check!(Irk::<Growth, Gauss<4>>::new(steps).unwrap(), dense: true);
    check!(Erk::<Growth, DormandPrince8>::new(steps).unwrap());
    check!(Adaptive::<Growth, Radau>::new(options).unwrap(), dense: true);
    check!(Adaptive::<Growth, Gauss<4>>::new(options).unwrap(), dense: true);
    check!(Adaptive::<Growth, DormandPrince8>::new(options).unwrap(), dense: true);

    let mut adaptive = Adaptive::<Growth, Radau>::new(options).unwrap();
    adaptive.set_time(1.0).unwrap();
    let mut seen = Vec::new();
    adaptive.solve_at(&vector![1.0], &none, 0.5, &[1.1, 1.5], |t, dense| seen.push((t, dense.x[0]))).unwrap();
    assert!(seen.len() == 2 && seen[0].0 == 1.1);
    seen.iter().for_each(|(t, x)| close(*x, *t));
    // Steps that are frozen are those of the same interval.
    adaptive.freeze().unwrap();
    close(adaptive.solve(&vector![1.0], &none, 0.5).unwrap().x[0], 1.5);
    assert!(matches!(adaptive.solve(&vector![1.0], &none, 1.5), Err(Error::OutsideInterval { .. })));

    let events = [Event::terminal::<Far>(Crossing::Rising)];
    let mut hybrid = Hybrid::new(Adaptive::<Growth, Radau>::new(options).unwrap(), &events).unwrap();
    hybrid.integrator().set_time(1.0).unwrap();
    let end = hybrid.solve(&vector![1.0], &none, 0.5).unwrap();
    assert_eq!((end.t, end.terminal), (1.5, false));
    close(end.nominal.x[0], 1.5);
    close(hybrid.dense(1.2).unwrap().x[0], 1.2);
    // Of several intervals the ends are given.
    let mut horizon = Piecewise::new(Adaptive::<Growth, Radau>::new(options).unwrap());
    horizon.integrator().set_time(1.0).unwrap();
    close(horizon.solve(&vector![1.0], &[none, none], &[1.2, 1.5]).unwrap().x[0], 1.5);
    close(horizon.dense(1.3).unwrap().x[0], 1.3);
}

/// A length that is lost beside the time would be no interval at all.
#[test]
fn unresolved_interval_lengths() {
    let mut adaptive = Adaptive::<Growth, Radau>::new(AdaptiveOptions::default()).unwrap();
    adaptive.set_time(1e20).unwrap();
    let error = adaptive.solve(&vector![1.0], &SVector::zeros(), 1.0).unwrap_err();
    assert!(error.to_string().contains("below the resolution of the time"), "{error}");
    adaptive.set_time(0.0).unwrap();
    assert!(matches!(
        adaptive.solve(&vector![1.0], &SVector::zeros(), f64::NAN),
        Err(Error::NonFiniteInput { argument: casados::error::Argument::H, .. })
    ));
}

/// What integrators of steps of variable size, with events and over several intervals have in
/// common.
trait Calls {
    /// One of the four modes, with a control.
    fn call(&mut self, mode: usize, u: f64) -> Result<(), Error>;
    fn dense_at(&mut self, t: f64) -> Result<casados::result::Dense<Falling>, Error>;
    fn freeze(&mut self, kept: bool) -> Result<(), Error>;
}

macro_rules! calls {
    ($type:ty, |$u:ident| ($($inputs:expr),*)) => {
        impl Calls for $type {
            fn call(&mut self, mode: usize, u: f64) -> Result<(), Error> {
                let (x0, $u, lambda) = (vector![1.0], Vector1::new(u), vector![1.0]);
                match mode {
                    0 => self.solve(&x0, $($inputs),*).map(|_| ()),
                    1 => self.forward(&x0, $($inputs),*).map(|_| ()),
                    2 => self.adjoint(&x0, $($inputs),*, &lambda).map(|_| ()),
                    _ => self.hessian(&x0, $($inputs),*, &lambda).map(|_| ()),
                }
            }
            fn dense_at(&mut self, t: f64) -> Result<casados::result::Dense<Falling>, Error> {
                self.dense(t).copied()
            }
            fn freeze(&mut self, kept: bool) -> Result<(), Error> {
                if kept { self.freeze() } else { Ok(self.thaw()) }
            }
        }
    };
}
macro_rules! of_method {
    ($method:ty) => {
        calls!(casados::adaptive::Integrator<Falling, $method, f64>, |u| (&u, 0.5));
        calls!(Hybrid<Falling, $method, f64>, |u| (&u, 0.5));
        calls!(Piecewise<Falling, $method, f64>, |u| (&[Vector1::new(0.5), u], &[0.1, 0.5]));
    };
}
of_method!(Radau);
of_method!(DormandPrince5);

/// The state falls below zero with the second of these controls, where the model has no value.
const VALID_CONTROL: f64 = 0.5;
const FAILING_CONTROL: f64 = 5.0;

/// After a call that failed, whichever it was and however late it failed, there is nothing to be
/// asked or frozen; after one that succeeds there is again, and it is that of an integrator that
/// never failed.
fn leaves_no_answers<C: Calls>(make: impl Fn() -> C) {
    let (mut object, mut calm) = (make(), make());
    for mode in 0..4 {
        for frozen in [false, true] {
            object.call(mode, VALID_CONTROL).unwrap();
            if frozen {
                object.freeze(true).unwrap();
            }
            object.dense_at(0.2).unwrap();
            let error = object.call(mode, FAILING_CONTROL).unwrap_err();
            assert_eq!(object.dense_at(0.2), Err(Error::NoResult), "after {error}");
            assert_eq!(object.freeze(true), Err(Error::NoResult), "after {error}");
            object.freeze(false).unwrap();
            assert_eq!(object.dense_at(0.2), Err(Error::NoResult), "after {error}");
            object.call(mode, VALID_CONTROL).unwrap();
            calm.call(mode, VALID_CONTROL).unwrap();
            assert_eq!(object.dense_at(0.2), calm.dense_at(0.2));
        }
    }
    // An argument that is none is a call that failed, too.
    assert!(object.call(0, f64::NAN).is_err());
    assert_eq!(object.dense_at(0.2), Err(Error::NoResult));
}

#[test]
fn results_after_failed_calls() {
    let options = AdaptiveOptions { rtol: 1e-8, atol: 1e-8, ..Default::default() };
    let events = [Event::terminal::<Floor>(Crossing::Rising)];
    macro_rules! all {
        ($method:ty) => {
            let adaptive = || Adaptive::<Falling, $method>::new(options).unwrap();
            leaves_no_answers(adaptive);
            leaves_no_answers(|| Hybrid::new(adaptive(), &events).unwrap());
            leaves_no_answers(|| Piecewise::new(adaptive()));
        };
    }
    all!(Radau);
    all!(DormandPrince5);
}

/// Falls at a given rate, and is put up when it is down.
#[ode]
fn weight(x: f64, u: f64) -> f64 {
    -u + 0.0 * x
}
#[function]
fn down(x: f64, u: f64) -> f64 {
    x + 0.0 * u
}
#[function]
fn up(x: f64, u: f64) -> f64 {
    x + 5.0 + 0.0 * u
}

/// A part between two events that has no length in one call has its steps again in the next.
#[test]
fn segments_of_no_length() {
    let events = [Event::jump::<Down, Up>(Crossing::Falling)];
    let radau = Adaptive::<Weight, Radau>::new(AdaptiveOptions::default()).unwrap();
    let mut hybrid = Hybrid::new(radau, &events).unwrap();
    hybrid.solve(&vector![1.0], &Vector1::new(2.0), 1.0).unwrap();
    hybrid.freeze().unwrap();
    // Down at 1/u, up by 5, and on to the end: 6 − u.
    for u in [2.0, 1.0, 2.0, 1.5] {
        let x = hybrid.solve(&vector![1.0], &Vector1::new(u), 1.0).unwrap().nominal.x[0];
        assert!((x - (6.0 - u)).abs() <= 1e-14, "{u}: {x}");
    }
}

/// Each option outside of its range is refused before anything runs, with its name, its value, and
/// the range.
#[test]
fn options_outside_of_their_ranges_are_refused() {
    use casados::options::Newton;
    let newton = Newton::default();
    let refused = |error: Option<Error>, name: &str, range: &str| {
        let Some(Error::InvalidOption { option, value, .. }) = error else { panic!("{name}: {error:?}") };
        let text = error.map(|error| error.to_string()).unwrap_or_default();
        assert_eq!(option, name);
        assert!(text.contains(name) && text.contains(&value.to_string()) && text.contains(range), "{text}");
    };
    let tolerance = |tolerance: f64| Options { newton: Newton { tolerance, ..newton }, ..Default::default() };
    let iterations = |max_iterations: usize, fixed_iterations: Option<usize>| Options {
        newton: Newton { max_iterations, fixed_iterations, ..newton },
        ..Default::default()
    };
    let of_newton = "between 1 and 10000 iterations";
    for (options, name, range) in [
        (Options { steps: 0, ..Default::default() }, "steps", "at least one"),
        (tolerance(10.0), "newton.tolerance", "between 0 and 0.1"),
        (tolerance(0.11), "newton.tolerance", "between 0 and 0.1"),
        (tolerance(-1e-300), "newton.tolerance", "between 0 and 0.1"),
        (tolerance(f64::NAN), "newton.tolerance", "between 0 and 0.1"),
        (tolerance(f64::INFINITY), "newton.tolerance", "between 0 and 0.1"),
        (iterations(0, None), "newton.max_iterations", of_newton),
        (iterations(usize::MAX, None), "newton.max_iterations", of_newton),
        (iterations(50, Some(0)), "newton.fixed_iterations", of_newton),
        (iterations(50, Some(usize::MAX)), "newton.fixed_iterations", of_newton),
    ] {
        refused(options.check().err(), name, range);
        refused(Irk::<Falling, Gauss<2>>::new(options).err(), name, range);
        refused(Erk::<Falling, Rk4>::new(options).err(), name, range);
        refused(Batch::<Falling, Gauss<2>>::new(options).err(), name, range);
    }
    assert!(tolerance(0.1).check().and(iterations(10_000, Some(10_000)).check()).is_ok());

    let valid = AdaptiveOptions::default();
    for (options, name, range) in [
        (AdaptiveOptions { rtol: f64::NAN, ..valid }, "rtol", "between 10 ε of the number type and 1"),
        (AdaptiveOptions { rtol: 1e-16, ..valid }, "rtol", "between 10 ε of the number type and 1"),
        (AdaptiveOptions { rtol: 10.0, ..valid }, "rtol", "between 10 ε of the number type and 1"),
        (AdaptiveOptions { atol: 0.0, ..valid }, "atol", "finite and above 0"),
        (AdaptiveOptions { atol: f64::NAN, ..valid }, "atol", "finite and above 0"),
        (AdaptiveOptions { atol: f64::INFINITY, ..valid }, "atol", "finite and above 0"),
        (AdaptiveOptions { initial_step: Some(-0.1), ..valid }, "initial_step", "finite length above 0"),
        (
            AdaptiveOptions { initial_step: Some(f64::INFINITY), ..valid },
            "initial_step",
            "finite length above 0",
        ),
        (AdaptiveOptions { max_step: 0.0, ..valid }, "max_step", "above 0"),
        (AdaptiveOptions { max_step: f64::NAN, ..valid }, "max_step", "above 0"),
        (AdaptiveOptions { min_step: -1.0, ..valid }, "min_step", "between 0 and `max_step`"),
        (AdaptiveOptions { min_step: 2.0, max_step: 1.0, ..valid }, "min_step", "between 0 and `max_step`"),
        (AdaptiveOptions { max_steps: 0, ..valid }, "max_steps", "at least one"),
    ] {
        refused(Adaptive::<Falling, Radau>::new(options).err(), name, range);
    }
    let mut adaptive = Adaptive::<Falling, Radau>::new(valid).unwrap();
    let (one, none) = (vector![1.0], vector![]);
    refused(adaptive.set_relative_tolerances(&vector![-1.0], &none).err(), "rtol", "and 1");
    refused(adaptive.set_absolute_tolerances(&vector![0.0], &none).err(), "atol", "above 0");
    refused(
        adaptive.set_sensitivity_scales(&vector![f64::NAN], &one, &vector![]).err(),
        "sensitivity_scales",
        "not below 0",
    );
}

/// One Newton matrix for all steps of an interval.
#[dae]
fn linear(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64) -> [f64; 3] {
    [xdot[0] - 1.7 * x[1], xdot[1] + 2.1 * x[0] + 0.3 * x[1] - z, z - 0.7 * u + 0.1 * x[0]]
}

/// No value where the first state is negative.
#[function]
fn logarithm(x: [f64; 2], z: f64, u: f64) -> f64 {
    x[0].ln() + 0.0 * (z + u)
}

/// Derivatives of dense output are those of the last good call to the last bit, whatever a call
/// that failed has left.
#[test]
fn dense_derivatives_after_failed_calls() {
    let (x0, u, negative) = (vector![0.3, -0.7], vector![0.9], vector![-50.0, -0.2]);
    macro_rules! check {
        ($($method:ty),*) => {$(
            let options = Options { steps: 3, ..Default::default() };
            let mut irk = Irk::<Linear, $method>::new(options).unwrap();
            let mut calm = Irk::<Linear, $method>::new(options).unwrap();
            irk.forward(&x0, &u, 0.3).unwrap();
            calm.forward(&x0, &u, 0.3).unwrap();
            for h in [0.9, 0.01, 0.5] {
                irk.with(&mut Quadrature::<Logarithm>::new()).forward(&negative, &u, h).unwrap_err();
                for t in [0.05, 0.12, 0.2, 0.3] {
                    assert_eq!(irk.dense_forward(t).unwrap(), calm.dense_forward(t).unwrap(), "{h} {t}");
                }
            }
        )*};
    }
    check!(Gauss<2>, Gauss<4>, RadauIIA<3>);
}

/// A tolerance of zero or infinity divides by that.
#[test]
fn tolerances_in_single_precision() {
    type Single = Adaptive<Growth, Radau, f32>;
    for atol in [1e-60, 1e60] {
        let options = AdaptiveOptions { rtol: 1e-4, atol, ..Default::default() };
        assert!(Adaptive::<Growth, Radau>::new(options).is_ok());
        let error = Single::new(options).map(|_| ()).unwrap_err();
        assert!(
            matches!(error, Error::InvalidOption { option: "atol", value, .. } if value == atol),
            "{error}"
        );
    }
}
