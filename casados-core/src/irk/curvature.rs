//! `Σ_i D_iᵀ H_i D_i` over the stages of a step, with `H_i` sparse and symmetric: first `G = −H D`, a few columns at a time,
//! then the lower triangle of `Dᵀ G`.

use super::directions::{panel, panels};
use crate::linalg::{Arithmetic, Kernel, is_long};
use crate::model::Dae;
use crate::scalar::Lanes;
use crate::shape::Array;
use core::marker::PhantomData;

/// So many columns of `G` are there at a time: two panels where registers are enough for their products.
pub const COLUMNS: usize = if cfg!(all(target_arch = "x86_64", feature = "std")) { 16 } else { 8 };

/// `sum −= Σ_i D_iᵀ H_i D_i`, the lower triangle, with `H_i` given by its own; a `fresh` sum begins with zero.
pub struct Subtract<'a, M, E, R, const S: usize> {
    pub entries: &'a [[E; S]],
    pub d: &'a [E],
    pub g: &'a mut [[[E; COLUMNS]; S]],
    pub sum: &'a mut [R],
    pub fresh: bool,
    pub model: PhantomData<M>,
}

impl<M: Dae, E: Lanes, R: Array<E>, const S: usize> Kernel for Subtract<'_, M, E, R, S> {
    type Number = E;
    type Output = ();
    const WIDE: bool = is_long::<M, S>();
    #[inline(always)]
    fn run<A: Arithmetic>(mut self) {
        let mut start = 0;
        if const { A::WIDE && size_of::<E>() <= 8 && COLUMNS == 16 } {
            while start + 16 <= const { M::STRUCTURE.directions.len() } {
                self.panels::<A, 8, 2>(start);
                start += 16;
            }
        }
        panels!(M::STRUCTURE.directions.len(), E, S, column from start, W => self.panels::<A, W, 1>(column));
    }
}

impl<M: Dae, E: Lanes, R: Array<E>, const S: usize> Subtract<'_, M, E, R, S> {
    /// `P` panels of `W` columns.
    #[inline(always)]
    fn panels<A: Arithmetic, const W: usize, const P: usize>(&mut self, column: usize) {
        let rows = M::STRUCTURE.curved.len() * S;
        let g = self.g.as_flattened_mut().as_flattened_mut().get_mut(..rows * P * W).unwrap_or_default();
        let g = g.as_chunks_mut::<W>().0.as_chunks_mut::<P>().0;
        // All stages in registers, or two of them where numbers are registers themselves and there are sixteen.
        if const { size_of::<E>() <= 8 || A::WIDE || S <= 2 } {
            multiply::<A, M, E, S, S, W, P>(self.entries, self.d, g.as_chunks_mut().0, 0, column);
        } else {
            for stage in (0..S).step_by(2) {
                multiply::<A, M, E, S, 2, W, P>(self.entries, self.d, g.as_chunks_mut().0, stage, column);
            }
        }
        panels!(M::STRUCTURE.directions.len(), E, S, row, V => {
            if row >= column {
                let d = panel::<E, V>(self.d, row, rows);
                let sum = &mut *self.sum;
                if self.fresh {
                    for sum in sum.iter_mut().skip(row).take(V) {
                        let to = sum.as_mut().get_mut(column..).and_then(|sum| sum.as_chunks_mut::<W>().0.first_chunk_mut());
                        if let Some(to) = to {
                            *to = [[E::from_f64(0.0); W]; P];
                        }
                    }
                }
                if const { size_of::<E>() > 8 && V > 2 && A::WIDE } {
                    tiles::<A, E, R, V, 4, 1, W, P>(d, g, sum, row, column);
                } else if const { size_of::<E>() > 8 && V > 2 } {
                    tiles::<A, E, R, V, 2, 1, W, P>(d, g, sum, row, column);
                } else if const { size_of::<E>() > 8 } {
                    tiles::<A, E, R, V, V, 1, W, P>(d, g, sum, row, column);
                } else if const { V > 4 && A::WIDE } {
                    tiles::<A, E, R, V, 8, 1, W, P>(d, g, sum, row, column);
                } else if const { V > 4 } {
                    tiles::<A, E, R, V, 4, 1, W, P>(d, g, sum, row, column);
                } else if const { V > 2 } {
                    tiles::<A, E, R, V, 4, 2, W, P>(d, g, sum, row, column);
                } else {
                    tiles::<A, E, R, V, V, 4, W, P>(d, g, sum, row, column);
                }
            }
        });
    }
}

/// `G = −H D` at `N` stages, from a stage on, in `P` panels from a column on.
#[inline(always)]
fn multiply<
    A: Arithmetic,
    M: Dae,
    E: Lanes,
    const S: usize,
    const N: usize,
    const W: usize,
    const P: usize,
>(
    entries: &[[E; S]],
    d: &[E],
    g: &mut [[[[E; W]; P]; S]],
    stage: usize,
    column: usize,
) {
    let rows = M::STRUCTURE.curved.len() * S;
    let mut of_d: [&[[[E; W]; S]]; P] = [&[]; P];
    for (p, of_d) in of_d.iter_mut().enumerate() {
        *of_d = panel::<E, W>(d, column + p * W, rows).as_chunks().0;
    }
    // Without a slice for each row, which would have to be found.
    let (mut packet, mut terms) = ([[[E::from_f64(0.0); W]; P]; N], M::STRUCTURE.symmetric.iter());
    let mut next = terms.next();
    while let Some(term) = next {
        if let Some(values) = entries.get(term.entry as usize) {
            for (p, d) in of_d.iter().enumerate() {
                let Some(d) = d.get(term.column as usize) else { continue };
                subtract_stages::<A, E, N, W, P>(&mut packet, p, from(values, stage), from(d, stage));
            }
        }
        next = terms.next();
        if let Some(next) = next
            && next.row == term.row
        {
            continue;
        }
        if let Some(rows) = g.get_mut(term.row as usize).and_then(|rows| rows.get_mut(stage..)) {
            for (to, packet) in rows.iter_mut().zip(&packet) {
                *to = *packet;
            }
        }
        packet = [[[E::from_f64(0.0); W]; P]; N];
    }
}

/// `packet − values d` at `N` stages, in one of `P` panels.
#[inline(always)]
fn subtract_stages<A: Arithmetic, E: Lanes, const N: usize, const W: usize, const P: usize>(
    packet: &mut [[[E; W]; P]; N],
    p: usize,
    values: &[E],
    d: &[[E; W]],
) {
    if const { W == 1 && P == 1 }
        && let Some(packet) = packet.as_flattened_mut().as_flattened_mut().first_chunk_mut::<N>()
        && let (Some(values), Some(d)) = (values.first_chunk(), d.as_flattened().first_chunk())
    {
        // The stages of one column side by side.
        A::subtract_products(packet, values, d);
        return;
    }
    for ((packet, &value), d) in packet.iter_mut().zip(values).zip(d) {
        A::subtract_row(&mut packet[p], value, d);
    }
}

/// The stages from one of them on.
#[inline(always)]
fn from<V>(stages: &[V], first: usize) -> &[V] {
    stages.get(first..).unwrap_or_default()
}

/// `sum −= Dᵀ G` for a panel of `D` and panels of `−G` that begin with a row and a column; each tile is in registers while it
/// goes through all variables at all stages, in as many strands as hide how long an addition takes. Above the diagonal it
/// writes what nobody reads.
#[inline(always)]
fn tiles<
    A: Arithmetic,
    E: Lanes,
    R: Array<E>,
    const V: usize,
    const ROWS: usize,
    const STRANDS: usize,
    const W: usize,
    const P: usize,
>(
    d: &[[E; V]],
    g: &[[[E; W]; P]],
    sum: &mut [R],
    row: usize,
    column: usize,
) {
    for t in 0..V / ROWS {
        let mut strands = [[[[E::from_f64(0.0); W]; P]; ROWS]; STRANDS];
        let ((d, last_d), (g, last_g)) = (d.as_chunks::<STRANDS>(), g.as_chunks::<STRANDS>());
        for (d, g) in d.iter().zip(g) {
            for ((tile, d), g) in strands.iter_mut().zip(d).zip(g) {
                subtract_outer::<A, E, V, ROWS, W, P>(tile, d, g, t);
            }
        }
        let Some((tile, others)) = strands.split_first_mut() else { return };
        for (d, g) in last_d.iter().zip(last_g) {
            subtract_outer::<A, E, V, ROWS, W, P>(tile, d, g, t);
        }
        for other in others {
            let other = other.as_flattened().as_flattened();
            for (to, from) in tile.as_flattened_mut().as_flattened_mut().iter_mut().zip(other) {
                *to = *to + *from;
            }
        }
        for (tile, sum) in tile.iter().zip(sum.iter_mut().skip(row + t * ROWS)) {
            let (columns, _) = sum.as_mut().get_mut(column..).unwrap_or_default().as_chunks_mut::<W>();
            let Some(columns) = columns.first_chunk_mut::<P>() else { continue };
            for (sum, &tile) in columns.as_flattened_mut().iter_mut().zip(tile.as_flattened()) {
                *sum = *sum - tile;
            }
        }
    }
}

/// `tile − d gᵀ`, of `ROWS` elements of `d`.
#[inline(always)]
fn subtract_outer<
    A: Arithmetic,
    E: Lanes,
    const V: usize,
    const ROWS: usize,
    const W: usize,
    const P: usize,
>(
    tile: &mut [[[E; W]; P]; ROWS],
    d: &[E; V],
    g: &[[E; W]; P],
    t: usize,
) {
    let Some(d) = d.as_chunks::<ROWS>().0.get(t) else { return };
    for (tile, &d) in tile.iter_mut().zip(d) {
        for (tile, g) in tile.iter_mut().zip(g) {
            A::subtract_row(tile, d, g);
        }
    }
}
