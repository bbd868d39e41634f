//! Setup of an integrator before each single interval, and conversion of its errors.

use crate::error::Error;
use crate::integrator::Integrator;
use crate::model::{Dae, VectorU, VectorX};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::dynamics::{Interval, IntervalResult, Nodes, Sink, vector};
use crate::scalar::Real;
use crate::shape::Shape;

/// Sets parameters and time of an integrator before an interval.
pub(in crate::ocp) trait IntervalSetup<T> {
    fn begin(&mut self, interval: &Interval<'_, T>) -> Result<(), Error>;
}

impl<T: Real, I: Integrator<Number = T>> IntervalSetup<T> for I {
    fn begin(&mut self, interval: &Interval<'_, T>) -> Result<(), Error> {
        if <<I::Model as Dae>::Shape as Shape>::NP > 0 {
            self.set_parameters(&interval.parameters())?;
        }
        self.set_time(interval.t)
    }
}

/// Evaluates all intervals, one after the other, each at its state and control.
///
/// # Errors
/// [`OcpError::Integration`]
pub(in crate::ocp) fn each<M: Dae, T: Real, D>(
    dynamics: &mut D,
    nodes: &Nodes<'_, T>,
    sink: Sink<'_, T>,
    integrate: impl for<'r> Fn(
        &'r mut D,
        &Interval<'_, T>,
        &VectorX<M, T>,
        &VectorU<M, T>,
    ) -> Result<IntervalResult<'r, T>, Error>,
) -> Result<(), OcpError> {
    for (k, interval) in nodes.iter().enumerate() {
        let step = integrate(dynamics, &interval, &vector(interval.x), &vector(interval.u));
        sink(k, &in_interval(k, step)?);
    }
    Ok(())
}

/// Converts the result of an integrator to the result of an interval.
///
/// # Errors
/// [`OcpError::Integration`]
pub(in crate::ocp) fn in_interval<V>(interval: usize, result: Result<V, Error>) -> Result<V, OcpError> {
    result.map_err(|error| OcpError::Integration { interval, error, phase: None })
}
