//! The task of a batch call, and its chunks of consecutive intervals with their outputs.

use super::batch_output::BatchOutput;
use super::error::BatchError;
use super::intervals::BatchInputs;
use super::lanes::MAX_LANES;
use super::single::Single;
use crate::error::Error;
use crate::options::Options;
use crate::scalar::lanes::second_level_cache;
use crate::scalar::{Lanes, Real, Widest};
use alloc::vec::Vec;
use core::marker::PhantomData;

/// Maximal fraction of the second-level cache for the factors and right-hand sides of a group.
/// Larger groups are split, down to single intervals, since they would be loaded from main memory
/// repeatedly.
const MAX_CACHE_FRACTION: f64 = 5.0 / 8.0;

/// Returns the number of intervals per group: the lanes of the widest register whose group fits the
/// cache.
pub fn lanes_per_group<I: Single, R: BatchOutput<I::Model, I::Number>>(options: &Options) -> usize {
    let mut max_lanes = MAX_LANES;
    loop {
        match I::Number::run_in_widest_register(
            max_lanes,
            CacheFit::<I> { options, columns: R::COLUMNS, integrator: PhantomData },
        ) {
            Ok((lanes, true)) => return lanes,
            Ok((lanes, false)) => max_lanes = lanes.saturating_sub(1),
            Err(_) => return 1,
        }
    }
}

/// Returns the lanes of a register, and whether a group fits the cache.
struct CacheFit<'a, I> {
    options: &'a Options,
    /// Number of columns of derivatives.
    columns: usize,
    integrator: PhantomData<I>,
}

impl<I: Single> Widest<I::Number> for CacheFit<'_, I> {
    type Output = (usize, bool);
    fn call<E: Lanes<Cell: AsRef<[I::Number]> + AsMut<[I::Number]>>>(self) -> (usize, bool) {
        let bytes = I::working_set::<E>(self.options, self.columns) as f64;
        (E::LANES, I::SUPPORTS_GROUPS && bytes <= MAX_CACHE_FRACTION * second_level_cache() as f64)
    }
}

/// The task of a call.
pub struct BatchTask<'a, I: Single> {
    pub inputs: &'a BatchInputs<'a, I::Model, I::Number>,
    pub options: &'a Options,
    pub tableau: &'a I::Tableau,
    pub start_values: Option<[&'a [I::Number]; 2]>,
    /// Number of intervals that are computed together.
    pub lanes: usize,
    /// Number of intervals that are simulated together before each is differentiated alone.
    pub simulation_lanes: usize,
    /// Whether stored stages are solutions for these inputs.
    pub reuses_solutions: bool,
}

impl<I: Single> BatchTask<'_, I> {
    /// Returns the number of intervals of a group.
    pub fn group_size(&self) -> usize {
        self.lanes.max(self.simulation_lanes)
    }
}

/// Receives results in order, with the indices of their intervals.
pub type Sink<'a, R> = &'a mut dyn FnMut(usize, &R);

/// Consecutive intervals and their outputs.
pub struct IntervalChunk<'a, I: Single, R> {
    pub first_interval: usize,
    /// One result for each interval, or memory for those of one group or of one interval, which is
    /// reused.
    pub results: &'a mut [R],
    pub status: &'a mut [Result<(), Error>],
    /// The stages of all steps of every interval; empty without a warm start, as `has_stages`.
    pub stages: &'a mut [I::Stages],
    pub has_stages: &'a mut [bool],
}

impl<'a, I: Single, R> IntervalChunk<'a, I, R> {
    /// Splits off the first `count` intervals.
    pub fn split_off_front(&mut self, count: usize, steps: usize) -> IntervalChunk<'a, I, R> {
        let first = self.first_interval;
        let count = count.min(self.status.len());
        self.first_interval += count;
        IntervalChunk {
            first_interval: first,
            results: split_front(&mut self.results, count),
            status: split_front(&mut self.status, count),
            stages: split_front(&mut self.stages, count.saturating_mul(steps)),
            has_stages: split_front(&mut self.has_stages, count),
        }
    }

    /// Returns the index of the result of an interval; all intervals share the last element if
    /// there are fewer.
    pub fn result_index(&self, index: usize) -> usize {
        index.min(self.results.len().saturating_sub(1))
    }
}

/// Resizes a vector.
pub fn try_resize<V: Clone>(vector: &mut Vec<V>, length: usize, value: V) -> Result<(), BatchError> {
    let bytes = length.saturating_mul(size_of::<V>());
    vector.try_reserve(length.saturating_sub(vector.len())).map_err(|_| BatchError::OutOfMemory { bytes })?;
    vector.resize(length, value);
    Ok(())
}

/// Splits off the first elements.
fn split_front<'a, V>(slice: &mut &'a mut [V], count: usize) -> &'a mut [V] {
    let count = count.min(slice.len());
    let (first, rest) = core::mem::take(slice).split_at_mut(count);
    *slice = rest;
    first
}
