//! The event function along the solution, with algebraic states as implicit functions:
//!
//! ```text
//! G(x, u, p, t) = g(x, z(x, u, p, t), u, p, t)        G_w = g_w + g_z z_w        ġ = G_x ẋ + G_t
//! ```
//!
//! `z_w` follows from the algebraic equations by the implicit function theorem.

use super::evaluate::{check_finite, event_function_rate, write_point};
use super::{Event, Hybrid};
use crate::adaptive::engine::Engine;
use crate::adaptive::point::{ModelPoint, write_inputs};
use crate::error::Error;
use crate::model::{ArrayK, ArrayV, Dae, VectorP, VectorU, VectorX};
use crate::scalar::{Real, Scalar};
use crate::shape::{Matrix, Shape};

/// Rounding errors of its terms within which an event function counts as zero.
const ZERO_TOLERANCE_ROUNDOFFS: f64 = 64.0;

/// An event function with its derivatives at a point of the solution.
pub(super) struct EventFunctionPoint<M: Dae, T: Real> {
    pub value: T,
    /// `G_v`, with zeros for the algebraic states.
    pub gradient: ArrayV<M, T>,
    /// `ġ`
    pub rate: T,
    /// The magnitude of the terms of its value.
    term_magnitude: T,
}

impl<M: Dae, T: Real> EventFunctionPoint<M, T> {
    /// Whether the function is zero, to the rounding of its terms and of a time of this magnitude.
    pub fn is_zero(&self, time: T) -> bool {
        let size = self.term_magnitude + (self.rate * time).abs();
        self.value.abs() <= T::from_f64(ZERO_TOLERANCE_ROUNDOFFS * T::EPSILON) * size
    }
}

impl<M: Dae, B: Engine<M, T>, T: Real> Hybrid<M, B, T> {
    /// The event function at the point with `y = (ẋ, z)`.
    ///
    /// # Errors
    /// A value that is not finite; no derivatives of `z`.
    pub(super) fn event_function_at(
        &mut self,
        k: usize,
        event: &Event<M, T>,
        (x, u, t): (&VectorX<M, T>, &VectorU<M, T>, T),
        y: &ArrayK<M, T>,
    ) -> Result<EventFunctionPoint<M, T>, Error> {
        let parameters = self.integrator.workspace.parameters;
        write_inputs::<M, T>(self.variables.as_mut().as_mut(), u, &parameters);
        write_point::<M, T>(&mut self.variables, x, &y.as_ref()[M::Shape::NX..], t);
        let value = event.guard.first_output(&self.variables);
        check_finite(event.guard.name, &[value], k)?;
        let (mut gradient, mut by_t) = event.guard.gradient(&self.variables, &[T::ONE]);
        let mut terms = (by_t * t).abs();
        for (g, v) in gradient.as_ref().iter().zip(self.variables.as_ref().as_ref()) {
            terms = terms + (*g * *v).abs();
        }
        if event.guard.reads_algebraic_states {
            by_t = by_t + self.algebraic_time_derivative(k, &gradient, (x, u, t), y)?;
            self.eliminate_algebraic_states(&mut gradient, (x, u, t), y)?;
        }
        let rate = event_function_rate::<M, T>(&gradient, by_t, y);
        Ok(EventFunctionPoint { value, gradient, rate, term_magnitude: terms })
    }

    /// Replaces `(g_z, g_w)` by `(0, g_w + g_z z_w)`.
    fn eliminate_algebraic_states(
        &mut self,
        gradient: &mut ArrayV<M, T>,
        (x, u, t): (&VectorX<M, T>, &VectorU<M, T>, T),
        y: &ArrayK<M, T>,
    ) -> Result<(), Error> {
        let (nx, nz, nu) = (M::Shape::NX, M::Shape::NZ, M::Shape::NU);
        let parameters: VectorP<M, T> = self.integrator.workspace.parameters;
        let at = ModelPoint { x, u, p: &parameters, t };
        let forward = self.integrator.consistent.forward(&at, y)?;
        let (states, others) = gradient.as_mut().split_at_mut(2 * nx);
        let (algebraic, inputs) = others.split_at_mut(nz);
        let (controls, others) = inputs.split_at_mut(nu);
        for (j, by_z) in algebraic.iter_mut().enumerate() {
            let g = core::mem::replace(by_z, T::ZERO);
            for (c, to) in states.iter_mut().skip(nx).enumerate() {
                *to = *to + g * forward.dz_dx0[(j, c)];
            }
            for (c, to) in controls.iter_mut().enumerate() {
                *to = *to + g * forward.dz_du[(j, c)];
            }
            for (c, to) in others.iter_mut().enumerate().take(M::Shape::NP) {
                *to = *to + g * forward.dz_dp[(j, c)];
            }
        }
        Ok(())
    }

    /// `g_z ∂z/∂t` by a central difference, since models have no derivative with respect to time.
    /// It is zero if the model does not depend on time. Otherwise derivatives of the event are
    /// refused, and its location needs half of the digits only.
    fn algebraic_time_derivative(
        &mut self,
        k: usize,
        gradient: &ArrayV<M, T>,
        (x, u, t): (&VectorX<M, T>, &VectorU<M, T>, T),
        y: &ArrayK<M, T>,
    ) -> Result<T, Error> {
        let nx = M::Shape::NX;
        let Some(delta) = self.depends_on_time(k, x, y, t) else { return Ok(T::ZERO) };
        let [before, after] = [t - delta, t + delta];
        let [before, after] = [
            self.consistent_derivatives_from(*y, x, u, before)?,
            self.consistent_derivatives_from(*y, x, u, after)?,
        ];
        let by_z = &gradient.as_ref()[2 * nx..2 * nx + M::Shape::NZ];
        let changes = before.as_ref()[nx..].iter().zip(&after.as_ref()[nx..]);
        let sum = by_z.iter().zip(changes).fold(T::ZERO, |sum, (g, (a, b))| sum + *g * (*b - *a));
        Ok(sum / (delta + delta))
    }

    /// The distance of the times used, if the equations differ at other times near `t`.
    pub(super) fn depends_on_time(&self, k: usize, x: &VectorX<M, T>, y: &ArrayK<M, T>, t: T) -> Option<T> {
        let nx = M::Shape::NX;
        let length = self.segments.get(k).map_or(T::ZERO, |at| (at.span.end - at.span.start).abs());
        let delta = T::from_f64(Scalar::cbrt(T::EPSILON)) * t.abs().max(length);
        let mut v = *self.variables;
        let numbers = v.as_mut();
        numbers[..nx].copy_from_slice(&y.as_ref()[..nx]);
        numbers[nx..2 * nx].copy_from_slice(x.as_slice());
        numbers[2 * nx..2 * nx + M::Shape::NZ].copy_from_slice(&y.as_ref()[nx..]);
        let mut residual = |t: T| {
            let mut f: ArrayK<M, T> = bytemuck::Zeroable::zeroed();
            if let Some(time) = v.as_mut().last_mut() {
                *time = t;
            }
            M::residual::<T>(&v, &mut f);
            f
        };
        (residual(t - delta) != residual(t + delta)).then_some(delta)
    }

    /// The value of an event function at a state.
    pub(super) fn event_function_value(
        &mut self,
        k: usize,
        event: &Event<M, T>,
        x: &VectorX<M, T>,
        u: &VectorU<M, T>,
        t: T,
    ) -> Result<T, Error> {
        if event.guard.reads_algebraic_states {
            let y = self.consistent_derivatives(x, u, t)?;
            write_point::<M, T>(&mut self.variables, x, &y.as_ref()[M::Shape::NX..], t);
        } else {
            write_point::<M, T>(&mut self.variables, x, &[], t);
        }
        let value = event.guard.first_output(&self.variables);
        check_finite(event.guard.name, &[value], k)?;
        Ok(value)
    }
}
