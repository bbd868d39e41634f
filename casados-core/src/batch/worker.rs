//! Distribution of the work: intervals in groups, groups on threads, and intervals alone if their
//! group has no result for them.

use super::batch_output::BatchOutput;
use super::chunk::{BatchTask, IntervalChunk, Sink, try_resize};
#[cfg(feature = "parallel")]
use super::error::BatchError;
use super::group_call::{GroupCache, GroupCall, LaneIntervals};
use super::intervals::{Interval, vector};
use super::lanes::MAX_LANES;
use super::single::Single;
use super::statistics::BatchStatistics;
use crate::error::Error;
use crate::model::Dae;
use crate::options::Options;
use crate::result::Nominal;
use crate::scalar::Real;
use crate::shape::{Shape, copy_into};
use alloc::vec::Vec;
use bytemuck::Zeroable;

/// The default number of threads.
pub fn default_threads() -> usize {
    #[cfg(feature = "parallel")]
    return rayon::current_num_threads();
    #[cfg(not(feature = "parallel"))]
    1
}

/// Distributes groups evenly over the threads.
#[cfg(feature = "parallel")]
pub fn run_parallel<I: Single, R: BatchOutput<I::Model, I::Number>>(
    task: &BatchTask<'_, I>,
    workers: &mut Vec<Worker<I>>,
    threads: usize,
    mut chunk: IntervalChunk<'_, I, R>,
) -> Result<(), BatchError> {
    let groups = chunk.status.len().div_ceil(task.group_size());
    let threads = threads.min(groups).max(1);
    while workers.len() < threads {
        let worker = Worker::new(task.options, task.tableau);
        let bytes = threads.saturating_mul(size_of::<Worker<I>>());
        let (Ok(worker), Ok(())) = (worker, workers.try_reserve(1)) else {
            return Err(BatchError::OutOfMemory { bytes });
        };
        workers.push(worker);
    }
    if let (1, Some(worker)) = (threads, workers.first_mut()) {
        worker.run(task, chunk);
        return Ok(());
    }
    let intervals_per_thread = groups.div_ceil(threads).saturating_mul(task.group_size());
    rayon::scope(|scope| {
        for worker in workers.iter_mut().take(threads) {
            let share = chunk.split_off_front(intervals_per_thread, task.options.steps);
            scope.spawn(move |_| worker.run(task, share));
        }
    });
    Ok(())
}

/// Lanes of a register of 32 bytes: for no more intervals it is faster than wider registers.
const fn avx2_lanes<T>() -> usize {
    32 / size_of::<T>()
}

/// A worker of one thread, with its own memory.
pub struct Worker<I: Single> {
    single: I,
    /// A [`Group`](super::single::Group) for each register type: modes may need different ones.
    groups: GroupCache,
    /// Stages of intervals that are simulated together, and their final states.
    stages: Vec<I::Stages>,
    end_states: Vec<Nominal<I::Model, I::Number>>,
    pub statistics: BatchStatistics,
}

impl<I: Single> Worker<I> {
    pub fn new(options: &Options, tableau: &I::Tableau) -> Result<Self, Error> {
        Ok(Self::from_single(I::of(options, tableau)?))
    }

    /// Returns a worker with the same settings and its own memory.
    pub fn clone_settings(&self) -> Self {
        Self::from_single(self.single.clone())
    }

    fn from_single(single: I) -> Self {
        let (stages, ends) = (Vec::new(), Vec::new());
        Self {
            single,
            groups: [None, None],
            stages,
            end_states: ends,
            statistics: BatchStatistics::default(),
        }
    }

    pub fn run<R: BatchOutput<I::Model, I::Number>>(
        &mut self,
        task: &BatchTask<'_, I>,
        mut chunk: IntervalChunk<'_, I, R>,
    ) {
        while !chunk.status.is_empty() {
            let group = chunk.split_off_front(task.group_size(), task.options.steps);
            self.compute_group(task, group, &mut |_, _| {});
        }
    }

    /// Passes results to `sink`, up to the first failed interval. `chunk.results` holds one group,
    /// or one interval if no group is differentiated.
    pub fn for_each_result<R: BatchOutput<I::Model, I::Number>>(
        &mut self,
        task: &BatchTask<'_, I>,
        mut chunk: IntervalChunk<'_, I, R>,
        sink: Sink<'_, R>,
    ) {
        let results = core::mem::take(&mut chunk.results);
        let mut next = chunk.first_interval;
        while !chunk.status.is_empty() {
            let group = chunk.split_off_front(task.group_size(), task.options.steps);
            let group = IntervalChunk { results: &mut *results, ..group };
            self.compute_group(task, group, &mut |interval, result| {
                if interval == next {
                    next += 1;
                    sink(interval, result);
                }
            });
        }
    }

    /// Computes the intervals of one group; passes those with a result to `sink`.
    #[inline(never)]
    fn compute_group<R: BatchOutput<I::Model, I::Number>>(
        &mut self,
        task: &BatchTask<'_, I>,
        mut chunk: IntervalChunk<'_, I, R>,
        sink: Sink<'_, R>,
    ) {
        let mut intervals = [None; MAX_LANES];
        for (i, (interval, status)) in intervals.iter_mut().zip(chunk.status.iter_mut()).enumerate() {
            match task.inputs.interval(chunk.first_interval + i) {
                Ok(good) => *interval = Some(good),
                Err(error) => *status = Err(error),
            }
        }
        let count = intervals.iter().flatten().count();
        let has_several = count > 1;
        let (mut done, mut solved) = ([false; MAX_LANES], [false; MAX_LANES]);
        if has_several && task.lanes > 1 {
            let (groups, statistics, share) = (&mut self.groups, &mut self.statistics, &mut chunk);
            let group_call = GroupCall { task, groups, statistics, intervals: &intervals, chunk: share };
            // If the group cannot be allocated, intervals are computed alone.
            let lanes =
                if count > avx2_lanes::<I::Number>() { task.lanes } else { avx2_lanes::<I::Number>() };
            let lanes = lanes.min(task.lanes);
            done = I::Number::run_in_widest_register(lanes, group_call)
                .ok()
                .and_then(Result::ok)
                .unwrap_or_default();
        } else if has_several && task.simulation_lanes > 1 && !task.reuses_solutions {
            solved = self.simulate(task, &intervals, &chunk).unwrap_or_default();
        }
        for (i, interval) in intervals.iter().enumerate() {
            let Some(interval) = interval else { continue };
            if !done[i] {
                let is_redone = has_several && !solved[i] && !task.reuses_solutions;
                *(if is_redone { &mut self.statistics.redone } else { &mut self.statistics.alone }) += 1;
                let mut outcome = self.compute_single(task, interval, i, solved[i], &mut chunk);
                self.statistics.work.add(&self.single.statistics());
                if solved[i] && outcome.is_err() {
                    outcome = self.compute_single(task, interval, i, false, &mut chunk);
                    self.statistics.work.add(&self.single.statistics());
                }
                if let Some(status) = chunk.status.get_mut(i) {
                    *status = outcome;
                }
            }
            let result_index = chunk.result_index(i);
            if let (Some(Ok(())), Some(result)) = (chunk.status.get(i), chunk.results.get(result_index)) {
                sink(chunk.first_interval + i, result);
            }
        }
    }

    /// Simulates a group; returns the intervals whose stages were found.
    fn simulate<R>(
        &mut self,
        task: &BatchTask<'_, I>,
        intervals: &LaneIntervals<'_, I>,
        chunk: &IntervalChunk<'_, I, R>,
    ) -> Option<[bool; MAX_LANES]> {
        let Self { groups, stages, end_states: ends, statistics, .. } = self;
        let (count, steps) = (chunk.status.len(), task.options.steps);
        try_resize(stages, MAX_LANES.saturating_mul(steps), Zeroable::zeroed()).ok()?;
        try_resize(ends, MAX_LANES, Zeroable::zeroed()).ok()?;
        let mut has_stages = [false; MAX_LANES];
        for (to, from) in stages.iter_mut().zip(chunk.stages.iter()) {
            copy_into(to, from);
        }
        for (to, from) in has_stages.iter_mut().zip(chunk.has_stages.iter()) {
            *to = *from;
        }
        let mut share = IntervalChunk {
            first_interval: chunk.first_interval,
            results: ends.get_mut(..count)?,
            status: &mut [],
            stages,
            has_stages: &mut has_stages,
        };
        let group_call = GroupCall { task, groups, statistics, intervals, chunk: &mut share };
        I::Number::run_in_widest_register(task.simulation_lanes, group_call).ok().and_then(Result::ok)
    }

    /// Computes one interval; `is_solved` is whether its stages are known.
    fn compute_single<R: BatchOutput<I::Model, I::Number>>(
        &mut self,
        task: &BatchTask<'_, I>,
        interval: &Interval<'_, I::Model, I::Number>,
        index: usize,
        is_solved: bool,
        chunk: &mut IntervalChunk<'_, I, R>,
    ) -> Result<(), Error> {
        let single = &mut self.single;
        if <I::Model as Dae>::Shape::NP > 0 {
            single.set_parameters(&vector(interval.p))?;
        }
        single.set_time(interval.t0)?;
        if let Some(given) = task.start_values {
            single.give(given)?;
        }
        let steps = task.options.steps;
        let result_index = chunk.result_index(index);
        let stages = chunk.stages.chunks_exact_mut(steps).nth(index);
        let has_stages = chunk.has_stages.get_mut(index);
        match (&stages, &has_stages, self.stages.chunks_exact(steps).nth(index)) {
            (_, _, Some(stages)) if is_solved => single.start(Some(stages), true)?,
            (Some(stages), Some(true), _) => single.start(Some(stages), task.reuses_solutions)?,
            _ => single.start(None, false)?,
        }
        if let Some(result) = chunk.results.get_mut(result_index) {
            result.compute_single(single, interval)?;
        }
        if let (Some(stages), Some(has_stages)) = (stages, has_stages) {
            single.stages(stages)?;
            *has_stages = true;
        }
        Ok(())
    }
}
