//! Problems solved side by side in SIMD lanes: those whose only bounds are bounds of controls.
//!
//! | | |
//! | --- | --- |
//! | `group` | a problem in each lane, and the solution for given active sets |
//! | `sets` | active sets, and residuals of the optimality conditions |
//! | `transfer` | transfer of problems into lanes, and of solutions back |
//! | `cells` | products of matrices of registers |
//!
//! The method is Newton's for `min(s, λ) = 0`, as in [`interior::active`](super::interior) (M.
//! Hintermüller, K. Ito, K. Kunisch, "The primal-dual active set strategy as a semismooth Newton
//! method", SIAM J. Optim. 13, 2002), started without active bounds, or with those of a warm start.
//! A problem of this kind has a feasible point and, if all pivots are positive, a unique solution.
//!
//! Finished lanes idle until half of a group is finished; then the remaining problems form new
//! groups, each with its active set. A problem whose sets do not settle, with a weak pivot or with
//! non-finite numbers is solved alone afterwards, with all features and errors of a single solve.

mod cells;
mod group;
mod sets;
mod transfer;

use super::error::QpError;
use super::instance::QpInstance;
use super::interior::{InteriorPointOptions, is_initial_state_fixed};
use super::layout::StageOffsetsIter;
use super::memory::{try_reserve, try_resize};
use super::solver::QpStart;
use super::stage::ConstraintVector;
use super::statistics::{QpStatistics, Residuals};
use crate::qp::layout::part;
use crate::scalar::lanes::second_level_cache;
use crate::scalar::{Packed, Real, Registers, compiled};
use alloc::vec::Vec;
use group::Group;
pub use group::Size;
use sets::LaneResiduals;
use transfer::MAX_LANES;

/// The maximum number of active sets; nearly all problems whose sets settle need fewer.
const MAX_ACTIVE_SETS: usize = 16;
/// The fraction of the second-level cache that a group may use.
const CACHE_FRACTION: f64 = 5.0 / 8.0;
/// The fraction of the tolerance for residuals: a single solve is as accurate, or more so in units.
const TOLERANCE_FRACTION: f64 = 0.1;

/// The memory of groups.
#[derive(Clone, Debug)]
pub struct LaneWorkspace<T> {
    numbers: Vec<T>,
    /// Active sets of all problems.
    sets: Vec<i8>,
    /// Indices of the problems that are not solved yet.
    pending: Vec<u32>,
    /// Indices of the problems to be solved alone.
    left_for_single_solves: Vec<u32>,
}

impl<T> Default for LaneWorkspace<T> {
    fn default() -> Self {
        Self {
            numbers: Vec::new(),
            sets: Vec::new(),
            pending: Vec::new(),
            left_for_single_solves: Vec::new(),
        }
    }
}

/// Returns the dimensions of a problem that can be solved side by side with others: its initial
/// state is fixed, other states have no bounds, bounds of controls are hard and not equal.
pub fn size<T: Real>(instance: &QpInstance<T>, options: &InteriorPointOptions) -> Option<Size> {
    let QpInstance { qp, solution } = instance;
    let qp = qp.view();
    let size = Size::of(qp.dims)?;
    let is_plain = options.active_sets > 0 && options.max_iterations > 0 && options.tolerance > 0.0;
    if !is_plain || qp.is_coupled() || solution.dims() != qp.dims || !is_initial_state_fixed(qp) {
        return None;
    }
    let (infinity, none) = (T::from_f64(f64::INFINITY), T::from_f64(options.no_bound));
    for place in StageOffsetsIter::<T>::new(qp.dims) {
        let variables = if place.next > 0 { place.n } else { place.nx };
        let vector = |row| part(qp.data, place.data + place.constraint_vector_begin(row), variables);
        let (lower, upper) = (vector(ConstraintVector::Lower), vector(ConstraintVector::Upper));
        // Evaluated without a branch for each number.
        let mut good = true;
        for (&lower, &upper) in lower.iter().zip(upper) {
            good &= (lower <= upper) & (lower < infinity) & (upper > -infinity);
        }
        for (&lower, &upper) in lower.iter().zip(upper).skip(place.nx) {
            good &= lower < upper;
        }
        if place.stage > 0 {
            for (&lower, &upper) in lower.iter().zip(upper).take(place.nx) {
                good &= (lower <= -none) & (upper >= none);
            }
        }
        for row in [ConstraintVector::LowerLinear, ConstraintVector::UpperLinear] {
            let penalties = vector(row);
            for &penalty in penalties {
                good &= penalty >= T::ZERO;
            }
            for &penalty in penalties.get(place.nx..).unwrap_or_default() {
                good &= penalty == infinity;
            }
        }
        for row in [ConstraintVector::LowerQuadratic, ConstraintVector::UpperQuadratic] {
            for &penalty in vector(row) {
                good &= (penalty >= T::ZERO) & (penalty < infinity);
            }
        }
        if !good {
            return None;
        }
    }
    Some(size)
}

/// Solves problems of one size, as by [`size`]; the unsolved ones are in [`LaneWorkspace::alone`].
///
/// # Errors
/// [`QpError::OutOfMemory`]
pub fn solve<T: Real>(
    together: &mut LaneWorkspace<T>,
    size: Size,
    problems: (&mut [QpInstance<T>], &mut [Result<QpStatistics, QpError>]),
    (options, start): (&InteriorPointOptions, QpStart),
) -> Result<(), QpError> {
    let count = problems.0.len();
    // One more register, to align the first one to a cache line.
    let length = size.cells().saturating_add(1).saturating_mul(MAX_LANES);
    try_resize(&mut together.numbers, length)?;
    try_resize(&mut together.sets, count.saturating_mul(size.intervals * size.nu))?;
    for list in [&mut together.pending, &mut together.left_for_single_solves] {
        list.clear();
        try_reserve(list, count)?;
    }
    together.pending.extend((0..count).map(|index| index as u32));
    T::run_precompiled::<Solves>(Solve { together, size, problems, options, start });
    Ok(())
}

impl<T> LaneWorkspace<T> {
    /// Returns the problems of the last call that must be solved alone.
    pub fn unsolved_indices(&self) -> impl Iterator<Item = usize> {
        self.left_for_single_solves.iter().map(|&index| index as usize)
    }
}

/// The arguments of [`solve`].
pub struct Solve<'r, T: Real> {
    together: &'r mut LaneWorkspace<T>,
    size: Size,
    problems: (&'r mut [QpInstance<T>], &'r mut [Result<QpStatistics, QpError>]),
    options: &'r InteriorPointOptions,
    start: QpStart,
}

compiled! {
    /// See [`Solve`].
    pub Solves: Solve<'r, T>
}

impl<T: Real> Registers<T> for Solve<'_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(mut self) {
        let bytes = self.size.cells().saturating_mul(size_of::<E::Cell>());
        if E::LANES < 2 || bytes as f64 > CACHE_FRACTION * second_level_cache() as f64 {
            core::mem::swap(&mut self.together.pending, &mut self.together.left_for_single_solves);
            return;
        }
        let mut numbers = core::mem::take(&mut self.together.numbers);
        let skipped = numbers.as_ptr().align_offset(64).min(MAX_LANES);
        let cells = E::cells_mut(numbers.get_mut(skipped..).unwrap_or_default());
        let mut group = Group::new(self.size, cells.get_mut(..self.size.cells()).unwrap_or_default());
        for cell in &mut *group.hessian {
            E::from_f64(0.0).store(cell);
        }
        let mut first = true;
        while !self.together.pending.is_empty() {
            self.iterate_pending::<E>(&mut group, first);
            first = false;
        }
        self.together.numbers = numbers;
    }
}

impl<T: Real> Solve<'_, T> {
    /// Iterates on all pending problems, group by group.
    #[inline(always)]
    fn iterate_pending<E: Packed<T>>(&mut self, group: &mut Group<'_, E::Cell>, first: bool) {
        let (count, mut kept) = (self.together.pending.len(), 0);
        for begin in (0..count).step_by(E::LANES) {
            let mut indices = [0; MAX_LANES];
            let members = E::LANES.min(count - begin);
            for (to, &index) in indices.iter_mut().zip(part(&self.together.pending, begin, members)) {
                *to = index as usize;
            }
            let indices = indices.get(..members).unwrap_or_default();
            self.load_problems::<E>(group, indices);
            let mut convex = (1u32 << members) - 1;
            if first && self.start == QpStart::Warm {
                convex = self.convex_lanes::<E>(group, indices);
            }
            self.load_active_sets::<E>(group, indices, first);
            let left = self.iterate::<E>(group, indices, convex, count > E::LANES);
            for (lane, &index) in indices.iter().enumerate().filter(|(lane, _)| left >> lane & 1 == 1) {
                let sets = self.size.intervals * self.size.nu;
                let set = self.together.sets.get_mut(index * sets..).and_then(|rest| rest.get_mut(..sets));
                group.store_active_set::<T, E>(lane, set.unwrap_or_default());
                if let Some(place) = self.together.pending.get_mut(kept) {
                    *place = index as u32;
                }
                kept += 1;
            }
        }
        self.together.pending.truncate(kept);
    }

    /// Writes problems into the lanes; unused lanes repeat the last problem.
    #[inline(always)]
    fn load_problems<E: Packed<T>>(&self, group: &mut Group<'_, E::Cell>, indices: &[usize]) {
        let mut data: [&[T]; MAX_LANES] = [&[]; MAX_LANES];
        let (mut last, mut dims): (&[T], _) = (&[], &[][..]);
        for (lane, data) in data.iter_mut().enumerate() {
            if let Some(instance) = indices.get(lane).and_then(|&index| self.problems.0.get(index)) {
                (last, dims) = (instance.qp.view().data, instance.qp.dims());
            }
            *data = last;
        }
        group.write::<T, E>(dims, &data, self.options.no_bound);
    }

    /// Returns the lanes with convex problems, as bits: their pivots without active bounds are not
    /// weak. A cold start begins with this test. The other problems are left to be solved alone.
    #[inline(always)]
    fn convex_lanes<E: Packed<T>>(&mut self, group: &mut Group<'_, E::Cell>, indices: &[usize]) -> u32 {
        group.backward::<E>();
        let weak =
            group.has_small_pivot.first().map_or([0.0; MAX_LANES], |weak| lanes::<T, E>(E::load(weak)));
        let mut convex = 0;
        for (lane, (&index, &weak)) in indices.iter().zip(&weak).enumerate() {
            if weak == 0.0 {
                convex |= 1 << lane;
            } else {
                self.together.left_for_single_solves.push(index as u32);
            }
        }
        convex
    }

    /// Writes the initial active sets: those of the previous group, or of a warm start.
    #[inline(always)]
    fn load_active_sets<E: Packed<T>>(&self, group: &mut Group<'_, E::Cell>, indices: &[usize], first: bool) {
        let Size { nx, nu, intervals } = self.size;
        for (lane, &index) in indices.iter().enumerate() {
            if !first {
                let set = part(&self.together.sets, index * intervals * nu, intervals * nu);
                group.load_active_set::<T, E>(lane, set.iter().copied());
            } else if let (QpStart::Warm, Some(instance)) = (self.start, self.problems.0.get(index)) {
                let least = T::from_f64(self.options.tolerance);
                let [lower, upper] = instance.solution.sides();
                let places = StageOffsetsIter::<T>::new(instance.qp.dims()).take(intervals);
                let rows = places.flat_map(|place| place.row + nx..place.row + nx + nu);
                let is_at = |side: &[T], row: usize| side.get(row).is_some_and(|&force| force > least);
                let set = rows.map(|row| i8::from(is_at(upper, row)) - i8::from(is_at(lower, row)));
                group.load_active_set::<T, E>(lane, set);
            }
        }
    }

    /// Iterates on the lanes in `left` until all their problems are solved or given up, or, if
    /// others are pending, until half of the group is. Returns the remaining lanes, as bits.
    #[inline(always)]
    fn iterate<E: Packed<T>>(
        &mut self,
        group: &mut Group<'_, E::Cell>,
        indices: &[usize],
        mut left: u32,
        others: bool,
    ) -> u32 {
        let tolerance = E::from_f64(0.5 * TOLERANCE_FRACTION * self.options.tolerance);
        loop {
            group.solve::<E>();
            let changes = lanes::<T, E>(group.update_active_sets::<E>(tolerance));
            let weak =
                group.has_small_pivot.first().map_or([0.0; MAX_LANES], |weak| lanes::<T, E>(E::load(weak)));
            let mut settled = 0;
            let going = left;
            for (lane, &index) in indices.iter().enumerate().filter(|(lane, _)| going >> lane & 1 == 1) {
                let (Some(changes), Some(weak)) = (changes.get(lane), weak.get(lane)) else { return 0 };
                let Some(Ok(statistics)) = self.problems.1.get_mut(index) else { return 0 };
                statistics.iterations += 1;
                let is_over = statistics.iterations >= MAX_ACTIVE_SETS.min(self.options.max_iterations);
                if *changes == 0.0 && *weak == 0.0 {
                    settled |= 1 << lane;
                } else if changes.is_nan() || *weak != 0.0 || is_over {
                    left &= !(1 << lane);
                    self.together.left_for_single_solves.push(index as u32);
                }
            }
            if settled != 0 {
                self.store::<E>(group, indices, settled);
                left &= !settled;
            }
            if left == 0 || (others && 2 * left.count_ones() as usize <= indices.len()) {
                return left;
            }
        }
    }

    /// Evaluates and stores the solutions of lanes whose sets have settled.
    #[inline(always)]
    fn store<E: Packed<T>>(&mut self, group: &mut Group<'_, E::Cell>, indices: &[usize], settled: u32) {
        let LaneResiduals { stationarity, dynamics, inequalities, objective } = group.residuals::<E>();
        let of = [stationarity, dynamics, inequalities, objective].map(|value| lanes::<T, E>(value));
        for (lane, &index) in indices.iter().enumerate().filter(|(lane, _)| settled >> lane & 1 == 1) {
            let [stationarity, dynamics, inequalities, objective] =
                of.map(|lanes| lanes.get(lane).copied().unwrap_or(f64::NAN));
            let residuals = Residuals { stationarity, dynamics, inequalities, complementarity: 0.0 };
            let is_small = residuals.largest() <= TOLERANCE_FRACTION * self.options.tolerance;
            let problem = (self.problems.0.get_mut(index), self.problems.1.get_mut(index));
            let (Some(instance), Some(Ok(statistics))) = problem else { return };
            if !(is_small && objective.is_finite()) {
                self.together.left_for_single_solves.push(index as u32);
                continue;
            }
            let iterations = statistics.iterations;
            *statistics = QpStatistics {
                iterations,
                active_sets: iterations,
                factorisations: iterations,
                residuals,
                objective,
                ..QpStatistics::default()
            };
            group.read::<T, E>(lane, &mut instance.solution.view_mut());
        }
    }
}

/// Returns the numbers of the lanes.
#[inline(always)]
fn lanes<T: Real, E: Packed<T>>(register: E) -> [f64; MAX_LANES] {
    let mut cell: E::Cell = bytemuck::Zeroable::zeroed();
    register.store(&mut cell);
    let mut all = [0.0; MAX_LANES];
    for (lane, to) in all.iter_mut().enumerate().take(E::LANES) {
        *to = E::lane(&cell, lane);
    }
    all
}
