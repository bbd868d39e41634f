//! Newton's equations of the barrier problem, over the memory of a run.
//!
//! With the QP written at the iterate, one step of the interior point of QPs from there is a step of
//! that of the nonlinear problem: same slacks, same multipliers, exact Hessians.

use crate::qp::interior::{Counts, First, Iterate, Largest, Penalties, Sides, count, is_first_fixed};
use super::run::Work;
use crate::qp::{Field, QpError, QpView, SolutionView, Store, assign};
use crate::scalar::{Packed, Real, Registers};

/// What is known about the sides of a problem before any memory is touched.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lengths {
    pub counts: Counts,
    pub fixed: bool,
    pub numbers: usize,
}

impl Lengths {
    /// Of a problem with its penalties as they are, or with all bounds soft.
    pub fn of<T: Real>(qp: QpView<'_, T>, penalties: Penalties<T>) -> Self {
        let fixed = is_first_fixed(qp);
        let counts = count(qp, fixed, penalties);
        Self { counts, fixed, numbers: Iterate::<T>::memory(qp.dims, &counts) }
    }
}

/// The iterate of Newton's method in its memory. What is in the memory stays as it was; bounds are
/// those of the QP.
///
/// # Errors
/// [`QpError::OutOfMemory`], [`QpError::Dimension`]
pub(super) fn attach<'a, T: Real>(
    qp: QpView<'a, T>,
    lengths: &Lengths,
    numbers: &'a mut impl Store<T>,
    indices: &'a mut impl Store<u32>,
) -> Result<Iterate<'a, T>, QpError> {
    let mut numbers = numbers.at_least(lengths.numbers, Field::Numbers)?;
    let mut indices = indices.at_least(lengths.counts.indices(), Field::Indices)?;
    let first = if lengths.fixed { First::Fixed } else { First::Free };
    let sides =
        Sides::list(qp, lengths.fixed, Penalties::Given, lengths.counts, &mut numbers, &mut indices);
    Ok(Iterate::new(qp, first, sides, &mut numbers))
}

/// Evaluates all residuals at the iterate; multipliers `π` of the dynamics are those that make the
/// gradient of the Lagrangian in the states zero.
pub(super) fn evaluate<T: Real>(iterate: &mut Iterate<'_, T>, solution: &mut SolutionView<'_, T>) -> Largest<T> {
    let mut result = None;
    iterate.take_point(solution);
    iterate.give_initial_state();
    T::registers(Evaluate { iterate, pi: solution.dynamics, result: &mut result });
    result.unwrap_or(Largest::ZERO)
}

struct Evaluate<'r, 'a, 's, T> {
    iterate: &'r mut Iterate<'a, T>,
    pi: &'s mut [T],
    result: &'r mut Option<Largest<T>>,
}

impl<T: Real> Registers<T> for Evaluate<'_, '_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let _ = self.iterate.evaluate::<E>(self.pi);
        *self.result = Some(self.iterate.residuals::<E>());
    }
}

/// Residuals of what is linear in the QP at the iterate, after its constants have changed.
pub(super) fn evaluate_values<T: Real>(iterate: &mut Iterate<'_, T>) {
    T::registers(EvaluateValues { iterate });
}

struct EvaluateValues<'r, 'a, T> {
    iterate: &'r mut Iterate<'a, T>,
}

impl<T: Real> Registers<T> for EvaluateValues<'_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        self.iterate.evaluate_values::<E>();
    }
}

/// A step towards products of slacks and multipliers that are all `μ`.
///
/// # Errors
/// [`QpError::NotConvex`] where the reduced Hessian, with `δ` on the diagonal, is not positive
/// definite.
pub(super) fn step<T: Real>(iterate: &mut Iterate<'_, T>, mu: T, delta: T) -> Result<(), QpError> {
    let mut result = Ok(());
    iterate.proximal = delta;
    T::registers(Step { iterate, mu, result: &mut result });
    result
}

struct Step<'r, 'a, T> {
    iterate: &'r mut Iterate<'a, T>,
    mu: T,
    result: &'r mut Result<(), QpError>,
}

impl<T: Real> Registers<T> for Step<'_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        self.iterate.sides.aim(self.mu);
        *self.result = self.iterate.newton::<E>(true);
    }
}

/// The multipliers `π` after the full step, into `work.pi`. The point and its multipliers are put
/// back bit by bit.
pub(super) fn dynamics_after<T: Real>(iterate: &mut Iterate<'_, T>, work: &mut Work<'_, T>) {
    assign(work.rows, iterate.v);
    assign(work.slacks, iterate.sides.multiplier);
    assign(work.ends, iterate.sides.free);
    T::registers(After { iterate, pi: work.pi });
    assign(iterate.v, work.rows);
    assign(iterate.sides.multiplier, work.slacks);
    assign(iterate.sides.free, work.ends);
}

struct After<'r, 'a, 's, T> {
    iterate: &'r mut Iterate<'a, T>,
    pi: &'s mut [T],
}

impl<T: Real> Registers<T> for After<'_, '_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        self.iterate.go_to_multipliers();
        self.iterate.evaluate_gradient::<E>(self.pi);
    }
}

/// Newton's step at the same point after the constants of linear conditions have changed.
///
/// # Errors
/// Those of [`step`].
pub(super) fn resolve<T: Real>(iterate: &mut Iterate<'_, T>, mu: T, delta: f64) -> Result<(), QpError> {
    step(iterate, mu, T::from_f64(delta))
}
