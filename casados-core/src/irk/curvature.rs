//! `Σ_i D_iᵀ H_i D_i` over the stages of a step, with `H_i` sparse and symmetric: first `G = −H D`, a few columns at a time,
//! then the lower triangle of `Dᵀ G`.
//!
//! In a panel of `D` the stages of a variable lie beside each other, or, where it is large, variables of a stage do: what is multiplied is
//! then in the nearest cache.

use super::directions::{NEAREST, panel, panels, width};
use crate::linalg::{Arithmetic, Kernel, is_long};
use crate::model::{Dae, Term};
use crate::scalar::Lanes;
use crate::shape::Array;
use crate::structure::MOST_ROWS;
use core::marker::PhantomData;

/// So many columns of `G` are there at a time: two panels where registers are enough for their products.
pub const COLUMNS: usize = if cfg!(all(target_arch = "x86_64", feature = "std")) { 16 } else { 8 };

/// Whether all stages of a variable lie together: unless a panel is too large for the nearest cache, or numbers are registers of which
/// there may be sixteen, too few for more than two stages.
const fn together<M: Dae, E, const S: usize>() -> bool {
    let panel = M::STRUCTURE.curved.len() * S * width::<E>(S, M::STRUCTURE.directions.len()) * size_of::<E>();
    panel <= NEAREST / 2 && (S <= 2 || align_of::<E>() <= 8 || align_of::<E>() >= 64)
}

/// Where the row of a curved variable at a stage lies in a panel of `D`.
#[inline(always)]
pub const fn row_of<M: Dae, E, const S: usize>(variable: usize, stage: usize) -> usize {
    if const { together::<M, E, S>() } {
        variable * S + stage
    } else {
        stage * M::STRUCTURE.curved.len() + variable
    }
}

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
    /// `P` panels of `W` columns: all stages at a time, or pairs of them.
    #[inline(always)]
    fn panels<A: Arithmetic, const W: usize, const P: usize>(&mut self, column: usize) {
        if const { together::<M, E, S>() } {
            self.stages::<A, S, 1, W, P>(0, column);
            return;
        }
        let mut stage = 0;
        // Rows that go through their columns together fit the registers with pairs of stages, or with wider panels.
        while const { W <= 4 } && stage + 2 <= S {
            self.stages::<A, 1, 2, W, P>(stage, column);
            stage += 2;
        }
        while stage < S {
            self.stages::<A, 1, 1, W, P>(stage, column);
            stage += 1;
        }
    }

    /// `N` groups of `L` stages, which lie together, from a stage on.
    #[inline(always)]
    fn stages<A: Arithmetic, const L: usize, const N: usize, const W: usize, const P: usize>(
        &mut self,
        stage: usize,
        column: usize,
    ) {
        let curved = M::STRUCTURE.curved.len();
        let rows = curved * L;
        let g = self.g.as_flattened_mut().as_flattened_mut().get_mut(..rows * N * P * W).unwrap_or_default();
        let g = g.as_chunks_mut::<W>().0.as_chunks_mut::<P>().0;
        multiply::<A, M, E, S, L, N, W, P>(self.entries, self.d, g.as_chunks_mut().0, stage, column);
        for group in 0..N {
            self.tiles::<A, W, P>(group * rows, rows, (stage + group * L) * curved, column);
        }
    }

    /// `sum −= Dᵀ G` for some rows of panels of `−G`, from a first one on, which belong to rows of `D` from another one on.
    #[inline(always)]
    fn tiles<A: Arithmetic, const W: usize, const P: usize>(
        &mut self,
        of_g: usize,
        count: usize,
        of_d: usize,
        column: usize,
    ) {
        let all = M::STRUCTURE.curved.len() * S;
        let g = self.g.as_flattened().as_flattened().as_chunks::<W>().0.as_chunks::<P>().0;
        let g = g.get(of_g..of_g + count).unwrap_or_default();
        panels!(M::STRUCTURE.directions.len(), E, S, row, V => {
            if row >= column {
                let d = panel::<E, V>(self.d, row, all).get(of_d..of_d + count).unwrap_or_default();
                let (sum, fresh) = (&mut *self.sum, self.fresh && of_d == 0);
                if const { size_of::<E>() > 8 && V > 2 && W <= 4 && A::WIDE } {
                    tiles::<A, E, R, V, 4, 1, W, P>(d, g, sum, fresh, [row, column]);
                } else if const { size_of::<E>() > 8 && V > 2 } {
                    tiles::<A, E, R, V, 2, 1, W, P>(d, g, sum, fresh, [row, column]);
                } else if const { size_of::<E>() > 8 } {
                    tiles::<A, E, R, V, V, 1, W, P>(d, g, sum, fresh, [row, column]);
                } else if const { V > 4 && A::WIDE } {
                    tiles::<A, E, R, V, 8, 1, W, P>(d, g, sum, fresh, [row, column]);
                } else if const { V > 4 } {
                    tiles::<A, E, R, V, 4, 1, W, P>(d, g, sum, fresh, [row, column]);
                } else if const { V > 2 } {
                    tiles::<A, E, R, V, 4, 2, W, P>(d, g, sum, fresh, [row, column]);
                } else {
                    tiles::<A, E, R, V, V, 4, W, P>(d, g, sum, fresh, [row, column]);
                }
            }
        });
    }
}

/// `G = −H D` at `N` groups of `L` stages, from a stage on, in `P` panels from a column on.
#[inline(always)]
fn multiply<
    A: Arithmetic,
    M: Dae,
    E: Lanes,
    const S: usize,
    const L: usize,
    const N: usize,
    const W: usize,
    const P: usize,
>(
    entries: &[[E; S]],
    d: &[E],
    g: &mut [[[[E; W]; P]; L]],
    stage: usize,
    column: usize,
) {
    let curved = M::STRUCTURE.curved.len();
    let mut of_d: [[&[[[E; W]; L]]; P]; N] = [[&[]; P]; N];
    for (group, of_d) in of_d.iter_mut().enumerate() {
        let first = stage + group * L;
        for (p, of_d) in of_d.iter_mut().enumerate() {
            let panel = panel::<E, W>(d, column + p * W, curved * S);
            *of_d = panel.get(first * curved..(first + L) * curved).unwrap_or_default().as_chunks().0;
        }
    }
    let mut terms = M::STRUCTURE.symmetric;
    while let Some(first) = terms.first() {
        let of = Multiply { entries, d: &of_d, stage };
        terms = match first.rows {
            3 if const { MOST_ROWS >= 3 } => of.rows::<A, M, 3>(terms, g),
            2 if const { MOST_ROWS >= 2 } => of.rows::<A, M, 2>(terms, g),
            _ => of.rows::<A, M, 1>(terms, g),
        };
    }
}

/// See [`multiply`].
struct Multiply<'a, E, const S: usize, const L: usize, const N: usize, const W: usize, const P: usize> {
    entries: &'a [[E; S]],
    d: &'a [[&'a [[[E; W]; L]]; P]; N],
    stage: usize,
}

impl<E: Lanes, const S: usize, const L: usize, const N: usize, const W: usize, const P: usize>
    Multiply<'_, E, S, L, N, W, P>
{
    /// `R` rows of `G` whose terms alternate; the terms of the others. What they are multiplied with is fetched once for all of them, so many
    /// columns and stages at a time that it fits registers beside them; of sixteen registers it seldom does.
    #[inline(always)]
    fn rows<A: Arithmetic, M: Dae, const R: usize>(
        &self,
        terms: &'static [Term],
        g: &mut [[[[E; W]; P]; L]],
    ) -> &'static [Term] {
        if const { R == 1 || !A::WIDE && (size_of::<E>() > 8 || L > 2) } {
            let mut others = terms;
            for row in 0..R {
                others = self.row::<A, M, R>(terms, g, row);
            }
            return others;
        }
        if const { size_of::<E>() > 8 && W > 4 } {
            self.in_parts::<A, M, R, 1, 4>(terms, g)
        } else if const { size_of::<E>() > 8 || A::WIDE && L % 2 == 1 } {
            self.in_parts::<A, M, R, 1, W>(terms, g)
        } else if const { A::WIDE } {
            self.in_parts::<A, M, R, 2, W>(terms, g)
        } else {
            self.in_parts::<A, M, R, L, W>(terms, g)
        }
    }

    /// One of `R` rows, at all stages.
    #[inline(always)]
    fn row<A: Arithmetic, M: Dae, const R: usize>(
        &self,
        mut terms: &'static [Term],
        g: &mut [[[[E; W]; P]; L]],
        row: usize,
    ) -> &'static [Term] {
        let mut packets = [[[[E::from_f64(0.0); W]; P]; L]; N];
        let Some(&first) = terms.get(row) else { return &[] };
        while let Some((now, rest)) = terms.split_first_chunk::<R>()
            && let Some(term) = now.get(row)
            && term.row == first.row
        {
            if let Some(values) = self.entries.get(term.entry as usize) {
                for (group, (packet, of_d)) in packets.iter_mut().zip(self.d).enumerate() {
                    for (p, d) in of_d.iter().enumerate() {
                        let Some(d) = d.get(term.column as usize) else { continue };
                        subtract_stages::<A, E, L, W, P>(packet, p, from(values, self.stage + group * L), d);
                    }
                }
            }
            terms = rest;
        }
        for (group, packet) in packets.iter().enumerate() {
            if let Some(to) = g.get_mut(group * M::STRUCTURE.curved.len() + first.row as usize) {
                *to = *packet;
            }
        }
        terms
    }

    /// `R` rows, `K` stages and `C` columns at a time.
    #[inline(always)]
    fn in_parts<A: Arithmetic, M: Dae, const R: usize, const K: usize, const C: usize>(
        &self,
        terms: &'static [Term],
        g: &mut [[[[E; W]; P]; L]],
    ) -> &'static [Term] {
        let mut others = terms;
        for (group, of_d) in self.d.iter().enumerate() {
            let g = g.get_mut(group * M::STRUCTURE.curved.len()..).unwrap_or_default();
            for stage in 0..L / K {
                for part in 0..W / C {
                    let values = self.stage + group * L + stage * K;
                    others = self.part::<A, R, K, C>(terms, g, of_d, [stage, part, values]);
                }
            }
        }
        others
    }

    #[inline(always)]
    fn part<A: Arithmetic, const R: usize, const K: usize, const C: usize>(
        &self,
        mut terms: &'static [Term],
        g: &mut [[[[E; W]; P]; L]],
        of_d: &[&[[[E; W]; L]]; P],
        [stage, part, of_values]: [usize; 3],
    ) -> &'static [Term] {
        let mut packets = [[[[E::from_f64(0.0); C]; P]; K]; R];
        let Some((&rows, _)) = terms.split_first_chunk::<R>() else { return &[] };
        while let Some((now, rest)) = terms.split_first_chunk::<R>()
            && now[0].row == rows[0].row
        {
            let mut factors = [[[E::from_f64(0.0); C]; P]; K];
            for (p, of_d) in of_d.iter().enumerate() {
                let Some(d) = of_d.get(now[0].column as usize) else { continue };
                let Some(d) = d.as_chunks::<K>().0.get(stage) else { continue };
                for (factors, d) in factors.iter_mut().zip(d) {
                    if let Some(d) = d.as_chunks::<C>().0.get(part) {
                        factors[p] = *d;
                    }
                }
            }
            for (term, packets) in now.iter().zip(&mut packets) {
                let Some(values) = self.entries.get(term.entry as usize) else { continue };
                for ((packets, &value), factors) in
                    packets.iter_mut().zip(from(values, of_values)).zip(&factors)
                {
                    for (packet, factors) in packets.iter_mut().zip(factors) {
                        A::subtract_row(packet, value, factors);
                    }
                }
            }
            terms = rest;
        }
        for (term, packets) in rows.iter().zip(&packets) {
            let Some(to) = g.get_mut(term.row as usize) else { continue };
            let Some(to) = to.as_chunks_mut::<K>().0.get_mut(stage) else { continue };
            for (to, packets) in to.as_flattened_mut().iter_mut().zip(packets.as_flattened()) {
                if let Some(to) = to.as_chunks_mut::<C>().0.get_mut(part) {
                    *to = *packets;
                }
            }
        }
        terms
    }
}

/// `packet − values d` at `N` stages, in one of `P` panels.
#[inline(always)]
fn subtract_stages<A: Arithmetic, E: Lanes, const N: usize, const W: usize, const P: usize>(
    packet: &mut [[[E; W]; P]; N],
    p: usize,
    values: &[E],
    d: &[[E; W]; N],
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

/// From one of them on.
#[inline(always)]
fn from<V>(all: &[V], first: usize) -> &[V] {
    all.get(first..).unwrap_or_default()
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
    fresh: bool,
    [row, column]: [usize; 2],
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
        for (r, tile) in tile.iter().enumerate() {
            let row = sum.get_mut(row + t * ROWS + r).and_then(|sum| sum.as_mut().get_mut(column..));
            let columns = row.and_then(|row| row.as_chunks_mut::<W>().0.first_chunk_mut::<P>());
            let Some(columns) = columns else { continue };
            // In registers: of loops over single elements the compiler makes one over rows, which lie far apart.
            for (columns, tile) in columns.iter_mut().zip(tile) {
                let mut sum = if fresh { [E::from_f64(0.0); W] } else { *columns };
                A::subtract_row(&mut sum, E::from_f64(1.0), tile);
                *columns = sum;
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
