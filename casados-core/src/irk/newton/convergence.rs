//! The convergence test of Newton's method, lane by lane.

use crate::linalg::{Arithmetic, Kernel, dispatch};
use crate::scalar::Lanes;
use bytemuck::Zeroable;

/// If an unknown has moved by less than this part of its size since it was measured, its size is
/// still valid, and so is that of kinematic states which follow from it. (Of an unknown that was no
/// larger than its first increment nothing is known.)
const MAX_RELATIVE_MOVE: f64 = 1.0 / 8.0;

/// What is known of every lane. One that is neither active nor has converged has failed.
#[derive(Clone, Copy)]
pub(in crate::irk) struct ConvergenceTest<E: Lanes> {
    /// Which lanes go on.
    pub active: E::Mask,
    /// Which have converged.
    pub converged: E::Mask,
    /// The increment before.
    last_increment: E,
    /// How fast increments shrink; zero if that is not known.
    rate: E,
    /// How far unknowns have moved since they were measured, in parts of their sizes; infinite if
    /// increments were as large.
    relative_move: E,
    /// What the next increment has to be below.
    tolerance: E,
    /// Of linear equations the residual tells, not the increment.
    linear: bool,
}

/// Which increment the test takes.
#[derive(Clone, Copy)]
pub(in crate::irk) enum IncrementKind {
    /// The first one of a step, with factors that are `new` or older ones.
    First { new_factors: bool },
    /// A later one.
    Subsequent,
    /// The last one again, in lanes that have converged, with the sizes that the unknowns have now.
    Remeasured,
}

/// What all lanes together have to say.
#[derive(Clone, Copy, Default)]
pub(in crate::irk) struct Status {
    /// Some lane goes on.
    pub active: bool,
    /// Some lane does no longer.
    pub lane_stopped: bool,
    /// Increments of some active lane grow.
    pub increments_grow: bool,
    /// Those of some active lane hardly shrink.
    pub stagnates: bool,
    /// In some lane unknowns may no longer be of the size that was measured.
    pub sizes_outdated: bool,
    /// How many more increments are expected until the tolerance, in the slowest lane.
    pub predicted_iterations: f64,
}

impl<E: Lanes> ConvergenceTest<E> {
    /// With factors for which increments shrank by `rate`; zero if that is not known.
    pub fn start(tolerance: f64, rate: f64, linear: bool) -> Self {
        let zero = E::from_f64(0.0);
        let (all, none) = (E::le(zero, zero), E::lt(zero, zero));
        let [rate, tolerance] = [rate, tolerance].map(E::from_f64);
        Self {
            active: all,
            converged: none,
            last_increment: zero,
            rate,
            relative_move: zero,
            tolerance,
            linear,
        }
    }

    /// After an increment of this `size`, and what is expected of the `next` one.
    #[inline]
    pub fn update(&mut self, kind: IncrementKind, size: E, expected_next: E) -> Status {
        let test = TestUpdate { test: self, kind, size, next: expected_next };
        // What one lane says is known in registers.
        if const { E::LANES == 1 } { test.status() } else { dispatch(test) }
    }

    /// Lanes that hardly make progress have converged where their equations are `satisfied`.
    pub fn accept_satisfied(&mut self, satisfied: E::Mask) {
        let accepted = E::and(self.stagnating_lanes(), satisfied);
        self.active = E::and(self.active, E::not(accepted));
        self.converged = E::or(self.converged, accepted);
    }

    #[inline(always)]
    fn stagnating_lanes(&self) -> E::Mask {
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
struct TestUpdate<'a, E: Lanes> {
    test: &'a mut ConvergenceTest<E>,
    kind: IncrementKind,
    size: E,
    next: E,
}

impl<E: Lanes> Kernel for TestUpdate<'_, E> {
    type Number = E;
    type Output = Status;
    #[inline(always)]
    fn run<A: Arithmetic>(self) -> Status {
        self.status()
    }
}

impl<E: Lanes> TestUpdate<'_, E> {
    #[inline(always)]
    fn status(self) -> Status {
        let Self { test, kind, size, next } = self;
        let ConvergenceTest {
            mut active,
            mut converged,
            last_increment: mut last,
            mut rate,
            relative_move: mut moved,
            tolerance,
            linear: exact,
        } = *test;
        let (zero, one, half) = (E::from_f64(0.0), E::from_f64(1.0), E::from_f64(0.5));
        let previously_active = active;
        match kind {
            IncrementKind::Remeasured => {
                let reactivated = E::and(converged, E::lt(last + last, size));
                converged = E::and(converged, E::not(reactivated));
                active = E::or(active, reactivated);
                last = E::select(reactivated, size, last);
            }
            IncrementKind::First { .. } | IncrementKind::Subsequent => {
                let mut expected_increment = size;
                if let IncrementKind::First { new_factors: new } = kind {
                    // What the last step found out holds for its factors only; and too roughly to
                    // stop by it.
                    rate = if new { zero } else { rate };
                    moved = E::select(E::lt(size, one), zero, E::from_f64(f64::INFINITY));
                } else {
                    moved = moved + size;
                    rate = E::select(active, size / last, rate);
                    let is_rounding =
                        E::and(E::le(size, E::from_f64(E::STAGNATION)), E::le(last, size + size));
                    expected_increment = E::select(is_rounding, zero, next);
                }
                let finite = size.is_finite();
                last = E::select(active, size, last);
                active = E::and(active, finite);
                if !exact {
                    let newly_converged = E::and(active, E::le(expected_increment, tolerance));
                    converged = E::or(converged, newly_converged);
                    active = E::and(active, E::not(newly_converged));
                }
            }
        }
        *test = ConvergenceTest {
            active,
            converged,
            last_increment: last,
            rate,
            relative_move: moved,
            tolerance,
            linear: exact,
        };
        Status {
            active: E::any(active),
            lane_stopped: E::any(E::and(previously_active, E::not(active))),
            increments_grow: E::any(E::and(active, E::lt(one, rate))),
            stagnates: E::any(E::and(active, E::le(half, rate))),
            sizes_outdated: !E::all(E::le(moved, E::from_f64(MAX_RELATIVE_MOVE))),
            predicted_iterations: predicted_iterations(active, last, rate, tolerance),
        }
    }
}

/// How many times a size is to be multiplied by a rate to be no larger than the tolerance; 64 times
/// at most.
#[inline(always)]
pub(in crate::irk) fn predicted_iterations<E: Lanes>(
    active: E::Mask,
    mut size: E,
    rate: E,
    tolerance: E,
) -> f64 {
    let mut count = 0.0;
    while count < 64.0 && E::any(E::and(active, E::lt(tolerance, size))) {
        (size, count) = (size * rate, count + 1.0);
    }
    count
}
