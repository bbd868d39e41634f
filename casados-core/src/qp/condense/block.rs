//! The condensed problem, by a recursion over the stages of a block.

use super::plan::{CondensedRow, Kind, blocks, row_bounds_and_penalties};
use crate::qp::element::{get, set};
use crate::qp::interior::{Columns, PADDING_COLUMNS, Part, Source, product, subtract};
use crate::qp::layout::{
    StageDims, StageOffsets, StageOffsetsIter, copy_common, padded_len, part, part_mut, take_mut,
};
use crate::qp::problem::QpView;
use crate::qp::stage::ConstraintVector;
use crate::scalar::{Packed, Real, Registers};
use alloc::vec::Vec;

/// The matrices of the recursion, in one block of memory.
pub struct Work<'a, T> {
    /// `Z` of the next state, and of `(x, u)`
    z: &'a mut [T],
    z_next: &'a mut [T],
    /// `V`, and its next value.
    v: &'a mut [T],
    m: &'a mut [T],
    /// `−[A B]ᵀ`
    minus: &'a mut [T],
    /// `−[A B]ᵀ V`
    w: &'a mut [T],
    /// Constants of the rows of `Z`, and gradients of the rows of controls.
    constant: &'a mut [T],
    /// Gradients with respect to the next state, and to `(x, u)`.
    g: &'a mut [T],
    g_next: &'a mut [T],
    offset: &'a mut [T],
    ld_z: usize,
}

/// The largest dimensions.
pub struct MaxDimensions {
    pub n: usize,
    pub nx: usize,
    pub rows: usize,
}

impl<'a, T: Real> Work<'a, T> {
    pub fn lengths(largest: &MaxDimensions) -> [usize; 10] {
        let (ld, ld_x, ld_z) =
            (padded_len::<T>(largest.n), padded_len::<T>(largest.nx), padded_len::<T>(largest.rows));
        let n = largest.n + PADDING_COLUMNS;
        [ld_z * n, ld_z * n, ld_x * n, ld * n, ld * n, ld * n, ld_z, ld, ld, ld_x]
    }
    pub fn new(largest: &MaxDimensions, mut memory: &'a mut [T]) -> Self {
        let mut parts = Self::lengths(largest).into_iter().map(|length| take_mut(&mut memory, length));
        let mut next = || parts.next().unwrap_or_default();
        Self {
            z: next(),
            z_next: next(),
            v: next(),
            m: next(),
            minus: next(),
            w: next(),
            constant: next(),
            g: next(),
            g_next: next(),
            offset: next(),
            ld_z: padded_len::<T>(largest.rows),
        }
    }
}

/// Writes the condensed problem.
pub struct Condense<'a, T> {
    pub qp: QpView<'a, T>,
    pub block: usize,
    pub rows: &'a [CondensedRow],
    pub work: Work<'a, T>,
    pub dims: &'a [StageDims],
    pub target: &'a mut [T],
    /// Workspace for the origins of the rows of `Z`.
    pub origins: &'a mut Vec<CondensedRow>,
}

impl<T: Real> Registers<T> for Condense<'_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(mut self) {
        let mut rows = self.rows;
        let targets = StageOffsetsIter::<T>::new(self.dims);
        for (block, to) in blocks(self.qp.dims.len(), self.block).zip(targets) {
            let (here, others) = rows.split_at_checked(to.ng).unwrap_or_default();
            rows = others;
            self.block::<E>(block, &to, here);
        }
    }
}

impl<T: Real> Condense<'_, T> {
    /// Condenses a block.
    #[inline(always)]
    fn block<E: Packed<T>>(
        &mut self,
        block: core::ops::Range<usize>,
        to: &StageOffsets,
        rows: &[CondensedRow],
    ) {
        let Self { qp, work, target, origins, .. } = self;
        let target = part_mut(target, to.data, to.data_len());
        part_mut(target, 0, to.matrix()).fill(T::ZERO);
        origins.clear();
        let mut controls = 0;
        let stages = StageOffsetsIter::<T>::new(qp.dims).skip(block.start).take(block.len());
        for (count, place) in stages.rev().enumerate() {
            let stage = Stage { place, data: part(qp.data, place.data, place.data_len()), controls };
            work.propagate_stage::<E>(&stage, origins, count == 0);
            work.write_controls(&stage, to, origins, target);
            work.add_control_rows(&stage, origins);
            work.add_constraint_rows(&stage, rows, to, origins, target);
            work.shift_to_previous_stage(place.n, place.nx);
            controls += place.nu;
            if place.stage == block.start {
                work.write_first_state(&stage, to, origins, target);
            }
        }
        work.write_bound_offsets(to, origins, target);
    }
}

/// A stage of a block.
struct Stage<'s, T> {
    place: StageOffsets,
    data: &'s [T],
    /// The number of controls of later stages of the block.
    controls: usize,
}

impl<T: Real> Work<'_, T> {
    /// Computes `M`, `Z` and their gradients over the variables of a stage from those over the next
    /// state; the last stage of a block starts the recursion.
    #[inline(always)]
    fn propagate_stage<E: Packed<T>>(
        &mut self,
        stage: &Stage<'_, T>,
        origins: &mut Vec<CondensedRow>,
        first: bool,
    ) {
        let Self { z, z_next, v, m, minus, w, constant, g, g_next, offset, ld_z } = self;
        let (Stage { data, place, .. }, ld_z) = (stage, *ld_z);
        let &StageOffsets { n, ld, next, ld_next, stage, .. } = place;
        let matrix = Columns { data: part(data, 0, place.matrix()), ld };
        let negative = part_mut(minus, 0, ld * next);
        for (negative, &element) in negative.iter_mut().zip(matrix.data) {
            *negative = -element;
        }
        let negative = Columns { data: &*negative, ld };
        let linear = part(data, place.gradient(), ld);
        let b = part(data, place.offset(), next);
        g_next.iter_mut().zip(linear).for_each(|(g, &linear)| *g = linear);
        let hessian = part(data, place.matrix(), place.hessian());
        if first {
            // The state at the end of the block is `A x + B u + b`, and has no cost here.
            for i in 0..next {
                origins.push(CondensedRow { kind: Kind::State, stage: stage + 1, index: i });
                for (j, &element) in part(matrix.data, i * ld, n).iter().enumerate() {
                    set(z_next, j * ld_z + i, element);
                }
                set(constant, i, b.get(i).copied().unwrap_or(T::ZERO));
            }
            copy_common(part_mut(m, 0, hessian.len()), hessian);
            return;
        }
        // `g + V b`, and constants `+ Z b`
        let old = origins.len();
        for (offset, &b) in offset.iter_mut().zip(b) {
            *offset = -b;
        }
        subtract::<T, E>(g, Columns { data: v, ld: ld_next }, offset, next, next);
        subtract::<T, E>(constant, Columns { data: z, ld: ld_z }, offset, old, next);
        subtract::<T, E>(g_next, negative, g, n, next);
        let y = Columns { data: v, ld: ld_next };
        product::<T, E>(w, ld, Source::Zero, matrix, y, (n, 0..next, next), Part::Full);
        let y = Columns { data: w, ld };
        let hessian = Source::Matrix(Columns { data: hessian, ld });
        product::<T, E>(m, ld, hessian, matrix, y, (n, 0..n, next), Part::Lower);
        let x = Columns { data: z, ld: ld_z };
        product::<T, E>(z_next, ld_z, Source::Zero, x, negative, (old, 0..n, next), Part::Full);
    }

    /// Writes the columns of rows, `R` and bounds of the controls of a stage.
    #[inline(always)]
    fn write_controls(
        &self,
        stage: &Stage<'_, T>,
        to: &StageOffsets,
        origins: &[CondensedRow],
        target: &mut [T],
    ) {
        let StageOffsets { nx, nu, ld, .. } = stage.place;
        for i in 0..nu {
            let (here, column) =
                (to.nx + stage.controls + i, part(self.z_next, (nx + i) * self.ld_z, origins.len()));
            for (origin, &element) in origins.iter().zip(column) {
                set(target, row_element_index(to, origin, here), element);
            }
            for j in i..nu {
                let element = get(self.m, (nx + i) * ld + nx + j);
                set(target, to.matrix() + here * to.ld + here - i + j, element);
            }
            for (vector, value) in
                row_bounds_and_penalties(stage.data, &stage.place, nx + i).into_iter().enumerate()
            {
                set(
                    target,
                    to.constraint_vector_begin(ConstraintVector::Lower) + vector * to.rows + here,
                    value,
                );
            }
        }
    }

    /// Appends rows to `Z`: mixed derivatives with respect to the controls of a stage.
    #[inline(always)]
    fn add_control_rows(&mut self, stage: &Stage<'_, T>, origins: &mut Vec<CondensedRow>) {
        let StageOffsets { nx, nu, ld, stage: number, .. } = stage.place;
        for i in 0..nu {
            let row = origins.len();
            origins.push(CondensedRow { kind: Kind::Control, stage: number, index: stage.controls + i });
            for j in 0..nx {
                set(self.z_next, j * self.ld_z + row, get(self.m, j * ld + nx + i));
            }
            set(self.constant, row, get(self.g_next, nx + i));
        }
    }

    /// Appends rows to `Z`: the constraints of a stage among the `rows` of a block, with their
    /// bounds.
    #[inline(always)]
    fn add_constraint_rows(
        &mut self,
        stage: &Stage<'_, T>,
        rows: &[CondensedRow],
        to: &StageOffsets,
        origins: &mut Vec<CondensedRow>,
        target: &mut [T],
    ) {
        let StageOffsets { nx, n, ld, next, stage: number, .. } = stage.place;
        for (index, origin) in rows.iter().enumerate().filter(|(_, origin)| origin.stage == number) {
            let row = origins.len();
            origins.push(CondensedRow { index, ..*origin });
            let general = origin.index.checked_sub(ld);
            for j in 0..n {
                let element = match general {
                    // The constraints follow `[A B]ᵀ`.
                    Some(general) => get(stage.data, (next + general) * ld + j),
                    None if origin.index == j => T::ONE,
                    None => T::ZERO,
                };
                if j < nx {
                    set(self.z_next, j * self.ld_z + row, element);
                } else {
                    let column = to.nx + stage.controls + j - nx;
                    set(target, (to.next + index) * to.ld + column, element);
                }
            }
            set(self.constant, row, T::ZERO);
            for (vector, value) in
                row_bounds_and_penalties(stage.data, &stage.place, origin.index).into_iter().enumerate()
            {
                set(
                    target,
                    to.constraint_vector_begin(ConstraintVector::Lower) + vector * to.rows + to.ld + index,
                    value,
                );
            }
        }
    }

    /// Moves the recursion to the state of the stage.
    #[inline(always)]
    fn shift_to_previous_stage(&mut self, n: usize, nx: usize) {
        let Self { z, z_next, v, m, g, g_next, .. } = self;
        core::mem::swap(z, z_next);
        let (ld, ld_x) = (padded_len::<T>(n), padded_len::<T>(nx));
        for j in 0..nx {
            for i in j..nx {
                let element = get(m, j * ld + i);
                set(v, j * ld_x + i, element);
                set(v, i * ld_x + j, element);
            }
        }
        copy_common(part_mut(g, 0, nx), part(g_next, 0, nx));
        part_mut(g, nx, g.len() - nx.min(g.len())).fill(T::ZERO);
    }

    /// Writes the columns, `Q` and bounds of the first state of a block.
    #[inline(always)]
    fn write_first_state(
        &self,
        stage: &Stage<'_, T>,
        to: &StageOffsets,
        origins: &[CondensedRow],
        target: &mut [T],
    ) {
        let StageOffsets { nx, ld, .. } = stage.place;
        for j in 0..nx {
            for i in j..nx {
                set(target, to.matrix() + j * to.ld + i, get(self.m, j * ld + i));
            }
            for (row, origin) in origins.iter().enumerate() {
                set(target, row_element_index(to, origin, j), get(self.z, j * self.ld_z + row));
            }
            set(target, to.gradient() + j, get(self.g, j));
            for (vector, value) in
                row_bounds_and_penalties(stage.data, &stage.place, j).into_iter().enumerate()
            {
                set(
                    target,
                    to.constraint_vector_begin(ConstraintVector::Lower) + vector * to.rows + j,
                    value,
                );
            }
        }
    }

    /// Subtracts the constants of the rows of a block from their bounds.
    #[inline(always)]
    fn write_bound_offsets(&self, to: &StageOffsets, origins: &[CondensedRow], target: &mut [T]) {
        for (row, origin) in origins.iter().enumerate() {
            let constant = get(self.constant, row);
            match origin.kind {
                Kind::State => set(target, to.offset() + origin.index, constant),
                Kind::Control => set(target, to.gradient() + to.nx + origin.index, constant),
                Kind::Constraint => {
                    for vector in [ConstraintVector::Lower, ConstraintVector::Upper] {
                        let at = to.constraint_vector_begin(vector) + to.ld + origin.index;
                        let bound = get(target, at);
                        set(target, at, bound - constant);
                    }
                }
            }
        }
    }
}

/// Returns the index of the element of a row of `Z` for a variable of the condensed stage.
fn row_element_index(to: &StageOffsets, origin: &CondensedRow, variable: usize) -> usize {
    match origin.kind {
        Kind::State => origin.index * to.ld + variable,
        Kind::Constraint => (to.next + origin.index) * to.ld + variable,
        // Below the diagonal: later controls come first, so that this is its row with states, and
        // its column with controls.
        Kind::Control if variable < to.nx => to.matrix() + variable * to.ld + to.nx + origin.index,
        Kind::Control => to.matrix() + (to.nx + origin.index) * to.ld + variable,
    }
}
