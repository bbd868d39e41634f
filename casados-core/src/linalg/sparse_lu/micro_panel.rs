//! Panel rows of right-hand sides, between memory and registers.

use crate::linalg::block::{PanelRow, subtract_product};
use crate::linalg::kernel::arithmetic::{Arithmetic, Block};
use crate::scalar::{Field, each};
use crate::shape::{Array, InBounds, Plain};

/// Loads a panel row. The caller has checked the slot, so that there is no branch here.
#[cfg_attr(not(debug_assertions), inline(always))]
pub fn load<E: Field + Plain, R: Array<E>, const S: usize, const W: usize>(
    rows: &[[R; S]],
    slot: usize,
    column: usize,
) -> PanelRow<E, S, W> {
    let mut panel_row = [[E::from_f64(0.0); W]; S];
    if let Some(row) = rows.get(slot).in_bounds() {
        for (panel_row, row) in panel_row.iter_mut().zip(row) {
            if let Some(columns) = row.chunk(column) {
                *panel_row = *columns;
            }
        }
    }
    panel_row
}

/// `panel_row − block · other`, with `other` in memory.
#[cfg_attr(not(debug_assertions), inline(always))]
pub fn subtract_from_memory<A: Arithmetic, E: Field + Plain, R: Array<E>, const S: usize, const W: usize>(
    panel_row: &mut PanelRow<E, S, W>,
    block: &Block<E, S>,
    other: &[R; S],
    column: usize,
) {
    if const { W == 1 || size_of::<E>() <= 8 } {
        let other = load(core::slice::from_ref(other), 0, column);
        subtract_product::<A, E, S, W>(panel_row, block, &other);
        return;
    }
    each!(k < S => {
        if let Some(other) = other[k].chunk(column) {
            each!(i < S => { A::subtract_row(&mut panel_row[i], block[k][i], other); });
        }
    });
}

/// Nested loops: a closure would be compiled for every instruction set.
#[cfg_attr(not(debug_assertions), inline(always))]
pub fn is_zero<E: Field + Plain, R: Array<E>, const S: usize, const W: usize>(
    rows: &[[R; S]],
    slot: usize,
    column: usize,
) -> bool {
    for row in rows.get(slot).into_iter().flatten() {
        for element in row.as_ref().get(column..).in_bounds().unwrap_or_default().iter().take(W) {
            if *element != E::from_f64(0.0) {
                return false;
            }
        }
    }
    true
}

#[cfg_attr(not(debug_assertions), inline(always))]
pub fn store<E: Field + Plain, R: Array<E>, const S: usize, const W: usize>(
    rows: &mut [[R; S]],
    slot: usize,
    column: usize,
    panel_row: &PanelRow<E, S, W>,
) {
    if let Some(row) = rows.get_mut(slot).in_bounds() {
        for (panel_row, row) in panel_row.iter().zip(row) {
            if let Some(columns) = row.chunk_mut(column) {
                *columns = *panel_row;
            }
        }
    }
}
