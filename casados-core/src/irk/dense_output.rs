//! Dense output: the collocation polynomial of the step that contains the time.
//!
//! ```text
//! x(t_n + θh) = x_n + h Σ_i b_i(θ) k_i        z(t_n + θh) = Σ_i ℓ_i(θ) z_i
//! ```

use super::forward::memory::ForwardMemory;
use super::step::interpolate_algebraic;
use super::workspace::{Inputs, Step};
use crate::error::{Argument, Error};
use crate::finite::check_output;
use crate::irk::coefficients::dot;
use crate::memory::Fallback;
use crate::model::Dae;
use crate::result::Dense;
use crate::scalar::Real;
use crate::shape::Matrix;
use crate::tableau::Tableau;

/// The step that contains a time, and the weights at that time.
pub(crate) struct StepPoint<T, const S: usize> {
    pub step: usize,
    /// `b_i(θ)`
    weights: [T; S],
    /// `ℓ_i(θ)`
    lagrange: [T; S],
}

impl<T: Real, const S: usize> StepPoint<T, S> {
    /// # Errors
    /// [`Error::NonFiniteInput`], [`Error::OutsideInterval`], [`Error::NoInterpolation`]
    pub(crate) fn new<M: Dae>(
        t: T,
        inputs: &Inputs<M, T>,
        steps: usize,
        tableau: &Tableau<S>,
    ) -> Result<Self, Error> {
        if !t.is_finite() {
            return Err(Error::NonFiniteInput {
                argument: Argument::T,
                index: 0,
                name: "",
                value: t.to_f64(),
            });
        }
        if !tableau.is_collocation() {
            return Err(Error::NoInterpolation);
        }
        let (start, end) = (inputs.time.start, inputs.time.start + inputs.time.interval);
        let inside = if start <= end { start <= t && t <= end } else { end <= t && t <= start };
        if !inside {
            return Err(Error::OutsideInterval { t: t.to_f64(), start: start.to_f64(), end: end.to_f64() });
        }
        let position = if t == start {
            0.0
        } else if t == end {
            steps as f64
        } else {
            (t - start).to_f64() / inputs.time.step.to_f64()
        };
        // The cast saturates, so that `min` returns the last step for large values.
        let step = (position as usize).min(steps - 1);
        let theta = position - step as f64;
        Ok(Self {
            step,
            weights: tableau.weights(theta).map(T::from_f64),
            lagrange: tableau.lagrange(theta).map(T::from_f64),
        })
    }

    /// # Errors
    /// [`Error::Overflow`]
    pub(crate) fn evaluate<M: Dae>(
        &self,
        step: &Step<M, T, S>,
        h: T,
        result: &mut Dense<M, T>,
    ) -> Result<(), Error> {
        for ((to, x), k) in result.x.as_mut_slice().iter_mut().zip(step.x.as_ref()).zip(step.y.as_ref()) {
            *to = *x + h * dot(&self.weights, k);
        }
        interpolate_algebraic::<M, T, S>(result.z.as_mut_slice(), &step.y, &self.lagrange);
        check_output(result.x.as_slice(), self.step)?;
        check_output(result.z.as_slice(), self.step)
    }

    /// # Errors
    /// [`Error::Overflow`]
    pub(crate) fn differentiate<M: Dae, F: Fallback>(
        &self,
        h: T,
        memory: &mut ForwardMemory<M, T, S>,
    ) -> Result<(), Error> {
        memory.interpolate::<F>(&self.weights.map(|weight| h * weight), &self.lagrange);
        let dense = &memory.dense;
        for values in [
            dense.dx_dx0.as_slice(),
            dense.dx_du.as_slice(),
            dense.dx_dp.as_slice(),
            dense.dz_dx0.as_slice(),
            dense.dz_du.as_slice(),
            dense.dz_dp.as_slice(),
        ] {
            check_output(values, self.step)?;
        }
        Ok(())
    }
}
