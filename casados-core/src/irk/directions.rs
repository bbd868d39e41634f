//! Directions of sensitivities, in panels.
//!
//! A panel is a group of columns of the matrices that have one column per direction: its rows
//! `[E; W]` fit registers. Panels lie one after the other, so that all operations on a panel use
//! the L1 cache.

use crate::memory::Fallback;
use crate::model::{Dae, NO_COLUMN};
use crate::plan::Plan;
use crate::scalar::lanes::REGISTERS;
use crate::scalar::{Field, Lanes};
use crate::shape::{InBounds, Shape};

/// Size of the L1 cache in bytes.
pub(super) const L1_CACHE_BYTES: usize = 1 << 15;

/// Number of columns of the widest panels: eight for scalars. For SIMD registers four, so that the
/// panel row of all stages and its multipliers fit the register file; eight for two stages if there
/// are thirty-two registers and many columns: the factors, then in the L2 cache, are read half as
/// often.
pub(super) const fn panel_width<E>(stages: usize, count: usize) -> usize {
    let allows_wide_panels = size_of::<E>() == 64 && stages <= 2 && count >= 16;
    if size_of::<E>() <= 8 || allows_wide_panels { 8 } else { 4 }
}

/// Number of columns of all panels, at most `max_columns`. Two narrow panels after the wide ones
/// are merged into one, padded with columns of zeros: each width needs its own code, and the
/// padding costs no extra SIMD instructions.
const fn padded_columns<E>(directions: usize, max_columns: usize) -> usize {
    let columns = match directions % 8 {
        5.. if size_of::<E>() <= 8 => directions.next_multiple_of(8),
        3 | 7 => directions + 1,
        _ => directions,
    };
    if REGISTERS && columns <= max_columns { columns } else { directions }
}

/// A number for each column of all panels. Targets with SIMD registers have memory for whole
/// panels.
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64", target_arch = "wasm32"))]
pub type ArrayC<M, T> = <<M as Dae>::Shape as Shape>::ArrayC<T>;
/// A number for each direction.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64", target_arch = "wasm32")))]
pub type ArrayC<M, T> = crate::model::ArrayW<M, T>;

/// Number of columns of the panels of all directions. Kernels that are compiled for all models have
/// whole panels, if there is memory for them.
pub(super) const fn total_columns<M: Dae, E, F: Fallback>() -> usize {
    let (directions, most) = (M::STRUCTURE.directions.len(), M::Shape::NC);
    let full_panel_columns = directions.next_multiple_of(8);
    match <F::Plan<M> as Plan>::KNOWN_STRUCTURE {
        Some(_) => padded_columns::<E>(directions, most),
        None if full_panel_columns <= most => full_panel_columns,
        None => directions,
    }
}

/// Number of columns of all panels, if it is known at compile time.
pub(super) const fn static_columns<P: Plan, E>() -> Option<usize> {
    match P::KNOWN_STRUCTURE {
        Some(structure) => Some(padded_columns::<E>(structure.directions.len(), P::NC)),
        None => None,
    }
}

/// Whether some panels of `count` columns have this width. If `count` is known at run time only,
/// panels have eight columns (four of SIMD registers) or one.
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

/// Evaluates an expression for each panel of `$S` stages, from `$column` on, with `$W` columns: as
/// many as [`panel_width`] returns, four, two or one. `$count` is the number of columns, `$known`
/// the number at compile time, if it is known. `from` begins with a later panel.
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

/// Returns the first column and the width of the panel that contains a column.
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

/// Returns the rows of the panel that begins with `column`, of a matrix with `rows` rows.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(super) fn panel<E, const W: usize>(panels: &[E], column: usize, rows: usize) -> &[[E; W]] {
    panels.get(column * rows..(column + W) * rows).in_bounds().unwrap_or_default().as_chunks().0
}

/// Returns the rows of the panel that begins with `column`, of a matrix with `rows` rows.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(super) fn panel_mut<E, const W: usize>(panels: &mut [E], column: usize, rows: usize) -> &mut [[E; W]] {
    panels.get_mut(column * rows..(column + W) * rows).in_bounds().unwrap_or_default().as_chunks_mut().0
}

/// The dependence of the directions on `w`.
pub(crate) trait Directions<E>: Copy {
    /// Number of columns of the panels, if it is known at compile time.
    const COLUMNS: Option<usize>;
    /// Whether each direction is an element of `w`.
    const ARE_UNIT_VECTORS: bool = false;
    /// Number of columns of the panels.
    fn columns(self) -> usize;
    /// The column of an element of `w`, if it is a direction.
    fn column(self, _index: usize) -> Option<usize> {
        None
    }
    /// `row += factor · dw_index`, in the columns from `column` on.
    fn add_scaled<const W: usize>(self, index: usize, factor: E, column: usize, row: &mut [E; W]);
    /// `Σ_c weight_c dw_index,c` over all columns, with the first or the second set of weights.
    fn weighted_sum(self, index: usize, with_second_weights: bool) -> E;
}

/// One direction for each element of `w` that has any influence.
#[derive(Clone, Copy)]
pub(crate) struct IdentityDirections<P> {
    plan: P,
    columns: usize,
}

/// Unit directions of the plan that an integrator has for its model.
pub(crate) type IdentityDirectionsOf<M, F> = IdentityDirections<<F as Fallback>::Plan<M>>;

impl<P: Plan> IdentityDirections<P> {
    /// Directions for panels of numbers `E`.
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

/// Given directions: rows of a matrix whose columns are the directions.
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

/// The weight of a direction in the first or the second checksum: neither equal nor alternating, so
/// that no structure of the model hides an error.
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

    /// The widths of the panels of `columns` columns.
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

    /// Panels cover all directions and have at most two widths: eight columns and a narrower one.
    /// Panels of SIMD registers may have a further one of one or two columns.
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
            // Without memory for padding, there is one column for each direction.
            assert_eq!(padded_columns::<f64>(directions, directions), directions);
        }
    }
}
