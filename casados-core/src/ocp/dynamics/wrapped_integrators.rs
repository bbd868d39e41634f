//! Wrapped integrators as dynamics: with projection, and with divided intervals.

use crate::constrained::{Projectable, Projected};
use crate::integrator::{Divided, Integrator};
use crate::memory::{WithForward, WithHessian};
use crate::model::Dae;
use crate::ocp::dynamics::interval_setup::{IntervalSetup, each};
use crate::ocp::dynamics::single_interval::names;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::dynamics::{Dynamics, Nodes, SecondOrder, Sink, vector};
use crate::ocp::formulation::names::Names;
use crate::scalar::Real;

macro_rules! dynamics {
    ([$($generics:tt)*] $model:ident, $type:ty) => {
        impl<M: $model, T: Real, $($generics)*> Dynamics<T> for $type
        where
            I: Integrator<Model = M, Number = T, Memory: WithForward>,
        {
            type Shape = M::Shape;
            const NAMES: Names = names::<M>();

            fn simulate(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
                each::<M, T, _>(self, nodes, sink, |integrator, at, x, u| {
                    integrator.begin(at)?;
                    Ok(integrator.solve(x, u, at.h)?.into())
                })
            }
            fn linearise(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
                each::<M, T, _>(self, nodes, sink, |integrator, at, x, u| {
                    integrator.begin(at)?;
                    Ok(integrator.forward(x, u, at.h)?.into())
                })
            }
        }

        impl<M: $model, T: Real, $($generics)*> SecondOrder<T> for $type
        where
            I: Integrator<Model = M, Number = T, Memory: WithHessian>,
        {
            fn second_order(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
                each::<M, T, _>(self, nodes, sink, |integrator, at, x, u| {
                    integrator.begin(at)?;
                    Ok(integrator.hessian(x, u, at.h, &vector(at.multipliers))?.into())
                })
            }
        }
    };
}

dynamics!([I] Projectable, Projected<I>);
dynamics!([I, const N: usize] Dae, Divided<I, N>);
