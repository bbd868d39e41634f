//! The constants of all calls: the method and the equations of the model.

use crate::model::{ArrayK, ArrayW, Ode};
use crate::scalar::{Lanes, Scalar};
use crate::shape::{Array, InBounds, Shape};
use crate::tableau::Tableau;
use bytemuck::Zeroable;

/// The state that an equation determines: `ẋ_state = factor · f`, with the residual `f` at `ẋ = 0`.
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
pub(crate) struct StateEquation<T> {
    pub state: usize,
    pub factor: T,
}

/// The constants of all calls: the method in the number type, and the equations of the model.
pub(crate) struct Scheme<M: Ode, E: Lanes, const S: usize> {
    pub a: [[E; S]; S],
    pub b: [E; S],
    pub c: [E; S],
    /// The state of each equation.
    pub equations: ArrayK<M, StateEquation<E>>,
    /// Whether the model has a second derivative with respect to the variable of each element of
    /// `w`.
    pub is_nonlinear: ArrayW<M, bool>,
}

impl<M: Ode, E: Lanes, const S: usize> Clone for Scheme<M, E, S> {
    fn clone(&self) -> Self {
        let Self { a, b, c, equations: rows, is_nonlinear: curved } = *self;
        Self { a, b, c, equations: rows, is_nonlinear: curved }
    }
}

impl<M: Ode, E: Lanes, const S: usize> Scheme<M, E, S> {
    pub fn new(tableau: &Tableau<S>) -> Self {
        let mut rows =
            ArrayK::<M, StateEquation<E>>::from_fn(|_| StateEquation { state: 0, factor: E::zeroed() });
        for (state, &(row, coefficient)) in M::ROWS.iter().enumerate() {
            if let Some(row) = rows.as_mut().get_mut(row as usize).in_bounds() {
                *row = StateEquation { state, factor: E::from_f64(-1.0 / coefficient) };
            }
        }
        let mut is_nonlinear = ArrayW::<M, bool>::from_fn(|_| false);
        for entry in 0..M::STRUCTURE.hessian.len() {
            let directions = entry_directions::<M>(entry).map(|(row, column)| [row, column]);
            for direction in directions.into_iter().flatten() {
                if let Some(curved) = is_nonlinear.as_mut().get_mut(direction).in_bounds() {
                    *curved = true;
                }
            }
        }
        Self {
            a: tableau.a().map(|row| row.map(E::from_f64)),
            b: tableau.b().map(E::from_f64),
            c: tableau.c().map(E::from_f64),
            equations: rows,
            is_nonlinear,
        }
    }
}

/// Returns the elements of `w` of an entry of the Hessian: `x`, `u`, `p` have the same order among
/// the variables and in `w`. `None` for an entry of `ẋ`, which occurs linearly.
pub(super) fn entry_directions<M: Ode>(entry: usize) -> Option<(usize, usize)> {
    let (row, column) = M::STRUCTURE.hessian.at(entry);
    Some((row.checked_sub(M::Shape::NX)?, column.checked_sub(M::Shape::NX)?))
}

/// Equal steps from `start_time` on.
#[derive(Clone, Copy)]
pub(crate) struct Grid<E> {
    pub start_time: E,
    /// Step size.
    pub h: E,
    pub steps: usize,
    /// Whether sums over the steps are compensated.
    pub compensated: bool,
}

/// Whether a coefficient of a tableau is zero.
#[inline(always)]
pub(super) fn is_zero<E: Lanes>(coefficient: E) -> bool {
    E::all(Scalar::eq(coefficient, E::zeroed()))
}
