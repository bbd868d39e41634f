//! Strategies of the forward sweep: all columns together, or in panels.

use super::forward::{UnitDirections, Variation};
use super::scheme::{Grid, Scheme};
use super::step::{StagePoint, StepWorkspace};
use crate::error::{Error, Place};
use crate::model::{ArrayW, ArrayX, Ode};
use crate::scalar::Lanes;

/// A forward sweep of the derivatives in all directions.
pub(crate) trait ForwardSweep<M: Ode, E: Lanes, const S: usize> {
    /// Integrates over all steps with the derivatives; updates the state of the workspace. With
    /// `has_stage_visitor` calls `on_stage` at each stage with its `dξ_i`.
    fn integrate(
        &mut self,
        scheme: &Scheme<M, E, S>,
        grid: &Grid<E>,
        workspace: &mut StepWorkspace<M, E, S>,
        variation: &mut Variation<M, E, ArrayW<M, E>, S>,
        has_stage_visitor: bool,
        on_stage: impl FnMut(&mut StagePoint<M, E>, &ArrayX<M, ArrayW<M, E>>, Place) -> Result<(), Error>,
    ) -> Result<(), Error>;
}

/// A sweep with all columns together.
pub(crate) struct AllColumns;

impl<M: Ode, E: Lanes, const S: usize> ForwardSweep<M, E, S> for AllColumns {
    fn integrate(
        &mut self,
        scheme: &Scheme<M, E, S>,
        grid: &Grid<E>,
        workspace: &mut StepWorkspace<M, E, S>,
        variation: &mut Variation<M, E, ArrayW<M, E>, S>,
        _: bool,
        on_stage: impl FnMut(&mut StagePoint<M, E>, &ArrayX<M, ArrayW<M, E>>, Place) -> Result<(), Error>,
    ) -> Result<(), Error> {
        variation.integrate(scheme, grid, workspace, UnitDirections, on_stage)
    }
}
