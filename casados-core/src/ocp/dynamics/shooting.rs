//! A batch as dynamics: all intervals in one call.

use crate::batch::{Answer, Integrator, Intervals, Single};
use crate::model::{Dae, VectorP, VectorU, VectorX, VectorZ};
use crate::ocp::dynamics::begin::at;
use crate::ocp::dynamics::inside::Inside;
use crate::ocp::dynamics::single::{names, origin};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::dynamics::{
    Dynamics, IntervalResult, Nodes, SecondOrder, Sink, vector,
};
use crate::ocp::formulation::functions::pattern::Origin;
use crate::ocp::formulation::names::Names;
use crate::qp::try_reserve;
use crate::result::{Forward, Hessian, Nominal};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};
use alloc::vec::Vec;
use bytemuck::Zeroable;

/// All intervals of a horizon at once: lanes of registers, and threads (feature `parallel`).
///
/// ```
/// use casados::ocp::{GeneralCost, HeapSqp, Horizon, Problem, Shooting};
/// use casados::prelude::*;
///
/// /// A cart on a rail that is pushed: position m, velocity m/s; acceleration m/s².
/// #[ode]
/// fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// #[function]
/// fn effort(_x: [f64; 2], u: f64) -> f64 { 0.5 * u * u }
///
/// let batch = Batch::<Cart, Gauss<2>>::new(Options::default())?;
/// let mut ocp = Problem::new(Shooting::new(batch))
///     .running_cost(GeneralCost::<Effort>::new())
///     .on(Horizon::uniform(40, 0.05))?;
/// ocp.fix_initial_state(&[0.0, 0.0])?.bound("x[0]", 40.., 1.0, 1.0)?.guess(&[0.0, 0.0], &[0.0])?;
/// assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Shooting<I: Single> {
    batch: Integrator<I>,
    x: Vec<VectorX<I::Model, I::Number>>,
    u: Vec<VectorU<I::Model, I::Number>>,
    p: Vec<VectorP<I::Model, I::Number>>,
    h: Vec<I::Number>,
    t: Vec<I::Number>,
    lambda: Vec<VectorX<I::Model, I::Number>>,
    nu: Vec<VectorZ<I::Model, I::Number>>,
    /// Results of a few intervals at a time.
    nominal: Vec<Nominal<I::Model, I::Number>>,
    forward: Vec<Forward<I::Model, I::Number>>,
    hessian: Vec<Hessian<I::Model, I::Number>>,
    /// Whether the batch has the stages of all intervals that are here.
    solved: bool,
}

impl<I: Single> core::fmt::Debug for Shooting<I> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Shooting").field("batch", &self.batch).finish_non_exhaustive()
    }
}

/// A batch with the same options, and memory of its own.
impl<I: Single> Clone for Shooting<I> {
    fn clone(&self) -> Self {
        Self::new(self.batch.clone())
    }
}

impl<I: Single> Shooting<I> {
    /// Memory for the intervals is allocated by the first call of its kind.
    #[must_use]
    pub fn new(batch: Integrator<I>) -> Self {
        Self {
            batch,
            x: Vec::new(),
            u: Vec::new(),
            p: Vec::new(),
            h: Vec::new(),
            t: Vec::new(),
            lambda: Vec::new(),
            nu: Vec::new(),
            nominal: Vec::new(),
            forward: Vec::new(),
            hessian: Vec::new(),
            solved: false,
        }
    }

    /// The batch.
    pub fn batch(&mut self) -> &mut Integrator<I> {
        // Whoever has it may use it for something else.
        self.solved = false;
        &mut self.batch
    }

    /// Copies the intervals to where the batch takes them from, and their multipliers if they are
    /// asked for. Where they are those of the last call, the batch has their stages.
    fn take(&mut self, nodes: &Nodes<'_, I::Number>, multipliers: bool) -> Result<(), OcpError> {
        let n = nodes.len();
        let mut same = core::mem::take(&mut self.solved) && self.x.len() == n;
        if !same {
            reserve(&mut self.x, n)?;
            reserve(&mut self.u, n)?;
            reserve(&mut self.p, n)?;
            reserve(&mut self.h, n)?;
            reserve(&mut self.t, n)?;
        }
        reserve(&mut self.lambda, n)?;
        reserve(&mut self.nu, n)?;
        for (k, interval) in nodes.iter().enumerate() {
            same &= put(&mut self.x, k, vector(interval.x), |x| x.as_slice() == interval.x);
            same &= put(&mut self.u, k, vector(interval.u), |u| u.as_slice() == interval.u);
            if <<I::Model as Dae>::Shape as Shape>::NP > 0 {
                let p: VectorP<I::Model, I::Number> = interval.parameters();
                same &= put(&mut self.p, k, p, |old| *old == p);
            }
            same &= put(&mut self.h, k, interval.h, |&h| h == interval.h);
            same &= put(&mut self.t, k, interval.t, |&t| t == interval.t);
            if multipliers {
                self.lambda.push(vector(interval.multipliers));
            }
            if !interval.nu.is_empty() {
                self.nu.push(vector(interval.nu));
            }
        }
        // Lifted stages go on where they are.
        self.batch.keep_stages(same && self.batch.options().newton.fixed_iterations.is_none());
        Ok(())
    }

    /// The results of all intervals, of which a few at a time are in memory; with the multipliers
    /// of ends and algebraic states, if these are asked for.
    fn each<R: Answer<I::Model, I::Number> + Zeroable>(
        &mut self,
        nodes: &Nodes<'_, I::Number>,
        [of_ends, of_algebraic]: [bool; 2],
        place: fn(&mut Self) -> &mut Vec<R>,
        sink: &mut dyn FnMut(usize, &R),
    ) -> Result<(), OcpError> {
        self.take(nodes, of_ends)?;
        let mut results = core::mem::take(place(self));
        let Self { batch, x, u, p, h, t, lambda, nu, .. } = self;
        let intervals = Intervals { x0: x, u, p, h, t0: t };
        let lambda = of_ends.then_some(&lambda[..]);
        let nu = (of_algebraic && !nu.is_empty()).then_some(&nu[..]);
        let outcome = batch.each(&intervals, (lambda, nu), &mut results, sink);
        *place(self) = results;
        outcome.map_err(OcpError::from)?;
        self.solved = true;
        Ok(())
    }
}

/// Writes an element, or adds it at the end; whether it was there already.
fn put<V>(list: &mut Vec<V>, k: usize, value: V, is_same: impl Fn(&V) -> bool) -> bool {
    match list.get_mut(k) {
        Some(element) => {
            let same = is_same(element);
            *element = value;
            same
        }
        None => {
            list.push(value);
            false
        }
    }
}

/// An empty list with room for so many.
fn reserve<V>(list: &mut Vec<V>, length: usize) -> Result<(), OcpError> {
    list.clear();
    Ok(try_reserve(list, length)?)
}

impl<I: Single<Number = T> + Inside<T>, T: Real> Dynamics<T> for Shooting<I> {
    type Shape = <I::Model as Dae>::Shape;
    const NAMES: Names = names::<I::Model>();
    const ALGEBRAIC: bool = true;
    const ORIGIN: Origin = origin::<I::Model>();

    /// They are in any case, and found where the point is the same.
    #[cfg(feature = "casadi")]
    fn keep_stages(&mut self, _solved: bool) -> bool {
        true
    }

    /// Lifted stages are those of whole intervals.
    fn has_pieces(&self) -> bool {
        self.batch.options().newton.fixed_iterations.is_none()
    }

    fn simulate(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        self.each(nodes, [false; 2], |own| &mut own.nominal, &mut |k, result: &Nominal<I::Model, T>| {
            sink(k, &result.into())
        })
    }

    fn inside(&mut self, nodes: &Nodes<'_, T>, parts: &[T], sink: Sink<'_, T>) -> Result<bool, OcpError> {
        let mut single = at(0, self.batch.single())?;
        for (k, interval) in nodes.iter().enumerate() {
            at(k, self.batch.start(k, &mut single))?;
            at(k, single.begin(&interval))?;
            let visit = &mut |j, x: &[T], z: &[T]| {
                sink(k * parts.len() + j, &IntervalResult { x, z, ..IntervalResult::default() })
            };
            at(k, single.at_parts(&interval, parts, visit))?;
        }
        Ok(true)
    }

    fn linearise(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        self.each(nodes, [false; 2], |own| &mut own.forward, &mut |k, result: &Forward<I::Model, T>| {
            sink(k, &result.into())
        })
    }
}

impl<I: Single<Number = T> + Inside<T>, T: Real> SecondOrder<T> for Shooting<I> {
    fn second_order(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        self.each(nodes, [true; 2], |own| &mut own.hessian, &mut |k, result: &Hessian<I::Model, T>| {
            sink(k, &result.into())
        })
    }
}
