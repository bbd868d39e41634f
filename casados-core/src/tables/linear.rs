//! Linear tables.

use super::points::{adjacent_pair, check_increasing, check_linear_slopes, check_values, interval_index};
use super::{KINKS, Table, cell_number};
use crate::scalar::{Real, Rows, Scalar};

/// A piecewise linear function, extrapolated linearly.
///
/// ```
/// use casados::tables::Linear;
///
/// const SPRING: Linear<4> = Linear::new([-1.0, 0.0, 1.0, 3.0], [-2.0, 0.0, 1.0, 2.0]);
/// assert_eq!(SPRING.value(2.0), 1.5);
/// assert_eq!(SPRING.value(5.0), 3.0);
/// assert_eq!((SPRING.derivative(-0.1), SPRING.derivative(0.0)), (2.0, 1.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear<const N: usize> {
    points: [f64; N],
    values: [f64; N],
}

impl<const N: usize> Linear<N> {
    /// A table of values at increasing points.
    ///
    /// # Panics
    /// If points do not increase, or a number or slope is not finite; in a `const` this is a
    /// compile-time error.
    #[must_use]
    pub const fn new(points: [f64; N], values: [f64; N]) -> Self {
        check_increasing(&points);
        check_values(&values);
        check_linear_slopes(&points, &values);
        Self { points, values }
    }

    /// `f(x)`
    #[inline]
    pub fn value<S: Scalar>(&self, x: S) -> S {
        self.partial([x], [0])
    }

    /// `f′(x)`; at a point, of the piece to its right.
    #[inline]
    pub fn derivative<S: Scalar>(&self, x: S) -> S {
        self.partial([x], [1])
    }
}

impl<const N: usize> Rows<1, 4> for &Linear<N> {
    #[inline(always)]
    fn row<T: Real>(self, [x]: [T; 1]) -> [T; 4] {
        let i = interval_index(&self.points, x);
        let ([x0, x1], [f0, f1]) = (adjacent_pair(&self.points, i), adjacent_pair(&self.values, i));
        [x0, x1, f0, f1].map(|&number| T::from_f64(number))
    }
}

impl<const N: usize> Table<1> for Linear<N> {
    #[inline(always)]
    fn partial<S: Scalar>(&self, [x]: [S; 1], [order]: [u32; 1]) -> S {
        let [x0, x1, f0, f1] = S::look_up([x], self);
        if order == KINKS {
            return x0;
        }
        let [a, b] = linear_weights(x, [x0, x1], order);
        a * f0 + b * f1
    }
}

/// A function of two variables that is bilinear in every cell of a grid, extrapolated in the same
/// way.
///
/// `values[i][j]` belongs to `x[i]` and `y[j]`.
///
/// ```
/// use casados::tables::Linear2;
///
/// const MAP: Linear2<2, 3> = Linear2::new([0.0, 1.0], [0.0, 2.0, 3.0], [[0.0, 2.0, 2.0], [1.0, 3.0, 0.0]]);
/// assert_eq!(MAP.value(0.5, 1.0), 1.5);
/// assert_eq!(MAP.gradient(0.5, 2.5), [-0.5, -1.5]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear2<const N: usize, const M: usize> {
    x: [f64; N],
    y: [f64; M],
    values: [[f64; M]; N],
}

impl<const N: usize, const M: usize> Linear2<N, M> {
    /// A table of values on a grid of increasing points.
    ///
    /// # Panics
    /// If points do not increase, or a number or slope is not finite; in a `const` this is a
    /// compile-time error.
    #[must_use]
    pub const fn new(x: [f64; N], y: [f64; M], values: [[f64; M]; N]) -> Self {
        check_increasing(&x);
        check_increasing(&y);
        let mut i = 0;
        while i < N {
            check_values(&values[i]);
            check_linear_slopes(&y, &values[i]);
            i += 1;
        }
        let mut j = 0;
        while j < M {
            let mut column = [0.0; N];
            let mut i = 0;
            while i < N {
                column[i] = values[i][j];
                i += 1;
            }
            check_linear_slopes(&x, &column);
            j += 1;
        }
        Self { x, y, values }
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

impl<const N: usize, const M: usize> Rows<2, 8> for &Linear2<N, M> {
    #[inline(always)]
    fn row<T: Real>(self, [x, y]: [T; 2]) -> [T; 8] {
        let (i, j) = (interval_index(&self.x, x), interval_index(&self.y, y));
        let ([x0, x1], [y0, y1]) = (adjacent_pair(&self.x, i), adjacent_pair(&self.y, j));
        let [[f00, f01], [f10, f11]] = adjacent_pair(&self.values, i).map(|row| adjacent_pair(row, j));
        [x0, x1, y0, y1, f00, f01, f10, f11].map(|&number| T::from_f64(number))
    }
}

impl<const N: usize, const M: usize> Table<2> for Linear2<N, M> {
    #[inline(always)]
    fn partial<S: Scalar>(&self, [x, y]: [S; 2], orders: [u32; 2]) -> S {
        let [x0, x1, y0, y1, f00, f01, f10, f11] = S::look_up([x, y], self);
        if orders[0] == KINKS {
            return cell_number(x0, y0);
        }
        let [a0, a1] = linear_weights(x, [x0, x1], orders[0]);
        let [b0, b1] = linear_weights(y, [y0, y1], orders[1]);
        a0 * (b0 * f00 + b1 * f01) + a1 * (b0 * f10 + b1 * f11)
    }
}

/// The weights of the values at the ends of a linear piece in its value or derivative.
#[inline(always)]
fn linear_weights<S: Scalar>(x: S, [x0, x1]: [S; 2], order: u32) -> [S; 2] {
    let (one, h) = (S::from_f64(1.0), x1 - x0);
    match order {
        0 => {
            let s = (x - x0) / h;
            [one - s, s]
        }
        1 => {
            let slope = one / h;
            [-slope, slope]
        }
        _ => [S::from_f64(0.0); 2],
    }
}
