//! Directions of sensitivities, in panels.
//!
//! A panel is a few columns of everything that has a column for each direction: rows `[E; W]` that
//! fit registers. Panels lie one after the other, so that all that is done to one happens in the
//! nearest cache.

use crate::memory::Fallback;
use crate::model::{Dae, NO_COLUMN};
use crate::plan::Plan;
use crate::scalar::lanes::REGISTERS;
use crate::scalar::{Field, Lanes};
use crate::shape::Shape;

/// So many bytes are in the nearest cache, beside others.
pub(super) const L1_CACHE_BYTES: usize = 1 << 15;

/// How many columns the widest panels have: eight; of numbers that are registers themselves four,
/// or the panel row of all stages would not fit beside what it is multiplied by. Of two stages
/// eight do where there are thirty-two registers: if columns are many, factors, which then come
/// from the second cache, are read half as often.
pub(super) const fn panel_width<E>(stages: usize, count: usize) -> usize {
    let allows_wide_panels = size_of::<E>() == 64 && stages <= 2 && count >= 16;
    if size_of::<E>() <= 8 || allows_wide_panels { 8 } else { 4 }
}

/// How many columns the panels of so many directions have together, where there is memory for
/// `most`. Where two narrow panels would follow the wide ones, columns of zeros make them one:
/// registers compute these beside the others, and each width has code of its own.
const fn padded_columns<E>(directions: usize, max_columns: usize) -> usize {
    let columns = match directions % 8 {
        5.. if size_of::<E>() <= 8 => directions.next_multiple_of(8),
        3 | 7 => directions + 1,
        _ => directions,
    };
    if REGISTERS && columns <= max_columns { columns } else { directions }
}

/// A number for each column of panels of all directions: there is memory for whole panels where
/// machines may have registers of several numbers.
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64", target_arch = "wasm32"))]
pub type ArrayC<M, T> = <<M as Dae>::Shape as Shape>::ArrayC<T>;
/// A number for each direction.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64", target_arch = "wasm32")))]
pub type ArrayC<M, T> = crate::model::ArrayW<M, T>;

/// How many columns panels of all directions have together: whole panels, where kernels are not
/// compiled for one model and there is memory for them.
pub(super) const fn total_columns<M: Dae, E, F: Fallback>() -> usize {
    let (directions, most) = (M::STRUCTURE.directions.len(), M::Shape::NC);
    let full_panel_columns = directions.next_multiple_of(8);
    match <F::Plan<M> as Plan>::KNOWN_STRUCTURE {
        Some(_) => padded_columns::<E>(directions, most),
        None if full_panel_columns <= most => full_panel_columns,
        None => directions,
    }
}

/// The same, if it is known when kernels are compiled.
pub(super) const fn static_columns<P: Plan, E>() -> Option<usize> {
    match P::KNOWN_STRUCTURE {
        Some(structure) => Some(padded_columns::<E>(structure.directions.len(), P::NC)),
        None => None,
    }
}

/// Whether some panels of so many columns have this width. Of any number of columns they have the
/// width of most, or one.
pub(super) const fn have_panels<E>(count: Option<usize>, stages: usize, columns: usize) -> bool {
    match (count, columns) {
        (None, 8) => size_of::<E>() <= 8,
        (None, 4) => size_of::<E>() > 8,
        (None, columns) => columns == 1,
        (Some(count), 8) => count >= 8 && panel_width::<E>(stages, count) == 8,
        (Some(count), 4) => count >= 4 && (count % 8 >= 4 || panel_width::<E>(stages, count) == 4),
        (Some(count), columns) => count % (2 * columns) >= columns,
    }
}

/// Evaluates an expression for each panel of `$S` stages: from `$column` on, `$W` columns, as many
/// as [`width`] says, four, two or one, of `$count` columns, which are `$known` when kernels are
/// compiled or not. It may begin with a later panel.
macro_rules! panels {
    ([$known:expr, $count:expr], $E:ty, $S:expr, $column:ident, $W:ident => $panel:expr) => {
        panels!([$known, $count], $E, $S, $column from 0, $W => $panel)
    };
    ([$known:expr, $count:expr], $E:ty, $S:expr, $column:ident from $start:expr, $W:ident => $panel:expr) => {{
        use $crate::irk::directions::have_panels;
        let (mut $column, count) = ($start, $count);
        if const { have_panels::<$E>($known, $S, 8) } {
            while $column + 8 <= count {
                const $W: usize = 8;
                $panel;
                $column += 8;
            }
        }
        if const { have_panels::<$E>($known, $S, 4) } {
            while $column + 4 <= count {
                const $W: usize = 4;
                $panel;
                $column += 4;
            }
        }
        if const { have_panels::<$E>($known, $S, 2) } {
            const $W: usize = 2;
            $panel;
            $column += 2;
        }
        if const { have_panels::<$E>($known, $S, 1) } {
            while $column < count {
                const $W: usize = 1;
                $panel;
                $column += 1;
            }
        }
    }};
}
pub(super) use panels;

/// Where the panel of a column begins, and how many columns it has.
#[inline(always)]
pub(super) const fn panel_of<E>(known: bool, column: usize, count: usize, stages: usize) -> (usize, usize) {
    let (mut begin, mut width) = (0, panel_width::<E>(stages, count));
    if !known && size_of::<E>() > 8 {
        width = 4;
    }
    loop {
        let full_panel_columns = begin + (count - begin) / width * width;
        if column < full_panel_columns || width == 1 {
            return (begin + (column - begin) / width * width, width);
        }
        (begin, width) = (full_panel_columns, if known { width / 2 } else { 1 });
    }
}

/// The rows of a panel that begins with a column, of a matrix with so many rows.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(super) fn panel<E, const W: usize>(panels: &[E], column: usize, rows: usize) -> &[[E; W]] {
    panels.get(column * rows..(column + W) * rows).unwrap_or_default().as_chunks().0
}

/// The rows of a panel that begins with a column, of a matrix with so many rows.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(super) fn panel_mut<E, const W: usize>(panels: &mut [E], column: usize, rows: usize) -> &mut [[E; W]] {
    panels.get_mut(column * rows..(column + W) * rows).unwrap_or_default().as_chunks_mut().0
}

/// How the directions depend on `w`.
pub(crate) trait Directions<E>: Copy {
    /// How many columns their panels have, if that is known when kernels are compiled.
    const COLUMNS: Option<usize>;
    /// Whether each is an element of `w`.
    const ARE_UNIT_VECTORS: bool = false;
    /// How many columns their panels have.
    fn columns(self) -> usize;
    /// The column of an element of `w`, if that is a direction.
    fn column(self, _index: usize) -> Option<usize> {
        None
    }
    /// `row += factor · dw_index`, in the columns from `column` on.
    fn add_scaled<const W: usize>(self, index: usize, factor: E, column: usize, row: &mut [E; W]);
    /// `Σ_c weight_c dw_index,c` over all columns, with the weights of the first sum or the second.
    fn weighted_sum(self, index: usize, with_second_weights: bool) -> E;
}

/// One direction for each element of `w` that has any influence.
#[derive(Clone, Copy)]
pub(crate) struct IdentityDirections<P> {
    plan: P,
    columns: usize,
}

/// That of the plan which an integrator has for its model.
pub(crate) type IdentityDirectionsOf<M, F> = IdentityDirections<<F as Fallback>::Plan<M>>;

impl<P: Plan> IdentityDirections<P> {
    /// Of numbers `E`.
    #[inline(always)]
    pub(crate) fn for_model<M: Dae, E, F: Fallback<Plan<M> = P>>() -> Self {
        Self { plan: F::plan::<M>(), columns: const { total_columns::<M, E, F>() } }
    }
}

/// The column of a direction.
#[inline(always)]
pub(crate) fn column_of<P: Plan>(plan: P, index: usize) -> Option<usize> {
    match plan.structure().column_of_direction.get(index) {
        Some(&NO_COLUMN) | None => None,
        Some(&column) => Some(column as usize),
    }
}

impl<P: Plan, E: Lanes> Directions<E> for IdentityDirections<P> {
    const COLUMNS: Option<usize> = static_columns::<P, E>();
    const ARE_UNIT_VECTORS: bool = true;

    #[inline(always)]
    fn columns(self) -> usize {
        match const { static_columns::<P, E>() } {
            Some(columns) => columns,
            None => self.columns,
        }
    }

    #[inline(always)]
    fn column(self, index: usize) -> Option<usize> {
        column_of(self.plan, index)
    }

    #[cfg_attr(not(debug_assertions), inline(always))]
    fn add_scaled<const W: usize>(self, index: usize, factor: E, column: usize, row: &mut [E; W]) {
        let Some(of_index) = column_of(self.plan, index) else { return };
        if let Some(element) = row.get_mut(of_index.wrapping_sub(column)) {
            *element = *element + factor;
        }
    }

    #[inline(always)]
    fn weighted_sum(self, index: usize, with_second_weights: bool) -> E {
        column_of(self.plan, index)
            .map_or(E::from_f64(0.0), |column| checksum_weight(column, with_second_weights))
    }
}

/// The rows of a matrix: each direction is a column.
#[derive(Clone, Copy)]
pub(crate) struct SeedDirections<'a, E, const C: usize>(pub &'a [[E; C]]);

impl<E: Lanes, const C: usize> Directions<E> for SeedDirections<'_, E, C> {
    const COLUMNS: Option<usize> = Some(C);

    #[inline(always)]
    fn columns(self) -> usize {
        C
    }

    #[cfg_attr(not(debug_assertions), inline(always))]
    fn add_scaled<const W: usize>(self, index: usize, factor: E, column: usize, row: &mut [E; W]) {
        let seeds = self.0.get(index).and_then(|row| row.get(column..)).unwrap_or_default();
        for (element, &seed) in row.iter_mut().zip(seeds) {
            *element = *element + factor * seed;
        }
    }

    #[inline(always)]
    fn weighted_sum(self, index: usize, with_second_weights: bool) -> E {
        let mut total = E::from_f64(0.0);
        for (column, &seed) in self.0.get(index).into_iter().flatten().enumerate() {
            total = total + checksum_weight::<E>(column, with_second_weights) * seed;
        }
        total
    }
}

/// The weight of a direction in the first sum over all of them, or in the second: neither equal nor
/// alternating, so that no structure hides an error.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(super) fn checksum_weight<E: Field>(direction: usize, with_second_weights: bool) -> E {
    let rank = if with_second_weights { 2 * direction + 1 } else { 3 * direction } % 7;
    E::from_f64(1.0) + E::from_f64(0.25) * E::from_whole(rank)
}

#[cfg(all(test, feature = "alloc", target_arch = "x86_64"))]
mod tests {
    use super::{padded_columns, panel_of};
    use crate::scalar::lanes::{F64x4, F64x8};
    use alloc::vec::Vec;

    /// The widths of panels that follow each other, of so many columns.
    fn widths<E>(columns: usize, stages: usize) -> Vec<usize> {
        let (mut widths, mut column) = (Vec::new(), 0);
        while column < columns {
            let (begin, width) = panel_of::<E>(true, column, columns, stages);
            assert_eq!(begin, column);
            assert!(
                (begin..begin + width).all(|of| panel_of::<E>(true, of, columns, stages) == (begin, width))
            );
            widths.push(width);
            column += width;
        }
        assert_eq!(column, columns);
        widths
    }

    /// Panels cover all directions, and have two widths at most: one of eight columns and a
    /// narrower one. Registers themselves may have a panel of two or of one column beside others.
    #[test]
    fn panels_have_few_widths() {
        for directions in 1..50 {
            let columns = padded_columns::<f64>(directions, usize::MAX);
            assert!((directions..directions.next_multiple_of(8) + 1).contains(&columns));
            let mut narrow = widths::<f64>(columns, 3);
            narrow.retain(|&width| width < 8);
            assert!(narrow.len() <= 1, "{directions}: {narrow:?}");
            for (columns, stages) in [
                (padded_columns::<F64x4<4>>(directions, usize::MAX), 2),
                (padded_columns::<F64x8<8>>(directions, usize::MAX), 2),
                (padded_columns::<F64x8<8>>(directions, usize::MAX), 4),
            ] {
                assert!((directions..=directions + 1).contains(&columns));
                let mut narrow = widths::<F64x8<8>>(columns, stages);
                narrow.retain(|&width| width < 4);
                assert!(narrow.len() <= 1, "{directions}: {narrow:?}");
            }
            // Without memory for more, columns are directions.
            assert_eq!(padded_columns::<f64>(directions, directions), directions);
        }
    }
}
