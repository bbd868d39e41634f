//! `G = −H D`: the sparse second derivatives of a step times the derivatives of its variables, a
//! panel at a time.

use crate::irk::directions::panel;
use crate::irk::forward::stage_sensitivities::stages_adjacent;
use crate::linalg::Arithmetic;
use crate::model::Term;
use crate::plan::Plan;
use crate::scalar::Lanes;
use crate::shape::InBounds;
use crate::structure::MAX_INTERLEAVED_ROWS;

/// Computes `G = −H D` at all stages in the panel that begins with `column`; `G` has the row layout
/// of the panel.
#[inline(always)]
pub(in crate::irk) fn multiply_panel<A: Arithmetic, M: Plan, E: Lanes, const S: usize, const W: usize>(
    plan: M,
    entries: &[[E; S]],
    d: &[E],
    g: &mut [[E; W]],
    column: usize,
) {
    let g = g.as_chunks_mut::<1>().0;
    if const { stages_adjacent::<M, E, S>() } {
        multiply::<A, M, E, S, S, 1, W, 1>(plan, entries, d, g.as_chunks_mut().0, 0, column);
        return;
    }
    for stage in 0..S {
        let g = g.get_mut(stage * plan.structure().curved.len()..).in_bounds().unwrap_or_default();
        multiply::<A, M, E, S, 1, 1, W, 1>(plan, entries, d, g.as_chunks_mut().0, stage, column);
    }
}

/// Computes `G = −H D` for `N` groups of `L` stages, from `stage` on, in `P` panels from `column`
/// on.
#[inline(always)]
pub(in crate::irk) fn multiply<
    A: Arithmetic,
    M: Plan,
    E: Lanes,
    const S: usize,
    const L: usize,
    const N: usize,
    const W: usize,
    const P: usize,
>(
    plan: M,
    entries: &[[E; S]],
    d: &[E],
    g: &mut [[[[E; W]; P]; L]],
    stage: usize,
    column: usize,
) {
    let curved = plan.structure().curved.len();
    let mut of_d: [[&[[[E; W]; L]]; P]; N] = [[&[]; P]; N];
    for (group, of_d) in of_d.iter_mut().enumerate() {
        let first = stage + group * L;
        for (p, of_d) in of_d.iter_mut().enumerate() {
            let panel = panel::<E, W>(d, column + p * W, curved * S);
            *of_d =
                panel.get(first * curved..(first + L) * curved).in_bounds().unwrap_or_default().as_chunks().0;
        }
    }
    let mut terms = plan.structure().symmetric;
    while let Some(first) = terms.first() {
        let product = SparseProduct { entries, d: &of_d, stage };
        terms = match first.rows {
            3 if const { MAX_INTERLEAVED_ROWS >= 3 } => product.multiply_rows::<A, 3>(curved, terms, g),
            2 if const { MAX_INTERLEAVED_ROWS >= 2 } => product.multiply_rows::<A, 2>(curved, terms, g),
            _ => product.multiply_row::<A, 1>(curved, terms, g, 0),
        };
    }
}

/// See [`multiply`].
struct SparseProduct<'a, E, const S: usize, const L: usize, const N: usize, const W: usize, const P: usize> {
    entries: &'a [[E; S]],
    d: &'a [[&'a [[[E; W]; L]]; P]; N],
    stage: usize,
}

impl<E: Lanes, const S: usize, const L: usize, const N: usize, const W: usize, const P: usize>
    SparseProduct<'_, E, S, L, N, W, P>
{
    /// Computes `R` rows of `G` with alternating terms, and returns the remaining terms. Rows of
    /// `D` are loaded once for all `R` rows, with as many columns and stages at a time as fit the
    /// registers; sixteen registers are mostly too few.
    #[inline(always)]
    fn multiply_rows<A: Arithmetic, const R: usize>(
        &self,
        curved: usize,
        terms: &'static [Term],
        g: &mut [[[[E; W]; P]; L]],
    ) -> &'static [Term] {
        if const { !A::WIDE && (size_of::<E>() > 8 || L > 2) } {
            let mut remaining_terms = terms;
            for row in 0..R {
                remaining_terms = self.multiply_row::<A, R>(curved, terms, g, row);
            }
            return remaining_terms;
        }
        if const { size_of::<E>() > 8 && W > 4 } {
            self.rows_in_parts::<A, R, 1, 4>(curved, terms, g)
        } else if const { size_of::<E>() > 8 || A::WIDE && L % 2 == 1 } {
            self.rows_in_parts::<A, R, 1, W>(curved, terms, g)
        } else if const { A::WIDE } {
            self.rows_in_parts::<A, R, 2, W>(curved, terms, g)
        } else {
            self.rows_in_parts::<A, R, L, W>(curved, terms, g)
        }
    }

    /// Computes one of `R` rows, at all stages.
    #[inline(always)]
    fn multiply_row<A: Arithmetic, const R: usize>(
        &self,
        curved: usize,
        mut terms: &'static [Term],
        g: &mut [[[[E; W]; P]; L]],
        row: usize,
    ) -> &'static [Term] {
        let mut panel_rows = [[[[E::from_f64(0.0); W]; P]; L]; N];
        let Some(&first) = terms.get(row).in_bounds() else { return &[] };
        while let Some((current_terms, rest)) = terms.split_first_chunk::<R>()
            && let Some(term) = current_terms.get(row)
            && term.row == first.row
        {
            if let Some(values) = self.entries.get(term.entry as usize).in_bounds() {
                for (group, (panel_row, of_d)) in panel_rows.iter_mut().zip(self.d).enumerate() {
                    for (p, d) in of_d.iter().enumerate() {
                        let Some(d) = d.get(term.column as usize).in_bounds() else { continue };
                        subtract_stages::<A, E, L, W, P>(
                            panel_row,
                            p,
                            values_from(values, self.stage + group * L),
                            d,
                        );
                    }
                }
            }
            terms = rest;
        }
        for (group, panel_row) in panel_rows.iter().enumerate() {
            if let Some(to) = g.get_mut(group * curved + first.row as usize).in_bounds() {
                *to = *panel_row;
            }
        }
        terms
    }

    /// Computes `R` rows, `K` stages and `C` columns at a time.
    #[inline(always)]
    fn rows_in_parts<A: Arithmetic, const R: usize, const K: usize, const C: usize>(
        &self,
        curved: usize,
        terms: &'static [Term],
        g: &mut [[[[E; W]; P]; L]],
    ) -> &'static [Term] {
        let mut remaining_terms = terms;
        for (group, of_d) in self.d.iter().enumerate() {
            let g = g.get_mut(group * curved..).in_bounds().unwrap_or_default();
            for stage in 0..L / K {
                for part in 0..W / C {
                    let values = self.stage + group * L + stage * K;
                    remaining_terms = self.rows_of_part::<A, R, K, C>(terms, g, of_d, [stage, part, values]);
                }
            }
        }
        remaining_terms
    }

    #[inline(always)]
    fn rows_of_part<A: Arithmetic, const R: usize, const K: usize, const C: usize>(
        &self,
        mut terms: &'static [Term],
        g: &mut [[[[E; W]; P]; L]],
        of_d: &[&[[[E; W]; L]]; P],
        [stage, part, of_values]: [usize; 3],
    ) -> &'static [Term] {
        let mut panel_rows = [[[[E::from_f64(0.0); C]; P]; K]; R];
        let Some((&rows, _)) = terms.split_first_chunk::<R>() else { return &[] };
        while let Some((current_terms, rest)) = terms.split_first_chunk::<R>()
            && current_terms[0].row == rows[0].row
        {
            let mut factors = [[[E::from_f64(0.0); C]; P]; K];
            for (p, of_d) in of_d.iter().enumerate() {
                let Some(d) = of_d.get(current_terms[0].column as usize).in_bounds() else { continue };
                let Some(d) = d.as_chunks::<K>().0.get(stage).in_bounds() else { continue };
                for (factors, d) in factors.iter_mut().zip(d) {
                    if let Some(d) = d.as_chunks::<C>().0.get(part).in_bounds() {
                        factors[p] = *d;
                    }
                }
            }
            for (term, panel_rows) in current_terms.iter().zip(&mut panel_rows) {
                let Some(values) = self.entries.get(term.entry as usize).in_bounds() else { continue };
                for ((panel_rows, &value), factors) in
                    panel_rows.iter_mut().zip(values_from(values, of_values)).zip(&factors)
                {
                    for (panel_row, factors) in panel_rows.iter_mut().zip(factors) {
                        A::subtract_row(panel_row, value, factors);
                    }
                }
            }
            terms = rest;
        }
        for (term, panel_rows) in rows.iter().zip(&panel_rows) {
            let Some(to) = g.get_mut(term.row as usize).in_bounds() else { continue };
            let Some(to) = to.as_chunks_mut::<K>().0.get_mut(stage).in_bounds() else { continue };
            for (to, panel_rows) in to.as_flattened_mut().iter_mut().zip(panel_rows.as_flattened()) {
                if let Some(to) = to.as_chunks_mut::<C>().0.get_mut(part).in_bounds() {
                    *to = *panel_rows;
                }
            }
        }
        terms
    }
}

/// `panel_row − values d` at `N` stages, in one of `P` panels.
#[inline(always)]
fn subtract_stages<A: Arithmetic, E: Lanes, const N: usize, const W: usize, const P: usize>(
    panel_row: &mut [[[E; W]; P]; N],
    p: usize,
    values: &[E],
    d: &[[E; W]; N],
) {
    if const { W == 1 && P == 1 }
        && let Some(panel_row) = panel_row.as_flattened_mut().as_flattened_mut().first_chunk_mut::<N>()
        && let (Some(values), Some(d)) = (values.first_chunk(), d.as_flattened().first_chunk())
    {
        // The stages of one column fill a register.
        A::subtract_products(panel_row, values, d);
        return;
    }
    for ((panel_row, &value), d) in panel_row.iter_mut().zip(values).zip(d) {
        A::subtract_row(&mut panel_row[p], value, d);
    }
}

/// The values from the stage `first` on.
#[inline(always)]
fn values_from<V>(all: &[V], first: usize) -> &[V] {
    all.get(first..).in_bounds().unwrap_or_default()
}
