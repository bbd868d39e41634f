//! Couplings of stages: periodic states and shared controls.
//!
//! Periodic states have multipliers `θ` of `x₀ − x_N = 0`. `θ` and the shared controls `w` are
//! parameters of the recursion, in this order: see [`border`](super::border).

use super::kernels::PADDING_COLUMNS;
use super::riccati::{Extent, InitialStateKind};
use super::vector::{add_scaled, scale_vector};
use crate::qp::element::set;
use crate::qp::layout::{StageOffsets, StageOffsetsIter, first_nx, padded_len, take_mut};
use crate::qp::{QpView, StageDims, marked_indices};
use crate::scalar::Real;

/// Proof that couplings are supported. Without the feature `alloc` this type has no value, so that
/// programs without couplings do not contain their code.
#[cfg(feature = "alloc")]
#[derive(Clone, Copy)]
pub struct CouplingSupport;
#[cfg(not(feature = "alloc"))]
#[derive(Clone, Copy)]
pub enum CouplingSupport {}

#[cfg(feature = "alloc")]
const COUPLING_SUPPORT: Option<CouplingSupport> = Some(CouplingSupport);
#[cfg(not(feature = "alloc"))]
const COUPLING_SUPPORT: Option<CouplingSupport> = None;

/// The data of couplings, in memory of the caller.
pub struct Coupling<'a, T> {
    /// A mark for every state of the first stage: whether it is periodic.
    pub periodic: &'a [T],
    /// A mark for every control of the first stage: whether it is shared.
    pub shared: &'a [T],
    /// The number of periodic states.
    pub conditions: usize,
    /// The number of parameters.
    pub count: usize,
    /// The number of states of the first stage that are solved for with the parameters.
    pub free: usize,
    /// `x₀ − x_N`
    pub residual: &'a mut [T],
    /// `θ`
    pub theta: &'a mut [T],
    /// `Δθ`, then `Δw`.
    pub step: &'a mut [T],
    /// Columns of `M` of shared controls, over the variables of all stages.
    pub columns: &'a mut [T],
    /// `S`, the lower triangle. Its columns, and those of the three matrices below, have the same
    /// padded length: an element for each parameter.
    pub schur: &'a mut [T],
    /// `s`
    pub linear: &'a mut [T],
    /// `Γᵀ` of the current stage over all its variables, and `−Γᵀ` of the next stage.
    pub gamma: &'a mut [T],
    pub minus: &'a mut [T],
    /// `Σ Γ₊ᵀ r`, the term of dynamics residuals in `s`.
    pub offset: &'a mut [T],
    /// `L⁻¹ M_u·` of all parameters, a column for each variable of all stages.
    pub eliminated: &'a mut [T],
    /// `p` at the first stage.
    pub first: &'a mut [T],
    /// The system of the first state and the parameters, and its factors.
    pub matrix: &'a mut [T],
    pub right: &'a mut [T],
    pub exchanged: &'a mut [T],
    _exists: CouplingSupport,
}

impl<'a, T: Real> Coupling<'a, T> {
    /// Returns the length of the memory for these numbers of periodic states and shared controls.
    pub const fn memory(dims: &[StageDims], conditions: usize, shared: usize) -> usize {
        let Extent { n, nx, end, .. } = Extent::of::<T>(dims);
        let count = conditions + shared;
        let columns = n + PADDING_COLUMNS + nx + 1 + count + PADDING_COLUMNS + end.v;
        let (first, border) = (first_nx(dims), first_nx(dims) + count);
        padded_len::<T>(count) * columns
            + 2 * conditions
            + 2 * count
            + shared * end.v
            + first
            + border * (border + 2)
    }

    /// Returns the length of the memory for a QP.
    pub fn memory_of(qp: QpView<'_, T>) -> usize {
        if COUPLING_SUPPORT.is_none() {
            return 0;
        }
        let (conditions, shared) =
            (marked_indices(qp.periodic()).count(), marked_indices(qp.shared()).count());
        if conditions + shared == 0 { 0 } else { Self::memory(qp.dims, conditions, shared) }
    }

    /// The couplings of a QP, in memory of this length.
    pub fn new(
        qp: QpView<'a, T>,
        extent: &Extent,
        first: InitialStateKind,
        memory: &mut &'a mut [T],
    ) -> Option<Self> {
        let (periodic, shared) = (qp.periodic(), qp.shared());
        let (conditions, parameters) = (marked_indices(periodic).count(), marked_indices(shared).count());
        let count = conditions + parameters;
        if count == 0 {
            return None;
        }
        let _exists = COUPLING_SUPPORT?;
        let (v, nx, ld) = (extent.end.v, first_nx(qp.dims), padded_len::<T>(count));
        let n = nx + count;
        Some(Self {
            _exists,
            periodic,
            shared,
            conditions,
            count,
            free: if first == InitialStateKind::Fixed { 0 } else { nx },
            residual: take_mut(memory, conditions),
            theta: take_mut(memory, conditions),
            step: take_mut(memory, count),
            columns: take_mut(memory, parameters * v),
            schur: take_mut(memory, ld * (count + PADDING_COLUMNS)),
            linear: take_mut(memory, count),
            gamma: take_mut(memory, ld * (extent.n + PADDING_COLUMNS)),
            minus: take_mut(memory, ld * extent.nx),
            offset: take_mut(memory, ld),
            eliminated: take_mut(memory, ld * v),
            first: take_mut(memory, nx),
            matrix: take_mut(memory, n * n),
            right: take_mut(memory, n),
            exchanged: take_mut(memory, n),
        })
    }

    /// Evaluates `x₀ − x_N` at a point over the rows.
    pub fn evaluate(&mut self, qp: QpView<'_, T>, rows: &[T]) {
        let last = last_state(qp);
        let at = |row: usize| rows.get(row).copied().unwrap_or(T::ZERO);
        for (residual, i) in self.residual.iter_mut().zip(marked_indices(self.periodic)) {
            *residual = at(i) - at(last + i);
        }
    }

    /// Takes the fraction `alpha` of the step of the multipliers; residuals are multiplied by
    /// `1 − alpha`.
    pub fn take_step(&mut self, alpha: T) {
        add_scaled(self.theta, alpha, self.step);
        scale_vector(self.residual, T::ONE - alpha);
    }

    /// Returns the sum of `|x₀ − x_N|`.
    pub fn residual_sum(&self) -> f64 {
        self.residual.iter().fold(0.0, |sum, gap| sum + gap.abs().to_f64())
    }

    /// Adds the gradient terms of `θ`, with the step of `Δθ` if requested, to the rows.
    pub fn add_multiplier_forces(&self, qp: QpView<'_, T>, with_step: bool, rows: &mut [T]) {
        let last = last_state(qp);
        let multipliers = self.theta.iter().zip(&*self.step).zip(marked_indices(self.periodic));
        for ((&theta, &step), i) in multipliers {
            let force = if with_step { theta + step } else { theta };
            for (row, force) in [(i, force), (last + i, -force)] {
                if let Some(row) = rows.get_mut(row) {
                    *row = *row + force;
                }
            }
        }
    }

    /// Replaces a gradient over the rows by that of the coupled variables: the sum over coupled
    /// elements at the first stage, zero elsewhere. `θ` absorbs the elements of periodic states at
    /// the last stage.
    pub fn fold(&mut self, qp: QpView<'_, T>, rows: &mut [T]) {
        let mut join = |first: usize, other: usize| {
            let value = rows.get(other).copied().unwrap_or(T::ZERO);
            set(rows, other, T::ZERO);
            if let Some(row) = rows.get_mut(first) {
                *row = *row + value;
            }
            value
        };
        let last = last_state(qp);
        for (theta, i) in self.theta.iter_mut().zip(marked_indices(self.periodic)) {
            *theta = *theta + join(i, last + i);
        }
        let Some(first) = StageOffsetsIter::<T>::new(qp.dims).next() else { return };
        for j in marked_indices(self.shared) {
            for StageOffsets { row, nx, .. } in
                StageOffsetsIter::<T>::new(qp.dims).skip(1).filter(|place| j < place.nu)
            {
                join(first.nx + j, row + nx + j);
            }
        }
    }
}

/// Returns the offset of the last state among the rows.
fn last_state<T: Real>(qp: QpView<'_, T>) -> usize {
    StageOffsetsIter::<T>::new(qp.dims).next_back().map_or(0, |place| place.row)
}
