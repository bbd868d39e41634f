//! Couplings of variables of several stages: periodic states and shared controls.
//!
//! ```text
//! x₀[i] = x_N[i]        u_k[j] = u₀[j] at every stage k that has it
//! ```
//!
//! A shared control is for example a free parameter or the length of a horizon. Couplings have no
//! multipliers in a solution: the stationarity of coupled variables is the sum of their gradients.

use super::layout::StageDims;
use super::problem::{Qp, QpView};
use crate::scalar::Real;

impl<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Qp<T, D, M> {
    /// Couples a state of the last stage to that of the first, `x₀[i] = x_N[i]`; returns whether
    /// both stages have it.
    pub fn make_periodic(&mut self, state: usize) -> bool {
        let (first, last) = ends(self.dims());
        let exists = state < first.nx.min(last.nx) && self.dims().len() > 1;
        exists && self.mark(state)
    }

    /// Couples a control over all stages that have it; returns whether the first stage has it.
    /// Bounds at any stage hold at all stages.
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
    /// Returns a mark for every state of the first stage: nonzero if it is periodic.
    pub(crate) fn periodic(&self) -> &'a [T] {
        self.marks.get(..ends(self.dims).0.nx).unwrap_or_default()
    }
    /// Returns a mark for every control of the first stage: nonzero if it is shared.
    pub(crate) fn shared(&self) -> &'a [T] {
        self.marks.get(ends(self.dims).0.nx..).unwrap_or_default()
    }
    /// Returns whether there are periodic states or shared controls.
    #[must_use]
    pub fn is_coupled(&self) -> bool {
        marked_indices(self.marks).next().is_some()
    }
}

/// Returns the indices of nonzero marks.
pub(crate) fn marked_indices<T: Real>(marks: &[T]) -> impl Iterator<Item = usize> + '_ {
    marks.iter().enumerate().filter(|(_, mark)| **mark != T::ZERO).map(|(i, _)| i)
}

/// Returns whether an index is marked.
pub(crate) fn is_marked<T: Real>(marks: &[T], index: usize) -> bool {
    marks.get(index).is_some_and(|&mark| mark != T::ZERO)
}

/// Returns the first and the last dimensions.
fn ends(dims: &[StageDims]) -> (StageDims, StageDims) {
    (dims.first().copied().unwrap_or_default(), dims.last().copied().unwrap_or_default())
}
