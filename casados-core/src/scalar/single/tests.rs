//! Errors of the `f32` functions for firmware, against `f64`.

use std::format;
use std::string::String;

/// Stride of the tested arguments: a prime, so that all bit patterns occur.
const ARGUMENT_STRIDE: usize = if cfg!(debug_assertions) { 9973 } else { 997 };

/// The distance of a result from the exact one in units in the last place.
fn error_in_ulps(result: f32, exact: f64) -> f64 {
    let rounded = exact as f32;
    if exact.is_nan() || rounded.is_infinite() || result.is_nan() {
        return if result == rounded || exact.is_nan() && result.is_nan() { 0.0 } else { f64::INFINITY };
    }
    let exponent = exact.abs().log2().floor().max(-126.0);
    (f64::from(result) - exact).abs() / (exponent - 23.0).exp2()
}

/// The largest error, and its argument.
fn largest(f: impl Fn(f32) -> f32, exact: impl Fn(f64) -> f64) -> (f64, f32) {
    let mut largest = (0.0, 0.0);
    for bits in (0..=u32::MAX).step_by(ARGUMENT_STRIDE) {
        let a = f32::from_bits(bits);
        let error = error_in_ulps(f(a), exact(f64::from(a)));
        if error > largest.0 {
            largest = (error, a);
        }
    }
    largest
}

#[test]
fn errors_are_below_their_bounds() {
    let mut mistakes = String::new();
    macro_rules! below {
        ($($bound:literal: $($name:ident = $f:expr),*;)*) => { $($({
            let (error, a) = largest($f, f64::$name);
            std::println!("{} {error:.3} at {a:e}", stringify!($name));
            if error.is_nan() || error > $bound {
                mistakes += &format!("{}({a:e}) is off by {error} units\n", stringify!($name));
            }
        })*)* };
    }
    below!(
        0.5: sqrt = super::sqrt;
        0.82: sin = super::sin, cos = super::cos, exp = super::exp;
        1.0: tan = super::tan, exp2 = super::exp2, asin = super::asin, cbrt = super::cbrt;
        1.0: ln = libm::logf, ln_1p = libm::log1pf, log2 = libm::log2f, log10 = libm::log10f,
            exp_m1 = libm::expm1f, acos = libm::acosf, atan = libm::atanf;
        3.0: sinh = libm::sinhf, cosh = libm::coshf, tanh = libm::tanhf, asinh = libm::asinhf, acosh = super::acosh,
            atanh = libm::atanhf;
    );
    assert!(mistakes.is_empty(), "{mistakes}");
}

#[test]
fn errors_of_functions_of_two_numbers() {
    let mut worst = [(0.0, 0.0, 0.0); 3];
    let mut state = 1_u64;
    for _ in 0..4_000_000_000 / ARGUMENT_STRIDE {
        // Random bits; then one argument close to the other.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let a = f32::from_bits((state >> 32) as u32);
        let b = if state & 1 << 20 == 0 {
            f32::from_bits((state >> 5) as u32)
        } else {
            a * ((state >> 8 & 0xFF_FFFF) as f32 / 4e6 - 2.0)
        };
        let (x, y) = (f64::from(a), f64::from(b));
        let errors = [
            error_in_ulps(super::hypot(a, b), x.hypot(y)),
            error_in_ulps(libm::atan2f(a, b), x.atan2(y)),
            error_in_ulps(libm::powf(a, b), x.powf(y)),
        ];
        for (worst, error) in worst.iter_mut().zip(errors) {
            if error > worst.0 {
                *worst = (error, a, b);
            }
        }
    }
    std::println!("{worst:?}");
    for (worst, bound) in worst.into_iter().zip([1.0, 1.5, 1.0]) {
        assert!(worst.0 <= bound, "{worst:?}");
    }
}

#[test]
fn signs_and_special_values() {
    assert!(super::sin(-0.0).is_sign_negative() && super::tan(-0.0).is_sign_negative());
    assert!(super::asin(-0.0).is_sign_negative() && super::cbrt(-0.0).is_sign_negative());
    assert_eq!(super::sin_cos(-2.5), (super::sin(-2.5), super::cos(2.5)));
    for a in [f32::INFINITY, f32::NEG_INFINITY, f32::NAN] {
        assert!(super::sin(a).is_nan() && super::cos(a).is_nan() && super::tan(a).is_nan());
    }
    assert!(super::hypot(f32::NAN, f32::INFINITY) == f32::INFINITY && super::hypot(f32::NAN, 1.0).is_nan());
    assert!(super::exp(f32::INFINITY) == f32::INFINITY && super::exp(f32::NEG_INFINITY) == 0.0);
    assert!(super::exp(0.0) == 1.0 && super::exp(f32::NAN).is_nan());
    assert!(super::asin(1.5).is_nan() && super::exp2(f32::NAN).is_nan() && super::cbrt(f32::NAN).is_nan());
}
