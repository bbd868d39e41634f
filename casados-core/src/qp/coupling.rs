//! Variables of several stages that are one and the same: periodic states and shared controls.
//!
//! ```text
//! x₀[i] = x_N[i]        u_k[j] = u₀[j] at every stage k that has it
//! ```
//!
//! A shared control is a parameter to be found, or the length of a horizon. These conditions have
//! no multipliers in a solution: the gradient of the Lagrangian in variables that are one is the
//! sum of its elements in all of them.

use super::check::{largest, of_control, of_state};
use super::layout::StageDims;
use super::problem::{Qp, QpView, Stage};
use super::solution::{Solution, SolutionStage};
use super::statistics::Residuals;
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
        marked(self.marks).next().is_some()
    }
}

/// The indices of marks.
pub(crate) fn marked<T: Real>(marks: &[T]) -> impl Iterator<Item = usize> + '_ {
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

/// Residuals of variables that are one: sums of gradients, and differences.
pub(super) fn residuals<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    qp: QpView<'_, T>,
    solution: &Solution<T, D, M>,
    result: &mut Residuals,
) {
    type Pair<'a, T> = (Stage<'a, T>, SolutionStage<'a, T>);
    let pairs = || qp.stages().zip(solution.stages());
    let (Some(first), Some(last)): (Option<Pair<'_, T>>, _) = (pairs().next(), pairs().next_back()) else {
        return;
    };
    let arriving = solution.stages().rev().nth(1).map_or(&[][..], |before| before.dynamics);
    for i in marked(qp.periodic()) {
        let sum = of_state(&first.0, &first.1, &[], i).0 + of_state(&last.0, &last.1, arriving, i).0;
        largest(&mut result.stationarity, sum);
        let at = |x: &[T]| x.get(i).map_or(0.0, |x| x.to_f64());
        largest(&mut result.dynamics, at(first.1.x) - at(last.1.x));
    }
    for j in marked(qp.shared()) {
        let at = |u: &[T]| u.get(j).map(|u| u.to_f64());
        let sum: f64 = pairs()
            .filter(|(_, point)| at(point.u).is_some())
            .map(|(data, point)| of_control(&data, &point, j).0)
            .sum();
        largest(&mut result.stationarity, sum);
        let of_first = at(first.1.u).unwrap_or(0.0);
        pairs()
            .filter_map(|(_, point)| at(point.u))
            .for_each(|u| largest(&mut result.dynamics, u - of_first));
    }
}
