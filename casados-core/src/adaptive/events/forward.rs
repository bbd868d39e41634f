//! Forward sensitivities over the segments between events.

use super::*;
use crate::integrator::chain_rule::{chain_states, fill_matrix, set_identity};
use crate::memory::allocate;
use crate::result::Forward;

impl<M: Dae, B: Engine<M, T>, T: Real> Hybrid<M, B, T> {
    /// Computes the derivatives of all steps and events, and the linearisation of the events; for
    /// second derivatives (`second`) also their data.
    #[allow(clippy::type_complexity)]
    pub(super) fn forward_sweep(
        &mut self,
        x0: &VectorX<M, T>,
        second: bool,
        mut along: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<(HybridForward<M, T>, LinearisedEvents<M, T>), Error> {
        reset_integrand(&mut along);
        let (nx, nu, nw) = (M::Shape::NX, M::Shape::NU, M::Shape::NW);
        let [mut v, mut next] = match self.sensitivities.take() {
            Some(there) => there,
            None => [allocate()?, allocate()?],
        };
        set_identity::<M, T>(&mut v);
        let (mut times, mut moments) = (Vec::new(), core::mem::take(&mut self.linearised_events));
        moments.clear();
        let mut x = *x0;
        for k in 0..self.segment_count {
            let Self { integrator, segments, solution, .. } = self;
            let Some(segment) = segments.get_mut(k) else { break };
            segment.x = x;
            let mut history = core::mem::take(&mut segment.step_sensitivities);
            let mut own = core::mem::take(&mut segment.start_sensitivities);
            history.clear();
            let (mut frozen, state, memory, _) = segment.load(integrator)?;
            // Chain rule: its derivatives with respect to the start of the segment times the
            // derivatives of that start.
            let mut part = chain_rule_integrand(&mut along, Some(&*v), false);
            frozen.forward::<B>(
                state,
                &x,
                memory,
                second.then_some(&mut history),
                dyn_integrand(&mut part),
            )?;
            let local = &memory.hessian.first.forward;
            if k == 0 {
                solution.nominal.z0 = local.nominal.z0;
            }
            chain_states(local, &v, &mut next);
            core::mem::swap(&mut v, &mut next);
            if second {
                segment_derivative_rows(local, &mut own)?;
            }
            (segment.step_sensitivities, segment.start_sensitivities) = (history, own);
            let Some((event, moment)) = self.linearise_event(k)? else { break };
            let [v, next] = [&mut v, &mut next].map(|v| ArrayW::<M, T>::flat_mut(v.as_mut().as_mut()));
            let time = self.forward_over_jump(event, &moment, v, next)?;
            if let Some(integrand) = &mut along {
                self.integrand_at_jump(k, &event, &moment, &mut **integrand, |integrand, sign, at| {
                    integrand.add_end_time_gradient(sign, &time, at)
                })?;
            }
            push(&mut times, time_gradient(time.as_ref()))?;
            push(&mut moments, (event, moment))?;
            x = self.solution.occurrences.get(k).map_or(x, |occurrence| occurrence.after);
        }
        self.collect_solution();
        finish_integrand(&mut along)?;
        let [v, _] = self.sensitivities.insert([v, next]);
        let v = ArrayW::<M, T>::flat(v.as_ref().as_ref());
        if let Some((index, _)) = find_non_finite(v) {
            return Err(Error::Overflow { step: 0, index });
        }
        let mut result = HybridForward {
            solution: self.solution.clone(),
            dx_dx0: Zeroable::zeroed(),
            dx_du: Zeroable::zeroed(),
            dx_dp: Zeroable::zeroed(),
            times,
        };
        fill_matrix(&mut result.dx_dx0, |r, c| v[r * nw + c]);
        fill_matrix(&mut result.dx_du, |r, c| v[r * nw + nx + c]);
        fill_matrix(&mut result.dx_dp, |r, c| v[r * nw + nx + nu + c]);
        Ok((result, moments))
    }
}

/// The parts of a row with respect to `(x₀, u, p)`.
fn time_gradient<M: Dae, T: Real>(row: &[T]) -> TimeGradient<M, T> {
    let (nx, nu) = (M::Shape::NX, M::Shape::NU);
    let mut gradient =
        TimeGradient::<M, T> { x0: Zeroable::zeroed(), u: Zeroable::zeroed(), p: Zeroable::zeroed() };
    gradient.x0.as_mut_slice().copy_from_slice(&row[..nx]);
    gradient.u.as_mut_slice().copy_from_slice(&row[nx..nx + nu]);
    gradient.p.as_mut_slice().copy_from_slice(&row[nx + nu..]);
    gradient
}

/// The derivatives of one segment, row by row.
///
/// # Errors
/// [`Error::OutOfMemory`]
fn segment_derivative_rows<M: Dae, T: Real>(local: &Forward<M, T>, own: &mut Vec<T>) -> Result<(), Error> {
    let (nx, nu, nw) = (M::Shape::NX, M::Shape::NU, M::Shape::NW);
    refill_vec(own, nx * nw, T::ZERO)?;
    for (index, element) in own.iter_mut().enumerate() {
        let (r, w) = (index / nw, index % nw);
        *element = if w < nx {
            local.dx_dx0[(r, w)]
        } else if w < nx + nu {
            local.dx_du[(r, w - nx)]
        } else {
            local.dx_dp[(r, w - nx - nu)]
        };
    }
    Ok(())
}
