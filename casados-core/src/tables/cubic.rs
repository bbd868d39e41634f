//! Cubic pieces by values and slopes at their ends, and the slopes of natural splines.

use crate::scalar::Scalar;

/// The weights with which a derivative of a cubic piece is made of `[f₀, f₁, f₀′, f₁′]`: of order
/// zero, with `s = (x − x₀)/h` and `r = 1 − s`, they are
/// `[r² (1 + 2s), s² (3 − 2s), h s r², −h s² r]` (Hermite), and outside linear in `x`.
#[inline(always)]
pub fn weights<S: Scalar>(x: S, [x0, x1]: [S; 2], order: u32) -> [S; 4] {
    let c = S::from_f64;
    let (zero, one, three) = (c(0.0), c(1.0), c(3.0));
    let (d, h) = (x - x0, x1 - x0);
    let (left, right) = (d.lt(zero), h.lt(d));
    let within = S::select(left, zero, S::select(right, h, d));
    let s = within / h;
    let r = one - s;
    let inside = |a: S| S::select(S::or(left, right), zero, a);
    match order {
        0 => {
            let below = S::select(left, d, zero);
            let above = S::select(right, d - h, zero);
            let (rr, ss) = (r * r, s * s);
            [rr * (one + (s + s)), ss * (three - (s + s)), within * rr + below, above - within * s * r]
        }
        1 => {
            let slope = c(6.0) * s * r / h;
            [-slope, slope, r * (one - three * s), s * (three * s - c(2.0))]
        }
        2 => {
            let second = inside((c(12.0) * s - c(6.0)) / (h * h));
            let first = c(6.0) * s;
            [second, -second, inside((first - c(4.0)) / h), inside((first - c(2.0)) / h)]
        }
        3 => {
            let square = h * h;
            let (third, second) = (inside(c(12.0) / (square * h)), inside(c(6.0) / square));
            [third, -third, second, second]
        }
        _ => [zero; 4],
    }
}

/// The slopes at its points of the natural cubic spline: its second derivative is continuous, and
/// zero at both ends (C. de Boor, "A Practical Guide to Splines", chapter IV).
///
/// ```text
/// f′ᵢ₋₁/hᵢ₋₁ + 2 (1/hᵢ₋₁ + 1/hᵢ) f′ᵢ + f′ᵢ₊₁/hᵢ = 3 (δᵢ₋₁/hᵢ₋₁ + δᵢ/hᵢ),   δᵢ = (fᵢ₊₁ − fᵢ)/hᵢ
/// ```
///
/// The matrix is tridiagonal and diagonally dominant: no pivots have to be looked for.
pub const fn slopes<const N: usize>(points: &[f64; N], values: &[f64; N]) -> [f64; N] {
    let (mut upper, mut slopes) = ([0.0; N], [0.0; N]);
    let mut i = 0;
    while i < N {
        let (mut diagonal, mut right, mut lower) = (0.0, 0.0, 0.0);
        if i > 0 {
            let h = points[i] - points[i - 1];
            lower = 1.0 / h;
            diagonal += 2.0 / h;
            right += 3.0 * (values[i] - values[i - 1]) / h / h;
        }
        if i + 1 < N {
            let h = points[i + 1] - points[i];
            upper[i] = 1.0 / h;
            diagonal += 2.0 / h;
            right += 3.0 * (values[i + 1] - values[i]) / h / h;
        }
        if i > 0 {
            diagonal -= lower * upper[i - 1];
            right -= lower * slopes[i - 1];
        }
        upper[i] /= diagonal;
        slopes[i] = right / diagonal;
        i += 1;
    }
    while i > 1 {
        i -= 1;
        slopes[i - 1] -= upper[i - 1] * slopes[i];
    }
    slopes
}
