//! Elementary functions of `f32` without the standard library: the functions that `libm` computes
//! in `f64`, which processors with a single-precision FPU emulate, and `exp`, whose run time in
//! `libm` depends on the argument. No operation has double precision. The other functions of `libm`
//! are in single precision.
//!
//! Bounds of the error in units in the last place of the exact result, for these functions and
//! those of `libm`; tests compare with `f64` over all arguments, one in ten thousand, or one in a
//! thousand with optimisation.
//!
//! | function | bound |
//! | --- | --- |
//! | `sqrt` | 0.5 |
//! | `sin`, `cos`, `sin_cos`, `exp` | 0.82 |
//! | `tan`, `exp2`, `asin`, `cbrt`, `hypot` | 1 |
//! | `ln`, `ln_1p`, `log2`, `log10`, `exp_m1`, `acos`, `atan`, `powf` | 1 |
//! | `atan2` | 1.5 |
//! | `sinh`, `cosh`, `tanh`, `asinh`, `acosh`, `atanh` | 3 |

mod circular;
#[cfg(test)]
mod tests;

pub use circular::{asin, cos, sin, sin_cos, tan};

/// `√a`, by the instruction of processors with an FPU.
#[inline(always)]
pub fn sqrt(a: f32) -> f32 {
    #[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
    return instruction::sqrt(a);
    #[cfg(not(all(target_arch = "arm", target_abi = "eabihf")))]
    libm::sqrtf(a)
}

/// `core` lacks square roots, the compiler does not recognise `libm`'s, and inline assembly has no
/// register class for a single-precision FPU.
#[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
#[allow(unsafe_code)]
mod instruction {
    #[inline(always)]
    pub fn sqrt(a: f32) -> f32 {
        let mut bits = a.to_bits();
        // SAFETY: it changes the two given registers, and restores `s0`; every target with this
        // binary interface has the instruction.
        unsafe {
            core::arch::asm!(
                "vmov {kept}, s0",
                "vmov s0, {bits}",
                "vsqrt.f32 s0, s0",
                "vmov {bits}, s0",
                "vmov s0, {kept}",
                kept = out(reg) _,
                bits = inout(reg) bits,
                options(pure, nomem, nostack),
            );
        }
        f32::from_bits(bits)
    }
}

/// `a 2ⁿ`, rounded once, for `a` near 1 and `|n| ≤ 250`.
#[inline(always)]
fn scale_by_power_of_two(a: f32, n: i32) -> f32 {
    let half = n / 2;
    let power = |n: i32| f32::from_bits(((n + 127) as u32) << 23);
    a * power(half) * power(n - half)
}

/// `2ᵃ = 2ⁿ 2ʳ`, `|r| ≤ ½`, with the polynomial of S. Moshier's Cephes for `(2ʳ − 1)/r`, its
/// largest term as a sum.
pub fn exp2(a: f32) -> f32 {
    const EXP2_POLYNOMIAL: [f32; 5] =
        [1.535_336_2e-4, 1.339_887_4e-3, 9.618_437e-3, 5.550_332_5e-2, 2.402_264_8e-1];
    // ln 2 minus its `f32`.
    const LN_2_LOW: f32 = -1.904_654_3e-9;
    // Comparisons with NaN are false: NaN is returned.
    let a = if a > 130.0 { 130.0 } else { a };
    let a = if a < -152.0 { -152.0 } else { a };
    let n = (a + ROUNDING_SHIFT) - ROUNDING_SHIFT;
    let r = a - n;
    let (linear, rest) = exact_product(r, core::f32::consts::LN_2);
    let (one, low) = exact_ordered_sum(1.0, linear);
    scale_by_power_of_two(
        one + (low + (rest + r * LN_2_LOW + r * r * polynomial(r, EXP2_POLYNOMIAL))),
        n as i32,
    )
}

/// `eᵃ = 2ⁿ eʳ`, `|r| ≤ ln 2 / 2`, with the polynomial of S. Moshier's Cephes for
/// `(eʳ − 1 − r)/r²`, its largest terms as a sum.
pub fn exp(a: f32) -> f32 {
    const EXP_POLYNOMIAL: [f32; 6] =
        [1.987_569_2e-4, 1.398_199_9e-3, 8.333_452e-3, 4.166_579_6e-2, 1.666_666_5e-1, 0.5];
    /// ln 2 as 355/512, whose products with `n` are exact, and the excess of that.
    const LN_2: [f32; 2] = [f32::from_bits(0x3F31_8000), 2.121_944_4e-4];
    // Comparisons with NaN are false: NaN is returned.
    let a = if a > 90.0 { 90.0 } else { a };
    let a = if a < -105.0 { -105.0 } else { a };
    let n = (a * core::f32::consts::LOG2_E + ROUNDING_SHIFT) - ROUNDING_SHIFT;
    let (r, rest) = exact_sum(a - n * LN_2[0], n * LN_2[1]);
    let (one, low) = exact_ordered_sum(1.0, r);
    scale_by_power_of_two(one + (low + (rest + r * r * polynomial(r, EXP_POLYNOMIAL))), n as i32)
}

/// `∛a`: an initial guess from the exponent, as in FreeBSD's `s_cbrtf.c`, and three steps of
/// Halley's method, the last one with the error of the cube.
pub fn cbrt(a: f32) -> f32 {
    let magnitude = a.abs();
    if !(magnitude > 0.0 && magnitude <= f32::MAX) {
        return a + a;
    }
    let (up, back) =
        power_of_two_scaling(magnitude, [1e-30, 1e30], [TWO_TO_8 * TWO_TO_8 * TWO_TO_8, TWO_TO_8]);
    let scaled = magnitude * up;
    let mut root = f32::from_bits(scaled.to_bits() / 3 + 709_958_130);
    for _ in 0..2 {
        let cube = root * root * root;
        root *= (scaled + scaled + cube) / (scaled + cube + cube);
    }
    let (square, low) = exact_product(root, root);
    let (cube, rest) = exact_product(square, root);
    root -= ((cube - scaled) + (rest + low * root)) / (3.0 * square);
    (root * back).copysign(a)
}

/// `√(a² + b²)`, scaled by the larger one so that squares neither overflow nor underflow.
pub fn hypot(a: f32, b: f32) -> f32 {
    let (a, b) = (a.abs(), b.abs());
    if a == f32::INFINITY || b == f32::INFINITY {
        return f32::INFINITY;
    }
    let (long, short) = if a < b { (b, a) } else { (a, b) };
    let (up, down) = power_of_two_scaling(long, [1e-8, 1e18], [TWO_TO_90, TWO_TO_90]);
    let (long, short) = (long * up, short * up);
    let ((long_square, low), (short_square, lower)) =
        (exact_product(long, long), exact_product(short, short));
    let (sum, rest) = exact_ordered_sum(long_square, short_square);
    let rest = rest + (low + lower);
    let root = sqrt(sum);
    let (back, error) = exact_product(root, root);
    let rest = ((sum - back) - error) + rest;
    if root == 0.0 { long + short } else { (root + rest / (root + root)) * down }
}

const TWO_TO_8: f32 = 256.0;
const TWO_TO_90: f32 = (1_u128 << 90) as f32;

/// Powers of two that scale a number into bounds, and its result back.
#[inline(always)]
fn power_of_two_scaling(a: f32, [low, high]: [f32; 2], [up, down]: [f32; 2]) -> (f32, f32) {
    if a < low {
        (up, 1.0 / down)
    } else if a > high {
        (1.0 / up, down)
    } else {
        (1.0, 1.0)
    }
}

/// `arcosh a`; that of `libm` is not NaN for some arguments below one.
pub fn acosh(a: f32) -> f32 {
    if a < 1.0 { f32::NAN } else { libm::acoshf(a) }
}

/// `1.5 · 2²³`: adding and subtracting it rounds to an integer; adding it alone leaves the integer
/// in the last bits.
const ROUNDING_SHIFT: f32 = 12_582_912.0;

/// `a + b` and its rounding error, for `|a| ≥ |b|`.
#[inline(always)]
fn exact_ordered_sum(a: f32, b: f32) -> (f32, f32) {
    let [high, low] = super::fast_two_sum(a, b);
    (high, low)
}

/// `a + b` and its rounding error.
#[inline(always)]
fn exact_sum(a: f32, b: f32) -> (f32, f32) {
    let [high, low] = super::two_sum(a, b);
    (high, low)
}

/// `a b` and its rounding error (Dekker), without overflow or underflow.
#[inline(always)]
fn exact_product(a: f32, b: f32) -> (f32, f32) {
    let halves = |a: f32| {
        let scaled = a * 4097.0;
        let upper = scaled - (scaled - a);
        (upper, a - upper)
    };
    let (high, (a1, a2), (b1, b2)) = (a * b, halves(a), halves(b));
    (high, a2 * b2 - (((high - a1 * b1) - a2 * b1) - a1 * b2))
}

/// A polynomial; the coefficient of the highest power is the first.
#[inline(always)]
fn polynomial<const K: usize>(x: f32, coefficients: [f32; K]) -> f32 {
    coefficients.into_iter().fold(0.0, |sum, c| sum * x + c)
}
