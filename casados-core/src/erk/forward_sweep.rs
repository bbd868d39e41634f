//! How derivatives go along with the steps.

use super::forward::{UnitDirections, Variation};
use super::scheme::{Grid, Scheme};
use super::step::{StagePoint, StepWorkspace};
use crate::error::{Error, Place};
use crate::model::{ArrayW, ArrayX, Ode};
use crate::scalar::Lanes;

/// How derivatives in all directions go along with the steps.
pub(crate) trait ForwardSweep<M: Ode, E: Lanes, const S: usize> {
    /// All steps, from `x` to `x`, with the derivatives; `evaluate_stage` sees each stage with its
    /// `dξ_i`, if it is to see any.
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

/// All columns together.
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
