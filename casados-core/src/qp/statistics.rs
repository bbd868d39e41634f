//! What a solver tells about its work.

use core::fmt;

/// How far a point is from the conditions of optimality: the largest element of each of the four.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Residuals {
    /// Gradient of the Lagrangian.
    pub stationarity: f64,
    /// `A x + B u + b − x₊`
    pub dynamics: f64,
    /// Violation of bounds and general constraints, and of the signs of multipliers.
    pub inequalities: f64,
    /// Products of slacks and multipliers.
    pub complementarity: f64,
}

impl Residuals {
    /// The largest of them; NaN if one of them is.
    #[must_use]
    pub fn largest(&self) -> f64 {
        let all = [self.stationarity, self.dynamics, self.inequalities, self.complementarity];
        all.into_iter().fold(0.0, larger)
    }
}

/// The larger of two numbers; NaN if one of them is.
#[inline(always)]
pub(crate) fn larger<T: PartialOrd>(a: T, b: T) -> T {
    // What is not equal to itself is NaN.
    #[allow(clippy::eq_op)]
    let keeps = b <= a || a != a;
    if keeps { a } else { b }
}

/// A number, or zero in place of a negative one; NaN stays.
#[inline(always)]
pub(crate) fn positive<T: PartialOrd + Default>(a: T) -> T {
    larger(T::default(), a)
}

impl fmt::Display for Residuals {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "stationarity {:.1e}, dynamics {:.1e}, inequalities {:.1e}, complementarity {:.1e}",
            self.stationarity, self.dynamics, self.inequalities, self.complementarity
        )
    }
}

/// What a solution took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct QpStatistics {
    /// Newton's steps with a matrix of their own: active sets, and iterations of the interior
    /// point.
    pub iterations: usize,
    /// How many of them tried an active set.
    pub active_sets: usize,
    /// Factorisations.
    pub factorisations: usize,
    /// Solves that corrected a solution for rounding errors and regularisation.
    pub refinements: usize,
    /// Pivots that were too small and were made larger.
    pub regularised: usize,
    /// How well the conditions of optimality hold.
    pub residuals: Residuals,
    /// `½ vᵀ H v + hᵀ v`, with penalties of soft constraints.
    pub objective: f64,
}
