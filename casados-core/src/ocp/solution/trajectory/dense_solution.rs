//! The iterate with points between the nodes.

use super::{Kind, Series, Trajectory};
use crate::ocp::formulation::bernstein;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::constraint::{ConstraintContext, Constraints};
use crate::ocp::formulation::functions::dynamics::{Dynamics, IntervalResult, Nodes};
use crate::ocp::formulation::instance::data::{Node, split_data};
use crate::ocp::formulation::instance::{Ocp, interval_nodes};
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::qp::element::get;
use crate::qp::{SolutionStage, StageDims, copy_common, part, part_mut, zeros};
use crate::scalar::Real;
use crate::shape::Shape;
use alloc::vec::Vec;
use bytemuck::Zeroable;

/// Values at points inside the intervals.
struct InnerValues<T> {
    points: usize,
    /// States, algebraic states and path constraints, by points.
    values: Vec<T>,
    /// The number of values of a point.
    values_per_point: usize,
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Returns [`Ocp::solution`] with the given number of equidistant points inside each interval:
    /// by the dense output of implicit integrators, by shorter intervals for explicit integrators.
    /// Path constraints, which are imposed at nodes, are also evaluated at these points. Bounds are
    /// those of the node before, and there are no multipliers. A [`Map`](crate::ocp::Map) has no
    /// points between nodes.
    ///
    /// # Errors
    /// The errors of [`Ocp::linearise`].
    ///
    /// # Example
    /// A fall from rest covers a quarter of the distance in half of the time:
    /// ```
    /// use casados::ocp::{Horizon, Problem};
    /// use casados::prelude::*;
    ///
    /// #[ode]
    /// fn fall(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
    ///
    /// let irk = Irk::<Fall, Gauss<2>>::new(Options::default())?;
    /// let mut ocp = Problem::new(irk).on(Horizon::uniform(1, 2.0))?;
    /// ocp.fix_initial_state(&[0.0; 2])?.guess(&[0.0; 2], &[0.0])?;
    /// ocp.guess_stage(0, &[0.0; 2], &[1.0])?.guess_stage(1, &[2.0, 2.0], &[])?;
    /// let solution = ocp.dense_solution(3)?;
    /// assert_eq!(solution.times(), [0.0, 0.5, 1.0, 1.5, 2.0]);
    /// assert!((solution.state("x[0]")?[2] - 0.5).abs() < 1e-14);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn dense_solution(&mut self, points: usize) -> Result<Trajectory<T>, OcpError> {
        let solution = self.solution()?;
        let width = P::Shape::NX + P::Shape::NZ + P::Path::ROWS;
        let count = self.intervals().saturating_mul(points).saturating_mul(width);
        let values = zeros(count)?;
        let count = T::from_whole(points + 1);
        let parts: Vec<T> = (1..=points).map(|part| T::from_whole(part) / count).collect();
        let Some(inside) = self.evaluate_inside(&parts, values)? else { return Ok(solution) };
        let Trajectory { model, times, time_unit, series } = solution;
        let mut dense = inside.interleave(&times, |k, j| {
            let [start, end] = [k, k + 1].map(|node| get(&times, node));
            start + get(&parts, j) * (end - start)
        });
        dense.truncate(dense.len() - points);
        // Series with values inside are in the order of these values, except states that are shown
        // as controls or integrals.
        let model_names = <P::Dynamics as Dynamics<T>>::NAMES;
        let (model_states, added_states) = model_names.x.split_at(model_names.model_state_count());
        let mut next = 0..;
        let mut place = |series: &Series<T>| match series.kind {
            Kind::Control | Kind::Integral => added_states
                .iter()
                .position(|name| *name == series.name)
                .map(|state| model_states.len() + state),
            kind if kind.is_available_inside() => next
                .next()
                .map(|index| if index < model_states.len() { index } else { index + added_states.len() }),
            _ => None,
        };
        let indices: Vec<Option<usize>> = series.iter().map(&mut place).collect();
        let pairs = series.iter().zip(indices);
        let mut dense_series: Vec<Series<T>> =
            pairs.map(|(series, index)| inside.dense_series(series, index)).collect();
        for (first, degree) in model_names.model_controls().filter(|&(_, degree)| degree > 0) {
            let is_first = |one: &Series<T>| Some(&one.name.as_str()) == model_names.u.get(first);
            let Some(at) = series.iter().position(is_first) else { continue };
            let coefficients = series.get(at..=at + degree).unwrap_or_default();
            // The control precedes its coefficients.
            if let Some(control) = at.checked_sub(1).and_then(|before| dense_series.get_mut(before)) {
                let theta = |point: usize| point.checked_sub(1).map_or(T::ZERO, |j| get(&parts, j));
                for (index, value) in control.values.iter_mut().enumerate() {
                    let (k, point) = (index / (points + 1), index % (points + 1));
                    let of_interval: Vec<T> = coefficients.iter().map(|one| get(&one.values, k)).collect();
                    *value = bernstein::value(&of_interval, theta(point));
                }
            }
        }
        let series = dense_series;
        Ok(Trajectory { model, times: dense, time_unit, series })
    }

    /// Evaluates values inside the intervals, at these fractions; `None` for maps.
    fn evaluate_inside(
        &mut self,
        parts: &[T],
        mut values: Vec<T>,
    ) -> Result<Option<InnerValues<T>>, OcpError> {
        let (intervals, points) = (self.intervals(), parts.len());
        let (nx, nz, np) = (P::Shape::NX, P::Shape::NZ, P::Shape::NP);
        let width = nx + nz + P::Path::ROWS;
        let has_points = self.inner_points.count() > 0;
        if has_points {
            self.simulate_pieces(None, |_, _| {})?;
        }
        let (layout, free) = (self.layout(), self.free.view());
        let data = split_data::<P, T>(self.data.as_mut(), layout);
        let Problem { dynamics, path, .. } = self.problem.parts();
        let (v, multipliers) = self.iterate.variables_and_costates();
        let nodes = interval_nodes::<P::Shape, T>(v, multipliers, &[], (data.p, free), data.times);
        // Intervals that are integrated in pieces are evaluated piece by piece.
        let ends = if has_points { self.inner_points.fractions() } else { &[T::ZERO, T::ONE] };
        let (mut start_variables, mut is_there) = (v.to_vec(), true);
        for (piece, ends) in ends.windows(2).enumerate() {
            let [from, to] = [get(ends, 0), get(ends, 1)];
            let points_in_piece = parts.iter().enumerate().filter(|(_, part)| from < **part && **part <= to);
            let (indices, fractions_in_piece): (Vec<usize>, Vec<T>) =
                points_in_piece.map(|(index, &part)| (index, (part - from) / (to - from))).unzip();
            for k in 0..if piece > 0 { intervals } else { 0 } {
                let start = self.inner_points.point_solution::<P::Shape>(k, piece).x;
                copy_common(part_mut(&mut start_variables, k * nodes.ld[0], nx), start);
            }
            let nodes = Nodes { v: &start_variables, piece: has_points.then_some([from, to]), ..nodes };
            is_there &= dynamics.inside(&nodes, &fractions_in_piece, &mut |point,
                                                                            step: &IntervalResult<
                '_,
                T,
            >| {
                let (interval, local) = (point / fractions_in_piece.len(), point % fractions_in_piece.len());
                let point = interval * points + indices.get(local).copied().unwrap_or(0);
                let to = part_mut(&mut values, point * width, nx + nz).iter_mut();
                to.zip(step.x.iter().chain(step.z)).for_each(|(to, &from)| *to = from);
            })?;
        }
        let mut point = <P::Shape as Shape>::ArrayV::<T>::zeroed();
        for (k, stage) in self.iterate.stages().enumerate().take(if is_there { intervals } else { 0 }) {
            let [start, end] = [k, k + 1].map(|node| get(data.times, node));
            for (j, &fraction) in parts.iter().enumerate() {
                let point_values = part_mut(&mut values, (k * points + j) * width, width);
                let (variables, g) = point_values.split_at_mut_checked(nx + nz).unwrap_or_default();
                let (x, z) = variables.split_at_checked(nx).unwrap_or_default();
                let p = part(data.p, k * np, np);
                let node = Node { time: start + fraction * (end - start), p, reference: &[], factor: T::ONE };
                node.write_variables::<P::Shape>(&mut point, &SolutionStage { x, ..stage }, z, free);
                path.value(&point, g, ConstraintContext::new(k, free, &[]))?;
            }
        }
        Ok(is_there.then_some(InnerValues { points, values, values_per_point: width }))
    }
}

impl<T: Real> InnerValues<T> {
    /// Values at nodes, each followed by the values of points in the next interval.
    fn interleave<V: Copy>(&self, at_nodes: &[V], mut inside: impl FnMut(usize, usize) -> V) -> Vec<V> {
        let mut values = Vec::new();
        for (k, &value) in at_nodes.iter().enumerate() {
            values.push(value);
            values.extend((0..self.points).map(|j| inside(k, j)));
        }
        values
    }

    /// A series with points inside, if it has an index among their values.
    fn dense_series(&self, series: &Series<T>, index: Option<usize>) -> Series<T> {
        let Series { kind, name, unit, first, values, lower, upper, .. } = series;
        let dense =
            Series::new(*kind, name.as_str(), first * (self.points + 1), Vec::new()).with_unit(unit.as_str());
        if *kind == Kind::Terminal {
            return Series { values: values.clone(), lower: lower.clone(), upper: upper.clone(), ..dense };
        }
        let inside = |k: usize, j: usize| match index {
            Some(index) => get(&self.values, (k * self.points + j) * self.values_per_point + index),
            None => get(values, k),
        };
        let value_at = |list: &[Option<T>], k: usize| list.get(k).copied().flatten();
        let mut dense = Series {
            values: self.interleave(values, inside),
            lower: self.interleave(lower, |k, _| value_at(lower, k)),
            upper: self.interleave(upper, |k, _| value_at(upper, k)),
            ..dense
        };
        // There are no points after the last node.
        let is_at_nodes = matches!(kind, Kind::State | Kind::Parameter | Kind::Integral);
        if is_at_nodes || *kind == Kind::Control && index.is_some() {
            dense.values.truncate(dense.values.len().saturating_sub(self.points));
            dense.lower.truncate(dense.values.len());
            dense.upper.truncate(dense.values.len());
        }
        dense
    }
}

impl Kind {
    fn is_available_inside(self) -> bool {
        matches!(self, Self::State | Self::Algebraic | Self::Path)
    }
}
