//! What an iteration of Newton's method does to the unknowns, and how far it went.

use super::follow::{leader, led};
use crate::linalg::{Arithmetic, AtRow, Kernel, each_row, follows, has_followers, slot};
use crate::model::{ArrayK, ArrayV, ArrayX, Dae};
use crate::scalar::{Lanes, Scalar};
use crate::shape::{Plain, Shape};

/// The residual in the slots of the equations; states that [follow](super::follow) others have none.
pub(super) struct PlaceResidual<'a, M: Dae, E: Plain, const S: usize> {
    pub f: &'a ArrayK<M, [E; S]>,
    pub increment: &'a mut ArrayK<M, [[E; 1]; S]>,
}

impl<M: Dae, E: Lanes, const S: usize> Kernel for PlaceResidual<'_, M, E, S> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(mut self) {
        each_row::<A, _>(&mut self);
    }
}

impl<M: Dae, E: Lanes, const S: usize> AtRow for PlaceResidual<'_, M, E, S> {
    const ROWS: usize = M::Shape::NK;
    const INSTRUCTIONS: usize = 2 * S;
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, equation: usize) {
        let slot = slot::<M>(equation);
        let follower = follows::<M>(slot);
        if follower.is_some_and(|follower| !follower.asked) {
            return;
        }
        if let (Some(to), Some(f)) = (self.increment.as_mut().get_mut(slot), self.f.as_ref().get(equation)) {
            let zero = [E::from_f64(0.0); S];
            to.as_flattened_mut().copy_from_slice(if follower.is_some() { &zero } else { f });
        }
    }
}

/// The largest residual, of what is a number.
pub(super) struct Largest<'a, E> {
    pub residual: &'a [E],
}

impl<E: Lanes> Kernel for Largest<'_, E> {
    type Number = E;
    type Output = E;
    #[inline(always)]
    fn run<A: Arithmetic>(self) -> E {
        let mut largest = [E::from_f64(0.0); 8];
        let (eights, rest) = self.residual.as_chunks::<8>();
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

/// `y ← y − Δ`
pub(super) struct Subtract<'a, E, const S: usize> {
    pub y: &'a mut [[E; S]],
    pub increment: &'a [[[E; 1]; S]],
}

impl<E: Lanes, const S: usize> Kernel for Subtract<'_, E, S> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        for (y, increment) in self.y.iter_mut().zip(self.increment) {
            for (y, [delta]) in y.iter_mut().zip(increment) {
                *y = *y - *delta;
            }
        }
    }
}

/// `y ← y − Δ`; the size of the increment, and of the one that is expected next.
pub(super) struct Update<'a, M: Dae, E: Lanes, const S: usize> {
    pub followed: &'a Followed<'a, M, E, S>,
    pub x: &'a ArrayX<M, E>,
    pub y: &'a mut ArrayK<M, [E; S]>,
    pub increment: &'a mut ArrayK<M, [[E; 1]; S]>,
    pub weights: &'a mut ArrayK<M, E>,
    pub sizes: &'a mut ArrayK<M, E>,
    pub active: E::Mask,
    pub h: E,
    pub floor: E,
    pub tolerance: E,
    pub full: bool,
    /// Whether weights are to be found, and nothing is known of the increment before.
    pub measure: bool,
}

impl<M: Dae, E: Lanes, const S: usize> Kernel for Update<'_, M, E, S> {
    type Number = E;
    type Output = (E, E);
    #[inline(always)]
    fn run<A: Arithmetic>(self) -> (E, E) {
        let Self { followed, x, y, increment, weights, sizes, active, h, floor, tolerance, full, measure } =
            self;
        let (zero, infinite) = (E::from_f64(0.0), E::from_f64(f64::INFINITY));
        let (own_y, own) = (part_mut::<M, _>(y.as_mut()), part_mut::<M, _>(increment.as_mut()));
        for (y, increment) in own_y.iter_mut().zip(own) {
            // In registers: the optimiser cannot know that they do not overlap.
            let (mut new, mut deltas) = (*y, *increment);
            for (y, [delta]) in new.iter_mut().zip(&mut deltas) {
                *delta = E::select(active, *delta, zero);
                *y = *y - *delta;
            }
            (*y, *increment) = (new, deltas);
        }
        if measure {
            let largest = Measure::<M, E, S> { followed, x, y, increment, weights, h, floor }.run::<A>();
            let (sizes, weights) = (part_mut::<M, _>(sizes.as_mut()), part::<M, _>(weights.as_ref()));
            for ((size, increment), &weight) in
                sizes.iter_mut().zip(part::<M, _>(increment.as_ref())).zip(weights)
            {
                *size = largest_of(increment) * weight;
            }
            return (largest, infinite);
        }
        // Four unknowns side by side, and the rest one by one.
        let (increments, last) = part::<M, _>(increment.as_ref()).as_chunks::<4>();
        let (weights, last_weights) = part::<M, _>(weights.as_ref()).as_chunks::<4>();
        let (sizes, last_sizes) = part_mut::<M, _>(sizes.as_mut()).as_chunks_mut::<4>();
        let mut some = Increments::none(tolerance, full);
        for ((increments, weights), sizes) in increments.iter().zip(weights).zip(sizes) {
            some.take(increments, weights, sizes);
        }
        let mut others = Increments::none(tolerance, full);
        for ((increment, weight), size) in last.iter().zip(last_weights).zip(last_sizes) {
            let (increment, weight) = (core::array::from_ref(increment), core::array::from_ref(weight));
            others.take(increment, weight, core::array::from_mut(size));
        }
        let ([largest, excess, sum], others) = (some.total(), others.total());
        let (largest, excess, sum) = (largest.max(others[0]), excess.max(others[1]), sum + others[2]);
        let number = E::le(sum.abs(), E::from_f64(f64::MAX));
        (E::select(number, largest, sum), E::select(E::le(excess, zero), zero, infinite))
    }
}

/// What belongs to unknowns that iterations find, as far as that is a part of it: those that [follow](super::follow) others have no increments.
#[inline(always)]
fn part<M: Dae, T>(of: &[T]) -> &[T] {
    of.get(const { led::<M>().0 }..const { led::<M>().1 }).unwrap_or_default()
}

#[inline(always)]
fn part_mut<M: Dae, T>(of: &mut [T]) -> &mut [T] {
    of.get_mut(const { led::<M>().0 }..const { led::<M>().1 }).unwrap_or_default()
}

/// What is known of the increments of some unknowns, in `N` strands.
struct Increments<E, const N: usize> {
    largest: [E; N],
    /// By how much one, and the one that is expected next, is too large; not positive if that is below the tolerance.
    excess: [E; N],
    /// The sum of what is not a number is not a number, which a maximum may lose.
    sum: [E; N],
    tolerance: E,
    full: bool,
}

impl<E: Lanes, const N: usize> Increments<E, N> {
    #[inline(always)]
    fn none(tolerance: E, full: bool) -> Self {
        let zero = E::from_f64(0.0);
        Self { largest: [zero; N], excess: [-tolerance; N], sum: [zero; N], tolerance, full }
    }

    /// Takes `N` unknowns into account, whose last increments had these sizes.
    #[inline(always)]
    fn take<const S: usize>(&mut self, increments: &[[[E; 1]; S]; N], weights: &[E; N], sizes: &mut [E; N]) {
        let old = *sizes;
        let (mut new, mut excess) = ([E::from_f64(0.0); N], [E::from_f64(0.0); N]);
        // Stage by stage, so that what is done to unknowns is done to vectors.
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
        // `θ size/(1 − θ)` with `θ = size/old`, or `θ² size`, against the tolerance; divided only where it must be.
        if self.full {
            for n in 0..N {
                let rate = new[n] / old[n];
                excess[n] = new[n] * rate * rate - self.tolerance;
            }
        } else {
            for n in 0..N {
                excess[n] = new[n] * new[n] - self.tolerance * (old[n] - new[n]);
            }
        }
        for n in 0..N {
            // Where increments hardly shrink, nothing is expected but that the next one is as large.
            let expected = excess[n].max(new[n] + new[n] - old[n]);
            let own = new[n] - self.tolerance;
            self.excess[n] = E::select(E::lt(own, expected), own, expected).max(self.excess[n]);
            self.largest[n] = new[n].max(self.largest[n]);
        }
        *sizes = new;
    }

    /// The largest increment, the largest excess, the sum.
    #[inline(always)]
    fn total(&self) -> [E; 3] {
        let (mut largest, mut excess, mut sum) = (E::from_f64(0.0), -self.tolerance, E::from_f64(0.0));
        for n in 0..N {
            largest = self.largest[n].max(largest);
            excess = self.excess[n].max(excess);
            sum = sum + self.sum[n];
        }
        [largest, excess, sum]
    }
}

/// The largest of all stages.
#[inline(always)]
fn largest_of<E: Lanes, const S: usize>(increment: &[[E; 1]; S]) -> E {
    let mut largest = E::from_f64(0.0);
    for [delta] in increment {
        largest = delta.abs().max(largest);
    }
    largest
}

/// The size of an increment relative to the unknowns as they are now.
pub(super) struct Measure<'a, M: Dae, E: Plain, const S: usize> {
    pub followed: &'a Followed<'a, M, E, S>,
    pub x: &'a ArrayX<M, E>,
    pub y: &'a ArrayK<M, [E; S]>,
    pub increment: &'a ArrayK<M, [[E; 1]; S]>,
    pub weights: &'a mut ArrayK<M, E>,
    pub h: E,
    pub floor: E,
}

impl<M: Dae, E: Lanes, const S: usize> Kernel for Measure<'_, M, E, S> {
    type Number = E;
    type Output = E;
    #[inline(always)]
    fn run<A: Arithmetic>(self) -> E {
        let Self { followed, x, y, increment, weights, h, floor } = self;
        let (zero, one, smallest) = (E::from_f64(0.0), E::from_f64(1.0), E::from_f64(E::SMALLEST));
        // A change of ẋ below this much of x/h rounds to none in x.
        let per_step = E::select(Scalar::eq(h, zero), zero, floor / h.abs());
        let (mut largest, mut sum) = ([zero; S], [zero; S]);
        let first = const { led::<M>().0 };
        let y = part::<M, _>(y.as_ref()).iter();
        let unknowns = y.zip(part::<M, _>(increment.as_ref())).zip(part_mut::<M, _>(weights.as_mut()));
        for (unknown, ((y, increment), weight)) in unknowns.enumerate() {
            let mut size =
                (x.as_ref().get(first + unknown).map_or(zero, |x| *x).abs() * per_step).max(smallest);
            for (y, [delta]) in y.iter().zip(increment) {
                size = y.abs().max(delta.abs().max(size));
            }
            *weight = one / size;
            for ((largest, sum), [delta]) in largest.iter_mut().zip(&mut sum).zip(increment) {
                let size = delta.abs() * *weight;
                *largest = size.max(*largest);
                *sum = *sum + size;
            }
        }
        if const { !has_followers::<M>() } {
            return size_of(largest, sum);
        }
        // `|Δ_q| ≤ |c| h ‖A‖ |Δ_v|`, relative to `k_q`: it counts where what `q` follows is much smaller than its change within the step.
        let &Followed { jacobian, points, a } = followed;
        let (mut most, mut norm) = (size_of(largest, sum), zero);
        for a in a {
            let mut sum = zero;
            for a in a {
                sum = sum + a.abs();
            }
            norm = sum.max(norm);
        }
        norm = E::from_f64(TYPICAL) * norm * h.abs();
        for state in 0..M::STRUCTURE.elimination.followers.len() {
            let Some((leader, minus_c)) = leader::<M, E, S>(state, jacobian) else { continue };
            let Some(weight) = weights.as_mut().get_mut(leader) else { continue };
            let mut size = (x.as_ref().get(state).map_or(zero, |x| *x).abs() * per_step).max(smallest);
            for k in points.as_ref().get(state).into_iter().flatten() {
                size = k.abs().max(size);
            }
            let bound = norm * minus_c.abs();
            if E::any(E::lt(*weight * size, bound))
                && let Some(increment) = increment.as_ref().get(leader)
            {
                *weight = (bound / size).max(*weight);
                most = (largest_of(increment) * *weight).max(most);
            }
        }
        most
    }
}

/// So much of their bound increments of followers typically are: `Σ_j a_ij Δ_j` sums up to half of the largest `Σ_j |a_ij| |Δ_j|` if they have one
/// sign at all stages, and less if not. (With the bound itself 5 masses take an iteration more in each step than their own increments ask for.)
const TYPICAL: f64 = 0.25;

/// Who [follows](super::follow) unknowns, whose increments count for them too.
pub(super) struct Followed<'a, M: Dae, E: Plain, const S: usize> {
    pub jacobian: &'a M::Jacobian<[E; S]>,
    /// Where their `k` are.
    pub points: &'a ArrayV<M, [E; S]>,
    pub a: &'a [[E; S]; S],
}

/// The largest of all stages, or what is not a number.
#[inline(always)]
fn size_of<E: Lanes, const S: usize>(largest: [E; S], sum: [E; S]) -> E {
    let zero = E::from_f64(0.0);
    let (mut total, mut most) = (zero, zero);
    for (&largest, &sum) in largest.iter().zip(&sum) {
        (total, most) = (total + sum, largest.max(most));
    }
    E::select(E::le(total, E::from_f64(f64::MAX)), most, total)
}
