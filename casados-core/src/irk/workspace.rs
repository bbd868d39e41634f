//! The data of steps, and the workspace of all calls.

use super::stage_array::StageArray;
use crate::linalg::{Factors, SharedFactors};
use crate::memory::{Fallback, fallback::Pivoting};
use crate::model::{ArrayK, ArrayV, ArrayX, Dae, VectorP, VectorU};
use crate::result::{Dense, Nominal};
use crate::scalar::{Lanes, Strided};
use crate::shape::{Aligned, Plain, copy, copy_into};
use bytemuck::Zeroable;

/// One step: its start and its stages determine everything else.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct Step<M: Dae, T: Plain, const S: usize> {
    /// State at the start of the step.
    pub(crate) x: ArrayX<M, T>,
    /// The unknowns `(k, z)` at the stages.
    pub(crate) y: Aligned<ArrayK<M, [T; S]>>,
}

/// The inputs of a call besides the initial state.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(crate) struct Inputs<M: Dae, T: Plain> {
    pub u: VectorU<M, T>,
    pub p: VectorP<M, T>,
    pub time: IntervalTimes<T>,
}

/// The times of an interval.
#[derive(Clone, Copy, Zeroable)]
pub(crate) struct IntervalTimes<T> {
    /// Start of the interval.
    pub start: T,
    /// Length of the interval.
    pub interval: T,
    /// Length of a step.
    pub step: T,
}

/// The linearisation of the stages of a step.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(crate) struct Linearization<M: Dae, T: Plain, const S: usize, F: Fallback = Pivoting> {
    /// Entries of the Jacobian of the model, each at all stages.
    pub jacobian: Aligned<StageArray<M::Jacobian<[T; S]>, T, S>>,
    /// Factors of the Newton matrix.
    pub factors: Factors<M, T, S, F>,
}

/// The workspace of all calls.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct StageWorkspace<M: Dae, T: Lanes, const S: usize, F: Fallback = Pivoting> {
    /// Solution of the last call.
    pub(crate) result: Nominal<M, T>,
    /// Result of the last dense output.
    pub(crate) dense_output: Dense<M, T>,
    /// Inputs of the last call.
    pub(crate) inputs: Inputs<M, T>,
    /// Inputs of the last successful call.
    pub(crate) last_inputs: Inputs<M, T>,
    /// Parameters set by the user.
    pub(crate) parameters: VectorP<M, T>,
    /// Start values set by the user.
    pub(crate) start_values: ArrayK<M, T>,
    /// State at the start of the step, then at its end.
    pub(crate) x: ArrayX<M, T>,
    /// Compensation of `x`, if sums are compensated.
    pub(crate) compensation: ArrayX<M, T>,
    /// Variables of the model at all stages.
    pub(crate) points: Aligned<StageArray<ArrayV<M, [T; S]>, T, S>>,
    /// The residual at all stages.
    pub(crate) f: Aligned<StageArray<ArrayK<M, [T; S]>, T, S>>,
    /// The residual in the slots of the equations, then the increment.
    pub(crate) increment: Aligned<ArrayK<M, [[T; 1]; S]>>,
    /// Reciprocal sizes of the unknowns, the weights of increments.
    pub(crate) weights: ArrayK<M, T>,
    /// Sizes of the last increments.
    pub(crate) increment_sizes: ArrayK<M, T>,
    pub(crate) linearization: Linearization<M, T, S, F>,
    /// Factors of the shared Jacobian.
    pub(crate) shared: F::Place<SharedFactors<M, T, S>>,
    /// Scratch memory: sums and magnitudes of backward errors; compensation of the stages while
    /// they are solved with compensated sums.
    pub(crate) variable_scratch: [Aligned<ArrayV<M, [T; S]>>; 2],
    pub(crate) equation_magnitudes: Aligned<ArrayK<M, [T; S]>>,
    /// Validity of the available factors.
    pub(crate) validity: FactorValidity,
    /// Whether the constant entries of the Jacobian are written.
    pub(crate) constants_written: bool,
    /// Whether start values are solutions up to rounding.
    pub(crate) start_near_solution: bool,
    /// Whether the next evaluation of the model is at identical stages.
    pub(crate) identical_stages: bool,
    /// Whether the Jacobian, equal at all stages, is written for the first stage only.
    pub(crate) first_stage_only: bool,
}

/// Validity of factors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Zeroable)]
pub(crate) struct FactorValidity {
    /// Whether the factors belong to this call and its step size.
    pub factors: bool,
    /// Whether the factors of the shared Jacobian do.
    pub shared: bool,
    /// Contraction rate `θ` of Newton's method with them; zero if unknown.
    pub rate: f64,
}

copy!([M: Dae, T: Plain] Inputs<M, T>);

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> Linearization<M, E, S, F> {
    /// Copies the Jacobian and the factors.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        copy_into(&mut self.jacobian, &other.jacobian);
        self.factors.copy_from(&other.factors);
    }
}

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> StageWorkspace<M, E, S, F> {
    /// Returns the stored linearisation, or else that of the workspace.
    pub(crate) fn linearization<'a>(
        &'a self,
        stored_linearization: Option<&'a Linearization<M, E, S, F>>,
    ) -> &'a Linearization<M, E, S, F> {
        stored_linearization.unwrap_or(&self.linearization)
    }

    /// Writes the constant entries of the Jacobian; must be called first.
    pub(crate) fn write_constants(&mut self) {
        if !self.constants_written {
            for stage in 0..S {
                M::jacobian_constants::<Strided<E, S>>(self.linearization.jacobian.stage_view_mut(stage));
            }
            self.constants_written = true;
        }
    }
}
