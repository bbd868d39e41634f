//! The iterate of a problem as a trajectory.

use super::{Kind, Series, Trajectory};
use crate::ocp::assembly::algebraic;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::instance::data::{
    constraint_bounds, node_row_count, path_row_count, split_data,
};
use crate::ocp::formulation::instance::{Ocp, interval_nodes};
use crate::ocp::formulation::labels::output_name;
use crate::ocp::formulation::names::Names;
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::qp::element::get;
use crate::qp::{Bounds, SolutionStage, Stage, StageDims};
use crate::scalar::Real;
use crate::shape::Shape;
use alloc::string::{String, ToString};
use alloc::vec;
use alloc::vec::Vec;

/// The names of constraints.
pub(in crate::ocp) fn constraint_names<C: Constraints<S, T>, S: Shape, T: Real>()
-> impl Iterator<Item = String> {
    (0..C::ROWS).map(|row| output_name::<C, S, T>(row).to_string())
}

/// The unit of a variable; empty if it is unknown.
fn unit_at(units: &'static [&'static str], index: usize) -> &'static str {
    units.get(index).copied().unwrap_or_default()
}

impl Names {
    /// The kind of a control of the QP.
    pub(super) fn control_kind(&self, control: usize) -> Kind {
        match self.linear_state(control) {
            Some(_) => Kind::Rate,
            None if self.polynomial_of(control).is_some() => Kind::Coefficient,
            None => Kind::Control,
        }
    }

    /// The kind of a state of the QP.
    pub(super) fn state_kind(&self, state: usize) -> Kind {
        match state.checked_sub(self.model_state_count()) {
            None => Kind::State,
            Some(more) if more < self.linear.len() => Kind::Control,
            Some(_) => Kind::Integral,
        }
    }
}

/// Access to the bounds and multipliers of one kind in a stage.
struct BoundAccess<T> {
    bounds: for<'a> fn(&Stage<'a, T>) -> Bounds<'a, T>,
    multipliers: for<'a> fn(&SolutionStage<'a, T>) -> [&'a [T]; 2],
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Returns the iterate by names, with algebraic states, constraints, bounds and multipliers;
    /// after a run of a solver this is the solution. A model with algebraic states is integrated
    /// once more.
    ///
    /// # Errors
    /// The errors of [`Ocp::linearise`].
    pub fn solution(&mut self) -> Result<Trajectory<T>, OcpError> {
        self.check()?;
        let (intervals, layout) = (self.intervals(), self.layout());
        let rows = intervals * path_row_count::<P, T>(layout) + P::Terminal::ROWS;
        let mut values = vec![T::ZERO; rows];
        if P::Shape::NZ > 0 && P::Dynamics::ALGEBRAIC || self.inner_points.count() > 0 {
            self.update_algebraic()?;
        }
        if rows > 0 {
            self.evaluate_constraints(&mut values)?;
        }
        let model_names = <P::Dynamics as Dynamics<T>>::NAMES;
        let (mut series, mut of_algebraic) = (Vec::new(), Vec::new());
        let states = BoundAccess {
            bounds: |stage| stage.x_bounds(),
            multipliers: |stage| [stage.x_lower, stage.x_upper],
        };
        let controls = BoundAccess {
            bounds: |stage| stage.u_bounds(),
            multipliers: |stage| [stage.u_lower, stage.u_upper],
        };
        for i in 0..model_names.model_state_count() {
            series.push(self.state_series(i, &states));
        }
        if P::Dynamics::ALGEBRAIC {
            let layout = self.layout();
            let all = split_data::<P, T>(self.data.as_mut(), layout).algebraic;
            for (i, &name) in model_names.z.iter().enumerate() {
                let at = |k| get(algebraic::values_and_jacobian::<P::Shape, T>(all, layout, k).0, i);
                let values = (0..intervals).map(at).collect();
                let algebraic = Series::new(Kind::Algebraic, name, 0, values);
                series.push(algebraic.with_unit(unit_at(model_names.units.z, i)));
                of_algebraic.push(series.len() - 1);
            }
        }
        for (i, &at) in of_algebraic.iter().enumerate() {
            if let (Some(row), Some(one)) = (self.algebraic_bound_row(P::Shape::NX + i), series.get_mut(at)) {
                self.set_row_bounds(one, row);
            }
        }
        let free = self.free.count();
        for (i, &name) in model_names.u.iter().enumerate() {
            let kind = model_names.control_kind(i);
            if let Some(state) = model_names.linear_state(i) {
                series.push(self.state_series(state, &states));
            }
            let values = self.iterate.stages().take(intervals).map(|stage| get(stage.u, free + i)).collect();
            let control = Series::new(kind, name, 0, values).with_unit(unit_at(model_names.units.u, i));
            let control = self.with_bounds_and_multipliers(control, free + i, &controls);
            if model_names.polynomial_of(i).is_some_and(|(first, _)| first == i) {
                let name = model_names.control_name(i);
                series.push(Series { kind: Kind::Control, name: name.into(), ..control.clone() });
            }
            series.push(control);
        }
        for i in model_names.x.len() - model_names.integrals..model_names.x.len() {
            series.push(self.state_series(i, &states));
        }
        for (i, &name) in model_names.p.iter().take(model_names.model_parameter_count()).enumerate() {
            let parameter = match self.free.view().index_of(i) {
                Some(w) => self.free_parameter_series(name, w, &controls),
                None => {
                    let p = self.data.as_ref().get(intervals + 1..).unwrap_or_default();
                    let values = (0..=intervals).map(|k| get(p, k * P::Shape::NP + i)).collect();
                    Series::new(Kind::Parameter, name, 0, values)
                }
            };
            series.push(parameter.with_unit(unit_at(model_names.units.p, i)));
        }
        for (row, name) in constraint_names::<P::Path, _, T>().enumerate() {
            series.push(self.constraint_series(Kind::Path, name, row, &values).with_unit(P::Path::unit(row)));
        }
        for (row, name) in constraint_names::<P::Terminal, _, T>().enumerate() {
            let terminal = self.constraint_series(Kind::Terminal, name, row, &values);
            series.push(terminal.with_unit(P::Terminal::unit(row)));
        }
        for index in 0..layout.inner_rows {
            let (name, unit) = self.inner_row_name_and_unit(index);
            let row = node_row_count::<P, T>() + index;
            if self.inner_points.row::<P>(index).is_some_and(|row| row.point() > 0) {
                series.push(self.constraint_series(Kind::Inside, name, row, &values).with_unit(unit));
            }
        }
        let duration =
            self.iterate.stages().next().map_or(T::ONE, |first| self.free.view().duration(first.u));
        let times = self.times().iter().map(|&time| duration * time).collect();
        let (model, time_unit) = (model_names.model.into(), model_names.units.t.into());
        Ok(Trajectory { model, times, time_unit, series })
    }

    /// The series of a state of the QP: a state, a linear control or an integral.
    fn state_series(&self, i: usize, places: &BoundAccess<T>) -> Series<T> {
        let model_names = <P::Dynamics as Dynamics<T>>::NAMES;
        let kind = model_names.state_kind(i);
        let name = model_names.x.get(i).copied().unwrap_or_default();
        let values = self.iterate.stages().map(|stage| get(stage.x, i)).collect();
        let state = Series::new(kind, name, 0, values).with_unit(unit_at(model_names.units.x, i));
        let mut state = self.with_bounds_and_multipliers(state, i, places);
        let stages = self.iterate.stages().take(self.intervals());
        state.costates = stages.map(|stage| get(stage.dynamics, i)).collect();
        state
    }

    /// Computes the algebraic states of the iterate.
    pub(in crate::ocp) fn update_algebraic(&mut self) -> Result<(), OcpError> {
        if self.inner_points.count() > 0 {
            return self.simulate_pieces(None, |_, _| {});
        }
        let (layout, free) = (self.layout(), self.free.view());
        let data = split_data::<P, T>(self.data.as_mut(), layout);
        let Problem { dynamics, .. } = self.problem.parts();
        let (v, multipliers) = self.iterate.variables_and_costates();
        let nodes = interval_nodes::<P::Shape, T>(v, multipliers, &[], (data.p, free), data.times);
        dynamics.simulate(&nodes, &mut |k, step| {
            algebraic::store_interval::<P::Shape, T>(data.algebraic, free, k, step)
        })
    }

    /// The series of a free parameter, which is one variable, with its bounds and multipliers at
    /// every node.
    fn free_parameter_series(&self, name: &'static str, w: usize, places: &BoundAccess<T>) -> Series<T> {
        let nodes = self.intervals() + 1;
        let value = self.iterate.stages().next().map_or(T::ZERO, |stage| get(stage.u, w));
        let one =
            self.with_bounds_and_multipliers(Series::new(Kind::Parameter, name, 0, vec![value]), w, places);
        let Series { lower, upper, lower_multipliers, upper_multipliers, .. } = one;
        let mut series = Series::new(Kind::Parameter, name, 0, vec![value; nodes]);
        let repeat = |list: Vec<Option<T>>| list.into_iter().cycle().take(nodes).collect();
        (series.lower, series.upper) = (repeat(lower), repeat(upper));
        let repeat = |list: Vec<T>| list.into_iter().cycle().take(nodes).collect();
        (series.lower_multipliers, series.upper_multipliers) =
            (repeat(lower_multipliers), repeat(upper_multipliers));
        series
    }

    /// Adds the bounds and multipliers of states or controls to a series.
    fn with_bounds_and_multipliers(
        &self,
        mut series: Series<T>,
        i: usize,
        places: &BoundAccess<T>,
    ) -> Series<T> {
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

    /// The series of an output of constraints. The values of the last stage follow those of all
    /// others.
    fn constraint_series(&self, kind: Kind, name: String, row: usize, values: &[T]) -> Series<T> {
        let intervals = self.intervals();
        let stages = if kind == Kind::Terminal { intervals..intervals + 1 } else { 0..intervals };
        let layout = self.layout();
        let all = |list: &[T]| {
            stages.clone().map(|k| get(list, k * path_row_count::<P, T>(layout) + row)).collect::<Vec<_>>()
        };
        let mut series = Series::new(kind, name, stages.start, all(values));
        self.set_row_bounds(&mut series, row);
        series
    }

    /// Adds the bounds and multipliers of a row to a series.
    fn set_row_bounds(&self, series: &mut Series<T>, row: usize) {
        let layout = self.layout();
        let stages = series.first..series.first + series.values.len();
        let sides = constraint_bounds::<P, T>(self.data.as_ref(), layout);
        let of_side = |list: &[T]| {
            let bound = |k: usize| get(list, k * path_row_count::<P, T>(layout) + row);
            stages.clone().map(|k| Some(bound(k)).filter(|bound| bound.is_finite())).collect()
        };
        [series.lower, series.upper] = sides.map(of_side);
        for point in self.iterate.stages().skip(stages.start).take(stages.len()) {
            series.lower_multipliers.push(get(point.g_lower, row));
            series.upper_multipliers.push(get(point.g_upper, row));
        }
    }

    /// The row of the bounds of an algebraic state at nodes, if it has bounds.
    pub(super) fn algebraic_bound_row(&self, variable: usize) -> Option<usize> {
        let index = self.inner_points.bounded_variables().iter().position(|&row| row == (variable, 0))?;
        Some(node_row_count::<P, T>() + self.inner_points.count() * P::Path::ROWS + index)
    }
}
