//! Derivatives of groups of intervals, in panels of columns.
//!
//! Columns of SIMD registers are as many times longer as there are lanes, so that those of all
//! stages exceed the L1 cache. Therefore all stages of a step are linearised first; then each panel
//! is propagated through all of them.

use super::forward::{Directions, UnitDirections, Variation, begin};
use super::forward_sweep::ForwardSweep;
use super::scheme::{Grid, Scheme};
use super::step::{StagePoint, StepWorkspace, UnitStride};
use crate::error::{Error, Place};
use crate::linalg::{kernels, run_plain};
use crate::model::{ArrayW, ArrayX, Ode};
use crate::scalar::Lanes;
use crate::shape::{InBounds, Shape};
use bytemuck::Zeroable;

/// Number of columns of a panel: enough independent products to hide their latency.
const PANEL_WIDTH: usize = 4;

/// A forward sweep panel by panel.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(crate) struct ColumnPanels<M: Ode, E: Lanes, const S: usize> {
    /// The Jacobian of each stage of a step.
    jacobians: [M::Jacobian<[E; 1]>; S],
    panel: Variation<M, E, [E; PANEL_WIDTH], S>,
}

/// The unit vectors of a panel.
#[derive(Clone, Copy)]
struct PanelColumns {
    first: usize,
    columns: usize,
}

impl<M: Ode, E: Lanes> Directions<M, E> for PanelColumns {
    #[inline(always)]
    fn columns(self) -> usize {
        self.columns
    }
    #[inline(always)]
    fn add_scaled(self, i: usize, coefficient: E, row: &mut [E]) {
        if let Some(element) = i.checked_sub(self.first).and_then(|i| row.get_mut(i)) {
            *element = *element + coefficient;
        }
    }
}

impl<M: Ode, E: Lanes, const S: usize> ForwardSweep<M, E, S> for ColumnPanels<M, E, S> {
    fn integrate(
        &mut self,
        scheme: &Scheme<M, E, S>,
        grid: &Grid<E>,
        workspace: &mut StepWorkspace<M, E, S>,
        variation: &mut Variation<M, E, ArrayW<M, E>, S>,
        has_stage_visitor: bool,
        mut on_stage: impl FnMut(&mut StagePoint<M, E>, &ArrayX<M, ArrayW<M, E>>, Place) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let Self { jacobians, panel } = self;
        for jacobian in &mut *jacobians {
            M::jacobian_constants::<UnitStride<E>>(jacobian);
        }
        begin::<M, E, _, _>(E::from_f64(1.0), &mut variation.dx, UnitDirections);
        // The `dξ_i` for `on_stage` are stored in `dk_i`.
        let Variation { dx, dk: seen, .. } = variation;
        for step in 0..grid.steps {
            let StepWorkspace { point, record, x, compensation: rest, .. } = &mut *workspace;
            let at = |stage| Place { step, stage, iteration: 0 };
            record.x = *x;
            for (stage, jacobian) in jacobians.iter_mut().enumerate() {
                point.move_to_stage(scheme, grid, record, at(stage))?;
                point.derivative_jacobian(scheme, &mut record.k[stage], jacobian, at(stage))?;
            }
            for first in (0..M::Shape::NW).step_by(PANEL_WIDTH) {
                let panel_columns = PanelColumns { first, columns: PANEL_WIDTH.min(M::Shape::NW - first) };
                take::<M, E>(dx, panel_columns, &mut panel.dx);
                for (stage, jacobian) in jacobians.iter().enumerate() {
                    panel.stage_state(scheme, &grid.h, stage, panel_columns);
                    if has_stage_visitor {
                        put::<M, E>(&panel.dxi, panel_columns, &mut seen[stage]);
                    }
                    panel.stage_derivative(scheme, jacobian, stage, panel_columns);
                }
                panel.advance(scheme, &grid.h, panel_columns);
                put::<M, E>(&panel.dx, panel_columns, dx);
            }
            for (stage, dxi) in seen.iter().enumerate().filter(|_| has_stage_visitor) {
                point.move_to_stage(scheme, grid, record, at(stage))?;
                on_stage(point, dxi, at(stage))?;
            }
            record.advance(scheme, grid, step, x, grid.compensated.then_some(rest), &mut point.non_finite)?;
            point.counts.steps += 1;
        }
        Ok(())
    }
}

kernels! { by run_plain;
    /// Copies the columns of a panel from the matrix.
    fn take [M: Ode, E: Lanes] [M, E] <A>(
        rows: &'k ArrayX<M, ArrayW<M, E>>,
        part: PanelColumns,
        panel: &'k mut ArrayX<M, [E; PANEL_WIDTH]>,
    ) {
        for (to, from) in panel.as_mut().iter_mut().zip(rows.as_ref()) {
            for (i, to) in to.iter_mut().enumerate().take(part.columns) {
                if let Some(from) = from.as_ref().get(part.first + i).in_bounds() {
                    *to = *from;
                }
            }
        }
    }

    /// Copies the columns of a panel back to the matrix.
    fn put [M: Ode, E: Lanes] [M, E] <A>(
        panel: &'k ArrayX<M, [E; PANEL_WIDTH]>,
        part: PanelColumns,
        rows: &'k mut ArrayX<M, ArrayW<M, E>>,
    ) {
        for (from, to) in panel.as_ref().iter().zip(rows.as_mut()) {
            for (i, from) in from.iter().enumerate().take(part.columns) {
                if let Some(to) = to.as_mut().get_mut(part.first + i).in_bounds() {
                    *to = *from;
                }
            }
        }
    }
}
