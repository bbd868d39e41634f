//! Increments of Newton's method: the update of the unknowns, and the statistics for the
//! convergence test.

use super::norm::{KinematicScales, MeasureIncrement, larger_accumulator, unknowns_of, unknowns_of_mut};
use crate::linalg::{Arithmetic, Kernel, RowVisitor, for_each_row, kernels};
use crate::plan::{Plan, StructureTable};
use crate::scalar::Lanes;
use crate::shape::{InBounds, Plain};

/// Copies the residual to the slots of the equations; residuals of kinematic states are zero.
pub(in crate::irk) struct PlaceResidual<'a, M: Plan, E: Plain, const S: usize> {
    pub plan: M,
    pub f: &'a M::K<[E; S]>,
    pub increment: &'a mut M::K<[[E; 1]; S]>,
}

impl<M: Plan, E: Lanes, const S: usize> Kernel for PlaceResidual<'_, M, E, S> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(mut self) {
        for_each_row::<A, _>(&mut self);
    }
}

impl<M: Plan, E: Lanes, const S: usize> RowVisitor for PlaceResidual<'_, M, E, S> {
    const ROWS: Option<usize> = StructureTable::Unknowns.known_row_count::<M>();
    #[inline(always)]
    fn row_count(&self) -> usize {
        self.plan.nk()
    }
    const INSTRUCTIONS: usize = 2 * S;
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, equation: usize) {
        let slot = self.plan.slot(equation);
        if self.plan.kinematic(slot).is_some() {
            return;
        }
        if let (Some(to), Some(f)) =
            (self.increment.as_mut().get_mut(slot).in_bounds(), self.f.as_ref().get(equation).in_bounds())
        {
            to.as_flattened_mut().copy_from_slice(f);
        }
    }
}

kernels! {
    /// Returns the largest magnitude of a residual, ignoring values that are not numbers.
    pub(in crate::irk) fn largest [E: Lanes] [E] <A>(residual: &'k [E]) -> E {
        let mut largest = [E::from_f64(0.0); 8];
        let (eights, rest) = residual.as_chunks::<8>();
        for residuals in eights {
            for (largest, residual) in largest.iter_mut().zip(residuals) {
                *largest = residual.abs().max(*largest);
            }
        }
        for (largest, residual) in largest.iter_mut().zip(rest) {
            *largest = residual.abs().max(*largest);
        }
        let [a, b, c, d, e, f, g, h] = largest;
        (a.max(b).max(c.max(d))).max(e.max(f).max(g.max(h)))
    }
}

kernels! {
    /// `y ← y − Δ`
    pub(in crate::irk) fn subtract_increment [E: Lanes, const S: usize] [E, S] <A>(
        y: &'k mut [[E; S]],
        increment: &'k [[[E; 1]; S]],
    ) {
        for (y, increment) in y.iter_mut().zip(increment) {
            for (y, [delta]) in y.iter_mut().zip(increment) {
                *y = *y - *delta;
            }
        }
    }
}

/// `y ← y − Δ`. Returns the size of the increment, and zero if the next increment is expected to be
/// below the tolerance, otherwise `1 + growth`, where `growth` is the largest difference between
/// the increment of an unknown and its last one. (Two numbers are returned in registers, three are
/// not.)
pub(in crate::irk) struct UpdateUnknowns<'a, M: Plan, E: Lanes, const S: usize> {
    pub plan: M,
    pub scales: &'a KinematicScales<'a, M, E, S>,
    pub x: &'a M::X<E>,
    pub y: &'a mut M::K<[E; S]>,
    pub increment: &'a mut M::K<[[E; 1]; S]>,
    pub weights: &'a mut M::K<E>,
    pub sizes: &'a mut M::K<E>,
    pub active: E::Mask,
    pub h: E,
    pub floor: E,
    pub tolerance: E,
    pub full_newton: bool,
    /// Whether to measure the sizes of the unknowns; there is no last increment to compare with.
    pub measures_sizes: bool,
}

impl<M: Plan, E: Lanes, const S: usize> Kernel for UpdateUnknowns<'_, M, E, S> {
    type Number = E;
    type Output = (E, E);
    #[inline(always)]
    fn run<A: Arithmetic>(self) -> (E, E) {
        let Self {
            plan,
            scales,
            x,
            y,
            increment,
            weights,
            sizes,
            active,
            h,
            floor,
            tolerance,
            full_newton: full,
            measures_sizes: measure,
        } = self;
        let (zero, one) = (E::from_f64(0.0), E::from_f64(1.0));
        if measure {
            let (y_part, increment_part) =
                (unknowns_of_mut(plan, y.as_mut()), unknowns_of_mut(plan, increment.as_mut()));
            for (y, increment) in y_part.iter_mut().zip(increment_part) {
                subtract_active(core::array::from_mut(y), core::array::from_mut(increment), active);
            }
            let measure = MeasureIncrement { plan, scales, x, y, increment, weights, sizes, h, floor };
            return (measure.run::<A>(), one);
        }
        // Four unknowns at a time, then the remaining ones.
        let (y, last_y) = unknowns_of_mut(plan, y.as_mut()).as_chunks_mut::<4>();
        let (increments, last) = unknowns_of_mut(plan, increment.as_mut()).as_chunks_mut::<4>();
        let (weights, last_weights) = unknowns_of(plan, weights.as_ref()).as_chunks::<4>();
        let (sizes, last_sizes) = unknowns_of_mut(plan, sizes.as_mut()).as_chunks_mut::<4>();
        let mut blocks_of_four = IncrementStatistics::with_tolerance(tolerance, full);
        for (((y, increments), weights), sizes) in y.iter_mut().zip(increments).zip(weights).zip(sizes) {
            subtract_active(y, increments, active);
            blocks_of_four.include(increments, weights, sizes);
        }
        let mut remainder = IncrementStatistics::with_tolerance(tolerance, full);
        for (((y, increment), weight), size) in last_y.iter_mut().zip(last).zip(last_weights).zip(last_sizes)
        {
            let increment = core::array::from_mut(increment);
            subtract_active(core::array::from_mut(y), increment, active);
            remainder.include(increment, core::array::from_ref(weight), core::array::from_mut(size));
        }
        let ([largest, excess, growth, sum], other) = (blocks_of_four.reduce(), remainder.reduce());
        let size = larger_accumulator([[largest, sum], [other[0], other[3]]]);
        (size, E::select(E::le(excess.max(other[1]), zero), zero, one + growth.max(other[2])))
    }
}

/// `y ← y − Δ` of some unknowns, in lanes that are `active`; the increments of other lanes become
/// zero. A single lane is always active here.
#[inline(always)]
fn subtract_active<E: Lanes, const S: usize, const N: usize>(
    y: &mut [[E; S]; N],
    increments: &mut [[[E; 1]; S]; N],
    active: E::Mask,
) {
    // Local copies stay in registers: the optimiser cannot prove that the arguments do not overlap.
    let (mut new, mut deltas) = (*y, *increments);
    for (y, [delta]) in new.as_flattened_mut().iter_mut().zip(deltas.as_flattened_mut()) {
        if const { E::LANES > 1 } {
            *delta = E::select(active, *delta, E::from_f64(0.0));
        }
        *y = *y - *delta;
    }
    *y = new;
    if const { E::LANES > 1 } {
        *increments = deltas;
    }
}

/// Statistics of the increments of some unknowns, in `N` accumulators.
struct IncrementStatistics<E, const N: usize> {
    largest: [E; N],
    /// Excess over the tolerance of the increment and of the expected next one, whichever is
    /// smaller.
    excess: [E; N],
    /// Growth of the increment over the last one.
    growth: [E; N],
    /// Sum of the increments: it is NaN if one of them is, which a maximum may lose.
    sum: [E; N],
    tolerance: E,
    full_newton: bool,
}

impl<E: Lanes, const N: usize> IncrementStatistics<E, N> {
    #[inline(always)]
    fn with_tolerance(tolerance: E, full: bool) -> Self {
        let zero = E::from_f64(0.0);
        let (zeros, excess) = ([zero; N], [-tolerance; N]);
        Self { largest: zeros, excess, growth: zeros, sum: zeros, tolerance, full_newton: full }
    }

    /// Includes `N` unknowns, with the `sizes` of their last increments.
    #[inline(always)]
    fn include<const S: usize>(
        &mut self,
        increments: &[[[E; 1]; S]; N],
        weights: &[E; N],
        sizes: &mut [E; N],
    ) {
        let old = *sizes;
        let (mut new, mut excess) = ([E::from_f64(0.0); N], [E::from_f64(0.0); N]);
        // The loop over stages is outside, so that operations on the unknowns are vectorised.
        #[allow(clippy::needless_range_loop)]
        for i in 0..S {
            for n in 0..N {
                let [delta] = increments[n][i];
                new[n] = delta.abs().max(new[n]);
                self.sum[n] = self.sum[n] + delta;
            }
        }
        for n in 0..N {
            new[n] = new[n] * weights[n];
        }
        // The growth of all increments.
        let mut growth = [E::from_f64(0.0); N];
        for n in 0..N {
            growth[n] = new[n] - old[n];
        }
        // `θ size/(1 − θ)` with `θ = size/old`, or `θ² size`, compared with the tolerance; without
        // a division where possible.
        if self.full_newton {
            for n in 0..N {
                let rate = new[n] / old[n];
                excess[n] = new[n] * rate * rate - self.tolerance;
            }
        } else {
            for n in 0..N {
                excess[n] = new[n] * new[n] + self.tolerance * growth[n];
            }
        }
        for n in 0..N {
            // For stagnating increments the next one is expected to be at least as large.
            let expected = excess[n].max(new[n] + growth[n]);
            let increment_part = new[n] - self.tolerance;
            // The minimum of both.
            self.excess[n] = (-(-increment_part).max(-expected)).max(self.excess[n]);
            self.growth[n] = growth[n].max(self.growth[n]);
            self.largest[n] = new[n].max(self.largest[n]);
        }
        *sizes = new;
    }

    /// Returns the largest increment, the largest excess, the largest growth, and the sum.
    #[inline(always)]
    fn reduce(&self) -> [E; 4] {
        let zero = E::from_f64(0.0);
        let [mut largest, mut excess, mut growth, mut sum] = [zero, -self.tolerance, zero, zero];
        for n in 0..N {
            largest = self.largest[n].max(largest);
            excess = self.excess[n].max(excess);
            growth = self.growth[n].max(growth);
            sum = sum + self.sum[n];
        }
        [largest, excess, growth, sum]
    }
}
