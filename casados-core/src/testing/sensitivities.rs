//! The sensitivities of an integrator against each other, against differences, and against an exact
//! solution.
//!
//! What rounding does to a result is sampled: the interval is run again with every input changed by
//! a few units in the last place, which draws all roundings anew (stochastic arithmetic: Vignes, "A
//! stochastic arithmetic for reliable scientific computation", 1993). The largest deviation among
//! the samples stands for condition times epsilon of that very entry.

use super::bounded::Bounded;
use super::differences;
use super::integrator::{Answer, Interval};
use super::points::Random;
use super::report::{Entry, Report};
use crate::error::Error;
use crate::integrator::Integrator;
use crate::memory::Heap;
use crate::model::{Dae, VectorP, VectorU, VectorX};
use crate::shape::Shape;
use core::any::type_name;
use nalgebra::DMatrix;
use std::format;
use std::string::String;
use std::vec::Vec;

/// Runs with changed inputs.
const SAMPLES: usize = 8;

/// Deviations that a difference of two results may have. The largest of eight samples is below one
/// standard deviation once in twenty entries and below a quarter once in four hundred thousand: 32
/// of it are at least eight standard deviations.
const DEVIATIONS: f64 = 32.0;

/// Checks one interval of an integrator:
/// - repeated calls return the same bits, and all calls agree about what they share;
/// - forward sensitivities against differences of the solution, and adjoint ones against both
///   (`λᵀ (S v) = (Sᵀ λ)ᵀ v` for all `v`);
/// - the Hessian is symmetric, and agrees with differences of the gradient.
///
/// The report warns where a state, differential or algebraic, is outside of its `range(..)` of the
/// model: of several roots of the equations the integrator may have taken another one than is
/// meant.
///
/// Errors are those of the integrator at the given inputs.
pub fn check_sensitivities<M: Dae, I: Integrator<Model = M, Number = f64, Memory = Heap>>(
    integrator: &mut I,
    x0: &VectorX<M, f64>,
    u: &VectorU<M, f64>,
    p: &VectorP<M, f64>,
    h: f64,
) -> Result<Report, Error> {
    let interval = Interval::new::<M>(x0, u, p, h);
    let mut random = Random::new(7);
    let lambda: Vec<f64> = (0..M::Shape::NX).map(|_| random.symmetric()).collect();
    let mut report = Report::new(format!("sensitivities of {}", type_name::<I>()));

    let solved = interval.solve(integrator)?;
    warn::<M>(&mut report, &solved);
    let (states, derivatives) = interval.forward(integrator)?;
    let (adjoint_states, gradient) = interval.adjoint(integrator, &lambda)?;
    let all = interval.hessian(integrator, &lambda)?;

    let same = |report: &mut Report, quantity, a: &[f64], b: &[f64]| {
        let bits = |v: f64| v.to_bits();
        let entries = a.iter().zip(b).map(|(&value, &expected)| Entry {
            value: if bits(value) == bits(expected) { expected } else { value },
            expected,
            tolerance: if bits(value) == bits(expected) { 0.0 } else { -1.0 },
        });
        report.compare(quantity, "the call before", 0, 0.0, entries.enumerate(), |i| format!("element {i}"));
    };
    same(&mut report, "solve", &interval.solve(integrator)?, &solved);
    same(&mut report, "forward", interval.forward(integrator)?.1.as_slice(), derivatives.as_slice());
    same(&mut report, "adjoint", &interval.adjoint(integrator, &lambda)?.1, &gradient);
    same(
        &mut report,
        "hessian",
        interval.hessian(integrator, &lambda)?.hessian.as_slice(),
        all.hessian.as_slice(),
    );

    let noise = noise(integrator, &interval, &lambda, &all)?;
    let state = |i| state_name::<M>(i);
    agree(&mut report, "state", "solve", &states, &solved, &noise.states, state);
    agree(&mut report, "state of adjoint", "solve", &adjoint_states, &solved, &noise.states, state);
    agree(&mut report, "state of hessian", "solve", &all.states, &solved, &noise.states, state);
    let entry = |i| derivative_name::<M>(i);
    let (values, bounds) = (all.derivatives.as_slice(), noise.derivatives.as_slice());
    agree(&mut report, "forward of hessian", "forward", values, derivatives.as_slice(), bounds, entry);
    agree(&mut report, "adjoint of hessian", "adjoint", &all.gradient, &gradient, &noise.gradient, |i| {
        format!("by {}", direction_name::<M>(i))
    });

    // λᵀ S, with the noise of both sides.
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
    agree(&mut report, "adjoint", "forward", &gradient, &product(&derivatives, false), &rounding, |i| {
        format!("by {}", direction_name::<M>(i))
    });

    let transposed = all.hessian.transpose();
    let entries = all.hessian.iter().zip(transposed.iter()).map(|(&value, &expected)| Entry {
        value,
        expected,
        tolerance: 0.0,
    });
    let scale = largest(all.hessian.as_slice());
    report.compare("Hessian", "its transpose", 0, scale, entries.enumerate(), second_name::<M>);

    for direction in directions::<M>(&interval) {
        let moved = |value: Bounded| Interval {
            w: interval.w.iter().zip(&direction.seed).map(|(w, d)| w + value.value * d).collect(),
            h,
        };
        let by_solve = differences::derivative(0.0, solved.len(), |value| {
            attach(moved(value).solve(integrator).ok(), &noise.states)
        });
        let (own, bounds) = direction.of(&derivatives, &noise.derivatives);
        against_differences(&mut report, "forward", &own, &by_solve, &bounds, |i| {
            format!("{} by {}", state_name::<M>(i), direction.name)
        });
        let by_adjoint = differences::derivative(0.0, M::Shape::NW, |value| {
            attach(moved(value).adjoint(integrator, &lambda).ok().map(|a| a.1), &noise.gradient)
        });
        let (own, bounds) = direction.of(&all.hessian, &noise.hessian);
        against_differences(&mut report, "Hessian", &own, &by_adjoint, &bounds, |i| {
            format!("by {} and {}", direction_name::<M>(i), direction.name)
        });
    }
    Ok(report)
}

/// An exact solution: the end state and, as far as they are known, its derivatives by
/// `w = (x₀, u, p)`.
#[derive(Clone, Debug, Default)]
pub struct Exact {
    /// `x` at the end of the interval, and after it `z` if that is known.
    pub states: Vec<f64>,
    /// `∂(x, z)/∂w`, a row per state; empty if not known.
    pub first: Vec<Vec<f64>>,
    /// `∂²x_i/∂w²` for each state; empty if not known.
    pub second: Vec<Vec<Vec<f64>>>,
}

/// Checks an integrator against an exact solution, first and second derivatives included.
///
/// `coarse` takes fewer steps than `fine`: the difference between the two is the estimate of the
/// discretisation error of `fine`, of which it is a multiple when the order is reached. Together
/// with the sampled rounding error it is the tolerance of the comparison.
pub fn check_exact<M: Dae, I: Integrator<Model = M, Number = f64, Memory = Heap>>(
    coarse: &mut I,
    fine: &mut I,
    x0: &VectorX<M, f64>,
    u: &VectorU<M, f64>,
    p: &VectorP<M, f64>,
    h: f64,
    exact: &Exact,
) -> Result<Report, Error> {
    let interval = Interval::new::<M>(x0, u, p, h);
    let (nx, nw) = (M::Shape::NX, M::Shape::NW);
    let mut report = Report::new(format!("{} against the exact solution", type_name::<I>()));
    // Elimination is stable in norm only: of a small entry beside large ones no more can be asked
    // than some ε of the largest. Samples do not show this where a model is linear, since its
    // matrices stay the same. Rounding errors of ε/2 in each of n steps add up to about √n ε/2: 3ε
    // after 32 steps, and as in the other comparisons 4ε are granted.
    let largest_first = exact.first.iter().map(|row| largest(row)).fold(0.0, f64::max);
    let largest_second = exact.second.iter().flatten().map(|row| largest(row)).fold(0.0, f64::max);
    for i in 0..nx {
        let lambda: Vec<f64> = (0..nx).map(|j| f64::from(u8::from(i == j))).collect();
        let answer = interval.hessian(fine, &lambda)?;
        if i == 0 {
            warn::<M>(&mut report, &answer.states);
        }
        let rough = interval.hessian(coarse, &lambda)?;
        let noise = noise(fine, &interval, &lambda, &answer)?;
        let mut compare = |quantity,
                           own: &[f64],
                           rough: &[f64],
                           noise: &[f64],
                           exact: &[f64],
                           scale: f64,
                           name: &dyn Fn(usize) -> String| {
            let floor = 4.0 * f64::EPSILON * scale;
            let entries = exact.iter().enumerate().map(|(k, &expected)| {
                let tolerance = (own[k] - rough[k]).abs() + DEVIATIONS * noise[k] + floor;
                (k, Entry { value: own[k], expected, tolerance })
            });
            report.compare(quantity, "exact", 0, largest(exact), entries, name);
        };
        if i == 0 {
            compare(
                "state",
                &answer.states,
                &rough.states,
                &noise.states,
                &exact.states,
                largest(&exact.states),
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
            // Both are symmetric: row-major or column-major is the same.
            let flat: Vec<f64> = second.iter().take(nw).flatten().copied().collect();
            let (own, rough) = (answer.hessian.as_slice(), rough.hessian.as_slice());
            compare("second derivative", own, rough, noise.hessian.as_slice(), &flat, largest_second, &|k| {
                format!("{} {}", state_name::<M>(i), second_name::<M>(k))
            });
        }
    }
    Ok(report)
}

/// Warns where states `(x, z, z0)` are outside of the ranges of the model.
fn warn<M: Dae>(report: &mut Report, states: &[f64]) {
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

/// A direction in the space of `w`, in which differences are taken.
struct Direction {
    name: String,
    seed: Vec<f64>,
}

/// The unit vectors, if they are few; for large models random directions, in which every entry
/// takes part.
fn directions<M: Dae>(interval: &Interval) -> Vec<Direction> {
    const UNITS: usize = 12;
    const RANDOM: usize = 4;
    let size = |w: f64| w.abs().max(1.0);
    if M::Shape::NW <= UNITS {
        return (0..M::Shape::NW)
            .map(|j| Direction {
                name: direction_name::<M>(j),
                seed: (0..M::Shape::NW).map(|i| f64::from(u8::from(i == j))).collect(),
            })
            .collect();
    }
    let mut random = Random::new(11);
    (0..RANDOM)
        .map(|number| Direction {
            name: format!("random direction {number}"),
            seed: interval.w.iter().map(|&w| random.symmetric() * size(w)).collect(),
        })
        .collect()
}

impl Direction {
    /// The derivatives in this direction, and their noise: that of the entries and that of the sum.
    fn of(&self, matrix: &DMatrix<f64>, noise: &DMatrix<f64>) -> (Vec<f64>, Vec<f64>) {
        let n = self.seed.len() as f64;
        let sum = |term: &dyn Fn(usize, f64) -> f64| -> f64 {
            self.seed.iter().enumerate().map(|(j, &d)| term(j, d)).sum()
        };
        (0..matrix.nrows())
            .map(|i| {
                let value = sum(&|j, d| matrix[(i, j)] * d);
                let bound = sum(&|j, d| {
                    let rounding = n * f64::EPSILON * (matrix[(i, j)] * d).abs() / DEVIATIONS;
                    noise[(i, j)] * d.abs() + rounding
                });
                (value, bound)
            })
            .unzip()
    }
}

/// The largest deviation of each entry over samples.
fn noise<M: Dae>(
    integrator: &mut impl Integrator<Model = M, Number = f64, Memory = Heap>,
    interval: &Interval,
    lambda: &[f64],
    center: &Answer,
) -> Result<Answer, Error> {
    let mut random = Random::new(3);
    let mut noise = Answer {
        states: center.states.iter().map(|_| 0.0).collect(),
        derivatives: center.derivatives.map(|_| 0.0),
        gradient: center.gradient.iter().map(|_| 0.0).collect(),
        hessian: center.hessian.map(|_| 0.0),
    };
    for _ in 0..SAMPLES {
        let mut change = |value: f64| value * (1.0 + f64::EPSILON * [-2.0, -1.0, 1.0, 2.0][random.below(4)]);
        let sample = Interval { w: interval.w.iter().map(|&w| change(w)).collect(), h: change(interval.h) };
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

/// Two results of the same quantity within the noise.
fn agree(
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
        tolerance: DEVIATIONS * noise + 4.0 * f64::EPSILON * expected.abs(),
    });
    report.compare(quantity, reference, 0, largest(expected), entries.enumerate(), name);
}

fn against_differences(
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
        tolerance: d.error + DEVIATIONS * noise + 4.0 * f64::EPSILON * value.abs(),
    });
    report.compare(quantity, "differences", 0, largest(values), entries.enumerate(), name);
}

/// Values with their noise; NaN where the integrator failed, which differences leave out.
fn attach(values: Option<Vec<f64>>, noise: &[f64]) -> Vec<Bounded> {
    match values {
        Some(values) => values
            .iter()
            .zip(noise)
            .map(|(&value, &noise)| Bounded { value, error: DEVIATIONS * noise + f64::EPSILON * value.abs() })
            .collect(),
        None => noise.iter().map(|_| Bounded { value: f64::NAN, error: f64::INFINITY }).collect(),
    }
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |a, b| if b.is_finite() { f64::max(a, b.abs()) } else { a })
}

fn state_name<M: Dae>(i: usize) -> String {
    let (nx, nz) = (M::Shape::NX, M::Shape::NZ);
    if i < nx {
        String::from(M::STRUCTURE.x[i])
    } else if i < nx + nz {
        String::from(M::STRUCTURE.z[i - nx])
    } else {
        format!("{} at the start", M::STRUCTURE.z[i - nx - nz])
    }
}

fn direction_name<M: Dae>(i: usize) -> String {
    let s = &M::STRUCTURE;
    let names = s.x.iter().map(|x| (*x, true)).chain(s.u.iter().chain(s.p).map(|w| (*w, false)));
    match names.into_iter().nth(i) {
        Some((name, true)) => format!("{name} at the start"),
        Some((name, false)) => String::from(name),
        None => format!("direction {i}"),
    }
}

fn derivative_name<M: Dae>(i: usize) -> String {
    let rows = M::Shape::NX + 2 * M::Shape::NZ;
    format!("{} by {}", state_name::<M>(i % rows), direction_name::<M>(i / rows))
}

fn second_name<M: Dae>(i: usize) -> String {
    let n = M::Shape::NW;
    format!("by {} and {}", direction_name::<M>(i % n), direction_name::<M>(i / n))
}
