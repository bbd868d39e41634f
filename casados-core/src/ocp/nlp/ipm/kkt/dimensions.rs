//! Dimensions of Newton's equations.

use crate::ocp::assembly::units::{ProblemScaling, ScalingUnits};
use crate::qp::interior::{
    ConstraintInterpretation, Counts, Extent, Iterate, PenaltyMode, count, is_initial_state_fixed,
};
use crate::qp::{InteriorPointOptions, QpView};
use crate::scalar::Real;

/// Numbers of inequalities and lengths of memory, known before memory is allocated.
#[derive(Clone, Copy, Debug)]
pub(in crate::ocp::nlp) struct KktDimensions {
    pub counts: Counts,
    pub has_fixed_initial_state: bool,
    pub number_count: usize,
    pub extent: Extent,
    /// The objective unit and the smallest unit of a row.
    pub scaling: ProblemScaling,
    /// Whether the run is in the restoration phase.
    pub in_restoration: bool,
}

impl KktDimensions {
    /// Dimensions of a problem with its present penalties.
    pub fn from_qp<T: Real>(qp: QpView<'_, T>) -> Self {
        let reading = reading_options(qp);
        let counts = count(qp, &reading);
        let (numbers, extent) = (kkt_number_count::<T>(qp, &counts), Extent::of::<T>(qp.dims));
        Self {
            counts,
            has_fixed_initial_state: reading.fixed,
            number_count: numbers,
            extent,
            scaling: ProblemScaling { objective_unit: 1.0, tolerance: 1.0 },
            in_restoration: false,
        }
    }

    /// The units of all rows, with the scaling.
    pub fn units<'a, T>(&self, rows: &'a [T]) -> ScalingUnits<'a, T> {
        ScalingUnits { scaling: self.scaling, rows }
    }

    /// Dimensions of the same problem with every bound and equation soft.
    pub fn with_all_bounds_soft<T: Real>(&self, qp: QpView<'_, T>) -> Self {
        let counts = counts_with_all_bounds_soft(&self.counts);
        Self { counts, number_count: kkt_number_count::<T>(qp, &counts), ..*self }
    }
}

/// The number count of Newton's equations, with the steps of the multipliers of equations.
fn kkt_number_count<T: Real>(qp: QpView<'_, T>, counts: &Counts) -> usize {
    Iterate::<T>::memory_of(qp, counts) + counts.equations
}

/// Counts with every bound and equation soft.
pub(in crate::ocp::nlp::ipm) const fn counts_with_all_bounds_soft(counts: &Counts) -> Counts {
    let Counts { lower, upper, equations, .. } = *counts;
    let (lower, upper) = (lower + equations, upper + equations);
    Counts { lower, upper, soft: lower + upper, equations }
}

/// How the constraints of a problem are read.
pub(in crate::ocp::nlp::ipm) fn reading_options<T: Real>(qp: QpView<'_, T>) -> ConstraintInterpretation<T> {
    let no_bound = T::from_f64(InteriorPointOptions::new::<T>().no_bound);
    ConstraintInterpretation { fixed: is_initial_state_fixed(qp), penalties: PenaltyMode::Given, no_bound }
}
