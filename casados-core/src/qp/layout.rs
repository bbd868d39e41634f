//! Dimensions of the stages, and their offsets in flat memory.
//!
//! A stage has the variables `v = (x, u)`. Its matrices are stored column after column; every
//! column starts at a multiple of [`padded_len`] elements, so that whole registers can be read from
//! it. The padding is zero.

use crate::scalar::lanes::REGISTERS;
use core::iter::FusedIterator;
use core::marker::PhantomData;

/// The dimensions of one stage.
///
/// ```
/// use casados::qp::StageDims;
///
/// // Two states, a control, no general constraint; at the end no control.
/// let mut dims = [StageDims::new(2, 1, 0); 4];
/// dims[3].nu = 0;
/// assert_eq!((dims[0].nx, dims[0].nu, dims[3].nu), (2, 1, 0));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct StageDims {
    /// States `x`.
    pub nx: usize,
    /// Controls `u`. At the last stage they have costs and bounds, but no dynamics.
    pub nu: usize,
    /// Rows of the general constraints `lg ≤ C x + D u ≤ ug`.
    pub ng: usize,
}

impl StageDims {
    /// `nx`, `nu`, `ng`
    #[must_use]
    pub const fn new(nx: usize, nu: usize, ng: usize) -> Self {
        Self { nx, nu, ng }
    }
}

/// Returns `n` rounded up to whole registers (64 bytes, the widest) of elements of type `T`.
/// Without SIMD it is rounded up to an even number, as tiles require; firmware then uses half the
/// memory and does no work for padding.
#[must_use]
pub(crate) const fn padded_len<T>(n: usize) -> usize {
    let width = if REGISTERS { 64 / size_of::<T>() } else { 2 };
    n.div_ceil(width) * width
}

/// The dimensions of a stage, and the offsets of its parts in the arrays of the horizon.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct StageOffsets {
    /// The index of the stage.
    pub stage: usize,
    /// States.
    pub nx: usize,
    /// Controls.
    pub nu: usize,
    /// General constraints.
    pub ng: usize,
    /// States of the next stage; 0 for the last stage.
    pub next: usize,
    /// `nx + nu`
    pub n: usize,
    /// The stride of columns, `n` padded; also the length of a vector `v`.
    pub ld: usize,
    /// The padded length of a vector of next states.
    pub ld_next: usize,
    /// The length of a vector over all constraints: `ld` for the bounds, `ng` padded for the
    /// general constraints.
    pub rows: usize,
    /// Columns of the factors, one for each variable that is eliminated at this stage.
    pub pivots: usize,
    /// Offset of the data.
    pub data: usize,
    /// Offset in vectors `v` of the horizon.
    pub v: usize,
    /// Offset in vectors of next states.
    pub dynamics: usize,
    /// Offset in vectors over constraints.
    pub row: usize,
    /// Offset in the factors.
    pub factor: usize,
}

impl StageOffsets {
    const fn new<T>(stage: usize, dims: StageDims, next: usize) -> Self {
        let n = dims.nx + dims.nu;
        let ld = padded_len::<T>(n);
        Self {
            stage,
            nx: dims.nx,
            nu: dims.nu,
            ng: dims.ng,
            next,
            n,
            ld,
            ld_next: padded_len::<T>(next),
            rows: ld + padded_len::<T>(dims.ng),
            // A free first state is eliminated like a control.
            pivots: if stage == 0 { n } else { dims.nu },
            data: 0,
            v: 0,
            dynamics: 0,
            row: 0,
            factor: 0,
        }
    }
    /// Returns the length of `[A B; C D]ᵀ`, which has a column for each next state and each general
    /// constraint.
    pub const fn matrix(&self) -> usize {
        self.ld * (self.next + self.ng)
    }
    /// Returns the length of `[Q Sᵀ; S R]`.
    pub const fn hessian(&self) -> usize {
        self.ld * self.n
    }
    /// Returns the length of all data of the stage: matrix, Hessian, gradient, offset, and six
    /// vectors over its constraints.
    pub const fn data_len(&self) -> usize {
        self.matrix() + self.hessian() + self.ld + self.ld_next + 6 * self.rows
    }
    const fn factor_len(&self) -> usize {
        self.ld * self.pivots
    }
    /// Returns the same dimensions with the offsets after those of `before`.
    #[cfg_attr(feature = "std", inline(always))]
    const fn placed_after(mut self, before: &Self) -> Self {
        self.data = before.data + before.data_len();
        self.v = before.v + before.ld;
        self.dynamics = before.dynamics + before.ld_next;
        self.row = before.row + before.rows;
        self.factor = before.factor + before.factor_len();
        self
    }
    /// Returns the same dimensions with the offsets before those of `after`.
    #[cfg_attr(feature = "std", inline(always))]
    const fn placed_before(mut self, after: &Self) -> Self {
        self.data = after.data.saturating_sub(self.data_len());
        self.v = after.v.saturating_sub(self.ld);
        self.dynamics = after.dynamics.saturating_sub(self.ld_next);
        self.row = after.row.saturating_sub(self.rows);
        self.factor = after.factor.saturating_sub(self.factor_len());
        self
    }
    /// Returns the offsets after this stage, as those of an empty stage: they are the lengths of
    /// the arrays.
    const fn end(&self) -> Self {
        Self::new::<u8>(0, StageDims::new(0, 0, 0), 0).placed_after(self)
    }
}

/// Returns the number of states of the first stage.
pub(crate) const fn first_nx(dims: &[StageDims]) -> usize {
    match dims.first() {
        Some(first) => first.nx,
        None => 0,
    }
}

/// An iterator over the offsets of all stages, forwards or backwards.
#[derive(Clone, Debug)]
pub(crate) struct StageOffsetsIter<'a, T> {
    dims: &'a [StageDims],
    /// The number of stages taken from the front.
    taken: usize,
    /// States of the stage after the remaining ones.
    next: usize,
    number: PhantomData<T>,
    front: StageOffsets,
    /// The offsets at the back; none before the first step backwards.
    back: Option<StageOffsets>,
}

impl<'a, T> StageOffsetsIter<'a, T> {
    /// The offsets of stages with elements of type `T`.
    pub fn new(dims: &'a [StageDims]) -> Self {
        Self { dims, taken: 0, next: 0, number: PhantomData, front: StageOffsets::default(), back: None }
    }
    /// The same, with the known [`end`], which makes backward iteration cheaper.
    pub fn with_known_end(dims: &'a [StageDims], end: StageOffsets) -> Self {
        Self { back: Some(end), ..Self::new(dims) }
    }
}

impl<T> Iterator for StageOffsetsIter<'_, T> {
    type Item = StageOffsets;

    // Inlined with `std`, where the optimiser drops unused offsets; firmware saves code size.
    #[cfg_attr(feature = "std", inline(always))]
    #[cfg_attr(not(feature = "std"), inline)]
    fn next(&mut self) -> Option<StageOffsets> {
        let (&first, rest) = self.dims.split_first()?;
        let next = rest.first().map_or(self.next, |dims| dims.nx);
        let offsets = StageOffsets::new::<T>(self.taken, first, next).placed_after(&self.front);
        (self.dims, self.front, self.taken) = (rest, offsets, self.taken + 1);
        Some(offsets)
    }
    fn size_hint(&self) -> (usize, Option<usize>) {
        (self.dims.len(), Some(self.dims.len()))
    }
}

impl<T> DoubleEndedIterator for StageOffsetsIter<'_, T> {
    #[cfg_attr(feature = "std", inline(always))]
    #[cfg_attr(not(feature = "std"), inline)]
    fn next_back(&mut self) -> Option<StageOffsets> {
        let (&last, rest) = self.dims.split_last()?;
        let back = match self.back {
            Some(back) => back,
            None => place_after_stages::<T>(self.front, self.taken, self.dims),
        };
        let offsets = StageOffsets::new::<T>(self.taken + rest.len(), last, self.next).placed_before(&back);
        (self.dims, self.back, self.next) = (rest, Some(offsets), last.nx);
        Some(offsets)
    }
}

impl<T> ExactSizeIterator for StageOffsetsIter<'_, T> {}
impl<T> FusedIterator for StageOffsetsIter<'_, T> {}

/// Returns the offsets after the last stage: the lengths of the arrays of the horizon.
pub(crate) const fn end<T>(dims: &[StageDims]) -> StageOffsets {
    place_after_stages::<T>(StageOffsets::new::<T>(0, StageDims::new(0, 0, 0), 0), 0, dims)
}

/// Returns whether the lengths of such a horizon exceed the memory, and may overflow `usize`.
pub(crate) const fn exceeds_memory(dims: &[StageDims]) -> bool {
    let (mut total, mut rest): (u128, _) = (0, dims);
    while let Some((&first, after)) = rest.split_first() {
        let next = match after.first() {
            Some(dims) => dims.nx as u128,
            None => 0,
        };
        let (n, ng) = (first.nx as u128 + first.nu as u128 + 16, first.ng as u128 + 16);
        // The product of two of these is below 2¹³⁰; each larger than 2⁶² is too large by itself.
        let (most, columns) = (1 << 62, n + next + ng);
        if n > most || columns > most {
            return true;
        }
        total = total.saturating_add(16 * n * columns);
        rest = after;
    }
    total > (usize::MAX / 64) as u128
}

/// Returns the offsets after the stages that follow `place`; `stage` is the index of the first of
/// them.
const fn place_after_stages<T>(
    mut place: StageOffsets,
    mut stage: usize,
    dims: &[StageDims],
) -> StageOffsets {
    let mut rest = dims;
    while let Some((&first, after)) = rest.split_first() {
        let next = match after.first() {
            Some(dims) => dims.nx,
            None => 0,
        };
        place = StageOffsets::new::<T>(stage, first, next).placed_after(&place);
        stage += 1;
        rest = after;
    }
    place.end()
}

/// Returns a part of a slice, or an empty slice if it is out of range; length checks on entry
/// exclude that.
#[inline(always)]
pub(crate) fn part<T>(slice: &[T], begin: usize, length: usize) -> &[T] {
    slice.get(begin..).and_then(|rest| rest.get(..length)).unwrap_or_default()
}

/// Returns a mutable part of a slice, as [`part`].
#[inline(always)]
pub(crate) fn part_mut<T>(slice: &mut [T], begin: usize, length: usize) -> &mut [T] {
    slice.get_mut(begin..).and_then(|rest| rest.get_mut(..length)).unwrap_or_default()
}

/// Copies elements up to the shorter length.
#[inline(always)]
pub(crate) fn copy_common<T: Copy>(target: &mut [T], source: &[T]) {
    for (target, &source) in target.iter_mut().zip(source) {
        *target = source;
    }
}

/// Moves a part of a slice to an earlier position.
pub(crate) fn move_to_front<T: Copy>(slice: &mut [T], from: usize, to: usize, length: usize) {
    for i in 0..length {
        let value = slice.get(from + i).copied();
        if let (Some(target), Some(value)) = (slice.get_mut(to + i), value) {
            *target = value;
        }
    }
}

/// Splits off the first elements of a slice.
#[inline(always)]
pub(crate) fn take_mut<'a, T>(rest: &mut &'a mut [T], length: usize) -> &'a mut [T] {
    let (first, second) = core::mem::take(rest).split_at_mut_checked(length).unwrap_or_default();
    *rest = second;
    first
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backwards_is_forwards_reversed() {
        let dims = [(3, 2, 0), (9, 1, 4), (2, 12, 1), (5, 0, 2)].map(|(x, u, g)| StageDims::new(x, u, g));
        let parts = |p: StageOffsets| [p.stage, p.n, p.next, p.data, p.v, p.dynamics, p.row, p.factor];
        let forwards: alloc::vec::Vec<_> = StageOffsetsIter::<f32>::new(&dims).map(parts).collect();
        let mut backwards: alloc::vec::Vec<_> =
            StageOffsetsIter::<f32>::new(&dims).rev().map(parts).collect();
        backwards.reverse();
        assert_eq!(forwards, backwards);
        // With a known end, and from both ends.
        let mut known: alloc::vec::Vec<_> =
            StageOffsetsIter::<f32>::with_known_end(&dims, end::<f32>(&dims)).rev().map(parts).collect();
        known.reverse();
        assert_eq!(forwards, known);
        let mut places = StageOffsetsIter::<f32>::new(&dims).map(parts);
        let ends = [places.next(), places.next_back(), places.next(), places.next_back()];
        assert_eq!(ends.map(Option::unwrap), [0, 3, 1, 2].map(|stage| forwards[stage]));
        assert_eq!(forwards.iter().map(|p| p[2]).collect::<alloc::vec::Vec<_>>(), [9, 2, 5, 0]);
    }
}
