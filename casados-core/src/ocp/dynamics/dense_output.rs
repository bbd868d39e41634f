//! Dense output of integrators of single intervals.

use crate::error::Error;
use crate::memory::Memory;
use crate::model::{Dae, Ode, VectorU, VectorX};
use crate::ocp::dynamics::interval_setup::{IntervalSetup, in_interval};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::dynamics::{Interval, IntervalResult, Nodes, Sink, vector};
use crate::scalar::Real;
use crate::shape::Matrix;
use crate::{erk, irk};

/// Receives an index, and the states and algebraic states at this fraction of an interval.
pub(in crate::ocp) type StateVisitor<'a, T> = &'a mut dyn FnMut(usize, &[T], &[T]);

/// An integrator with dense output inside an interval.
pub(in crate::ocp) trait DenseOutput<T>: IntervalSetup<T> {
    /// Evaluates states and algebraic states at fractions of an interval, after
    /// [`IntervalSetup::begin`].
    ///
    /// # Errors
    /// The errors of the integrator.
    fn states_at_fractions(
        &mut self,
        interval: &Interval<'_, T>,
        parts: &[T],
        visit: StateVisitor<'_, T>,
    ) -> Result<(), Error>;
}

/// By the collocation polynomial, or, for tableaux without one, by integrating shorter intervals.
impl<M: Dae, B, const S: usize, T: Real, W: Memory> DenseOutput<T> for irk::Integrator<M, B, S, T, W> {
    fn states_at_fractions(
        &mut self,
        interval: &Interval<'_, T>,
        parts: &[T],
        visit: StateVisitor<'_, T>,
    ) -> Result<(), Error> {
        let (x, u): (VectorX<M, T>, VectorU<M, T>) = (vector(interval.x), vector(interval.u));
        let has_polynomial = self.tableau().is_collocation();
        if has_polynomial {
            self.solve(&x, &u, interval.h)?;
        }
        for (j, &part) in parts.iter().enumerate() {
            if has_polynomial {
                let dense = self.dense(interval.t + part * interval.h)?;
                visit(j, dense.x.as_slice(), dense.z.as_slice());
            } else {
                let end = self.solve(&x, &u, part * interval.h)?;
                visit(j, end.x.as_slice(), end.z.as_slice());
            }
        }
        Ok(())
    }
}

impl<M: Ode, B, const S: usize, T: Real, W: Memory> DenseOutput<T> for erk::Integrator<M, B, S, T, W> {
    fn states_at_fractions(
        &mut self,
        interval: &Interval<'_, T>,
        parts: &[T],
        visit: StateVisitor<'_, T>,
    ) -> Result<(), Error> {
        let (x, u): (VectorX<M, T>, VectorU<M, T>) = (vector(interval.x), vector(interval.u));
        for (j, &part) in parts.iter().enumerate() {
            visit(j, self.solve(&x, &u, part * interval.h)?.x.as_slice(), &[]);
        }
        Ok(())
    }
}

/// Evaluates states and algebraic states at fractions of all intervals, one interval after the
/// other.
///
/// # Errors
/// [`OcpError::Integration`]
pub(in crate::ocp) fn for_each_interval_inside<T: Real>(
    integrator: &mut impl DenseOutput<T>,
    nodes: &Nodes<'_, T>,
    parts: &[T],
    sink: Sink<'_, T>,
) -> Result<bool, OcpError> {
    for (k, interval) in nodes.iter().enumerate() {
        in_interval(k, integrator.begin(&interval))?;
        let visit = &mut |j, x: &[T], z: &[T]| {
            sink(k * parts.len() + j, &IntervalResult { x, z, ..IntervalResult::default() })
        };
        in_interval(k, integrator.states_at_fractions(&interval, parts, visit))?;
    }
    Ok(true)
}
