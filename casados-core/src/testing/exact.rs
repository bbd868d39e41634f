//! Checks of an integrator against an exact solution.

use super::integrator::CheckedInterval;
use super::names::{direction_name, second_derivative_name, state_name};
use super::report::{Entry, Report};
use super::rounding_noise::{MAX_DEVIATIONS, largest_magnitude, measure_noise};
use super::sensitivities::warn_outside_ranges;
use crate::error::Error;
use crate::integrator::Integrator;
use crate::memory::{WithAdjoint, WithHessian};
use crate::model::{Dae, VectorP, VectorU, VectorX};
use crate::shape::Shape;
use core::any::type_name;
use nalgebra::DMatrix;
use std::format;
use std::string::String;
use std::vec::Vec;

/// An exact solution: the end state and its known derivatives with respect to `w = (x₀, u, p)`.
///
/// ```
/// # use casados::testing::Exact;
/// // x₊ = x₀ e^(−p h) of `ẋ = −p x` at x₀ = 2, p = 0.5, h = 1, by w = (x₀, p).
/// let e = (-0.5_f64).exp();
/// let exact = Exact {
///     states: vec![2.0 * e],
///     first: vec![vec![e, -2.0 * e]],
///     ..Exact::default() // second derivatives are not known
/// };
/// assert_eq!(exact.first[0].len(), 2);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Exact {
    /// `x` at the end of the interval, followed by `z` if known.
    pub states: Vec<f64>,
    /// `∂(x, z)/∂w`, a row per state; empty if not known.
    pub first: Vec<Vec<f64>>,
    /// `∂²x_i/∂w²` for each state; empty if not known.
    pub second: Vec<Vec<Vec<f64>>>,
}

/// Checks an integrator against an exact solution, with first and second derivatives.
///
/// `coarse` takes fewer steps than `fine`: the difference between the two estimates the
/// discretisation error of `fine`, of which it is a multiple in the asymptotic range. The tolerance
/// is this difference plus the sampled rounding error.
///
/// ```
/// use casados::prelude::*;
/// use casados::testing::{Exact, check_exact};
/// use nalgebra::{Vector1, vector};
///
/// /// Its solution is x₀ e^(−p t).
/// #[ode]
/// fn decay(x: f64, p: f64) -> f64 {
///     -p * x
/// }
///
/// let (x0, p, h): (f64, f64, f64) = (2.0, 0.5, 1.0);
/// let e = (-p * h).exp();
/// let exact = Exact {
///     states: vec![x0 * e],
///     // By (x₀, p), and twice.
///     first: vec![vec![e, -h * x0 * e]],
///     second: vec![vec![vec![0.0, -h * e], vec![-h * e, h * h * x0 * e]]],
/// };
/// let integrator = |steps| Irk::<Decay, Gauss<3>>::new(Options { steps, ..Default::default() });
/// let (mut coarse, mut fine) = (integrator(4)?, integrator(8)?);
/// let report =
///     check_exact(&mut coarse, &mut fine, &Vector1::new(x0), &vector![], &Vector1::new(p), h, &exact)?;
/// report.assert();
/// # Ok::<(), casados::Error>(())
/// ```
pub fn check_exact<M: Dae, I: Integrator<Model = M, Number = f64, Memory: WithHessian + WithAdjoint<1>>>(
    coarse: &mut I,
    fine: &mut I,
    x0: &VectorX<M, f64>,
    u: &VectorU<M, f64>,
    p: &VectorP<M, f64>,
    h: f64,
    exact: &Exact,
) -> Result<Report, Error> {
    let interval = CheckedInterval::new::<M>(x0, u, p, h);
    let (nx, nw) = (M::Shape::NX, M::Shape::NW);
    let mut report = Report::new(format!("{} against the exact solution", type_name::<I>()));
    // Elimination is stable in norm only: the error of a small entry may be a few ε of the largest
    // one. Samples do not show this for a linear model, since its matrices are constant. Rounding
    // errors of ε/2 in each of n steps accumulate to about √n ε/2: 3ε after 32 steps. The tolerance
    // is 4ε, as in other comparisons.
    let largest_first = exact.first.iter().map(|row| largest_magnitude(row)).fold(0.0, f64::max);
    let largest_second = exact.second.iter().flatten().map(|row| largest_magnitude(row)).fold(0.0, f64::max);
    for i in 0..nx {
        let lambda: Vec<f64> = (0..nx).map(|j| f64::from(u8::from(i == j))).collect();
        let answer = interval.hessian(fine, &lambda)?;
        if i == 0 {
            warn_outside_ranges::<M>(&mut report, &answer.states);
        }
        let rough = interval.hessian(coarse, &lambda)?;
        let noise = measure_noise(fine, &interval, &lambda, &answer)?;
        let mut compare = |quantity,
                           own: &[f64],
                           rough: &[f64],
                           noise: &[f64],
                           exact: &[f64],
                           scale: f64,
                           name: &dyn Fn(usize) -> String| {
            let floor = 4.0 * f64::EPSILON * scale;
            let entries = exact.iter().enumerate().map(|(k, &expected)| {
                let tolerance = (own[k] - rough[k]).abs() + MAX_DEVIATIONS * noise[k] + floor;
                (k, Entry { value: own[k], expected, tolerance })
            });
            report.compare(quantity, "exact", 0, largest_magnitude(exact), entries, name);
        };
        if i == 0 {
            compare(
                "state",
                &answer.states,
                &rough.states,
                &noise.states,
                &exact.states,
                largest_magnitude(&exact.states),
                &|k| state_name::<M>(k),
            );
            for (row, first) in exact.first.iter().enumerate() {
                let of = |m: &DMatrix<f64>| m.row(row).iter().copied().collect::<Vec<_>>();
                let (own, rough) = (of(&answer.derivatives), of(&rough.derivatives));
                compare("derivative", &own, &rough, &of(&noise.derivatives), first, largest_first, &|k| {
                    format!("{} by {}", state_name::<M>(row), direction_name::<M>(k))
                });
            }
        }
        if let Some(first) = exact.first.get(i) {
            compare(
                "gradient",
                &answer.gradient,
                &rough.gradient,
                &noise.gradient,
                first,
                largest_first,
                &|k| format!("{} by {}", state_name::<M>(i), direction_name::<M>(k)),
            );
        }
        if let Some(second) = exact.second.get(i) {
            // Symmetric: row-major and column-major order are equal.
            let flat: Vec<f64> = second.iter().take(nw).flatten().copied().collect();
            let (own, rough) = (answer.hessian.as_slice(), rough.hessian.as_slice());
            compare("second derivative", own, rough, noise.hessian.as_slice(), &flat, largest_second, &|k| {
                format!("{} {}", state_name::<M>(i), second_derivative_name::<M>(k))
            });
        }
    }
    Ok(report)
}
