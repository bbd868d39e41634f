//! Look-up tables and splines: functions of one or two variables that interpolate values.
//!
//! They are constants of a model, and `#[dae]`, `#[ode]` and `#[function]` support their methods:
//! first and second derivatives are exact, and the model remains an ordinary function.
//!
//! ```
//! use casados::prelude::*;
//! use casados::tables::{Linear2, Spline};
//!
//! /// Torque of a motor by its speed.
//! const TORQUE: Spline<5> =
//!     Spline::natural([0.0, 100.0, 200.0, 300.0, 400.0], [2.0, 2.4, 2.5, 2.1, 1.2]);
//! /// Losses by speed and torque.
//! const LOSSES: Linear2<2, 3> =
//!     Linear2::new([0.0, 400.0], [0.0, 1.0, 2.5], [[0.0, 0.1, 0.4], [0.3, 0.5, 1.1]]);
//!
//! #[ode]
//! fn motor(x: f64, u: f64) -> f64 {
//!     let torque = u * TORQUE.value(x);
//!     torque - LOSSES.value(x, torque)
//! }
//!
//! // At the points a table has its values, and between them it is smooth.
//! assert_eq!(TORQUE.value(300.0), 2.1);
//! assert!(TORQUE.derivative(200.0) < 0.0);
//! assert_eq!(motor(0.0, 0.5), 0.5 * 2.0 - 0.1);
//! ```
//!
//! | type | function | derivatives |
//! | --- | --- | --- |
//! | [`Linear`] | `(1 − s) fᵢ + s fᵢ₊₁` with `s = (x − xᵢ)/(xᵢ₊₁ − xᵢ)` | the first one jumps at the points |
//! | [`Linear2`] | bilinear in each cell | the first ones jump at the lines of the grid |
//! | [`Spline`] | the cubic spline: natural (minimal `∫ f″² dx` of all functions through the points), clamped (given slopes at its ends), or not-a-knot | C²; the third one jumps |
//! | [`Spline2`] | the tensor product of cubic splines, natural or not-a-knot | C² |
//!
//! **Extrapolation** is linear in each variable. Natural splines remain C², since `f″ = 0` at their
//! ends; the second derivative of other splines jumps there. For constant extrapolation repeat the
//! last value of a linear table, or clamp a spline with slope zero.
//!
//! **Kinks.** At a point of a linear table the derivative is that of the piece to its right. Steps
//! across a kink lose their order: adaptive implicit methods detect kinks and reduce the step size.
//! Splines have no kinks.
//!
//! Points that do not increase and numbers that are not finite are compile-time errors in a
//! `const`.

mod cubic;
mod linear;
mod points;
mod spline;
#[cfg(all(test, feature = "testing"))]
mod tests;

pub use linear::{Linear, Linear2};
pub use spline::{Spline, Spline2};

use crate::scalar::Scalar;

/// A function of `K` variables with all of its derivatives: the interface for emitted code.
#[doc(hidden)]
#[diagnostic::on_unimplemented(
    message = "`{Self}` is no table of `casados::tables` with so many variables: {K}",
    note = "`value` of a `Linear` or `Spline` takes one argument, that of a `Linear2` or `Spline2` two"
)]
pub trait Table<const K: usize> {
    /// The derivative of these orders in each variable: of zeros the value; of [`KINKS`] or
    /// [`KNOTS`] a number that identifies the piece.
    fn partial<S: Scalar>(&self, at: [S; K], orders: [u32; K]) -> S;
}

/// An order for which `partial` returns a number that identifies the piece, if the first derivative
/// jumps between pieces; otherwise zero.
pub(crate) const KINKS: u32 = 254;
/// As [`KINKS`], if a higher derivative jumps.
pub(crate) const KNOTS: u32 = 255;

/// A number that identifies a cell, by its lower left corner.
#[inline(always)]
fn cell_number<S: Scalar>(x0: S, y0: S) -> S {
    x0 + S::from_f64(core::f64::consts::SQRT_2) * y0
}

impl<const K: usize, T: Table<K>> Table<K> for &T {
    #[inline(always)]
    fn partial<S: Scalar>(&self, at: [S; K], orders: [u32; K]) -> S {
        T::partial(self, at, orders)
    }
}
