//! Computes a group of intervals, and writes the result of each.

use super::batch_output::{BatchOutput, LaneResults};
use super::chunk::{BatchTask, IntervalChunk};
use super::intervals::Interval;
use super::lanes::MAX_LANES;
use super::single::{Group, Single};
use super::statistics::BatchStatistics;
use crate::error::Error;
use crate::integrator::Integrator;
use crate::linalg::{Arithmetic, Kernel, dispatch};
use crate::options::Start;
use crate::scalar::{Lanes, Widest};
use alloc::boxed::Box;
use core::any::Any;

/// Groups for the register types of the machine.
pub type GroupCache = [Option<Box<dyn Any + Send + Sync>>; 2];

/// The intervals of a group with valid inputs, one in each lane.
pub type LaneIntervals<'a, I> =
    [Option<Interval<'a, <I as Integrator>::Model, <I as Integrator>::Number>>; MAX_LANES];

/// Writes the results of lanes that have converged and are finite.
struct Distribute<'a, E: Lanes, W, R> {
    converged_lanes: E::Mask,
    lane_results: &'a W,
    /// On entry the lanes with an interval, on return those with a valid result.
    valid_lanes: &'a mut [bool; MAX_LANES],
    results: &'a mut [R],
}

impl<E: Lanes, W: LaneResults<E, R>, R> Kernel for Distribute<'_, E, W, R> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { converged_lanes: good, lane_results: wide, valid_lanes: done, results } = self;
        let good = E::and(good, wide.is_finite());
        let mut valid_cell: E::Cell = bytemuck::Zeroable::zeroed();
        E::select(good, E::from_f64(1.0), E::from_f64(0.0)).store(&mut valid_cell);
        for (lane, done) in done.iter_mut().enumerate().take(E::LANES) {
            *done &= E::lane(&valid_cell, lane) != 0.0;
        }
        wide.unpack(&*done, results, |result| result);
    }
}

/// A call that computes the intervals of a group.
pub struct GroupCall<'a, 'b, 'c, I: Single, R> {
    pub task: &'a BatchTask<'b, I>,
    pub groups: &'a mut GroupCache,
    pub statistics: &'a mut BatchStatistics,
    pub intervals: &'a LaneIntervals<'b, I>,
    pub chunk: &'a mut IntervalChunk<'c, I, R>,
}

impl<I: Single, R: BatchOutput<I::Model, I::Number>> Widest<I::Number> for GroupCall<'_, '_, '_, I, R> {
    /// The intervals with a result.
    type Output = Result<[bool; MAX_LANES], Error>;

    // Not inlined, so that it is optimised once for all callers.
    #[inline(never)]
    fn call<E: Lanes<Cell: AsRef<[I::Number]> + AsMut<[I::Number]>>>(self) -> Self::Output {
        let Self { task: work, groups, statistics, intervals, chunk: share } = self;
        let mut valid_lanes = [false; MAX_LANES];
        let has_group_type = |group: &Box<dyn Any + Send + Sync>| (**group).is::<I::Group<E>>();
        // The slot of this register type, or a free one.
        let cache_slot = groups.iter_mut().find(|place| place.as_ref().is_none_or(has_group_type));
        let group = cache_slot.map(|group| {
            group.get_or_insert_with(|| Box::new(I::Group::<E>::new(work.options, work.tableau)))
        });
        let group = group.and_then(|group| group.downcast_mut::<I::Group<E>>());
        // Unused lanes hold a copy of the first interval.
        let first_lane = intervals.iter().position(Option::is_some);
        let (Some(group), Some(first_lane)) = (group, first_lane) else { return Ok(valid_lanes) };
        let Some(Some(padding_interval)) = intervals.get(first_lane) else { return Ok(valid_lanes) };
        let mut lanes = [padding_interval; MAX_LANES];
        for (lane, interval) in lanes.iter_mut().zip(intervals).take(E::LANES) {
            *lane = interval.as_ref().unwrap_or(padding_interval);
        }
        let source_lane =
            |lane: usize| if matches!(intervals.get(lane), Some(Some(_))) { lane } else { first_lane };

        let steps = work.options.steps;
        let mut stages: [&[I::Stages]; MAX_LANES] = [&[]; MAX_LANES];
        let mut has_initial_stages =
            I::IS_ITERATIVE && (work.options.start == Start::Warm || work.reuses_solutions);
        if has_initial_stages {
            for (lane, stages) in stages.iter_mut().enumerate().take(E::LANES) {
                let from = share.stages.chunks_exact(steps).nth(source_lane(lane));
                *stages = from.unwrap_or_default();
                has_initial_stages &= share.has_stages.get(source_lane(lane)).copied().unwrap_or(false);
            }
        }
        let lanes = lanes.get(..E::LANES).unwrap_or_default();
        group.load_intervals(
            lanes,
            work.start_values,
            has_initial_stages.then_some(&stages),
            work.reuses_solutions,
        )?;

        let (good, wide) = R::compute_group::<I, E>(group)?;
        for (done, interval) in valid_lanes.iter_mut().zip(intervals).take(E::LANES) {
            *done = interval.is_some();
        }
        dispatch(Distribute {
            converged_lanes: good,
            lane_results: wide,
            valid_lanes: &mut valid_lanes,
            results: &mut *share.results,
        });
        let places = share.stages.chunks_exact_mut(steps).zip(share.has_stages.iter_mut());
        for (lane, ((stages, warm), done)) in places.zip(valid_lanes).enumerate() {
            if done {
                group.copy_stages(lane, stages)?;
                *warm = true;
            }
        }
        statistics.groups += 1;
        statistics.work.add(&group.statistics());
        Ok(valid_lanes)
    }
}
