//! How much memory Newton's equations take.

use crate::ocp::assembly::units::{ProblemScaling, ScalingUnits};
use crate::qp::interior::{Counts, Extent, Iterate, PenaltyMode, Reading, count, is_initial_state_fixed};
use crate::qp::{InteriorPointOptions, QpView};
use crate::scalar::Real;

/// What is known about the sides of a problem before any memory is touched.
#[derive(Clone, Copy, Debug)]
pub(in crate::ocp::nlp) struct KktDimensions {
    pub counts: Counts,
    pub has_fixed_initial_state: bool,
    pub number_count: usize,
    pub extent: Extent,
    /// What is known of units.
    pub scaling: ProblemScaling,
    /// Whether violations count alone, without the objective.
    pub in_restoration: bool,
}

impl KktDimensions {
    /// Of a problem with its penalties as they are.
    pub fn from_qp<T: Real>(qp: QpView<'_, T>) -> Self {
        let reading = reading_options(qp);
        let counts = count(qp, &reading);
        let (numbers, extent) = (kkt_number_count::<T>(qp, &counts), Extent::of::<T>(qp.dims));
        Self {
            counts,
            has_fixed_initial_state: reading.fixed,
            number_count: numbers,
            extent,
            scaling: ProblemScaling { objective_unit: 1.0, min_row_unit: 1.0 },
            in_restoration: false,
        }
    }

    /// Units whose sizes these are.
    pub fn units<'a, T>(&self, rows: &'a [T]) -> ScalingUnits<'a, T> {
        ScalingUnits { scaling: self.scaling, rows }
    }

    /// Of the same problem with every bound soft, equations too.
    pub fn with_all_bounds_soft<T: Real>(&self, qp: QpView<'_, T>) -> Self {
        let counts = counts_with_all_bounds_soft(&self.counts);
        Self { counts, number_count: kkt_number_count::<T>(qp, &counts), ..*self }
    }
}

/// How many numbers Newton's equations take, with changes of multipliers of equations.
fn kkt_number_count<T: Real>(qp: QpView<'_, T>, counts: &Counts) -> usize {
    Iterate::<T>::memory_of(qp, counts) + counts.equations
}

/// Every bound soft, equations too.
pub(in crate::ocp::nlp::ipm) const fn counts_with_all_bounds_soft(counts: &Counts) -> Counts {
    let Counts { lower, upper, equations, .. } = *counts;
    let (lower, upper) = (lower + equations, upper + equations);
    Counts { lower, upper, soft: lower + upper, equations }
}

/// How the constraints of a problem are read.
pub(in crate::ocp::nlp::ipm) fn reading_options<T: Real>(qp: QpView<'_, T>) -> Reading<T> {
    let no_bound = T::from_f64(InteriorPointOptions::new::<T>().no_bound);
    Reading { fixed: is_initial_state_fixed(qp), penalties: PenaltyMode::Given, no_bound }
}
