//! What is remembered about steps, and the memory that all calls work in.

use super::stage_array::StageArray;
use crate::linalg::{Factors, SharedFactors};
use crate::memory::{Fallback, fallback::Pivoting};
use crate::model::{ArrayK, ArrayV, ArrayX, Dae, VectorP, VectorU};
use crate::result::{Dense, Nominal};
use crate::scalar::{Lanes, Strided};
use crate::shape::{Aligned, Plain, copy, copy_into};
use bytemuck::Zeroable;

/// One step: all that is needed to find out anything else about it.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct Step<M: Dae, T: Plain, const S: usize> {
    /// The state at its start.
    pub(crate) x: ArrayX<M, T>,
    /// The unknowns `(k, z)` at its stages.
    pub(crate) y: Aligned<ArrayK<M, [T; S]>>,
}

/// What a call was given, besides the state at its start.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(crate) struct Inputs<M: Dae, T: Plain> {
    pub u: VectorU<M, T>,
    pub p: VectorP<M, T>,
    pub time: IntervalTimes<T>,
}

/// Where an interval is.
#[derive(Clone, Copy, Zeroable)]
pub(crate) struct IntervalTimes<T> {
    /// Its start.
    pub start: T,
    /// Its length.
    pub interval: T,
    /// The length of one of its steps.
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

/// The memory that every call works in.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct StageWorkspace<M: Dae, T: Lanes, const S: usize, F: Fallback = Pivoting> {
    /// The solution of the last call.
    pub(crate) result: Nominal<M, T>,
    /// The solution at the last time that was asked for.
    pub(crate) dense_output: Dense<M, T>,
    /// What the last call was given.
    pub(crate) inputs: Inputs<M, T>,
    /// What the last successful call was given.
    pub(crate) last_inputs: Inputs<M, T>,
    /// Parameters as they were set.
    pub(crate) parameters: VectorP<M, T>,
    /// Start values as they were given.
    pub(crate) start_values: ArrayK<M, T>,
    /// The state at the start of the step, then at its end.
    pub(crate) x: ArrayX<M, T>,
    /// What was rounded off from it, if sums are compensated.
    pub(crate) compensation: ArrayX<M, T>,
    /// Variables of the model, each at all stages.
    pub(crate) points: Aligned<StageArray<ArrayV<M, [T; S]>, T, S>>,
    /// The residual at all stages.
    pub(crate) f: Aligned<StageArray<ArrayK<M, [T; S]>, T, S>>,
    /// The residual in the slots of the equations, then the increment.
    pub(crate) increment: Aligned<ArrayK<M, [[T; 1]; S]>>,
    /// Reciprocals of the sizes of the unknowns, which increments are measured by.
    pub(crate) weights: ArrayK<M, T>,
    /// The sizes of the last increments.
    pub(crate) increment_sizes: ArrayK<M, T>,
    pub(crate) linearization: Linearization<M, T, S, F>,
    /// Factors of the shared Jacobian of the stages, which iterations take where that is cheaper.
    pub(crate) shared: F::Place<SharedFactors<M, T, S>>,
    /// Where derivatives are tried on their equations: sums, and the sizes of their terms. While
    /// stages are solved with compensated sums, what they are beyond their digits.
    pub(crate) variable_scratch: [Aligned<ArrayV<M, [T; S]>>; 2],
    pub(crate) equation_magnitudes: Aligned<ArrayK<M, [T; S]>>,
    /// What the factors that are there are good for.
    pub(crate) validity: FactorValidity,
    /// Whether the constant entries of the Jacobian are there.
    pub(crate) constants_written: bool,
    /// Whether start values are solutions but for their last digits.
    pub(crate) start_near_solution: bool,
    /// Whether the model has the same values at all stages when it is evaluated next.
    pub(crate) identical_stages: bool,
    /// Whether its Jacobian, the same at all stages, is there for the first one only.
    pub(crate) first_stage_only: bool,
}

/// What factors that are there are good for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Zeroable)]
pub(crate) struct FactorValidity {
    /// They belong to this call, and to its size of steps.
    pub factors: bool,
    /// Those of the shared Jacobian do.
    pub shared: bool,
    /// How fast Newton's method converged with them, `θ`; zero if it is not known.
    pub rate: f64,
}

copy!([M: Dae, T: Plain] Inputs<M, T>);

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> Linearization<M, E, S, F> {
    /// Copies what holds.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        copy_into(&mut self.jacobian, &other.jacobian);
        self.factors.copy_from(&other.factors);
    }
}

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> StageWorkspace<M, E, S, F> {
    /// The linearisation of a step that was remembered, or else the one that is here.
    pub(crate) fn linearization<'a>(
        &'a self,
        stored_linearization: Option<&'a Linearization<M, E, S, F>>,
    ) -> &'a Linearization<M, E, S, F> {
        stored_linearization.unwrap_or(&self.linearization)
    }

    /// To be called before anything else.
    pub(crate) fn write_constants(&mut self) {
        if !self.constants_written {
            for stage in 0..S {
                M::jacobian_constants::<Strided<E, S>>(self.linearization.jacobian.stage_view_mut(stage));
            }
            self.constants_written = true;
        }
    }
}
