//! Look-up tables and splines: functions of one or two variables that interpolate numbers.
//!
//! They are constants of a model, and methods that `#[dae]`, `#[ode]` and `#[function]` know: first
//! and second derivatives are exact, and the function stays one that can be called.
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
//! | [`Linear2`] | the same in both variables: bilinear in each cell | likewise |
//! | [`Spline`] | the cubic spline: natural (of all functions through the points that with the least `∫ f″² dx`), with given slopes at its ends, or not-a-knot | C²; the third one jumps |
//! | [`Spline2`] | the tensor product of cubic splines, natural or not-a-knot | C² |
//!
//! **Outside of the points** all of them are continued linearly, in each variable: finite, and as
//! smooth as inside, but for splines that are not natural: a natural one has `f″ = 0` at its ends,
//! so that it stays C², where the second derivative of the others jumps. A linear table that should
//! stay constant has its last value twice; a spline is clamped with the slope zero.
//!
//! **Where a linear table has a kink** its derivative is that of the piece on the right. Steps
//! across one lose their order: adaptive implicit methods see them and take shorter ones. A spline
//! has none.
//!
//! Points that do not increase and numbers that are not finite are errors of the compiler in a
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

/// A function of `K` variables with all of its derivatives: what emitted code calls.
#[doc(hidden)]
#[diagnostic::on_unimplemented(
    message = "`{Self}` is no table of `casados::tables` with so many variables: {K}",
    note = "`value` of a `Linear` or `Spline` takes one argument, that of a `Linear2` or `Spline2` two"
)]
pub trait Table<const K: usize> {
    /// The derivative of these orders in each variable: of zeros the value; of [`KINKS`] or
    /// [`KNOTS`] what tells its pieces apart.
    fn partial<S: Scalar>(&self, at: [S; K], orders: [u32; K]) -> S;
}

/// An order that stands for a number of each piece, where the first derivative jumps between them;
/// else zero.
pub(crate) const KINKS: u32 = 254;
/// The same where a higher derivative jumps.
pub(crate) const KNOTS: u32 = 255;

/// A number of a cell, by its lower left corner.
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
