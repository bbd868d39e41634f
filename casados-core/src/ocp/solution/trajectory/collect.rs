//! The iterate of a problem as a trajectory.

use super::{Kind, Series, Trajectory};
use crate::ocp::assembly::algebraic;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::instance::data::{bounds, node_rows, path_rows, split};
use crate::ocp::formulation::instance::{Ocp, nodes};
use crate::ocp::formulation::labels::output;
use crate::ocp::formulation::names::Names;
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::qp::element::get;
use crate::qp::{Bounds, SolutionStage, Stage, StageDims};
use crate::scalar::Real;
use crate::shape::Shape;
use alloc::string::{String, ToString};
use alloc::vec;
use alloc::vec::Vec;

/// What constraints are called.
pub(in crate::ocp) fn names<C: Constraints<S, T>, S: Shape, T: Real>() -> impl Iterator<Item = String> {
    (0..C::ROWS).map(|row| output::<C, S, T>(row).to_string())
}

/// The unit of a variable, if one is known.
fn unit(units: &'static [&'static str], index: usize) -> &'static str {
    units.get(index).copied().unwrap_or_default()
}

impl Names {
    /// What a state of the QP is.
    pub(super) fn kind_of_state(&self, state: usize) -> Kind {
        match state.checked_sub(self.own_states()) {
            None => Kind::State,
            Some(more) if more < self.linear.len() => Kind::Control,
            Some(_) => Kind::Integral,
        }
    }
}

/// Where bounds and multipliers of one kind are in a stage.
struct Places<T> {
    bounds: for<'a> fn(&Stage<'a, T>) -> Bounds<'a, T>,
    multipliers: for<'a> fn(&SolutionStage<'a, T>) -> [&'a [T]; 2],
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// The iterate by names, with algebraic states and constraints at it, bounds and multipliers:
    /// after a solver the solution. Intervals are integrated once more where the model has
    /// algebraic states.
    ///
    /// # Errors
    /// As [`Ocp::linearise`].
    pub fn solution(&mut self) -> Result<Trajectory<T>, OcpError> {
        self.check()?;
        let (intervals, layout) = (self.intervals(), self.layout());
        let rows = intervals * path_rows::<P, T>(layout) + P::Terminal::ROWS;
        let mut values = vec![T::ZERO; rows];
        if P::Shape::NZ > 0 && P::Dynamics::ALGEBRAIC || self.inner.count() > 0 {
            self.find_algebraic()?;
        }
        if rows > 0 {
            self.constraints(&mut values)?;
        }
        let known = <P::Dynamics as Dynamics<T>>::NAMES;
        let (mut series, mut of_algebraic) = (Vec::new(), Vec::new());
        let states =
            Places { bounds: |stage| stage.x_bounds(), multipliers: |stage| [stage.x_lower, stage.x_upper] };
        let controls =
            Places { bounds: |stage| stage.u_bounds(), multipliers: |stage| [stage.u_lower, stage.u_upper] };
        for i in 0..known.own_states() {
            series.push(self.of_state(i, &states));
        }
        if P::Dynamics::ALGEBRAIC {
            let layout = self.layout();
            let all = split::<P, T>(self.data.as_mut(), layout).algebraic;
            for (i, &name) in known.z.iter().enumerate() {
                let at = |k| get(algebraic::at::<P::Shape, T>(all, layout, k).0, i);
                let values = (0..intervals).map(at).collect();
                let algebraic = Series::new(Kind::Algebraic, name, 0, values);
                series.push(algebraic.with_unit(unit(known.units.z, i)));
                of_algebraic.push(series.len() - 1);
            }
        }
        for (i, &at) in of_algebraic.iter().enumerate() {
            if let (Some(row), Some(one)) = (self.node_row(P::Shape::NX + i), series.get_mut(at)) {
                self.limit(one, row);
            }
        }
        let free = self.free.count();
        for (i, &name) in known.u.iter().enumerate() {
            let (kind, linear) = match known.linear_state(i) {
                Some(state) => (Kind::Rate, Some(self.of_state(state, &states))),
                None => (Kind::Control, None),
            };
            series.extend(linear);
            let values = self.iterate.stages().take(intervals).map(|stage| get(stage.u, free + i)).collect();
            let control = Series::new(kind, name, 0, values).with_unit(unit(known.units.u, i));
            series.push(self.bounded(control, free + i, &controls));
        }
        for i in known.x.len() - known.integrals..known.x.len() {
            series.push(self.of_state(i, &states));
        }
        for (i, &name) in known.p.iter().enumerate() {
            let parameter = match self.free.view().of(i) {
                Some(w) => self.of_free(name, w, &controls),
                None => {
                    let p = self.data.as_ref().get(intervals + 1..).unwrap_or_default();
                    let values = (0..=intervals).map(|k| get(p, k * P::Shape::NP + i)).collect();
                    Series::new(Kind::Parameter, name, 0, values)
                }
            };
            series.push(parameter.with_unit(unit(known.units.p, i)));
        }
        for (row, name) in names::<P::Path, _, T>().enumerate() {
            series.push(self.of_constraint(Kind::Path, name, row, &values).with_unit(P::Path::unit(row)));
        }
        for (row, name) in names::<P::Terminal, _, T>().enumerate() {
            let terminal = self.of_constraint(Kind::Terminal, name, row, &values);
            series.push(terminal.with_unit(P::Terminal::unit(row)));
        }
        for index in 0..layout.inner {
            let (name, unit) = self.inside_name(index);
            let row = node_rows::<P, T>() + index;
            if self.inner.row::<P>(index).is_some_and(|row| row.point() > 0) {
                series.push(self.of_constraint(Kind::Inside, name, row, &values).with_unit(unit));
            }
        }
        let duration =
            self.iterate.stages().next().map_or(T::ONE, |first| self.free.view().duration(first.u));
        let times = self.times().iter().map(|&time| duration * time).collect();
        let (model, time_unit) = (known.model.into(), known.units.t.into());
        Ok(Trajectory { model, times, time_unit, series })
    }

    /// A state, or what is one in the QP: a linear control or an integral.
    fn of_state(&self, i: usize, places: &Places<T>) -> Series<T> {
        let known = <P::Dynamics as Dynamics<T>>::NAMES;
        let kind = known.kind_of_state(i);
        let name = known.x.get(i).copied().unwrap_or_default();
        let values = self.iterate.stages().map(|stage| get(stage.x, i)).collect();
        let state = Series::new(kind, name, 0, values).with_unit(unit(known.units.x, i));
        let mut state = self.bounded(state, i, places);
        let stages = self.iterate.stages().take(self.intervals());
        state.costates = stages.map(|stage| get(stage.dynamics, i)).collect();
        state
    }

    /// Algebraic states of the iterate.
    pub(in crate::ocp) fn find_algebraic(&mut self) -> Result<(), OcpError> {
        if self.inner.count() > 0 {
            return self.simulate_pieces(None, |_, _| {});
        }
        let (layout, free) = (self.layout(), self.free.view());
        let data = split::<P, T>(self.data.as_mut(), layout);
        let Problem { dynamics, .. } = self.problem.parts();
        let (v, multipliers) = self.iterate.variables_and_costates();
        let nodes = nodes::<P::Shape, T>(v, multipliers, &[], (data.p, free), data.times);
        dynamics
            .simulate(&nodes, &mut |k, step| algebraic::keep::<P::Shape, T>(data.algebraic, free, k, step))
    }

    /// A free parameter, with its bounds and multipliers at every node: it is one variable.
    fn of_free(&self, name: &'static str, w: usize, places: &Places<T>) -> Series<T> {
        let nodes = self.intervals() + 1;
        let value = self.iterate.stages().next().map_or(T::ZERO, |stage| get(stage.u, w));
        let one = self.bounded(Series::new(Kind::Parameter, name, 0, vec![value]), w, places);
        let Series { lower, upper, lower_multipliers, upper_multipliers, .. } = one;
        let mut series = Series::new(Kind::Parameter, name, 0, vec![value; nodes]);
        let repeat = |list: Vec<Option<T>>| list.into_iter().cycle().take(nodes).collect();
        (series.lower, series.upper) = (repeat(lower), repeat(upper));
        let repeat = |list: Vec<T>| list.into_iter().cycle().take(nodes).collect();
        (series.lower_multipliers, series.upper_multipliers) =
            (repeat(lower_multipliers), repeat(upper_multipliers));
        series
    }

    /// With the bounds and multipliers of states or controls.
    fn bounded(&self, mut series: Series<T>, i: usize, places: &Places<T>) -> Series<T> {
        let finite = |bound: T| bound.is_finite().then_some(bound);
        let count = series.values.len();
        for (stage, point) in self.qp.view().stages().zip(self.iterate.stages()).take(count) {
            let (bounds, [lower, upper]) = ((places.bounds)(&stage), (places.multipliers)(&point));
            series.lower.push(finite(get(bounds.lower, i)));
            series.upper.push(finite(get(bounds.upper, i)));
            series.lower_multipliers.push(get(lower, i));
            series.upper_multipliers.push(get(upper, i));
        }
        series
    }

    /// An output of the constraints, of whose values those of the last stage lie behind those of
    /// all others.
    fn of_constraint(&self, kind: Kind, name: String, row: usize, values: &[T]) -> Series<T> {
        let intervals = self.intervals();
        let stages = if kind == Kind::Terminal { intervals..intervals + 1 } else { 0..intervals };
        let layout = self.layout();
        let all = |list: &[T]| {
            stages.clone().map(|k| get(list, k * path_rows::<P, T>(layout) + row)).collect::<Vec<_>>()
        };
        let mut series = Series::new(kind, name, stages.start, all(values));
        self.limit(&mut series, row);
        series
    }

    /// Gives a series the bounds and multipliers of a row.
    fn limit(&self, series: &mut Series<T>, row: usize) {
        let layout = self.layout();
        let stages = series.first..series.first + series.values.len();
        let sides = bounds::<P, T>(self.data.as_ref(), layout);
        let of_side = |list: &[T]| {
            let bound = |k: usize| get(list, k * path_rows::<P, T>(layout) + row);
            stages.clone().map(|k| Some(bound(k)).filter(|bound| bound.is_finite())).collect()
        };
        [series.lower, series.upper] = sides.map(of_side);
        for point in self.iterate.stages().skip(stages.start).take(stages.len()) {
            series.lower_multipliers.push(get(point.g_lower, row));
            series.upper_multipliers.push(get(point.g_upper, row));
        }
    }

    /// The row of an algebraic state at nodes, if it has bounds.
    pub(super) fn node_row(&self, variable: usize) -> Option<usize> {
        let index = self.inner.variables().iter().position(|&row| row == (variable, 0))?;
        Some(node_rows::<P, T>() + self.inner.count() * P::Path::ROWS + index)
    }
}
