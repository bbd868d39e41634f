//! Variables of several stages that are one and the same: periodic states and shared controls.
//!
//! ```text
//! x₀[i] = x_N[i]        u_k[j] = u₀[j] at every stage k that has it
//! ```
//!
//! A shared control is a parameter to be found, or the length of a horizon. These conditions have
//! no multipliers in a solution: the gradient of the Lagrangian in variables that are one is the
//! sum of its elements in all of them.

use super::layout::StageDims;
use super::problem::{Qp, QpView};
use crate::scalar::Real;

impl<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Qp<T, D, M> {
    /// Makes a state of the last stage that of the first one, `x₀[i] = x_N[i]`; whether both have
    /// it.
    pub fn make_periodic(&mut self, state: usize) -> bool {
        let (first, last) = ends(self.dims());
        let exists = state < first.nx.min(last.nx) && self.dims().len() > 1;
        exists && self.mark(state)
    }

    /// Makes a control the same at all stages that have it; whether the first one has. Bounds at
    /// any stage are bounds of all.
    pub fn share(&mut self, control: usize) -> bool {
        let (first, _) = ends(self.dims());
        control < first.nu && self.mark(first.nx + control)
    }

    fn mark(&mut self, index: usize) -> bool {
        match self.marks_mut().get_mut(index) {
            Some(mark) => *mark = T::ONE,
            None => return false,
        }
        true
    }
}

impl<'a, T: Real> QpView<'a, T> {
    /// For every state of the first stage whether it is periodic: not zero.
    pub(crate) fn periodic(&self) -> &'a [T] {
        self.marks.get(..ends(self.dims).0.nx).unwrap_or_default()
    }
    /// For every control of the first stage whether it is shared.
    pub(crate) fn shared(&self) -> &'a [T] {
        self.marks.get(ends(self.dims).0.nx..).unwrap_or_default()
    }
    /// Whether there are periodic states or shared controls.
    #[must_use]
    pub fn is_coupled(&self) -> bool {
        marked_indices(self.marks).next().is_some()
    }
}

/// The indices of marks.
pub(crate) fn marked_indices<T: Real>(marks: &[T]) -> impl Iterator<Item = usize> + '_ {
    marks.iter().enumerate().filter(|(_, mark)| **mark != T::ZERO).map(|(i, _)| i)
}

/// Whether there is a mark.
pub(crate) fn is_marked<T: Real>(marks: &[T], index: usize) -> bool {
    marks.get(index).is_some_and(|&mark| mark != T::ZERO)
}

/// The first and the last dimensions.
fn ends(dims: &[StageDims]) -> (StageDims, StageDims) {
    (dims.first().copied().unwrap_or_default(), dims.last().copied().unwrap_or_default())
}
