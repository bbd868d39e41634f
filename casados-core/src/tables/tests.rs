//! Tables against closed forms, another way to the same splines, and three ways to derivatives.

use super::*;
use crate::scalar::lanes::{F32x4, F64x2};
use num_complex::Complex64;
use num_dual::{Dual64, HyperDual64};
use std::vec::Vec;

const X: [f64; 6] = [-1.5, -0.25, 0.5, 2.0, 2.75, 4.5];
const F: [f64; 6] = [0.7, -0.4, 1.3, 1.1, 2.9, -0.8];
const Y: [f64; 4] = [10.0, 12.0, 17.0, 20.0];
const G: [[f64; 4]; 6] = [
    [0.1, 0.9, -0.6, 0.3],
    [1.4, 0.2, 0.5, -1.1],
    [-0.3, 0.8, 1.9, 0.4],
    [0.6, -1.2, 0.7, 1.5],
    [2.1, 0.4, -0.9, 0.2],
    [-0.5, 1.0, 0.3, 1.7],
];
const SPLINE: Spline<6> = Spline::natural(X, F);
const LINEAR: Linear<6> = Linear::new(X, F);
const SPLINE2: Spline2<6, 4> = Spline2::natural(X, Y, G);
const LINEAR2: Linear2<6, 4> = Linear2::new(X, Y, G);

fn close(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance * (1.0 + expected.abs()), "{found} is not {expected}");
}

/// Inside and outside of the points, none of them a point.
fn places() -> impl Iterator<Item = f64> {
    (0..60).map(|k| -3.017 + 0.1501 * f64::from(k))
}

#[test]
fn values_at_the_points_are_kept_to_the_last_bit() {
    for (x, f) in X.into_iter().zip(F) {
        assert_eq!((SPLINE.value(x), LINEAR.value(x)), (f, f));
    }
    for (x, row) in X.into_iter().zip(G) {
        for (y, f) in Y.into_iter().zip(row) {
            assert_eq!((SPLINE2.value(x, y), LINEAR2.value(x, y)), (f, f));
        }
    }
}

/// The natural spline through 0, 1, 0 at 0, 1, 2 is `(3x − x³)/2` up to the middle, and outside a
/// line.
#[test]
fn the_least_spline_has_its_closed_form() {
    const HAT: Spline<3> = Spline::natural([0.0, 1.0, 2.0], [0.0, 1.0, 0.0]);
    const PRODUCT: Spline2<3, 3> = Spline2::natural(
        [0.0, 1.0, 2.0],
        [0.0, 1.0, 2.0],
        [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]],
    );
    let form = |x: f64| {
        let (x, sign) = if x > 1.0 { (2.0 - x, -1.0) } else { (x, 1.0) };
        let third = if x < 0.0 { 0.0 } else { -3.0 * sign };
        match x {
            x if x < 0.0 => [1.5 * x, 1.5 * sign, 0.0, third],
            x => [1.5 * x - 0.5 * x * x * x, sign * (1.5 - 1.5 * x * x), -3.0 * x, third],
        }
    };
    let places = [-2.5, -0.3, 0.2, 0.7, 1.1, 1.9, 2.4, 7.0];
    for x in places {
        for (order, expected) in form(x).into_iter().enumerate() {
            close(HAT.partial([x], [order as u32]), expected, 1e-14);
        }
        for y in places {
            for (i, a) in form(x).into_iter().enumerate() {
                for (j, b) in form(y).into_iter().enumerate() {
                    close(PRODUCT.partial([x, y], [i as u32, j as u32]), a * b, 1e-14);
                }
            }
        }
    }
    assert_eq!(HAT.partial([0.3], [4]), 0.0);
}

/// The same spline by its second derivatives at the points, from a dense system.
fn by_moments(points: &[f64], values: &[f64], x: f64) -> f64 {
    let n = points.len();
    let mut matrix = nalgebra::DMatrix::<f64>::identity(n, n);
    let mut right = nalgebra::DVector::<f64>::zeros(n);
    for i in 1..n - 1 {
        let (h, k) = (points[i] - points[i - 1], points[i + 1] - points[i]);
        matrix[(i, i - 1)] = h / 6.0;
        matrix[(i, i)] = (h + k) / 3.0;
        matrix[(i, i + 1)] = k / 6.0;
        right[i] = (values[i + 1] - values[i]) / k - (values[i] - values[i - 1]) / h;
    }
    let moments = matrix.lu().solve(&right).expect("the matrix is regular");
    let i = points[1..n - 1].iter().filter(|&&point| point <= x).count();
    let (h, a, b) = (points[i + 1] - points[i], points[i + 1] - x, x - points[i]);
    (moments[i] * a * a * a + moments[i + 1] * b * b * b) / (6.0 * h)
        + (values[i] / h - moments[i] * h / 6.0) * a
        + (values[i + 1] / h - moments[i + 1] * h / 6.0) * b
}

#[test]
fn splines_are_those_of_second_derivatives() {
    for x in places().filter(|x| (X[0]..X[5]).contains(x)) {
        close(SPLINE.value(x), by_moments(&X, &F, x), 1e-14);
        for y in [10.3, 12.9, 16.0, 19.99] {
            let rows: Vec<f64> = G.iter().map(|row| by_moments(&Y, row, y)).collect();
            close(SPLINE2.value(x, y), by_moments(&X, &rows, x), 1e-14);
        }
    }
}

#[test]
fn splines_are_twice_continuously_differentiable_everywhere() {
    let step = 1e-9;
    for x in X {
        for order in 0..3 {
            let sides = [x - step, x + step].map(|x| SPLINE.partial([x], [order]));
            close(sides[0], sides[1], 1e-7);
            for (y, other) in Y.into_iter().flat_map(|y| (0..3).map(move |other| (y, other))) {
                let sides = [x - step, x + step].map(|x| SPLINE2.partial([x, y], [order, other]));
                close(sides[0], sides[1], 1e-7);
                let sides = [y - step, y + step].map(|y| SPLINE2.partial([x, y], [order, other]));
                close(sides[0], sides[1], 1e-7);
            }
        }
    }
    let third = [0.4, 0.6].map(|x| SPLINE.partial([x], [3]));
    assert!((third[0] - third[1]).abs() > 1.0, "but not three times");
}

#[test]
fn all_tables_are_continued_linearly() {
    for (end, away) in [(X[0], -2.0), (X[5], 3.0)] {
        let x = end + away;
        close(SPLINE.value(x), SPLINE.value(end) + away * SPLINE.derivative(end), 1e-14);
        close(LINEAR.value(x), LINEAR.value(end) + away * LINEAR.derivative(end), 1e-14);
        assert_eq!([2, 3].map(|order| SPLINE.partial([x], [order])), [0.0; 2]);
        let inside = SPLINE2.value(end, 11.0) + away * SPLINE2.gradient(end, 11.0)[0];
        close(SPLINE2.value(x, 11.0), inside, 1e-14);
        // Beyond a corner the function is bilinear.
        let corner = |i, j| SPLINE2.partial([end, Y[3]], [i, j]);
        let expected = corner(0, 0) + away * corner(1, 0) + 4.0 * corner(0, 1) + 4.0 * away * corner(1, 1);
        close(SPLINE2.value(x, Y[3] + 4.0), expected, 1e-14);
    }
    assert!(SPLINE.value(f64::NAN).is_nan() && LINEAR2.value(0.0, f64::NAN).is_nan());
    assert!(SPLINE.value(1e300_f64).is_finite());
}

/// Derivatives of lower order, differentiated by hyper-dual numbers, by complex numbers, and by
/// differences of sixth order.
fn check_derivatives<const K: usize>(table: &impl Table<K>, orders: [u32; K], at: [f64; K]) {
    let value = |at: [f64; K]| table.partial(at, orders);
    for j in 0..K {
        let raised = |orders: [u32; K], by: usize| core::array::from_fn(|k| orders[k] + u32::from(k == by));
        let exact: f64 = table.partial(at, raised(orders, j));
        let complex: [Complex64; K] =
            core::array::from_fn(|k| Complex64::new(at[k], if k == j { 1e-200 } else { 0.0 }));
        close(table.partial(complex, orders).im / 1e-200, exact, 1e-14);
        let dual: [Dual64; K] = core::array::from_fn(|k| Dual64::new(at[k], f64::from(u8::from(k == j))));
        close(table.partial(dual, orders).eps, exact, 1e-14);
        let moved = |by: f64| value(core::array::from_fn(|k| if k == j { at[k] + by } else { at[k] }));
        let h = 1e-4;
        let difference = |n: f64| moved(n * h) - moved(-n * h);
        let difference = (45.0 * difference(1.0) - 9.0 * difference(2.0) + difference(3.0)) / (60.0 * h);
        close(difference, exact, 1e-10);
        for l in 0..K {
            let exact: f64 = table.partial(at, raised(raised(orders, j), l));
            let hyper: [HyperDual64; K] = core::array::from_fn(|k| {
                let part = |of: usize| f64::from(u8::from(k == of));
                HyperDual64::new(at[k], part(j), part(l), 0.0)
            });
            close(table.partial(hyper, orders).eps1eps2, exact, 1e-13);
        }
    }
}

#[test]
fn derivatives_agree_three_ways() {
    for x in places() {
        for order in 0..3 {
            check_derivatives(&SPLINE, [order], [x]);
            check_derivatives(&LINEAR, [order], [x]);
        }
        for y in [7.0, 10.1, 14.0, 19.0, 25.0] {
            for orders in [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]] {
                check_derivatives(&SPLINE2, orders, [x, y]);
                check_derivatives(&LINEAR2, orders, [x, y]);
            }
        }
    }
}

#[test]
fn registers_have_the_bits_of_numbers() {
    let list: Vec<f64> = places().collect();
    for pair in list.windows(2) {
        let x = F64x2::<2>::load(&[pair[0], pair[1]]);
        let y = F64x2::<2>::load(&[11.0, 18.5]);
        for order in 0..4 {
            let lanes = SPLINE.partial([x], [order]).to_array();
            assert_eq!(lanes, [pair[0], pair[1]].map(|x| SPLINE.partial([x], [order])));
            let lanes = SPLINE2.partial([x, y], [order, 1]).to_array();
            assert_eq!(lanes[0], SPLINE2.partial([pair[0], 11.0], [order, 1]));
            assert_eq!(lanes[1], SPLINE2.partial([pair[1], 18.5], [order, 1]));
        }
        assert_eq!(LINEAR2.value(x, y).to_array()[1], LINEAR2.value(pair[1], 18.5));
    }
    for four in list.windows(4) {
        let x = [four[0], four[1], four[2], four[3]].map(|x| x as f32);
        let lanes = SPLINE.value(F32x4::<4>::load(&x)).to_array();
        assert_eq!(lanes, x.map(|x| SPLINE.value(x)));
        for (single, x) in lanes.into_iter().zip(x) {
            close(f64::from(single), SPLINE.value(f64::from(x)), 1e-5);
        }
    }
}

#[test]
#[should_panic(expected = "have to increase")]
fn points_have_to_increase() {
    let _ = Spline::natural([0.0, 1.0, 1.0], [0.0; 3]);
}

#[test]
#[should_panic(expected = "have to be finite")]
fn values_have_to_be_finite() {
    let _ = Linear2::new([0.0, 1.0], [0.0, 1.0], [[0.0, 0.0], [0.0, f64::NAN]]);
}

#[test]
#[should_panic(expected = "at least two points")]
fn one_point_is_no_table() {
    let _ = Linear::new([0.0], [0.0]);
}
