//! Bounds of variables by name, at nodes and at points inside intervals.

use crate::ocp::formulation::check::{first_stage, stage_range};
use crate::ocp::formulation::error::{OcpError, Part};
use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::instance::construction::Reallocatable;
use crate::ocp::formulation::instance::data::{node_row_count, path_row_count, split_data};
use crate::ocp::formulation::problem::Formulation;
use crate::qp::StageDims;
use crate::qp::element::set;
use crate::scalar::Real;
#[cfg(feature = "alloc")]
use crate::shape::Shape;
use crate::structure::name_matches;
use core::ops::{Range, RangeBounds};

impl<P: Formulation<T>, T: Real, D: Reallocatable<StageDims>, M: Reallocatable<T> + AsMut<[T]>>
    Ocp<P, T, D, M>
{
    /// Sets the bounds of a state, control, algebraic state or free parameter, or of all variables
    /// with this name (`u` denotes `u[0]`, `u[1]`, …), at these stages; `..` denotes all stages.
    /// The last stage has no controls and no algebraic states; free parameters are the same at all
    /// stages. An infinite bound is no bound. While the initial state is fixed, bounds of states do
    /// not apply to stage 0.
    ///
    /// Bounds of states and algebraic states hold at points inside intervals too ([`Ocp::inside`]).
    /// The first bounds of an algebraic state add a row of the QP to each stage: set them before
    /// creating a solver.
    ///
    /// # Errors
    /// [`OcpError::UnknownName`], [`OcpError::NoSuchStage`], [`OcpError::EmptyRange`],
    /// [`OcpError::CrossedBounds`], [`OcpError::InvalidValue`]: then no bound is changed.
    /// [`OcpError::OutOfMemory`]; [`OcpError::Unsupported`] for algebraic states in given memory.
    pub fn bound(
        &mut self,
        name: &str,
        stages: impl RangeBounds<usize>,
        lower: T,
        upper: T,
    ) -> Result<&mut Self, OcpError> {
        let stages_by_kind = self.stages_of_name(name, &stages)?;
        let row_stages = self.inner_row_stages(name, &stages, &stages_by_kind)?;
        let (labels, index) = self.labels_of_name(name, first_stage(&stages));
        labels.check_bounds(index, lower, upper)?;
        let is_bound = lower.is_finite() || upper.is_finite();
        #[cfg(feature = "alloc")]
        self.add_missing_rows(name, &row_stages, is_bound)?;
        #[cfg(not(feature = "alloc"))]
        if is_bound && stages_by_kind.iter().all(Range::is_empty) {
            return Err(OcpError::Unsupported {
                what: "bounds of algebraic states without the feature `alloc`",
                remedy: "Write them as path constraints",
            });
        }
        self.for_each_bound(name, stages_by_kind, |bounds, index| bounds.set(index, lower, upper));
        let layout = self.layout();
        let data = split_data::<P, T>(self.data.as_mut(), layout);
        for row in matching_inner_rows::<P, T>(&self.inner_points, name) {
            for k in row_stages.clone() {
                set(data.lower, k * path_row_count::<P, T>(layout) + row, lower);
                set(data.upper, k * path_row_count::<P, T>(layout) + row, upper);
            }
        }
        Ok(self)
    }

    /// Adds the rows that bounds of the variables with this name require.
    #[cfg(feature = "alloc")]
    fn add_missing_rows(
        &mut self,
        name: &str,
        stages: &Range<usize>,
        is_bound: bool,
    ) -> Result<(), OcpError> {
        let (model_names, nx) = (self.names(), P::Shape::NX);
        let mut inner = None;
        let variables = model_names.x.iter().chain(model_names.z).enumerate();
        for (variable, _) in variables.filter(|(_, variable)| name_matches(name, variable)) {
            let has_rows = if variable < nx { self.inner_points.count() > 0 } else { P::Dynamics::ALGEBRAIC };
            if has_rows && is_bound && !stages.is_empty() && !self.inner_points.has_variable(variable) {
                inner.get_or_insert_with(|| self.inner_points.clone()).add_variable(variable, nx);
            }
        }
        match inner {
            None => Ok(()),
            Some(inner) => {
                let free = self.free.clone();
                self.rebuild(free, inner, None)
            }
        }
    }
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Returns the stages of the rows of algebraic states, or of states at points.
    ///
    /// # Errors
    /// [`OcpError::NoSuchStage`], [`OcpError::EmptyRange`]
    pub(in crate::ocp) fn inner_row_stages(
        &self,
        name: &str,
        stages: &impl RangeBounds<usize>,
        [of_states, ..]: &[Range<usize>; 3],
    ) -> Result<Range<usize>, OcpError> {
        let intervals = self.intervals();
        if P::Dynamics::ALGEBRAIC && self.names().z.iter().any(|variable| name_matches(name, variable)) {
            return stage_range(Part::AlgebraicBounds, stages, intervals);
        }
        Ok(of_states.start.min(intervals)..of_states.end.min(intervals))
    }
}

/// Returns the rows of variables with this name at points.
pub(in crate::ocp) fn matching_inner_rows<'a, P: Formulation<T>, T: Real>(
    inner: &'a crate::ocp::formulation::instance::inner_points::InnerPoints<T>,
    name: &'a str,
) -> impl Iterator<Item = usize> + 'a {
    let first = node_row_count::<P, T>() + inner.count() * P::Path::ROWS;
    let model_names = <P::Dynamics as Dynamics<T>>::NAMES;
    let matches_name = move |variable: usize| {
        model_names
            .x
            .iter()
            .chain(model_names.z)
            .nth(variable)
            .is_some_and(|variable| name_matches(name, variable))
    };
    let variables = inner.bounded_variables().iter().enumerate();
    variables.filter(move |(_, (variable, _))| matches_name(*variable)).map(move |(i, _)| first + i)
}
