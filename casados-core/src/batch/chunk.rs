//! What a call of a batch is to do, and its parts: consecutive intervals, with what is found out
//! about them.

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

/// Groups whose factors and right-hand sides need more of the second-level cache are smaller, or
/// computed one interval after the other: what does not lie in it is fetched from afar again and
/// again.
const MAX_CACHE_FRACTION: f64 = 5.0 / 8.0;

/// How many intervals are computed together: as many as the widest register has whose group fits
/// into the cache.
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

/// The lanes of a register, and whether they are to be used.
struct CacheFit<'a, I> {
    options: &'a Options,
    /// How many columns of derivatives are computed.
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

/// What is to be done.
pub struct BatchTask<'a, I: Single> {
    pub inputs: &'a BatchInputs<'a, I::Model, I::Number>,
    pub options: &'a Options,
    pub tableau: &'a I::Tableau,
    pub start_values: Option<[&'a [I::Number]; 2]>,
    /// How many intervals are computed together.
    pub lanes: usize,
    /// How many are simulated together before each is differentiated alone.
    pub simulation_lanes: usize,
    /// Whether stages that are remembered are solutions at these inputs.
    pub reuses_solutions: bool,
}

impl<I: Single> BatchTask<'_, I> {
    /// How many intervals a group has.
    pub fn group_size(&self) -> usize {
        self.lanes.max(self.simulation_lanes)
    }
}

/// Takes results one after the other, with the numbers of their intervals.
pub type Sink<'a, R> = &'a mut dyn FnMut(usize, &R);

/// Consecutive intervals, and where what is found out about them belongs.
pub struct IntervalChunk<'a, I: Single, R> {
    pub first_interval: usize,
    /// As many as there are intervals, or memory for those of a group, or for one: then the result
    /// of an interval is gone when the next one is computed.
    pub results: &'a mut [R],
    pub status: &'a mut [Result<(), Error>],
    /// The stages of all steps of every interval; empty without a warm start, as `warm`.
    pub stages: &'a mut [I::Stages],
    pub has_stages: &'a mut [bool],
}

impl<'a, I: Single, R> IntervalChunk<'a, I, R> {
    /// The next intervals, which are taken away.
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

    /// Where the result of an interval is: all have one place if there is no more.
    pub fn result_index(&self, index: usize) -> usize {
        index.min(self.results.len().saturating_sub(1))
    }
}

/// Makes a vector as long as that.
pub fn try_resize<V: Clone>(vector: &mut Vec<V>, length: usize, value: V) -> Result<(), BatchError> {
    let bytes = length.saturating_mul(size_of::<V>());
    vector.try_reserve(length.saturating_sub(vector.len())).map_err(|_| BatchError::OutOfMemory { bytes })?;
    vector.resize(length, value);
    Ok(())
}

/// The first elements, which are taken away.
fn split_front<'a, V>(slice: &mut &'a mut [V], count: usize) -> &'a mut [V] {
    let count = count.min(slice.len());
    let (first, rest) = core::mem::take(slice).split_at_mut(count);
    *slice = rest;
    first
}
