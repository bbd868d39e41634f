//! Elementary functions and constants.

use crate::{emitted_residual, same_bits, subarray, test_point};
use casados::{Dae, dae, ode};

#[dae]
fn unary(xdot: [f64; 27], x: [f64; 27]) -> [f64; 27] {
    // Arguments within the domains, whatever x is.
    let inside = |a: f64| a / 2.5;
    let positive = |a: f64| a.abs() + 0.25;
    let [mut r0, mut r1, mut r2] = [0.0, 0.0, 0.0];
    let (s, c) = x[24].sin_cos();
    r0 += s * c;
    r1 -= 1.5;
    r2 += x[26].signum();
    [
        xdot[0] - positive(x[0]).sqrt(),
        xdot[1] - x[1].cbrt(),
        xdot[2] - x[2].exp(),
        xdot[3] - x[3].exp2(),
        xdot[4] - x[4].exp_m1(),
        xdot[5] - positive(x[5]).ln(),
        xdot[6] - positive(x[6]).ln_1p(),
        xdot[7] - positive(x[7]).log2(),
        xdot[8] - positive(x[8]).log10(),
        xdot[9] - x[9].sin(),
        xdot[10] - f64::cos(x[10]),
        xdot[11] - x[11].tan(),
        xdot[12] - inside(x[12]).asin(),
        xdot[13] - inside(x[13]).acos(),
        xdot[14] - x[14].atan(),
        xdot[15] - x[15].sinh(),
        xdot[16] - x[16].cosh(),
        xdot[17] - x[17].tanh(),
        xdot[18] - x[18].asinh(),
        xdot[19] - (1.0 + positive(x[19])).acosh(),
        xdot[20] - inside(x[20]).atanh(),
        xdot[21] - x[21].abs(),
        xdot[22] - x[22].recip(),
        xdot[23] - x[23].to_radians() - x[23].to_degrees(),
        xdot[24] - r0,
        xdot[25] - r1 * -x[25],
        xdot[26] - r2 * x[26],
    ]
}

#[dae]
fn binary(xdot: [f64; 10], x: [f64; 10], p: [f64; 2]) -> [f64; 10] {
    let a = p[0].abs() + 0.5;
    [
        xdot[0] - a.powf(x[0]),
        xdot[1] - x[1].powi(3) + x[1].powi(-2) - x[1].powi(0),
        xdot[2] - x[2].atan2(p[1]),
        xdot[3] - x[3].hypot(p[1]),
        xdot[4] - x[4].max(p[1]),
        xdot[5] - f64::min(x[5], p[1]),
        xdot[6] - x[6].clamp(-1.0, 0.5),
        xdot[7] - x[7].copysign(p[1]),
        xdot[8] - a.log(3.0) * x[8],
        xdot[9] - x[9].powi(2) * f64::powf(a, 1.5),
    ]
}

#[dae]
fn constants(xdot: [f64; 3], x: [f64; 3]) -> [f64; 3] {
    use core::f64::consts::{FRAC_PI_2, PI, TAU};
    use std::f64::consts;
    [
        xdot[0] - PI * x[0] + FRAC_PI_2,
        xdot[1] - TAU * x[1] + consts::SQRT_2 - consts::E * core::f64::consts::LN_2,
        xdot[2] - (x[2] + f64::EPSILON) * f64::MIN_POSITIVE.sqrt() * f64::from(3_u8) + OUTSIDE,
    ]
}

/// A constant that the macro does not see.
const OUTSIDE: f64 = 0.1 + 0.2;

#[dae]
fn fused(xdot: [f64; 1], x: [f64; 1], u: [f64; 2]) -> [f64; 1] {
    [xdot[0] - x[0].mul_add(u[0], u[1])]
}

#[test]
fn functions_of_one_argument() {
    same_bits::<Unary>(|v| unary(subarray(v, 0), subarray(v, 27)).to_vec());
}

#[test]
fn functions_of_two_arguments() {
    same_bits::<Binary>(|v| binary(subarray(v, 0), subarray(v, 10), subarray(v, 20)).to_vec());
}

#[test]
fn named_constants() {
    same_bits::<Constants>(|v| constants(subarray(v, 0), subarray(v, 3)).to_vec());
}

/// `mul_add` rounds once, the emitted `a * b + c` twice: each rounding is at most half an ulp of a
/// number below 6, and the subtraction adds one.
#[test]
fn fused_multiplication() {
    for seed in 1..=20 {
        let v = test_point(5, seed);
        let (plain, found) =
            (fused(subarray(&v, 0), subarray(&v, 1), subarray(&v, 2))[0], emitted_residual::<Fused>(&v)[0]);
        assert!((plain - found).abs() <= 3.0 * 8.0 * f64::EPSILON / 2.0, "{plain} {found}");
    }
    assert_eq!(Fused::STRUCTURE.u, ["u[0]", "u[1]"]);
}

/// Terms that are zero whatever else is a number.
#[ode]
fn structural_zeros(x: [f64; 2]) -> [f64; 2] {
    [0.0 * x[0].ln() + x[1], 1e-300 * x[0].ln() + (x[1].ln() - x[1].ln()) + 0.0 / x[1].ln()]
}

/// They are left out, NaN or not; what has any other factor keeps its NaN.
#[test]
fn elimination_of_structural_zeros() {
    let x = [-0.3, -0.7];
    let [first, second] = structural_zeros(x);
    assert!(first.is_nan() && second.is_nan());
    // v = (ẋ, x, t)
    let found = crate::emitted_residual::<StructuralZeros>(&[0.0, 0.0, x[0], x[1], 0.0]);
    assert_eq!(found[0], 0.7);
    assert!(found[1].is_nan());
    // Of ẋ₀ and x₁, of ẋ₁ and x₀.
    assert_eq!(StructuralZeros::STRUCTURE.jacobian.rows.len(), 4);
}
