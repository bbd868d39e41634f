//! The rows of `D` that enter second derivatives: of curved variables at all stages, from the
//! derivatives of a step.

use crate::irk::directions::{Directions, L1_CACHE_BYTES, known_columns, width};
use crate::linalg::{Arithmetic, Block, PanelRow};
use crate::plan::Plan;
use crate::scalar::Lanes;

/// Whether all stages of a variable lie together: unless a panel is too large for the nearest
/// cache, or numbers are registers of which there may be sixteen, too few for more than two stages.
const fn are_together<E, const S: usize>(curved: usize, columns: usize) -> bool {
    let panel = curved * S * width::<E>(S, columns) * size_of::<E>();
    panel <= L1_CACHE_BYTES / 2 && (S <= 2 || align_of::<E>() <= 8 || align_of::<E>() >= 64)
}

/// The same of a plan. Where kernels are not compiled for one model, variables of a stage do.
pub(in crate::irk) const fn together<P: Plan, E, const S: usize>() -> bool {
    match (P::KNOWN, known_columns::<P, E>()) {
        (Some(structure), Some(columns)) => are_together::<E, S>(structure.curved.len(), columns),
        _ => false,
    }
}

/// Where rows of curved variables lie in a panel of `D`.
#[derive(Clone, Copy)]
pub(in crate::irk) struct Rows {
    curved: usize,
    /// Whether all stages of a variable lie together.
    together: bool,
}

impl Rows {
    /// Those of a plan.
    #[inline(always)]
    pub fn of<P: Plan, E, const S: usize>(plan: P) -> Self {
        let curved = plan.structure().curved.len();
        Self { curved, together: const { together::<P, E, S>() } }
    }

    /// The row of a curved variable at a stage.
    #[inline(always)]
    pub fn at<const S: usize>(self, variable: usize, stage: usize) -> usize {
        if self.together { variable * S + stage } else { stage * self.curved + variable }
    }
}

/// What they are made by.
pub(in crate::irk) struct CurvedRows<P, E, D, const S: usize> {
    pub plan: P,
    /// `−hA`
    pub minus_ha: Block<E, S>,
    pub directions: D,
}

impl<P: Plan, E: Lanes, D: Directions<E>, const S: usize> CurvedRows<P, E, D, S> {
    /// Those of a panel, from the derivatives of its stages.
    #[inline(always)]
    pub fn panel<A: Arithmetic, const W: usize>(
        &self,
        v: &[[E; W]],
        dy: &[PanelRow<E, S, W>],
        d: &mut [[E; W]],
        column: usize,
    ) {
        let (nx, nz) = (self.plan.nx(), self.plan.nz());
        let rows = Rows::of::<P, E, S>(self.plan);
        for (c, &variable) in self.plan.structure().curved.iter().enumerate() {
            let variable = variable as usize;
            if (nx..2 * nx).contains(&variable) {
                let (Some(dk), Some(start)) = (dy.get(variable - nx), v.get(variable - nx)) else { continue };
                for i in 0..S {
                    let Some(d) = d.get_mut(rows.at::<S>(c, i)) else { continue };
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
                    if let Some(d) = d.get_mut(rows.at::<S>(c, i)) {
                        *d = *own;
                    }
                }
            } else {
                for i in 0..S {
                    let Some(d) = d.get_mut(rows.at::<S>(c, i)) else { continue };
                    *d = [E::from_f64(0.0); W];
                    self.directions.add(variable - nx - nz, E::from_f64(1.0), column, d);
                }
            }
        }
    }
}
