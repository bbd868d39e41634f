//! Bounds by name, and checks of bounds.

use super::data::split;
use super::dynamics::{Dynamics, Names};
use super::error::{ConstraintName, OcpError, Part, Text};
use super::instance::{Initial, Ocp};
use super::problem::Formulation;
use super::{constraint::Constraints, cost::Cost};
use crate::qp::{BoundsMut, Field, QpError, Side, StageDims};
use crate::scalar::Real;
use crate::shape::Shape;
use core::ops::{Bound, Range, RangeBounds};

/// # Errors
/// [`OcpError::CrossedBounds`], [`OcpError::InvalidValue`]
pub(super) fn check<T: Real>(
    part: Part,
    stage: usize,
    index: usize,
    lower: T,
    upper: T,
) -> Result<(), OcpError> {
    let infinity = T::from_f64(f64::INFINITY);
    if lower <= upper && lower < infinity && upper > -infinity {
        return Ok(());
    }
    let (lower, upper) = (lower.to_f64(), upper.to_f64());
    Err(if lower.is_nan() || lower == f64::INFINITY {
        OcpError::InvalidValue { part, stage, index, value: lower }
    } else if upper.is_nan() || upper == f64::NEG_INFINITY {
        OcpError::InvalidValue { part, stage, index, value: upper }
    } else {
        OcpError::CrossedBounds { part, stage, index, lower, upper }
    })
}

/// A linear penalty may be infinite: then the bound is hard.
///
/// # Errors
/// [`OcpError::InvalidValue`]
pub(super) fn check_penalty<T: Real>(
    stage: usize,
    index: usize,
    linear: T,
    quadratic: T,
) -> Result<(), OcpError> {
    let part = Part::Penalty;
    let is_penalty = linear >= T::ZERO;
    if !is_penalty {
        return Err(OcpError::InvalidValue { part, stage, index, value: linear.to_f64() });
    }
    if !(quadratic >= T::ZERO && quadratic.is_finite()) {
        return Err(OcpError::InvalidValue { part, stage, index, value: quadratic.to_f64() });
    }
    Ok(())
}

/// # Errors
/// [`OcpError::InvalidValue`]
pub(super) fn check_finite<T: Real>(part: Part, stage: usize, values: &[T]) -> Result<(), OcpError> {
    match crate::irk::not_finite(values) {
        None => Ok(()),
        Some((index, value)) => Err(OcpError::InvalidValue { part, stage, index, value }),
    }
}

/// # Errors
/// [`OcpError::Length`], [`OcpError::InvalidValue`]
pub(super) fn check_vector<T: Real>(
    part: Part,
    stage: usize,
    values: &[T],
    expected: usize,
) -> Result<(), OcpError> {
    if values.len() != expected {
        return Err(OcpError::Length { part, stage, expected, found: values.len() });
    }
    check_finite(part, stage, values)
}

/// A range of stages, of which there are so many.
///
/// # Errors
/// [`OcpError::NoSuchStage`]
pub(super) fn range(
    part: Part,
    stages: &impl RangeBounds<usize>,
    count: usize,
) -> Result<Range<usize>, OcpError> {
    let start = match stages.start_bound() {
        Bound::Included(&start) => start,
        Bound::Excluded(&start) => start.saturating_add(1),
        Bound::Unbounded => 0,
    };
    let end = match stages.end_bound() {
        Bound::Included(&end) => end.saturating_add(1),
        Bound::Excluded(&end) => end,
        Bound::Unbounded => count,
    };
    if end > count || start > end {
        let stage = if end > count { end.saturating_sub(1) } else { start };
        return Err(OcpError::NoSuchStage { part, stage, stages: count });
    }
    Ok(start..end)
}

/// Whether a name means a variable: `u` means `u[0]`, `u[1]`, and `cart` means `cart.position`.
pub(super) fn means(name: &str, variable: &str) -> bool {
    variable.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with(['[', '.']))
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// The names of states and controls.
    #[must_use]
    pub fn names(&self) -> Names {
        <P::Dynamics as Dynamics<T>>::NAMES
    }

    /// Does something to the bounds of every variable that a name means.
    fn each(
        &mut self,
        name: &str,
        stages: &impl RangeBounds<usize>,
        mut change: impl FnMut(&mut BoundsMut<'_, T>, usize),
    ) -> Result<(), OcpError> {
        let known = self.names();
        let fixed = self.initial == Initial::Fixed;
        let mut found = false;
        for (part, names, count) in [
            (Part::StateBounds, known.x, self.intervals() + 1),
            (Part::ControlBounds, known.u, self.intervals()),
        ] {
            let indices = || names.iter().enumerate().filter(|(_, variable)| means(name, variable));
            if indices().next().is_none() {
                continue;
            }
            found = true;
            let range = range(part, stages, count)?;
            for (k, mut stage) in self.qp.stages_mut().enumerate() {
                // Of a state that is given there is nothing to be bounded.
                if !range.contains(&k) || (k == 0 && fixed && part == Part::StateBounds) {
                    continue;
                }
                let mut bounds =
                    if part == Part::StateBounds { stage.x_bounds_mut() } else { stage.u_bounds_mut() };
                indices().for_each(|(index, _)| change(&mut bounds, index));
            }
        }
        if found { Ok(()) } else { Err(OcpError::UnknownName { name: Text::new(name), known }) }
    }

    /// Bounds of a state or control, or of all of them that a name means (`u` means `u[0]`, `u[1]`,
    /// …), at some stages: `..` are all of them, the last one has no controls. An infinite bound is
    /// none. While the initial state is fixed, bounds of states do not touch stage 0.
    ///
    /// # Errors
    /// [`OcpError::UnknownName`], [`OcpError::NoSuchStage`], [`OcpError::CrossedBounds`],
    /// [`OcpError::InvalidValue`]
    pub fn bound(
        &mut self,
        name: &str,
        stages: impl RangeBounds<usize>,
        lower: T,
        upper: T,
    ) -> Result<&mut Self, OcpError> {
        let known = self.names();
        let control = known.u.iter().position(|variable| means(name, variable));
        let state = known.x.iter().position(|variable| means(name, variable));
        let part = if state.is_some() { Part::StateBounds } else { Part::ControlBounds };
        let first = match stages.start_bound() {
            Bound::Included(&start) => start,
            Bound::Excluded(&start) => start.saturating_add(1),
            Bound::Unbounded => 0,
        };
        check(part, first, state.or(control).unwrap_or(0), lower, upper)?;
        self.each(name, &stages, |bounds, index| bounds.set(index, lower, upper))?;
        Ok(self)
    }

    /// Makes bounds of states or controls soft: leaving one by `e` costs
    /// `linear · e + ½ quadratic · e²`. An infinite linear penalty makes them hard again.
    ///
    /// # Errors
    /// [`OcpError::UnknownName`], [`OcpError::NoSuchStage`], [`OcpError::InvalidValue`]
    pub fn soften(
        &mut self,
        name: &str,
        stages: impl RangeBounds<usize>,
        linear: T,
        quadratic: T,
    ) -> Result<&mut Self, OcpError> {
        check_penalty(0, 0, linear, quadratic)?;
        self.each(name, &stages, |bounds, index| bounds.soften(index, linear, quadratic))?;
        Ok(self)
    }

    /// Bounds of the path constraints at some stages.
    ///
    /// # Errors
    /// [`OcpError::Length`], [`OcpError::NoSuchStage`], [`OcpError::CrossedBounds`],
    /// [`OcpError::InvalidValue`]
    pub fn set_path_bounds(
        &mut self,
        stages: impl RangeBounds<usize>,
        lower: &[T],
        upper: &[T],
    ) -> Result<&mut Self, OcpError> {
        let range = range(Part::PathBounds, &stages, self.intervals())?;
        self.write_bounds(Part::PathBounds, range, P::Path::ROWS, lower, upper)
    }

    /// Bounds of the terminal constraints.
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
        for bounds in [lower, upper] {
            if bounds.len() != rows {
                let (stage, found) = (stages.start, bounds.len());
                return Err(OcpError::Length { part, stage, expected: rows, found });
            }
        }
        for (index, (&lower, &upper)) in lower.iter().zip(upper).enumerate() {
            check(part, stages.start, index, lower, upper)?;
        }
        let intervals = self.intervals();
        let data = split::<P, T>(self.data.as_mut(), intervals);
        for k in stages {
            for (bounds, given) in [(&mut *data.lower, lower), (&mut *data.upper, upper)] {
                // The rows of the last stage lie behind those of all others.
                crate::qp::assign(crate::qp::part_mut(bounds, k * P::Path::ROWS, rows), given);
            }
        }
        Ok(self)
    }

    /// The state at the start.
    ///
    /// # Errors
    /// [`OcpError::Length`], [`OcpError::InvalidValue`]
    pub fn fix_initial_state(&mut self, x0: &[T]) -> Result<&mut Self, OcpError> {
        check_vector(Part::InitialState, 0, x0, P::Shape::NX)?;
        self.qp.fix_initial_state(x0)?;
        self.initial = Initial::Fixed;
        Ok(self)
    }

    /// The state at the start is free; it may be bounded like any other.
    pub fn free_initial_state(&mut self) -> &mut Self {
        self.initial = Initial::Free;
        let infinity = T::from_f64(f64::INFINITY);
        if let Some(mut stage) = self.qp.stage_mut(0) {
            let bounds = stage.x_bounds_mut();
            bounds.lower.fill(-infinity);
            bounds.upper.fill(infinity);
        }
        self
    }

    /// The times of the nodes.
    #[must_use]
    pub fn times(&self) -> &[T] {
        crate::qp::part(self.data.as_ref(), 0, self.intervals() + 1)
    }

    /// Parameters of some nodes; the last node has parameters for terminal cost and constraints.
    ///
    /// # Errors
    /// [`OcpError::Length`], [`OcpError::NoSuchStage`], [`OcpError::InvalidValue`]
    pub fn set_parameters(
        &mut self,
        stages: impl RangeBounds<usize>,
        p: &[T],
    ) -> Result<&mut Self, OcpError> {
        let intervals = self.intervals();
        let range = range(Part::Parameters, &stages, intervals + 1)?;
        check_vector(Part::Parameters, range.start, p, P::Shape::NP)?;
        let data = split::<P, T>(self.data.as_mut(), intervals);
        for k in range {
            crate::qp::assign(crate::qp::part_mut(data.p, k * P::Shape::NP, P::Shape::NP), p);
        }
        Ok(self)
    }

    /// The reference of the stage cost at some stages; zero if never set.
    ///
    /// # Errors
    /// [`OcpError::Length`], [`OcpError::NoSuchStage`], [`OcpError::InvalidValue`]
    pub fn set_reference(
        &mut self,
        stages: impl RangeBounds<usize>,
        reference: &[T],
    ) -> Result<&mut Self, OcpError> {
        let (intervals, length) = (self.intervals(), P::StageCost::REFERENCES);
        let range = range(Part::Reference, &stages, intervals)?;
        check_vector(Part::Reference, range.start, reference, length)?;
        let data = split::<P, T>(self.data.as_mut(), intervals);
        for k in range {
            crate::qp::assign(crate::qp::part_mut(data.references, k * length, length), reference);
        }
        Ok(self)
    }

    /// The reference of the terminal cost; zero if never set.
    ///
    /// # Errors
    /// [`OcpError::Length`], [`OcpError::InvalidValue`]
    pub fn set_terminal_reference(&mut self, reference: &[T]) -> Result<&mut Self, OcpError> {
        let (intervals, length) = (self.intervals(), P::TerminalCost::REFERENCES);
        check_vector(Part::TerminalReference, intervals, reference, length)?;
        let data = split::<P, T>(self.data.as_mut(), intervals);
        let begin = intervals * P::StageCost::REFERENCES;
        crate::qp::assign(crate::qp::part_mut(data.references, begin, length), reference);
        Ok(self)
    }

    /// A constraint of the QP by its name in the problem.
    #[must_use]
    pub fn name(&self, field: Field, stage: usize, index: usize, side: Side) -> ConstraintName {
        let names = self.names();
        let of = |list: &[&'static str]| list.get(index).copied().unwrap_or("");
        let (part, (name, output)) = match field {
            Field::StateBounds => (Part::StateBounds, (of(names.x), 0)),
            Field::ControlBounds => (Part::ControlBounds, (of(names.u), 0)),
            _ if stage == self.intervals() => (Part::TerminalBounds, P::Terminal::name(index)),
            _ => (Part::PathBounds, P::Path::name(index)),
        };
        ConstraintName { part, stage, name, output, side }
    }

    /// The constraint that makes a QP infeasible.
    #[must_use]
    pub fn infeasible(&self, error: &QpError) -> Option<ConstraintName> {
        match *error {
            QpError::Infeasible { field, stage, index, side, .. } => {
                Some(self.name(field, stage, index, side))
            }
            _ => None,
        }
    }
}
