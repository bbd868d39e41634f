//! The rows of `D` that enter second derivatives: those of nonlinear variables at all stages.

use crate::irk::directions::{Directions, L1_CACHE_BYTES, panel_width, static_columns};
use crate::linalg::{Arithmetic, Block, PanelRow};
use crate::plan::Plan;
use crate::scalar::Lanes;
use crate::shape::InBounds;

/// Whether the stages of a variable are adjacent in a panel of `D`. They are not if a panel exceeds
/// the L1 cache, or if numbers are SIMD registers, there are only sixteen of them, and more than
/// two stages.
const fn are_stages_adjacent<E, const S: usize>(curved: usize, columns: usize) -> bool {
    let panel = curved * S * panel_width::<E>(S, columns) * size_of::<E>();
    panel <= L1_CACHE_BYTES / 2 && (S <= 2 || align_of::<E>() <= 8 || align_of::<E>() >= 64)
}

/// Whether the stages of a variable are adjacent for a plan. If the plan is known at run time only,
/// the variables of a stage are adjacent.
pub(in crate::irk) const fn stages_adjacent<P: Plan, E, const S: usize>() -> bool {
    match (P::KNOWN_STRUCTURE, static_columns::<P, E>()) {
        (Some(structure), Some(columns)) => are_stages_adjacent::<E, S>(structure.curved.len(), columns),
        _ => false,
    }
}

/// The order of the rows of nonlinear variables in a panel of `D`.
#[derive(Clone, Copy)]
pub(in crate::irk) struct StageRowLayout {
    nonlinear_count: usize,
    /// Whether the stages of a variable are adjacent.
    stages_adjacent: bool,
}

impl StageRowLayout {
    /// The layout for a plan.
    #[inline(always)]
    pub fn for_plan<P: Plan, E, const S: usize>(plan: P) -> Self {
        let curved = plan.structure().curved.len();
        Self { nonlinear_count: curved, stages_adjacent: const { stages_adjacent::<P, E, S>() } }
    }

    /// The row of a nonlinear variable at a stage.
    #[inline(always)]
    pub fn row_index<const S: usize>(self, variable: usize, stage: usize) -> usize {
        if self.stages_adjacent { variable * S + stage } else { stage * self.nonlinear_count + variable }
    }
}

/// Writes the rows of `D`.
pub(in crate::irk) struct StageRowWriter<P, E, D, const S: usize> {
    pub plan: P,
    /// `−hA`
    pub minus_ha: Block<E, S>,
    pub directions: D,
}

impl<P: Plan, E: Lanes, D: Directions<E>, const S: usize> StageRowWriter<P, E, D, S> {
    /// Writes the rows of a panel from the derivatives of its stages.
    #[inline(always)]
    pub fn write_panel<A: Arithmetic, const W: usize>(
        &self,
        v: &[[E; W]],
        dy: &[PanelRow<E, S, W>],
        d: &mut [[E; W]],
        column: usize,
    ) {
        let (nx, nz) = (self.plan.nx(), self.plan.nz());
        let rows = StageRowLayout::for_plan::<P, E, S>(self.plan);
        for (c, &variable) in self.plan.structure().curved.iter().enumerate() {
            let variable = variable as usize;
            if (nx..2 * nx).contains(&variable) {
                let (Some(dk), Some(start)) =
                    (dy.get(variable - nx).in_bounds(), v.get(variable - nx).in_bounds())
                else {
                    continue;
                };
                for i in 0..S {
                    let Some(d) = d.get_mut(rows.row_index::<S>(c, i)).in_bounds() else { continue };
                    let mut row = *start;
                    for (column, dk) in self.minus_ha.iter().zip(dk) {
                        A::subtract_row(&mut row, column[i], dk);
                    }
                    *d = row;
                }
            } else if variable < 2 * nx + nz {
                let unknown = if variable < nx { variable } else { variable - nx };
                let Some(unknown_rows) = dy.get(unknown).in_bounds() else { continue };
                for (i, own) in unknown_rows.iter().enumerate() {
                    if let Some(d) = d.get_mut(rows.row_index::<S>(c, i)).in_bounds() {
                        *d = *own;
                    }
                }
            } else {
                for i in 0..S {
                    let Some(d) = d.get_mut(rows.row_index::<S>(c, i)).in_bounds() else { continue };
                    *d = [E::from_f64(0.0); W];
                    self.directions.add_scaled(variable - nx - nz, E::from_f64(1.0), column, d);
                }
            }
        }
    }
}
