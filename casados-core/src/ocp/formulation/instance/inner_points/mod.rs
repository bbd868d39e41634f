//! Points inside intervals, at which path constraints and bounds of states and algebraic states
//! hold too.
//!
//! ```text
//! rows of a stage   (g at its node, links of copies, g at every point, bounds of variables at points)
//! ```
//!
//! An interval is integrated from point to point, so that states there are exact ends of steps. The
//! rows of the points follow the other rows of a problem: problems without points have no cost.

#[cfg(feature = "alloc")]
pub(in crate::ocp) mod piece_memory;

#[cfg(feature = "alloc")]
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::error::Part;
use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::instance::data::node_row_count;
#[cfg(feature = "alloc")]
use crate::ocp::formulation::instance::inner_points::piece_memory::PieceMemory;
use crate::ocp::formulation::problem::Formulation;
#[cfg(feature = "alloc")]
use crate::qp::zeros;
use crate::scalar::Real;
use crate::shape::Shape;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;
use core::marker::PhantomData;

/// A row that follows the path constraints at the nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::ocp) enum InnerRow {
    /// A row of the path constraints at a point, counted from 1.
    Path { row: usize, point: usize },
    /// The bounds of a state or, by indices from `NX` on, of an algebraic state at a point; point 0
    /// is the node.
    Variable { variable: usize, point: usize },
}

impl InnerRow {
    /// Returns the point of the row.
    pub fn point(self) -> usize {
        match self {
            Self::Path { point, .. } | Self::Variable { point, .. } => point,
        }
    }

    /// Returns the kind of bounds of the row.
    pub fn bounds_part<P: Formulation<T>, T: Real>(self) -> Part {
        match self {
            Self::Path { .. } => Part::PathBounds,
            Self::Variable { variable, .. } if variable < P::Shape::NX => Part::StateBounds,
            Self::Variable { .. } => Part::AlgebraicBounds,
        }
    }
}

/// The points of every interval, and the variables with bounds there.
#[derive(Clone, Debug)]
pub(in crate::ocp) struct InnerPoints<T> {
    /// Zero, the points as fractions of an interval, and one; empty if there are no points.
    #[cfg(feature = "alloc")]
    fractions: Vec<T>,
    /// Bounded variables, each with its point.
    #[cfg(feature = "alloc")]
    bounded_variables: Vec<(usize, usize)>,
    #[cfg(feature = "alloc")]
    pub piece_memory: PieceMemory<T>,
    /// Whether costs are evaluated at points too.
    #[cfg(feature = "alloc")]
    has_costs_at_points: bool,
    number_type: PhantomData<T>,
}

impl<T> Default for InnerPoints<T> {
    fn default() -> Self {
        Self {
            #[cfg(feature = "alloc")]
            fractions: Vec::new(),
            #[cfg(feature = "alloc")]
            bounded_variables: Vec::new(),
            #[cfg(feature = "alloc")]
            piece_memory: PieceMemory::default(),
            #[cfg(feature = "alloc")]
            has_costs_at_points: false,
            number_type: PhantomData,
        }
    }
}

impl<T: Real> InnerPoints<T> {
    /// Returns the number of points.
    #[inline(always)]
    pub fn count(&self) -> usize {
        self.fractions().len().saturating_sub(2)
    }

    /// Returns zero, the points, and one; nothing if there are no points.
    #[inline(always)]
    pub fn fractions(&self) -> &[T] {
        #[cfg(feature = "alloc")]
        return &self.fractions;
        #[cfg(not(feature = "alloc"))]
        &[]
    }

    /// Returns whether costs are evaluated at points too.
    #[inline(always)]
    pub fn has_costs_at_points(&self) -> bool {
        #[cfg(feature = "alloc")]
        return self.has_costs_at_points;
        #[cfg(not(feature = "alloc"))]
        false
    }

    /// Returns the fraction of an interval that its node represents in a running cost.
    #[inline(always)]
    pub fn node_fraction(&self) -> T {
        if self.has_costs_at_points() { self.fraction(1) } else { T::ONE }
    }

    /// Returns the bounded variables, each with its point.
    #[inline(always)]
    pub fn bounded_variables(&self) -> &[(usize, usize)] {
        #[cfg(feature = "alloc")]
        return &self.bounded_variables;
        #[cfg(not(feature = "alloc"))]
        &[]
    }

    /// Returns the number of rows at a stage.
    #[inline(always)]
    pub fn row_count<P: Formulation<T>>(&self) -> usize {
        self.count() * P::Path::ROWS + self.bounded_variables().len()
    }

    /// Returns a row by its index.
    pub fn row<P: Formulation<T>>(&self, index: usize) -> Option<InnerRow> {
        let path_row_count = self.count() * P::Path::ROWS;
        match index.checked_sub(path_row_count) {
            None => Some(InnerRow::Path { row: index % P::Path::ROWS, point: 1 + index / P::Path::ROWS }),
            Some(index) => {
                let &(variable, point) = self.bounded_variables().get(index)?;
                Some(InnerRow::Variable { variable, point })
            }
        }
    }

    /// Returns a row and its name.
    pub fn row_name<P: Formulation<T>>(&self, row: usize) -> (InnerRow, (&'static str, usize)) {
        let model_names = <P::Dynamics as Dynamics<T>>::NAMES;
        let row = self.row::<P>(row).unwrap_or(InnerRow::Variable { variable: 0, point: 0 });
        let name = match row {
            InnerRow::Path { row, .. } => P::Path::name(row),
            InnerRow::Variable { variable, .. } => {
                (model_names.x.iter().chain(model_names.z).nth(variable).copied().unwrap_or(""), 0)
            }
        };
        (row, name)
    }

    /// Returns whether algebraic states have bounds at nodes.
    #[inline(always)]
    pub fn has_algebraic_bounds<P: Formulation<T>>(&self) -> bool {
        self.bounded_variables().iter().any(|&(variable, point)| point == 0 && variable >= P::Shape::NX)
    }

    /// Returns a point as a fraction of the interval.
    pub fn fraction(&self, point: usize) -> T {
        self.fractions().get(point).copied().unwrap_or(T::ZERO)
    }
}

#[cfg(feature = "alloc")]
impl<T: Real> InnerPoints<T> {
    /// Returns the fractions, and the memory of pieces.
    pub fn fractions_and_memory(&mut self) -> (&[T], &mut PieceMemory<T>) {
        (&self.fractions, &mut self.piece_memory)
    }

    /// Creates these points.
    ///
    /// # Errors
    /// [`OcpError::InvalidPoint`]
    pub fn with_points(points: &[T]) -> Result<Self, OcpError> {
        let mut parts = zeros(points.len() + 2)?;
        let mut previous_point = T::ZERO;
        for (index, (to, &point)) in parts.iter_mut().skip(1).zip(points).enumerate() {
            if !(previous_point < point && point < T::ONE) {
                return Err(OcpError::InvalidPoint { index, value: point.to_f64() });
            }
            (*to, previous_point) = (point, point);
        }
        if let Some(last) = parts.last_mut() {
            *last = T::ONE;
        }
        if points.is_empty() {
            parts.clear();
        }
        Ok(Self { fractions: parts, ..Self::default() })
    }

    /// Enables costs at the points.
    pub fn with_costs_at_points(self) -> Self {
        Self { has_costs_at_points: true, ..self }
    }

    /// Adds rows for a variable at all points, and at the node if it is algebraic.
    pub fn add_variable(&mut self, variable: usize, nx: usize) {
        let points = usize::from(variable < nx)..=self.count();
        self.bounded_variables.extend(points.map(|point| (variable, point)));
    }

    /// Returns whether a variable has rows.
    pub fn has_variable(&self, variable: usize) -> bool {
        self.bounded_variables.iter().any(|&(other, _)| other == variable)
    }
}

/// Returns the row of a path constraint at a point, counted from 1.
pub(in crate::ocp) fn inner_path_row<P: Formulation<T>, T: Real>(row: usize, point: usize) -> usize {
    node_row_count::<P, T>() + (point - 1) * P::Path::ROWS + row
}

#[cfg(feature = "alloc")]
/// Checks that the dynamics can be integrated in pieces.
///
/// # Errors
/// [`OcpError::Unsupported`]
pub(in crate::ocp) fn check_supports_pieces<D: Dynamics<T>, T: Real>(dynamics: &D) -> Result<(), OcpError> {
    if dynamics.has_pieces() {
        return Ok(());
    }
    let what = "points inside intervals of maps and of lifted stages";
    Err(OcpError::Unsupported { what, remedy: "Take an integrator, or a finer horizon" })
}
