//! Soft bounds of variables and constraints, by name, stage and side.

use crate::ocp::formulation::check::{Labels, first_stage, stage_range};
use crate::ocp::formulation::error::{OcpError, Part, Text};
use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::instance::data::{path_row_count, split_data};
use crate::ocp::formulation::instance::inner_points::inner_path_row;
use crate::ocp::formulation::labels::output_name;
use crate::ocp::formulation::problem::Formulation;
use crate::ocp::formulation::variable_bounds::matching_inner_rows;
use crate::qp::element::get;
use crate::qp::{Side, StageDims};
use crate::scalar::Real;
use crate::structure::name_matches;
use core::ops::RangeBounds;

const BOTH_SIDES: &[Side] = &[Side::Lower, Side::Upper];

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Makes bounds of states, controls or constraints soft: a violation `e` costs
    /// `linear · e + ½ quadratic · e²`. An infinite linear penalty makes them hard again.
    ///
    /// A name denotes variables as in [`Ocp::bound`], or constraints: their function, or one of its
    /// outputs, `Corner[2]`. Path constraints exist at all stages but the last, terminal
    /// constraints at the last. [`Ocp::soften_lower`] and [`Ocp::soften_upper`] soften one side.
    ///
    /// # Errors
    /// [`OcpError::UnknownName`], [`OcpError::NoSuchStage`], [`OcpError::EmptyRange`],
    /// [`OcpError::InvalidValue`]; [`OcpError::NoBound`] if no variable or constraint with this
    /// name has a bound at these stages. After an error no penalty is changed.
    pub fn soften(
        &mut self,
        name: &str,
        stages: impl RangeBounds<usize>,
        linear: T,
        quadratic: T,
    ) -> Result<&mut Self, OcpError> {
        self.soften_sides(name, stages, BOTH_SIDES, [linear, quadratic])
    }

    /// As [`Ocp::soften`], for lower bounds only.
    ///
    /// # Errors
    /// As [`Ocp::soften`].
    pub fn soften_lower(
        &mut self,
        name: &str,
        stages: impl RangeBounds<usize>,
        linear: T,
        quadratic: T,
    ) -> Result<&mut Self, OcpError> {
        self.soften_sides(name, stages, &[Side::Lower], [linear, quadratic])
    }

    /// As [`Ocp::soften`], for upper bounds only.
    ///
    /// # Errors
    /// As [`Ocp::soften`].
    ///
    /// # Example
    /// The cost pulls towards 3 with the force `3 − x`: the upper bound 1 is violated until the
    /// force is its penalty.
    /// ```
    /// use casados::ocp::{Constraint, HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
    /// use casados::prelude::*;
    ///
    /// #[function]
    /// fn go(x: f64, u: f64) -> f64 { x + u }
    /// #[function]
    /// fn place(x: f64, _u: f64) -> f64 { x }
    ///
    /// let mut ocp = Problem::new(Map::<Go, f64>::new())
    ///     .terminal_cost(LeastSquaresCost::<Place>::diagonal(&[1.0]))
    ///     .terminal_constraints(Constraint::<Place>::new([-1.0], [1.0]))
    ///     .on(Horizon::uniform(1, 1.0))?;
    /// ocp.fix_initial_state(&[0.0])?.set_terminal_reference(&[3.0])?;
    /// ocp.soften_upper("Place", .., 0.5, 0.0)?.guess(&[0.0], &[0.0])?;
    /// assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
    /// assert!((ocp.stage(1)?.x[0] - 2.5).abs() < 1e-6);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn soften_upper(
        &mut self,
        name: &str,
        stages: impl RangeBounds<usize>,
        linear: T,
        quadratic: T,
    ) -> Result<&mut Self, OcpError> {
        self.soften_sides(name, stages, &[Side::Upper], [linear, quadratic])
    }

    fn soften_sides(
        &mut self,
        name: &str,
        stages: impl RangeBounds<usize>,
        sides: &[Side],
        penalty: [T; 2],
    ) -> Result<&mut Self, OcpError> {
        let model_names = self.names();
        let is_variable = model_names
            .x
            .iter()
            .chain(model_names.u)
            .chain(model_names.z)
            .any(|variable| name_matches(name, variable));
        let is_path = (0..P::Path::ROWS).any(|row| output_name::<P::Path, _, T>(row).matches(name));
        let is_terminal =
            (0..P::Terminal::ROWS).any(|row| output_name::<P::Terminal, _, T>(row).matches(name));
        let end_without_bound = if !is_variable && (is_path || is_terminal) {
            self.soften_constraints(name, &stages, [is_path, is_terminal], sides, penalty)?
        } else {
            self.soften_variables(name, &stages, sides, penalty)?
        };
        match end_without_bound {
            None => Ok(self),
            Some(end) => Err(OcpError::NoBound { name: Text::new(name), start: first_stage(&stages), end }),
        }
    }

    /// Softens bounds of variables. Returns the end of the range of stages if there is no bound.
    fn soften_variables(
        &mut self,
        name: &str,
        stages: &impl RangeBounds<usize>,
        sides: &[Side],
        [linear, quadratic]: [T; 2],
    ) -> Result<Option<usize>, OcpError> {
        let stages_by_kind = self.stages_of_name(name, stages)?;
        let (labels, index) = self.labels_of_name(name, first_stage(stages));
        labels.check_penalty(index, linear, quadratic)?;
        let row_stages = self.inner_row_stages(name, stages, &stages_by_kind)?;
        let layout = self.layout();
        let data = split_data::<P, T>(self.data.as_mut(), layout);
        let rows: &dyn Fn() -> _ = &|| matching_inner_rows::<P, T>(&self.inner_points, name);
        let row_index = |k: usize, row: usize| k * path_row_count::<P, T>(layout) + row;
        let bounds_of_side = |side: &Side| if *side == Side::Lower { &*data.lower } else { &*data.upper };
        let mut is_bounded = row_stages.clone().any(|k| {
            rows()
                .any(|row| sides.iter().any(|side| get(bounds_of_side(side), row_index(k, row)).is_finite()))
        });
        self.for_each_bound(name, stages_by_kind.clone(), |bounds, index| {
            let bounds_of_side =
                |&side: &Side| if side == Side::Lower { &*bounds.lower } else { &*bounds.upper };
            is_bounded |= sides.iter().map(bounds_of_side).any(|list| get(list, index).is_finite());
        });
        if !is_bounded {
            return Ok(stages_by_kind.iter().chain([&row_stages]).map(|range| range.end).max());
        }
        self.for_each_bound(name, stages_by_kind, |bounds, index| {
            sides.iter().for_each(|&side| bounds.soften_side(index, side, linear, quadratic));
        });
        for (_, mut stage) in self.qp.stages_mut().enumerate().filter(|(k, _)| row_stages.contains(k)) {
            for row in matching_inner_rows::<P, T>(&self.inner_points, name) {
                sides.iter().for_each(|&side| stage.g_bounds_mut().soften_side(row, side, linear, quadratic));
            }
        }
        Ok(None)
    }

    /// Softens bounds of constraints. Returns the end of the range of stages if there is no bound.
    fn soften_constraints(
        &mut self,
        name: &str,
        stages: &impl RangeBounds<usize>,
        [is_path, is_terminal]: [bool; 2],
        sides: &[Side],
        [linear, quadratic]: [T; 2],
    ) -> Result<Option<usize>, OcpError> {
        let last = self.intervals();
        let part = if is_path { Part::PathBounds } else { Part::TerminalBounds };
        let range = stage_range(part, stages, if is_terminal { last + 1 } else { last })?;
        let row = match is_path {
            true => (0..P::Path::ROWS).find(|&row| output_name::<P::Path, _, T>(row).matches(name)),
            false => (0..P::Terminal::ROWS).find(|&row| output_name::<P::Terminal, _, T>(row).matches(name)),
        };
        let labels = Labels::constraints::<P, T>(part, range.start);
        labels.check_penalty(row.unwrap_or(0), linear, quadratic)?;
        let (layout, points) = (self.layout(), self.inner_points.count());
        let data = split_data::<P, T>(self.data.as_mut(), layout);
        let rows = |k: usize| {
            let count = if k == last { P::Terminal::ROWS } else { P::Path::ROWS };
            let points = if k == last { 0 } else { points };
            let matching_rows = (0..count).filter(move |&row| match k == last {
                true => output_name::<P::Terminal, _, T>(row).matches(name),
                false => output_name::<P::Path, _, T>(row).matches(name),
            });
            // The rows at the node and at every point.
            let point_rows =
                move |row: usize| (1..=points).map(move |point| inner_path_row::<P, T>(row, point));
            matching_rows.flat_map(move |row| core::iter::once(row).chain(point_rows(row)))
        };
        let has_bound = |place: usize| {
            let bounds_of_side = |&side: &Side| if side == Side::Lower { &*data.lower } else { &*data.upper };
            sides.iter().map(bounds_of_side).any(|list| get(list, place).is_finite())
        };
        if !range.clone().any(|k| rows(k).any(|row| has_bound(k * path_row_count::<P, T>(layout) + row))) {
            return Ok(Some(range.end));
        }
        for (k, mut stage) in self.qp.stages_mut().enumerate().filter(|(k, _)| range.contains(k)) {
            for (row, &side) in rows(k).flat_map(|row| sides.iter().map(move |side| (row, side))) {
                stage.g_bounds_mut().soften_side(row, side, linear, quadratic);
            }
        }
        Ok(None)
    }
}
