//! An integrator with divided intervals: one call is a sequence of calls for its parts.
//!
//! With `V_k = dx_k/dw` at the start of part `k`, its derivatives `(A, B)` by `x_k` and by
//! `(u, p)`, its adjoint `λ_k`, and `D_k = d(x_k, u, p)/dw`:
//!
//! ```text
//! V_{k+1} = A V_k + (0, B)        λ_k = Aᵀ λ_{k+1}        d²(λᵀx_N)/dw² = Σ_k D_kᵀ ∇²(λ_{k+1}ᵀ x_{k+1}) D_k
//! ```

mod integrator_trait;

use super::chain_rule::{
    FullHessian, StateSensitivities, chain_states, set_identity, write_algebraic, write_states,
};
use super::{ControlOf, Integrator, StateOf};
use crate::error::{Argument, Error};
use crate::finite::check_input;
use crate::memory::{Family, Memory, WithForward};
use crate::model::{Dae, VectorX};
use crate::quadrature::{ChainRuleIntegrand, Integrand, OptionalIntegrand};
use crate::result::{Adjoint, Forward, Hessian, Nominal};
use crate::scalar::{Field, Real};
use crate::shape::Plain;
use crate::statistics::Statistics;
use bytemuck::Zeroable;
use core::marker::PhantomData;

/// An integrator that divides each interval into `N` parts of equal length, one call for each.
/// Results, derivatives of first and second order, and integrals are those of the whole interval.
///
/// It is intended for operations once per call, such as the projection of
/// [`Projected`](crate::Projected): with one step per part the projection is applied after every
/// step. `adjoint` and `hessian` integrate twice. Step numbers in errors are counted from the start
/// of a part.
///
/// ```
/// use casados::prelude::*;
/// use casados::{Divided, Integrator, Projected};
/// use nalgebra::vector;
///
/// /// A pendulum on a circle of radius one.
/// #[dae(index_reduction(projection))]
/// fn pendulum(xdot: [f64; 4], x: [f64; 4], z: f64) -> [f64; 5] {
///     let circle = x[0] * x[0] + x[1] * x[1] - 1.0;
///     [xdot[0] - x[2], xdot[1] - x[3], xdot[2] + z * x[0], xdot[3] + z * x[1] + 9.81, circle]
/// }
///
/// let irk = Projected::new(Irk::<Pendulum, RadauIIA<2>>::new(Options::default())?);
/// let mut irk = Divided::<_, 10>::new(irk);
/// let end = irk.forward(&vector![1.0, 0.0, 0.0, 0.0], &vector![], 0.2)?;
/// assert!((end.x[0].hypot(end.x[1]) - 1.0).abs() < 1e-15);
/// # Ok::<(), casados::Error>(())
/// ```
pub struct Divided<I: Integrator, const N: usize> {
    integrator: I,
    time: I::Number,
    statistics: Statistics,
    nominal: NominalStorage<I, NominalMemory<I::Model, I::Number, N>>,
    forward: <I::Memory as Memory>::Forward<ForwardMemory<I::Model, I::Number>>,
    adjoint: <I::Memory as Memory>::Adjoint<Adjoints<I::Model, I::Number>>,
    hessian: <I::Memory as Memory>::Hessian<HessianMemory<I::Model, I::Number, N>>,
}

type NominalStorage<I, V> = <<I as Integrator>::Memory as Memory>::Nominal<V>;

#[derive(Zeroable)]
#[zeroable(bound = "")]
struct NominalMemory<M: Dae, T: Real, const N: usize> {
    result: Nominal<M, T>,
    /// The initial state of each part.
    states: [VectorX<M, T>; N],
}

#[derive(Zeroable)]
#[zeroable(bound = "")]
struct ForwardMemory<M: Dae, T: Real> {
    result: Forward<M, T>,
    /// `V` at the start and at the end of a part.
    v: [StateSensitivities<M, T>; 2],
}

/// Results of `adjoint`.
struct Adjoints<M, T>(PhantomData<fn() -> (M, T)>);

impl<M: Dae, T: Plain> Family for Adjoints<M, T> {
    type Of<const C: usize> = Adjoint<M, T, C>;
}

#[derive(Zeroable)]
#[zeroable(bound = "")]
struct HessianMemory<M: Dae, T: Real, const N: usize> {
    result: Hessian<M, T>,
    /// `V` at the start of each part.
    start_sensitivities: [StateSensitivities<M, T>; N],
    /// `∇²(λᵀx)` of a part times `D`; `sum` is the sum over all parts.
    product: FullHessian<M, T>,
    sum: FullHessian<M, T>,
}

impl<I: Integrator, const N: usize> Divided<I, N> {
    /// Returns an integrator with divided intervals. Its time is set by `set_time`, and zero by
    /// default.
    pub fn new(integrator: I) -> Self {
        const { assert!(N > 0, "an interval has at least one part") }
        Self {
            integrator,
            time: I::Number::ZERO,
            statistics: Statistics::default(),
            nominal: Default::default(),
            forward: Default::default(),
            adjoint: Default::default(),
            hessian: Default::default(),
        }
    }

    /// Returns the integrator of the parts.
    pub fn integrator(&mut self) -> &mut I {
        &mut self.integrator
    }

    /// Begins a call.
    fn begin_call(&mut self, h: I::Number) -> Result<(), Error> {
        self.statistics = Statistics::default();
        check_input(Argument::H, &[h])
    }

    /// Sets the time of a part; returns its length.
    fn begin_part(&mut self, part: usize, h: I::Number) -> Result<I::Number, Error> {
        let count = I::Number::from_f64(N as f64);
        self.integrator.set_time(self.time + h * I::Number::from_f64(part as f64) / count)?;
        Ok(h / count)
    }

    /// Adds the statistics of a part.
    fn add_part_statistics(&mut self) {
        self.statistics.add(&self.integrator.statistics());
    }

    /// Computes the solution, and stores the initial states of the parts.
    fn solve_parts(
        &mut self,
        x0: &StateOf<Self>,
        u: &ControlOf<Self>,
        h: I::Number,
        integrand: &mut OptionalIntegrand<'_, '_, I::Model, I::Number>,
    ) -> Result<(), Error> {
        let (mut x, mut z0) = (*x0, None);
        for k in 0..N {
            let length = self.begin_part(k, h)?;
            let mut chained = chained_integrand(integrand, None, false);
            let part = self.integrator.solve_with_quadrature(&x, u, length, as_dyn_integrand(&mut chained));
            let part = part.copied();
            self.add_part_statistics();
            let part = part?;
            let memory = I::Memory::nominal(&mut self.nominal)?;
            memory.states[k] = x;
            x = part.x;
            memory.result = part;
            memory.result.z0 = *z0.get_or_insert(part.z0);
        }
        Ok(())
    }

    /// Computes the solution and its derivatives; calls `on_part_start` at the start of each part.
    fn differentiate_parts(
        &mut self,
        x0: &StateOf<Self>,
        u: &ControlOf<Self>,
        h: I::Number,
        with_hessian: bool,
        integrand: &mut OptionalIntegrand<'_, '_, I::Model, I::Number>,
        mut on_part_start: impl FnMut(&mut Self, usize, &StateOf<Self>) -> Result<(), Error>,
    ) -> Result<(), Error>
    where
        I::Memory: WithForward,
    {
        let mut x = *x0;
        let ForwardMemory { v: [now, _], .. } = I::Memory::forward(&mut self.forward)?;
        set_identity::<I::Model, _>(now);
        for k in 0..N {
            on_part_start(self, k, &x)?;
            let length = self.begin_part(k, h)?;
            let Self { integrator, forward, .. } = self;
            let ForwardMemory { result, v: [now, next] } = I::Memory::forward(forward)?;
            let mut chained = chained_integrand(integrand, (k > 0).then_some(&*now), with_hessian);
            let part = integrator.forward_with_quadrature(&x, u, length, as_dyn_integrand(&mut chained));
            let part = part.map(|part| {
                chain_states(part, now, next);
                if k == 0 {
                    result.clone_from(part);
                } else {
                    let start_results = (result.nominal.z0, result.dz0_dx0, result.dz0_du, result.dz0_dp);
                    result.nominal = part.nominal;
                    (result.nominal.z0, result.dz0_dx0, result.dz0_du, result.dz0_dp) = start_results;
                }
                if k + 1 == N {
                    write_states(next, result);
                    write_algebraic(part, now, result);
                }
                core::mem::swap(now, next);
                x = part.nominal.x;
            });
            self.add_part_statistics();
            part?;
        }
        Ok(())
    }
}

/// Returns the integrand of a part.
fn chained_integrand<'a, M: Dae, T: Real>(
    integrand: &'a mut OptionalIntegrand<'_, '_, M, T>,
    v: Option<&'a StateSensitivities<M, T>>,
    with_hessian: bool,
) -> Option<ChainRuleIntegrand<'a, M, T>> {
    integrand.as_mut().map(|inner| ChainRuleIntegrand { inner: &mut **inner, v, with_hessian })
}

fn as_dyn_integrand<'a, M: Dae, T: Real, Q: Integrand<M, T> + 'a>(
    integrand: &'a mut Option<Q>,
) -> OptionalIntegrand<'a, 'a, M, T> {
    match integrand {
        Some(integrand) => Some(integrand),
        None => None,
    }
}
