//! Integrators that wrap others as dynamics: with a projection, and divided intervals.

use super::begin::at;
use super::dynamics::{Dynamics, Interval, Nodes, SecondOrder, Sink, vector};
use super::error::OcpError;
use super::names::Names;
use super::single::names;
use crate::constrained::{Projectable, Projected};
use crate::error::Error;
use crate::integrator::{Divided, Integrator};
use crate::memory::{WithForward, WithHessian};
use crate::model::{Dae, VectorU, VectorX};
use crate::scalar::Real;
use crate::shape::Shape;

/// State and control.
type Point<M, T> = (VectorX<M, T>, VectorU<M, T>);

/// Parameters, time, state and control of an interval.
fn begin<M: Dae, T: Real, I: Integrator<Model = M, Number = T>>(
    integrator: &mut I,
    interval: &Interval<'_, T>,
) -> Result<Point<M, T>, Error> {
    if <M::Shape as Shape>::NP > 0 {
        integrator.set_parameters(&vector(interval.p))?;
    }
    integrator.set_time(interval.t)?;
    Ok((vector(interval.x), vector(interval.u)))
}

macro_rules! dynamics {
    ([$($generics:tt)*] $model:ident, $type:ty) => {
        impl<M: $model, T: Real, $($generics)*> Dynamics<T> for $type
        where
            I: Integrator<Model = M, Number = T, Memory: WithForward>,
        {
            type Shape = M::Shape;
            const NAMES: Names = names::<M>();

            fn simulate(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
                for (k, interval) in nodes.iter().enumerate() {
                    let (x, u) = at(k, begin(self, &interval))?;
                    let result = at(k, self.solve(&x, &u, interval.h))?;
                    sink(k, &result.into());
                }
                Ok(())
            }
            fn linearise(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
                for (k, interval) in nodes.iter().enumerate() {
                    let (x, u) = at(k, begin(self, &interval))?;
                    let result = at(k, self.forward(&x, &u, interval.h))?;
                    sink(k, &result.into());
                }
                Ok(())
            }
        }

        impl<M: $model, T: Real, $($generics)*> SecondOrder<T> for $type
        where
            I: Integrator<Model = M, Number = T, Memory: WithHessian>,
        {
            fn second_order(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
                for (k, interval) in nodes.iter().enumerate() {
                    let (x, u) = at(k, begin(self, &interval))?;
                    let lambda: VectorX<M, T> = vector(interval.multipliers);
                    let result = at(k, self.hessian(&x, &u, interval.h, &lambda))?;
                    sink(k, &result.into());
                }
                Ok(())
            }
        }
    };
}

dynamics!([I] Projectable, Projected<I>);
dynamics!([I, const N: usize] Dae, Divided<I, N>);
