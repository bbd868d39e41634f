//! Checks of the sensitivities of an integrator against each other and against differences.

use super::bounded::Bounded;
use super::differences;
use super::integrator::{CallResults, CheckedInterval};
use super::names::{derivative_name, direction_name, second_derivative_name, state_name};
use super::points::Random;
use super::report::{Entry, Report};
use super::rounding_noise::{
    MAX_DEVIATIONS, compare_results, compare_with_differences, largest_magnitude, measure_noise,
    values_with_noise,
};
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

/// Checks one interval of an integrator:
/// - repeated calls are bitwise equal, and all calls agree in their common results;
/// - forward sensitivities agree with differences of the solution, and adjoint ones with both
///   (`λᵀ (S v) = (Sᵀ λ)ᵀ v` for all `v`);
/// - the Hessian is symmetric, and agrees with differences of the gradient.
///
/// The report has a warning if a differential or algebraic state is outside of its `range(..)` of
/// the model: the integrator may have found an unintended root of the equations.
///
/// # Errors
/// Those of the integrator at the given inputs.
///
/// ```
/// use casados::prelude::*;
/// use casados::testing::check_sensitivities;
/// use nalgebra::vector;
///
/// #[ode]
/// fn pendulum(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0] - 9.81 * x[0].sin()]
/// }
///
/// let mut irk = Irk::<Pendulum, Gauss<2>>::new(Options::default())?;
/// check_sensitivities(&mut irk, &vector![0.3, 0.0], &vector![0.5], &Default::default(), 0.1)?.assert();
/// # Ok::<(), casados::Error>(())
/// ```
pub fn check_sensitivities<
    M: Dae,
    I: Integrator<Model = M, Number = f64, Memory: WithHessian + WithAdjoint<1>>,
>(
    integrator: &mut I,
    x0: &VectorX<M, f64>,
    u: &VectorU<M, f64>,
    p: &VectorP<M, f64>,
    h: f64,
) -> Result<Report, Error> {
    let interval = CheckedInterval::new::<M>(x0, u, p, h);
    let mut random = Random::new(7);
    let lambda: Vec<f64> = (0..M::Shape::NX).map(|_| random.symmetric()).collect();
    let mut report = Report::new(format!("sensitivities of {}", type_name::<I>()));

    let solved = interval.solve(integrator)?;
    warn_outside_ranges::<M>(&mut report, &solved);
    let (states, derivatives) = interval.forward(integrator)?;
    let (adjoint_states, gradient) = interval.adjoint(integrator, &lambda)?;
    let all = interval.hessian(integrator, &lambda)?;

    let first =
        CallRecord { states: &solved, derivatives: &derivatives, gradient: &gradient, combined_call: &all };
    first.check_repeated_calls(&mut report, integrator, &interval, &lambda)?;

    let noise = measure_noise(integrator, &interval, &lambda, &all)?;
    let state = |i| state_name::<M>(i);
    compare_results(&mut report, "state", "solve", &states, &solved, &noise.states, state);
    compare_results(&mut report, "state of adjoint", "solve", &adjoint_states, &solved, &noise.states, state);
    compare_results(&mut report, "state of hessian", "solve", &all.states, &solved, &noise.states, state);
    let entry = |i| derivative_name::<M>(i);
    let (values, bounds) = (all.derivatives.as_slice(), noise.derivatives.as_slice());
    compare_results(
        &mut report,
        "forward of hessian",
        "forward",
        values,
        derivatives.as_slice(),
        bounds,
        entry,
    );
    compare_results(
        &mut report,
        "adjoint of hessian",
        "adjoint",
        &all.gradient,
        &gradient,
        &noise.gradient,
        |i| format!("by {}", direction_name::<M>(i)),
    );

    // `λᵀ S`, with the noise of both sides.
    let nx = M::Shape::NX;
    let product = |s: &DMatrix<f64>, absolute: bool| -> Vec<f64> {
        (0..M::Shape::NW)
            .map(|j| {
                let terms = lambda.iter().enumerate().map(|(i, lambda)| lambda * s[(i, j)]);
                if absolute { terms.map(f64::abs).sum() } else { terms.sum() }
            })
            .collect()
    };
    let rounding: Vec<f64> = product(&derivatives, true)
        .iter()
        .zip(product(&noise.derivatives, true))
        .zip(&noise.gradient)
        .map(|((magnitude, forward), adjoint)| nx as f64 * f64::EPSILON * magnitude + forward + adjoint)
        .collect();
    compare_results(
        &mut report,
        "adjoint",
        "forward",
        &gradient,
        &product(&derivatives, false),
        &rounding,
        |i| format!("by {}", direction_name::<M>(i)),
    );

    let transposed = all.hessian.transpose();
    let entries = all.hessian.iter().zip(transposed.iter()).map(|(&value, &expected)| Entry {
        value,
        expected,
        tolerance: 0.0,
    });
    let scale = largest_magnitude(all.hessian.as_slice());
    report.compare("Hessian", "its transpose", 0, scale, entries.enumerate(), second_derivative_name::<M>);

    first.check_differences(&mut report, integrator, &interval, (&lambda, &noise));
    Ok(report)
}

/// The results of the calls.
struct CallRecord<'a> {
    states: &'a [f64],
    derivatives: &'a DMatrix<f64>,
    gradient: &'a [f64],
    combined_call: &'a CallResults,
}

impl CallRecord<'_> {
    /// Checks that repeated calls are bitwise equal.
    fn check_repeated_calls<M: Dae>(
        &self,
        report: &mut Report,
        integrator: &mut impl Integrator<Model = M, Number = f64, Memory: WithHessian + WithAdjoint<1>>,
        interval: &CheckedInterval,
        lambda: &[f64],
    ) -> Result<(), Error> {
        let same = |report: &mut Report, quantity, a: &[f64], b: &[f64]| {
            let bits = |v: f64| v.to_bits();
            let entries = a.iter().zip(b).map(|(&value, &expected)| Entry {
                value: if bits(value) == bits(expected) { expected } else { value },
                expected,
                tolerance: if bits(value) == bits(expected) { 0.0 } else { -1.0 },
            });
            report.compare(quantity, "the call before", 0, 0.0, entries.enumerate(), |i| {
                format!("element {i}")
            });
        };
        same(report, "solve", &interval.solve(integrator)?, self.states);
        same(report, "forward", interval.forward(integrator)?.1.as_slice(), self.derivatives.as_slice());
        same(report, "adjoint", &interval.adjoint(integrator, lambda)?.1, self.gradient);
        same(
            report,
            "hessian",
            interval.hessian(integrator, lambda)?.hessian.as_slice(),
            self.combined_call.hessian.as_slice(),
        );
        Ok(())
    }

    /// Checks differences of states and of gradients in several directions.
    fn check_differences<M: Dae>(
        &self,
        report: &mut Report,
        integrator: &mut impl Integrator<Model = M, Number = f64, Memory: WithHessian + WithAdjoint<1>>,
        interval: &CheckedInterval,
        (lambda, noise): (&[f64], &CallResults),
    ) {
        for direction in directions::<M>(interval) {
            let moved = |value: Bounded| CheckedInterval {
                w: interval.w.iter().zip(&direction.seed).map(|(w, d)| w + value.value * d).collect(),
                h: interval.h,
            };
            let by_solve = differences::derivative(0.0, self.states.len(), |value| {
                values_with_noise(moved(value).solve(integrator).ok(), &noise.states)
            });
            let (own, bounds) = direction.directional_derivatives(self.derivatives, &noise.derivatives);
            compare_with_differences(report, "forward", &own, &by_solve, &bounds, |i| {
                format!("{} by {}", state_name::<M>(i), direction.name)
            });
            let by_adjoint = differences::derivative(0.0, M::Shape::NW, |value| {
                values_with_noise(moved(value).adjoint(integrator, lambda).ok().map(|a| a.1), &noise.gradient)
            });
            let (own, bounds) =
                direction.directional_derivatives(&self.combined_call.hessian, &noise.hessian);
            compare_with_differences(report, "Hessian", &own, &by_adjoint, &bounds, |i| {
                format!("by {} and {}", direction_name::<M>(i), direction.name)
            });
        }
    }
}

/// Adds a warning for states `(x, z, z0)` outside of the ranges of the model.
pub(super) fn warn_outside_ranges<M: Dae>(report: &mut Report, states: &[f64]) {
    let (nx, nz) = (M::Shape::NX, M::Shape::NZ);
    for (i, &value) in states.iter().enumerate() {
        let variable = nx + if i < nx + nz { i } else { i - nz };
        let Some(range) = M::RANGES.get(variable).filter(|range| !range.contains(value)) else { continue };
        let (name, crate::model::Range { low, high }) = (state_name::<M>(i), range);
        let root = if i < nx {
            ""
        } else {
            ": if this is another root, give start values, `nominal(z = ..)` or `set_start`"
        };
        report.warnings.push(format!("{name} is {value:e}, outside of its range {low:e}..={high:e}{root}"));
    }
}

/// A direction of differences in the space of `w`.
struct Direction {
    name: String,
    seed: Vec<f64>,
}

/// The unit vectors for small models; random directions, in which every entry takes part, for large
/// ones.
fn directions<M: Dae>(interval: &CheckedInterval) -> Vec<Direction> {
    const MAX_UNIT_DIRECTIONS: usize = 12;
    const RANDOM_DIRECTIONS: usize = 4;
    let size = |w: f64| w.abs().max(1.0);
    if M::Shape::NW <= MAX_UNIT_DIRECTIONS {
        return (0..M::Shape::NW)
            .map(|j| Direction {
                name: direction_name::<M>(j),
                seed: (0..M::Shape::NW).map(|i| f64::from(u8::from(i == j))).collect(),
            })
            .collect();
    }
    let mut random = Random::new(11);
    (0..RANDOM_DIRECTIONS)
        .map(|number| Direction {
            name: format!("random direction {number}"),
            seed: interval.w.iter().map(|&w| random.symmetric() * size(w)).collect(),
        })
        .collect()
}

impl Direction {
    /// The derivatives in this direction, and their noise: that of the entries plus that of the
    /// sum.
    fn directional_derivatives(&self, matrix: &DMatrix<f64>, noise: &DMatrix<f64>) -> (Vec<f64>, Vec<f64>) {
        let n = self.seed.len() as f64;
        let sum = |term: &dyn Fn(usize, f64) -> f64| -> f64 {
            self.seed.iter().enumerate().map(|(j, &d)| term(j, d)).sum()
        };
        (0..matrix.nrows())
            .map(|i| {
                let value = sum(&|j, d| matrix[(i, j)] * d);
                let bound = sum(&|j, d| {
                    let rounding = n * f64::EPSILON * (matrix[(i, j)] * d).abs() / MAX_DEVIATIONS;
                    noise[(i, j)] * d.abs() + rounding
                });
                (value, bound)
            })
            .unzip()
    }
}
