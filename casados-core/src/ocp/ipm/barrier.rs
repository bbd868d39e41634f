//! How the barrier parameter shrinks.

use crate::qp::Residuals;
use crate::scalar::{Real, Scalar};

/// `κ_ε`: a barrier problem is solved well enough where its error is below this times `μ`.
const ENOUGH: f64 = 10.0;
/// `κ_μ`
const LINEAR: f64 = 0.2;
/// `θ_μ`
const SUPERLINEAR: f64 = 1.5;

/// `E_μ`: the largest residual of the conditions of the barrier problem.
pub(super) fn error(residuals: &Residuals, farthest: f64) -> f64 {
    let Residuals { stationarity, dynamics, inequalities, .. } = *residuals;
    [stationarity, dynamics, inequalities].into_iter().fold(farthest, larger)
}

/// The largest `|s λ − μ|`.
pub(super) fn farthest<T: Real>(slacks: &[T], multipliers: &[T], mu: f64) -> f64 {
    let products = slacks.iter().zip(multipliers);
    products.fold(0.0, |m, (&s, &l)| larger(m, (s.to_f64() * l.to_f64() - mu).abs()))
}

/// The larger one; NaN stays.
fn larger(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}

/// The next `μ` where the error is small enough for it.
pub(super) fn shrink(mu: f64, error: impl Fn(f64) -> f64, tolerance: f64) -> f64 {
    let (mut mu, least) = (mu, tolerance / 10.0);
    while mu > least && error(mu) <= ENOUGH * mu {
        mu = (LINEAR * mu).min(Scalar::powf(mu, SUPERLINEAR)).max(least);
    }
    mu
}

/// `τ`: slacks and multipliers keep `1 − τ` of what they have.
pub(super) fn fraction_to_boundary(mu: f64) -> f64 {
    (1.0 - mu).max(0.99)
}
