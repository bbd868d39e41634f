//! Plots of the solutions of optimal control problems over time, with their bounds.

use super::curve::Curve;
use super::panel::Panel;
use super::svg::Colour;
use crate::ocp::{Kind, Trajectory, TrajectoryError};
use crate::scalar::Real;
use crate::structure::name_matches;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

/// Without multipliers a bound is active within this part of the range of the values.
const ACTIVE_BOUND_TOLERANCE: f64 = 1e-4;

/// A value with its bounds.
#[derive(Clone, Copy)]
struct BoundedValue {
    time: f64,
    value: f64,
    bounds: [f64; 2],
    /// The multipliers of both bounds, if known.
    multipliers: Option<[f64; 2]>,
}

impl BoundedValue {
    /// Whether the value is fixed: its bounds are equal.
    fn is_given(&self) -> bool {
        self.bounds[0] >= self.bounds[1]
    }

    /// Whether a bound is active: the multiplier is larger than the distance, whose product
    /// vanishes at a solution; without multipliers, whether the value is at the bound.
    fn is_active(&self, span: f64) -> bool {
        let near = [ACTIVE_BOUND_TOLERANCE * span; 2];
        let forces = self.bounds.into_iter().zip(self.multipliers.unwrap_or(near));
        !self.is_given() && forces.into_iter().any(|(bound, force)| force > (self.value - bound).abs())
    }
}

impl Panel {
    /// A panel of a solution over time, as returned by [`Ocp::solution`](crate::ocp::Ocp::solution)
    /// or `dense_solution`: all states, algebraic states, controls, parameters and outputs of
    /// constraints with this name. `x` selects all states, `Corner[2]` an output of a constraint.
    ///
    /// Controls are steps, or lines if they are piecewise linear. Bounds near the values are
    /// dashed; the line is wide where one is active. Units are those of the model's doc comments
    /// ([`Units`](crate::structure::Units)) or of [`Trajectory::set_unit`]: at the axis, or behind
    /// each name if they differ.
    ///
    /// # Errors
    /// [`TrajectoryError::Unknown`]
    pub fn trajectories<T: Real>(solution: &Trajectory<T>, name: &str) -> Result<Self, TrajectoryError> {
        let found: Vec<_> =
            solution.series().iter().filter(|series| name_matches(name, &series.name)).collect();
        if found.is_empty() {
            // The error lists the names.
            solution.get(name)?;
        }
        let panel = Self::new(format!("{}: {name}", solution.model()));
        let mut panel = panel.x(with_unit("time", solution.time_unit()));
        let unit = found.first().map_or("", |series| series.unit.as_str());
        let is_common = found.iter().all(|series| series.unit == unit);
        if is_common && !unit.is_empty() {
            panel = panel.y(with_unit(name, unit));
        }
        Ok(found.into_iter().enumerate().fold(panel, |panel, (i, series)| {
            let name = with_unit(&series.name, if is_common { "" } else { &series.unit });
            line_with_bounds(solution, series, name, Colour::of(i)).into_iter().fold(panel, Self::with)
        }))
    }
}

/// A name with its unit, if any: `speed, m/s`.
fn with_unit(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.into() } else { format!("{name}, {unit}") }
}

fn bounded_values<T: Real>(solution: &Trajectory<T>, series: &crate::ocp::Series<T>) -> Vec<BoundedValue> {
    let times = solution.times();
    let of = |bounds: &[Option<T>], k: usize| bounds.get(k).copied().flatten().map(|bound| bound.to_f64());
    let mut points: Vec<BoundedValue> = (series.values.iter().enumerate())
        .map(|(k, value)| {
            let multipliers = series.lower_multipliers.get(k).zip(series.upper_multipliers.get(k));
            BoundedValue {
                time: times.get(series.first.saturating_add(k)).map_or(f64::NAN, |time| time.to_f64()),
                value: value.to_f64(),
                bounds: [
                    of(&series.lower, k).unwrap_or(f64::NEG_INFINITY),
                    of(&series.upper, k).unwrap_or(f64::INFINITY),
                ],
                multipliers: multipliers.map(|(lower, upper)| [lower.to_f64(), upper.to_f64()]),
            }
        })
        .collect();
    if is_piecewise_constant(solution, series)
        && let (Some(&last), Some(end)) = (points.last(), times.last())
    {
        // The last control is held until the end.
        points.push(BoundedValue { time: end.to_f64(), ..last });
    }
    points
}

/// Whether values are constant on intervals: controls that are not piecewise linear, and rates.
fn is_piecewise_constant<T: Real>(solution: &Trajectory<T>, series: &crate::ocp::Series<T>) -> bool {
    matches!(series.kind, Kind::Control | Kind::Rate) && series.values.len() < solution.times().len()
}

/// A line with its bounds, which marks active ones.
fn line_with_bounds<T: Real>(
    solution: &Trajectory<T>,
    series: &crate::ocp::Series<T>,
    name: String,
    colour: Colour,
) -> Vec<Curve> {
    let points = bounded_values(solution, series);
    let over = |name: String, value: &dyn Fn(&BoundedValue) -> f64| {
        let line = points.iter().map(|point| (point.time, value(point)));
        let drawn = match series.kind {
            _ if is_piecewise_constant(solution, series) => Curve::steps(name, line),
            Kind::Terminal => Curve::dots(name, line),
            _ => Curve::line(name, line),
        };
        drawn.colour(colour)
    };
    let (low, high) = super::draw::value_range(points.iter().map(|point| &point.value));
    let span = high - low;
    let is_near = |bound: f64| span <= 0.0 || (bound > low - 1.5 * span && bound < high + 1.5 * span);
    let bound = |point: &BoundedValue, side: usize| {
        if point.is_given() || !is_near(point.bounds[side]) { f64::NAN } else { point.bounds[side] }
    };
    let active = |point: &BoundedValue| if point.is_active(span) { point.value } else { f64::NAN };
    let mut drawn: Vec<Curve> = (0..2)
        .filter(|&side| points.iter().any(|point| bound(point, side).is_finite()))
        .map(|side| over(String::new(), &|point| bound(point, side)).width(1.0).dashed())
        .collect();
    if points.iter().any(|point| point.is_active(span)) {
        let wide = over(String::new(), &active).width(6.0);
        drawn.push(if is_piecewise_constant(solution, series) { wide } else { wide.marked() });
    }
    drawn.push(over(name, &|point| point.value));
    drawn
}
