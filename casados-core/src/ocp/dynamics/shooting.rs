//! A batch as dynamics: all intervals in one call.

use crate::batch::{BatchOutput, Integrator, Intervals, Single};
use crate::model::{Dae, VectorP, VectorU, VectorX, VectorZ};
use crate::ocp::dynamics::dense_output::DenseOutput;
use crate::ocp::dynamics::interval_setup::in_interval;
use crate::ocp::dynamics::single_interval::{model_structure, names};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::dynamics::{
    Dynamics, IntervalResult, Nodes, SecondOrder, Sink, vector,
};
use crate::ocp::formulation::functions::sparsity::DynamicsStructure;
use crate::ocp::formulation::names::Names;
use crate::qp::try_reserve;
use crate::result::{Forward, Hessian, Nominal};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};
use alloc::vec::Vec;
use bytemuck::Zeroable;

/// Integrates all intervals of a horizon in one call, in SIMD lanes and threads (feature
/// `parallel`).
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
    /// Results of one chunk of intervals.
    nominal: Vec<Nominal<I::Model, I::Number>>,
    forward: Vec<Forward<I::Model, I::Number>>,
    hessian: Vec<Hessian<I::Model, I::Number>>,
    /// Whether the stages in the batch are those of the intervals in `x`, `u`, `p`, `h`, `t`.
    stages_are_current: bool,
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
    /// Wraps a batch. The first call of each kind allocates the memory of the intervals.
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
            stages_are_current: false,
        }
    }

    /// Returns the batch.
    pub fn batch(&mut self) -> &mut Integrator<I> {
        // The caller may integrate other intervals with it.
        self.stages_are_current = false;
        &mut self.batch
    }

    /// Copies the intervals, and their multipliers if requested, to the arguments of the batch. If
    /// the intervals are those of the last call, the batch reuses its stages.
    fn load_intervals(&mut self, nodes: &Nodes<'_, I::Number>, multipliers: bool) -> Result<(), OcpError> {
        let n = nodes.len();
        let mut is_unchanged = core::mem::take(&mut self.stages_are_current) && self.x.len() == n;
        if !is_unchanged {
            clear_and_reserve(&mut self.x, n)?;
            clear_and_reserve(&mut self.u, n)?;
            clear_and_reserve(&mut self.p, n)?;
            clear_and_reserve(&mut self.h, n)?;
            clear_and_reserve(&mut self.t, n)?;
        }
        clear_and_reserve(&mut self.lambda, n)?;
        clear_and_reserve(&mut self.nu, n)?;
        for (k, interval) in nodes.iter().enumerate() {
            is_unchanged &=
                replace_or_push(&mut self.x, k, vector(interval.x), |x| x.as_slice() == interval.x);
            is_unchanged &=
                replace_or_push(&mut self.u, k, vector(interval.u), |u| u.as_slice() == interval.u);
            if <<I::Model as Dae>::Shape as Shape>::NP > 0 {
                let p: VectorP<I::Model, I::Number> = interval.parameters();
                is_unchanged &= replace_or_push(&mut self.p, k, p, |old| *old == p);
            }
            is_unchanged &= replace_or_push(&mut self.h, k, interval.h, |&h| h == interval.h);
            is_unchanged &= replace_or_push(&mut self.t, k, interval.t, |&t| t == interval.t);
            if multipliers {
                self.lambda.push(vector(interval.multipliers));
            }
            if !interval.nu.is_empty() {
                self.nu.push(vector(interval.nu));
            }
        }
        // Lifted stages advance in each call: they are not reused.
        self.batch.store_stages(is_unchanged && self.batch.options().newton.fixed_iterations.is_none());
        Ok(())
    }

    /// Evaluates all intervals chunk by chunk, with the multipliers of ends and algebraic states if
    /// these are given.
    fn evaluate_intervals<R: BatchOutput<I::Model, I::Number> + Zeroable>(
        &mut self,
        nodes: &Nodes<'_, I::Number>,
        [of_ends, of_algebraic]: [bool; 2],
        result_memory: fn(&mut Self) -> &mut Vec<R>,
        sink: &mut dyn FnMut(usize, &R),
    ) -> Result<(), OcpError> {
        self.load_intervals(nodes, of_ends)?;
        let mut results = core::mem::take(result_memory(self));
        let Self { batch, x, u, p, h, t, lambda, nu, .. } = self;
        let intervals = Intervals { x0: x, u, p, h, t0: t };
        let lambda = of_ends.then_some(&lambda[..]);
        let nu = (of_algebraic && !nu.is_empty()).then_some(&nu[..]);
        let outcome = batch.for_each_result(&intervals, (lambda, nu), &mut results, sink);
        *result_memory(self) = results;
        outcome.map_err(OcpError::from)?;
        self.stages_are_current = true;
        Ok(())
    }
}

/// Replaces or appends an element; returns whether it was there with the same value.
fn replace_or_push<V>(list: &mut Vec<V>, k: usize, value: V, is_same: impl Fn(&V) -> bool) -> bool {
    match list.get_mut(k) {
        Some(element) => {
            let is_unchanged = is_same(element);
            *element = value;
            is_unchanged
        }
        None => {
            list.push(value);
            false
        }
    }
}

/// Clears a list and reserves memory for `length` elements.
fn clear_and_reserve<V>(list: &mut Vec<V>, length: usize) -> Result<(), OcpError> {
    list.clear();
    Ok(try_reserve(list, length)?)
}

impl<I: Single<Number = T> + DenseOutput<T>, T: Real> Dynamics<T> for Shooting<I> {
    type Shape = <I::Model as Dae>::Shape;
    const NAMES: Names = names::<I::Model>();
    const ALGEBRAIC: bool = true;
    const STRUCTURE: DynamicsStructure = model_structure::<I::Model>();

    /// Stages are always stored; `load_intervals` decides whether they are reused.
    #[cfg(feature = "casadi")]
    fn keep_stages(&mut self, _solved: bool) -> bool {
        true
    }

    /// Lifted stages belong to whole intervals.
    fn has_pieces(&self) -> bool {
        self.batch.options().newton.fixed_iterations.is_none()
    }

    fn simulate(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        self.evaluate_intervals(nodes, [false; 2], |own| &mut own.nominal, &mut |k,
                                                                                 result: &Nominal<
            I::Model,
            T,
        >| {
            sink(k, &result.into())
        })
    }

    fn inside(&mut self, nodes: &Nodes<'_, T>, parts: &[T], sink: Sink<'_, T>) -> Result<bool, OcpError> {
        let mut single = in_interval(0, self.batch.single_integrator())?;
        for (k, interval) in nodes.iter().enumerate() {
            in_interval(k, self.batch.warm_start_single(k, &mut single))?;
            in_interval(k, single.begin(&interval))?;
            let visit = &mut |j, x: &[T], z: &[T]| {
                sink(k * parts.len() + j, &IntervalResult { x, z, ..IntervalResult::default() })
            };
            in_interval(k, single.states_at_fractions(&interval, parts, visit))?;
        }
        Ok(true)
    }

    fn linearise(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        self.evaluate_intervals(nodes, [false; 2], |own| &mut own.forward, &mut |k,
                                                                                 result: &Forward<
            I::Model,
            T,
        >| {
            sink(k, &result.into())
        })
    }
}

impl<I: Single<Number = T> + DenseOutput<T>, T: Real> SecondOrder<T> for Shooting<I> {
    fn second_order(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        self.evaluate_intervals(nodes, [true; 2], |own| &mut own.hessian, &mut |k,
                                                                                result: &Hessian<
            I::Model,
            T,
        >| {
            sink(k, &result.into())
        })
    }
}
