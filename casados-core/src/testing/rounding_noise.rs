//! Rounding noise of results, and comparisons that allow for it.
//!
//! The noise is sampled: the interval is repeated with every input changed by a few units in the
//! last place, which randomises all rounding errors (stochastic arithmetic: Vignes, "A stochastic
//! arithmetic for reliable scientific computation", 1993). The largest deviation of the samples
//! estimates the condition number times epsilon of each entry.

use super::bounded::Bounded;
use super::integrator::{CallResults, CheckedInterval};
use super::points::Random;
use super::report::{Entry, Report};
use crate::error::Error;
use crate::integrator::Integrator;
use crate::memory::{WithAdjoint, WithHessian};
use crate::model::Dae;
use std::string::String;
use std::vec::Vec;

/// The number of runs with changed inputs.
const SAMPLES: usize = 8;

/// Tolerance of a difference of two results, in sampled deviations. The largest of eight samples is
/// below one standard deviation once in twenty entries and below a quarter once in four hundred
/// thousand: 32 deviations are at least eight standard deviations.
pub(super) const MAX_DEVIATIONS: f64 = 32.0;

/// The largest deviation of each entry over all samples.
pub(super) fn measure_noise<M: Dae>(
    integrator: &mut impl Integrator<Model = M, Number = f64, Memory: WithHessian + WithAdjoint<1>>,
    interval: &CheckedInterval,
    lambda: &[f64],
    center: &CallResults,
) -> Result<CallResults, Error> {
    let mut random = Random::new(3);
    let mut noise = CallResults {
        states: center.states.iter().map(|_| 0.0).collect(),
        derivatives: center.derivatives.map(|_| 0.0),
        gradient: center.gradient.iter().map(|_| 0.0).collect(),
        hessian: center.hessian.map(|_| 0.0),
    };
    for _ in 0..SAMPLES {
        let mut change = |value: f64| value * (1.0 + f64::EPSILON * [-2.0, -1.0, 1.0, 2.0][random.below(4)]);
        let sample =
            CheckedInterval { w: interval.w.iter().map(|&w| change(w)).collect(), h: change(interval.h) };
        let answer = sample.hessian(integrator, lambda)?;
        let widen = |noise: &mut [f64], sample: &[f64], center: &[f64]| {
            for ((noise, sample), center) in noise.iter_mut().zip(sample).zip(center) {
                *noise = noise.max((sample - center).abs());
            }
        };
        widen(&mut noise.states, &answer.states, &center.states);
        widen(&mut noise.gradient, &answer.gradient, &center.gradient);
        widen(noise.derivatives.as_mut_slice(), answer.derivatives.as_slice(), center.derivatives.as_slice());
        widen(noise.hessian.as_mut_slice(), answer.hessian.as_slice(), center.hessian.as_slice());
    }
    Ok(noise)
}

/// Compares two results for the same quantity, up to the noise.
pub(super) fn compare_results(
    report: &mut Report,
    quantity: &'static str,
    reference: &'static str,
    values: &[f64],
    expected: &[f64],
    noise: &[f64],
    name: impl Fn(usize) -> String,
) {
    let entries = values.iter().zip(expected).zip(noise).map(|((&value, &expected), &noise)| Entry {
        value,
        expected,
        tolerance: MAX_DEVIATIONS * noise + 4.0 * f64::EPSILON * expected.abs(),
    });
    report.compare(quantity, reference, 0, largest_magnitude(expected), entries.enumerate(), name);
}

pub(super) fn compare_with_differences(
    report: &mut Report,
    quantity: &'static str,
    values: &[f64],
    differences: &[Bounded],
    noise: &[f64],
    name: impl Fn(usize) -> String,
) {
    let entries = values.iter().zip(differences).zip(noise).map(|((&value, d), &noise)| Entry {
        value,
        expected: d.value,
        tolerance: d.error + MAX_DEVIATIONS * noise + 4.0 * f64::EPSILON * value.abs(),
    });
    report.compare(quantity, "differences", 0, largest_magnitude(values), entries.enumerate(), name);
}

/// Values with their noise; NaN if the integrator failed, which differences skip.
pub(super) fn values_with_noise(values: Option<Vec<f64>>, noise: &[f64]) -> Vec<Bounded> {
    match values {
        Some(values) => values
            .iter()
            .zip(noise)
            .map(|(&value, &noise)| Bounded {
                value,
                error: MAX_DEVIATIONS * noise + f64::EPSILON * value.abs(),
            })
            .collect(),
        None => noise.iter().map(|_| Bounded { value: f64::NAN, error: f64::INFINITY }).collect(),
    }
}

pub(super) fn largest_magnitude(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |a, b| if b.is_finite() { f64::max(a, b.abs()) } else { a })
}
