//! Weighted sums of the stage derivatives over all directions, for the checks in `backward_error`
//! and `refine`.

use crate::irk::directions::checksum_weight;
use crate::linalg::{Arithmetic, PanelRow, Prefetch, Visitor};
use crate::scalar::{Field, each};
use crate::shape::InBounds;

/// Number of accumulators of a sum over all columns. Sums of SIMD registers use the first one only.
pub(in crate::irk) const ACCUMULATORS: usize = 4;

/// Whether sums have one accumulator: the sums of other rows hide the latency of its additions, and
/// it is stored once per row of a panel.
const fn uses_one_accumulator<E>() -> bool {
    size_of::<E>() > 8
}

/// The sum of all accumulators.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(in crate::irk) fn sum_accumulators<E: Field>(accumulators: &[E; ACCUMULATORS]) -> E {
    let [a, b, c, d] = *accumulators;
    if const { uses_one_accumulator::<E>() } { a } else { (a + b) + (c + d) }
}

/// The negative weights of the columns of a panel.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(in crate::irk) fn minus_weights<E: Field, const W: usize>(
    column: usize,
    with_second_weights: bool,
) -> [E; W] {
    let mut weights = [E::from_f64(0.0); W];
    for (w, to) in weights.iter_mut().enumerate() {
        *to = -checksum_weight::<E>(column + w, with_second_weights);
    }
    weights
}

/// Adds panel rows to the sums over all columns, as a visitor of solved rows.
pub(in crate::irk) struct ChecksumVisitor<'a, E, const S: usize, const W: usize> {
    pub sums: &'a mut [[[E; ACCUMULATORS]; S]],
    pub minus_weights: &'a [E; W],
    /// Prefetch target: the memory of the next panel.
    pub prefetch: Prefetch<'a, E>,
}

impl<E: Field, const S: usize, const W: usize> ChecksumVisitor<'_, E, S, W> {
    /// Adds all unknowns of a panel.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub fn add_panel<A: Arithmetic>(&mut self, panel_rows: &[PanelRow<E, S, W>]) {
        for (slot, panel_row) in panel_rows.iter().enumerate() {
            self.on_solved::<A>(slot, panel_row);
        }
    }
}

impl<E: Field, const S: usize, const W: usize> Visitor<E, S, W> for ChecksumVisitor<'_, E, S, W> {
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn on_solved<A: Arithmetic>(&mut self, slot: usize, panel_row: &PanelRow<E, S, W>) {
        let Some(sums) = self.sums.get_mut(slot).in_bounds() else { return };
        each!(i < S => { accumulate::<A, E, W>(&mut sums[i], self.minus_weights, &panel_row[i]); });
    }
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn on_pivot_done(&mut self) {
        self.prefetch.prefetch_line();
    }
}

/// Sets the accumulators to zero.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(in crate::irk) fn clear_accumulators<E: Field>(accumulators: &mut [E; ACCUMULATORS]) {
    let [first, others @ ..] = accumulators;
    *first = E::from_f64(0.0);
    if const { !uses_one_accumulator::<E>() } {
        *others = [E::from_f64(0.0); ACCUMULATORS - 1];
    }
}

/// `accumulators += weights · row`; column `c` goes to accumulator `c` modulo their number.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(in crate::irk) fn accumulate<A: Arithmetic, E: Field, const W: usize>(
    accumulators: &mut [E; ACCUMULATORS],
    minus_weights: &[E; W],
    row: &[E; W],
) {
    if const { uses_one_accumulator::<E>() } {
        let [sum, ..] = accumulators;
        each!(w < W => { *sum = A::subtract(*sum, minus_weights[w], row[w]); });
        return;
    }
    let ((weights, last_weights), (row, last)) = (minus_weights.as_chunks(), row.as_chunks());
    // Local copies stay in registers: the optimiser cannot prove that the arguments do not overlap.
    let mut accumulated = *accumulators;
    each!(n < W / ACCUMULATORS => { A::subtract_products(&mut accumulated, &weights[n], &row[n]); });
    each!(n < W % ACCUMULATORS => { accumulated[n] = A::subtract(accumulated[n], last_weights[n], last[n]); });
    *accumulators = accumulated;
}
