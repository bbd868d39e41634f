//! How derivatives go along with the steps.

use super::forward::{Unit, Variation};
use super::scheme::{Grid, Scheme};
use super::step::{Base, Point};
use crate::error::{Error, Place};
use crate::model::{ArrayW, ArrayX, Ode};
use crate::scalar::Lanes;

/// How derivatives in all directions go along with the steps.
pub(crate) trait Sweeps<M: Ode, E: Lanes, const S: usize> {
    /// All steps, from `x` to `x`, with the derivatives; `at_stage` sees each stage with its
    /// `dξ_i`, if it is to see any.
    fn run(
        &mut self,
        scheme: &Scheme<M, E, S>,
        grid: &Grid<E>,
        base: &mut Base<M, E, S>,
        variation: &mut Variation<M, E, ArrayW<M, E>, S>,
        is_seen: bool,
        at_stage: impl FnMut(&mut Point<M, E>, &ArrayX<M, ArrayW<M, E>>, Place) -> Result<(), Error>,
    ) -> Result<(), Error>;
}

/// All columns together.
pub(crate) struct Whole;

impl<M: Ode, E: Lanes, const S: usize> Sweeps<M, E, S> for Whole {
    fn run(
        &mut self,
        scheme: &Scheme<M, E, S>,
        grid: &Grid<E>,
        base: &mut Base<M, E, S>,
        variation: &mut Variation<M, E, ArrayW<M, E>, S>,
        _: bool,
        at_stage: impl FnMut(&mut Point<M, E>, &ArrayX<M, ArrayW<M, E>>, Place) -> Result<(), Error>,
    ) -> Result<(), Error> {
        variation.run(scheme, grid, base, Unit, at_stage)
    }
}
