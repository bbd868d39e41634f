//! Direct collocation: stages of the integrator are variables of the problem, which go with its
//! iterates.
//!
//! ```text
//! G(y, w) = 0,  x_{k+1} = E(y, w)        w = (x_k, u_k), y = (k_i, z_i) of all stages
//! Δy = a + D Δw                          a = −G_y⁻¹ G,  D = −G_y⁻¹ G_w
//! ```
//!
//! The QP keeps the size of that of multiple shooting: stages are eliminated interval by interval,
//! by the plan of the model. It has `E(y + a)` for the end of an interval, `E_y D + E_w` for its
//! derivatives, and `[I; D]ᵀ ∇²(μᵀG) [I; D]` with `μ` of the adjoint for its Hessian. What `a` adds
//! to the gradient, `Dᵀ ∇²(μᵀG) a`, is the change of `πᵀ dE/dw` from `y` to `y + a`, to first
//! order.
//!
//! A solver that knows stages lets them go as far as the rest, `y + α Δy`, and holds `h G` for a
//! part of the violation. Others have `y + a + D (w − w̄)`.
//!
//! R. Quirynen, S. Gros, B. Houska, M. Diehl, "Lifted collocation integrators for direct optimal
//! control in ACADO toolkit", Math. Program. Comput. 9 (2017).

mod equations;

use crate::error::Error;
use crate::irk::{Arguments, Coefficients, Integrator};
use crate::memory::Heap;
use crate::model::{ArrayK, Dae, VectorP, VectorU, VectorX};
use crate::ocp::dynamics::begin::{Begin, at};
use crate::ocp::dynamics::inside::Inside;
use crate::ocp::dynamics::single::names;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::dynamics::{
    Dynamics, IntegralTerms, Interval, IntervalResult, Nodes, SecondOrder, Sink, StageAction, vector,
};
use crate::ocp::formulation::names::Names;
use crate::qp::{copy_common, part, try_reserve};
use crate::result::Seeds;
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};
use alloc::vec::Vec;
use bytemuck::Zeroable;
use equations::Point;

type Irk<M, B, const S: usize, T> = Integrator<M, B, S, T, Heap>;

/// Direct collocation as dynamics, with the tableau of an implicit integrator: the same discrete
/// solution as that of multiple shooting.
///
/// ```text
/// f(k_i, x + h Σ_j a_ij k_j, u, z_i, p, t_i) = 0        x₊ = x + h Σ_i b_i k_i
/// ```
///
/// `k_i` and `z_i` are variables that [`Ipm`](crate::ocp::Ipm) moves together with states and
/// controls, with the same length of step; no iteration of Newton's method is for stages alone.
/// They begin between the states of the guess, `k_i = (x_{k+1} − x_k)/h`, and `z_i` at the nominal
/// values of the model. A guess need not be one that can be integrated: far from a solution this is
/// more robust than [`Shooting`](crate::ocp::Shooting).
///
/// ```
/// # use casados_core::{Dae, Error, Gauss, Irk, Options};
/// # use casados_core::ocp::{Collocation, Problem};
/// # fn example<Pendulum: Dae>() -> Result<(), Error> {
/// let irk = Irk::<Pendulum, Gauss<2>>::new(Options { steps: 2, ..Default::default() })?;
/// let problem = Problem::new(Collocation::new(irk)?);
/// # Ok(())
/// # }
/// ```
pub struct Collocation<M: Dae, B, const S: usize, T: Real> {
    /// Differentiates at the stages that there are.
    at: Irk<M, B, S, T>,
    /// Goes one iteration of Newton's method from there, and differentiates again.
    newton: Irk<M, B, S, T>,
    coefficients: Coefficients<T, S>,
    /// `y` of every step of every interval.
    stages: Vec<ArrayK<M, [T; S]>>,
    /// `a`
    increments: Vec<ArrayK<M, [T; S]>>,
    /// `Δy`
    change: Vec<ArrayK<M, [T; S]>>,
    /// Those of the best iterate.
    best: Vec<ArrayK<M, [T; S]>>,
    /// `w̄`, where increments are from.
    from: Vec<T>,
}

impl<M: Dae, B, const S: usize, T: Real> core::fmt::Debug for Collocation<M, B, S, T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Collocation").field("integrator", &self.at).finish_non_exhaustive()
    }
}

/// The same stages, and integrators with memory of their own.
impl<M: Dae, B, const S: usize, T: Real> Clone for Collocation<M, B, S, T> {
    fn clone(&self) -> Self {
        Self {
            at: self.at.clone(),
            newton: self.newton.clone(),
            coefficients: self.coefficients.clone(),
            stages: self.stages.clone(),
            increments: self.increments.clone(),
            change: self.change.clone(),
            best: self.best.clone(),
            from: self.from.clone(),
        }
    }
}

impl<M: Dae, B, const S: usize, T: Real> Collocation<M, B, S, T> {
    /// With the steps and the tableau of an integrator.
    ///
    /// # Errors
    /// Those of making an integrator.
    pub fn new(integrator: Irk<M, B, S, T>) -> Result<Self, Error> {
        let tableau = *integrator.tableau();
        Ok(Self {
            newton: Integrator::build(integrator.options().lifted(), tableau)?,
            coefficients: Coefficients::new(tableau, false),
            at: integrator,
            stages: Vec::new(),
            increments: Vec::new(),
            change: Vec::new(),
            best: Vec::new(),
            from: Vec::new(),
        })
    }

    /// Iterations of Newton's method that the last derivatives of an interval took: one for each
    /// step, which finds `a`. Points that are tried take none.
    #[must_use]
    pub fn iterations(&self) -> usize {
        self.at.statistics().iterations + self.newton.statistics().iterations
    }

    fn steps(&self) -> usize {
        self.at.options().steps
    }

    /// Stages between the states of a guess, with the nominal values of algebraic states.
    fn place_between(&mut self, nodes: &Nodes<'_, T>) -> Result<(), OcpError> {
        let (steps, nx) = (self.steps(), M::Shape::NX);
        let count = nodes.len().saturating_mul(steps);
        for list in [&mut self.stages, &mut self.increments, &mut self.change, &mut self.best] {
            list.clear();
            try_reserve(list, count)?;
            list.resize(count, Zeroable::zeroed());
        }
        self.from.clear();
        for (k, interval) in nodes.iter().enumerate() {
            let next = part(nodes.v, (k + 1) * nodes.ld[0], nx);
            for y in self.stages.iter_mut().skip(k * steps).take(steps) {
                let (slopes, algebraic) = y.as_mut().split_at_mut(nx);
                for ((slope, &end), &start) in slopes.iter_mut().zip(next).zip(interval.x) {
                    *slope = [(end - start) / interval.h; S];
                }
                for (z, &start) in algebraic.iter_mut().zip(M::START.get(nx..).unwrap_or_default()) {
                    *z = [T::from_f64(start); S];
                }
            }
        }
        Ok(())
    }

    /// Stages for all intervals; those of a solver that does not know them follow its iterate.
    fn follow(&mut self, nodes: &Nodes<'_, T>) -> Result<(), OcpError> {
        if self.stages.len() != nodes.len() * self.steps() {
            return self.place_between(nodes);
        }
        if nodes.step_length.is_none() && self.change_to(nodes)? {
            self.go(T::ONE);
        }
        Ok(())
    }

    /// `Δy = a + D (w − w̄)`, if there is a `w̄`.
    fn change_to(&mut self, nodes: &Nodes<'_, T>) -> Result<bool, OcpError> {
        if self.from.len() != nodes.v.len() {
            return Ok(false);
        }
        let from = core::mem::take(&mut self.from);
        let difference = from.iter().zip(nodes.v).map(|(&from, &to)| to - from).collect::<Vec<T>>();
        let result = self.expand_from(&Nodes { v: &from, ..*nodes }, &Nodes { v: &difference, ..*nodes });
        self.from = from;
        result.map(|()| true)
    }

    /// `Δy = a + D Δw`
    fn expand_from(&mut self, nodes: &Nodes<'_, T>, steps: &Nodes<'_, T>) -> Result<(), OcpError> {
        let count = self.steps();
        for (k, (interval, step)) in nodes.iter().zip(steps.iter()).enumerate() {
            let places = k * count..(k + 1) * count;
            let change = self.change.get_mut(places.clone()).unwrap_or_default();
            change.copy_from_slice(self.increments.get(places.clone()).unwrap_or_default());
            let mut seeds = Seeds::<M, T, 1>::zeroed();
            copy_common(seeds.x0.as_mut_slice(), step.x);
            copy_common(seeds.u.as_mut_slice(), step.u);
            step.free.spread(seeds.p.as_mut_slice(), step.w);
            let (x, u) = (vector(interval.x), vector(interval.u));
            at(k, self.at.begin(&interval))?;
            at(k, self.at.set_solution(self.stages.get(places).unwrap_or_default()))?;
            let arguments = Arguments { x0: &x, u: &u, h: interval.h };
            at(k, self.at.add_stage_derivatives(&arguments, &seeds, change))?;
        }
        Ok(())
    }

    /// Stages go a part of their way.
    fn go(&mut self, alpha: T) {
        go::<M, S, T>(&mut self.stages, &self.change, alpha);
    }

    /// All intervals at their stages: derivatives of `order` 1 or 2, and ends and algebraic states
    /// after one iteration of Newton's method.
    fn differentiate(
        &mut self,
        nodes: &Nodes<'_, T>,
        run: impl for<'r> Fn(&'r mut Irk<M, B, S, T>, &Interval<'_, T>) -> Result<IntervalResult<'r, T>, Error>,
        second: bool,
        sink: Sink<'_, T>,
    ) -> Result<(), OcpError> {
        self.follow(nodes)?;
        let count = self.steps();
        self.from.clear();
        self.from.extend_from_slice(nodes.v);
        for (k, interval) in nodes.iter().enumerate() {
            let places = k * count..(k + 1) * count;
            let stages = self.stages.get(places.clone()).unwrap_or_default();
            let increments = self.increments.get_mut(places).unwrap_or_default();
            let residual =
                Point::<M, T, S>::at(&interval, &self.coefficients, count).follow(stages, &[], T::ZERO).1;
            at(k, self.newton.begin(&interval))?;
            at(k, self.newton.run.set_stages_of_steps(stages))?;
            let (x, u) = (vector(interval.x), vector(interval.u));
            let after = *at(k, self.newton.forward(&x, &u, interval.h))?;
            at(k, self.newton.copy_stages(increments))?;
            for (increment, y) in increments.iter_mut().zip(stages) {
                let increment = increment.as_mut().as_flattened_mut().iter_mut();
                for (increment, &y) in increment.zip(y.as_ref().as_flattened()) {
                    *increment = *increment - y;
                }
            }
            at(k, self.at.begin(&interval))?;
            at(k, self.at.set_solution(stages))?;
            let step = at(k, run(&mut self.at, &interval))?;
            let (mut of_x, mut of_u, mut of_p) =
                (VectorX::<M, T>::zeroed(), VectorU::<M, T>::zeroed(), VectorP::<M, T>::zeroed());
            let mut cost = IntegralTerms::default();
            if second {
                let after = IntervalResult::from(&after);
                let changes = |of: [&[T]; 2], after: [&[T]; 2], to: &mut [T]| {
                    add_change(interval.multipliers, of[0], after[0], to);
                    add_change(interval.nu, of[1], after[1], to);
                };
                changes([step.dx, step.dz[0]], [after.dx, after.dz[0]], of_x.as_mut_slice());
                changes([step.du, step.dz[1]], [after.du, after.dz[1]], of_u.as_mut_slice());
                if interval.free.count() > 0 {
                    changes([step.dp, step.dz[2]], [after.dp, after.dz[2]], of_p.as_mut_slice());
                }
                (cost.x, cost.u, cost.p) = (of_x.as_slice(), of_u.as_slice(), of_p.as_slice());
            }
            let (x, z) = (after.nominal.x.as_slice(), after.nominal.z0.as_slice());
            sink(k, &IntervalResult { x, z, cost, stages: residual, ..step });
        }
        Ok(())
    }
}

/// Stages go a part of their way.
fn go<M: Dae, const S: usize, T: Real>(
    stages: &mut [ArrayK<M, [T; S]>],
    change: &[ArrayK<M, [T; S]>],
    alpha: T,
) {
    for (y, change) in stages.iter_mut().zip(change) {
        let y = y.as_mut().as_flattened_mut().iter_mut();
        for (y, &change) in y.zip(change.as_ref().as_flattened()) {
            *y = *y + alpha * change;
        }
    }
}

/// Adds `λᵀ (A' − A)`, with matrices column after column.
fn add_change<T: Real>(weights: &[T], before: &[T], after: &[T], to: &mut [T]) {
    let rows = weights.len().max(1);
    let columns = before.chunks_exact(rows).zip(after.chunks_exact(rows));
    for (to, (before, after)) in to.iter_mut().zip(columns) {
        for ((&weight, &before), &after) in weights.iter().zip(before).zip(after) {
            *to = *to + weight * (after - before);
        }
    }
}

impl<M: Dae, B, const S: usize, T: Real> Dynamics<T> for Collocation<M, B, S, T> {
    type Shape = M::Shape;
    const NAMES: Names = names::<M>();
    const ALGEBRAIC: bool = true;
    const LIFTED: bool = true;

    fn simulate(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        let count = self.steps();
        if self.stages.len() != nodes.len() * count {
            self.place_between(nodes)?;
        }
        let alpha = match nodes.step_length {
            Some(alpha) => alpha,
            None if self.change_to(nodes)? => T::ONE,
            None => T::ZERO,
        };
        for (k, interval) in nodes.iter().enumerate() {
            let places = k * count..(k + 1) * count;
            let [stages, change] =
                [&self.stages, &self.change].map(|list| list.get(places.clone()).unwrap_or_default());
            let point = Point::<M, T, S>::at(&interval, &self.coefficients, count);
            let (end, residual) = point.follow(stages, change, alpha);
            sink(
                k,
                &IntervalResult {
                    x: end.x.as_slice(),
                    z: end.z0.as_slice(),
                    stages: residual,
                    ..IntervalResult::default()
                },
            );
        }
        Ok(())
    }

    fn linearise(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        self.differentiate(nodes, forward::<M, B, S, T>, false, sink)
    }

    /// By the polynomials through the stages as they are.
    fn inside(&mut self, nodes: &Nodes<'_, T>, parts: &[T], sink: Sink<'_, T>) -> Result<bool, OcpError> {
        let count = self.steps();
        if self.stages.len() != nodes.len() * count {
            self.place_between(nodes)?;
        }
        let alpha = if self.change_to(nodes)? { T::ONE } else { T::ZERO };
        for (k, interval) in nodes.iter().enumerate() {
            let places = k * count..(k + 1) * count;
            let [stages, change] =
                [&self.stages, &self.change].map(|list| list.get(places.clone()).unwrap_or_default());
            let mut stages = stages.to_vec();
            go::<M, S, T>(&mut stages, change, alpha);
            at(k, self.at.begin(&interval))?;
            at(k, self.at.set_solution(&stages))?;
            let visit = &mut |j, x: &[T], z: &[T]| {
                sink(k * parts.len() + j, &IntervalResult { x, z, ..IntervalResult::default() })
            };
            at(k, self.at.at_parts(&interval, parts, visit))?;
        }
        Ok(true)
    }

    fn begin_stages(&mut self, nodes: &Nodes<'_, T>) -> Result<(), OcpError> {
        self.place_between(nodes)
    }

    fn expand_stages(&mut self, nodes: &Nodes<'_, T>, steps: &Nodes<'_, T>) -> Result<(), OcpError> {
        self.expand_from(nodes, steps)
    }

    fn move_stages(&mut self, action: StageAction<T>) {
        match action {
            StageAction::Go(alpha) => self.go(alpha),
            StageAction::Remember => self.best.copy_from_slice(&self.stages),
            StageAction::Recall => self.stages.copy_from_slice(&self.best),
        }
    }
}

impl<M: Dae, B, const S: usize, T: Real> SecondOrder<T> for Collocation<M, B, S, T> {
    fn second_order(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        self.differentiate(nodes, hessian::<M, B, S, T>, true, sink)
    }
}

fn forward<'r, M: Dae, B, const S: usize, T: Real>(
    irk: &'r mut Irk<M, B, S, T>,
    of: &Interval<'_, T>,
) -> Result<IntervalResult<'r, T>, Error> {
    irk.forward(&vector(of.x), &vector(of.u), of.h).map(IntervalResult::from)
}

fn hessian<'r, M: Dae, B, const S: usize, T: Real>(
    irk: &'r mut Irk<M, B, S, T>,
    of: &Interval<'_, T>,
) -> Result<IntervalResult<'r, T>, Error> {
    let lambda = vector(of.multipliers);
    irk.hessian_with_quadrature(&vector(of.x), &vector(of.u), of.h, &lambda, of.nu, None)
        .map(IntervalResult::from)
}
