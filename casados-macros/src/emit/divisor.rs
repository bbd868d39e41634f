//! Division by a constant in two operations, bitwise equal to the quotient.
//!
//! A division takes as long as ten products. With `1/c ≈ h + l`, where `|h| ≤ |1/c|`, so that both
//! have one sign and infinities and zeros are preserved, a fused product gives
//!
//! ```text
//! x/c = RN(h x + RN(l x))
//! ```
//!
//! for all `x`, except for results next to the smallest and the largest numbers. It suffices to
//! verify the few `x` whose quotient is so close to the midpoint of two doubles that the error of
//! the sum may change the rounding. They are enumerated and tested; if one of them fails, the next
//! `h` and `l` are tried. N. Brisebarre, J.-M. Muller, S. K. Raina, "Accelerating correctly rounded
//! floating-point division when the divisor is known in advance", IEEE Transactions on Computers 53
//! (2004).

/// Significant bits of a double.
const MANTISSA_BITS: u32 = f64::MANTISSA_DIGITS;
/// Quotients within this many units of `1/(2ᵏ C)` of a midpoint are verified.
const HARD_CASE_DISTANCE: u128 = 64;

/// `[h, l]`, if quotients by `c` are bitwise equal.
pub fn reciprocal(c: f64) -> Option<[f64; 2]> {
    // For other `c` the product `l x` would often underflow.
    if !(1e-100..1e100).contains(&c.abs()) {
        return None;
    }
    let nearest = 1.0 / c;
    // The remainder of a quotient rounded to nearest or to zero is a double.
    let rest = |high: f64| (-high).mul_add(c, 1.0);
    let below = u64::from(rest(nearest) < 0.0);
    let hard: Vec<f64> = hard_cases(c).collect();
    (below..below + 3).find_map(|below| {
        let high = f64::from_bits(nearest.to_bits() - below);
        let low = (rest(high) / c).to_bits();
        [low, low + 1, low.saturating_sub(1)]
            .into_iter()
            .map(f64::from_bits)
            .find_map(|low| hard.iter().all(|&x| x.mul_add(high, x * low) == x / c).then_some([high, low]))
    })
}

/// All `x` in `2⁵² .. 2⁵³` whose quotient by `c` is within a relative distance of 2⁻¹⁰¹ of the
/// midpoint of two doubles, and some more.
///
/// (If `h` is up to three units in the last place, a relative error of 3 · 2⁻⁵², below `1/c`, and
/// `l` has an error of one and a half of its units, the relative error of the sum is 4.5 · 2⁻¹⁰⁴,
/// and the rounding of `l x` adds 1.5 · 2⁻¹⁰⁴.)
///
/// With the integers `X = x` and `C` of the significant digits a midpoint is `M/2ᵏ`, `k = 53` if
/// `X ≥ C` and otherwise `k = 54`, and `X/C = M/2ᵏ + d/(2ᵏ C)` with an integer `|d| ≤ 64`:
/// `2ᵏ X = d` modulo `C`. (`d = 0` does not occur: `M` is odd, so that `C` would be a multiple of
/// `2ᵏ`.)
fn hard_cases(c: f64) -> impl Iterator<Item = f64> {
    let digits = u128::from(c.to_bits() & ((1 << (MANTISSA_BITS - 1)) - 1) | 1 << (MANTISSA_BITS - 1));
    let twos = digits.trailing_zeros();
    let odd = digits >> twos;
    [MANTISSA_BITS, MANTISSA_BITS + 1].into_iter().flat_map(move |k| {
        let inverse = power(odd.div_ceil(2), k - twos, odd);
        (1..=HARD_CASE_DISTANCE).filter(move |d| d.trailing_zeros() >= twos).flat_map(move |d| {
            let above = (d >> twos) * inverse % odd;
            [above, odd - above].into_iter().flat_map(move |first| {
                let least = 1_u128 << (MANTISSA_BITS - 1);
                let begin = first + least.saturating_sub(first).div_ceil(odd) * odd;
                (begin..2 * least).step_by(odd as usize).map(|x| x as f64)
            })
        })
    })
}

/// `base^exponent` modulo `modulus`.
fn power(base: u128, exponent: u32, modulus: u128) -> u128 {
    (0..exponent).fold(1 % modulus, |power, _| power * base % modulus)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// xorshift64*, Vigna 2016
    fn random(state: &mut u64) -> u64 {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        state.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    /// A number of moderate magnitude.
    fn random_number(state: &mut u64) -> f64 {
        let (bits, exponent) = (random(state), random(state) % 200);
        f64::from_bits(bits & (1 << 63 | ((1 << 52) - 1)) | (923 + exponent) << 52)
    }

    #[test]
    fn quotients_have_the_same_bits() {
        let mut state = 0x9E37_79B9_7F4A_7C15;
        let mut kept = 0;
        for _ in 0..2000 {
            let c = random_number(&mut state);
            let Some([high, low]) = reciprocal(c) else { continue };
            kept += 1;
            assert!(high.abs() <= (1.0 / c).abs() && low * c >= 0.0, "{c:e}");
            for _ in 0..200 {
                let x = random_number(&mut state);
                assert_eq!(x.mul_add(high, x * low).to_bits(), (x / c).to_bits(), "{x:e} / {c:e}");
            }
        }
        assert!(kept > 1950, "{kept} of 2000");
    }

    #[test]
    fn numbers_of_models_are_divisors() {
        for c in [3.0, 5.0, 10.0, 100.0, 288.15, 434.287, 0.1, -9.81] {
            assert!(reciprocal(c).is_some(), "{c}");
        }
    }

    /// The enumeration is compared with its definition.
    #[test]
    fn hard_cases_are_hard_and_others_are_not() {
        let mut state = 0x2545_F491_4F6C_DD1D;
        for _ in 0..200 {
            let c = random_number(&mut state).abs();
            let digits = u128::from(c.to_bits() & ((1 << 52) - 1) | 1 << 52);
            let distance = |x: u128| {
                [53, 54].map(|k| ((x << k) % digits).min(digits - (x << k) % digits)).into_iter().min()
            };
            let hard: Vec<f64> = hard_cases(c).collect();
            for &x in &hard {
                assert!(distance(x as u128) <= Some(HARD_CASE_DISTANCE), "{x} / {c:e}");
            }
            for _ in 0..1000 {
                let x = random(&mut state) >> 11 | 1 << 52;
                assert!(
                    hard.contains(&(x as f64)) || distance(u128::from(x)) > Some(HARD_CASE_DISTANCE),
                    "{x} / {c:e}"
                );
            }
        }
    }

    #[test]
    fn infinities_and_zeros_stay() {
        for c in [3.0, -7.0, 288.15, -434.287] {
            let Some([high, low]) = reciprocal(c) else { panic!("{c}") };
            for x in [0.0, -0.0, f64::INFINITY, f64::NEG_INFINITY] {
                assert_eq!(x.mul_add(high, x * low).to_bits(), (x / c).to_bits(), "{x} / {c}");
            }
        }
    }

    #[test]
    fn numbers_without_such_a_reciprocal() {
        for c in [0.0, f64::NAN, f64::INFINITY, 1e-300, -1e200] {
            assert_eq!(reciprocal(c), None, "{c}");
        }
    }
}
