//! Bounds of constraints, initial state, parameters and references.

use crate::ocp::formulation::check::{Labels, stage_range};
use crate::ocp::formulation::error::{ConstraintName, OcpError, Part, Text};
use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::functions::cost::Cost;
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::instance::data::{node_row_count, path_row_count, split_data};
use crate::ocp::formulation::instance::inner_points::inner_path_row;
use crate::ocp::formulation::instance::{InitialState, Ocp};
use crate::ocp::formulation::names::Names;
use crate::ocp::formulation::problem::Formulation;
use crate::qp::{BoundsMut, QpError, QpField, Side, StageDims, check};
use crate::scalar::Real;
use crate::shape::Shape;
use crate::structure::name_matches;
use core::ops::{Range, RangeBounds};

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Returns the bounds of a general constraint of a stage as the user gave them.
    #[cfg(feature = "casadi")]
    pub(crate) fn given_bounds(&self, stage: usize, row: usize) -> [T; 2] {
        let (intervals, layout) = (self.intervals(), self.layout());
        let rows = intervals * path_row_count::<P, T>(layout) + P::Terminal::ROWS;
        let references = intervals * P::StageCost::REFERENCES + P::TerminalCost::REFERENCES;
        let begin =
            (intervals + 1) * (1 + P::Shape::NP) + references + stage * path_row_count::<P, T>(layout) + row;
        [begin, begin + rows].map(|i| self.data.as_ref().get(i).copied().unwrap_or(T::ZERO))
    }

    /// Returns the names of the model and its variables.
    #[must_use]
    pub fn names(&self) -> Names {
        <P::Dynamics as Dynamics<T>>::NAMES
    }

    /// Returns the stages at which a name denotes states, controls and free parameters. The range
    /// is empty for a kind of variable without this name.
    ///
    /// # Errors
    /// [`OcpError::UnknownName`], [`OcpError::NoSuchStage`], [`OcpError::EmptyRange`]
    pub(in crate::ocp) fn stages_of_name(
        &self,
        name: &str,
        stages: &impl RangeBounds<usize>,
    ) -> Result<[Range<usize>; 3], OcpError> {
        let model_names = self.names();
        let matching_stages =
            |part, names: &[&str], count| match names.iter().any(|variable| name_matches(name, variable)) {
                true => stage_range(part, stages, count),
                false => Ok(0..0),
            };
        let of_states = matching_stages(Part::StateBounds, model_names.x, self.intervals() + 1)?;
        let of_controls = matching_stages(Part::ControlBounds, model_names.u, self.intervals())?;
        // Free parameters are the same at all stages.
        let is_free = model_names
            .p
            .iter()
            .enumerate()
            .any(|(p, name_of_p)| self.matches_free_parameter(name, p, name_of_p));
        let is_algebraic =
            P::Dynamics::ALGEBRAIC && model_names.z.iter().any(|variable| name_matches(name, variable));
        if of_states.is_empty() && of_controls.is_empty() && !is_free && !is_algebraic {
            let known = const { &<P::Dynamics as Dynamics<T>>::NAMES };
            return Err(OcpError::UnknownName { name: Text::new(name), known });
        }
        Ok([of_states, of_controls, 0..usize::from(is_free)])
    }

    fn matches_free_parameter(&self, name: &str, parameter: usize, parameter_name: &str) -> bool {
        name_matches(name, parameter_name) && self.free.view().index_of(parameter).is_some()
    }

    /// Applies a function to the bounds of every variable with this name.
    pub(in crate::ocp) fn for_each_bound(
        &mut self,
        name: &str,
        [of_states, of_controls, of_free]: [Range<usize>; 3],
        mut visit: impl FnMut(&mut BoundsMut<'_, T>, usize),
    ) {
        let model_names = self.names();
        // A fixed state has no bounds to set.
        let fixed_states = match self.initial_state {
            InitialState::Fixed => model_names.x.len(),
            InitialState::PartlyFixed => model_names.model_state_count(),
            _ => 0,
        };
        let first_integral = model_names.x.len() - model_names.integrals;
        let free = self.free.view();
        for (k, mut stage) in self.qp.stages_mut().enumerate() {
            let is_fixed = |index: usize| k == 0 && (index < fixed_states || index >= first_integral);
            let matches_name = |(_, variable): &(usize, &&str)| name_matches(name, variable);
            if of_states.contains(&k) {
                let states = model_names.x.iter().enumerate().filter(matches_name).map(|(index, _)| index);
                states.filter(|&i| !is_fixed(i)).for_each(|i| visit(&mut stage.x_bounds_mut(), i));
            }
            if of_controls.contains(&k) {
                let controls = model_names.u.iter().enumerate().filter(matches_name);
                controls.for_each(|(j, _)| visit(&mut stage.u_bounds_mut(), free.count() + j));
            }
            if of_free.contains(&k) {
                let meant =
                    model_names.p.iter().enumerate().filter(|(_, variable)| name_matches(name, variable));
                let meant = meant.filter_map(|(parameter, _)| free.index_of(parameter));
                meant.for_each(|w| visit(&mut stage.u_bounds_mut(), w));
            }
        }
    }

    /// Returns the labels and the index of the first variable with this name, for errors at this
    /// stage.
    pub(in crate::ocp) fn labels_of_name(&self, name: &str, stage: usize) -> (Labels, usize) {
        let model_names = self.names();
        let position = |names: &[&str]| names.iter().position(|variable| name_matches(name, variable));
        match [model_names.x, model_names.u, model_names.z, model_names.p].map(position) {
            [Some(index), ..] => (Labels::states::<P, T>(Part::StateBounds, stage), index),
            [_, Some(index), ..] => (Labels::controls::<P, T>(Part::ControlBounds, stage), index),
            [_, _, Some(index), _] => (Labels::algebraic::<P, T>(Part::AlgebraicBounds, stage), index),
            [.., index] => (Labels::parameters::<P, T>(Part::ParameterBounds, 0), index.unwrap_or(0)),
        }
    }

    /// Sets the bounds of the path constraints at these stages.
    ///
    /// # Errors
    /// [`OcpError::Length`], [`OcpError::NoSuchStage`], [`OcpError::EmptyRange`],
    /// [`OcpError::CrossedBounds`], [`OcpError::InvalidValue`]
    pub fn set_path_bounds(
        &mut self,
        stages: impl RangeBounds<usize>,
        lower: &[T],
        upper: &[T],
    ) -> Result<&mut Self, OcpError> {
        let range = stage_range(Part::PathBounds, &stages, self.intervals())?;
        self.write_bounds(Part::PathBounds, range, P::Path::ROWS, lower, upper)
    }

    /// Sets the bounds of the terminal constraints.
    ///
    /// # Errors
    /// [`OcpError::Length`], [`OcpError::CrossedBounds`], [`OcpError::InvalidValue`]
    pub fn set_terminal_bounds(&mut self, lower: &[T], upper: &[T]) -> Result<&mut Self, OcpError> {
        let last = self.intervals();
        self.write_bounds(Part::TerminalBounds, last..last + 1, P::Terminal::ROWS, lower, upper)
    }

    fn write_bounds(
        &mut self,
        part: Part,
        stages: Range<usize>,
        rows: usize,
        lower: &[T],
        upper: &[T],
    ) -> Result<&mut Self, OcpError> {
        let labels = Labels::constraints::<P, T>(part, stages.start);
        labels.check_length(lower, rows)?;
        labels.check_length(upper, rows)?;
        for (index, (&lower, &upper)) in lower.iter().zip(upper).enumerate() {
            labels.check_bounds(index, lower, upper)?;
        }
        let (layout, points) = (self.layout(), self.inner_points.count());
        let data = split_data::<P, T>(self.data.as_mut(), layout);
        for k in stages {
            for (bounds, given) in [(&mut *data.lower, lower), (&mut *data.upper, upper)] {
                // The rows of the last stage follow those of all other stages.
                let begin = k * path_row_count::<P, T>(layout);
                crate::qp::copy_common(crate::qp::part_mut(bounds, begin, rows), given);
                for point in if part == Part::PathBounds { 1..points + 1 } else { 0..0 } {
                    let row = inner_path_row::<P, T>(0, point);
                    crate::qp::copy_common(crate::qp::part_mut(bounds, begin + row, rows), given);
                }
            }
        }
        Ok(self)
    }

    /// Fixes the initial state. `x0` excludes linear controls, which are free at the start, and
    /// integrals, which start at zero.
    ///
    /// # Errors
    /// [`OcpError::Length`], [`OcpError::InvalidValue`]
    pub fn fix_initial_state(&mut self, x0: &[T]) -> Result<&mut Self, OcpError> {
        let model_names = self.names();
        let model_states = model_names.model_state_count();
        Labels::states::<P, T>(Part::InitialState, 0).check_vector(x0, model_states)?;
        if model_states == P::Shape::NX {
            self.qp.fix_initial_state(x0)?;
        } else if let Some(mut stage) = self.qp.stage_mut(0) {
            let (infinity, mut bounds) = (T::from_f64(f64::INFINITY), stage.x_bounds_mut());
            for (i, &value) in x0.iter().enumerate() {
                bounds.set(i, value, value);
                bounds.soften(i, infinity, T::ZERO);
            }
        }
        self.initial_state =
            if model_names.linear.is_empty() { InitialState::Fixed } else { InitialState::PartlyFixed };
        Ok(self)
    }

    /// Frees the initial state; it may be bounded like any other state. A state that was fixed has
    /// no bounds until new ones are set.
    pub fn free_initial_state(&mut self) -> &mut Self {
        let was_fixed = matches!(self.initial_state, InitialState::Fixed | InitialState::PartlyFixed);
        let model_states = self.names().model_state_count();
        self.initial_state = InitialState::Free;
        let infinity = T::from_f64(f64::INFINITY);
        if was_fixed && let Some(mut stage) = self.qp.stage_mut(0) {
            let mut bounds = stage.x_bounds_mut();
            (0..model_states).for_each(|i| bounds.set(i, -infinity, infinity));
        }
        self
    }

    /// Returns the times of the nodes; with a free end time, as fractions of the horizon.
    #[must_use]
    pub fn times(&self) -> &[T] {
        crate::qp::part(self.data.as_ref(), 0, self.intervals() + 1)
    }

    /// Sets the parameters at these nodes. The parameters of the last node are those of the
    /// terminal cost and constraints.
    ///
    /// # Errors
    /// [`OcpError::Length`], [`OcpError::NoSuchStage`], [`OcpError::EmptyRange`],
    /// [`OcpError::InvalidValue`]
    pub fn set_parameters(
        &mut self,
        stages: impl RangeBounds<usize>,
        p: &[T],
    ) -> Result<&mut Self, OcpError> {
        let intervals = self.intervals();
        let range = stage_range(Part::Parameters, &stages, intervals + 1)?;
        let count = self.names().model_parameter_count();
        Labels::parameters::<P, T>(Part::Parameters, range.start).check_vector(p, count)?;
        let layout = self.layout();
        let data = split_data::<P, T>(self.data.as_mut(), layout);
        for k in range {
            crate::qp::copy_common(crate::qp::part_mut(data.p, k * P::Shape::NP, P::Shape::NP), p);
        }
        Ok(self)
    }

    /// Sets the reference of the stage cost at these stages; zero by default.
    ///
    /// # Errors
    /// [`OcpError::Length`], [`OcpError::NoSuchStage`], [`OcpError::EmptyRange`],
    /// [`OcpError::InvalidValue`]
    pub fn set_reference(
        &mut self,
        stages: impl RangeBounds<usize>,
        reference: &[T],
    ) -> Result<&mut Self, OcpError> {
        let (intervals, length) = (self.intervals(), P::StageCost::REFERENCES);
        let range = stage_range(Part::Reference, &stages, intervals)?;
        Labels::references::<P, T>(Part::Reference, range.start).check_vector(reference, length)?;
        let layout = self.layout();
        let data = split_data::<P, T>(self.data.as_mut(), layout);
        for k in range {
            crate::qp::copy_common(crate::qp::part_mut(data.references, k * length, length), reference);
        }
        Ok(self)
    }

    /// Sets the reference of the stage cost at every stage. The function gets the stage, the time
    /// of its node and the reference to write, which is zero before.
    ///
    /// ```
    /// # use casados::ocp::*;
    /// # use casados::prelude::*;
    /// # #[function]
    /// # fn push(x: f64, u: f64) -> f64 { x + u }
    /// # #[function]
    /// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
    /// # let mut ocp = Problem::new(Map::<Push, f64>::new())
    /// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0, 1e-4]))
    /// #     .on(Horizon::uniform(20, 0.1))?;
    /// # ocp.fix_initial_state(&[0.0])?.guess(&[0.0], &[0.0])?;
    /// // `x` follows a sine, and `u` stays small.
    /// ocp.set_references(|_stage, t, reference| reference[0] = t.sin())?;
    /// HeapSqp::new(&ocp)?.solve(&mut ocp)?;
    /// let x = ocp.solution()?.state("x")?[10];
    /// assert!((x - 1.0_f64.sin()).abs() < 1e-3);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`OcpError::InvalidValue`]; the references of the stages before the error are set.
    pub fn set_references(
        &mut self,
        mut write: impl FnMut(usize, T, &mut [T]),
    ) -> Result<&mut Self, OcpError> {
        let (intervals, length) = (self.intervals(), P::StageCost::REFERENCES);
        let layout = self.layout();
        let data = split_data::<P, T>(self.data.as_mut(), layout);
        for (k, &mut time) in data.times.iter_mut().enumerate().take(intervals) {
            let reference = crate::qp::part_mut(data.references, k * length, length);
            reference.fill(T::ZERO);
            write(k, time, reference);
            Labels::references::<P, T>(Part::Reference, k).check_vector(reference, length)?;
        }
        Ok(self)
    }

    /// Sets the reference of the terminal cost; zero by default.
    ///
    /// # Errors
    /// [`OcpError::Length`], [`OcpError::InvalidValue`]
    pub fn set_terminal_reference(&mut self, reference: &[T]) -> Result<&mut Self, OcpError> {
        let (intervals, length) = (self.intervals(), P::TerminalCost::REFERENCES);
        Labels::references::<P, T>(Part::TerminalReference, intervals).check_vector(reference, length)?;
        let layout = self.layout();
        let data = split_data::<P, T>(self.data.as_mut(), layout);
        let begin = intervals * P::StageCost::REFERENCES;
        crate::qp::copy_common(crate::qp::part_mut(data.references, begin, length), reference);
        Ok(self)
    }

    /// Returns the name of a constraint of the QP.
    pub(in crate::ocp) fn constraint_name(
        &self,
        field: QpField,
        stage: usize,
        index: usize,
        side: Side,
    ) -> ConstraintName {
        let names = self.names();
        let name_at = |list: &[&'static str]| list.get(index).copied().unwrap_or("");
        let mut point = 0;
        let (part, (name, output)) = match field {
            QpField::StateBounds => (Part::StateBounds, (name_at(names.x), 0)),
            QpField::ControlBounds => match index.checked_sub(self.free.count()) {
                Some(u) => (Part::ControlBounds, (names.u.get(u).copied().unwrap_or(""), 0)),
                None => (Part::ParameterBounds, (self.free_parameter_name(index), 0)),
            },
            _ if stage == self.intervals() => (Part::TerminalBounds, P::Terminal::name(index)),
            _ => match index.checked_sub(P::Path::ROWS) {
                Some(_) if index >= node_row_count::<P, T>() => {
                    let (row, name) = self.inner_points.row_name::<P>(index - node_row_count::<P, T>());
                    point = row.point();
                    (row.bounds_part::<P, T>(), name)
                }
                Some(copy) => (Part::StateBounds, (self.free_parameter_name(copy), 0)),
                None => (Part::PathBounds, P::Path::name(index)),
            },
        };
        ConstraintName { part, stage, name, output, point, side, phase: None }
    }

    /// Returns the first non-finite derivative in the QP.
    pub(in crate::ocp) fn find_non_finite_derivative(&self, error: &QpError) -> Option<OcpError> {
        // Every error but infeasibility may be due to non-finite data. `check` visits derivatives
        // before the bounds and constants that depend on them.
        if matches!(error, QpError::Infeasible { .. }) {
            return None;
        }
        let Err(QpError::InvalidValue { field, stage, index, value }) = check(self.qp()) else { return None };
        let model_names = self.names();
        let (nx, nu) = (model_names.x.len(), self.free.count() + model_names.u.len());
        let input = |index: usize| match index.checked_sub(self.free.count()) {
            Some(u) => model_names.u.get(u).copied().unwrap_or(""),
            None => self.free_parameter_name(index),
        };
        let state = |index: usize| model_names.x.get(index).copied().unwrap_or("");
        let rows = match field {
            QpField::A | QpField::B | QpField::Q => nx,
            QpField::C | QpField::D if stage == self.intervals() => P::Terminal::ROWS,
            QpField::C | QpField::D => path_row_count::<P, T>(self.layout()),
            QpField::R | QpField::S => nu,
            QpField::GradientX | QpField::GradientU => 1,
            _ => return None,
        };
        let (row, column) = (index.checked_rem(rows)?, index.checked_div(rows)?);
        let by = match field {
            QpField::A | QpField::Q | QpField::S | QpField::C | QpField::GradientX => state(column),
            _ => input(column),
        };
        let (of, output) = match field {
            QpField::C | QpField::D if stage == self.intervals() => P::Terminal::name(row),
            QpField::C | QpField::D => {
                let name = self.name(QpField::GeneralBounds, stage, row, Side::Lower);
                (name.name, name.output)
            }
            QpField::A | QpField::B | QpField::Q => (state(row), 0),
            QpField::R | QpField::S => (input(row), 0),
            _ => ("", 0),
        };
        Some(OcpError::NonFiniteDerivative { field, stage, of, output, by, value, phase: None })
    }
}
