//! How far a step goes: merit function and filter.

use super::options::{Globalisation, SqpOptions};
use crate::ocp::data::split;
use crate::ocp::error::OcpError;
use crate::ocp::instance::Ocp;
use crate::ocp::problem::Formulation;
use crate::qp::{Bounds, Solution, StageDims, add_symmetric, assign, part, part_mut};
use crate::scalar::{Real, Scalar};
use crate::shape::Shape;

/// Objective with penalties of soft bounds, and the sum of all violations of what is hard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Measure {
    pub objective: f64,
    pub violation: f64,
}

/// What is known of a step before it is taken.
#[derive(Clone, Copy, Debug)]
pub(super) struct Model {
    /// `∇fᵀd`, with the change of penalties.
    pub slope: f64,
    /// `dᵀHd`
    pub curvature: f64,
}

/// Entries of the filter; the oldest one is forgotten when there are more.
const ENTRIES: usize = 64;
/// What a new iterate must be better by, as a part of the violation.
const MARGIN: f64 = 1e-5;
/// The part of the expected decrease that is enough.
const ARMIJO: f64 = 1e-4;

/// What a line search remembers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    /// Penalty `ν` of the merit function.
    pub penalty: f64,
    entries: [Measure; ENTRIES],
    count: usize,
}

impl Search {
    pub fn new() -> Self {
        Self { penalty: 0.0, entries: [Measure { objective: 0.0, violation: 0.0 }; ENTRIES], count: 0 }
    }

    /// Before a line search from a point.
    pub fn begin(&mut self, here: &Measure, model: &Model) {
        if here.violation > 0.0 {
            // The merit function is to shrink by a tenth of `ν c` at least (Nocedal and Wright, (18.36)).
            let needed = (model.slope + 0.5 * model.curvature.max(0.0)) / (0.9 * here.violation);
            if needed > self.penalty {
                self.penalty = 2.0 * needed;
            }
        }
    }

    /// Whether a point is good enough after a step of this length.
    pub fn accepts(
        &mut self,
        options: &SqpOptions,
        length: f64,
        here: &Measure,
        model: &Model,
        there: &Measure,
    ) -> bool {
        if !(there.objective.is_finite() && there.violation.is_finite()) {
            return false;
        }
        // Near the solution, differences are roundings.
        let noise = 10.0 * f64::EPSILON * (1.0 + here.objective.abs() + self.penalty * here.violation);
        match options.globalisation {
            Globalisation::FullStep => true,
            Globalisation::Merit => {
                let merit = |m: &Measure| m.objective + self.penalty * m.violation;
                let slope = model.slope - self.penalty * here.violation;
                merit(there) <= merit(here) + ARMIJO * length * slope.min(0.0) + noise
            }
            Globalisation::Filter => {
                let entries = self.entries.iter().take(self.count.min(ENTRIES));
                let mut dominated = entries.filter(|old| !better(there, old, noise));
                if dominated.next().is_some() {
                    return false;
                }
                // Where the objective is expected to shrink far more than there is violation, it must (Wächter and Biegler, (19)).
                let descends = model.slope < 0.0
                    && length * Scalar::powf(-model.slope, 2.3) > Scalar::powf(here.violation, 1.1);
                if descends {
                    return there.objective <= here.objective + ARMIJO * length * model.slope + noise;
                }
                let good = better(there, here, noise);
                if good {
                    if let Some(entry) = self.entries.get_mut(self.count % ENTRIES) {
                        *entry = *here;
                    }
                    self.count += 1;
                }
                good
            }
        }
    }
}

/// Whether one of both is smaller by a margin.
fn better(a: &Measure, b: &Measure, noise: f64) -> bool {
    a.violation <= (1.0 - MARGIN) * b.violation || a.objective <= b.objective - MARGIN * b.violation + noise
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Slope and curvature of the objective from the iterate to the solution of its QP.
    pub(super) fn model(&mut self, solution: &Solution<T, D, M>, penalties: f64) -> Model {
        let intervals = self.intervals();
        let data = split::<P, T>(self.data.as_mut(), intervals);
        let (from, _) = self.iterate.vectors();
        let (to, _) = solution.vectors();
        let (mut slope, mut curvature, mut begin) = (T::ZERO, T::ZERO, 0);
        let mut soft = -penalties;
        for (stage, point) in self.qp.view().stages().zip(solution.stages()) {
            let view = stage.arrays();
            let (v, w) = (part(from, begin, view.ld), part(to, begin, view.ld));
            begin += view.ld;
            let (direction, rest) = data.scratch.split_at_mut_checked(view.ld).unwrap_or_default();
            let gradient = part_mut(rest, 0, view.ld);
            for ((d, &w), &v) in direction.iter_mut().zip(w).zip(v) {
                *d = w - v;
            }
            assign(gradient, part(view.gradient, 0, view.ld));
            add_symmetric(gradient, view.hessian, view.ld, v, view.n);
            slope = gradient.iter().zip(&*direction).fold(slope, |sum, (&g, &d)| sum + g * d);
            gradient.fill(T::ZERO);
            add_symmetric(gradient, view.hessian, view.ld, direction, view.n);
            curvature = gradient.iter().zip(&*direction).fold(curvature, |sum, (&g, &d)| sum + g * d);
            let x = |i: usize| point.x.get(i).copied().unwrap_or(T::ZERO);
            let u = |i: usize| point.u.get(i).copied().unwrap_or(T::ZERO);
            let g = |i: usize| {
                let column = part(view.matrix, (view.next + i) * view.ld, view.ld);
                crate::ocp::linearise::dot(column, w)
            };
            soft += sides(&stage.x_bounds(), x).objective
                + sides(&stage.u_bounds(), u).objective
                + sides(&stage.g_bounds(), g).objective;
        }
        Model { slope: slope.to_f64() + soft, curvature: curvature.to_f64() }
    }

    /// Objective and violations at some point.
    ///
    /// # Errors
    /// Those of functions and integrators.
    pub(super) fn measure(&mut self, at: &Solution<T, D, M>, ends: &mut [T]) -> Result<Measure, OcpError> {
        let objective = self.evaluate(at, ends)?;
        let mut sum = Measure { objective: objective.to_f64(), violation: 0.0 };
        let (intervals, nx, rows) = (self.intervals(), P::Shape::NX, self.rows());
        let values = ends.get(intervals * nx..).unwrap_or_default();
        let mut stages = at.stages().peekable();
        for (k, stage) in self.qp.view().stages().enumerate() {
            let Some(point) = stages.next() else { break };
            if let Some(next) = stages.peek() {
                for (&phi, &x) in part(ends, k * nx, nx).iter().zip(next.x) {
                    sum.violation += (phi - x).abs().to_f64();
                }
            }
            let x = |i: usize| point.x.get(i).copied().unwrap_or(T::ZERO);
            let u = |i: usize| point.u.get(i).copied().unwrap_or(T::ZERO);
            for part in [sides(&stage.x_bounds(), x), sides(&stage.u_bounds(), u)] {
                sum.objective += part.objective;
                sum.violation += part.violation;
            }
            let bounds = stage.g_bounds();
            for index in 0..bounds.lower.len() {
                let [lower, upper] = self.limits(k, index);
                let value = values.get(k * rows + index).copied().unwrap_or(T::ZERO);
                let part = side(&bounds, index, lower, upper, value);
                sum.objective += part.objective;
                sum.violation += part.violation;
            }
        }
        Ok(sum)
    }
}

/// Penalties and violations of some bounds.
fn sides<T: Real>(bounds: &Bounds<'_, T>, value: impl Fn(usize) -> T) -> Measure {
    let mut sum = Measure { objective: 0.0, violation: 0.0 };
    for (i, (&lower, &upper)) in bounds.lower.iter().zip(bounds.upper).enumerate() {
        let part = side(bounds, i, lower, upper, value(i));
        sum.objective += part.objective;
        sum.violation += part.violation;
    }
    sum
}

/// Those of one.
fn side<T: Real>(bounds: &Bounds<'_, T>, index: usize, lower: T, upper: T, value: T) -> Measure {
    let mut sum = Measure { objective: 0.0, violation: 0.0 };
    let at = |penalties: &[T]| penalties.get(index).map_or(0.0, |p| p.to_f64());
    for (excess, linear, quadratic) in [
        (lower - value, bounds.lower_linear, bounds.lower_quadratic),
        (value - upper, bounds.upper_linear, bounds.upper_quadratic),
    ] {
        let excess = excess.to_f64();
        if excess > 0.0 {
            let linear = at(linear);
            if linear.is_finite() {
                sum.objective += excess * (linear + 0.5 * at(quadratic) * excess);
            } else {
                sum.violation += excess;
            }
        }
    }
    sum
}
