//! Derivatives across an event, forward and adjoint.

use super::evaluate::dot;
use super::*;

impl<M: Dae, B: Engine<M, T>, T: Real> Hybrid<M, B, T> {
    /// Replaces `V⁻` by `V⁺`, or by the derivative of the final state; writes the derivative of the
    /// time.
    pub(super) fn forward_over_jump(
        &mut self,
        event: Event<M, T>,
        moment: &EventLinearisation<M, T>,
        v: &mut [T],
        next: &mut [T],
    ) -> Result<ArrayW<M, T>, Error> {
        let (nx, nz, nw) = (M::Shape::NX, M::Shape::NZ, M::Shape::NW);
        let guard = moment.function_gradient.as_ref();
        let factor = -(T::ONE / moment.function_rate);
        let mut time = ArrayW::<M, T>::zeroed();
        for (w, element) in time.as_mut().iter_mut().enumerate().skip(nx) {
            *element = factor * guard[nx + nz + w];
        }
        for (g, v) in guard[nx..].iter().zip(v.chunks_exact(nw.max(1))) {
            axpy(factor * *g, v, time.as_mut());
        }
        for (f, v) in moment.derivatives_before.as_ref().iter().zip(v.chunks_exact_mut(nw.max(1))) {
            axpy(*f, time.as_ref(), v);
        }
        let Some(jump) = event.jump else { return Ok(time) };
        for (r, row) in next.chunks_exact_mut(nw.max(1)).enumerate() {
            let unit = ArrayX::<M, T>::from_fn(|x| if x == r { T::ONE } else { T::ZERO });
            let (gradient, rate) = jump.gradient(&self.variables, unit.as_ref());
            row.fill(T::ZERO);
            row[nx..].copy_from_slice(&gradient.as_ref()[2 * nx + nz..2 * nx + nz + nw - nx]);
            for (j, v) in gradient.as_ref()[nx..2 * nx].iter().zip(v.chunks_exact(nw.max(1))) {
                axpy(*j, v, row);
            }
            axpy(rate - moment.derivatives_after.as_ref()[r], time.as_ref(), row);
        }
        v.copy_from_slice(next);
        Ok(time)
    }

    /// Evaluates an integrand before the event and, with the sign of a lower limit, after it.
    pub(super) fn integrand_at_jump(
        &mut self,
        k: usize,
        event: &Event<M, T>,
        moment: &EventLinearisation<M, T>,
        integrand: &mut dyn Integrand<M, T>,
        mut each: impl FnMut(&mut dyn Integrand<M, T>, T, Place) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.move_to_event(k);
        let Some(occurrence) = self.solution.occurrences.get(k) else { return Ok(()) };
        let (nx, nk, at) = (M::Shape::NX, M::Shape::NK, Place { step: k, stage: 0, iteration: 0 });
        let sides = [
            (&occurrence.before, &moment.derivatives_before, T::ONE),
            (&occurrence.after, &moment.derivatives_after, -T::ONE),
        ];
        for (x, y, sign) in sides.into_iter().take(if event.jump.is_some() { 2 } else { 1 }) {
            let (point, _) = integrand.stage_variables_mut();
            point.copy_from_slice(self.variables.as_ref().as_ref());
            point[nx..2 * nx].copy_from_slice(x.as_slice());
            point[2 * nx..nx + nk].copy_from_slice(&y.as_ref()[nx..]);
            each(integrand, sign, at)?;
        }
        Ok(())
    }

    /// Replaces `λ⁺` by `λ⁻`; returns `κ = −σ/ġ`. `density` is the derivative of the integral with
    /// respect to the time of the event.
    pub(super) fn adjoint_over_jump(
        &mut self,
        k: usize,
        event: Event<M, T>,
        moment: &EventLinearisation<M, T>,
        density: T,
        result: &mut HybridAdjoint<M, T>,
    ) -> T {
        let (nx, nz, nu) = (M::Shape::NX, M::Shape::NZ, M::Shape::NU);
        let inputs = 2 * nx + nz;
        let sigma = match event.jump {
            None => dot(result.grad_x0.as_slice(), moment.derivatives_before.as_ref()),
            Some(jump) => {
                self.move_to_event(k);
                let lambda = result.grad_x0;
                let (gradient, rate) = jump.gradient(&self.variables, lambda.as_slice());
                let gradient = gradient.as_ref();
                result.grad_x0.as_mut_slice().copy_from_slice(&gradient[nx..2 * nx]);
                axpy(T::ONE, &gradient[inputs..inputs + nu], result.grad_u.as_mut_slice());
                axpy(T::ONE, &gradient[inputs + nu..], result.grad_p.as_mut_slice());
                dot(&gradient[nx..2 * nx], moment.derivatives_before.as_ref()) + rate
                    - dot(lambda.as_slice(), moment.derivatives_after.as_ref())
            }
        };
        let (factor, guard) =
            (-((sigma + density) / moment.function_rate), moment.function_gradient.as_ref());
        axpy(factor, &guard[nx..2 * nx], result.grad_x0.as_mut_slice());
        axpy(factor, &guard[inputs..inputs + nu], result.grad_u.as_mut_slice());
        axpy(factor, &guard[inputs + nu..], result.grad_p.as_mut_slice());
        factor
    }
}
