//! Who computes what: intervals in groups, groups on threads, and those alone that no group gives a
//! result for.

use super::answer::{Answer, Wide};
use super::error::BatchError;
use super::intervals::{Inputs, Interval, vector};
use super::lanes::MOST_LANES;
use super::single::{Group, Single};
use super::statistics::BatchStatistics;
use crate::error::Error;
use crate::integrator::Integrator;
use crate::linalg::{Arithmetic, Kernel, dispatch};
use crate::model::Dae;
use crate::options::{Options, Start};
use crate::result::Nominal;
use crate::scalar::lanes::second_level_cache;
use crate::scalar::{Lanes, Real, Widest};
use crate::shape::{Shape, assign};
use alloc::boxed::Box;
use alloc::vec::Vec;
use bytemuck::Zeroable;
use core::any::Any;
use core::marker::PhantomData;

/// Groups whose factors and right-hand sides need more of the second-level cache are smaller, or
/// computed one interval after the other: what does not lie in it is fetched from afar again and
/// again.
const WORKING_SET: f64 = 7.0 / 8.0;

/// How many intervals are computed together: as many as the widest register has whose group fits
/// into the cache.
pub fn width<I: Single, R: Answer<I::Model, I::Number>>(options: &Options) -> usize {
    let mut most = MOST_LANES;
    loop {
        match I::Number::widest(most, Fits::<I> { options, columns: R::COLUMNS, of: PhantomData }) {
            Ok((lanes, true)) => return lanes,
            Ok((lanes, false)) => most = lanes.saturating_sub(1),
            Err(_) => return 1,
        }
    }
}

/// The lanes of a register, and whether they are to be used.
struct Fits<'a, I> {
    options: &'a Options,
    /// How many columns of derivatives are computed.
    columns: usize,
    of: PhantomData<I>,
}

impl<I: Single> Widest<I::Number> for Fits<'_, I> {
    type Output = (usize, bool);
    fn call<E: Lanes<Cell: AsRef<[I::Number]> + AsMut<[I::Number]>>>(self) -> (usize, bool) {
        let bytes = I::working_set::<E>(self.options, self.columns) as f64;
        (E::LANES, I::TOGETHER && bytes <= WORKING_SET * second_level_cache() as f64)
    }
}

/// What is to be done.
pub struct Work<'a, I: Single> {
    pub inputs: &'a Inputs<'a, I::Model, I::Number>,
    pub options: &'a Options,
    pub tableau: &'a I::Tableau,
    pub given: Option<[&'a [I::Number]; 2]>,
    /// How many intervals are computed together.
    pub lanes: usize,
    /// How many are simulated together before each is differentiated alone.
    pub simulated: usize,
    /// Whether stages that are remembered are solutions at these inputs.
    pub solved: bool,
}

impl<I: Single> Work<'_, I> {
    /// How many intervals a group has.
    fn size(&self) -> usize {
        self.lanes.max(self.simulated)
    }
}

/// Consecutive intervals, and where what is found out about them belongs.
pub struct Share<'a, I: Single, R> {
    pub first: usize,
    pub results: &'a mut [R],
    pub status: &'a mut [Result<(), Error>],
    /// The stages of all steps of every interval; empty without a warm start, as `warm`.
    pub stages: &'a mut [I::Stages],
    pub warm: &'a mut [bool],
}

impl<'a, I: Single, R> Share<'a, I, R> {
    /// The next intervals, which are taken away.
    fn take(&mut self, count: usize, steps: usize) -> Share<'a, I, R> {
        let first = self.first;
        let count = count.min(self.results.len());
        self.first += count;
        Share {
            first,
            results: split(&mut self.results, count),
            status: split(&mut self.status, count),
            stages: split(&mut self.stages, count.saturating_mul(steps)),
            warm: split(&mut self.warm, count),
        }
    }
}

/// Makes a vector as long as that.
pub fn fill<V: Clone>(vector: &mut Vec<V>, length: usize, value: V) -> Result<(), BatchError> {
    let bytes = length.saturating_mul(size_of::<V>());
    vector.try_reserve(length.saturating_sub(vector.len())).map_err(|_| BatchError::OutOfMemory { bytes })?;
    vector.resize(length, value);
    Ok(())
}

/// The first elements, which are taken away.
fn split<'a, V>(slice: &mut &'a mut [V], count: usize) -> &'a mut [V] {
    let count = count.min(slice.len());
    let (first, rest) = core::mem::take(slice).split_at_mut(count);
    *slice = rest;
    first
}

/// Gives every thread as many groups as every other.
#[cfg(feature = "parallel")]
pub fn parallel<I: Single, R: Answer<I::Model, I::Number>>(
    work: &Work<'_, I>,
    workers: &mut Vec<Worker<I>>,
    threads: usize,
    mut share: Share<'_, I, R>,
) -> Result<(), BatchError> {
    let groups = share.results.len().div_ceil(work.size());
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

/// Groups of the registers that a machine has.
type Groups = [Option<Box<dyn Any + Send + Sync>>; 2];

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
        while !share.results.is_empty() {
            let group = share.take(work.size(), work.options.steps);
            self.group(work, group);
        }
    }

    /// The intervals of one group.
    fn group<R: Answer<I::Model, I::Number>>(&mut self, work: &Work<'_, I>, mut share: Share<'_, I, R>) {
        let mut intervals = [None; MOST_LANES];
        for (i, (interval, status)) in intervals.iter_mut().zip(share.status.iter_mut()).enumerate() {
            match work.inputs.interval(share.first + i) {
                Ok(good) => *interval = Some(good),
                Err(error) => *status = Err(error),
            }
        }
        let several = intervals.iter().flatten().count() > 1;
        let (mut done, mut solved) = ([false; MOST_LANES], [false; MOST_LANES]);
        if several && work.lanes > 1 {
            let (groups, statistics, share) = (&mut self.groups, &mut self.statistics, &mut share);
            let together = Together { work, groups, statistics, intervals: &intervals, share };
            // What did not get memory side by side may get it alone.
            done = I::Number::widest(work.lanes, together).ok().and_then(Result::ok).unwrap_or_default();
        } else if several && work.simulated > 1 {
            solved = self.simulate(work, &intervals, &share).unwrap_or_default();
        }
        for (i, interval) in intervals.iter().enumerate() {
            let (Some(interval), false) = (interval, done[i]) else { continue };
            let again = several && !solved[i];
            *(if again { &mut self.statistics.redone } else { &mut self.statistics.alone }) += 1;
            let mut outcome = self.alone(work, interval, i, solved[i], &mut share);
            self.statistics.add_work(&self.single.statistics());
            if solved[i] && outcome.is_err() {
                outcome = self.alone(work, interval, i, false, &mut share);
                self.statistics.add_work(&self.single.statistics());
            }
            if let Some(status) = share.status.get_mut(i) {
                *status = outcome;
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
        let (count, steps) = (MOST_LANES.min(share.results.len()), work.options.steps);
        fill(stages, MOST_LANES.saturating_mul(steps), Zeroable::zeroed()).ok()?;
        fill(ends, MOST_LANES, Zeroable::zeroed()).ok()?;
        let mut warm = [false; MOST_LANES];
        for (to, from) in stages.iter_mut().zip(share.stages.iter()) {
            assign(to, from);
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
        let stages = share.stages.chunks_exact_mut(steps).nth(index);
        let warm = share.warm.get_mut(index);
        match (&stages, &warm, self.stages.chunks_exact(steps).nth(index)) {
            (_, _, Some(stages)) if solved => single.start(Some(stages), true)?,
            (Some(stages), Some(true), _) => single.start(Some(stages), work.solved)?,
            _ => single.start(None, false)?,
        }
        if let Some(result) = share.results.get_mut(index) {
            result.alone(single, interval)?;
        }
        if let (Some(stages), Some(warm)) = (stages, warm) {
            single.stages(stages)?;
            *warm = true;
        }
        Ok(())
    }
}

/// The intervals of a group that can be computed, each in its lane.
type Lined<'a, I> = [Option<Interval<'a, <I as Integrator>::Model, <I as Integrator>::Number>>; MOST_LANES];

/// Gives every interval its result, where all is well and finite.
struct Distribute<'a, E: Lanes, W, R> {
    good: E::Mask,
    wide: &'a W,
    /// On entry which lanes are asked for, on return which are good.
    done: &'a mut [bool; MOST_LANES],
    results: &'a mut [R],
}

impl<E: Lanes, W: Wide<E, R>, R> Kernel for Distribute<'_, E, W, R> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { good, wide, done, results } = self;
        let good = E::and(good, wide.is_finite());
        let mut verdict: E::Cell = bytemuck::Zeroable::zeroed();
        E::select(good, E::from_f64(1.0), E::from_f64(0.0)).store(&mut verdict);
        for (lane, done) in done.iter_mut().enumerate().take(E::LANES) {
            *done &= E::lane(&verdict, lane) != 0.0;
        }
        wide.unpack(&*done, results, |result| result);
    }
}

/// The intervals of a group side by side.
struct Together<'a, 'b, 'c, I: Single, R> {
    work: &'a Work<'b, I>,
    groups: &'a mut Groups,
    statistics: &'a mut BatchStatistics,
    intervals: &'a Lined<'b, I>,
    share: &'a mut Share<'c, I, R>,
}

impl<I: Single, R: Answer<I::Model, I::Number>> Widest<I::Number> for Together<'_, '_, '_, I, R> {
    /// For which intervals there is a result.
    type Output = Result<[bool; MOST_LANES], Error>;

    fn call<E: Lanes<Cell: AsRef<[I::Number]> + AsMut<[I::Number]>>>(self) -> Self::Output {
        let Self { work, groups, statistics, intervals, share } = self;
        let mut done = [false; MOST_LANES];
        let is_mine = |group: &Box<dyn Any + Send + Sync>| (**group).is::<I::Group<E>>();
        // Its own place, or one that is free.
        let place = groups.iter_mut().find(|place| place.as_ref().is_none_or(is_mine));
        let group = place.map(|group| {
            group.get_or_insert_with(|| Box::new(I::Group::<E>::new(work.options, work.tableau)))
        });
        let group = group.and_then(|group| group.downcast_mut::<I::Group<E>>());
        // Lanes that nobody needs hold a copy of the first interval.
        let first = intervals.iter().position(Option::is_some);
        let (Some(group), Some(first)) = (group, first) else { return Ok(done) };
        let Some(Some(copy)) = intervals.get(first) else { return Ok(done) };
        let mut lanes = [copy; MOST_LANES];
        for (lane, interval) in lanes.iter_mut().zip(intervals).take(E::LANES) {
            *lane = interval.as_ref().unwrap_or(copy);
        }
        let index = |lane: usize| if matches!(intervals.get(lane), Some(Some(_))) { lane } else { first };

        let steps = work.options.steps;
        let mut stages: [&[I::Stages]; MOST_LANES] = [&[]; MOST_LANES];
        let mut warm = I::ITERATES && (work.options.start == Start::Warm || work.solved);
        if warm {
            for (lane, stages) in stages.iter_mut().enumerate().take(E::LANES) {
                let from = share.stages.chunks_exact(steps).nth(index(lane));
                *stages = from.unwrap_or_default();
                warm &= share.warm.get(index(lane)).copied().unwrap_or(false);
            }
        }
        let lanes = lanes.get(..E::LANES).unwrap_or_default();
        group.place(lanes, work.given, warm.then_some(&stages), work.solved)?;

        let (good, wide) = R::together::<I, E>(group)?;
        for (done, interval) in done.iter_mut().zip(intervals).take(E::LANES) {
            *done = interval.is_some();
        }
        dispatch(Distribute { good, wide, done: &mut done, results: &mut *share.results });
        let places = share.stages.chunks_exact_mut(steps).zip(share.warm.iter_mut());
        for (lane, ((stages, warm), done)) in places.zip(done).enumerate() {
            if done {
                group.stages(lane, stages)?;
                *warm = true;
            }
        }
        statistics.groups += 1;
        statistics.add_work(&group.work());
        Ok(done)
    }
}
