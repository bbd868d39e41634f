//! `Dᵀ H D` with a sparse symmetric matrix `H`.

use crate::linalg::{Arithmetic, Kernel};
use crate::model::Pattern;
use crate::scalar::Lanes;
use crate::shape::{Array, InBounds};

/// `sum −= Dᵀ H D` at a stage (lower triangle), with `H` given by its lower triangle.
pub(crate) struct CongruenceUpdate<'a, E, R, const S: usize> {
    pub pattern: Pattern,
    pub nonlinear_variables: &'static [u32],
    pub entries: &'a [[E; S]],
    pub stage: usize,
    pub d: &'a [R],
    pub g: &'a mut [R],
    pub sum: &'a mut [R],
}

impl<E: Lanes, R: Array<E>, const S: usize> Kernel for CongruenceUpdate<'_, E, R, S> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { pattern, nonlinear_variables: curved, entries, stage, d, g, sum } = self;
        for &row in curved {
            if let Some(row) = g.get_mut(row as usize).in_bounds() {
                row.as_mut().fill(E::from_f64(0.0));
            }
        }
        // G = H D
        let places = pattern.rows.iter().zip(pattern.columns);
        for ((&row, &column), values) in places.zip(entries) {
            let Some(&value) = values.get(stage).in_bounds() else { continue };
            add_scaled_row::<A, E, R>(value, d, column, g, row);
            if row != column {
                add_scaled_row::<A, E, R>(value, d, row, g, column);
            }
        }
        // Micro-tiles of the triangle, each summed over all nonlinear variables in registers. The
        // last tiles overlap the preceding ones, and skip the elements that these have computed.
        // SIMD registers have narrow tiles.
        let wide = const { size_of::<E>() <= 8 };
        let rows = if R::LEN < 4 { 1 } else { 4 };
        let mut row = 0;
        while row < R::LEN {
            let start = row.min(R::LEN - rows);
            let mut column = 0;
            while column < start + rows {
                let skip = [row - start, 0];
                if wide && column + 8 <= R::LEN && rows == 4 {
                    subtract_tile::<A, E, R, 4, 8>(curved, d, g, sum, [start, column], skip);
                    column += 8;
                } else if wide && R::LEN >= 8 && column + 4 < R::LEN {
                    let at = R::LEN - 8;
                    subtract_tile::<A, E, R, 4, 8>(curved, d, g, sum, [start, at], [skip[0], column - at]);
                    column = R::LEN;
                } else if !wide && rows == 4 {
                    let at = column.min(R::LEN - 2);
                    subtract_tile::<A, E, R, 4, 2>(curved, d, g, sum, [start, at], [skip[0], column - at]);
                    column = at + 2;
                } else if rows == 4 {
                    let at = column.min(R::LEN - 4);
                    subtract_tile::<A, E, R, 4, 4>(curved, d, g, sum, [start, at], [skip[0], column - at]);
                    column = at + 4;
                } else {
                    subtract_tile::<A, E, R, 1, 1>(curved, d, g, sum, [start, column], skip);
                    column += 1;
                }
            }
            row = start + rows;
        }
    }
}

/// `g_to += value · d_from`
#[inline(always)]
fn add_scaled_row<A: Arithmetic, E: Lanes, R: Array<E>>(value: E, d: &[R], from: u32, g: &mut [R], to: u32) {
    let (Some(from), Some(to)) = (d.get(from as usize).in_bounds(), g.get_mut(to as usize).in_bounds())
    else {
        return;
    };
    let value = -value;
    for (to, &from) in to.as_mut().iter_mut().zip(from.as_ref()) {
        *to = A::subtract(*to, value, from);
    }
}

/// A micro-tile of `sum −= Dᵀ G` from a row and a column on, without the first `skipped` rows and
/// columns. Elements above the diagonal may be written, but are never read.
#[inline(always)]
fn subtract_tile<A: Arithmetic, E: Lanes, R: Array<E>, const ROWS: usize, const COLUMNS: usize>(
    curved: &[u32],
    d: &[R],
    g: &[R],
    sum: &mut [R],
    [row, column]: [usize; 2],
    skipped: [usize; 2],
) {
    let mut tile = [[E::from_f64(0.0); COLUMNS]; ROWS];
    for &variable in curved {
        let (Some(d), Some(g)) = (d.get(variable as usize).in_bounds(), g.get(variable as usize).in_bounds())
        else {
            continue;
        };
        let (Some(d), Some(g)) = (d.as_ref().get(row..).in_bounds(), g.as_ref().get(column..).in_bounds())
        else {
            continue;
        };
        let (Some(d), Some(g)) = (d.first_chunk::<ROWS>(), g.first_chunk::<COLUMNS>()) else { continue };
        for (tile, &d) in tile.iter_mut().zip(d) {
            A::subtract_row(tile, d, g);
        }
    }
    for (tile, sum) in tile.iter().zip(sum.iter_mut().skip(row)).skip(skipped[0]) {
        for (&tile, sum) in tile.iter().zip(sum.as_mut().iter_mut().skip(column)).skip(skipped[1]) {
            *sum = *sum + tile;
        }
    }
}
