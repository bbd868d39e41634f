//! The convergence test of Newton's method, lane by lane.

use crate::linalg::{Arithmetic, Kernel, dispatch};
use crate::scalar::Lanes;
use bytemuck::Zeroable;

/// If an unknown has moved by less than this part of its size since it was measured, its size is
/// still valid, and so is that of kinematic states which follow from it. (Of an unknown that was no
/// larger than its first increment nothing is known.)
const LITTLE_MOVED: f64 = 1.0 / 8.0;

/// What is known of every lane. One that is neither active nor has converged has failed.
#[derive(Clone, Copy)]
pub(in crate::irk) struct ConvergenceTest<E: Lanes> {
    /// Which lanes go on.
    pub active: E::Mask,
    /// Which have converged.
    pub converged: E::Mask,
    /// The increment before.
    last: E,
    /// How fast increments shrink; zero if that is not known.
    rate: E,
    /// How far unknowns have moved since they were measured, in parts of their sizes; infinite if
    /// increments were as large.
    moved: E,
    /// What the next increment has to be below.
    tolerance: E,
    /// Of linear equations the residual tells, not the increment.
    exact: bool,
}

/// Which increment the test takes.
#[derive(Clone, Copy)]
pub(in crate::irk) enum IncrementKind {
    /// The first one of a step, with factors that are `new` or older ones.
    First { new: bool },
    /// A later one.
    Later,
    /// The last one again, in lanes that have converged, with the sizes that the unknowns have now.
    Again,
}

/// What all lanes together have to say.
#[derive(Clone, Copy, Default)]
pub(in crate::irk) struct Status {
    /// Some lane goes on.
    pub active: bool,
    /// Some lane does no longer.
    pub changed: bool,
    /// Increments of some active lane grow.
    pub grows: bool,
    /// Those of some active lane hardly shrink.
    pub stuck: bool,
    /// In some lane unknowns may no longer be of the size that was measured.
    pub moved: bool,
    /// How many more increments are expected until the tolerance, in the slowest lane.
    pub remaining: f64,
}

impl<E: Lanes> ConvergenceTest<E> {
    /// With factors for which increments shrank by `rate`; zero if that is not known.
    pub fn start(tolerance: f64, rate: f64, exact: bool) -> Self {
        let zero = E::from_f64(0.0);
        let (all, none) = (E::le(zero, zero), E::lt(zero, zero));
        let [rate, tolerance] = [rate, tolerance].map(E::from_f64);
        Self { active: all, converged: none, last: zero, rate, moved: zero, tolerance, exact }
    }

    /// After an increment of this `size`, and what is expected of the `next` one.
    #[inline]
    pub fn take(&mut self, kind: IncrementKind, size: E, next: E) -> Status {
        let test = Take { test: self, kind, size, next };
        // What one lane says is known in registers.
        if const { E::LANES == 1 } { test.status() } else { dispatch(test) }
    }

    /// Lanes that hardly make progress have converged where their equations are `satisfied`.
    pub fn accept(&mut self, satisfied: E::Mask) {
        let accepted = E::and(self.stuck(), satisfied);
        self.active = E::and(self.active, E::not(accepted));
        self.converged = E::or(self.converged, accepted);
    }

    #[inline(always)]
    fn stuck(&self) -> E::Mask {
        E::and(self.active, E::le(E::from_f64(0.5), self.rate))
    }

    /// The slowest rate of those that have converged: lanes that failed have no say in what the
    /// others do next.
    pub fn slowest_rate(&self) -> f64 {
        let mut cell: E::Cell = Zeroable::zeroed();
        E::select(self.converged, self.rate, E::from_f64(0.0)).store(&mut cell);
        (0..E::LANES).fold(0.0, |rate, lane| E::lane(&cell, lane).max(rate))
    }
}

/// See [`ConvergenceTest::take`].
struct Take<'a, E: Lanes> {
    test: &'a mut ConvergenceTest<E>,
    kind: IncrementKind,
    size: E,
    next: E,
}

impl<E: Lanes> Kernel for Take<'_, E> {
    type Number = E;
    type Output = Status;
    #[inline(always)]
    fn run<A: Arithmetic>(self) -> Status {
        self.status()
    }
}

impl<E: Lanes> Take<'_, E> {
    #[inline(always)]
    fn status(self) -> Status {
        let Self { test, kind, size, next } = self;
        let ConvergenceTest { mut active, mut converged, mut last, mut rate, mut moved, tolerance, exact } =
            *test;
        let (zero, one, half) = (E::from_f64(0.0), E::from_f64(1.0), E::from_f64(0.5));
        let before = active;
        match kind {
            IncrementKind::Again => {
                let back = E::and(converged, E::lt(last + last, size));
                converged = E::and(converged, E::not(back));
                active = E::or(active, back);
                last = E::select(back, size, last);
            }
            IncrementKind::First { .. } | IncrementKind::Later => {
                let mut expected = size;
                if let IncrementKind::First { new } = kind {
                    // What the last step found out holds for its factors only; and too roughly to
                    // stop by it.
                    rate = if new { zero } else { rate };
                    moved = E::select(E::lt(size, one), zero, E::from_f64(f64::INFINITY));
                } else {
                    moved = moved + size;
                    rate = E::select(active, size / last, rate);
                    let rounding = E::and(E::le(size, E::from_f64(E::STAGNATION)), E::le(last, size + size));
                    expected = E::select(rounding, zero, next);
                }
                let finite = size.is_finite();
                last = E::select(active, size, last);
                active = E::and(active, finite);
                if !exact {
                    let done = E::and(active, E::le(expected, tolerance));
                    converged = E::or(converged, done);
                    active = E::and(active, E::not(done));
                }
            }
        }
        *test = ConvergenceTest { active, converged, last, rate, moved, tolerance, exact };
        Status {
            active: E::any(active),
            changed: E::any(E::and(before, E::not(active))),
            grows: E::any(E::and(active, E::lt(one, rate))),
            stuck: E::any(E::and(active, E::le(half, rate))),
            moved: !E::all(E::le(moved, E::from_f64(LITTLE_MOVED))),
            remaining: remaining(active, last, rate, tolerance),
        }
    }
}

/// How many times a size is to be multiplied by a rate to be no larger than the tolerance; 64 times
/// at most.
#[inline(always)]
pub(in crate::irk) fn remaining<E: Lanes>(active: E::Mask, mut size: E, rate: E, tolerance: E) -> f64 {
    let mut count = 0.0;
    while count < 64.0 && E::any(E::and(active, E::lt(tolerance, size))) {
        (size, count) = (size * rate, count + 1.0);
    }
    count
}
