//! Polynomials in Bernstein form: values and restrictions, by de Casteljau's algorithm.
//!
//! G. Farin, *Curves and Surfaces for CAGD*, 5th edition, chapters 4 and 5 (blossoms, subdivision).

use crate::qp::element::get;
use crate::scalar::Real;
use alloc::vec::Vec;

/// Returns the value at `theta` of the polynomial with these coefficients.
pub(in crate::ocp) fn value<T: Real>(coefficients: &[T], theta: T) -> T {
    blossom(coefficients, |_| theta)
}

/// Returns the coefficients of a polynomial over the part `[from, to]` of its interval.
pub(in crate::ocp) fn restriction<T: Real>(coefficients: &[T], [from, to]: [T; 2]) -> Vec<T> {
    let at_end = |count: usize| move |level: usize| if level < count { to } else { from };
    (0..coefficients.len()).map(|count| blossom(coefficients, at_end(count))).collect()
}

/// Returns the blossom: the last point of de Casteljau's algorithm with an argument for each level.
fn blossom<T: Real>(coefficients: &[T], argument: impl Fn(usize) -> T) -> T {
    let mut points = coefficients.to_vec();
    for level in 0..points.len().saturating_sub(1) {
        let theta = argument(level);
        points = points.windows(2).map(|pair| get(pair, 0) + theta * (get(pair, 1) - get(pair, 0))).collect();
    }
    get(&points, 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `θ²` has the coefficients 0, 0, 1; over `[a, b]` they are `a²`, `a b`, `b²`.
    #[test]
    fn parts_of_a_parabola() {
        let (a, b) = (0.25, 0.75);
        assert_eq!(restriction(&[0.0, 0.0, 1.0], [a, b]), [a * a, a * b, b * b]);
        assert_eq!(value(&[0.0, 0.0, 1.0], a), a * a);
        assert_eq!(value(&[3.0], a), 3.0);
    }
}
