//! Variables of several stages that are one: periodic orbits, parameters that are found, free end
//! times.
//!
//! ```text
//! x₀[i] = x_N[i]        u_k[j] = u₀[j]
//! ```

use super::bounds::means;
use super::dynamics::Dynamics;
use super::error::{OcpError, Text};
use super::instance::Ocp;
use super::problem::Formulation;
use crate::qp::{StageDims, marked};
use crate::scalar::Real;

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Makes states periodic, `x₀ = x_N`: one, or all that a name means (`x` means `x[0]`, `x[1]`,
    /// …). The initial state is to be free.
    ///
    /// # Errors
    /// [`OcpError::UnknownName`]
    pub fn periodic(&mut self, name: &str) -> Result<&mut Self, OcpError> {
        let known = <P::Dynamics as Dynamics<T>>::NAMES;
        let mut found = false;
        for (i, _) in known.x.iter().enumerate().filter(|(_, state)| means(name, state)) {
            found |= self.qp.make_periodic(i);
        }
        if found { Ok(self) } else { Err(OcpError::UnknownName { name: Text::new(name), known }) }
    }

    /// Makes controls the same at all stages, `u_k = u₀`: one, or all that a name means. These are
    /// parameters that are found, among them the length of the horizon: `dx/dτ = T f(x, u)` over
    /// `τ ∈ [0, 1]`, with `T` a control of the model that is shared.
    ///
    /// Their guess is that of stage 0. A bound at one stage is a bound of all: one at stage 0 is
    /// enough. What is a rate adds up to the value itself over a horizon of length one:
    /// `running_cost` of `T` is the duration.
    ///
    /// A shared control is no state with `Ṫ = 0`, which every stage would carry along, but one
    /// right-hand side more of the recursion.
    ///
    /// # Errors
    /// [`OcpError::UnknownName`]
    pub fn shared(&mut self, name: &str) -> Result<&mut Self, OcpError> {
        let known = <P::Dynamics as Dynamics<T>>::NAMES;
        let mut found = false;
        for (j, _) in known.u.iter().enumerate().filter(|(_, control)| means(name, control)) {
            found |= self.qp.share(j);
        }
        if found { Ok(self) } else { Err(OcpError::UnknownName { name: Text::new(name), known }) }
    }

    /// Refuses periodic states and shared controls where nobody can solve that.
    ///
    /// # Errors
    /// [`OcpError::Coupled`]
    pub(super) fn is_uncoupled(&self) -> Result<(), OcpError> {
        if self.qp().is_coupled() { Err(OcpError::Coupled) } else { Ok(()) }
    }

    /// Makes shared controls of the iterate those of stage 0.
    pub(super) fn join_controls(&mut self) {
        let intervals = self.intervals();
        for j in marked(self.qp.view().shared()) {
            let Some(value) = self.iterate.stage(0).and_then(|stage| stage.u.get(j).copied()) else { return };
            for k in 1..=intervals {
                if let Some(u) = self.iterate.stage_mut(k).and_then(|stage| stage.u.get_mut(j)) {
                    *u = value;
                }
            }
        }
    }

    /// Makes periodic states of the last stage of the iterate those of the first one.
    pub(super) fn join_states(&mut self) {
        let last = self.intervals();
        for i in marked(self.qp.view().periodic()) {
            let Some(value) = self.iterate.stage(0).and_then(|stage| stage.x.get(i).copied()) else { return };
            if let Some(x) = self.iterate.stage_mut(last).and_then(|stage| stage.x.get_mut(i)) {
                *x = value;
            }
        }
    }
}
