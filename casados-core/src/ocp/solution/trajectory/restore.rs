//! A trajectory as the iterate of a problem, or as its guess.

use super::from_iterate::constraint_names;
use super::{Kind, Series, Trajectory, TrajectoryError};
use crate::ocp::formulation::bernstein;
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::instance::data::node_row_count;
use crate::ocp::formulation::problem::Formulation;
use crate::qp::element::{get, set};
use crate::qp::{SolutionStageMut, StageDims, copy_common};
use crate::scalar::Real;
use alloc::string::String;
use alloc::vec::Vec;

/// Access to one kind in a stage: values, multipliers of lower and of upper bounds.
type StageAccess<T> = for<'a, 'b> fn(&'b mut SolutionStageMut<'a, T>) -> [&'b mut [T]; 3];

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Makes a trajectory the iterate, with its multipliers, so that a warm-started run continues
    /// from it. The trajectory must be that of a problem with the same names and number of stages.
    ///
    /// # Errors
    /// [`TrajectoryError::Unknown`] for missing quantities, [`TrajectoryError::Length`];
    /// [`TrajectoryError::Problem`] if a value is not finite. The iterate is unchanged except in
    /// the last case.
    pub fn restore(&mut self, trajectory: &Trajectory<T>) -> Result<&mut Self, TrajectoryError> {
        let intervals = self.intervals();
        let model_names = <P::Dynamics as Dynamics<T>>::NAMES;
        let row_access: StageAccess<T> = |stage| [&mut [], &mut *stage.g_lower, &mut *stage.g_upper];
        let list = |names: &[&str]| names.iter().map(|&name| name.into()).collect::<Vec<String>>();
        let kinds: [(Kind, Vec<String>, StageAccess<T>); 4] = [
            (Kind::State, list(model_names.x), |stage| {
                [&mut *stage.x, &mut *stage.x_lower, &mut *stage.x_upper]
            }),
            (Kind::Control, list(model_names.u), |stage| {
                [&mut *stage.u, &mut *stage.u_lower, &mut *stage.u_upper]
            }),
            (Kind::Path, constraint_names::<P::Path, _, T>().collect(), row_access),
            (Kind::Terminal, constraint_names::<P::Terminal, _, T>().collect(), row_access),
        ];
        // All series are found before the iterate is changed.
        let mut found = Vec::new();
        for (kind, names, places) in kinds {
            let (first, count) = match kind {
                Kind::State => (0, intervals + 1),
                Kind::Terminal => (intervals, 1),
                _ => (0, intervals),
            };
            let of_kind = trajectory.series.iter().filter(|series| series.kind == kind);
            let of_kind: Vec<_> = of_kind.collect();
            for (index, name) in names.into_iter().enumerate() {
                let series_kind = match kind {
                    Kind::State => model_names.state_kind(index),
                    Kind::Control => model_names.control_kind(index),
                    kind => kind,
                };
                // Repeated functions have the same names, in the same order.
                let series = match of_kind.get(index).filter(|series| series.name == name) {
                    Some(&series) => series,
                    None => trajectory.series_of_kind(&name, series_kind)?,
                };
                let costates = if kind == Kind::State { intervals } else { 0 };
                check_lengths(series, [count, count, count, costates])?;
                let index = if kind == Kind::Control { self.free.count() + index } else { index };
                found.push((index, first, series, places));
            }
        }
        for index in 0..self.layout().inner_rows {
            let at_node = self.inner_points.row::<P>(index).is_none_or(|row| row.point() == 0);
            let kind = if at_node { Kind::Algebraic } else { Kind::Inside };
            let series = trajectory.series_of_kind(&self.inner_row_name_and_unit(index).0, kind)?;
            check_lengths(series, [intervals, intervals, intervals, 0])?;
            found.push((node_row_count::<P, T>() + index, 0, series, row_access));
        }
        let mut free = Vec::new();
        for (parameter, &name) in model_names.p.iter().enumerate() {
            if let Some(w) = self.free.view().index_of(parameter) {
                let series = trajectory.series_of_kind(name, Kind::Parameter)?;
                check_lengths(
                    series,
                    [intervals + 1, series.lower_multipliers.len(), series.upper_multipliers.len(), 0],
                )?;
                free.push((w, series));
            }
        }
        for (w, series) in free {
            self.write_free_parameter(w, get(&series.values, 0));
            if let Some(first) = self.iterate.stage_mut(0) {
                set(first.u_lower, w, get(&series.lower_multipliers, 0));
                set(first.u_upper, w, get(&series.upper_multipliers, 0));
            }
        }
        for (index, first, series, places) in found {
            for (k, &value) in series.values.iter().enumerate() {
                let Some(mut stage) = self.iterate.stage_mut(first + k) else { continue };
                let multipliers =
                    [&series.lower_multipliers, &series.upper_multipliers].map(|list| get(list, k));
                let given = [value, multipliers[0], multipliers[1]];
                for (to, from) in places(&mut stage).into_iter().zip(given) {
                    set(to, index, from);
                }
                if let Some(&costate) = series.costates.get(k) {
                    set(stage.dynamics, index, costate);
                }
            }
        }
        self.update_initial_state_copies();
        self.algebraic_is_current = false;
        self.check_iterate()?;
        Ok(self)
    }

    /// Makes a trajectory the guess: states are interpolated linearly between its points, controls
    /// are those that apply at a time, free parameters are copied if it has them, and multipliers
    /// are zero. Horizons may differ, as between a coarse and a fine grid. Outside its times the
    /// nearest values are taken.
    ///
    /// # Errors
    /// [`TrajectoryError::Unknown`] for a missing state or control; [`TrajectoryError::Problem`] if
    /// a value is not finite.
    ///
    /// # Example
    /// ```
    /// use casados::ocp::{HeapSqp, Horizon, LeastSquaresCost, Problem};
    /// use casados::prelude::*;
    ///
    /// #[ode]
    /// fn fall(x: f64, u: f64) -> f64 { u - x }
    /// #[function]
    /// fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
    ///
    /// let problem = |intervals, length| {
    ///     let erk = Erk::<Fall, Rk4>::new(Options::default())?;
    ///     let cost = LeastSquaresCost::<Both>::diagonal(&[1.0, 0.1]);
    ///     let mut ocp = Problem::new(erk).running_cost(cost).on(Horizon::uniform(intervals, length))?;
    ///     ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
    ///     Ok::<_, Box<dyn std::error::Error>>(ocp)
    /// };
    /// let (mut coarse, mut fine) = (problem(5, 0.2)?, problem(20, 0.05)?);
    /// HeapSqp::new(&coarse)?.solve(&mut coarse)?;
    /// fine.guess_from(&coarse.solution()?)?;
    /// assert_eq!(fine.stage(8)?.x, coarse.stage(2)?.x);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn guess_from(&mut self, trajectory: &Trajectory<T>) -> Result<&mut Self, TrajectoryError> {
        let model_names = <P::Dynamics as Dynamics<T>>::NAMES;
        let all_series = |names: &[&str], kind| {
            names.iter().map(|&name| trajectory.series_of_kind(name, kind)).collect::<Result<Vec<_>, _>>()
        };
        let model_states = model_names.x.get(..model_names.model_state_count()).unwrap_or_default();
        let controls: Vec<&str> =
            model_names.model_controls().map(|(first, _)| model_names.control_name(first)).collect();
        let (states, controls) =
            (all_series(model_states, Kind::State)?, all_series(&controls, Kind::Control)?);
        let (mut x, mut u) = (Vec::new(), Vec::new());
        for k in 0..=self.intervals() {
            let unit =
                if self.free.view().end_time_index().is_some() { trajectory.end_time() } else { T::ONE };
            let time = unit * get(self.times(), k);
            let (before, fraction) = interval_and_fraction(&trajectory.times, time);
            x.clear();
            u.clear();
            let linear = |series: &Series<T>| {
                let [start, end] = [before, before + 1].map(|k| element_or_last(&series.values, k));
                start + fraction * (end - start)
            };
            x.extend(states.iter().map(|series| linear(series)));
            if k < self.intervals() || !model_names.linear.is_empty() {
                // A linear control has a value at the last time too.
                let is_linear = |series: &Series<T>| series.values.len() == trajectory.times.len();
                let at = |series: &&Series<T>| match is_linear(series) {
                    true => linear(series),
                    false => element_or_last(&series.values, before),
                };
                u.extend(controls.iter().map(at));
            }
            self.guess_stage(k, &x, &u)?;
            self.guess_polynomials(k, unit, trajectory, before);
        }
        for (parameter, &name) in model_names.p.iter().enumerate() {
            if let Some(w) = self.free.view().index_of(parameter)
                && let Ok(series) = trajectory.series_of_kind(name, Kind::Parameter)
            {
                self.write_free_parameter(w, get(&series.values, 0));
            }
        }
        self.check_iterate()?;
        Ok(self)
    }
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Sets the polynomial controls of an interval to the parts of those of a trajectory in its
    /// interval `from`, if the trajectory has coefficients.
    fn guess_polynomials(&mut self, k: usize, unit: T, trajectory: &Trajectory<T>, from: usize) {
        let model_names = <P::Dynamics as Dynamics<T>>::NAMES;
        let from = from.min(trajectory.times.len().saturating_sub(2));
        let [start, end] = [from, from + 1].map(|node| element_or_last(&trajectory.times, node));
        let nodes = [k, k + 1].map(|node| unit * element_or_last(self.times(), node));
        let ends = nodes.map(|time| ((time - start) / (end - start)).max(T::ZERO).min(T::ONE));
        let free = self.free.count();
        for (first, degree) in model_names.model_controls().filter(|&(_, degree)| degree > 0) {
            let names = model_names.u.get(first..=first + degree).unwrap_or_default();
            let series: Result<Vec<_>, _> =
                names.iter().map(|name| trajectory.series_of_kind(name, Kind::Coefficient)).collect();
            let (Ok(series), Some(stage)) = (series, self.iterate.stage_mut(k)) else { continue };
            let coefficients: Vec<T> = series.iter().map(|one| element_or_last(&one.values, from)).collect();
            let part = bernstein::restriction(&coefficients, ends);
            copy_common(stage.u.get_mut(free + first..).unwrap_or_default(), &part);
        }
    }
}

/// Returns the point at or before a time, up to rounding errors, and the fraction of the interval
/// from there.
fn interval_and_fraction<T: Real>(times: &[T], time: T) -> (usize, T) {
    let rounding =
        T::from_f64(16.0 * T::EPSILON) * (element_or_last(times, times.len()) - element_or_last(times, 0));
    let next = times.iter().position(|&other| time + rounding < other).unwrap_or(times.len());
    let before = next.saturating_sub(1);
    let (start, end) = (element_or_last(times, before), element_or_last(times, before + 1));
    if start < time && start < end { (before, (time - start) / (end - start)) } else { (before, T::ZERO) }
}

/// An element, or the last one.
fn element_or_last<T: Real>(values: &[T], index: usize) -> T {
    values.get(index).or(values.last()).copied().unwrap_or(T::ZERO)
}

/// Checks the lengths of a series: values, multipliers of lower and upper bounds, costates.
fn check_lengths<T>(series: &Series<T>, expected: [usize; 4]) -> Result<(), TrajectoryError> {
    let Series { values, lower_multipliers, upper_multipliers, costates, name, .. } = series;
    let lists = [values, lower_multipliers, upper_multipliers, costates].map(Vec::len);
    match lists.into_iter().zip(expected).find(|(found, expected)| found != expected) {
        None => Ok(()),
        Some((found, expected)) => Err(TrajectoryError::Length { name: name.clone(), found, expected }),
    }
}
