//! Elementary functions of registers against references of 100 bits, and at special arguments.

use super::reference::{self, ReferenceFunction};
use super::{cell, inside, on_every_register, same, specials};
use crate::scalar::lanes::functions::{self, Call, Elementary};
use crate::scalar::lanes::*;
use crate::scalar::{Lanes, Scalar, each};
use std::vec::Vec;

/// xorshift64*, Vigna 2016
struct Random(u64);
impl Random {
    fn bits(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }
    /// A number between two bounds.
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }
    /// `±10ᵏ` with `k` between two bounds
    fn magnitude(&mut self, low: f64, high: f64) -> f64 {
        let magnitude = 10.0_f64.powf(self.between(low, high));
        if self.bits() & 1 == 0 { magnitude } else { -magnitude }
    }
}

/// An elementary function: its name, its implementation for registers, its reference, its test
/// arguments, and the documented bound of its error (units in the last place).
struct Case<L> {
    name: &'static str,
    of_lanes: fn(L, L) -> L,
    of_one: fn(f64, f64) -> f64,
    reference: ReferenceFunction,
    argument: fn(&mut Random) -> (f64, f64),
    bound: f64,
}

/// An angle within the range of the reduction, often close to a multiple of π/2.
fn angle(random: &mut Random) -> (f64, f64) {
    let a = match random.bits() % 4 {
        0 => random.magnitude(-300.0, 6.2),
        1 => random.between(-10.0, 10.0),
        2 => random.between(-1.6e6, 1.6e6),
        _ => random.between(0.0, 1e6).floor() * core::f64::consts::FRAC_PI_2 * (1.0 + f64::EPSILON),
    };
    (a, 0.0)
}
fn exponent(random: &mut Random) -> (f64, f64) {
    let a = if random.bits() & 1 == 0 { random.magnitude(-20.0, 2.85) } else { random.between(-2.0, 2.0) };
    (a, 0.0)
}
fn positive(random: &mut Random) -> (f64, f64) {
    let a = match random.bits() % 3 {
        0 => random.magnitude(-307.0, 308.0),
        1 => random.between(0.5, 2.0),
        _ => 1.0 + random.magnitude(-16.0, -2.0),
    };
    (a.abs(), 0.0)
}
fn above_minus_one(random: &mut Random) -> (f64, f64) {
    let a = if random.bits() & 1 == 0 { random.magnitude(-290.0, -0.01) } else { random.between(-0.99, 3.0) };
    (if random.bits() & 3 == 0 { random.magnitude(0.0, 290.0).abs() } else { a }, 0.0)
}
fn within_one(random: &mut Random) -> (f64, f64) {
    let a = match random.bits() % 3 {
        0 => random.magnitude(-140.0, -0.01),
        1 => random.between(-1.0, 1.0),
        _ => 1.0 - random.magnitude(-15.0, -1.0).abs(),
    };
    (a, 0.0)
}
fn any(random: &mut Random) -> (f64, f64) {
    let a =
        if random.bits() & 1 == 0 { random.magnitude(-120.0, 120.0) } else { random.magnitude(-2.0, 2.0) };
    let b = if random.bits() & 1 == 0 {
        random.magnitude(-3.0, 3.0) * a
    } else {
        random.magnitude(-120.0, 120.0)
    };
    (a, b)
}
fn above_one(random: &mut Random) -> (f64, f64) {
    (1.0 + random.magnitude(-15.0, 140.0).abs(), 0.0)
}
/// Powers between 1e-290 and 1e290.
fn power(random: &mut Random) -> (f64, f64) {
    let (a, _) = positive(random);
    (a, random.between(-650.0, 650.0) / a.ln().abs().max(1e-3))
}

fn cases<L: Lanes>() -> Vec<Case<L>> {
    macro_rules! cases {
        ($($name:ident $($second:ident)?, $argument:ident, $bound:literal;)*) => {
            std::vec![$(Case {
                name: stringify!($name),
                of_lanes: |a, _b| a.$name($(cases!(_b $second))?),
                of_one: |a, _b| Scalar::$name(a $(, cases!(_b $second))?),
                reference: reference::$name,
                argument: $argument,
                bound: $bound,
            }),*]
        };
        ($b:ident and) => { $b };
    }
    // The bounds are those of the table in `functions`.
    cases! {
        sin, angle, 0.80; cos, angle, 0.80; tan, angle, 0.90;
        exp, exponent, 0.80; exp2, exponent, 0.80; exp_m1, exponent, 0.65;
        sinh, exponent, 0.90; cosh, exponent, 0.70; tanh, exponent, 0.60;
        ln, positive, 0.65; log2, positive, 0.51; log10, positive, 0.51; ln_1p, above_minus_one, 0.51;
        powf and, power, 0.70;
        asin, within_one, 0.70; acos, within_one, 0.70; atan, any, 0.70; atan2 and, any, 0.70;
        asinh, any, 0.51; acosh, above_one, 0.51; atanh, within_one, 0.51;
        cbrt, any, 0.51; hypot and, any, 0.51;
    }
}

/// `a 2ⁿ`, exactly if it is normal.
fn scaled(a: f64, n: i32) -> f64 {
    a * 2.0_f64.powi(n / 2) * 2.0_f64.powi(n - n / 2)
}

/// The error of a result in units in the last place of the exact one, for a type with `bits` bits.
fn error(result: f64, (exact, n): (reference::DoubleDouble, i32), bits: i32) -> f64 {
    let unit = 2.0_f64.powi(exact.high.abs().log2().floor() as i32 + 1 - bits);
    (scaled(result, -n) - exact.high - exact.low).abs() / unit
}

/// Errors are below the bounds for `f64`; for `f32`, which is rounded from it, below half a unit
/// plus the contribution of one unit of `f64`.
fn accuracy<L: Lanes>(bits: i32) {
    let count = if cfg!(debug_assertions) { 1000 } else { 50_000 };
    for case in cases::<L>() {
        let mut random = Random(0x9E37_79B9_7F4A_7C15);
        let mut points: Vec<(f64, f64)> = (0..count).map(|_| (case.argument)(&mut random)).collect();
        let single = bits == 24;
        if single {
            points = points.iter().map(|&(a, b)| (f64::from(a as f32), f64::from(b as f32))).collect();
        }
        let bound = if single { 0.5 + 2.0_f64.powi(24 - 53) } else { case.bound };
        let (first, second): (Vec<_>, Vec<_>) = points.into_iter().unzip();
        inside::<L>(|| {
            for start in (0..count).step_by(L::LANES) {
                let (a, b) = (cell::<L>(&first, start, 1), cell::<L>(&second, start, 1));
                let mut out = a;
                (case.of_lanes)(L::load(&a), L::load(&b)).store(&mut out);
                for lane in 0..L::LANES {
                    let (a, b, result) = (L::lane(&a, lane), L::lane(&b, lane), L::lane(&out, lane));
                    let one = (case.of_one)(a, b);
                    let limits = if single {
                        f64::from(f32::MIN_POSITIVE)..f64::from(f32::MAX)
                    } else {
                        // Beyond, the reference lacks digits.
                        1e-290..1e307
                    };
                    if ![a, one].iter().all(|a| limits.contains(&a.abs())) || b.abs() > limits.end {
                        continue;
                    }
                    let exact = (case.reference)(a, b);
                    let error = error(result, exact, bits);
                    assert!(error <= bound, "{}({a:e}, {b:e}) = {result:e}: {error} units", case.name);
                }
            }
        });
    }
}

#[test]
fn errors_are_below_the_documented_bounds() {
    macro_rules! check {
        (F32x4, $single:ident, $($lanes:literal),*) => {
            accuracy::<F32x4<4>>(24);
        };
        (F32x8, $single:ident, $($lanes:literal),*) => {
            accuracy::<F32x8<8>>(24);
        };
        (F32x16, $single:ident, $($lanes:literal),*) => {
            accuracy::<F32x16<16>>(24);
        };
        (F64x2, $single:ident, $($lanes:literal),*) => {
            accuracy::<F64x2<2>>(53);
        };
        (F64x4, $single:ident, $($lanes:literal),*) => {
            accuracy::<F64x4<4>>(53);
        };
        (F64x8, $single:ident, $($lanes:literal),*) => {
            accuracy::<F64x8<8>>(53);
        };
    }
    on_every_register!(check);
}

/// A number as a register of one, used by firmware, has the same bounds.
#[test]
fn numbers_as_registers_of_one() {
    let count = if cfg!(debug_assertions) { 4000 } else { 200_000 };
    let mut random = Random(0x2545_F491_4F6C_DD1D);
    macro_rules! check {
        ($($name:ident, $argument:ident, $bound:literal;)*) => { $(
            for _ in 0..count {
                let (a, _) = $argument(&mut random);
                let (one, result) = (Scalar::$name(a), <functions::$name as Call<f64>>::call(a));
                if a.abs() > 1e-290 && (1e-290..1e307).contains(&one.abs()) {
                    let error = error(result, reference::$name(a, 0.0), 53);
                    assert!(error <= $bound, "{}({a:e}) = {result:e}: {error} units", stringify!($name));
                }
            }
            for a in specials() {
                let (one, result): (f64, _) = (Scalar::$name(a), <functions::$name as Call<f64>>::call(a));
                let close = (result - one).abs() <= 2.0 * f64::EPSILON * one.abs() + 5e-324;
                assert!(same(result, one) || one != 0.0 && close, "{}({a:e}) = {result:e}", stringify!($name));
            }
        )* };
    }
    check! { sin, angle, 0.80; cos, angle, 0.80; tan, angle, 0.90; exp, exponent, 0.80; }
    for a in (0..count).map(|_| angle(&mut random).0).chain(specials()) {
        let (sin, cos) = functions::sin_cos::call(a);
        assert!(same(sin, functions::sin::call(a)) && same(cos, functions::cos::call(a)), "{a:e}");
    }
}

/// Zeros keep their sign, infinities and NaN are as for single numbers, and all other results are
/// finite and close to `f64`, for arguments of all magnitudes. The test of accuracy bounds the
/// errors.
fn special<L: Lanes>() {
    let values = specials();
    for case in cases::<L>() {
        // The standard library loses all digits of these functions at both ends of the range, and
        // overflows.
        let poor = matches!(case.name, "asinh" | "acosh" | "atanh");
        inside::<L>(|| {
            let seconds = if matches!(case.name, "atan2" | "hypot" | "powf") { values.len() } else { 1 };
            for i in 0..seconds {
                for j in (0..values.len()).step_by(L::LANES) {
                    let (a, b) = (cell::<L>(&values, j, 1), cell::<L>(&values, i, 0));
                    let mut out = a;
                    (case.of_lanes)(L::load(&a), L::load(&b)).store(&mut out);
                    for lane in 0..L::LANES {
                        let (a, b, result) = (L::lane(&a, lane), L::lane(&b, lane), L::lane(&out, lane));
                        let one = (case.of_one)(a, b);
                        let close = (result - one).abs() <= 2.0 * f64::EPSILON * one.abs() + 5e-324;
                        let poor = poor && a.is_finite() && result.is_finite() && a != 0.0;
                        assert!(
                            same(result, one) || one != 0.0 && close || poor,
                            "{}({a:e}, {b:e}) = {result:e}, not {one:e}",
                            case.name
                        );
                    }
                }
            }
        });
    }
}

#[test]
fn special_arguments_are_as_for_one_number() {
    macro_rules! check {
        (F64x2, $single:ident, $($lanes:literal),*) => { $( special::<F64x2<$lanes>>(); )* };
        (F64x4, $single:ident, $($lanes:literal),*) => { $( special::<F64x4<$lanes>>(); )* };
        (F64x8, $single:ident, $($lanes:literal),*) => { $( special::<F64x8<$lanes>>(); )* };
        ($single_type:ident, $single:ident, $($lanes:literal),*) => {};
    }
    on_every_register!(check);
}

/// The bits of a lane are independent of the other lanes.
fn independence<L: Lanes>() {
    let strange = [f64::NAN, f64::INFINITY, -0.0, 1e300, -3.0, 5e-324, f64::NEG_INFINITY];
    for case in cases::<L>() {
        let mut random = Random(88172645463325252);
        inside::<L>(|| {
            for round in 0..20 {
                let points: Vec<(f64, f64)> = (0..L::LANES).map(|_| (case.argument)(&mut random)).collect();
                let (first, second): (Vec<_>, Vec<_>) = points.into_iter().unzip();
                let (a, b) = (cell::<L>(&first, 0, 1), cell::<L>(&second, 0, 1));
                let (mut expected, mut out) = (a, a);
                (case.of_lanes)(L::load(&a), L::load(&b)).store(&mut expected);
                for lane in 0..L::LANES {
                    let mut disturbed = a;
                    L::set_lane(&mut disturbed, lane, strange[round % strange.len()]);
                    (case.of_lanes)(L::load(&disturbed), L::load(&b)).store(&mut out);
                    for other in (0..L::LANES).filter(|&other| other != lane) {
                        let (one, two) = (L::lane(&expected, other), L::lane(&out, other));
                        assert!(same(one, two), "{} changed in lane {other} by lane {lane}", case.name);
                    }
                }
            }
        });
    }
}

#[test]
fn lanes_do_not_disturb_each_other() {
    macro_rules! check {
        ($name:ident, $single:ident, $($lanes:literal),*) => { $( independence::<$name<$lanes>>(); )* };
    }
    on_every_register!(check);
}

#[test]
fn sin_cos_equals_sin_and_cos() {
    macro_rules! check {
        ($name:ident, $single:ident, $($lanes:literal),*) => { $( {
            let mut random = Random(362436069);
            let values: Vec<f64> = (0..100).map(|_| angle(&mut random).0).chain(specials()).collect();
            inside::<$name<$lanes>>(|| {
                for start in 0..values.len() {
                    let a = $name::<$lanes>::load(&cell::<$name<$lanes>>(&values, start, 1));
                    let (sin, cos) = a.sin_cos();
                    let pairs = [(sin.to_array(), a.sin().to_array()), (cos.to_array(), a.cos().to_array())];
                    for (one, two) in pairs {
                        assert!(one.iter().zip(&two).all(|(&a, &b)| same(a as f64, b as f64)), "{a:?}");
                    }
                }
            });
        } )* };
    }
    on_every_register!(check);
}

/// Several arguments in one call give the values of separate calls. Compiled hundreds of times:
/// therefore with loops, and independent parts outside.
fn at_once<L: Lanes, F: Elementary<K, R>, const K: usize, const R: usize, const N: usize>(_: F) {
    let values = specials();
    inside::<L>(|| {
        for i in 0..values.len() {
            let mut a = [[L::from_f64(0.0); K]; N];
            each!(n < N => {
                each!(k < K => {
                    a[n][k] = argument::<L>(&values, i, n, k);
                });
            });
            let together = L::together::<F, K, R, N>(a);
            each!(n < N => {
                let alone = F::of(a[n]);
                each!(r < R => {
                    assert_same_lanes(together[n][r], alone[r], a[n][0]);
                });
            });
        }
    });
}

/// Argument `k` of the `n`th of several calls.
#[inline(never)]
fn argument<L: Lanes>(values: &[f64], i: usize, n: usize, k: usize) -> L {
    L::load(&cell::<L>(values, i + 2 * n + (7 - n) * k, 1))
}

#[inline(never)]
fn assert_same_lanes<L: Lanes>(found: L, expected: L, argument: L) {
    let [mut of_all, mut of_each] = [cell::<L>(&[0.0], 0, 1); 2];
    found.store(&mut of_all);
    expected.store(&mut of_each);
    for lane in 0..L::LANES {
        let (found, expected) = (L::lane(&of_all, lane), L::lane(&of_each, lane));
        assert!(same(found, expected), "{found:e}, not {expected:e}, of {argument:?}");
    }
}

/// All functions in one register type; in the others, whose arguments are packed differently, one
/// function with one argument and result, and one with two of each. The register types: all lanes
/// used, doubles in wider registers, and each with an unused lane.
#[test]
fn several_arguments_in_one_call() {
    macro_rules! all {
        ($register:ty: $($function:ident)*) => {
            $( at_once::<$register, _, _, _, 2>(functions::$function); at_once::<$register, _, _, _, 4>(functions::$function); )*
        };
        ($register:ty) => { all!($register: exp atan2 sin_cos); };
    }
    macro_rules! check {
        (F64x4, $element:ident, $($n:literal),*) => {
            all!(F64x4<3>: exp exp2 exp_m1 sinh cosh tanh powf ln ln_1p log2 log10 asinh acosh atanh sin cos tan asin
                acos atan atan2 sin_cos cbrt hypot);
            all!(F64x4<2>);
            all!(F64x4<4>);
        };
        (F64x8, $element:ident, $($n:literal),*) => { all!(F64x8<7>); all!(F64x8<8>); };
        ($name:ident, $element:ident, $n:literal $(, $more:literal)+) => { check!($name, $element $(, $more)+); };
        ($name:ident, $element:ident, $n:literal) => { all!($name<$n>); };
    }
    on_every_register!(check);
}
