//! Intervals that are divided: four parts of one step are four steps, in values and all
//! derivatives; and the projection of every step.

use casados::error::Argument;
use casados::prelude::*;
use casados::result::Hessian;
use casados::testing::check_sensitivities;
use casados::{Divided, Integrator, Projected};
use nalgebra::{Matrix1, vector};

/// With everything that derivatives are taken by.
#[dae]
fn swing(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2], t: f64) -> [f64; 3] {
    [
        xdot[0] - x[1],
        xdot[1] * (1.0 + 0.1 * x[0] * x[0]) + z + p[1] * x[1] - u * (1.0 + 0.1 * t),
        z * (1.0 + 0.2 * x[1] * x[1]) - p[0] * x[0].sin(),
    ]
}

#[function]
fn outputs(x: [f64; 2], z: f64, u: f64, p: [f64; 2], t: f64) -> f64 {
    x[0] * x[0] + z * x[1] * p[0] + u * u * x[0] + (x[1] * z).cos() * p[1] * (0.5 + t)
}

type Single = Irk<Swing, RadauIIA<3>>;

const H: f64 = 0.7;

/// Results of a call with an integrand, which is the second one.
fn hessian<I>(mut integrator: I) -> (Hessian<Swing>, Quadrature<Outputs>)
where
    I: Integrator<Model = Swing, Number = f64, Memory = Heap>,
{
    let mut integral = Quadrature::<Outputs>::new();
    integral.nu = Matrix1::new(0.8);
    integrator.set_parameters(&vector![9.0, 0.2]).unwrap();
    integrator.set_time(0.4).unwrap();
    let (x0, u, lambda) = (vector![0.6, -1.1], vector![0.7], vector![1.2, -0.5]);
    let adjoint = *integrator.with(&mut integral).adjoint(&x0, &u, H, &lambda).unwrap();
    let value = integral.q;
    let forward = *integrator.with(&mut integral).forward(&x0, &u, H).unwrap();
    let dq = (integral.dq_dx0, integral.dq_du, integral.dq_dp);
    let nominal = *integrator.solve(&x0, &u, H).unwrap();
    let hessian = *integrator.with(&mut integral).hessian(&x0, &u, H, &lambda).unwrap();
    // Each call has what the smaller ones have.
    assert!(
        (adjoint.grad_x0 - hessian.grad_x0).amax() < 1e-14
            && (adjoint.grad_p - hessian.grad_p).amax() < 1e-14
    );
    assert!((adjoint.grad_u - hessian.grad_u).amax() < 1e-14 && (value - integral.q).amax() < 1e-14);
    assert!(
        (forward.dx_dx0 - hessian.dx_dx0).amax() < 1e-14 && (forward.dz_dp - hessian.dz_dp).amax() < 1e-14
    );
    assert!((nominal.x - hessian.x).amax() < 1e-14 && (nominal.z0 - hessian.z0).amax() < 1e-14);
    assert!((dq.0 - integral.dq_dx0).amax() < 1e-14 && (dq.2 - integral.dq_dp).amax() < 1e-14);
    assert!((dq.1 - integral.dq_du).amax() < 1e-14);
    (hessian, integral)
}

#[test]
fn parts_as_steps() {
    let options = |steps| Options { steps, ..Default::default() };
    let (whole, of_whole) = hessian(Single::new(options(4)).unwrap());
    let (parts, of_parts) = hessian(Divided::<_, 4>::new(Single::new(options(1)).unwrap()));
    let (halves, of_halves) = hessian(Divided::<_, 2>::new(Single::new(options(2)).unwrap()));
    for (other, integral) in [(parts, of_parts), (halves, of_halves)] {
        // Magnitudes are below 20 in second derivatives, and of size one before.
        let near = |error: f64, what: &str| assert!(error < 3e-13, "{what}: {error}");
        near((other.x - whole.x).amax(), "x");
        near((other.z - whole.z).amax(), "z");
        near((other.z0 - whole.z0).amax(), "z0");
        near((other.dx_dx0 - whole.dx_dx0).amax(), "dx/dx0");
        near((other.dx_du - whole.dx_du).amax(), "dx/du");
        near((other.dx_dp - whole.dx_dp).amax(), "dx/dp");
        near((other.dz_dx0 - whole.dz_dx0).amax(), "dz/dx0");
        near((other.dz_du - whole.dz_du).amax(), "dz/du");
        near((other.dz_dp - whole.dz_dp).amax(), "dz/dp");
        near((other.dz0_dx0 - whole.dz0_dx0).amax(), "dz0/dx0");
        near((other.dz0_dp - whole.dz0_dp).amax(), "dz0/dp");
        near((other.grad_x0 - whole.grad_x0).amax(), "gradient x0");
        near((other.grad_u - whole.grad_u).amax(), "gradient u");
        near((other.grad_p - whole.grad_p).amax(), "gradient p");
        near((other.h_xx - whole.h_xx).amax(), "xx");
        near((other.h_xu - whole.h_xu).amax(), "xu");
        near((other.h_uu - whole.h_uu).amax(), "uu");
        near((other.h_xp - whole.h_xp).amax(), "xp");
        near((other.h_up - whole.h_up).amax(), "up");
        near((other.h_pp - whole.h_pp).amax(), "pp");
        near((integral.q - of_whole.q).amax(), "q");
        near((integral.dq_dx0 - of_whole.dq_dx0).amax(), "dq/dx0");
        near((integral.dq_du - of_whole.dq_du).amax(), "dq/du");
        near((integral.dq_dp - of_whole.dq_dp).amax(), "dq/dp");
    }
}

/// A bead on the wire `y = sin(a x) + 0.1 sin t` that a force pushes.
#[dae(index_reduction(projection))]
fn bead(xdot: [f64; 4], x: [f64; 4], u: f64, z: f64, p: f64, t: f64) -> [f64; 5] {
    [
        xdot[0] - x[2],
        xdot[1] - x[3],
        xdot[2] - z * p * (p * x[0]).cos() - u,
        xdot[3] + z + 9.81,
        x[1] - (p * x[0]).sin() - 0.1 * t.sin(),
    ]
}

/// Steps are coarse, so that each projection moves by percents. What a divided interval gives is
/// what as many calls give.
#[test]
fn projection_of_every_step() {
    let single = || Projected::new(Irk::<Bead, RadauIIA<1>>::new(Options::default()).unwrap());
    let mut divided = Divided::<_, 3>::new(single());
    let (x0, u, p) = (vector![0.4, (1.3f64 * 0.4).sin(), 0.8, 0.7], vector![0.6], vector![1.3]);
    divided.set_parameters(&p).unwrap();
    let end = divided.solve(&x0, &u, 0.3).unwrap().x;
    let statistics = divided.statistics();
    let mut alone = single();
    alone.set_parameters(&p).unwrap();
    let mut x = x0;
    for step in 0..3 {
        alone.set_time(0.1 * f64::from(step)).unwrap();
        x = alone.solve(&x, &u, 0.1).unwrap().x;
    }
    assert!((end - x).amax() < 1e-14, "{end} {x}");
    assert!((end[1] - (1.3 * end[0]).sin() - 0.1 * 0.3f64.sin()).abs() < 1e-15);
    assert_eq!(statistics.steps, 3);

    divided.set_time(0.3).unwrap();
    check_sensitivities(&mut divided, &x0, &u, &p, 0.3).unwrap().assert();
}

#[test]
fn errors_of_a_part() {
    let mut divided = Divided::<_, 2>::new(Single::new(Options::default()).unwrap());
    let (x0, u) = (vector![0.6, -1.1], vector![0.7]);
    assert_eq!(divided.solve(&x0, &u, H).unwrap_err(), Error::ParametersNotSet);
    divided.set_parameters(&vector![9.0, 0.2]).unwrap();
    assert!(matches!(divided.solve(&x0, &u, f64::NAN), Err(Error::NonFiniteInput { .. })));
    let lambda = vector![f64::NAN, 0.0];
    for error in
        [divided.adjoint(&x0, &u, H, &lambda).map(|_| ()), divided.hessian(&x0, &u, H, &lambda).map(|_| ())]
    {
        let Err(Error::NonFiniteInput { argument, name, .. }) = error else { panic!("{error:?}") };
        assert_eq!((argument, name), (Argument::Lambda, "x[0]"));
    }
    assert!(divided.hessian(&x0, &u, H, &vector![1.0, 0.0]).is_ok());
}

/// A force of `1e308 u`.
#[ode]
fn pushed(_x: [f64; 1], u: f64) -> [f64; 1] {
    [1e308 * u]
}

/// The derivatives of each part are numbers, and their sum is none.
#[test]
fn overflow_of_results() {
    let mut divided = Divided::<_, 4>::new(Erk::<Pushed, Rk4>::new(Options::default()).unwrap());
    let (x0, u, lambda) = (vector![1.0], vector![0.0], vector![1.0]);
    assert_eq!(divided.solve(&x0, &u, 4.0).unwrap().x, x0);
    for result in [
        divided.forward(&x0, &u, 4.0).map(|_| ()),
        divided.adjoint(&x0, &u, 4.0, &lambda).map(|_| ()),
        divided.hessian(&x0, &u, 4.0, &lambda).map(|_| ()),
    ] {
        assert!(matches!(result, Err(Error::Overflow { .. })), "{result:?}");
    }
}
