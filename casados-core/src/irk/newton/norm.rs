//! The norm of increments relative to the unknowns, including the effect on kinematic states.

use crate::irk::kinematic::minus_c;
use crate::linalg::{Arithmetic, Kernel, RowVisitor, for_each_row};
use crate::plan::{Plan, StructureTable};
use crate::scalar::{Lanes, Scalar};
use crate::shape::{InBounds, Plain};

/// The size of an increment relative to the present unknowns.
pub(in crate::irk) struct MeasureIncrement<'a, M: Plan, E: Plain, const S: usize> {
    pub plan: M,
    pub scales: &'a KinematicScales<'a, M, E, S>,
    pub x: &'a M::X<E>,
    pub y: &'a M::K<[E; S]>,
    pub increment: &'a M::K<[[E; 1]; S]>,
    pub weights: &'a mut M::K<E>,
    pub sizes: &'a mut M::K<E>,
    pub h: E,
    pub floor: E,
}

impl<M: Plan, E: Lanes, const S: usize> Kernel for MeasureIncrement<'_, M, E, S> {
    type Number = E;
    type Output = E;
    #[inline(always)]
    fn run<A: Arithmetic>(self) -> E {
        let Self { plan, scales, x, y, increment, weights, sizes, h, floor } = self;
        let zero = E::from_f64(0.0);
        // Changes of `ẋ` below this fraction of `x/h` round to zero in `x`.
        let change_per_step = E::select(Scalar::eq(h, zero), zero, floor / h.abs());
        // Four unknowns at a time, then the remaining ones.
        let (ys, last_ys) = unknowns_of(plan, y.as_ref()).as_chunks::<4>();
        let (increments, last) = unknowns_of(plan, increment.as_ref()).as_chunks::<4>();
        let (own_weights, last_weights) = unknowns_of_mut(plan, weights.as_mut()).as_chunks_mut::<4>();
        let (own_sizes, last_sizes) = unknowns_of_mut(plan, sizes.as_mut()).as_chunks_mut::<4>();
        let mut states = x.as_ref().get(plan.facts().non_kinematic_range.0..).in_bounds().unwrap_or_default();
        let mut blocks_of_four = RelativeIncrements { largest: [zero; 4], sum: [zero; 4], change_per_step };
        for (((y, increments), weights), sizes) in ys.iter().zip(increments).zip(own_weights).zip(own_sizes) {
            blocks_of_four.include(&mut states, y, increments, weights, sizes);
        }
        let mut remainder = RelativeIncrements { largest: [zero], sum: [zero], change_per_step };
        for (((y, increment), weight), size) in last_ys.iter().zip(last).zip(last_weights).zip(last_sizes) {
            let (y, increment) = (core::array::from_ref(y), core::array::from_ref(increment));
            let (weight, size) = (core::array::from_mut(weight), core::array::from_mut(size));
            remainder.include(&mut states, y, increment, weight, size);
        }
        let largest = larger_accumulator([blocks_of_four.reduce(), remainder.reduce()]);
        if const { !StructureTable::Kinematic.may_have_rows::<M>() } {
            return largest;
        }
        let mut norm = zero;
        for a in scales.a {
            let mut sum = zero;
            for a in a {
                sum = sum + a.abs();
            }
            norm = sum.max(norm);
        }
        let norm = E::from_f64(TYPICAL_KINEMATIC_RATIO) * norm * h.abs();
        let mut velocities = VelocityIncrements {
            plan,
            scales,
            x,
            increment,
            weights,
            sizes,
            change_per_step,
            tableau_norm: norm,
            largest,
        };
        for_each_row::<A, _>(&mut velocities);
        velocities.largest
    }
}

/// Relative increments of some unknowns, in `N` accumulators.
struct RelativeIncrements<E, const N: usize> {
    largest: [E; N],
    /// Sum of the increments: it preserves NaN, which a maximum may lose.
    sum: [E; N],
    change_per_step: E,
}

impl<E: Lanes, const N: usize> RelativeIncrements<E, N> {
    /// Includes `N` unknowns; `states` are the states of those that are derivatives.
    #[inline(always)]
    fn include<const S: usize>(
        &mut self,
        states: &mut &[E],
        y: &[[E; S]; N],
        increments: &[[[E; 1]; S]; N],
        weights: &mut [E; N],
        sizes: &mut [E; N],
    ) {
        let (zero, one, smallest) = (E::from_f64(0.0), E::from_f64(1.0), E::from_f64(E::SMALLEST));
        let (mut scale, mut size, mut sum) = ([zero; N], [zero; N], [zero; N]);
        if let Some((own, rest)) = states.split_first_chunk() {
            (scale, *states) = (*own, rest);
        } else {
            for (scale, x) in scale.iter_mut().zip(core::mem::take(states)) {
                *scale = *x;
            }
        }
        for scale in &mut scale {
            *scale = (scale.abs() * self.change_per_step).max(smallest);
        }
        // The loop over stages is outside, so that operations on the unknowns are vectorised.
        #[allow(clippy::needless_range_loop)]
        for i in 0..S {
            for n in 0..N {
                let [delta] = increments[n][i];
                size[n] = delta.abs().max(size[n]);
                scale[n] = y[n][i].abs().max(scale[n]);
                sum[n] = sum[n] + delta;
            }
        }
        for n in 0..N {
            weights[n] = one / size[n].max(scale[n]);
            sizes[n] = size[n] * weights[n];
            self.sum[n] = self.sum[n] + sum[n] * weights[n];
            self.largest[n] = sizes[n].max(self.largest[n]);
        }
    }

    /// Returns the largest relative increment, and the sum.
    #[inline(always)]
    fn reduce(&self) -> [E; 2] {
        let (mut largest, mut sum) = (E::from_f64(0.0), E::from_f64(0.0));
        for n in 0..N {
            (largest, sum) = (self.largest[n].max(largest), sum + self.sum[n]);
        }
        [largest, sum]
    }
}

/// The bound `|Δ_q| ≤ |c| h ‖A‖ |Δ_v|`, relative to `k_q`: relevant if `v` is much smaller than its
/// change within the step.
struct VelocityIncrements<'a, M: Plan, E: Plain, const S: usize> {
    plan: M,
    scales: &'a KinematicScales<'a, M, E, S>,
    x: &'a M::X<E>,
    increment: &'a M::K<[[E; 1]; S]>,
    weights: &'a mut M::K<E>,
    sizes: &'a mut M::K<E>,
    change_per_step: E,
    /// `h ‖A‖`
    tableau_norm: E,
    /// The largest increment.
    largest: E,
}

impl<M: Plan, E: Lanes, const S: usize> RowVisitor for VelocityIncrements<'_, M, E, S> {
    const ROWS: Option<usize> = StructureTable::Kinematic.known_row_count::<M>();
    #[inline(always)]
    fn row_count(&self) -> usize {
        StructureTable::Kinematic.row_count(self.plan.structure())
    }
    const INSTRUCTIONS: usize = 8;
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, state: usize) {
        let KinematicScales { jacobian, points, .. } = self.scales;
        let Some(kinematic) = self.plan.kinematic(state) else { return };
        let (Some(own), Some(minus_c)) =
            (self.plan.velocity(kinematic), minus_c(kinematic, jacobian.as_ref()))
        else {
            return;
        };
        let (weights, sizes) = (self.weights.as_mut(), self.sizes.as_mut());
        let (Some(weight), Some(k)) =
            (weights.get_mut(own).in_bounds(), points.as_ref().get(state).in_bounds())
        else {
            return;
        };
        let bound = self.tableau_norm * minus_c.abs();
        // The first stage is sufficient in most cases.
        if !E::any(E::lt(*weight * k[0].abs(), bound)) {
            return;
        }
        let smallest = E::from_f64(E::SMALLEST);
        let mut size = match self.x.as_ref().get(state) {
            Some(x) => (x.abs() * self.change_per_step).max(smallest),
            None => smallest,
        };
        for k in k {
            size = k.abs().max(size);
        }
        if let (Some(to), Some(increment)) =
            (sizes.get_mut(own).in_bounds(), self.increment.as_ref().get(own).in_bounds())
        {
            *weight = (bound / size).max(*weight);
            let mut largest = E::from_f64(0.0);
            for [delta] in increment {
                largest = delta.abs().max(largest);
            }
            *to = largest * *weight;
            self.largest = to.max(self.largest);
        }
    }
}

/// Typical ratio of an increment of a kinematic state to its bound: `Σ_j a_ij Δ_j` is up to half of
/// the largest `Σ_j |a_ij| |Δ_j|` if all stages have the same sign, otherwise less.
const TYPICAL_KINEMATIC_RATIO: f64 = 0.25;

/// The sizes `k_q` of [kinematic](crate::irk::kinematic) states, by which increments of velocities
/// are measured too.
pub(in crate::irk) struct KinematicScales<'a, M: Plan, E: Plain, const S: usize> {
    pub jacobian: &'a M::Jacobian<[E; S]>,
    /// Variables that contain `k_q`.
    pub points: &'a M::V<[E; S]>,
    pub a: &'a [[E; S]; S],
}

/// The part of an array of unknowns without the kinematic states at its ends, which have no
/// increments.
#[inline(always)]
pub(in crate::irk) fn unknowns_of<M: Plan, T>(plan: M, of: &[T]) -> &[T] {
    let (first, end) = plan.facts().non_kinematic_range;
    of.get(first..end).in_bounds().unwrap_or_default()
}

#[inline(always)]
pub(in crate::irk) fn unknowns_of_mut<M: Plan, T>(plan: M, of: &mut [T]) -> &mut [T] {
    let (first, end) = plan.facts().non_kinematic_range;
    of.get_mut(first..end).in_bounds().unwrap_or_default()
}

/// The larger of two accumulators, or NaN.
#[inline(always)]
pub(super) fn larger_accumulator<E: Lanes>([[a, sum], [b, other]]: [[E; 2]; 2]) -> E {
    let total = sum + other;
    E::select(E::le(total.abs(), E::from_f64(f64::MAX)), a.max(b), total)
}
