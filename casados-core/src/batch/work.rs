//! Who computes what: intervals in groups, groups on threads, and those alone that no group gives a
//! result for.

use super::answer::{Answer, Wide};
use super::error::BatchError;
use super::group::Group;
use super::intervals::{Inputs, Interval, vector};
use super::lanes::MOST_LANES;
use super::statistics::BatchStatistics;
use crate::error::Error;
use crate::irk;
use crate::linalg::{Arithmetic, Kernel, dispatch};
use crate::memory::Heap;
use crate::model::{ArrayK, Dae};
use crate::options::{Newton, Options, Start};
use crate::result::Nominal;
use crate::scalar::lanes::second_level_cache;
use crate::scalar::{Lanes, Real, Widest};
use crate::shape::{Shape, assign};
use crate::tableau::Tableau;
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
pub fn width<M: Dae, T: Real, R: Answer<M, T>, const S: usize>(options: &Newton) -> usize {
    let shared = S > 2
        && options.fixed_iterations.is_none()
        && options.jacobian.is_adaptive()
        && !M::STRUCTURE.linear_in_state;
    let mut most = MOST_LANES;
    loop {
        match T::widest(most, Fits::<M, R, S> { shared, of: PhantomData }) {
            Ok((lanes, true)) => return lanes,
            Ok((lanes, false)) => most = lanes.saturating_sub(1),
            Err(_) => return 1,
        }
    }
}

/// The lanes of a register, and whether they are to be used.
struct Fits<M, R, const S: usize> {
    /// Whether Newton's method takes the shared Jacobian of the stages.
    shared: bool,
    of: PhantomData<(M, R)>,
}

impl<M: Dae, T: Real, R: Answer<M, T>, const S: usize> Widest<T> for Fits<M, R, S> {
    type Output = (usize, bool);
    fn call<E: Lanes<Cell: AsRef<[T]> + AsMut<[T]>>>(self) -> (usize, bool) {
        let fits = R::working_set::<E, S>(self.shared) as f64 <= WORKING_SET * second_level_cache() as f64;
        // Without a plan the whole matrix is pivoted, which no two intervals do in the same way.
        (E::LANES, !M::STRUCTURE.elimination.pivots.is_empty() && fits)
    }
}

/// What is to be done.
pub struct Work<'a, M: Dae, T: Real, const S: usize> {
    pub inputs: &'a Inputs<'a, M, T>,
    pub options: &'a Options,
    pub tableau: &'a Tableau<S>,
    pub given: Option<[&'a [T]; 2]>,
    /// How many intervals are computed together.
    pub lanes: usize,
    /// How many are simulated together before each is differentiated alone.
    pub simulated: usize,
    /// Whether records are solutions at these inputs.
    pub solved: bool,
}

impl<M: Dae, T: Real, const S: usize> Work<'_, M, T, S> {
    /// How many intervals a group has.
    fn size(&self) -> usize {
        self.lanes.max(self.simulated)
    }
}

/// Consecutive intervals, and where what is found out about them belongs.
pub struct Share<'a, M: Dae, T: Real, R, const S: usize> {
    pub first: usize,
    pub results: &'a mut [R],
    pub status: &'a mut [Result<(), Error>],
    /// The stages of all steps of every interval; empty without a warm start, as `warm`.
    pub records: &'a mut [ArrayK<M, [T; S]>],
    pub warm: &'a mut [bool],
}

impl<'a, M: Dae, T: Real, R, const S: usize> Share<'a, M, T, R, S> {
    /// The next intervals, which are taken away.
    fn take(&mut self, count: usize, steps: usize) -> Share<'a, M, T, R, S> {
        let first = self.first;
        let count = count.min(self.results.len());
        self.first += count;
        Share {
            first,
            results: split(&mut self.results, count),
            status: split(&mut self.status, count),
            records: split(&mut self.records, count.saturating_mul(steps)),
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
pub fn parallel<M: Dae, B, R: Answer<M, T>, T: Real, const S: usize>(
    work: &Work<'_, M, T, S>,
    workers: &mut Vec<Worker<M, B, S, T>>,
    threads: usize,
    mut share: Share<'_, M, T, R, S>,
) -> Result<(), BatchError> {
    let groups = share.results.len().div_ceil(work.size());
    let threads = threads.min(groups).max(1);
    while workers.len() < threads {
        let worker = Worker::new(*work.options, *work.tableau);
        let bytes = threads.saturating_mul(size_of::<Worker<M, B, S, T>>());
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
pub struct Worker<M: Dae, B, const S: usize, T: Real> {
    single: irk::Integrator<M, B, S, T, Heap>,
    /// A [`Group`] for each kind of register: results of several kinds may need different ones.
    groups: Groups,
    /// Stages of the steps of intervals that are simulated together, and where they lead.
    stages: Vec<ArrayK<M, [T; S]>>,
    ends: Vec<Nominal<M, T>>,
    pub statistics: BatchStatistics,
}

impl<M: Dae, B, const S: usize, T: Real> Worker<M, B, S, T> {
    pub fn new(options: Options, tableau: Tableau<S>) -> Result<Self, Error> {
        let single = irk::Integrator::build(options, tableau)?;
        let (stages, ends) = (Vec::new(), Vec::new());
        Ok(Self { single, groups: [None, None], stages, ends, statistics: BatchStatistics::default() })
    }

    /// The same with memory of its own.
    pub fn fresh(&self) -> Self {
        let (single, stages, ends) = (self.single.clone(), Vec::new(), Vec::new());
        Self { single, groups: [None, None], stages, ends, statistics: BatchStatistics::default() }
    }

    pub fn run<R: Answer<M, T>>(&mut self, work: &Work<'_, M, T, S>, mut share: Share<'_, M, T, R, S>) {
        while !share.results.is_empty() {
            let group = share.take(work.size(), work.options.steps);
            self.group(work, group);
        }
    }

    /// The intervals of one group.
    fn group<R: Answer<M, T>>(&mut self, work: &Work<'_, M, T, S>, mut share: Share<'_, M, T, R, S>) {
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
            done = T::widest(work.lanes, together).ok().and_then(Result::ok).unwrap_or_default();
        } else if several && work.simulated > 1 {
            solved = self.simulate(work, &intervals, &share).unwrap_or_default();
        }
        for (i, interval) in intervals.iter().enumerate() {
            let (Some(interval), false) = (interval, done[i]) else { continue };
            let again = several && !solved[i];
            *(if again { &mut self.statistics.redone } else { &mut self.statistics.alone }) += 1;
            let mut outcome = self.alone(work, interval, i, solved[i], &mut share);
            self.statistics.add_work(self.single.statistics());
            if solved[i] && outcome.is_err() {
                outcome = self.alone(work, interval, i, false, &mut share);
                self.statistics.add_work(self.single.statistics());
            }
            if let Some(status) = share.status.get_mut(i) {
                *status = outcome;
            }
        }
    }

    /// The stages of all intervals of a group, for those that arrive.
    fn simulate<R>(
        &mut self,
        work: &Work<'_, M, T, S>,
        intervals: &[Option<Interval<'_, M, T>>; MOST_LANES],
        share: &Share<'_, M, T, R, S>,
    ) -> Option<[bool; MOST_LANES]> {
        let Self { groups, stages, ends, statistics, .. } = self;
        let (count, steps) = (MOST_LANES.min(share.results.len()), work.options.steps);
        fill(stages, MOST_LANES.saturating_mul(steps), Zeroable::zeroed()).ok()?;
        fill(ends, MOST_LANES, Zeroable::zeroed()).ok()?;
        let mut warm = [false; MOST_LANES];
        for (to, from) in stages.iter_mut().zip(share.records.iter()) {
            assign(to, from);
        }
        for (to, from) in warm.iter_mut().zip(share.warm.iter()) {
            *to = *from;
        }
        let mut share = Share {
            first: share.first,
            results: ends.get_mut(..count)?,
            status: &mut [],
            records: stages,
            warm: &mut warm,
        };
        let together = Together { work, groups, statistics, intervals, share: &mut share };
        T::widest(work.simulated, together).ok().and_then(Result::ok)
    }

    /// One interval; its stages may be known.
    fn alone<R: Answer<M, T>>(
        &mut self,
        work: &Work<'_, M, T, S>,
        interval: &Interval<'_, M, T>,
        index: usize,
        solved: bool,
        share: &mut Share<'_, M, T, R, S>,
    ) -> Result<(), Error> {
        let irk = &mut self.single;
        if M::Shape::NP > 0 {
            irk.set_parameters(&vector(interval.p))?;
        }
        irk.set_time(interval.t0)?;
        if let Some([xdot, z]) = work.given {
            irk.set_start(&vector(xdot), &vector(z))?;
        }
        let steps = work.options.steps;
        let record = share.records.chunks_exact_mut(steps).nth(index);
        let warm = share.warm.get_mut(index);
        match (&record, &warm, self.stages.chunks_exact(steps).nth(index)) {
            (_, _, Some(stages)) if solved => irk.set_solution(stages)?,
            (Some(record), Some(true), _) if work.solved => irk.set_solution(record)?,
            (Some(record), Some(true), _) => irk.set_record(record)?,
            _ => irk.reset(),
        }
        if let Some(result) = share.results.get_mut(index) {
            result.alone(irk, interval)?;
        }
        if let (Some(record), Some(warm)) = (record, warm) {
            irk.record(record)?;
            *warm = true;
        }
        Ok(())
    }
}

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
struct Together<'a, 'b, 'c, M: Dae, T: Real, R, const S: usize> {
    work: &'a Work<'b, M, T, S>,
    groups: &'a mut Groups,
    statistics: &'a mut BatchStatistics,
    intervals: &'a [Option<Interval<'b, M, T>>; MOST_LANES],
    share: &'a mut Share<'c, M, T, R, S>,
}

impl<M: Dae, T: Real, R: Answer<M, T>, const S: usize> Widest<T> for Together<'_, '_, '_, M, T, R, S> {
    /// For which intervals there is a result.
    type Output = Result<[bool; MOST_LANES], Error>;

    fn call<E: Lanes<Cell: AsRef<[T]> + AsMut<[T]>>>(self) -> Self::Output {
        let Self { work, groups, statistics, intervals, share } = self;
        let mut done = [false; MOST_LANES];
        let is_mine = |group: &Box<dyn Any + Send + Sync>| (**group).is::<Group<M, E, S>>();
        // Its own place, or one that is free.
        let place = groups.iter_mut().find(|place| place.as_ref().is_none_or(is_mine));
        let group = place.map(|group| {
            group.get_or_insert_with(|| Box::new(Group::<M, E, S>::new(work.options, work.tableau)))
        });
        let group = group.and_then(|group| group.downcast_mut::<Group<M, E, S>>());
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
        let mut records: [&[ArrayK<M, [T; S]>]; MOST_LANES] = [&[]; MOST_LANES];
        let mut warm = work.options.start == Start::Warm || work.solved;
        if warm {
            for (lane, record) in records.iter_mut().enumerate().take(E::LANES) {
                let from = share.records.chunks_exact(steps).nth(index(lane));
                *record = from.unwrap_or_default();
                warm &= share.warm.get(index(lane)).copied().unwrap_or(false);
            }
        }
        group.place(lanes.get(..E::LANES).unwrap_or_default(), work.given, warm.then_some(&records))?;

        group.solved = warm && work.solved;
        let (good, wide) = R::together(group, warm)?;
        for (done, interval) in done.iter_mut().zip(intervals).take(E::LANES) {
            *done = interval.is_some();
        }
        dispatch(Distribute { good, wide, done: &mut done, results: &mut *share.results });
        let places = share.records.chunks_exact_mut(steps).zip(share.warm.iter_mut());
        for (lane, ((record, warm), done)) in places.zip(done).enumerate() {
            if done {
                group.record(lane, record)?;
                *warm = true;
            }
        }
        statistics.groups += 1;
        statistics.add_work(&group.statistics);
        Ok(done)
    }
}
