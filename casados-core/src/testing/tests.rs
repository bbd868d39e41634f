//! The checks themselves: they accept a right model, find every kind of fault in a wrong one, and the scalars that they
//! rest on agree with each other function by function.

use super::bounded::Bounded;
use super::forward::Forward;
use super::*;
use crate::error::Error;
use crate::model::{ArrayK, ArrayV, Dae, GraphDae, Operations, Pattern, Structure};
use crate::result::{Adjoint, Hessian, Nominal};
use crate::scalar::{Lanes, Scalar};
use crate::shape::{Dims, Plain};
use nalgebra::SVector;
use num_complex::Complex64;
use num_dual::{Dual2_64, Dual64, HyperDual64};
use std::string::ToString;
use std::vec::Vec;

/// `0 = ẋ − u sin x − z, 0 = z eˣ − p`, with a fault on request.
struct Example<const FAULT: u8>;

const NO_FAULT: u8 = 0;
const JACOBIAN_SIGN: u8 = 1;
const ADJOINT_LAST_DIGITS: u8 = 2;
const HESSIAN_TERM: u8 = 3;
const HESSIAN_PATTERN: u8 = 4;
const CONSTANT_FORGOTTEN: u8 = 5;
const LINEAR_DECLARED: u8 = 6;

fn residual<S: Scalar>(v: &[S], f: &mut [S]) {
    f[0] = v[0] - v[3] * v[1].sin() - v[2];
    f[1] = v[2] * v[1].exp() - v[4];
}

fn gradient<const FAULT: u8, S: Scalar>(v: &[S], mu: &[S], g: &mut [S]) {
    let (s, c) = v[1].sin_cos();
    let e = v[1].exp();
    g[0] = mu[0];
    g[1] = mu[1] * v[2] * e - mu[0] * v[3] * c;
    g[2] = mu[1] * e - mu[0];
    g[3] = -mu[0] * s;
    g[4] = -mu[1];
    g[5] = S::from_f64(0.0);
    if FAULT == ADJOINT_LAST_DIGITS {
        g[3] = g[3] * S::from_f64(1.0 + 1e-13);
    }
}

impl<const FAULT: u8> Dae for Example<FAULT> {
    type Shape = Dims<1, 1, 1, 1, 2, 6, 3>;
    type Jacobian<T: Plain> = [T; 7];
    type Hessian<T: Plain> = [T; 3];
    const STRUCTURE: Structure = Structure {
        name: "example",
        x: &["angle"],
        z: &["force"],
        u: &["torque"],
        p: &["level"],
        jacobian: Pattern { rows: &[0, 0, 1, 0, 1, 0, 1], columns: &[0, 1, 1, 2, 2, 3, 4] },
        blocks: [0, 1, 3, 5, 6, 7],
        constant: &[true, false, false, true, false, false, true],
        hessian: Pattern {
            rows: &[1, 2, 3],
            // The pattern with a fault has (2, 2) in place of (2, 1).
            columns: if FAULT == HESSIAN_PATTERN { &[1, 2, 1] } else { &[1, 1, 1] },
        },
        linear: if FAULT == LINEAR_DECLARED { &[false, true] } else { &[false, false] },
        operations: Operations { residual: 0, residual_jacobian: 0, adjoint: 0, hessian: 0 },
    };

    fn residual<S: Lanes>(v: &ArrayV<Self, S>, f: &mut ArrayK<Self, S>) {
        residual(v, f);
    }
    fn jacobian_constants<S: Lanes>(jacobian: &mut Self::Jacobian<S>) {
        jacobian[0] = S::from_f64(1.0);
        jacobian[3] = S::from_f64(-1.0);
        if FAULT != CONSTANT_FORGOTTEN {
            jacobian[6] = S::from_f64(-1.0);
        }
    }
    fn residual_jacobian<S: Lanes>(
        v: &ArrayV<Self, S>,
        f: &mut ArrayK<Self, S>,
        jacobian: &mut Self::Jacobian<S>,
    ) {
        residual(v, f);
        let (s, c) = v[1].sin_cos();
        jacobian[1] = if FAULT == JACOBIAN_SIGN { v[3] * c } else { -v[3] * c };
        jacobian[2] = v[2] * v[1].exp();
        jacobian[4] = v[1].exp();
        jacobian[5] = -s;
    }
    fn adjoint<S: Lanes>(v: &ArrayV<Self, S>, mu: &ArrayK<Self, S>, g: &mut ArrayV<Self, S>) {
        gradient::<FAULT, S>(v, mu, g);
    }
    fn hessian<S: Lanes>(v: &ArrayV<Self, S>, mu: &ArrayK<Self, S>, hessian: &mut Self::Hessian<S>) {
        let (s, c) = v[1].sin_cos();
        let e = v[1].exp();
        hessian[0] = mu[0] * v[3] * s;
        if FAULT != HESSIAN_TERM {
            hessian[0] = hessian[0] + mu[1] * v[2] * e;
        }
        hessian[1] = mu[1] * e;
        hessian[2] = -mu[0] * c;
    }
}

impl<const FAULT: u8> GraphDae for Example<FAULT> {
    fn residual_of<S: Scalar>(v: &[S], f: &mut [S]) {
        residual(v, f);
    }
    fn adjoint_of<S: Scalar>(v: &[S], mu: &[S], g: &mut [S]) {
        gradient::<FAULT, S>(v, mu, g);
    }
}

fn check<const FAULT: u8>() -> Report {
    check_derivatives::<Example<FAULT>>(&Points::random(10).all(-2.0..=2.0))
}

#[test]
fn right_model_passes() {
    check::<NO_FAULT>().assert();
    check_pattern::<Example<NO_FAULT>>(&Points::random(5)).assert();
    let report = check::<NO_FAULT>();
    // Nothing remains unsaid, and the largest difference is rounding.
    for row in &report.rows {
        assert_eq!(row.inconclusive, 0, "{report}");
        assert!(row.difference < 1e-11, "{report}");
    }
}

#[test]
fn faults_are_found_and_named() {
    let found = |report: Report, quantity: &str, entry: &str| {
        assert!(!report.passed(), "{report}");
        assert!(
            report.wrong.iter().any(|wrong| wrong.quantity == quantity && wrong.entry == entry),
            "{report}"
        );
        assert!(report.to_string().contains(entry));
    };
    found(check::<JACOBIAN_SIGN>(), "Jacobian", "of equation 0 by angle");
    found(check::<ADJOINT_LAST_DIGITS>(), "adjoint", "by torque");
    found(check::<HESSIAN_TERM>(), "Hessian", "by angle and angle");
    found(check::<HESSIAN_PATTERN>(), "Hessian", "by force and angle");
    found(check::<CONSTANT_FORGOTTEN>(), "Jacobian", "of equation 1 by level");
    found(check::<LINEAR_DECLARED>(), "Hessian, linear rows", "of equation 1 by angle and angle");
    let pattern = check_pattern::<Example<HESSIAN_PATTERN>>(&Points::random(5));
    found(pattern, "Hessian outside", "by force and angle");
}

#[test]
fn points_outside_of_the_domain_do_not_pass() {
    let report = check_derivatives::<Example<NO_FAULT>>(&Points::random(3).all(1e4..=1e5));
    assert!(!report.passed(), "{report}");
}

/// Every function, over the scalar of the caller.
fn functions<S: Scalar>(a: S, b: S) -> Vec<(&'static str, S)> {
    let one = S::from_f64(1.0);
    let third = S::from_f64(1.0 / 3.0);
    std::vec![
        ("add", a + b),
        ("sub", a - b),
        ("mul", a * b),
        ("div", a / b),
        ("neg", -a),
        ("sqrt", a.sqrt()),
        ("cbrt", a.cbrt()),
        ("exp", a.exp()),
        ("exp2", a.exp2()),
        ("exp_m1", a.exp_m1()),
        ("ln", a.ln()),
        ("ln_1p", a.ln_1p()),
        ("log2", a.log2()),
        ("log10", a.log10()),
        ("sin", a.sin()),
        ("cos", a.cos()),
        ("sin_cos", a.sin_cos().0 * a.sin_cos().1),
        ("tan", a.tan()),
        ("asin", a.asin()),
        ("acos", a.acos()),
        ("atan", a.atan()),
        ("atan2", a.atan2(b)),
        ("sinh", a.sinh()),
        ("cosh", a.cosh()),
        ("tanh", a.tanh()),
        ("asinh", a.asinh()),
        ("acosh", a.acosh()),
        ("atanh", a.atanh()),
        ("hypot", a.hypot(b)),
        ("powi 3", a.powi(3)),
        ("powi -2", a.powi(-2)),
        ("powi 0", a.powi(0)),
        ("powf", a.powf(b)),
        ("powf 1/3", a.powf(third)),
        ("powf 3", a.powf(S::from_f64(3.0))),
        ("abs", a.abs()),
        ("signum", a.signum()),
        ("select", S::select(S::lt(a, b), a * a, b)),
        ("masks", S::select(S::or(S::not(S::le(a, one)), S::and(S::eq(a, b), S::lt(a, b))), a, b * a)),
    ]
}

/// Arguments in every quadrant and on both sides of every branch; outside of its domain a function is not finite in
/// real arithmetic, and is not compared.
fn arguments() -> impl Iterator<Item = (f64, f64)> {
    let values = [-2.5, -1.0, -0.8, -0.1, 1e-3, 0.3, 0.95, 1.7, 12.0];
    values.into_iter().flat_map(move |a| [-1.3, -0.4, 0.7, 2.2].into_iter().map(move |b| (a, b)))
}

/// Values and first derivatives by complex step and by dual numbers, against [`Forward`] within its rounding bound.
#[test]
fn first_derivatives_agree() {
    const H: f64 = 1e-200;
    let exact = Bounded::exact;
    let mut compared = 0;
    for (a, b) in arguments() {
        for (da, db) in [(1.0, 0.0), (0.0, 1.0), (0.6, -1.4)] {
            let reference =
                functions(Forward { re: exact(a), d: exact(da) }, Forward { re: exact(b), d: exact(db) });
            let complex = functions(Complex64::new(a, da * H), Complex64::new(b, db * H));
            let dual = functions(Dual64::new(a, da), Dual64::new(b, db));
            for ((&(name, reference), (_, complex)), (_, dual)) in reference.iter().zip(complex).zip(dual) {
                let (value, d) = (reference.re, reference.d);
                if !value.value.is_finite() || !d.error.is_finite() {
                    continue;
                }
                compared += 1;
                // At most four times the operations, on both sides.
                let near = |found: f64, expected: Bounded| {
                    let tolerance = 5.0 * expected.error + f64::EPSILON * expected.value.abs();
                    assert!(
                        (found - expected.value).abs() <= tolerance,
                        "{name}({a}, {b}) along ({da}, {db}): {found:e}, expected {expected:?}"
                    );
                };
                near(complex.re, value);
                near(dual.re, value);
                near(complex.im / H, d);
                near(dual.eps, d);
            }
        }
    }
    assert!(compared > 2500, "{compared}");
}

/// Second derivatives by hyper-duals and second-order duals against two nested [`Forward`].
#[test]
fn second_derivatives_agree() {
    let exact = Bounded::exact;
    let mut compared = 0;
    for (a, b) in arguments() {
        for (da, db) in [(1.0, 0.0), (0.0, 1.0), (0.6, -1.4)] {
            let nested = |value: f64, d: f64| Forward {
                re: Forward { re: exact(value), d: exact(d) },
                d: Forward { re: exact(d), d: exact(0.0) },
            };
            let reference = functions(nested(a, da), nested(b, db));
            let hyper = functions(HyperDual64::new(a, da, da, 0.0), HyperDual64::new(b, db, db, 0.0));
            let second = functions(Dual2_64::new(a, da, 0.0), Dual2_64::new(b, db, 0.0));
            for ((&(name, reference), (_, hyper)), (_, second)) in reference.iter().zip(hyper).zip(second) {
                let dd = reference.d.d;
                if !dd.error.is_finite() || !reference.re.re.value.is_finite() {
                    continue;
                }
                compared += 1;
                let tolerance = 5.0 * dd.error + f64::EPSILON * dd.value.abs();
                for found in [hyper.eps1eps2, second.v2] {
                    assert!(
                        (found - dd.value).abs() <= tolerance,
                        "{name}({a}, {b}) along ({da}, {db}): {found:e}, expected {dd:?}"
                    );
                }
            }
        }
    }
    assert!(compared > 2500, "{compared}");
}

/// Complex functions far from the real axis: inverse functions invert, and the derivative is that along the imaginary
/// direction too (Cauchy-Riemann), which the dual over the real axis cannot tell.
#[test]
fn complex_functions_are_analytic() {
    for (a, b) in [(0.3, 0.4), (0.7, -1.1), (1.5, 0.2), (0.2, 1.3)] {
        let z = Complex64::new(a, b);
        let near = |name: &str, x: Complex64, y: Complex64| {
            let distance = f64::hypot(x.re - y.re, x.im - y.im);
            // A few roundings in each of two functions of moderate condition.
            assert!(distance <= 32.0 * f64::EPSILON * f64::hypot(y.re, y.im).max(1.0), "{name} {x} {y}");
        };
        near("sqrt", Scalar::powi(Scalar::sqrt(z), 2), z);
        near("cbrt", Scalar::powi(Scalar::cbrt(z), 3), z);
        near("ln", Scalar::exp(Scalar::ln(z)), z);
        near("ln_1p", Scalar::exp_m1(Scalar::ln_1p(z)), z);
        near("log2", Scalar::exp2(Scalar::log2(z)), z);
        near("log10", Scalar::powf(Complex64::new(10.0, 0.0), Scalar::log10(z)), z);
        near("asin", Scalar::sin(Scalar::asin(z)), z);
        near("acos", Scalar::cos(Scalar::acos(z)), z);
        near("atan", Scalar::tan(Scalar::atan(z)), z);
        near("asinh", Scalar::sinh(Scalar::asinh(z)), z);
        near("acosh", Scalar::cosh(Scalar::acosh(z)), z);
        near("atanh", Scalar::tanh(Scalar::atanh(z)), z);
        near("powf", Scalar::powf(z, Complex64::new(0.5, 0.0)), Scalar::sqrt(z));
        near("atan2", Scalar::tan(Scalar::atan2(z, Complex64::new(0.9, 0.1))), z / Complex64::new(0.9, 0.1));
    }
}

/// An integrator whose answers are those of `x = x₀ e^{uh} + p x₀²`, `z = p x₀`, `z₀ = u x₀`, with a fault on request.
struct Closed<const FAULT: u8> {
    p: f64,
    calls: f64,
    result: Hessian<Example<NO_FAULT>>,
    adjoint: Adjoint<Example<NO_FAULT>>,
}

const GRADIENT: u8 = 1;
const SECOND: u8 = 3;
const FORWARD: u8 = 4;
const REPEATED: u8 = 5;

impl<const FAULT: u8> Closed<FAULT> {
    fn new() -> Self {
        Self {
            p: f64::NAN,
            calls: 0.0,
            result: bytemuck::Zeroable::zeroed(),
            adjoint: bytemuck::Zeroable::zeroed(),
        }
    }

    fn evaluate(&mut self, x0: f64, u: f64, h: f64, lambda: f64) {
        let (p, e) = (self.p, f64::exp(u * h));
        let r = &mut self.result;
        let f = &mut r.first.forward;
        (f.nominal.x[0], f.nominal.z[0], f.nominal.z0[0]) = (x0 * e + p * x0 * x0, p * x0, u * x0);
        (f.dx_dx0[0], f.dx_du[0], f.dx_dp[0]) = (e + 2.0 * p * x0, h * x0 * e, x0 * x0);
        (f.dz_dx0[0], f.dz_du[0], f.dz_dp[0]) = (p, 0.0, x0);
        (f.dz0_dx0[0], f.dz0_du[0], f.dz0_dp[0]) = (u, x0, 0.0);
        (r.h_xx[0], r.h_xu[0], r.h_xp[0]) = (lambda * 2.0 * p, lambda * h * e, lambda * 2.0 * x0);
        (r.h_uu[0], r.h_up[0], r.h_pp[0]) = (lambda * h * h * x0 * e, 0.0, 0.0);
        let f = &mut r.first.forward;
        match FAULT {
            FORWARD => f.dz0_du[0] *= 1.0 + 1e-12,
            SECOND => r.h_xu[0] *= 1.0 + 1e-8,
            REPEATED => {
                self.calls += 1.0;
                f.nominal.x[0] *= 1.0 + f64::EPSILON * self.calls;
            }
            _ => {}
        }
        let (x, u, p) = (f.dx_dx0[0], f.dx_du[0], f.dx_dp[0]);
        (r.first.grad_x0[0], r.first.grad_u[0], r.first.grad_p[0]) = (lambda * x, lambda * u, lambda * p);
        if FAULT == GRADIENT {
            r.first.grad_u[0] *= 1.0 + 1e-12;
        }
    }
}

impl<const FAULT: u8> Integrator<Example<NO_FAULT>> for Closed<FAULT> {
    fn set_parameters(&mut self, p: &SVector<f64, 1>) -> Result<(), Error> {
        self.p = p[0];
        Ok(())
    }
    fn reset(&mut self) {}
    fn solve(
        &mut self,
        x0: &SVector<f64, 1>,
        u: &SVector<f64, 1>,
        h: f64,
    ) -> Result<&Nominal<Example<NO_FAULT>>, Error> {
        self.evaluate(x0[0], u[0], h, 1.0);
        Ok(&self.result)
    }
    fn forward(
        &mut self,
        x0: &SVector<f64, 1>,
        u: &SVector<f64, 1>,
        h: f64,
    ) -> Result<&crate::result::Forward<Example<NO_FAULT>>, Error> {
        self.evaluate(x0[0], u[0], h, 1.0);
        Ok(&self.result)
    }
    fn adjoint(
        &mut self,
        x0: &SVector<f64, 1>,
        u: &SVector<f64, 1>,
        h: f64,
        lambda: &SVector<f64, 1>,
    ) -> Result<&Adjoint<Example<NO_FAULT>>, Error> {
        self.evaluate(x0[0], u[0], h, lambda[0]);
        let first = self.result.first;
        self.adjoint = Adjoint {
            nominal: first.forward.nominal,
            grad_x0: first.grad_x0,
            grad_u: first.grad_u,
            grad_p: first.grad_p,
        };
        Ok(&self.adjoint)
    }
    fn hessian(
        &mut self,
        x0: &SVector<f64, 1>,
        u: &SVector<f64, 1>,
        h: f64,
        lambda: &SVector<f64, 1>,
    ) -> Result<&Hessian<Example<NO_FAULT>>, Error> {
        self.evaluate(x0[0], u[0], h, lambda[0]);
        Ok(&self.result)
    }
}

fn sensitivities<const FAULT: u8>() -> Report {
    let v = SVector::<f64, 1>::new;
    check_sensitivities::<Example<NO_FAULT>, _>(&mut Closed::<FAULT>::new(), &v(0.7), &v(-1.2), &v(0.4), 0.3)
        .expect("a closed form does not fail")
}

#[test]
fn right_sensitivities_pass_and_wrong_ones_are_named() {
    let report = sensitivities::<NO_FAULT>();
    report.assert();
    for row in &report.rows {
        assert!(row.difference <= 1e-10, "{report}");
    }
    let found = |report: Report, quantity: &str, entry: &str| {
        assert!(
            report.wrong.iter().any(|wrong| wrong.quantity == quantity && wrong.entry == entry),
            "{report}"
        );
    };
    found(sensitivities::<GRADIENT>(), "adjoint", "by torque");
    found(sensitivities::<SECOND>(), "Hessian", "by angle at the start and torque");
    found(sensitivities::<FORWARD>(), "forward", "force at the start by torque");
    found(sensitivities::<REPEATED>(), "solve", "element 0");
}

#[test]
fn exact_solution() {
    let v = SVector::<f64, 1>::new;
    let (x0, u, p, h) = (0.7, -1.2, 0.4, 0.3);
    let e = f64::exp(u * h);
    let mut exact = Exact {
        states: std::vec![x0 * e + p * x0 * x0, p * x0],
        first: std::vec![std::vec![e + 2.0 * p * x0, h * x0 * e, x0 * x0], std::vec![p, 0.0, x0]],
        second: std::vec![std::vec![
            std::vec![2.0 * p, h * e, 2.0 * x0],
            std::vec![h * e, h * h * x0 * e, 0.0],
            std::vec![2.0 * x0, 0.0, 0.0],
        ]],
    };
    let run = |exact: &Exact| {
        let (mut coarse, mut fine) = (Closed::<NO_FAULT>::new(), Closed::<NO_FAULT>::new());
        check_exact::<Example<NO_FAULT>, _>(&mut coarse, &mut fine, &v(x0), &v(u), &v(p), h, exact)
            .expect("a closed form does not fail")
    };
    run(&exact).assert();
    exact.second[0][1][1] *= 1.0 + 1e-13;
    assert!(!run(&exact).passed());
}

#[test]
fn convergence_order() {
    // The explicit Euler method on ẋ = −x: an order that is asked for and one that is not there.
    let euler = |steps: usize| {
        let h = 1.0 / steps as f64;
        Ok::<_, Error>(std::vec![(0..steps).fold(1.0, |x, _| x - h * x)])
    };
    let report = convergence(&[16, 32, 64, 128, 256], &[f64::exp(-1.0)], 1e-15, euler);
    report.assert_order(1.0);
    assert!(std::panic::catch_unwind(|| report.assert_order(2.0)).is_err());
    // Rounding says nothing about an order, and a failure is no result.
    assert_eq!(convergence(&[1, 2], &[1.0], 1e-15, |_| Ok::<_, Error>(std::vec![1.0])).order(), None);
    let failed = convergence(&[1, 2], &[1.0], 1e-15, |_| Err(Error::NoResult));
    assert!(std::panic::catch_unwind(|| failed.assert_error(1.0)).is_err());
}
