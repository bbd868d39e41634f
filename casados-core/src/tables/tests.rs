//! Tables against closed forms, splines against a second algorithm, and derivatives by three
//! methods.

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
const NATURAL: Spline<6> = Spline::natural(X, F);
const CLAMPED: Spline<6> = Spline::clamped(X, F, SLOPES);
const SLOPES: [f64; 2] = [1.3, -2.1];
const NOT_A_KNOT: Spline<6> = Spline::not_a_knot(X, F);
const LINEAR: Linear<6> = Linear::new(X, F);
const NATURAL_2D: Spline2<6, 4> = Spline2::natural(X, Y, G);
const NOT_A_KNOT_2D: Spline2<6, 4> = Spline2::not_a_knot(X, Y, G);
const LINEAR_2D: Linear2<6, 4> = Linear2::new(X, Y, G);

fn assert_close(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance * (1.0 + expected.abs()), "{found} is not {expected}");
}

/// Points inside and outside of the table, none of them a node.
fn sample_points() -> impl Iterator<Item = f64> {
    (0..60).map(|k| -3.017 + 0.1501 * f64::from(k))
}

#[test]
fn values_at_the_points() {
    for (x, f) in X.into_iter().zip(F) {
        assert_eq!((NATURAL.value(x), LINEAR.value(x)), (f, f));
        assert_eq!((CLAMPED.value(x), NOT_A_KNOT.value(x)), (f, f));
    }
    for (x, row) in X.into_iter().zip(G) {
        for (y, f) in Y.into_iter().zip(row) {
            assert_eq!((NATURAL_2D.value(x, y), LINEAR_2D.value(x, y), NOT_A_KNOT_2D.value(x, y)), (f, f, f));
        }
    }
}

/// The natural spline through 0, 1, 0 at 0, 1, 2 is `(3x − x³)/2` up to the middle, and linear
/// outside.
#[test]
fn spline_through_three_points() {
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
            assert_close(HAT.partial([x], [order as u32]), expected, 1e-14);
        }
        for y in places {
            for (i, a) in form(x).into_iter().enumerate() {
                for (j, b) in form(y).into_iter().enumerate() {
                    assert_close(PRODUCT.partial([x, y], [i as u32, j as u32]), a * b, 1e-14);
                }
            }
        }
    }
    assert_eq!(HAT.partial([0.3], [4]), 0.0);
}

/// Clamped and not-a-knot splines reproduce a cubic polynomial and its derivatives.
#[test]
fn cubic_polynomials_are_reproduced() {
    let cubic =
        |x: f64| [((0.3 * x - 0.7) * x + 1.1) * x + 0.4, (0.9 * x - 1.4) * x + 1.1, 1.8 * x - 1.4, 1.8];
    fn check_on_points<const N: usize>(points: [f64; N], cubic: impl Fn(f64) -> [f64; 4]) {
        let values = points.map(|x| cubic(x)[0]);
        let slopes = [points[0], points[N - 1]].map(|x| cubic(x)[1]);
        let mut splines = std::vec![Spline::clamped(points, values, slopes)];
        if N > 3 {
            splines.push(Spline::not_a_knot(points, values));
        }
        for (spline, k) in splines.iter().flat_map(|spline| (0..=50).map(move |k| (spline, k))) {
            let x = points[0] + (points[N - 1] - points[0]) * f64::from(k) / 50.0;
            for (order, expected) in cubic(x).into_iter().enumerate() {
                assert_close(spline.partial([x], [order as u32]), expected, 1e-12);
            }
        }
    }
    check_on_points([-0.5, 1.5], cubic);
    check_on_points([-0.5, 1.0, 1.5], cubic);
    check_on_points([-0.5, 0.0, 1.0, 1.5], cubic);
    check_on_points(X, cubic);
    let product = |x: f64, y: f64| cubic(x)[0] * cubic(0.1 * y)[0];
    let of_two = Spline2::not_a_knot(X, Y, X.map(|x| Y.map(|y| product(x, y))));
    assert_close(of_two.value(0.9, 13.0), product(0.9, 13.0), 1e-12);
    assert_close(of_two.partial([0.9, 13.0], [1, 2]), cubic(0.9)[1] * 0.01 * cubic(1.3)[2], 1e-12);
}

#[test]
fn fewer_points_than_four_are_a_polynomial() {
    let parabola = Spline::not_a_knot([0.0, 1.0, 3.0], [0.0, 1.0, 9.0]);
    let line = Spline::not_a_knot([1.0, 3.0], [2.0, -2.0]);
    for x in [0.0, 0.4, 1.0, 2.0, 3.0] {
        assert_close(parabola.value(x), x * x, 1e-14);
        assert_close(parabola.derivative(x), 2.0 * x, 1e-14);
        assert_close(line.value(x), 4.0 - 2.0 * x, 1e-14);
    }
}

/// Clamped and not-a-knot splines have order four up to the ends; natural ones have order two where
/// the function has curvature there.
#[test]
fn errors_at_the_ends_have_their_orders() {
    fn errors<const N: usize>() -> [f64; 3] {
        let points: [f64; N] = core::array::from_fn(|i| 1.0 + i as f64 / (N - 1) as f64);
        let values = points.map(f64::exp);
        let ends = [points[0].exp(), points[N - 1].exp()];
        let splines = [
            Spline::natural(points, values),
            Spline::clamped(points, values, ends),
            Spline::not_a_knot(points, values),
        ];
        splines.map(|spline| {
            let error = |k: u32| {
                let x = 1.0 + f64::from(k) / 997.0;
                (spline.value(x) - x.exp()).abs()
            };
            (0..=997).map(error).fold(0.0, f64::max)
        })
    }
    let (coarse, fine) = (errors::<17>(), errors::<33>());
    for ((coarse, fine), order) in coarse.into_iter().zip(fine).zip([2.0, 4.0, 4.0]) {
        let found = (coarse / fine).log2();
        assert!((found - order).abs() < 0.2, "order {found}, not {order}");
    }
}

/// The end conditions of the tested splines.
#[derive(Clone, Copy)]
enum TestEnds {
    Natural,
    Slopes,
    NotAKnot,
}

/// The same spline by its second derivatives at the points (moments), from a dense system.
fn spline_by_moments(ends: TestEnds, points: &[f64], values: &[f64], x: f64) -> f64 {
    let n = points.len();
    let h = |i: usize| points[i + 1] - points[i];
    let slope = |i: usize| (values[i + 1] - values[i]) / h(i);
    let mut matrix = nalgebra::DMatrix::<f64>::identity(n, n);
    let mut right = nalgebra::DVector::<f64>::zeros(n);
    for i in 1..n - 1 {
        matrix[(i, i - 1)] = h(i - 1) / 6.0;
        matrix[(i, i)] = (h(i - 1) + h(i)) / 3.0;
        matrix[(i, i + 1)] = h(i) / 6.0;
        right[i] = slope(i) - slope(i - 1);
    }
    match ends {
        TestEnds::Natural => {}
        TestEnds::Slopes => {
            for (end, next, piece, sign) in [(0, 1, 0, 1.0), (n - 1, n - 2, n - 2, -1.0)] {
                matrix[(end, end)] = h(piece) / 3.0;
                matrix[(end, next)] = h(piece) / 6.0;
                right[end] = sign * (slope(piece) - SLOPES[usize::from(end > 0)]);
            }
        }
        TestEnds::NotAKnot => {
            for (end, first) in [(0, 0), (n - 1, n - 3)] {
                let (h, k) = (h(first), h(first + 1));
                let row = [1.0 / h, -1.0 / h - 1.0 / k, 1.0 / k];
                matrix[(end, end)] = 0.0;
                for (j, number) in row.into_iter().enumerate() {
                    matrix[(end, first + j)] = number;
                }
            }
        }
    }
    let moments = matrix.lu().solve(&right).expect("the matrix is regular");
    let i = points[1..n - 1].iter().filter(|&&point| point <= x).count();
    let (h, a, b) = (h(i), points[i + 1] - x, x - points[i]);
    (moments[i] * a * a * a + moments[i + 1] * b * b * b) / (6.0 * h)
        + (values[i] / h - moments[i] * h / 6.0) * a
        + (values[i + 1] / h - moments[i + 1] * h / 6.0) * b
}

#[test]
fn splines_by_their_moments() {
    for x in sample_points().filter(|x| (X[0]..X[5]).contains(x)) {
        assert_close(NATURAL.value(x), spline_by_moments(TestEnds::Natural, &X, &F, x), 1e-14);
        assert_close(CLAMPED.value(x), spline_by_moments(TestEnds::Slopes, &X, &F, x), 1e-13);
        assert_close(NOT_A_KNOT.value(x), spline_by_moments(TestEnds::NotAKnot, &X, &F, x), 1e-13);
        for y in [10.3, 12.9, 16.0, 19.99] {
            for (spline, ends, tolerance) in
                [(NATURAL_2D, TestEnds::Natural, 1e-14), (NOT_A_KNOT_2D, TestEnds::NotAKnot, 1e-13)]
            {
                let rows: Vec<f64> = G.iter().map(|row| spline_by_moments(ends, &Y, row, y)).collect();
                assert_close(spline.value(x, y), spline_by_moments(ends, &X, &rows, x), tolerance);
            }
        }
    }
}

#[test]
fn end_conditions() {
    assert_eq!([X[0], X[5]].map(|x| CLAMPED.derivative(x)), SLOPES);
    assert_eq!([X[0] - 3.0, X[5] + 2.0].map(|x| CLAMPED.derivative(x)), SLOPES);
    for spline in [CLAMPED, NOT_A_KNOT] {
        for x in &X[1..5] {
            let sides = [x - 1e-9, x + 1e-9].map(|x| spline.partial([x], [2]));
            assert_close(sides[0], sides[1], 1e-6);
        }
    }
    for x in [X[1], X[4]] {
        let sides = [x - 1e-9, x + 1e-9].map(|x| NOT_A_KNOT.partial([x], [3]));
        assert_close(sides[0], sides[1], 1e-12);
    }
}

#[test]
fn splines_are_twice_continuously_differentiable_everywhere() {
    let step = 1e-9;
    for x in X {
        for order in 0..3 {
            let sides = [x - step, x + step].map(|x| NATURAL.partial([x], [order]));
            assert_close(sides[0], sides[1], 1e-7);
            for (y, other) in Y.into_iter().flat_map(|y| (0..3).map(move |other| (y, other))) {
                let sides = [x - step, x + step].map(|x| NATURAL_2D.partial([x, y], [order, other]));
                assert_close(sides[0], sides[1], 1e-7);
                let sides = [y - step, y + step].map(|y| NATURAL_2D.partial([x, y], [order, other]));
                assert_close(sides[0], sides[1], 1e-7);
            }
        }
    }
    let third = [0.4, 0.6].map(|x| NATURAL.partial([x], [3]));
    assert!((third[0] - third[1]).abs() > 1.0, "but not three times");
}

#[test]
fn all_tables_are_continued_linearly() {
    for (end, away) in [(X[0], -2.0), (X[5], 3.0)] {
        let x = end + away;
        assert_close(NATURAL.value(x), NATURAL.value(end) + away * NATURAL.derivative(end), 1e-14);
        assert_close(LINEAR.value(x), LINEAR.value(end) + away * LINEAR.derivative(end), 1e-14);
        assert_eq!([2, 3].map(|order| NATURAL.partial([x], [order])), [0.0; 2]);
        let inside = NATURAL_2D.value(end, 11.0) + away * NATURAL_2D.gradient(end, 11.0)[0];
        assert_close(NATURAL_2D.value(x, 11.0), inside, 1e-14);
        // Beyond a corner the function is bilinear.
        let corner = |i, j| NATURAL_2D.partial([end, Y[3]], [i, j]);
        let expected = corner(0, 0) + away * corner(1, 0) + 4.0 * corner(0, 1) + 4.0 * away * corner(1, 1);
        assert_close(NATURAL_2D.value(x, Y[3] + 4.0), expected, 1e-14);
    }
    assert!(NATURAL.value(f64::NAN).is_nan() && LINEAR_2D.value(0.0, f64::NAN).is_nan());
    assert!(NATURAL.value(1e300_f64).is_finite());
}

/// Compares derivatives with those of lower order, differentiated by hyper-dual numbers, by complex
/// numbers, and by differences of sixth order.
fn check_derivatives<const K: usize>(table: &impl Table<K>, orders: [u32; K], at: [f64; K]) {
    let value = |at: [f64; K]| table.partial(at, orders);
    for j in 0..K {
        let raised = |orders: [u32; K], by: usize| core::array::from_fn(|k| orders[k] + u32::from(k == by));
        let exact: f64 = table.partial(at, raised(orders, j));
        let complex: [Complex64; K] =
            core::array::from_fn(|k| Complex64::new(at[k], if k == j { 1e-200 } else { 0.0 }));
        assert_close(table.partial(complex, orders).im / 1e-200, exact, 1e-14);
        let dual: [Dual64; K] = core::array::from_fn(|k| Dual64::new(at[k], f64::from(u8::from(k == j))));
        assert_close(table.partial(dual, orders).eps, exact, 1e-14);
        let moved = |by: f64| value(core::array::from_fn(|k| if k == j { at[k] + by } else { at[k] }));
        let h = 1e-4;
        let difference = |n: f64| moved(n * h) - moved(-n * h);
        let difference = (45.0 * difference(1.0) - 9.0 * difference(2.0) + difference(3.0)) / (60.0 * h);
        assert_close(difference, exact, 1e-10);
        for l in 0..K {
            let exact: f64 = table.partial(at, raised(raised(orders, j), l));
            let hyper: [HyperDual64; K] = core::array::from_fn(|k| {
                let part = |of: usize| f64::from(u8::from(k == of));
                HyperDual64::new(at[k], part(j), part(l), 0.0)
            });
            assert_close(table.partial(hyper, orders).eps1eps2, exact, 1e-13);
        }
    }
}

#[test]
fn derivatives_agree_three_ways() {
    for x in sample_points() {
        for order in 0..3 {
            check_derivatives(&NATURAL, [order], [x]);
            check_derivatives(&CLAMPED, [order], [x]);
            check_derivatives(&NOT_A_KNOT, [order], [x]);
            check_derivatives(&LINEAR, [order], [x]);
        }
        for y in [7.0, 10.1, 14.0, 19.0, 25.0] {
            for orders in [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]] {
                check_derivatives(&NATURAL_2D, orders, [x, y]);
                check_derivatives(&NOT_A_KNOT_2D, orders, [x, y]);
                check_derivatives(&LINEAR_2D, orders, [x, y]);
            }
        }
    }
}

#[test]
fn registers_have_the_bits_of_numbers() {
    let list: Vec<f64> = sample_points().collect();
    for pair in list.windows(2) {
        let x = F64x2::<2>::load(&[pair[0], pair[1]]);
        let y = F64x2::<2>::load(&[11.0, 18.5]);
        for order in 0..4 {
            let lanes = NATURAL.partial([x], [order]).to_array();
            assert_eq!(lanes, [pair[0], pair[1]].map(|x| NATURAL.partial([x], [order])));
            let lanes = NATURAL_2D.partial([x, y], [order, 1]).to_array();
            assert_eq!(lanes[0], NATURAL_2D.partial([pair[0], 11.0], [order, 1]));
            assert_eq!(lanes[1], NATURAL_2D.partial([pair[1], 18.5], [order, 1]));
        }
        assert_eq!(LINEAR_2D.value(x, y).to_array()[1], LINEAR_2D.value(pair[1], 18.5));
    }
    for four in list.windows(4) {
        let x = [four[0], four[1], four[2], four[3]].map(|x| x as f32);
        let lanes = NATURAL.value(F32x4::<4>::load(&x)).to_array();
        assert_eq!(lanes, x.map(|x| NATURAL.value(x)));
        for (single, x) in lanes.into_iter().zip(x) {
            assert_close(f64::from(single), NATURAL.value(f64::from(x)), 1e-5);
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
#[should_panic(expected = "have to be finite")]
fn slopes_have_to_be_finite() {
    let _ = Spline::clamped([0.0, 1.0], [0.0, 1.0], [0.0, f64::INFINITY]);
}

#[test]
#[should_panic(expected = "too close for its values")]
fn slopes_of_close_points_have_to_be_finite() {
    let _ = Spline::natural([0.0, 1e-300, 1.0], [0.0, 1.0, 0.0]);
}

#[test]
#[should_panic(expected = "too close for its values")]
fn slopes_on_a_grid_have_to_be_finite() {
    let _ = Spline2::natural([0.0, 1.0, 2.0], [0.0, 1e-300, 1.0], [[0.0, 1.0, 4.0]; 3]);
}

#[test]
#[should_panic(expected = "too close for its values")]
fn slopes_of_linear_tables_have_to_be_finite() {
    let _ = Linear::new([0.0, 1e-310, 1.0], [0.0, 1.0, 0.0]);
}

#[test]
#[should_panic(expected = "at least two points")]
fn one_point_is_no_table() {
    let _ = Linear::new([0.0], [0.0]);
}
