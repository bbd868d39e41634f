//! The intervals of a group side by side, and what each of them gets.

use super::answer::{Answer, Wide};
use super::intervals::Interval;
use super::lanes::MOST_LANES;
use super::share::{Share, Work};
use super::single::{Group, Single};
use super::statistics::BatchStatistics;
use crate::error::Error;
use crate::integrator::Integrator;
use crate::linalg::{Arithmetic, Kernel, dispatch};
use crate::options::Start;
use crate::scalar::{Lanes, Widest};
use alloc::boxed::Box;
use core::any::Any;

/// Groups of the registers that a machine has.
pub type Groups = [Option<Box<dyn Any + Send + Sync>>; 2];

/// The intervals of a group that can be computed, each in its lane.
pub type Lined<'a, I> =
    [Option<Interval<'a, <I as Integrator>::Model, <I as Integrator>::Number>>; MOST_LANES];

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
pub struct Together<'a, 'b, 'c, I: Single, R> {
    pub work: &'a Work<'b, I>,
    pub groups: &'a mut Groups,
    pub statistics: &'a mut BatchStatistics,
    pub intervals: &'a Lined<'b, I>,
    pub share: &'a mut Share<'c, I, R>,
}

impl<I: Single, R: Answer<I::Model, I::Number>> Widest<I::Number> for Together<'_, '_, '_, I, R> {
    /// For which intervals there is a result.
    type Output = Result<[bool; MOST_LANES], Error>;

    // What callers have of it they do not have to optimise again.
    #[inline(never)]
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
        statistics.work.add(&group.work());
        Ok(done)
    }
}
