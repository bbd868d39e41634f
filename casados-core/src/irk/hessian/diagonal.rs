//! Second derivatives on the diagonal that need no row of `D`: of a direction itself.

use crate::irk::directions::Identity;
use crate::linalg::{Arithmetic, Kernel};
use crate::model::Dae;
use crate::scalar::Lanes;
use crate::shape::Array;
use core::marker::PhantomData;

/// Second derivatives in a control or a parameter alone: its row of `D_i` is that of the unit
/// matrix.
pub(in crate::irk) struct Diagonal<'a, M, E, R, const S: usize> {
    pub entries: &'a [[E; S]],
    pub sum: &'a mut [R],
    pub model: PhantomData<M>,
}

impl<M: Dae, E: Lanes, R: Array<E>, const S: usize> Kernel for Diagonal<'_, M, E, R, S> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        for diagonal_controls in M::STRUCTURE.diagonal_controls {
            let Some(column) = Identity::<M>::column(diagonal_controls.direction as usize) else { continue };
            let (Some(entries), Some(row)) =
                (self.entries.get(diagonal_controls.entry as usize), self.sum.get_mut(column))
            else {
                continue;
            };
            let Some(to) = row.as_mut().get_mut(column) else { continue };
            for &entry in entries {
                *to = A::subtract(*to, E::from_f64(1.0), entry);
            }
        }
    }
}
