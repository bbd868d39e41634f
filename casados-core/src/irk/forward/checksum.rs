//! Weighted sums of the derivatives of the stages over all directions, by which they are checked
//! (`backward_error`, `refine`).

use crate::irk::directions::weight;
use crate::linalg::{Ahead, Arithmetic, PanelRow, Visitor};
use crate::scalar::{Field, each};

/// So many accumulators a sum over all columns has; of numbers that are registers themselves only
/// the first is used.
pub(in crate::irk) const ACCUMULATORS: usize = 4;

/// Whether sums have one accumulator: those of other rows are computed meanwhile, and its memory is
/// written once for each row of a panel.
const fn is_one<E>() -> bool {
    size_of::<E>() > 8
}

/// The sum of all accumulators.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(in crate::irk) fn total<E: Field>(accumulators: &[E; ACCUMULATORS]) -> E {
    let [a, b, c, d] = *accumulators;
    if const { is_one::<E>() } { a } else { (a + b) + (c + d) }
}

/// The weights of some columns, with another sign.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(in crate::irk) fn minus_weights<E: Field, const W: usize>(column: usize, second: bool) -> [E; W] {
    let mut weights = [E::from_f64(0.0); W];
    for (w, to) in weights.iter_mut().enumerate() {
        *to = -weight::<E>(column + w, second);
    }
    weights
}

/// Sums over all columns, of which some are shown.
pub(in crate::irk) struct Summed<'a, E, const S: usize, const W: usize> {
    pub sums: &'a mut [[[E; ACCUMULATORS]; S]],
    pub minus_weights: &'a [E; W],
    /// Where the next panel will be written.
    pub ahead: Ahead<'a, E>,
}

impl<E: Field, const S: usize, const W: usize> Summed<'_, E, S, W> {
    /// Adds all unknowns of a panel.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub fn all<A: Arithmetic>(&mut self, panel_rows: &[PanelRow<E, S, W>]) {
        for (slot, panel_row) in panel_rows.iter().enumerate() {
            self.on_solved::<A>(slot, panel_row);
        }
    }
}

impl<E: Field, const S: usize, const W: usize> Visitor<E, S, W> for Summed<'_, E, S, W> {
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn on_solved<A: Arithmetic>(&mut self, slot: usize, panel_row: &PanelRow<E, S, W>) {
        let Some(sums) = self.sums.get_mut(slot) else { return };
        each!(i < S => { accumulate::<A, E, W>(&mut sums[i], self.minus_weights, &panel_row[i]); });
    }
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn pass(&mut self) {
        self.ahead.next();
    }
}

/// A sum over no columns.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(in crate::irk) fn clear<E: Field>(accumulators: &mut [E; ACCUMULATORS]) {
    let [first, others @ ..] = accumulators;
    *first = E::from_f64(0.0);
    if const { !is_one::<E>() } {
        *others = [E::from_f64(0.0); ACCUMULATORS - 1];
    }
}

/// `accumulators += weights · row`, as far apart as the accumulators are.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(in crate::irk) fn accumulate<A: Arithmetic, E: Field, const W: usize>(
    accumulators: &mut [E; ACCUMULATORS],
    minus_weights: &[E; W],
    row: &[E; W],
) {
    if const { is_one::<E>() } {
        let [sum, ..] = accumulators;
        each!(w < W => { *sum = A::subtract(*sum, minus_weights[w], row[w]); });
        return;
    }
    let ((weights, last_weights), (row, last)) = (minus_weights.as_chunks(), row.as_chunks());
    // In registers: the optimiser cannot know that they do not overlap.
    let mut own = *accumulators;
    each!(n < W / ACCUMULATORS => { A::subtract_products(&mut own, &weights[n], &row[n]); });
    each!(n < W % ACCUMULATORS => { own[n] = A::subtract(own[n], last_weights[n], last[n]); });
    *accumulators = own;
}
