//! The points of a table.

use crate::scalar::Real;

/// Panics if points do not increase.
pub const fn check_increasing<const N: usize>(points: &[f64; N]) {
    assert!(N >= 2, "a table has at least two points");
    let mut i = 0;
    while i < N {
        assert!(points[i].is_finite(), "the points of a table have to be finite");
        assert!(i == 0 || points[i - 1] < points[i], "the points of a table have to increase");
        i += 1;
    }
}

/// Panics if values are not finite.
pub const fn check_values<const N: usize>(values: &[f64; N]) {
    let mut i = 0;
    while i < N {
        assert!(values[i].is_finite(), "the values of a table have to be finite");
        i += 1;
    }
}

/// Panics if slopes of linear pieces are not finite.
pub const fn check_linear_slopes<const N: usize>(points: &[f64; N], values: &[f64; N]) {
    let mut slopes = [0.0; N];
    let mut i = 1;
    while i < N {
        slopes[i] = (values[i] - values[i - 1]) / (points[i] - points[i - 1]);
        i += 1;
    }
    check_slopes(&slopes);
}

/// Panics if slopes are not finite.
pub const fn check_slopes<const N: usize>(slopes: &[f64; N]) {
    let mut i = 0;
    while i < N {
        assert!(
            slopes[i].is_finite(),
            "the slopes of a table have to be finite: its points are too close for its values"
        );
        i += 1;
    }
}

/// The index of the interval that contains `x`; outside of the table, of the nearest one.
#[inline(always)]
pub fn interval_index<T: Real, const N: usize>(points: &[f64; N], x: T) -> usize {
    let (mut first, mut count) = (0, N.saturating_sub(1));
    while count > 1 {
        let half = count / 2;
        let below = points.get(first + half).is_some_and(|&point| T::from_f64(point) <= x);
        first += if below { half } else { 0 };
        count -= half;
    }
    first
}

/// Two successive elements of a table.
#[inline(always)]
pub fn adjacent_pair<T>(table: &[T], first: usize) -> [&T; 2] {
    match table.get(first..) {
        Some([a, b, ..]) => [a, b],
        // Unreachable: tables have at least two points, and the index is that of an interval.
        _ => [&table[0]; 2],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_found_by_counting() {
        fn check_interval_search<const N: usize>() {
            let points: [f64; N] = core::array::from_fn(|i| (i * i) as f64);
            for step in -20..(2 * N * N) as i32 {
                let x = 0.5 * f64::from(step);
                let counted = points.iter().filter(|&&point| point <= x).count();
                let expected = counted.saturating_sub(1).min(N - 2);
                assert_eq!(interval_index(&points, x), expected, "{x} of {N}");
                assert_eq!(interval_index(&points, x as f32), expected);
            }
            assert_eq!(interval_index(&points, f64::NAN), 0);
            assert_eq!(interval_index(&points, f64::INFINITY), N - 2);
        }
        check_interval_search::<2>();
        check_interval_search::<3>();
        check_interval_search::<4>();
        check_interval_search::<5>();
        check_interval_search::<8>();
        check_interval_search::<17>();
    }
}
