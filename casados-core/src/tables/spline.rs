//! Cubic splines.

use super::cubic::{EndConditions, hermite_weights, slopes};
use super::points::{adjacent_pair, check_increasing, check_values, interval_index};
use super::{KNOTS, Table, cell_number};
use crate::scalar::{Real, Rows, Scalar};

/// A cubic spline: twice continuously differentiable, interpolates all points, extrapolated
/// linearly.
///
/// In each interval, with `s = (x − xᵢ)/h` and `r = 1 − s`,
///
/// ```text
/// f = r² (1 + 2s) fᵢ + s² (3 − 2s) fᵢ₊₁ + h s r² f′ᵢ − h s² r f′ᵢ₊₁
/// ```
///
/// with the slopes `f′ᵢ` that make `f″` continuous. The end conditions are:
///
/// | constructor | at the ends | beyond |
/// | --- | --- | --- |
/// | [`Spline::natural`] | `f″ = 0` | C² |
/// | [`Spline::clamped`] | `f′` is given | C¹: `f″` jumps to zero |
/// | [`Spline::not_a_knot`] | `f‴` is continuous at the points next to them | C¹ |
///
/// ```
/// use casados::tables::Spline;
///
/// const LIFT: Spline<5> = Spline::natural([-8.0, 0.0, 8.0, 12.0, 16.0], [-0.7, 0.2, 1.1, 1.4, 1.2]);
/// assert_eq!(LIFT.value(8.0), 1.1);
/// // The slope of the continuation.
/// assert_eq!(LIFT.derivative(16.0), LIFT.derivative(30.0));
///
/// /// Flat at both ends, and constant beyond them.
/// const VALVE: Spline<3> = Spline::clamped([0.0, 0.5, 1.0], [0.0, 0.5, 1.0], [0.0, 0.0]);
/// assert_eq!((VALVE.value(-3.0), VALVE.derivative(1.0), VALVE.value(7.0)), (0.0, 0.0, 1.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spline<const N: usize> {
    points: [f64; N],
    /// The value and slope at each point.
    nodes: [[f64; 2]; N],
}

impl<const N: usize> Spline<N> {
    /// The natural spline through values at increasing points: `f″ = 0` at both ends.
    ///
    /// # Panics
    /// If points do not increase, or a number or slope is not finite; in a `const` this is a
    /// compile-time error.
    #[must_use]
    pub const fn natural(points: [f64; N], values: [f64; N]) -> Self {
        check_increasing(&points);
        check_values(&values);
        Self::new(points, values, EndConditions::Natural)
    }

    /// The clamped spline through values at increasing points, with given first and last slope:
    /// minimal `∫ f″² dx` of all functions with these values and slopes.
    ///
    /// # Panics
    /// As [`Spline::natural`].
    #[must_use]
    pub const fn clamped(points: [f64; N], values: [f64; N], slopes: [f64; 2]) -> Self {
        check_increasing(&points);
        check_values(&values);
        check_values(&slopes);
        Self::new(points, values, EndConditions::Slopes(slopes))
    }

    /// The not-a-knot spline through values at increasing points: the first two pieces are one
    /// polynomial, and so are the last two. It reproduces cubic polynomials, and its error has
    /// order four up to the ends, where that of a natural spline has order two. For three points it
    /// is the parabola, for two the line.
    ///
    /// # Panics
    /// As [`Spline::natural`].
    #[must_use]
    pub const fn not_a_knot(points: [f64; N], values: [f64; N]) -> Self {
        check_increasing(&points);
        check_values(&values);
        Self::new(points, values, EndConditions::NotAKnot)
    }

    /// Callers check the points, so that compiler errors name the caller.
    const fn new(points: [f64; N], values: [f64; N], ends: EndConditions) -> Self {
        let slopes = slopes(&points, &values, ends);
        let mut nodes = [[0.0; 2]; N];
        let mut i = 0;
        while i < N {
            nodes[i] = [values[i], slopes[i]];
            i += 1;
        }
        Self { points, nodes }
    }

    /// `f(x)`
    #[inline]
    pub fn value<S: Scalar>(&self, x: S) -> S {
        self.partial([x], [0])
    }

    /// `f′(x)`
    #[inline]
    pub fn derivative<S: Scalar>(&self, x: S) -> S {
        self.partial([x], [1])
    }
}

impl<const N: usize> Rows<1, 6> for &Spline<N> {
    #[inline(always)]
    fn row<T: Real>(self, [x]: [T; 1]) -> [T; 6] {
        let i = interval_index(&self.points, x);
        let ([x0, x1], [[f0, m0], [f1, m1]]) =
            (adjacent_pair(&self.points, i), adjacent_pair(&self.nodes, i));
        [x0, x1, f0, f1, m0, m1].map(|&number| T::from_f64(number))
    }
}

impl<const N: usize> Table<1> for Spline<N> {
    #[inline(always)]
    fn partial<S: Scalar>(&self, [x]: [S; 1], [order]: [u32; 1]) -> S {
        let [x0, x1, f0, f1, m0, m1] = S::look_up([x], self);
        if order == KNOTS {
            return x0;
        }
        let [a0, a1, b0, b1] = hermite_weights(x, [x0, x1], order);
        (a0 * f0 + a1 * f1) + (b0 * m0 + b1 * m1)
    }
}

/// A function of two variables that is a cubic spline in each: the tensor product, twice
/// continuously differentiable, interpolates all points of a grid, extrapolated linearly in each
/// variable.
///
/// `values[i][j]` belongs to `x[i]` and `y[j]`.
///
/// ```
/// use casados::tables::Spline2;
///
/// const MAP: Spline2<3, 3> = Spline2::natural(
///     [0.0, 1.0, 2.0],
///     [0.0, 2.0, 4.0],
///     [[0.0, 1.0, 4.0], [1.0, 2.0, 5.0], [4.0, 5.0, 8.0]],
/// );
/// assert_eq!(MAP.value(1.0, 4.0), 5.0);
/// assert!((MAP.gradient(1.0, 2.0)[0] - 2.0_f64).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spline2<const N: usize, const M: usize> {
    x: [f64; N],
    y: [f64; M],
    /// `[f, f_x, f_y, f_xy]`
    nodes: [[[f64; 4]; M]; N],
}

impl<const N: usize, const M: usize> Spline2<N, M> {
    /// The natural spline through values on a grid of increasing points, as [`Spline::natural`] in
    /// each variable.
    ///
    /// # Panics
    /// If points do not increase, or a number or slope is not finite; in a `const` this is a
    /// compile-time error.
    #[must_use]
    pub const fn natural(x: [f64; N], y: [f64; M], values: [[f64; M]; N]) -> Self {
        check_increasing(&x);
        check_increasing(&y);
        Self::new(x, y, values, EndConditions::Natural)
    }

    /// The spline through values on a grid of increasing points, as [`Spline::not_a_knot`] in each
    /// variable.
    ///
    /// # Panics
    /// As [`Spline2::natural`].
    #[must_use]
    pub const fn not_a_knot(x: [f64; N], y: [f64; M], values: [[f64; M]; N]) -> Self {
        check_increasing(&x);
        check_increasing(&y);
        Self::new(x, y, values, EndConditions::NotAKnot)
    }

    const fn new(x: [f64; N], y: [f64; M], values: [[f64; M]; N], ends: EndConditions) -> Self {
        let mut along_x = [[0.0; M]; N];
        let mut j = 0;
        while j < M {
            let mut column = [0.0; N];
            let mut i = 0;
            while i < N {
                column[i] = values[i][j];
                i += 1;
            }
            check_values(&column);
            let slopes = slopes(&x, &column, ends);
            while i > 0 {
                i -= 1;
                along_x[i][j] = slopes[i];
            }
            j += 1;
        }
        let mut nodes = [[[0.0; 4]; M]; N];
        let mut i = 0;
        while i < N {
            let (along_y, along_both) = (slopes(&y, &values[i], ends), slopes(&y, &along_x[i], ends));
            let mut j = 0;
            while j < M {
                nodes[i][j] = [values[i][j], along_x[i][j], along_y[j], along_both[j]];
                j += 1;
            }
            i += 1;
        }
        Self { x, y, nodes }
    }

    /// `f(x, y)`
    #[inline]
    pub fn value<S: Scalar>(&self, x: S, y: S) -> S {
        self.partial([x, y], [0, 0])
    }

    /// `[∂f/∂x, ∂f/∂y]`
    #[inline]
    pub fn gradient<S: Scalar>(&self, x: S, y: S) -> [S; 2] {
        [self.partial([x, y], [1, 0]), self.partial([x, y], [0, 1])]
    }
}

impl<const N: usize, const M: usize> Rows<2, 20> for &Spline2<N, M> {
    #[inline(always)]
    fn row<T: Real>(self, [x, y]: [T; 2]) -> [T; 20] {
        let (i, j) = (interval_index(&self.x, x), interval_index(&self.y, y));
        let ([x0, x1], [y0, y1]) = (adjacent_pair(&self.x, i), adjacent_pair(&self.y, j));
        let [[f00, f01], [f10, f11]] = adjacent_pair(&self.nodes, i).map(|row| adjacent_pair(row, j));
        let numbers = [[*x0, *x1, *y0, *y1], *f00, *f01, *f10, *f11];
        let mut row = [T::ZERO; 20];
        for (to, &number) in row.iter_mut().zip(numbers.as_flattened()) {
            *to = T::from_f64(number);
        }
        row
    }
}

impl<const N: usize, const M: usize> Table<2> for Spline2<N, M> {
    #[inline(always)]
    fn partial<S: Scalar>(&self, [x, y]: [S; 2], orders: [u32; 2]) -> S {
        let row = S::look_up([x, y], self);
        let [x0, x1, y0, y1] = [row[0], row[1], row[2], row[3]];
        if orders[0] == KNOTS {
            return cell_number(x0, y0);
        }
        let [a0, a1, b0, b1] = hermite_weights(x, [x0, x1], orders[0]);
        let [c0, c1, d0, d1] = hermite_weights(y, [y0, y1], orders[1]);
        // The node `k` of the cell, by its value and its slope in x.
        let node = |k: usize, a: S, b: S| {
            let at = |n: usize| row[4 + 4 * k + n];
            [a * at(0) + b * at(1), a * at(2) + b * at(3)]
        };
        let [[f00, g00], [f01, g01]] = [node(0, a0, b0), node(1, a0, b0)];
        let [[f10, g10], [f11, g11]] = [node(2, a1, b1), node(3, a1, b1)];
        (c0 * (f00 + f10) + c1 * (f01 + f11)) + (d0 * (g00 + g10) + d1 * (g01 + g11))
    }
}
