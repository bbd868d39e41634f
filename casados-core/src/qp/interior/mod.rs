//! The primal-dual interior point with Mehrotra's predictor-corrector, whose linear systems are
//! solved by a Riccati recursion.

mod active;
mod border;
mod cholesky;
mod coupling;
mod curvature;
mod iterate;
mod kernels;
mod limits;
mod newton;
mod options;
mod pairs;
mod residuals;
mod riccati;
mod run;
mod scaling;
mod shared;
mod sides;
mod stage_factor;
mod store;
mod symmetric;
mod terms;
mod units;
mod vector;
mod verdict;

pub(crate) use iterate::{Iterate, at};
pub(crate) use kernels::{
    Columns, add_symmetric_product, add_transposed, scale, splat, subtract, subtract_column, symmetric,
};
#[cfg(feature = "alloc")]
pub(super) use kernels::{PADDING_COLUMNS, Part, Source, product};
pub use options::InteriorPointOptions;
pub(crate) use riccati::{Extent, InitialStateKind};
pub(crate) use sides::{
    ConstraintInterpretation, Counts, Inequalities, PenaltyMode, count, is_initial_state_fixed,
};
pub use store::Store;
#[cfg(feature = "alloc")]
pub(crate) use symmetric::Symmetric;
pub(crate) use vector::dot;

use super::check::check_all_bounds;
use super::error::{QpError, QpField};
use super::layout::{StageDims, end, exceeds_memory, take_mut};
use super::problem::QpView;
use super::solution::SolutionView;
use super::solver::{QpSolver, QpStart};
use super::statistics::QpStatistics;
use super::violation::{self, linear_penalties};
use crate::scalar::Real;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;
use core::marker::PhantomData;
use limits::ResidualTolerances;
use run::{Attempt, Run, Runs};
use units::Units;

/// A primal-dual interior point that exploits the structure of optimal control.
///
/// Each iteration costs one Riccati factorisation, `O(N (nx + nu)³)`, and two solves. With the
/// feature `alloc` its memory is on the heap; only the first call and calls with larger problems
/// allocate. Otherwise see [`InteriorPoint::in_memory`].
///
/// A warm start first takes the bounds with multipliers as the active set, and corrects the set by
/// semismooth Newton steps (Hintermüller, Ito, Kunisch, "The primal-dual active set strategy as a
/// semismooth Newton method", SIAM J. Optim. 13, 2002): a QP similar to the last one takes a single
/// factorisation. After [`active_sets`](InteriorPointOptions::active_sets) unsuccessful sets the
/// interior point follows. A cold start first tries the solution without active bounds, unless the
/// zero point violates one.
///
/// The multipliers of an infeasible problem grow in the direction of a certificate of infeasibility
/// (Farkas' lemma). If they are close to one, the problem is solved again with all bounds soft:
/// this locates the violated bounds, and its multipliers are the certificate.
///
/// ```
/// use casados::qp::{HeapInteriorPoint, HeapQp, HeapSolution, QpSolver, QpStart, StageDims};
///
/// // x₊ = x + u from x₀ = 1, two intervals, ½ Σ (x² + u²).
/// let mut dims = [StageDims::new(1, 1, 0); 3];
/// dims[2].nu = 0;
/// let mut qp = HeapQp::<f64>::new(&dims)?;
/// for mut stage in qp.stages_mut() {
///     stage.a_mut().set(0, 0, 1.0);
///     stage.b_mut().set(0, 0, 1.0);
///     stage.q_mut().set(0, 0, 1.0);
///     stage.r_mut().set(0, 0, 1.0);
/// }
/// qp.fix_initial_state(&[1.0])?;
/// let mut solution = HeapSolution::new(&dims)?;
/// HeapInteriorPoint::new().solve(qp.view(), QpStart::Cold, solution.view_mut())?;
/// // By Riccati's recursion: P₂ = 1, P₁ = 1.5, P₀ = 1.6, u₀ = −P₁/(1 + P₁) x₀.
/// let u0 = solution.stages().next().map_or(f64::NAN, |stage| stage.u[0]);
/// assert!((u0 + 0.6).abs() < 1e-7);
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Clone, Debug)]
pub struct InteriorPoint<T, N, I> {
    /// Options, which may be changed between calls.
    pub options: InteriorPointOptions,
    /// The permitted residual, if it is above the tolerance of the options.
    permitted_residual: T,
    /// The required residual, if it is below the tolerance of the options.
    required_residual: T,
    /// The limit of iterations per call, set by [`QpSolver::limit`].
    limit: Option<usize>,
    numbers: N,
    indices: I,
    number: PhantomData<T>,
}

/// An interior point with its memory on the heap.
///
/// ```
/// # use casados::qp::*;
/// # // x₊ = x + u from x₀ = 1, with |u| ≤ 0.4, three intervals of ½ (x² + 0.1 u²).
/// # let mut dims = [StageDims::new(1, 1, 0); 4];
/// # dims[3].nu = 0;
/// # let mut qp = HeapQp::<f64>::new(&dims)?;
/// # for mut stage in qp.stages_mut() {
/// #     stage.a_mut().set(0, 0, 1.0);
/// #     stage.b_mut().set(0, 0, 1.0);
/// #     stage.q_mut().set(0, 0, 1.0);
/// #     stage.r_mut().set(0, 0, 0.1);
/// #     stage.u_bounds_mut().set(0, -0.4, 0.4);
/// # }
/// # qp.fix_initial_state(&[1.0])?;
/// let (mut solver, mut solution) = (HeapInteriorPoint::new(), HeapSolution::new(&dims)?);
/// solver.options.tolerance = 1e-9;
/// solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
/// let u0 = solution.stages().next().map_or(f64::NAN, |stage| stage.u[0]);
/// assert!((u0 + 0.4).abs() < 1e-8);
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[cfg(feature = "alloc")]
pub type HeapInteriorPoint<T = f64> = InteriorPoint<T, Vec<T>, Vec<u32>>;

#[cfg(feature = "alloc")]
impl<T: Real> HeapInteriorPoint<T> {
    /// A solver without memory, which the first call allocates.
    #[must_use]
    pub fn new() -> Self {
        Self::in_memory(Vec::new(), Vec::new())
    }
}

#[cfg(feature = "alloc")]
impl<T: Real> Default for HeapInteriorPoint<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real, N, I> InteriorPoint<T, N, I> {
    /// Returns the numbers of elements and indices in the memory for a problem with these numbers
    /// of finite bounds (lower and upper bounds counted separately), soft bounds among them, and
    /// equations (pairs of equal hard bounds) except the fixed initial state.
    ///
    /// Locating the constraints that make a problem infeasible requires the memory for all bounds
    /// soft. Periodic states and shared controls, which require the feature `alloc`, take
    /// [`InteriorPoint::memory_of_coupling`] more.
    #[must_use]
    pub const fn memory(dims: &[StageDims], bounds: usize, soft: usize, equations: usize) -> (usize, usize) {
        if exceeds_memory(dims) {
            return (usize::MAX, usize::MAX);
        }
        let counts = Counts { lower: bounds, upper: 0, soft, equations };
        (Iterate::<T>::memory(dims, &counts) + end::<T>(dims).row, counts.indices())
    }
}

impl<T: Real, N, I> InteriorPoint<T, N, I> {
    /// Returns the additional length for these numbers of periodic states and shared controls.
    #[must_use]
    pub const fn memory_of_coupling(dims: &[StageDims], periodic: usize, shared: usize) -> usize {
        if exceeds_memory(dims) {
            return usize::MAX;
        }
        if periodic + shared == 0 { 0 } else { coupling::Coupling::<T>::memory(dims, periodic, shared) }
    }
}

impl<T: Real, N: Store<T>, I: Store<u32>> InteriorPoint<T, N, I> {
    /// A solver in given memory, of the lengths by [`InteriorPoint::memory`].
    pub fn in_memory(numbers: N, indices: I) -> Self {
        Self {
            options: InteriorPointOptions::new::<T>(),
            permitted_residual: T::ZERO,
            required_residual: T::from_f64(f64::INFINITY),
            limit: None,
            numbers,
            indices,
            number: PhantomData,
        }
    }

    /// Runs the method once; also returns whether the multipliers are a certificate of
    /// infeasibility, or, with the objective, suspected to be one.
    fn run(
        &mut self,
        qp: QpView<'_, T>,
        attempt: Attempt,
        over: &mut dyn FnMut() -> bool,
        solution: &mut SolutionView<'_, T>,
    ) -> (Result<QpStatistics, QpError>, bool) {
        let (mut result, mut infeasible) = (Ok(QpStatistics::default()), false);
        let ran = self.prepare_and_run(qp, attempt, over, solution, (&mut result, &mut infeasible));
        (ran.and(result), infeasible)
    }

    fn prepare_and_run(
        &mut self,
        qp: QpView<'_, T>,
        attempt: Attempt,
        over: &mut dyn FnMut() -> bool,
        solution: &mut SolutionView<'_, T>,
        (result, infeasible): (&mut Result<QpStatistics, QpError>, &mut bool),
    ) -> Result<(), QpError> {
        let no_bound = T::from_f64(self.options.no_bound);
        let reading = ConstraintInterpretation {
            fixed: is_initial_state_fixed(qp),
            penalties: attempt.penalties,
            no_bound,
        };
        let counts = count(qp, &reading);
        let extent = Extent::of::<T>(qp.dims);
        let length = Iterate::<T>::memory_of(qp, &counts) + extent.end.row;
        let numbers = self.numbers.at_least(length, QpField::Numbers)?;
        let mut indices = self.indices.at_least(counts.indices(), QpField::Indices)?;
        numbers.fill(T::ZERO);
        // Arrays of inequalities have any length: they follow the arrays of whole registers.
        let (mut numbers, mut of_inequalities) =
            numbers.split_at_mut_checked(length - counts.memory_len()).unwrap_or_default();
        let mut sides = Inequalities::new(counts, &mut of_inequalities, &mut indices);
        sides.list(qp, &reading);
        let given = attempt.penalties == PenaltyMode::Given;
        let rows = take_mut(&mut numbers, extent.end.row);
        let found = if self.options.scaling { scaling::find(qp, &reading, rows) } else { None };
        let units = match found {
            Some(objective) => Units { rows, objective: if given { objective } else { T::ONE } },
            None => Units::NONE,
        };
        sides.set_units(units, !given);
        let first = if reading.fixed { InitialStateKind::Fixed } else { InitialStateKind::Free };
        let mut iterate = Iterate::new(qp, &extent, first, sides, &mut numbers);
        (iterate.objective, iterate.units, iterate.measure) = (given, units.rows, units);
        let tolerance =
            T::from_f64(self.options.tolerance).min(self.required_residual).max(self.permitted_residual);
        let limits = ResidualTolerances::new(&self.options, tolerance, attempt.penalties, found.is_some());
        T::run_precompiled::<Runs>(Run {
            iterate: &mut iterate,
            options: &self.options,
            limits,
            over,
            attempt,
            solution,
            result,
            infeasible,
        });
        Ok(())
    }

    /// Tries to solve a problem again after a failed first attempt, or returns the final error.
    fn retry(
        &mut self,
        qp: QpView<'_, T>,
        start: QpStart,
        mut error: QpError,
        over: &mut dyn FnMut() -> bool,
        solution: &mut SolutionView<'_, T>,
    ) -> Result<QpStatistics, QpError> {
        let (locate, most) = (self.options.locate, self.options.max_iterations);
        let mut attempt = Attempt {
            penalties: PenaltyMode::Given,
            start: QpStart::Cold,
            proximal: start == QpStart::Cold,
            statistics: QpStatistics::default(),
            iterations: most,
            suspects: false,
        };
        let mut located = false;
        loop {
            let (QpError::MaxIterations { iterations, residuals }
            | QpError::Stalled { iterations, residuals }) = error
            else {
                return Err(error);
            };
            attempt.statistics.iterations = iterations;
            attempt.iterations = if locate { iterations.saturating_add(most) } else { most };
            let violates =
                residuals.inequalities.is_nan() || residuals.inequalities > 1e2 * self.options.tolerance;
            if locate && !located && violates {
                located = true;
                let soft = Attempt { penalties: PenaltyMode::Hard, proximal: true, ..attempt };
                if let (_, true) = self.run(qp, soft, over, solution)
                    && let (Some(worst), _) =
                        violation::largest_violation(qp, solution.v, &[], |place, row| {
                            linear_penalties(qp, place, row)
                        })
                    && worst.violation > self.options.tolerance
                {
                    return Err(worst.into());
                }
            }
            if iterations >= attempt.iterations {
                return Err(error);
            }
            error = match self.run(qp, attempt, over, solution).0 {
                Err(error) => error,
                solved => return solved,
            };
            if attempt.proximal {
                return Err(error);
            }
            attempt.proximal = true;
        }
    }
}

impl<T: Real, N: Store<T>, I: Store<u32>> QpSolver<T> for InteriorPoint<T, N, I> {
    fn solve_until(
        &mut self,
        qp: QpView<'_, T>,
        start: QpStart,
        mut solution: SolutionView<'_, T>,
        over: &mut dyn FnMut() -> bool,
    ) -> Result<QpStatistics, QpError> {
        self.options.check::<T>()?;
        if cfg!(not(feature = "alloc")) && qp.is_coupled() {
            return Err(QpError::Coupled);
        }
        check_all_bounds(qp)?;
        solution.check_dimensions(qp)?;
        let attempt = Attempt {
            penalties: PenaltyMode::Given,
            start,
            proximal: false,
            statistics: QpStatistics::default(),
            iterations: self.options.max_iterations,
            suspects: self.options.locate || self.limit.is_some(),
        };
        let attempt = match self.limit {
            Some(limit) => Attempt { iterations: limit.min(attempt.iterations), ..attempt },
            None => attempt,
        };
        let (result, suspected) = self.run(qp, attempt, over, &mut solution);
        let Err(error) = result else { return result };
        // Non-finite data is detected after a failure only, not in every call.
        super::check::check(qp)?;
        if self.limit.is_none() {
            return self.retry(qp, start, error, over, &mut solution);
        }
        let (worst, _) =
            violation::largest_violation(qp, solution.v, &[], |place, row| linear_penalties(qp, place, row));
        Err(worst.filter(|_| suspected).map_or(error, QpError::from))
    }

    fn limit(&mut self, iterations: Option<usize>) {
        self.limit = iterations;
    }

    fn permit(&mut self, tolerance: f64) {
        self.permitted_residual = T::from_f64(if tolerance > 0.0 { tolerance } else { 0.0 });
    }

    fn require(&mut self, tolerance: f64) {
        self.required_residual = T::from_f64(if tolerance > 0.0 { tolerance } else { f64::INFINITY });
    }
}
