//! The [`Engine`] of a family of implicit methods.

use crate::adaptive::engine::{Engine, MethodState};
use crate::adaptive::order::{MethodFamily, MethodsByOrder, interpolate_step};
use crate::adaptive::step::{AfterStep, Run, Span};
use crate::adaptive::tape::TapeEntry;
use crate::error::Error;
use crate::model::{Dae, VectorX};
use crate::result::Dense;
use crate::scalar::Real;

/// The memory of a family: its steps, and their derivatives.
pub struct ImplicitState<M: Dae, B: MethodFamily, T: Real> {
    orders: MethodsByOrder<M, T>,
    differentiator: B::Differentiator<M, T>,
}

impl<M: Dae, B: MethodFamily, T: Real> Default for ImplicitState<M, B, T> {
    fn default() -> Self {
        Self { orders: MethodsByOrder::default(), differentiator: Default::default() }
    }
}

impl<M: Dae, B: MethodFamily, T: Real> MethodState<M, T> for B {
    type State = ImplicitState<M, B, T>;
}

impl<M: Dae, B: MethodFamily, T: Real> Engine<M, T> for B {
    const ENDS_ON_STAGE: bool = B::ENDS_ON_STAGE;
    type Differentiator = B::Differentiator<M, T>;

    fn integrate(
        state: &mut Self::State,
        run: &mut Run<'_, M, T>,
        x0: &VectorX<M, T>,
        span: Span<T>,
        after: AfterStep<'_, M, T>,
    ) -> Result<(), Error> {
        run.integrate::<B>(&mut state.orders, x0, span, after)
    }

    fn interpolate(
        state: &mut Self::State,
        _: &[T],
        entry: &TapeEntry<T>,
        (x, y): (&[T], &[T]),
        t: T,
        dense: &mut Dense<M, T>,
    ) -> Result<(), Error> {
        let stages = state.orders.get::<B>(entry.order_index)?;
        interpolate_step(stages, x, y, t - entry.t, entry.h, dense)
    }

    fn differentiator(state: &mut Self::State) -> &mut Self::Differentiator {
        &mut state.differentiator
    }
}
