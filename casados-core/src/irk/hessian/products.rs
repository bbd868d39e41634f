//! `Σ_i D_iᵀ H_i D_i` over the stages of a step, with `H_i` sparse and symmetric: first `G = −H D`,
//! a panel at a time, then the lower triangle of `Dᵀ G`.
//!
//! In a panel of `D` the stages of a variable are adjacent; in a large panel the variables of a
//! stage are, so that the factors of a product are in the L1 cache.

use super::sparse_product::multiply;
use crate::irk::directions::{panel, panels, static_columns};
use crate::irk::forward::stage_sensitivities::stages_adjacent;
use crate::linalg::{Arithmetic, Kernel, is_large_plan};
use crate::plan::Plan;
use crate::scalar::Lanes;
use crate::shape::InBounds;

/// Number of columns of the memory for `G`: two panels if there are enough registers for their
/// products, or `G` and `M` of one panel (`matrix_adjoint`). Firmware trades time for memory.
pub const G_COLUMNS: usize = if cfg!(feature = "std") { 16 } else { 8 };

/// A matrix over all directions, in row-major order, with the distance `stride` between rows.
pub struct StridedMatrix<'a, E> {
    pub elements: &'a mut [E],
    pub stride: usize,
}

impl<E> StridedMatrix<'_, E> {
    /// A row from a column on.
    #[inline(always)]
    pub fn row(&self, row: usize, column: usize) -> Option<&[E]> {
        self.elements.get(row * self.stride + column..(row + 1) * self.stride)
    }

    /// A row from a column on.
    #[inline(always)]
    pub fn row_mut(&mut self, row: usize, column: usize) -> Option<&mut [E]> {
        self.elements.get_mut(row * self.stride + column..(row + 1) * self.stride)
    }
}

/// `sum −= Σ_i D_iᵀ H_i D_i` (lower triangle), with `H_i` given by its lower triangle; the sum
/// starts at zero if `from_zero`.
pub struct CongruenceKernel<'a, M, E, const S: usize> {
    pub plan: M,
    /// Number of columns of all directions.
    pub columns: usize,
    pub entries: &'a [[E; S]],
    pub d: &'a [E],
    pub g: &'a mut [[[E; G_COLUMNS]; S]],
    pub sum: StridedMatrix<'a, E>,
    pub from_zero: bool,
}

impl<M: Plan, E: Lanes, const S: usize> Kernel for CongruenceKernel<'_, M, E, S> {
    type Number = E;
    type Output = ();
    const WIDE: bool = is_large_plan::<M, S>() && matches!(static_columns::<M, E>(), Some(8..));
    #[inline(always)]
    fn run<A: Arithmetic>(mut self) {
        let mut start = 0;
        let columns = match const { static_columns::<M, E>() } {
            Some(columns) => columns,
            None => self.columns,
        };
        self.columns = columns;
        if M::KNOWN_STRUCTURE.is_some() {
            self.sum.stride = M::NC;
        }
        if const { A::WIDE && size_of::<E>() <= 8 && G_COLUMNS == 16 } {
            while start + 16 <= columns {
                self.subtract_panels::<A, 8, 2>(start);
                start += 16;
            }
        }
        panels!([static_columns::<M, E>(), columns], E, S, column from start, W => self.subtract_panels::<A, W, 1>(column));
    }
}

impl<M: Plan, E: Lanes, const S: usize> CongruenceKernel<'_, M, E, S> {
    /// Processes `P` panels of `W` columns: all stages at a time, or pairs of stages.
    #[inline(always)]
    fn subtract_panels<A: Arithmetic, const W: usize, const P: usize>(&mut self, column: usize) {
        if const { stages_adjacent::<M, E, S>() } {
            self.subtract_stages::<A, S, 1, W, P>(0, column);
            return;
        }
        let mut stage = 0;
        // The rows of a term fit the registers with pairs of stages, or with wider panels.
        while const { W <= 4 } && stage + 2 <= S {
            self.subtract_stages::<A, 1, 2, W, P>(stage, column);
            stage += 2;
        }
        while stage < S {
            self.subtract_stages::<A, 1, 1, W, P>(stage, column);
            stage += 1;
        }
    }

    /// Processes `N` groups of `L` adjacent stages, from `stage` on.
    #[inline(always)]
    fn subtract_stages<A: Arithmetic, const L: usize, const N: usize, const W: usize, const P: usize>(
        &mut self,
        stage: usize,
        column: usize,
    ) {
        let curved = self.plan.structure().curved.len();
        let rows = curved * L;
        let g = self
            .g
            .as_flattened_mut()
            .as_flattened_mut()
            .get_mut(..rows * N * P * W)
            .in_bounds()
            .unwrap_or_default();
        let g = g.as_chunks_mut::<W>().0.as_chunks_mut::<P>().0;
        multiply::<A, M, E, S, L, N, W, P>(
            self.plan,
            self.entries,
            self.d,
            g.as_chunks_mut().0,
            stage,
            column,
        );
        for group in 0..N {
            self.subtract_tiles::<A, W, P>(group * rows, rows, (stage + group * L) * curved, column);
        }
    }

    /// `sum −= Dᵀ G` for `count` rows of panels of `−G` from `g_begin` on, and of `D` from
    /// `d_begin` on.
    #[inline(always)]
    fn subtract_tiles<A: Arithmetic, const W: usize, const P: usize>(
        &mut self,
        g_begin: usize,
        count: usize,
        d_begin: usize,
        column: usize,
    ) {
        let (row_count, columns) = (self.plan.structure().curved.len() * S, self.columns);
        let g = self.g.as_flattened().as_flattened().as_chunks::<W>().0.as_chunks::<P>().0;
        panels!([static_columns::<M, E>(), columns], E, S, row, V => {
            if row >= column {
                let g = g.get(g_begin..g_begin + count).in_bounds().unwrap_or_default();
                let d = panel::<E, V>(self.d, row, row_count).get(d_begin..d_begin + count).in_bounds().unwrap_or_default();
                let (sum, fresh) = (&mut self.sum, self.from_zero && d_begin == 0);
                if const { size_of::<E>() > 8 && V > 2 && W <= 4 && A::WIDE } {
                    subtract_panel_tiles::<A, E, V, 4, 1, W, P>(d, g, sum, fresh, [row, column]);
                } else if const { size_of::<E>() > 8 && V > 2 } {
                    subtract_panel_tiles::<A, E, V, 2, 1, W, P>(d, g, sum, fresh, [row, column]);
                } else if const { size_of::<E>() > 8 } {
                    subtract_panel_tiles::<A, E, V, V, 1, W, P>(d, g, sum, fresh, [row, column]);
                } else if const { V > 4 && A::WIDE } {
                    subtract_panel_tiles::<A, E, V, 8, 1, W, P>(d, g, sum, fresh, [row, column]);
                } else if const { V > 4 } {
                    subtract_panel_tiles::<A, E, V, 4, 1, W, P>(d, g, sum, fresh, [row, column]);
                } else if const { V > 2 } {
                    subtract_panel_tiles::<A, E, V, 4, 2, W, P>(d, g, sum, fresh, [row, column]);
                } else {
                    subtract_panel_tiles::<A, E, V, V, 4, W, P>(d, g, sum, fresh, [row, column]);
                }
            }
        });
    }
}

/// `sum −= Dᵀ G` for a panel of `D` (rows from `row` on) and panels of `−G` (columns from `column`
/// on). Each micro-tile stays in registers over all variables and stages, with as many accumulators
/// as hide the latency of additions. Elements above the diagonal are written, but never read.
#[inline(always)]
fn subtract_panel_tiles<
    A: Arithmetic,
    E: Lanes,
    const V: usize,
    const ROWS: usize,
    const ACCUMULATORS: usize,
    const W: usize,
    const P: usize,
>(
    d: &[[E; V]],
    g: &[[[E; W]; P]],
    sum: &mut StridedMatrix<'_, E>,
    from_zero: bool,
    [row, column]: [usize; 2],
) {
    for t in 0..V / ROWS {
        let mut accumulators = [[[[E::from_f64(0.0); W]; P]; ROWS]; ACCUMULATORS];
        let ((d, last_d), (g, last_g)) = (d.as_chunks::<ACCUMULATORS>(), g.as_chunks::<ACCUMULATORS>());
        for (d, g) in d.iter().zip(g) {
            for ((tile, d), g) in accumulators.iter_mut().zip(d).zip(g) {
                subtract_outer::<A, E, V, ROWS, W, P>(tile, d, g, t);
            }
        }
        let Some((tile, others)) = accumulators.split_first_mut() else { return };
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
            let columns = sum
                .row_mut(row + t * ROWS + r, column)
                .and_then(|row| row.as_chunks_mut::<W>().0.first_chunk_mut::<P>());
            let Some(columns) = columns else { continue };
            // Whole register rows: the compiler would turn loops over single elements into a loop
            // over rows, which are far apart in memory.
            for (columns, tile) in columns.iter_mut().zip(tile) {
                let mut sum = if from_zero { [E::from_f64(0.0); W] } else { *columns };
                A::subtract_row(&mut sum, E::from_f64(1.0), tile);
                *columns = sum;
            }
        }
    }
}

/// `tile − d gᵀ` for `ROWS` elements of `d`.
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
    tile_index: usize,
) {
    let Some(d) = d.as_chunks::<ROWS>().0.get(tile_index).in_bounds() else { return };
    for (tile, &d) in tile.iter_mut().zip(d) {
        for (tile, g) in tile.iter_mut().zip(g) {
            A::subtract_row(tile, d, g);
        }
    }
}
