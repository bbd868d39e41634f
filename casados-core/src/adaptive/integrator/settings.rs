//! What is set for all following calls.

use super::*;

impl<M: Dae, B: Engine<M, T>, T: Real> Integrator<M, B, T> {
    /// The parameters `p` of all following calls.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]: then the last parameters stay.
    pub fn set_parameters(&mut self, p: &VectorP<M, T>) -> Result<(), Error> {
        check_model_input::<M, T>(Argument::P, p.as_slice())?;
        self.workspace.parameters = *p;
        self.has_parameters = true;
        Ok(())
    }

    /// The time at the start of the interval of all following calls; zero if never set.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]: then the last time stays.
    pub fn set_time(&mut self, t: T) -> Result<(), Error> {
        check_input(Argument::T, &[t])?;
        self.start_time = t;
        Ok(())
    }

    /// Start values `ẋ` and `z` from which consistent ones are found; if never set, the nominal
    /// values of the model, [`Dae::START`]. Where there are several solutions they decide for one.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]: then the last values stay.
    pub fn set_start(&mut self, xdot: &VectorX<M, T>, z: &VectorZ<M, T>) -> Result<(), Error> {
        check_model_input::<M, T>(Argument::StartXdot, xdot.as_slice())?;
        check_model_input::<M, T>(Argument::StartZ, z.as_slice())?;
        stack_states::<M, T>(&mut self.workspace.start_guess, xdot, z);
        Ok(())
    }

    /// The relative tolerance of each state, instead of that of the options.
    ///
    /// # Errors
    /// [`Error::InvalidOption`]: then the last ones stay.
    pub fn set_relative_tolerances(&mut self, x: &VectorX<M, T>, z: &VectorZ<M, T>) -> Result<(), Error> {
        for rtol in x.as_slice().iter().chain(z.as_slice()) {
            check_rtol::<T>(rtol.to_f64())?;
        }
        stack_states::<M, T>(&mut self.workspace.tolerances.rtol, x, z);
        Ok(())
    }

    /// The absolute tolerance of each state, instead of that of the options.
    ///
    /// # Errors
    /// [`Error::InvalidOption`]: then the last ones stay.
    pub fn set_absolute_tolerances(&mut self, x: &VectorX<M, T>, z: &VectorZ<M, T>) -> Result<(), Error> {
        for atol in x.as_slice().iter().chain(z.as_slice()) {
            check_atol::<T>(atol.to_f64())?;
        }
        stack_states::<M, T>(&mut self.workspace.tolerances.atol, x, z);
        Ok(())
    }

    /// Whether the derivatives of the solution take part in the choice of the steps of all
    /// following calls: then a step is accepted if its estimated errors of the states and of every
    /// column of `V = d(x, z)/d(x₀, u, p)` are below the tolerances.
    ///
    /// Without it steps are chosen for the states, and derivatives are the exact ones of these
    /// steps: those of the solution up to an error that need not follow the tolerance. The error of
    /// `V_rc` is measured by `atol_r / s_c + rtol_r |V_rc|`, with the magnitudes `s` of
    /// [`Integrator::set_sensitivity_scales`]. Results are still exact derivatives of the steps
    /// that are taken. Each step that the states accept is differentiated once more than without,
    /// in every call that chooses steps, `solve` included; steps that are frozen cost nothing more.
    /// Over several intervals, and between events, `V` begins as the identity in each.
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

    /// The magnitudes of `x₀`, `u` and `p` by which errors of derivatives are measured, as `p̄` of
    /// CVODES. For those that are zero, and if never set, the absolute value in each call, or one
    /// if that is zero.
    ///
    /// # Errors
    /// [`Error::InvalidOption`] if one is negative or not finite: then the last ones stay.
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
