//! Errors of consistent states.

use crate::error::Argument;
use core::fmt;

/// The reason why [`Consistent`](super::Consistent) found no states.
///
/// ```
/// # use casados::prelude::*;
/// # use casados::{Consistent, Constrained, Inconsistent};
/// # use nalgebra::vector;
/// # /// A pendulum of 1 m in Cartesian coordinates: positions, velocities; z is the tension.
/// # #[dae(index_reduction(baumgarte = 2.0))]
/// # fn pendulum(xdot: [f64; 4], x: [f64; 4], z: f64) -> [f64; 5] {
/// #     [
/// #         xdot[0] - x[2],
/// #         xdot[1] - x[3],
/// #         xdot[2] + z * x[0],
/// #         xdot[3] + z * x[1] + 9.81,
/// #         x[0] * x[0] + x[1] * x[1] - 1.0,
/// #     ]
/// # }
/// let start = Consistent::<Pendulum>::new();
/// assert!(matches!(start.clone().hold("x[7]"), Err(Inconsistent::NoSuchState { name: "x[7]" })));
/// let guess = vector![f64::NAN, -0.8, 0.0, 0.0];
/// let error = start.solve(&guess, &vector![], 0.0).unwrap_err();
/// assert!(matches!(error, Inconsistent::NonFiniteInput { name: "x[0]", .. }));
/// println!("{error}");
/// # Ok::<(), casados::Inconsistent>(())
/// ```
#[derive(Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Inconsistent {
    /// No state has this name.
    NoSuchState {
        /// The unknown name.
        name: &'static str,
    },
    /// An input has an element that is infinite or NaN.
    NonFiniteInput {
        /// The input.
        argument: Argument,
        /// Index of the element.
        index: usize,
        /// Name of the element in the model; empty for the time.
        name: &'static str,
        /// Value of the element.
        value: f64,
    },
    /// An invariant or one of its derivatives is infinite or NaN.
    NonFinite {
        /// Equation of the constraint that the invariant comes from.
        equation: u32,
        /// Order of the derivative of the constraint.
        derivative: u32,
        /// The value.
        value: f64,
    },
    /// The derivatives of an invariant by the free states depend linearly on those of the preceding
    /// invariants.
    Dependent {
        /// Equation of the constraint that the invariant comes from.
        equation: u32,
        /// Order of the derivative of the constraint.
        derivative: u32,
        /// Violation of the invariant.
        residual: f64,
    },
    /// The iteration did not converge.
    NotConverged {
        /// Equation of the constraint with the largest violation.
        equation: u32,
        /// Order of the derivative of the constraint.
        derivative: u32,
        /// The largest violation.
        residual: f64,
    },
}

/// Displays an invariant by its equation.
struct Invariant(u32, u32);

impl fmt::Display for Invariant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.1 {
            0 => write!(f, "the constraint of equation {}", self.0),
            1 => write!(f, "the derivative of the constraint of equation {}", self.0),
            order => write!(f, "derivative {order} of the constraint of equation {}", self.0),
        }
    }
}

impl fmt::Display for Inconsistent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NoSuchState { name } => {
                write!(f, "no state is called `{name}`: `describe()` of the model lists the names")
            }
            Self::NonFiniteInput { argument, name: "", value, .. } => write!(f, "{argument} is {value}"),
            Self::NonFiniteInput { argument, name, value, .. } => {
                write!(f, "`{name}` of {argument} is {value}")
            }
            Self::NonFinite { equation, derivative, value } => {
                write!(f, "{} is {value}: take another guess", Invariant(equation, derivative))
            }
            Self::Dependent { equation, derivative, residual } => write!(
                f,
                "{} is violated by {residual:e}: the free states cannot change it independently of the other \
                 constraints. Hold fewer states, or take another guess",
                Invariant(equation, derivative)
            ),
            Self::NotConverged { equation, derivative, residual } => write!(
                f,
                "no consistent state was found: {} is violated by {residual:e}. Take a guess closer to the constraints, \
                 or hold other states",
                Invariant(equation, derivative)
            ),
        }
    }
}

debug_is_display!(Inconsistent);

impl core::error::Error for Inconsistent {}
