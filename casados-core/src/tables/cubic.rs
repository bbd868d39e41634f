//! Cubic pieces by values and slopes at their ends, and the slopes of splines.

use super::points::check_slopes;
use crate::scalar::Scalar;

/// The weights of `[f₀, f₁, f₀′, f₁′]` in a derivative of a cubic piece: of order zero, with
/// `s = (x − x₀)/h` and `r = 1 − s`, they are `[r² (1 + 2s), s² (3 − 2s), h s r², −h s² r]`
/// (Hermite); outside they are linear in `x`.
#[inline(always)]
pub fn hermite_weights<S: Scalar>(x: S, [x0, x1]: [S; 2], order: u32) -> [S; 4] {
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

/// The end conditions of a spline.
#[derive(Clone, Copy)]
pub enum EndConditions {
    /// The second derivative is zero.
    Natural,
    /// Given slopes.
    Slopes([f64; 2]),
    /// The third derivative is continuous at the second and the second-to-last point.
    NotAKnot,
}

/// The slopes at the points of the cubic spline with continuous second derivative (C. de Boor, "A
/// Practical Guide to Splines", chapter IV).
///
/// ```text
/// f′ᵢ₋₁/hᵢ₋₁ + 2 (1/hᵢ₋₁ + 1/hᵢ) f′ᵢ + f′ᵢ₊₁/hᵢ = 3 (δᵢ₋₁/hᵢ₋₁ + δᵢ/hᵢ),   δᵢ = (fᵢ₊₁ − fᵢ)/hᵢ
/// ```
///
/// The tridiagonal matrix needs no pivoting: it is diagonally dominant, except in the rows of
/// not-a-knot ends, whose pivots are positive.
pub const fn slopes<const N: usize>(points: &[f64; N], values: &[f64; N], ends: EndConditions) -> [f64; N] {
    let slopes = solve_slopes(points, values, ends);
    check_slopes(&slopes);
    slopes
}

const fn solve_slopes<const N: usize>(points: &[f64; N], values: &[f64; N], ends: EndConditions) -> [f64; N] {
    if let (EndConditions::NotAKnot, 3) = (ends, N) {
        return parabola(points, values);
    }
    let (mut upper, mut slopes) = ([0.0; N], [0.0; N]);
    let mut i = 0;
    while i < N {
        let [lower, mut diagonal, above, mut right] = match ends {
            EndConditions::Slopes([first, _]) if i == 0 => [0.0, 1.0, 0.0, first],
            EndConditions::Slopes([_, last]) if i + 1 == N => [0.0, 1.0, 0.0, last],
            EndConditions::NotAKnot if N > 3 && i == 0 => not_a_knot(points, values, [0, 1, 2]),
            EndConditions::NotAKnot if N > 3 && i + 1 == N => {
                not_a_knot(points, values, [N - 1, N - 2, N - 3])
            }
            _ => smoothness_row(points, values, i),
        };
        if i > 0 {
            diagonal -= lower * upper[i - 1];
            right -= lower * slopes[i - 1];
        }
        upper[i] = above / diagonal;
        slopes[i] = right / diagonal;
        i += 1;
    }
    while i > 1 {
        i -= 1;
        slopes[i - 1] -= upper[i - 1] * slopes[i];
    }
    slopes
}

/// The row of a point: below, on and above the diagonal, and the right-hand side. The second
/// derivatives of both sides are equal; at an end the one side is zero.
const fn smoothness_row<const N: usize>(points: &[f64; N], values: &[f64; N], i: usize) -> [f64; 4] {
    let [mut lower, mut diagonal, mut above, mut right] = [0.0; 4];
    if i > 0 {
        let h = points[i] - points[i - 1];
        lower = 1.0 / h;
        diagonal += 2.0 / h;
        right += 3.0 * (values[i] - values[i - 1]) / h / h;
    }
    if i + 1 < N {
        let h = points[i + 1] - points[i];
        above = 1.0 / h;
        diagonal += 2.0 / h;
        right += 3.0 * (values[i + 1] - values[i]) / h / h;
    }
    [lower, diagonal, above, right]
}

/// The row of a not-a-knot end and its two inner neighbours: both pieces are one polynomial.
///
/// ```text
/// k f′₀ + (h + k) f′₁ = ((3h + 2k) k δ₀ + h² δ₁)/(h + k)
/// ```
const fn not_a_knot<const N: usize>(points: &[f64; N], values: &[f64; N], [a, b, c]: [usize; 3]) -> [f64; 4] {
    let (h, k) = (points[b] - points[a], points[c] - points[b]);
    let (first, second) = ((values[b] - values[a]) / h, (values[c] - values[b]) / k);
    let (both, off) = (h + k, 1.0 + h / k);
    // Divided by `k`, which is negative at the last end.
    [off, 1.0, off, ((3.0 * h + 2.0 * k) * first + h * (h / k) * second) / both]
}

/// The slopes of the parabola through three points.
const fn parabola<const N: usize>(points: &[f64; N], values: &[f64; N]) -> [f64; N] {
    let (h, k) = (points[1] - points[0], points[2] - points[1]);
    let (first, second) = ((values[1] - values[0]) / h, (values[2] - values[1]) / k);
    let curvature = (second - first) / (h + k);
    let mut slopes = [0.0; N];
    slopes[0] = first - h * curvature;
    slopes[1] = first + h * curvature;
    slopes[2] = second + k * curvature;
    slopes
}
