//! The data of a QP.

use super::error::{QpError, QpField};
use super::layout::{
    StageDims, StageOffsetsIter, copy_common, end, exceeds_memory, part, part_mut, take_mut,
};
#[cfg(feature = "alloc")]
use super::memory::CACHE_LINE;
use super::stage::{ConstraintVector, Stage, StageMut};
use crate::scalar::Real;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;
use core::marker::PhantomData;

/// A quadratic program with the structure of optimal control, in memory of the caller.
///
/// With the feature `alloc`, `Qp::new(&dims)` allocates its memory; [`Qp::in_memory`] uses arrays
/// or static slices of [`Qp::memory`] elements. See the [module](super) for the problem.
///
/// A new QP is zero, without bounds. A fixed initial state has two equal bounds:
/// [`Qp::fix_initial_state`].
///
/// ```
/// use casados::qp::{HeapQp, StageDims};
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
/// assert_eq!(qp.view().stages().len(), 3);
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Qp<T, D, M> {
    dims: D,
    memory: M,
    /// The length of the data of the stages. A mark for every state and control of the first stage
    /// follows.
    stages: usize,
    /// The start of a cache line, from which whole registers are read.
    #[cfg(feature = "alloc")]
    begin: usize,
    number: PhantomData<T>,
}

/// A QP with its memory on the heap.
///
/// ```
/// use casados::qp::{HeapQp, StageDims};
///
/// // Two states, one control and one constraint at each of ten stages.
/// let qp = HeapQp::<f64>::new(&[StageDims::new(2, 1, 1); 10])?;
/// assert_eq!(qp.view().dims().len(), 10);
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[cfg(feature = "alloc")]
pub type HeapQp<T = f64> = Qp<T, Vec<StageDims>, Vec<T>>;

/// The data of a QP, for solvers.
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
/// let view = qp.view();
/// assert_eq!(view.stages().filter_map(|stage| stage.q().get(0, 0)).sum::<f64>(), 4.0);
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct QpView<'a, T> {
    pub(crate) dims: &'a [StageDims],
    pub(super) data: &'a [T],
    /// Marks of periodic states and shared controls.
    pub(super) marks: &'a [T],
}

impl<'a, T: Real> QpView<'a, T> {
    /// Returns the dimensions of the stages.
    #[must_use]
    pub fn dims(&self) -> &'a [StageDims] {
        self.dims
    }
    /// Returns a stage.
    #[must_use]
    pub fn stage(&self, stage: usize) -> Option<Stage<'a, T>> {
        self.stages().nth(stage)
    }
    /// Returns all stages in order.
    pub fn stages(&self) -> impl DoubleEndedIterator<Item = Stage<'a, T>> + ExactSizeIterator + use<'a, T> {
        let data = self.data;
        StageOffsetsIter::<T>::new(self.dims)
            .map(move |place| Stage { place, data: part(data, place.data, place.data_len()) })
    }
}

#[cfg(feature = "alloc")]
impl<T: Real> HeapQp<T> {
    /// A QP with its memory on the heap.
    ///
    /// # Errors
    /// [`QpError::OutOfMemory`]; [`QpError::Dimension`] if there is no stage.
    pub fn new(dims: &[StageDims]) -> Result<Self, QpError> {
        let line = CACHE_LINE / size_of::<T>();
        let memory: Vec<T> = super::memory::zeros(Self::memory(dims).saturating_add(line))?;
        let begin = memory.as_ptr().align_offset(CACHE_LINE).min(line);
        let mut qp = Self::in_memory(super::memory::copy(dims)?, memory)?;
        qp.begin = begin;
        qp.clear();
        Ok(qp)
    }
}

impl<T: Real, D, M> Qp<T, D, M> {
    /// Returns the length of the data; `usize::MAX` if it overflows.
    #[must_use]
    pub const fn memory(dims: &[StageDims]) -> usize {
        if exceeds_memory(dims) { usize::MAX } else { end::<T>(dims).data + coupling_mark_count(dims) }
    }
}

impl<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Qp<T, D, M> {
    /// A QP in given memory, of at least [`Qp::memory`] elements.
    ///
    /// # Errors
    /// [`QpError::Dimension`] if the memory is too short, or if there is no stage.
    pub fn in_memory(dims: D, memory: M) -> Result<Self, QpError> {
        let (expected, found) = (Self::memory(dims.as_ref()), memory.as_ref().len());
        if dims.as_ref().is_empty() {
            return Err(QpError::Dimension { field: QpField::Stages, stage: 0, expected: 1, found: 0 });
        }
        if found < expected {
            return Err(QpError::Dimension { field: QpField::Data, stage: 0, expected, found });
        }
        let stages = end::<T>(dims.as_ref()).data;
        let mut qp = Self {
            dims,
            memory,
            stages,
            #[cfg(feature = "alloc")]
            begin: 0,
            number: PhantomData,
        };
        qp.clear();
        Ok(qp)
    }
    /// Resets the data to zero, without bounds.
    pub fn clear(&mut self) {
        let (dims, data) = self.parts_mut();
        clear(dims, data);
    }
    /// Returns dimensions and numbers.
    fn parts_mut(&mut self) -> (&[StageDims], &mut [T]) {
        let data = self.memory.as_mut();
        #[cfg(feature = "alloc")]
        let data = data.get_mut(self.begin..).unwrap_or_default();
        (self.dims.as_ref(), data)
    }
    /// Returns a view for solvers.
    #[must_use]
    pub fn view(&self) -> QpView<'_, T> {
        let (dims, data) = (self.dims.as_ref(), self.memory.as_ref());
        #[cfg(feature = "alloc")]
        let data = data.get(self.begin..).unwrap_or_default();
        QpView { dims, data, marks: part(data, self.stages, coupling_mark_count(dims)) }
    }
    /// Returns the marks of periodic states and shared controls.
    pub(super) fn marks_mut(&mut self) -> &mut [T] {
        let stages = self.stages;
        let (dims, data) = self.parts_mut();
        part_mut(data, stages, coupling_mark_count(dims))
    }
    /// Returns the dimensions of the stages.
    #[must_use]
    pub fn dims(&self) -> &[StageDims] {
        self.dims.as_ref()
    }
    /// Returns a mutable stage.
    pub fn stage_mut(&mut self, stage: usize) -> Option<StageMut<'_, T>> {
        let (dims, data) = self.parts_mut();
        let place = StageOffsetsIter::<T>::new(dims).nth(stage)?;
        Some(StageMut { place, data: part_mut(data, place.data, place.data_len()) })
    }
    /// Returns all mutable stages in order.
    pub fn stages_mut(&mut self) -> impl Iterator<Item = StageMut<'_, T>> {
        let (dims, data) = self.parts_mut();
        stages_mut(dims, data)
    }
    /// Returns all data of the stages.
    #[cfg(feature = "alloc")]
    pub(super) fn data_mut(&mut self) -> &mut [T] {
        self.parts_mut().1
    }
    /// Fixes the initial state `x₀`, by two equal hard bounds of every component.
    ///
    /// # Errors
    /// [`QpError::Dimension`]
    pub fn fix_initial_state(&mut self, x0: &[T]) -> Result<(), QpError> {
        let Some(mut stage) = self.stage_mut(0) else { return Ok(()) };
        let bounds = stage.x_bounds_mut();
        let (expected, found) = (bounds.lower.len(), x0.len());
        if expected != found {
            return Err(QpError::Dimension { field: QpField::StateBounds, stage: 0, expected, found });
        }
        copy_common(bounds.lower, x0);
        copy_common(bounds.upper, x0);
        for penalties in [bounds.lower_linear, bounds.upper_linear] {
            penalties.fill(T::from_f64(f64::INFINITY));
        }
        Ok(())
    }
}

/// Returns the number of states and controls of the first stage.
const fn coupling_mark_count(dims: &[StageDims]) -> usize {
    match dims.first() {
        Some(first) => first.nx + first.nu,
        None => 0,
    }
}

/// Returns all mutable stages in order.
pub(super) fn stages_mut<'a, T: Real>(
    dims: &'a [StageDims],
    mut data: &'a mut [T],
) -> impl Iterator<Item = StageMut<'a, T>> {
    StageOffsetsIter::<T>::new(dims)
        .map(move |place| StageMut { place, data: take_mut(&mut data, place.data_len()) })
}

/// Resets data to zero, without bounds.
pub(super) fn clear<T: Real>(dims: &[StageDims], data: &mut [T]) {
    data.fill(T::ZERO);
    let infinity = T::from_f64(f64::INFINITY);
    let values = [-infinity, infinity, infinity, T::ZERO, infinity, T::ZERO];
    for stage in stages_mut(dims, data) {
        let rows = stage
            .data
            .get_mut(stage.place.constraint_vector_begin(ConstraintVector::Lower)..)
            .unwrap_or_default();
        for (row, value) in rows.chunks_exact_mut(stage.place.rows.max(1)).zip(values) {
            row.fill(value);
        }
    }
}
