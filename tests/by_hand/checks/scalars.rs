//! The scalars that the checks rest on agree with each other, function by function.

use casados_core::scalar::{Scalar, Tangent};
use casados_core::testing::Bounded;
use casados_core::testing::Forward;
use num_complex::Complex64;
use num_dual::{Dual2_64, Dual64, HyperDual64};

/// Every function, over the scalar of the caller.
fn all_functions<S: Scalar>(a: S, b: S) -> Vec<(&'static str, S)> {
    let one = S::from_f64(1.0);
    let third = S::from_f64(1.0 / 3.0);
    vec![
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

/// Arguments in every quadrant and on both sides of every branch; outside of its domain a function
/// is not finite in real arithmetic, and is not compared.
fn arguments() -> impl Iterator<Item = (f64, f64)> {
    let values = [-2.5, -1.0, -0.8, -0.1, 1e-3, 0.3, 0.95, 1.7, 12.0];
    values.into_iter().flat_map(move |a| [-1.3, -0.4, 0.7, 2.2].into_iter().map(move |b| (a, b)))
}

/// Values and first derivatives by complex step, by dual numbers and by tangents, against
/// [`Forward`] within its rounding bound.
#[test]
fn first_derivatives_agree() {
    const STEP: f64 = 1e-200;
    let exact = Bounded::exact;
    let mut compared = 0;
    for (a, b) in arguments() {
        for (da, db) in [(1.0, 0.0), (0.0, 1.0), (0.6, -1.4)] {
            let reference =
                all_functions(Forward { re: exact(a), d: exact(da) }, Forward { re: exact(b), d: exact(db) });
            let complex = all_functions(Complex64::new(a, da * STEP), Complex64::new(b, db * STEP));
            let dual = all_functions(Dual64::new(a, da), Dual64::new(b, db));
            let tangent =
                all_functions(Tangent { value: a, derivative: da }, Tangent { value: b, derivative: db });
            let others = complex.into_iter().zip(dual).zip(tangent);
            for (&(name, reference), (((_, complex), (_, dual)), (_, tangent))) in
                reference.iter().zip(others)
            {
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
                near(complex.im / STEP, d);
                near(dual.eps, d);
                near(tangent.value, value);
                near(tangent.derivative, d);
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
            let reference = all_functions(nested(a, da), nested(b, db));
            let hyper = all_functions(HyperDual64::new(a, da, da, 0.0), HyperDual64::new(b, db, db, 0.0));
            let second = all_functions(Dual2_64::new(a, da, 0.0), Dual2_64::new(b, db, 0.0));
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

/// Complex functions far from the real axis: inverse functions invert, and the derivative is that
/// along the imaginary direction too (Cauchy-Riemann), which the dual over the real axis cannot
/// tell.
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
