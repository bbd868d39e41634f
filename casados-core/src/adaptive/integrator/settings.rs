//! Settings for later calls.

use super::*;

impl<M: Dae, B: Engine<M, T>, T: Real> Integrator<M, B, T> {
    /// Sets the parameters `p` of all later calls.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]; the previous parameters remain set.
    pub fn set_parameters(&mut self, p: &VectorP<M, T>) -> Result<(), Error> {
        check_model_input::<M, T>(Argument::P, p.as_slice())?;
        self.workspace.parameters = *p;
        self.has_parameters = true;
        Ok(())
    }

    /// Sets the time at the start of the interval of all later calls; initially zero.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]; the previous time remains set.
    pub fn set_time(&mut self, t: T) -> Result<(), Error> {
        check_input(Argument::T, &[t])?;
        self.start_time = t;
        Ok(())
    }

    /// Sets the initial guess of `ẋ` and `z` for consistent initial values; initially the nominal
    /// values of the model, [`Dae::START`]. It selects one of several solutions.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]; the previous values remain set.
    pub fn set_start(&mut self, xdot: &VectorX<M, T>, z: &VectorZ<M, T>) -> Result<(), Error> {
        check_model_input::<M, T>(Argument::StartXdot, xdot.as_slice())?;
        check_model_input::<M, T>(Argument::StartZ, z.as_slice())?;
        stack_states::<M, T>(&mut self.workspace.start_guess, xdot, z);
        Ok(())
    }

    /// Sets the relative tolerance of each state, which replaces that of the options.
    ///
    /// # Errors
    /// [`Error::InvalidOption`]; the previous tolerances remain set.
    pub fn set_relative_tolerances(&mut self, x: &VectorX<M, T>, z: &VectorZ<M, T>) -> Result<(), Error> {
        for rtol in x.as_slice().iter().chain(z.as_slice()) {
            check_rtol::<T>(rtol.to_f64())?;
        }
        stack_states::<M, T>(&mut self.workspace.tolerances.rtol, x, z);
        Ok(())
    }

    /// Sets the absolute tolerance of each state, which replaces that of the options.
    ///
    /// # Errors
    /// [`Error::InvalidOption`]; the previous tolerances remain set.
    pub fn set_absolute_tolerances(&mut self, x: &VectorX<M, T>, z: &VectorZ<M, T>) -> Result<(), Error> {
        for atol in x.as_slice().iter().chain(z.as_slice()) {
            check_atol::<T>(atol.to_f64())?;
        }
        stack_states::<M, T>(&mut self.workspace.tolerances.atol, x, z);
        Ok(())
    }

    /// Includes the sensitivities in the error control of all later calls: a step is accepted if
    /// the estimated errors of the states and of every column of `V = d(x, z)/d(x₀, u, p)` are
    /// below the tolerances.
    ///
    /// Without it the states alone determine the steps, and derivatives are the exact ones of these
    /// steps; their error relative to the derivatives of the solution need not follow the
    /// tolerance. The error of `V_rc` is measured by `atol_r / s_c + rtol_r |V_rc|`, with the
    /// magnitudes `s` of [`Integrator::set_sensitivity_scales`]. Results remain the exact
    /// derivatives of the accepted steps. Each step that the states accept is differentiated once
    /// more, in every call that chooses steps, `solve` included; frozen steps have no extra cost.
    /// With several intervals, and between events, `V` starts from the identity in each.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub fn control_sensitivities(&mut self, controlled: bool) -> Result<(), Error> {
        self.sensitivities = match self.sensitivities.take() {
            _ if !controlled => None,
            Some(there) => Some(there),
            None => {
                Some(Box::new(Variational::new(Box::new(MethodStepDifferentiator::<M, B, T>::default()))?))
            }
        };
        Ok(())
    }

    /// Sets the magnitudes of `x₀`, `u` and `p` that scale errors of sensitivities, `p̄` of CVODES.
    /// The default, also used for zeros, is the absolute value in each call, or one if that is
    /// zero.
    ///
    /// # Errors
    /// [`Error::InvalidOption`] if a magnitude is negative or not finite; the previous ones remain
    /// set.
    pub fn set_sensitivity_scales(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        p: &VectorP<M, T>,
    ) -> Result<(), Error> {
        let scales = || x0.as_slice().iter().chain(u.as_slice()).chain(p.as_slice());
        if let Some(scale) = scales().find(|scale| !(scale.is_finite() && **scale >= T::ZERO)) {
            let (option, value) = ("sensitivity_scales", scale.to_f64());
            return Err(Error::InvalidOption {
                option,
                value,
                reason: "a magnitude is finite and not below 0",
            });
        }
        for (to, from) in self.workspace.magnitudes.as_mut().iter_mut().zip(scales()) {
            *to = *from;
        }
        Ok(())
    }
}
