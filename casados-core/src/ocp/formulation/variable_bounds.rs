//! Bounds of variables by name, at nodes and at points inside of intervals.

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
    /// Bounds of a state, control, algebraic state or free parameter, or of all of them that a name
    /// means (`u` means `u[0]`, `u[1]`, …), at some stages: `..` are all of them, the last one has
    /// no controls and no algebraic states, and free parameters are the same at all of them. An
    /// infinite bound is none. While the initial state is fixed, bounds of states do not touch
    /// stage 0.
    ///
    /// Bounds of states hold at points inside of intervals too, where there are some
    /// ([`Ocp::inside`]), and so do those of algebraic states. An algebraic state gets a row of the
    /// QP at each stage with its first bounds: solvers are made afterwards.
    ///
    /// # Errors
    /// [`OcpError::UnknownName`], [`OcpError::NoSuchStage`], [`OcpError::EmptyRange`],
    /// [`OcpError::CrossedBounds`], [`OcpError::InvalidValue`]: then no bound is changed.
    /// [`OcpError::OutOfMemory`]; [`OcpError::Unsupported`] of algebraic states in given memory.
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

    /// Makes rows for what a name means, where something can have rows and has none.
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
    /// The stages at which rows of points are meant, by what was found.
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

/// The rows of variables at points that a name means.
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
