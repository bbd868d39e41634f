//! Conditions between the first and the last state: periodic orbits.
//!
//! ```text
//! x₀[i] = x_N[i]        Lagrangian: … + θᵀ (x₀ − x_N)
//! ```

use super::data::split;
use super::dynamics::Dynamics;
use super::error::{OcpError, Text};
use super::instance::Ocp;
use super::problem::Formulation;
use crate::qp::{Solution, StageDims};
use crate::scalar::Real;

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Makes states periodic, `x₀ = x_N`: one, or all that a name means (`x` means `x[0]`, `x[1]`,
    /// …). The initial state is to be free. [`Ipm`](super::Ipm) solves such problems.
    ///
    /// # Errors
    /// [`OcpError::UnknownName`]
    pub fn periodic(&mut self, name: &str) -> Result<&mut Self, OcpError> {
        let known = <P::Dynamics as Dynamics<T>>::NAMES;
        let data = split::<P, T>(self.data.as_mut(), self.qp.dims().len().saturating_sub(1));
        let mut found = false;
        for (tied, variable) in data.tied.iter_mut().zip(known.x) {
            if super::bounds::means(name, variable) {
                (*tied, found) = (T::ONE, true);
            }
        }
        if found { Ok(self) } else { Err(OcpError::UnknownName { name: Text::new(name), known }) }
    }

    /// Which states are periodic, and the multipliers of that.
    pub(crate) fn coupling(&mut self) -> (&[T], &mut [T]) {
        let data = split::<P, T>(self.data.as_mut(), self.qp.dims().len().saturating_sub(1));
        (data.tied, data.coupling_multipliers)
    }

    /// Finds states that are periodic where nobody can solve that.
    ///
    /// # Errors
    /// [`OcpError::Periodic`]
    pub(super) fn is_uncoupled(&mut self) -> Result<(), OcpError> {
        let is_free = self.coupling().0.iter().all(|&tied| tied == T::ZERO);
        if is_free { Ok(()) } else { Err(OcpError::Periodic) }
    }

    /// Adds the terms of the conditions to the gradients of the QP.
    pub(super) fn couple(&mut self) {
        let intervals = self.qp.dims().len().saturating_sub(1);
        let data = split::<P, T>(self.data.as_mut(), intervals);
        if data.tied.iter().all(|&tied| tied == T::ZERO) {
            return;
        }
        for (stage, sign) in [(0, T::ONE), (intervals, -T::ONE)] {
            let Some(mut stage) = self.qp.stage_mut(stage) else { return };
            let gradient = stage.arrays().gradient;
            for ((gradient, &tied), &theta) in
                gradient.iter_mut().zip(&*data.tied).zip(&*data.coupling_multipliers)
            {
                *gradient = *gradient + sign * tied * theta;
            }
        }
    }
}

/// `x₀ − x_N` of the states that are tied.
pub(super) fn gaps<'a, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    tied: &'a [T],
    at: &'a Solution<T, D, M>,
) -> impl Iterator<Item = T> + 'a {
    let mut stages = at.stages();
    let first = stages.next().map_or(&[][..], |stage| stage.x);
    let last = stages.next_back().map_or(&[][..], |stage| stage.x);
    tied.iter().zip(first.iter().zip(last)).map(|(&tied, (&first, &last))| tied * (first - last))
}
