//! Events of algebraic states, against closed forms.

use super::{assert_close, differentiate, options};
use casados::prelude::*;
use nalgebra::{Vector1, vector};

/// A capacitor that is discharged, and the voltage of a divider: `ẋ = −p x + u`, `z + z³ = p x +
/// u`.
#[dae]
fn relay(xdot: f64, x: f64, z: f64, u: f64, p: f64) -> [f64; 2] {
    [xdot + p * x - u, z + z * z * z - p * x - u]
}

/// The relay falls off at a voltage of a half.
#[function]
fn voltage(_x: f64, z: f64, _u: f64, _p: f64) -> f64 {
    z - 0.5
}

#[function]
fn recharge(x: f64, _z: f64, u: f64, p: f64) -> f64 {
    x + 1.0 + p * u
}

const X0: f64 = 1.6;
const U: f64 = 0.05;
const P: f64 = 0.9;

/// `z = 0.5` is where `p x + u = 0.625`: at `t = ln((x₀ − u/p)/(x* − u/p))/p`.
#[test]
fn event_at_an_algebraic_state() {
    let formula = |[x, u, p]: [nalgebra::Complex<f64>; 3]| {
        let at = (-u + 0.625) / p;
        let time = ((x - u / p) / (at - u / p)).ln() / p;
        let after = at + p * u + 1.0;
        [u / p + (after - u / p) * (-p * (-time + 2.0)).exp(), time]
    };
    let (value, derivative) = differentiate([X0, U, P], formula);
    let event = Event::jump::<Voltage, Recharge>(Crossing::Falling);
    let (x0, u, p) = (Vector1::new(X0), Vector1::new(U), Vector1::new(P));
    macro_rules! check {
        ($method:ty) => {{
            let adaptive = Adaptive::<Relay, $method>::new(options(1e-11)).unwrap();
            let mut hybrid = Hybrid::new(adaptive, &[event]).unwrap();
            hybrid.integrator().set_parameters(&p).unwrap();
            let forward = hybrid.forward(&x0, &u, 2.0).unwrap();
            assert_eq!(forward.solution.occurrences.len(), 1);
            assert_close([forward.solution.nominal.x[0], forward.solution.occurrences[0].t], value, 1e-9);
            assert_close([forward.dx_dx0[0], forward.dx_du[0], forward.dx_dp[0]], derivative[0], 1e-8);
            let time = forward.times[0];
            assert_close([time.x0[0], time.u[0], time.p[0]], derivative[1], 1e-8);
            let adjoint = hybrid.adjoint(&x0, &u, 2.0, &vector![1.0]).unwrap();
            assert_close([adjoint.grad_x0[0], adjoint.grad_u[0], adjoint.grad_p[0]], derivative[0], 1e-8);
            let error = hybrid.hessian(&x0, &u, 2.0, &vector![1.0]).map(|_| ()).unwrap_err();
            assert!(matches!(error, Error::GuardOfAlgebraicStates { function: "Voltage" }), "{error}");
        }};
    }
    check!(Radau);
    check!(Gauss<3>);
}

/// The same with a source that rises: `z = x + t`.
#[dae]
fn rising(xdot: f64, x: f64, z: f64, t: f64) -> [f64; 2] {
    [xdot + x, z - x - t * t]
}

#[function]
fn two_volts(_x: f64, z: f64) -> f64 {
    z - 2.0
}

/// `e⁻ᵗ + t² = 2` is solved; its derivatives are not known, since nobody differentiates the model
/// by the time.
#[test]
fn event_functions_of_time() {
    let event = Event::terminal::<TwoVolts>(Crossing::Rising);
    let mut hybrid = Hybrid::new(Adaptive::<Rising, Radau>::new(options(1e-10)).unwrap(), &[event]).unwrap();
    let solution = hybrid.solve(&Vector1::new(1.0), &vector![], 3.0).unwrap();
    assert!(solution.terminal);
    assert_close([(-solution.t).exp() + solution.t * solution.t], [2.0], 1e-9);
    assert_close(solution.nominal.z, [2.0], 1e-11);
    let error = hybrid.forward(&Vector1::new(1.0), &vector![], 3.0).map(|_| ()).unwrap_err();
    assert!(matches!(error, Error::DependsOnTime { .. }), "{error}");
}
