//! Arrays that have the numbers of all stages side by side, looked at from a stage on.
#![allow(unsafe_code)]

use crate::shape::{Array, Plain};
use bytemuck::Zeroable;
use core::ops::{Deref, DerefMut};

/// An array of cells `[T; S]`, and a cell's worth of numbers behind it.
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
#[zeroable(bound = "A: Zeroable, T: Zeroable")]
#[repr(C)]
pub(crate) struct Stages<A, T, const S: usize> {
    cells: A,
    /// For the last cells of what begins with another stage: nothing that is looked for there is ever written.
    beyond: [T; S],
}

impl<A, T, const S: usize> Deref for Stages<A, T, S> {
    type Target = A;
    #[inline(always)]
    fn deref(&self) -> &A {
        &self.cells
    }
}

impl<A, T, const S: usize> DerefMut for Stages<A, T, S> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut A {
        &mut self.cells
    }
}

impl<A: Array<[T; S]>, T: Plain, const S: usize> Stages<A, T, S> {
    /// Cells that begin with the number of a stage.
    #[inline(always)]
    pub fn from(&self, stage: usize) -> &A {
        let stage = stage.min(S);
        // SAFETY: `A` is an array of `[T; S]`, the only type that is an `Array` of these; behind it, in the same struct and without a
        // gap, as both are aligned as `T` is, lie `S` more of `T`. So from its number `stage ≤ S` on there are as many as it has, which
        // are numbers, aligned as they ask, and borrowed with `self`.
        unsafe { &*core::ptr::from_ref(self).cast::<T>().add(stage).cast::<A>() }
    }

    /// Cells that begin with the number of a stage.
    #[inline(always)]
    pub fn from_mut(&mut self, stage: usize) -> &mut A {
        let stage = stage.min(S);
        // SAFETY: as above.
        unsafe { &mut *core::ptr::from_mut(self).cast::<T>().add(stage).cast::<A>() }
    }
}
