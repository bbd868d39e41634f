//! The convergence test of Newton's method, for each lane.

use crate::linalg::{Arithmetic, Kernel, dispatch};
use crate::scalar::Lanes;
use bytemuck::Zeroable;

/// If an unknown has changed by less than this fraction of its size since it was measured, its size
/// is still valid, and so are those of the kinematic states that depend on it. After a first
/// increment as large as the unknown, no size is valid.
const MAX_RELATIVE_MOVE: f64 = 1.0 / 8.0;

/// State of the convergence test. A lane that is neither active nor converged has failed.
#[derive(Clone, Copy)]
pub(in crate::irk) struct ConvergenceTest<E: Lanes> {
    /// Lanes that continue to iterate.
    pub active: E::Mask,
    /// Lanes that have converged.
    pub converged: E::Mask,
    /// Size of the last increment.
    last_increment: E,
    /// Contraction rate `θ`; zero if unknown.
    rate: E,
    /// Change of the unknowns since their sizes were measured, relative to their sizes; infinite if
    /// increments were as large.
    relative_move: E,
    /// Bound of the expected next increment.
    tolerance: E,
    /// Whether the equations are linear: their convergence is decided by the residual, not by the
    /// increment.
    linear: bool,
}

/// The kind of increment for a test.
#[derive(Clone, Copy)]
pub(in crate::irk) enum IncrementKind {
    /// The first increment of a step, with `new_factors` or older ones.
    First { new_factors: bool },
    /// A later increment.
    Subsequent,
    /// The last increment of lanes that have converged, measured again relative to the present
    /// sizes of the unknowns.
    Remeasured,
}

/// The result of a convergence test over all lanes.
#[derive(Clone, Copy, Default)]
pub(in crate::irk) struct Status {
    /// Whether some lane is active.
    pub active: bool,
    /// Whether some lane stopped in this test.
    pub lane_stopped: bool,
    /// Whether increments of some active lane grow, `θ > 1`.
    pub increments_grow: bool,
    /// Whether increments of some active lane stagnate, `θ ≥ 1/2`.
    pub stagnates: bool,
    /// Whether sizes of unknowns in some lane may be outdated.
    pub sizes_outdated: bool,
    /// Predicted number of iterations to the tolerance, in the slowest lane.
    pub predicted_iterations: f64,
}

impl<E: Lanes> ConvergenceTest<E> {
    /// Starts the test, with factors of contraction rate `rate`; zero if it is unknown.
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

    /// Updates the test with the `size` of an increment, and the expected size of the next one.
    #[inline]
    pub fn update(&mut self, kind: IncrementKind, size: E, expected_next: E) -> Status {
        let test = TestUpdate { test: self, kind, size, next: expected_next };
        // With one lane the status stays in registers.
        if const { E::LANES == 1 } { test.status() } else { dispatch(test) }
    }

    /// Marks stagnating lanes as converged if their residual is `satisfied`.
    pub fn accept_satisfied(&mut self, satisfied: E::Mask) {
        let accepted = E::and(self.stagnating_lanes(), satisfied);
        self.active = E::and(self.active, E::not(accepted));
        self.converged = E::or(self.converged, accepted);
    }

    #[inline(always)]
    fn stagnating_lanes(&self) -> E::Mask {
        E::and(self.active, E::le(E::from_f64(0.5), self.rate))
    }

    /// Returns the largest rate of the converged lanes; failed lanes do not affect the following
    /// steps of the others.
    pub fn slowest_rate(&self) -> f64 {
        let mut cell: E::Cell = Zeroable::zeroed();
        E::select(self.converged, self.rate, E::from_f64(0.0)).store(&mut cell);
        (0..E::LANES).fold(0.0, |rate, lane| E::lane(&cell, lane).max(rate))
    }
}

/// See [`ConvergenceTest::update`].
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
                    // The rate of the last step is valid for the same factors only, and too
                    // inaccurate to stop the iteration.
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

/// Returns the number of iterations at this rate until the size is below the tolerance, at most 64.
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
