//! How much memory Newton's equations take.

use crate::ocp::assembly::units::{Sizes, Units};
use crate::qp::interior::{Counts, Extent, Iterate, PenaltyMode, Reading, count, is_initial_state_fixed};
use crate::qp::{InteriorPointOptions, QpView};
use crate::scalar::Real;

/// What is known about the sides of a problem before any memory is touched.
#[derive(Clone, Copy, Debug)]
pub(in crate::ocp::nlp) struct Lengths {
    pub counts: Counts,
    pub fixed: bool,
    pub numbers: usize,
    pub extent: Extent,
    /// What is known of units.
    pub sizes: Sizes,
    /// Whether violations count alone, without the objective.
    pub alone: bool,
}

impl Lengths {
    /// Of a problem with its penalties as they are.
    pub fn of<T: Real>(qp: QpView<'_, T>) -> Self {
        let reading = reading(qp);
        let counts = count(qp, &reading);
        let (numbers, extent) = (numbers::<T>(qp, &counts), Extent::of::<T>(qp.dims));
        Self {
            counts,
            fixed: reading.fixed,
            numbers,
            extent,
            sizes: Sizes { force: 1.0, least: 1.0 },
            alone: false,
        }
    }

    /// Units whose sizes these are.
    pub fn units<'a, T>(&self, rows: &'a [T]) -> Units<'a, T> {
        Units { sizes: self.sizes, rows }
    }

    /// Of the same problem with every bound soft, equations too.
    pub fn all_soft<T: Real>(&self, qp: QpView<'_, T>) -> Self {
        let counts = all_soft(&self.counts);
        Self { counts, numbers: numbers::<T>(qp, &counts), ..*self }
    }
}

/// How many numbers Newton's equations take, with changes of multipliers of equations.
fn numbers<T: Real>(qp: QpView<'_, T>, counts: &Counts) -> usize {
    Iterate::<T>::memory_of(qp, counts) + counts.equations
}

/// Every bound soft, equations too.
pub(in crate::ocp::nlp::ipm) const fn all_soft(counts: &Counts) -> Counts {
    let Counts { lower, upper, equations, .. } = *counts;
    let (lower, upper) = (lower + equations, upper + equations);
    Counts { lower, upper, soft: lower + upper, equations }
}

/// How the constraints of a problem are read.
pub(in crate::ocp::nlp::ipm) fn reading<T: Real>(qp: QpView<'_, T>) -> Reading<T> {
    let no_bound = T::from_f64(InteriorPointOptions::new::<T>().no_bound);
    Reading { fixed: is_initial_state_fixed(qp), penalties: PenaltyMode::Given, no_bound }
}
