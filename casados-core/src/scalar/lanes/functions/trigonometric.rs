//! Sine, cosine, tangent and their inverses.
//!
//! `a = n π/2 + r` with `|r| ≤ π/4` by constants of 152 bits (Cody and Waite); larger arguments go through the
//! function of one number. Minimax polynomials, whose leading terms are added as pairs.

use super::exponential::{ROUND, clamp, copy_sign};
use super::pair::{Pair, c, ordered_sum, pattern, polynomial, product, sum};
use super::{Double, repair, repair2};
use crate::scalar::Scalar;
use core::f64::consts::{FRAC_2_PI, FRAC_PI_4, PI};

/// `(sin r − r)/r³` in `r²`; `sin r` to 4.8e-19
const SIN: [f64; 7] = [
    -0.1666666666666666574148081,
    8.333333333332911679880439e-3,
    -1.984126984072041638071382e-4,
    2.755731891656436873336159e-6,
    -2.505202441962207352463594e-8,
    1.604792091803842327847253e-10,
    -7.057422362727012189356724e-13,
];

/// `(cos r − 1 + r²/2)/r⁴` in `r²`; `cos r` to 6.4e-19
const COS: [f64; 6] = [
    4.1666666666666664353702032030923874e-2,
    -1.3888888888887061454080473765770876e-3,
    2.4801587298460743715279933074846497e-5,
    -2.7557317158684733573087216260137110e-7,
    2.0876127932306893445465958445873779e-9,
    -1.1381550818533403863861112682599268e-11,
];

/// π/2 in pieces of 33 bits, and the next 53.
const PI_2: [f64; 4] = [
    1.570796326734125614166259765625,
    6.077100506303965976595549136618501506745815277099609375e-11,
    2.022266248711166455795995623655170701782335385132682858966290950775146484375e-21,
    8.47842766036889956997365378670966664501768677731005e-32,
];
/// π/2 in pieces of 53 bits.
const PI_2_WHOLE: [f64; 3] = [
    core::f64::consts::FRAC_PI_2,
    6.1232339957367660358688201472919830e-17,
    -1.4973849048591698329435081771059920e-33,
];

/// Integers up to `2²⁰` times a piece of 33 bits are exact.
const LIMIT: f64 = 1_647_000.0;

/// `(n + 1.5 · 2⁵², r)`
#[inline(always)]
fn reduce<D: Double>(a: D) -> (D, Pair<D>) {
    let shifted = a * c(FRAC_2_PI) + c(ROUND);
    let n = shifted - c(ROUND);
    if D::FUSED {
        // The first product is rounded only after the cancellation, which is exact.
        let first = a.subtract_product(n, c(PI_2_WHOLE[0]));
        let second = product(n, c(PI_2_WHOLE[1]));
        let r = sum(first, -second.high);
        let low = (r.low - second.low).subtract_product(n, c(PI_2_WHOLE[2]));
        return (shifted, ordered_sum(r.high, low));
    }
    let first = a - n * c(PI_2[0]);
    let second = sum(first, -(n * c(PI_2[1])));
    let third = sum(second.high, -(n * c(PI_2[2])));
    let low = (third.low + second.low) - n * c(PI_2[3]);
    (shifted, ordered_sum(third.high, low))
}

/// `(sin r, cos r)`, `|r| ≤ π/4`
#[inline(always)]
fn near_zero<D: Double>(r: Pair<D>) -> (Pair<D>, Pair<D>) {
    let exact = product(r.high, r.high);
    let (square, half) = (exact.high, exact.high * c(0.5));
    let low = r.low.subtract_product(r.low, half);
    let sin = Pair { high: r.high, low: (r.high * square).mul_add(polynomial(square, SIN), low) };
    let one = ordered_sum(c(1.0), -half);
    let lost = exact.low.mul_add(c(0.5), r.high * r.low);
    let rest = (square * square).mul_add(polynomial(square, COS), -lost);
    (sin, Pair { high: one.high, low: one.low + rest })
}

/// Lanes in which `n` is odd, and the sign of the sine as a bit, for `n + 1.5 · 2⁵²`
#[inline(always)]
fn quadrant<D: Double>(shifted: D) -> (D::Mask, D) {
    let last = shifted.and_bits(pattern(1)).or_bits(c(1.0));
    let sign = shifted.and_bits(pattern(2)).shift_left::<62>();
    (D::not(last.eq(c(1.0))), sign)
}

/// Arguments that the reduction does not take, and zeros in their place.
#[inline(always)]
fn bounded<D: Double>(a: D) -> (D::Mask, D) {
    let usual = a.abs().lt(c(LIMIT));
    (D::not(usual), D::select(usual, a.abs(), c(0.0)))
}

/// `(sin a, cos a)`
#[inline(always)]
pub fn sin_cos<D: Double>(a: D) -> (D, D) {
    let (rare, magnitude) = bounded(a);
    let (shifted, r) = reduce(magnitude);
    let (s, co) = near_zero(r);
    let (s, co) = (s.round(), co.round());
    let (odd, sign) = quadrant(shifted);
    let (_, sign_of_cos) = quadrant(shifted + c(1.0));
    let mut sin = D::select(odd, co, s).xor_bits(sign).xor_bits(a.and_bits(c(-0.0)));
    let mut cos = D::select(odd, s, co).xor_bits(sign_of_cos);
    repair(rare, a, &mut sin, <f64 as Scalar>::sin);
    repair(rare, a, &mut cos, <f64 as Scalar>::cos);
    (sin, cos)
}

/// `sin a`
#[inline(always)]
pub fn sin<D: Double>(a: D) -> D {
    let (rare, magnitude) = bounded(a);
    let (shifted, r) = reduce(magnitude);
    let (s, co) = near_zero(r);
    let (odd, sign) = quadrant(shifted);
    let mut sin = Pair::select(odd, co, s).round().xor_bits(sign).xor_bits(a.and_bits(c(-0.0)));
    repair(rare, a, &mut sin, <f64 as Scalar>::sin);
    sin
}

/// `cos a`
#[inline(always)]
pub fn cos<D: Double>(a: D) -> D {
    let (rare, magnitude) = bounded(a);
    let (shifted, r) = reduce(magnitude);
    let (s, co) = near_zero(r);
    let (odd, sign) = quadrant(shifted + c(1.0));
    let mut cos = Pair::select(odd, co, s).round().xor_bits(sign);
    repair(rare, a, &mut cos, <f64 as Scalar>::cos);
    cos
}

/// `tan a`
#[inline(always)]
pub fn tan<D: Double>(a: D) -> D {
    let (rare, magnitude) = bounded(a);
    let (shifted, r) = reduce(magnitude);
    let (s, co) = near_zero(r);
    let (s, co) = (s.tidy(), co.tidy());
    let (odd, _) = quadrant(shifted);
    let quotient = Pair::select(odd, co, s).div(Pair::select(odd, s.negate(), co)).round();
    // So small a number is its own tangent, and its products would underflow.
    let result = D::select(magnitude.lt(c(1e-9)), magnitude, quotient);
    let mut result = result.xor_bits(a.and_bits(c(-0.0)));
    repair(rare, a, &mut result, <f64 as Scalar>::tan);
    result
}

/// `(arctan q − q)/q³` in `q²`, `|q| ≤ tan(π/8)`; `arctan q` to 6.8e-20
const ATAN: [f64; 12] = [
    -0.33333333333333331482961625624739099,
    0.19999999999998921418331576660420978,
    -0.14285714285526798783543257637015495,
    0.11111111095898457135078274404804688,
    -9.0909083953777239384130837152042660e-2,
    7.6922879061511822973429275407397654e-2,
    -6.6662962148647031401793583427206613e-2,
    5.8776470867499319705729721734441630e-2,
    -5.2221250305629372812088462246736362e-2,
    4.5176025583888043679614544548606975e-2,
    -3.3779706472766998781587233224854742e-2,
    1.5485553133661487251737653991769779e-2,
];
const TAN_PI_8: f64 = 0.414213562373095034452319396223194;
/// What π/4 lacks as a double.
const PI_4_LOW: f64 = 3.0616169978683830179e-17;

/// The angle of the point `(x, y)`, neither negative nor both zero; `x_is_negative` where the point is to be mirrored.
#[inline(always)]
fn angle<D: Double>(y: Pair<D>, x: Pair<D>, x_is_negative: D::Mask) -> D {
    let steep = x.high.lt(y.high);
    let (long, short) = (Pair::select(steep, y, x), Pair::select(steep, x, y));
    // Beyond π/8 the angle from the diagonal: tan(φ − π/4) = (tan φ − 1)/(tan φ + 1).
    let diagonal = (long.high * c(TAN_PI_8)).lt(short.high);
    let zero = c(0.0);
    let numerator = Pair::select(diagonal, short.add(long.negate()), short);
    let denominator = Pair::select(diagonal, long.add_smaller(short).tidy(), long);
    let q = numerator.div(denominator);
    let square = q.high * q.high;
    let low = (q.high * square).mul_add(polynomial(square, ATAN), q.low.subtract_product(q.low, square));
    let base = D::select(diagonal, c(FRAC_PI_4), zero);
    let base = Pair { high: base, low: D::select(diagonal, c(PI_4_LOW), zero) };
    let angle = base.add_smaller(Pair { high: q.high, low });
    let right = Pair::constant(2.0 * FRAC_PI_4, 2.0 * PI_4_LOW).add_smaller(angle.negate());
    let angle = Pair::select(steep, right, angle);
    let mirrored = Pair::constant(PI, 4.0 * PI_4_LOW).add_smaller(angle.negate());
    Pair::select(x_is_negative, mirrored, angle).round()
}

/// `arctan a`
#[inline(always)]
pub fn atan<D: Double>(a: D) -> D {
    let magnitude = clamp(a.abs(), 0.0, 1e20);
    let never = magnitude.lt(c(0.0));
    let result = angle(Pair::new(magnitude), Pair::new(c(1.0)), never);
    copy_sign(D::select(magnitude.lt(c(1e-9)), magnitude, result), a)
}

/// the angle of `(x, y)`
#[inline(always)]
pub fn atan2<D: Double>((y, x): (D, D)) -> D {
    let (along, up) = (x.abs(), y.abs());
    let longer = along.max(up);
    let size = |a: D| D::and(c::<D>(1e-130).lt(a), a.lt(c(1e130)));
    let fits = |a: D| D::or(size(a), a.eq(c(0.0)));
    let usual = D::and(size(longer), D::and(fits(along), fits(up)));
    let along = D::select(usual, along, c(1.0));
    let up = D::select(usual, up, c(0.0));
    let mut result = copy_sign(angle(Pair::new(up), Pair::new(along), x.lt(c(0.0))), y);
    repair2(D::not(usual), y, x, &mut result, <f64 as Scalar>::atan2);
    result
}

/// `√(1 − a²)`
#[inline(always)]
fn complement<D: Double>(a: D) -> Pair<D> {
    Pair::new(c(1.0)).add(product(a, a).negate()).sqrt()
}

/// `arcsin a`, the angle of `(√(1 − a²), a)`
#[inline(always)]
pub fn asin<D: Double>(a: D) -> D {
    let magnitude = a.abs();
    let never = magnitude.lt(c(0.0));
    let result = copy_sign(angle(Pair::new(magnitude), complement(magnitude), never), a);
    let result = D::select(magnitude.lt(c(1e-9)), a, result);
    D::select(magnitude.le(c(1.0)), result, c(f64::NAN))
}

/// `arccos a`, the angle of `(a, √(1 − a²))`
#[inline(always)]
pub fn acos<D: Double>(a: D) -> D {
    let magnitude = a.abs();
    let result = angle(complement(magnitude), Pair::new(magnitude), a.lt(c(0.0)));
    D::select(magnitude.le(c(1.0)), result, c(f64::NAN))
}
