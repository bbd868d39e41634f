//! Directions of sensitivities, in panels.
//!
//! A panel is a few columns of everything that has a column for each direction: rows `[E; W]` that
//! fit registers. Panels lie one after the other, so that all that is done to one happens in the
//! nearest cache.

use crate::model::{Dae, NO_COLUMN};
use crate::scalar::lanes::REGISTERS;
use crate::scalar::{Field, Lanes};
use crate::shape::Shape;
use core::marker::PhantomData;

/// So many bytes are in the nearest cache, beside others.
pub(super) const L1_CACHE_BYTES: usize = 1 << 15;

/// How many of some numbers, in their order, come before one: of directions that have any
/// influence, of curved variables.
pub(super) const fn before(numbers: &[u32], number: usize) -> usize {
    let mut count = 0;
    while count < numbers.len() && (numbers[count] as usize) < number {
        count += 1;
    }
    count
}

/// How many columns the widest panels have: eight; of numbers that are registers themselves four,
/// or the panel row of all stages would not fit beside what it is multiplied by. Of two stages
/// eight do where there are thirty-two registers: if columns are many, factors, which then come
/// from the second cache, are read half as often.
pub(super) const fn width<E>(stages: usize, count: usize) -> usize {
    let many = size_of::<E>() == 64 && stages <= 2 && count >= 16;
    if size_of::<E>() <= 8 || many { 8 } else { 4 }
}

/// How many columns the panels of so many directions have together, where there is memory for
/// `most`. Where two narrow panels would follow the wide ones, columns of zeros make them one:
/// registers compute these beside the others, and each width has code of its own.
const fn padded<E>(directions: usize, most: usize) -> usize {
    let columns = match directions % 8 {
        5.. if size_of::<E>() <= 8 => directions.next_multiple_of(8),
        3 | 7 => directions + 1,
        _ => directions,
    };
    if REGISTERS && columns <= most { columns } else { directions }
}

/// A number for each column of panels of all directions: there is memory for whole panels where
/// machines may have registers of several numbers.
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64", target_arch = "wasm32"))]
pub type ArrayC<M, T> = <<M as Dae>::Shape as Shape>::ArrayC<T>;
/// A number for each direction.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64", target_arch = "wasm32")))]
pub type ArrayC<M, T> = crate::model::ArrayW<M, T>;

/// How many columns panels of all directions have together.
pub(super) const fn all_columns<M: Dae, E>() -> usize {
    padded::<E>(M::STRUCTURE.directions.len(), M::Shape::NC)
}

/// Evaluates an expression for each panel of `$S` stages: from `$column` on, `$W` columns, as many
/// as [`width`] says, four, two or one. It may begin with a later panel.
macro_rules! panels {
    ($count:expr, $E:ty, $S:expr, $column:ident, $W:ident => $panel:expr) => {
        panels!($count, $E, $S, $column from 0, $W => $panel)
    };
    ($count:expr, $E:ty, $S:expr, $column:ident from $start:expr, $W:ident => $panel:expr) => {{
        let mut $column = $start;
        if const { $count >= 8 && $crate::irk::directions::width::<$E>($S, $count) == 8 } {
            while $column + 8 <= const { $count } {
                const $W: usize = 8;
                $panel;
                $column += 8;
            }
        }
        if const { $count >= 4 && ($count % 8 >= 4 || $crate::irk::directions::width::<$E>($S, $count) == 4) } {
            while $column + 4 <= const { $count } {
                const $W: usize = 4;
                $panel;
                $column += 4;
            }
        }
        if const { $count % 4 >= 2 } {
            const $W: usize = 2;
            $panel;
            $column += 2;
        }
        if const { $count % 2 == 1 } {
            const $W: usize = 1;
            $panel;
        }
    }};
}
pub(super) use panels;

/// Where the panel of a column begins, and how many columns it has.
#[inline(always)]
pub(super) const fn panel_of<E>(column: usize, count: usize, stages: usize) -> (usize, usize) {
    let (mut begin, mut width) = (0, width::<E>(stages, count));
    loop {
        let whole = begin + (count - begin) / width * width;
        if column < whole || width == 1 {
            return (begin + (column - begin) / width * width, width);
        }
        (begin, width) = (whole, width / 2);
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
pub(crate) trait Directions<E> {
    /// How many columns their panels have.
    const COLUMNS: usize;
    /// Whether each is an element of `w`.
    const SPARSE: bool = false;
    /// The column of an element of `w`, if that is a direction.
    fn column(_index: usize) -> Option<usize> {
        None
    }
    /// `row += factor · dw_index`, in the columns from `column` on.
    fn add<const W: usize>(&self, index: usize, factor: E, column: usize, row: &mut [E; W]);
    /// `Σ_c weight_c dw_index,c` over all columns, with the weights of the first sum or the second.
    fn total(&self, index: usize, second: bool) -> E;
}

/// One direction for each element of `w` that has any influence.
pub(crate) struct Identity<M>(PhantomData<M>);

impl<M> Identity<M> {
    pub(crate) const ALL: Self = Self(PhantomData);
}

impl<M: Dae> Identity<M> {
    /// The column of a direction.
    #[inline(always)]
    pub(crate) fn column(index: usize) -> Option<usize> {
        match M::STRUCTURE.column_of_direction.get(index) {
            Some(&NO_COLUMN) | None => None,
            Some(&column) => Some(column as usize),
        }
    }
}

impl<M: Dae, E: Lanes> Directions<E> for Identity<M> {
    const COLUMNS: usize = all_columns::<M, E>();
    const SPARSE: bool = true;

    #[inline(always)]
    fn column(index: usize) -> Option<usize> {
        Self::column(index)
    }

    #[cfg_attr(not(debug_assertions), inline(always))]
    fn add<const W: usize>(&self, index: usize, factor: E, column: usize, row: &mut [E; W]) {
        let Some(of_index) = Self::column(index) else { return };
        if let Some(element) = row.get_mut(of_index.wrapping_sub(column)) {
            *element = *element + factor;
        }
    }

    #[inline(always)]
    fn total(&self, index: usize, second: bool) -> E {
        Self::column(index).map_or(E::from_f64(0.0), |column| weight(column, second))
    }
}

/// The rows of a matrix: each direction is a column.
pub(crate) struct Seeded<'a, E, const C: usize>(pub &'a [[E; C]]);

impl<E: Lanes, const C: usize> Directions<E> for Seeded<'_, E, C> {
    const COLUMNS: usize = C;

    #[cfg_attr(not(debug_assertions), inline(always))]
    fn add<const W: usize>(&self, index: usize, factor: E, column: usize, row: &mut [E; W]) {
        let seeds = self.0.get(index).and_then(|row| row.get(column..)).unwrap_or_default();
        for (element, &seed) in row.iter_mut().zip(seeds) {
            *element = *element + factor * seed;
        }
    }

    #[inline(always)]
    fn total(&self, index: usize, second: bool) -> E {
        let mut total = E::from_f64(0.0);
        for (column, &seed) in self.0.get(index).into_iter().flatten().enumerate() {
            total = total + weight::<E>(column, second) * seed;
        }
        total
    }
}

/// The weight of a direction in the first sum over all of them, or in the second: neither equal nor
/// alternating, so that no structure hides an error.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(super) fn weight<E: Field>(direction: usize, second: bool) -> E {
    let rank = if second { 2 * direction + 1 } else { 3 * direction } % 7;
    E::from_f64(1.0) + E::from_f64(0.25) * E::from_whole(rank)
}

#[cfg(all(test, feature = "alloc", target_arch = "x86_64"))]
mod tests {
    use super::{padded, panel_of};
    use crate::scalar::lanes::{F64x4, F64x8};
    use alloc::vec::Vec;

    /// The widths of panels that follow each other, of so many columns.
    fn widths<E>(columns: usize, stages: usize) -> Vec<usize> {
        let (mut widths, mut column) = (Vec::new(), 0);
        while column < columns {
            let (begin, width) = panel_of::<E>(column, columns, stages);
            assert_eq!(begin, column);
            assert!((begin..begin + width).all(|of| panel_of::<E>(of, columns, stages) == (begin, width)));
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
            let columns = padded::<f64>(directions, usize::MAX);
            assert!((directions..directions.next_multiple_of(8) + 1).contains(&columns));
            let mut narrow = widths::<f64>(columns, 3);
            narrow.retain(|&width| width < 8);
            assert!(narrow.len() <= 1, "{directions}: {narrow:?}");
            for (columns, stages) in [
                (padded::<F64x4<4>>(directions, usize::MAX), 2),
                (padded::<F64x8<8>>(directions, usize::MAX), 2),
                (padded::<F64x8<8>>(directions, usize::MAX), 4),
            ] {
                assert!((directions..=directions + 1).contains(&columns));
                let mut narrow = widths::<F64x8<8>>(columns, stages);
                narrow.retain(|&width| width < 4);
                assert!(narrow.len() <= 1, "{directions}: {narrow:?}");
            }
            // Without memory for more, columns are directions.
            assert_eq!(padded::<f64>(directions, directions), directions);
        }
    }
}
