//! The rows of `D` that enter second derivatives: of curved variables at all stages, from the
//! derivatives of a step.

use crate::irk::directions::{Directions, L1_CACHE_BYTES, all_columns, width};
use crate::linalg::{Arithmetic, Block, PanelRow};
use crate::model::Dae;
use crate::scalar::Lanes;
use crate::shape::{Plain, Shape};
use core::marker::PhantomData;

/// Whether all stages of a variable lie together: unless a panel is too large for the nearest
/// cache, or numbers are registers of which there may be sixteen, too few for more than two stages.
pub(in crate::irk) const fn together<M: Dae, E, const S: usize>() -> bool {
    let panel = M::STRUCTURE.curved.len() * S * width::<E>(S, all_columns::<M, E>()) * size_of::<E>();
    panel <= L1_CACHE_BYTES / 2 && (S <= 2 || align_of::<E>() <= 8 || align_of::<E>() >= 64)
}

/// Where the row of a curved variable at a stage lies in a panel of `D`.
#[inline(always)]
pub(in crate::irk) const fn row_of<M: Dae, E, const S: usize>(variable: usize, stage: usize) -> usize {
    if const { together::<M, E, S>() } {
        variable * S + stage
    } else {
        stage * M::STRUCTURE.curved.len() + variable
    }
}

/// What they are made by.
pub(in crate::irk) struct CurvedRows<'a, M, E: Plain, D, const S: usize> {
    /// `−hA`
    pub minus_ha: Block<E, S>,
    pub directions: &'a D,
    pub model: PhantomData<M>,
}

impl<M: Dae, E: Lanes, D: Directions<E>, const S: usize> CurvedRows<'_, M, E, D, S> {
    /// Those of a panel, from the derivatives of its stages.
    #[inline(always)]
    pub fn panel<A: Arithmetic, const W: usize>(
        &self,
        v: &[[E; W]],
        dy: &[PanelRow<E, S, W>],
        d: &mut [[E; W]],
        column: usize,
    ) {
        let (nx, nz) = (M::Shape::NX, M::Shape::NZ);
        for (c, &variable) in M::STRUCTURE.curved.iter().enumerate() {
            let variable = variable as usize;
            if (nx..2 * nx).contains(&variable) {
                let (Some(dk), Some(start)) = (dy.get(variable - nx), v.get(variable - nx)) else { continue };
                for i in 0..S {
                    let Some(d) = d.get_mut(row_of::<M, E, S>(c, i)) else { continue };
                    let mut row = *start;
                    for (column, dk) in self.minus_ha.iter().zip(dk) {
                        A::subtract_row(&mut row, column[i], dk);
                    }
                    *d = row;
                }
            } else if variable < 2 * nx + nz {
                let unknown = if variable < nx { variable } else { variable - nx };
                let Some(own) = dy.get(unknown) else { continue };
                for (i, own) in own.iter().enumerate() {
                    if let Some(d) = d.get_mut(row_of::<M, E, S>(c, i)) {
                        *d = *own;
                    }
                }
            } else {
                for i in 0..S {
                    let Some(d) = d.get_mut(row_of::<M, E, S>(c, i)) else { continue };
                    *d = [E::from_f64(0.0); W];
                    self.directions.add(variable - nx - nz, E::from_f64(1.0), column, d);
                }
            }
        }
    }
}
