//! Bounds of variables by name, at nodes and at points inside of intervals.

use crate::ocp::formulation::check::{first, range};
use crate::ocp::formulation::error::{OcpError, Part};
use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::instance::data::{node_rows, path_rows, split};
use crate::ocp::formulation::instance::memory::Renewable;
use crate::ocp::formulation::problem::Formulation;
use crate::qp::StageDims;
use crate::qp::element::set;
use crate::scalar::Real;
#[cfg(feature = "alloc")]
use crate::shape::Shape;
use crate::structure::name_matches;
use core::ops::{Range, RangeBounds};

impl<P: Formulation<T>, T: Real, D: Renewable<StageDims>, M: Renewable<T> + AsMut<[T]>> Ocp<P, T, D, M> {
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
        let found = self.find(name, &stages)?;
        let of_rows = self.find_inside(name, &stages, &found)?;
        let (labels, index) = self.labels(name, first(&stages));
        labels.check_bounds(index, lower, upper)?;
        let is_bound = lower.is_finite() || upper.is_finite();
        #[cfg(feature = "alloc")]
        self.add_rows(name, &of_rows, is_bound)?;
        #[cfg(not(feature = "alloc"))]
        if is_bound && found.iter().all(Range::is_empty) {
            return Err(OcpError::Unsupported {
                what: "bounds of algebraic states without the feature `alloc`",
                remedy: "Write them as path constraints",
            });
        }
        self.each(name, found, |bounds, index| bounds.set(index, lower, upper));
        let layout = self.layout();
        let data = split::<P, T>(self.data.as_mut(), layout);
        for row in rows_of::<P, T>(&self.inner, name) {
            for k in of_rows.clone() {
                set(data.lower, k * path_rows::<P, T>(layout) + row, lower);
                set(data.upper, k * path_rows::<P, T>(layout) + row, upper);
            }
        }
        Ok(self)
    }

    /// Makes rows for what a name means, where something can have rows and has none.
    #[cfg(feature = "alloc")]
    fn add_rows(&mut self, name: &str, stages: &Range<usize>, is_bound: bool) -> Result<(), OcpError> {
        let (known, nx) = (self.names(), P::Shape::NX);
        let mut inner = None;
        let variables = known.x.iter().chain(known.z).enumerate();
        for (variable, _) in variables.filter(|(_, variable)| name_matches(name, variable)) {
            let has_rows = if variable < nx { self.inner.count() > 0 } else { P::Dynamics::ALGEBRAIC };
            if has_rows && is_bound && !stages.is_empty() && !self.inner.has(variable) {
                inner.get_or_insert_with(|| self.inner.clone()).add(variable, nx);
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
    pub(in crate::ocp) fn find_inside(
        &self,
        name: &str,
        stages: &impl RangeBounds<usize>,
        [of_states, ..]: &[Range<usize>; 3],
    ) -> Result<Range<usize>, OcpError> {
        let intervals = self.intervals();
        if P::Dynamics::ALGEBRAIC && self.names().z.iter().any(|variable| name_matches(name, variable)) {
            return range(Part::AlgebraicBounds, stages, intervals);
        }
        Ok(of_states.start.min(intervals)..of_states.end.min(intervals))
    }
}

/// The rows of variables at points that a name means.
pub(in crate::ocp) fn rows_of<'a, P: Formulation<T>, T: Real>(
    inner: &'a crate::ocp::formulation::instance::inside::InnerPoints<T>,
    name: &'a str,
) -> impl Iterator<Item = usize> + 'a {
    let first = node_rows::<P, T>() + inner.count() * P::Path::ROWS;
    let known = <P::Dynamics as Dynamics<T>>::NAMES;
    let meant = move |variable: usize| {
        known.x.iter().chain(known.z).nth(variable).is_some_and(|variable| name_matches(name, variable))
    };
    let variables = inner.variables().iter().enumerate();
    variables.filter(move |(_, (variable, _))| meant(*variable)).map(move |(i, _)| first + i)
}
