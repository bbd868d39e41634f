//! Arrays with the numbers of all stages adjacent, and views of them that begin with a stage.
#![allow(unsafe_code)]

use crate::shape::{Array, Plain};
use bytemuck::Zeroable;
use core::ops::{Deref, DerefMut};

/// An array of cells `[T; S]`, followed by one cell of padding.
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
#[zeroable(bound = "A: Zeroable, T: Zeroable")]
#[repr(C)]
pub(crate) struct StageArray<A, T, const S: usize> {
    cells: A,
    /// Padding of views that begin with a later stage: their last cells extend into it. It is never
    /// written.
    padding: [T; S],
}

impl<A, T, const S: usize> Deref for StageArray<A, T, S> {
    type Target = A;
    #[inline(always)]
    fn deref(&self) -> &A {
        &self.cells
    }
}

impl<A, T, const S: usize> DerefMut for StageArray<A, T, S> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut A {
        &mut self.cells
    }
}

impl<A: Array<[T; S]>, T: Plain, const S: usize> StageArray<A, T, S> {
    /// A view of the array whose cells begin with the number of a stage.
    #[inline(always)]
    pub fn stage_view(&self, stage: usize) -> &A {
        let stage = stage.min(S);
        // SAFETY: `A` is an array of `[T; S]`, the only type that is an `Array` of these. `S` more
        // numbers `T` follow it in the same struct, without a gap, since both are aligned as `T`.
        // So the memory from number `stage ≤ S` on contains as many initialised and aligned numbers
        // as `A`, borrowed with `self`.
        unsafe { &*core::ptr::from_ref(self).cast::<T>().add(stage).cast::<A>() }
    }

    /// A view of the array whose cells begin with the number of a stage.
    #[inline(always)]
    pub fn stage_view_mut(&mut self, stage: usize) -> &mut A {
        let stage = stage.min(S);
        // SAFETY: as above.
        unsafe { &mut *core::ptr::from_mut(self).cast::<T>().add(stage).cast::<A>() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A view contains the numbers of its stage, in the order of the cells; writing to it changes
    /// nothing else.
    #[test]
    fn first_numbers_are_those_of_the_stage() {
        let mut stages: StageArray<[[f64; 4]; 3], f64, 4> = Zeroable::zeroed();
        for stage in 0..4 {
            for (cell, first) in stages.stage_view_mut(stage).iter_mut().enumerate() {
                first[0] = (10 * cell + stage) as f64;
            }
        }
        assert_eq!(*stages, [[0.0, 1.0, 2.0, 3.0], [10.0, 11.0, 12.0, 13.0], [20.0, 21.0, 22.0, 23.0]]);
        assert_eq!(stages.padding, [0.0; 4]);
        for stage in 0..4 {
            let seen = stages.stage_view(stage);
            assert_eq!(seen.map(|cell| cell[0]), [0.0, 10.0, 20.0].map(|first| first + stage as f64));
        }
        // A view beyond the last stage begins with the padding.
        assert_eq!(stages.stage_view(9)[2], [0.0; 4]);
    }
}
