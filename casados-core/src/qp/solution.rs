//! Solutions: variables and multipliers.

mod stage;

pub use stage::{SolutionStage, SolutionStageMut};

use super::error::{QpError, QpField};
use super::layout::{
    StageDims, StageOffsets, StageOffsetsIter, end, exceeds_memory, move_to_front, part, part_mut, take_mut,
};
use super::problem::QpView;
use crate::scalar::Real;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;
use core::marker::PhantomData;

/// A point of a QP and its multipliers, in memory of the caller: the start and the result of
/// solvers.
///
/// Signs: the gradient of the Lagrangian at stage `k` is
/// `H v + h + [A B]ᵀ π_{k+1} − (π_k, 0) + λ_upper − λ_lower + [C D]ᵀ (λ_upper − λ_lower) = 0`, with
/// `π_0 = 0` and all `λ ≥ 0`.
///
/// ```
/// use casados::qp::{HeapSolution, StageDims};
///
/// let mut dims = [StageDims::new(2, 1, 0); 4];
/// dims[3].nu = 0;
/// let mut solution = HeapSolution::<f64>::new(&dims)?;
/// assert_eq!(solution.stages().map(|stage| stage.x.len() + stage.u.len()).sum::<usize>(), 11);
/// solution.shift(); // by a stage: where the next sampling instant begins
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Solution<T, D, M> {
    dims: D,
    memory: M,
    /// The lengths of all `v`, of all `π`, and of the multipliers of lower (or upper) bounds.
    lengths: [usize; 3],
    number: PhantomData<T>,
}

/// A solution with its memory on the heap.
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
/// solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
/// let states: Vec<f64> = solution.stages().map(|stage| stage.x[0]).collect();
/// assert!((states[0] - 1.0).abs() < 1e-9 && (states[1] - 0.6).abs() < 1e-6);
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[cfg(feature = "alloc")]
pub type HeapSolution<T = f64> = Solution<T, Vec<StageDims>, Vec<T>>;

/// A solution, for solvers.
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
/// /// A function over any solver of QPs: the first control.
/// fn first_control(solver: &mut impl QpSolver<f64>, qp: &HeapQp) -> Result<f64, QpError> {
///     let mut solution = HeapSolution::new(qp.dims())?;
///     let view: SolutionView<'_, f64> = solution.view_mut();
///     solver.solve(qp.view(), QpStart::Cold, view)?;
///     Ok(solution.stages().next().map_or(f64::NAN, |stage| stage.u[0]))
/// }
/// assert!((first_control(&mut HeapInteriorPoint::new(), &qp)? + 0.4).abs() < 1e-6);
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Debug)]
pub struct SolutionView<'a, T> {
    pub(crate) dims: &'a [StageDims],
    /// All `v = (x, u)`.
    pub(crate) v: &'a mut [T],
    /// All `π`.
    pub(crate) dynamics: &'a mut [T],
    /// Multipliers of lower bounds.
    pub(crate) lower: &'a mut [T],
    /// Multipliers of upper bounds.
    pub(crate) upper: &'a mut [T],
}

#[cfg(feature = "alloc")]
impl<T: Real> HeapSolution<T> {
    /// A solution with its memory on the heap, all zero.
    ///
    /// # Errors
    /// [`QpError::OutOfMemory`]
    pub fn new(dims: &[StageDims]) -> Result<Self, QpError> {
        Self::in_memory(super::memory::copy(dims)?, super::memory::zeros(Self::memory(dims))?)
    }
}

impl<T: Real, D, M> Solution<T, D, M> {
    /// Returns the length of a solution; `usize::MAX` if it overflows.
    #[must_use]
    pub const fn memory(dims: &[StageDims]) -> usize {
        if exceeds_memory(dims) {
            return usize::MAX;
        }
        let end = end::<T>(dims);
        end.v + end.dynamics + 2 * end.row
    }
}

impl<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]>> Solution<T, D, M> {
    /// Returns all `v`, and all `π`.
    pub(crate) fn variables_and_costates(&self) -> (&[T], &[T]) {
        let ([v, dynamics, _], memory) = (self.lengths, self.memory.as_ref());
        (part(memory, 0, v), part(memory, v, dynamics))
    }
    /// Returns all stages in order.
    pub fn stages(&self) -> impl DoubleEndedIterator<Item = SolutionStage<'_, T>> + ExactSizeIterator {
        let ([_, _, row], memory) = (self.lengths, self.memory.as_ref());
        let (v, dynamics) = self.variables_and_costates();
        let begin = v.len() + dynamics.len();
        let (lower, upper) = (part(memory, begin, row), part(memory, begin + row, row));
        StageOffsetsIter::<T>::new(self.dims.as_ref()).map(move |p| SolutionStage {
            x: part(v, p.v, p.nx),
            u: part(v, p.v + p.nx, p.nu),
            dynamics: part(dynamics, p.dynamics, p.next),
            x_lower: part(lower, p.row, p.nx),
            x_upper: part(upper, p.row, p.nx),
            u_lower: part(lower, p.row + p.nx, p.nu),
            u_upper: part(upper, p.row + p.nx, p.nu),
            g_lower: part(lower, p.row + p.ld, p.ng),
            g_upper: part(upper, p.row + p.ld, p.ng),
        })
    }
    /// Returns a borrowed solution.
    pub(crate) fn borrowed(&self) -> Solution<T, &[StageDims], &[T]> {
        Solution {
            dims: self.dims.as_ref(),
            memory: self.memory.as_ref(),
            lengths: self.lengths,
            number: PhantomData,
        }
    }
}

impl<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Solution<T, D, M> {
    /// A solution in given memory, of at least [`Solution::memory`] elements.
    ///
    /// # Errors
    /// [`QpError::Dimension`] if the memory is too short.
    pub fn in_memory(dims: D, mut memory: M) -> Result<Self, QpError> {
        let (expected, found) = (Self::memory(dims.as_ref()), memory.as_ref().len());
        if found < expected {
            return Err(QpError::Dimension { field: QpField::Solution, stage: 0, expected, found });
        }
        memory.as_mut().fill(T::ZERO);
        let StageOffsets { v, dynamics, row, .. } = end::<T>(dims.as_ref());
        Ok(Self { dims, memory, lengths: [v, dynamics, row], number: PhantomData })
    }
    /// Returns the dimensions of the stages.
    #[must_use]
    pub fn dims(&self) -> &[StageDims] {
        self.dims.as_ref()
    }
    /// Returns a view for solvers.
    pub fn view_mut(&mut self) -> SolutionView<'_, T> {
        let ([v, dynamics, row], mut rest) = (self.lengths, self.memory.as_mut());
        SolutionView {
            dims: self.dims.as_ref(),
            v: take_mut(&mut rest, v),
            dynamics: take_mut(&mut rest, dynamics),
            lower: take_mut(&mut rest, row),
            upper: take_mut(&mut rest, row),
        }
    }
    /// Returns the multipliers of lower and of upper bounds.
    #[cfg(feature = "alloc")]
    pub(super) fn sides(&self) -> [&[T]; 2] {
        let [v, dynamics, row] = self.lengths;
        [0, row].map(|side| part(self.memory.as_ref(), v + dynamics + side, row))
    }
    /// Returns all numbers, including padding.
    pub(crate) fn all_numbers(&self) -> &[T] {
        self.memory.as_ref()
    }
    /// Copies another solution of the same dimensions.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        super::layout::copy_common(self.memory.as_mut(), other.memory.as_ref());
    }
    /// Writes every number as a function of those of two solutions of the same dimensions.
    pub(crate) fn combine(&mut self, a: &Self, b: &Self, f: impl Fn(T, T) -> T) {
        let pairs = a.memory.as_ref().iter().zip(b.memory.as_ref());
        for (target, (&a, &b)) in self.memory.as_mut().iter_mut().zip(pairs) {
            *target = f(a, b);
        }
    }
    /// Updates all multipliers by a function of their values and those of another solution of the
    /// same dimensions.
    pub(crate) fn update_multipliers(&mut self, other: &Self, f: impl Fn(T, T) -> T) {
        let begin = self.lengths[0];
        let (targets, others) = (self.memory.as_mut(), other.memory.as_ref());
        for (target, &other) in targets.iter_mut().zip(others).skip(begin) {
            *target = f(*target, other);
        }
    }
    /// Returns all multipliers.
    pub(crate) fn multipliers_mut(&mut self) -> &mut [T] {
        let begin = self.lengths[0];
        self.memory.as_mut().get_mut(begin..).unwrap_or_default()
    }
    /// Returns a stage.
    #[must_use]
    pub fn stage(&self, stage: usize) -> Option<SolutionStage<'_, T>> {
        self.stages().nth(stage)
    }
    /// Returns a mutable stage.
    pub fn stage_mut(&mut self, stage: usize) -> Option<SolutionStageMut<'_, T>> {
        let place = StageOffsetsIter::<T>::new(self.dims.as_ref()).nth(stage)?;
        Some(self.view_mut().into_stage(place))
    }
    /// Calls a function for all mutable stages in order.
    #[cfg(feature = "alloc")]
    pub(crate) fn each_stage_mut(&mut self, mut write: impl FnMut(SolutionStageMut<'_, T>)) {
        let mut view = self.view_mut();
        for place in StageOffsetsIter::<T>::new(view.dims) {
            write(view.reborrow().into_stage(place));
        }
    }
    /// Sets states, controls and multipliers to zero, as for a new seed.
    pub fn clear(&mut self) {
        self.memory.as_mut().fill(T::ZERO);
    }
    /// Shifts the solution by one stage, as the start for the QP of the next sampling instant. The
    /// last stages are unchanged. Stages of different dimensions are not shifted into each other.
    pub fn shift(&mut self) {
        let SolutionView { dims, v, dynamics, lower, upper } = self.view_mut();
        let places = StageOffsetsIter::<T>::new(dims);
        for (here, there) in places.clone().zip(places.skip(1)) {
            if (here.nx, here.nu, here.ng) == (there.nx, there.nu, there.ng) {
                move_to_front(v, there.v, here.v, there.ld);
                move_to_front(lower, there.row, here.row, there.rows);
                move_to_front(upper, there.row, here.row, there.rows);
            }
            if here.next == there.next {
                move_to_front(dynamics, there.dynamics, here.dynamics, there.ld_next);
            }
        }
    }
}

impl<'a, T> SolutionView<'a, T> {
    fn into_stage(self, p: StageOffsets) -> SolutionStageMut<'a, T> {
        let mut v = part_mut(self.v, p.v, p.n);
        let mut lower = part_mut(self.lower, p.row, p.rows);
        let mut upper = part_mut(self.upper, p.row, p.rows);
        let padding = p.ld - p.n;
        let x_lower = take_mut(&mut lower, p.nx);
        let x_upper = take_mut(&mut upper, p.nx);
        let u_lower = take_mut(&mut lower, p.nu);
        let u_upper = take_mut(&mut upper, p.nu);
        take_mut(&mut lower, padding);
        take_mut(&mut upper, padding);
        SolutionStageMut {
            x: take_mut(&mut v, p.nx),
            u: take_mut(&mut v, p.nu),
            dynamics: part_mut(self.dynamics, p.dynamics, p.next),
            x_lower,
            x_upper,
            u_lower,
            u_upper,
            g_lower: take_mut(&mut lower, p.ng),
            g_upper: take_mut(&mut upper, p.ng),
        }
    }
    /// Checks that the dimensions are those of the QP.
    pub(super) fn check_dimensions(&self, qp: QpView<'_, T>) -> Result<(), QpError> {
        let (expected, found) = (qp.dims.len(), self.dims.len());
        if expected != found {
            return Err(QpError::Dimension { field: QpField::Stages, stage: 0, expected, found });
        }
        for (stage, (a, b)) in qp.dims.iter().zip(self.dims).enumerate() {
            for (field, expected, found) in
                [(QpField::X, a.nx, b.nx), (QpField::U, a.nu, b.nu), (QpField::GeneralBounds, a.ng, b.ng)]
            {
                if expected != found {
                    return Err(QpError::Dimension { field, stage, expected, found });
                }
            }
        }
        Ok(())
    }
    /// Returns a view with a shorter lifetime.
    pub fn reborrow(&mut self) -> SolutionView<'_, T> {
        let Self { dims, v, dynamics, lower, upper } = self;
        SolutionView { dims, v, dynamics, lower, upper }
    }
}
