//! Who computes what: intervals in groups, groups on threads, and those alone that no group gives a
//! result for.

use super::answer::Answer;
#[cfg(feature = "parallel")]
use super::error::BatchError;
use super::intervals::{Interval, vector};
use super::lanes::MOST_LANES;
use super::share::{Share, Sink, Work, fill};
use super::single::Single;
use super::statistics::BatchStatistics;
use super::together::{Groups, Lined, Together};
use crate::error::Error;
use crate::model::Dae;
use crate::options::Options;
use crate::result::Nominal;
use crate::scalar::Real;
use crate::shape::{Shape, copy_into};
use alloc::vec::Vec;
use bytemuck::Zeroable;

/// How many threads share the intervals, unless somebody says so.
pub fn threads() -> usize {
    #[cfg(feature = "parallel")]
    return rayon::current_num_threads();
    #[cfg(not(feature = "parallel"))]
    1
}

/// Gives every thread as many groups as every other.
#[cfg(feature = "parallel")]
pub fn parallel<I: Single, R: Answer<I::Model, I::Number>>(
    work: &Work<'_, I>,
    workers: &mut Vec<Worker<I>>,
    threads: usize,
    mut share: Share<'_, I, R>,
) -> Result<(), BatchError> {
    let groups = share.status.len().div_ceil(work.size());
    let threads = threads.min(groups).max(1);
    while workers.len() < threads {
        let worker = Worker::new(work.options, work.tableau);
        let bytes = threads.saturating_mul(size_of::<Worker<I>>());
        let (Ok(worker), Ok(())) = (worker, workers.try_reserve(1)) else {
            return Err(BatchError::OutOfMemory { bytes });
        };
        workers.push(worker);
    }
    if let (1, Some(worker)) = (threads, workers.first_mut()) {
        worker.run(work, share);
        return Ok(());
    }
    let most = groups.div_ceil(threads).saturating_mul(work.size());
    rayon::scope(|scope| {
        for worker in workers.iter_mut().take(threads) {
            let share = share.take(most, work.options.steps);
            scope.spawn(move |_| worker.run(work, share));
        }
    });
    Ok(())
}

/// How many numbers fill registers of 32 bytes: so few intervals take less time there than in wider
/// ones.
const fn narrow<T>() -> usize {
    32 / size_of::<T>()
}

/// What computes, with memory of its own.
pub struct Worker<I: Single> {
    single: I,
    /// A [`Group`] for each kind of register: results of several kinds may need different ones.
    groups: Groups,
    /// Stages of the steps of intervals that are simulated together, and where they lead.
    stages: Vec<I::Stages>,
    ends: Vec<Nominal<I::Model, I::Number>>,
    pub statistics: BatchStatistics,
}

impl<I: Single> Worker<I> {
    pub fn new(options: &Options, tableau: &I::Tableau) -> Result<Self, Error> {
        Ok(Self::with(I::of(options, tableau)?))
    }

    /// The same with memory of its own.
    pub fn fresh(&self) -> Self {
        Self::with(self.single.clone())
    }

    fn with(single: I) -> Self {
        let (stages, ends) = (Vec::new(), Vec::new());
        Self { single, groups: [None, None], stages, ends, statistics: BatchStatistics::default() }
    }

    pub fn run<R: Answer<I::Model, I::Number>>(&mut self, work: &Work<'_, I>, mut share: Share<'_, I, R>) {
        while !share.status.is_empty() {
            let group = share.take(work.size(), work.options.steps);
            self.group(work, group, &mut |_, _| {});
        }
    }

    /// Shows results to `sink`, up to the first interval that fails. There is memory for those of
    /// one group, or of one interval where no group is differentiated.
    pub fn each<R: Answer<I::Model, I::Number>>(
        &mut self,
        work: &Work<'_, I>,
        mut share: Share<'_, I, R>,
        sink: Sink<'_, R>,
    ) {
        let results = core::mem::take(&mut share.results);
        let mut next = share.first;
        while !share.status.is_empty() {
            let group = share.take(work.size(), work.options.steps);
            let group = Share { results: &mut *results, ..group };
            self.group(work, group, &mut |interval, result| {
                if interval == next {
                    next += 1;
                    sink(interval, result);
                }
            });
        }
    }

    /// The intervals of one group; those with a result are shown to `sink`.
    #[inline(never)]
    fn group<R: Answer<I::Model, I::Number>>(
        &mut self,
        work: &Work<'_, I>,
        mut share: Share<'_, I, R>,
        sink: Sink<'_, R>,
    ) {
        let mut intervals = [None; MOST_LANES];
        for (i, (interval, status)) in intervals.iter_mut().zip(share.status.iter_mut()).enumerate() {
            match work.inputs.interval(share.first + i) {
                Ok(good) => *interval = Some(good),
                Err(error) => *status = Err(error),
            }
        }
        let count = intervals.iter().flatten().count();
        let several = count > 1;
        let (mut done, mut solved) = ([false; MOST_LANES], [false; MOST_LANES]);
        if several && work.lanes > 1 {
            let (groups, statistics, share) = (&mut self.groups, &mut self.statistics, &mut share);
            let together = Together { work, groups, statistics, intervals: &intervals, share };
            // What did not get memory side by side may get it alone.
            let lanes = if count > narrow::<I::Number>() { work.lanes } else { narrow::<I::Number>() };
            let lanes = lanes.min(work.lanes);
            done = I::Number::widest(lanes, together).ok().and_then(Result::ok).unwrap_or_default();
        } else if several && work.simulated > 1 && !work.solved {
            solved = self.simulate(work, &intervals, &share).unwrap_or_default();
        }
        for (i, interval) in intervals.iter().enumerate() {
            let Some(interval) = interval else { continue };
            if !done[i] {
                let again = several && !solved[i] && !work.solved;
                *(if again { &mut self.statistics.redone } else { &mut self.statistics.alone }) += 1;
                let mut outcome = self.alone(work, interval, i, solved[i], &mut share);
                self.statistics.work.add(&self.single.statistics());
                if solved[i] && outcome.is_err() {
                    outcome = self.alone(work, interval, i, false, &mut share);
                    self.statistics.work.add(&self.single.statistics());
                }
                if let Some(status) = share.status.get_mut(i) {
                    *status = outcome;
                }
            }
            let place = share.place(i);
            if let (Some(Ok(())), Some(result)) = (share.status.get(i), share.results.get(place)) {
                sink(share.first + i, result);
            }
        }
    }

    /// The stages of all intervals of a group, for those that arrive.
    fn simulate<R>(
        &mut self,
        work: &Work<'_, I>,
        intervals: &Lined<'_, I>,
        share: &Share<'_, I, R>,
    ) -> Option<[bool; MOST_LANES]> {
        let Self { groups, stages, ends, statistics, .. } = self;
        let (count, steps) = (share.status.len(), work.options.steps);
        fill(stages, MOST_LANES.saturating_mul(steps), Zeroable::zeroed()).ok()?;
        fill(ends, MOST_LANES, Zeroable::zeroed()).ok()?;
        let mut warm = [false; MOST_LANES];
        for (to, from) in stages.iter_mut().zip(share.stages.iter()) {
            copy_into(to, from);
        }
        for (to, from) in warm.iter_mut().zip(share.warm.iter()) {
            *to = *from;
        }
        let mut share = Share {
            first: share.first,
            results: ends.get_mut(..count)?,
            status: &mut [],
            stages,
            warm: &mut warm,
        };
        let together = Together { work, groups, statistics, intervals, share: &mut share };
        I::Number::widest(work.simulated, together).ok().and_then(Result::ok)
    }

    /// One interval; its stages may be known.
    fn alone<R: Answer<I::Model, I::Number>>(
        &mut self,
        work: &Work<'_, I>,
        interval: &Interval<'_, I::Model, I::Number>,
        index: usize,
        solved: bool,
        share: &mut Share<'_, I, R>,
    ) -> Result<(), Error> {
        let single = &mut self.single;
        if <I::Model as Dae>::Shape::NP > 0 {
            single.set_parameters(&vector(interval.p))?;
        }
        single.set_time(interval.t0)?;
        if let Some(given) = work.given {
            single.give(given)?;
        }
        let steps = work.options.steps;
        let place = share.place(index);
        let stages = share.stages.chunks_exact_mut(steps).nth(index);
        let warm = share.warm.get_mut(index);
        match (&stages, &warm, self.stages.chunks_exact(steps).nth(index)) {
            (_, _, Some(stages)) if solved => single.start(Some(stages), true)?,
            (Some(stages), Some(true), _) => single.start(Some(stages), work.solved)?,
            _ => single.start(None, false)?,
        }
        if let Some(result) = share.results.get_mut(place) {
            result.alone(single, interval)?;
        }
        if let (Some(stages), Some(warm)) = (stages, warm) {
            single.stages(stages)?;
            *warm = true;
        }
        Ok(())
    }
}
