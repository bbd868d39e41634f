//! Dimensions of the stages, and where each stage lies in flat memory.
//!
//! A stage has the variables `v = (x, u)`. Its matrices lie column after column, and every column
//! begins at a multiple of [`pad`] numbers, so that whole registers can be read from it. What is
//! padding is zero.

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
    /// Controls `u`. Those of the last stage cost something and are bounded, but move nothing.
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

/// `n` rounded up to whole registers (64 bytes, the widest there are) of numbers of type `T`. Where
/// there are no registers an even number is enough, which tiles need: firmware has half the memory
/// then, and nothing to compute with what is padding.
#[must_use]
pub(crate) const fn padded_len<T>(n: usize) -> usize {
    let width = if REGISTERS { 64 / size_of::<T>() } else { 2 };
    n.div_ceil(width) * width
}

/// One stage, its dimensions, and where its parts begin in the arrays of the horizon.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct StageOffsets {
    /// The stage.
    pub stage: usize,
    /// States.
    pub nx: usize,
    /// Controls.
    pub nu: usize,
    /// General constraints.
    pub ng: usize,
    /// States of the next stage; none after the last one.
    pub next: usize,
    /// `nx + nu`
    pub n: usize,
    /// The distance from column to column, `n` padded; also the length of a vector `v`.
    pub ld: usize,
    /// The length of a vector of next states, padded.
    pub ld_next: usize,
    /// The length of a vector over all constraints: `ld` for the bounds, `ng` padded for the
    /// general ones.
    pub rows: usize,
    /// Columns of the factors: those of the variables that are eliminated at this stage.
    pub pivots: usize,
    /// Begin of the data.
    pub data: usize,
    /// Begin in vectors `v` of the horizon.
    pub v: usize,
    /// Begin in vectors of next states.
    pub dynamics: usize,
    /// Begin in vectors over constraints.
    pub row: usize,
    /// Begin in the factors.
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
            // The first state is eliminated like a control where it is not given.
            pivots: if stage == 0 { n } else { dims.nu },
            data: 0,
            v: 0,
            dynamics: 0,
            row: 0,
            factor: 0,
        }
    }
    /// `[A B; C D]ᵀ`: a column for each next state and each general constraint.
    pub const fn matrix(&self) -> usize {
        self.ld * (self.next + self.ng)
    }
    /// `[Q Sᵀ; S R]`
    pub const fn hessian(&self) -> usize {
        self.ld * self.n
    }
    /// All data of the stage: matrix, Hessian, gradient, offset, and six vectors over its
    /// constraints.
    pub const fn data_len(&self) -> usize {
        self.matrix() + self.hessian() + self.ld + self.ld_next + 6 * self.rows
    }
    const fn factor_len(&self) -> usize {
        self.ld * self.pivots
    }
    /// The same parts, behind those of `before`.
    #[cfg_attr(feature = "std", inline(always))]
    const fn placed_after(mut self, before: &Self) -> Self {
        self.data = before.data + before.data_len();
        self.v = before.v + before.ld;
        self.dynamics = before.dynamics + before.ld_next;
        self.row = before.row + before.rows;
        self.factor = before.factor + before.factor_len();
        self
    }
    /// The same parts, before those of `after`.
    #[cfg_attr(feature = "std", inline(always))]
    const fn placed_before(mut self, after: &Self) -> Self {
        self.data = after.data.saturating_sub(self.data_len());
        self.v = after.v.saturating_sub(self.ld);
        self.dynamics = after.dynamics.saturating_sub(self.ld_next);
        self.row = after.row.saturating_sub(self.rows);
        self.factor = after.factor.saturating_sub(self.factor_len());
        self
    }
    /// The place behind this one, of a stage that is empty: its begins are lengths.
    const fn end(&self) -> Self {
        Self::new::<u8>(0, StageDims::new(0, 0, 0), 0).placed_after(self)
    }
}

/// How many states there are at the start.
pub(crate) const fn first_nx(dims: &[StageDims]) -> usize {
    match dims.first() {
        Some(first) => first.nx,
        None => 0,
    }
}

/// The places of all stages, forwards or backwards.
#[derive(Clone, Debug)]
pub(crate) struct Places<'a, T> {
    dims: &'a [StageDims],
    /// How many stages were taken from the front.
    taken: usize,
    /// States behind the last stage that is left.
    next: usize,
    number: PhantomData<T>,
    front: StageOffsets,
    /// Only where somebody goes backwards.
    back: Option<StageOffsets>,
}

impl<'a, T> Places<'a, T> {
    /// Those of stages with numbers of type `T`.
    pub fn new(dims: &'a [StageDims]) -> Self {
        Self { dims, taken: 0, next: 0, number: PhantomData, front: StageOffsets::default(), back: None }
    }
    /// The same, for whoever knows [`end`] and goes backwards.
    pub fn with_known_end(dims: &'a [StageDims], end: StageOffsets) -> Self {
        Self { back: Some(end), ..Self::new(dims) }
    }
}

impl<T> Iterator for Places<'_, T> {
    type Item = StageOffsets;

    // What nobody asks of a place is not computed where the optimiser sees who asks; in firmware
    // memory is dearer.
    #[cfg_attr(feature = "std", inline(always))]
    #[cfg_attr(not(feature = "std"), inline)]
    fn next(&mut self) -> Option<StageOffsets> {
        let (&first, rest) = self.dims.split_first()?;
        let next = rest.first().map_or(self.next, |dims| dims.nx);
        let place = StageOffsets::new::<T>(self.taken, first, next).placed_after(&self.front);
        (self.dims, self.front, self.taken) = (rest, place, self.taken + 1);
        Some(place)
    }
    fn size_hint(&self) -> (usize, Option<usize>) {
        (self.dims.len(), Some(self.dims.len()))
    }
}

impl<T> DoubleEndedIterator for Places<'_, T> {
    #[cfg_attr(feature = "std", inline(always))]
    #[cfg_attr(not(feature = "std"), inline)]
    fn next_back(&mut self) -> Option<StageOffsets> {
        let (&last, rest) = self.dims.split_last()?;
        let back = match self.back {
            Some(back) => back,
            None => place_after_stages::<T>(self.front, self.taken, self.dims),
        };
        let place = StageOffsets::new::<T>(self.taken + rest.len(), last, self.next).placed_before(&back);
        (self.dims, self.back, self.next) = (rest, Some(place), last.nx);
        Some(place)
    }
}

impl<T> ExactSizeIterator for Places<'_, T> {}
impl<T> FusedIterator for Places<'_, T> {}

/// The place behind the last stage: its begins are the lengths of the arrays of the horizon.
pub(crate) const fn end<T>(dims: &[StageDims]) -> StageOffsets {
    place_after_stages::<T>(StageOffsets::new::<T>(0, StageDims::new(0, 0, 0), 0), 0, dims)
}

/// Whether lengths of such a horizon are more than there is memory, and may be more than a `usize`
/// holds.
pub(crate) const fn exceeds_memory(dims: &[StageDims]) -> bool {
    let (mut total, mut rest): (u128, _) = (0, dims);
    while let Some((&first, after)) = rest.split_first() {
        let next = match after.first() {
            Some(dims) => dims.nx as u128,
            None => 0,
        };
        let (n, ng) = (first.nx as u128 + first.nu as u128 + 16, first.ng as u128 + 16);
        // Two of these are below 2¹³⁰ at most: what is larger than 2⁶³ each is too large by itself.
        let (most, columns) = (1 << 62, n + next + ng);
        if n > most || columns > most {
            return true;
        }
        total = total.saturating_add(16 * n * columns);
        rest = after;
    }
    total > (usize::MAX / 64) as u128
}

/// The place behind stages that follow a place, from that one on whose number is given.
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

/// A part of a slice; an empty one where it ends too early, which the lengths checked on entry
/// exclude.
#[inline(always)]
pub(crate) fn part<T>(slice: &[T], begin: usize, length: usize) -> &[T] {
    slice.get(begin..).and_then(|rest| rest.get(..length)).unwrap_or_default()
}

/// As [`part`].
#[inline(always)]
pub(crate) fn part_mut<T>(slice: &mut [T], begin: usize, length: usize) -> &mut [T] {
    slice.get_mut(begin..).and_then(|rest| rest.get_mut(..length)).unwrap_or_default()
}

/// Copies what both have.
#[inline(always)]
pub(crate) fn copy_common<T: Copy>(target: &mut [T], source: &[T]) {
    for (target, &source) in target.iter_mut().zip(source) {
        *target = source;
    }
}

/// Copies a part of a slice to an earlier place.
pub(crate) fn move_to_front<T: Copy>(slice: &mut [T], from: usize, to: usize, length: usize) {
    for i in 0..length {
        let value = slice.get(from + i).copied();
        if let (Some(target), Some(value)) = (slice.get_mut(to + i), value) {
            *target = value;
        }
    }
}

/// The first numbers of a slice, which loses them.
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
        let forwards: alloc::vec::Vec<_> = Places::<f32>::new(&dims).map(parts).collect();
        let mut backwards: alloc::vec::Vec<_> = Places::<f32>::new(&dims).rev().map(parts).collect();
        backwards.reverse();
        assert_eq!(forwards, backwards);
        // From where it is known to end, and from both sides.
        let mut known: alloc::vec::Vec<_> =
            Places::<f32>::with_known_end(&dims, end::<f32>(&dims)).rev().map(parts).collect();
        known.reverse();
        assert_eq!(forwards, known);
        let mut places = Places::<f32>::new(&dims).map(parts);
        let ends = [places.next(), places.next_back(), places.next(), places.next_back()];
        assert_eq!(ends.map(Option::unwrap), [0, 3, 1, 2].map(|stage| forwards[stage]));
        assert_eq!(forwards.iter().map(|p| p[2]).collect::<alloc::vec::Vec<_>>(), [9, 2, 5, 0]);
    }
}
