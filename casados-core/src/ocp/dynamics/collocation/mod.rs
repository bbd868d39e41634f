//! Direct collocation: the stages of the integrator are variables of the problem, and converge with
//! its iterates.
//!
//! ```text
//! G(y, w) = 0,  x_{k+1} = E(y, w)        w = (x_k, u_k), y = (k_i, z_i) of all stages
//! Δy = a + D Δw                          a = −G_y⁻¹ G,  D = −G_y⁻¹ G_w
//! ```
//!
//! The QP has the size of multiple shooting: stages are eliminated interval by interval, by the
//! elimination plan of the model. It has `E(y + a)` for the end of an interval, `E_y D + E_w` for
//! its derivatives, and `[I; D]ᵀ ∇²(μᵀG) [I; D]` with the adjoint `μ` for its Hessian. The gradient
//! term of `a`, `Dᵀ ∇²(μᵀG) a`, is the change of `πᵀ dE/dw` from `y` to `y + a`, to first order.
//!
//! Solvers that support stages as variables update them with the step length of the iterate,
//! `y + α Δy`, and add `h G` to the violation. For other solvers the stages are
//! `y + a + D (w − w̄)`.
//!
//! R. Quirynen, S. Gros, B. Houska, M. Diehl, "Lifted collocation integrators for direct optimal
//! control in ACADO toolkit", Math. Program. Comput. 9 (2017).

mod equations;

use crate::error::Error;
use crate::irk::{Arguments, Coefficients, Integrator};
use crate::memory::Heap;
use crate::model::{ArrayK, Dae, VectorP, VectorU, VectorX};
use crate::ocp::dynamics::dense_output::DenseOutput;
use crate::ocp::dynamics::interval_setup::{IntervalSetup, in_interval};
use crate::ocp::dynamics::single_interval::names;
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
use equations::StageEquations;

type Irk<M, B, const S: usize, T> = Integrator<M, B, S, T, Heap>;

/// Direct collocation as dynamics, with the tableau of an implicit integrator. The discrete
/// solution is the same as with multiple shooting.
///
/// ```text
/// f(k_i, x + h Σ_j a_ij k_j, u, z_i, p, t_i) = 0        x₊ = x + h Σ_i b_i k_i
/// ```
///
/// [`Ipm`](crate::ocp::Ipm) updates the variables `k_i` and `z_i` together with states and
/// controls, with the same step length; there is no inner Newton iteration. Initial stages follow
/// from the guess: `k_i = (x_{k+1} − x_k)/h`, and `z_i` are the nominal values of the model. The
/// guess need not be integrable: far from a solution this is more robust than
/// [`Shooting`](crate::ocp::Shooting).
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
    /// Differentiates at the current stages.
    stage_differentiator: Irk<M, B, S, T>,
    /// Takes one Newton iteration from the current stages, and differentiates at the result.
    newton_integrator: Irk<M, B, S, T>,
    coefficients: Coefficients<T, S>,
    /// `y` of every step of every interval.
    stages: Vec<ArrayK<M, [T; S]>>,
    /// The Newton increments `a`.
    newton_increments: Vec<ArrayK<M, [T; S]>>,
    /// The steps `Δy`.
    stage_steps: Vec<ArrayK<M, [T; S]>>,
    /// The stages of the best iterate.
    best_stages: Vec<ArrayK<M, [T; S]>>,
    /// The point `w̄` of the linearisation.
    linearisation_point: Vec<T>,
}

impl<M: Dae, B, const S: usize, T: Real> core::fmt::Debug for Collocation<M, B, S, T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Collocation").field("integrator", &self.stage_differentiator).finish_non_exhaustive()
    }
}

/// Copies the stages, and creates integrators with their own memory.
impl<M: Dae, B, const S: usize, T: Real> Clone for Collocation<M, B, S, T> {
    fn clone(&self) -> Self {
        Self {
            stage_differentiator: self.stage_differentiator.clone(),
            newton_integrator: self.newton_integrator.clone(),
            coefficients: self.coefficients.clone(),
            stages: self.stages.clone(),
            newton_increments: self.newton_increments.clone(),
            stage_steps: self.stage_steps.clone(),
            best_stages: self.best_stages.clone(),
            linearisation_point: self.linearisation_point.clone(),
        }
    }
}

impl<M: Dae, B, const S: usize, T: Real> Collocation<M, B, S, T> {
    /// Direct collocation with the steps and the tableau of an integrator.
    ///
    /// # Errors
    /// The errors of creating an integrator.
    pub fn new(integrator: Irk<M, B, S, T>) -> Result<Self, Error> {
        let tableau = *integrator.tableau();
        Ok(Self {
            newton_integrator: Integrator::build(integrator.options().lifted(), tableau)?,
            coefficients: Coefficients::new(tableau, false),
            stage_differentiator: integrator,
            stages: Vec::new(),
            newton_increments: Vec::new(),
            stage_steps: Vec::new(),
            best_stages: Vec::new(),
            linearisation_point: Vec::new(),
        })
    }

    /// Returns the number of Newton iterations of the last derivatives of an interval: one for each
    /// step, which computes `a`. Trial points need none.
    #[must_use]
    pub fn iterations(&self) -> usize {
        self.stage_differentiator.statistics().iterations + self.newton_integrator.statistics().iterations
    }

    fn step_count(&self) -> usize {
        self.stage_differentiator.options().steps
    }

    /// Initialises the stages by the slopes between the states of a guess and the nominal values of
    /// algebraic states.
    fn interpolate_stages(&mut self, nodes: &Nodes<'_, T>) -> Result<(), OcpError> {
        let (steps, nx) = (self.step_count(), M::Shape::NX);
        let count = nodes.len().saturating_mul(steps);
        for list in
            [&mut self.stages, &mut self.newton_increments, &mut self.stage_steps, &mut self.best_stages]
        {
            list.clear();
            try_reserve(list, count)?;
            list.resize(count, Zeroable::zeroed());
        }
        self.linearisation_point.clear();
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

    /// Initialises the stages if their number has changed; for solvers without stages as variables,
    /// moves them to the iterate.
    fn update_stages(&mut self, nodes: &Nodes<'_, T>) -> Result<(), OcpError> {
        if self.stages.len() != nodes.len() * self.step_count() {
            return self.interpolate_stages(nodes);
        }
        if nodes.step_length.is_none() && self.compute_stage_steps(nodes)? {
            self.take_step(T::ONE);
        }
        Ok(())
    }

    /// Computes `Δy = a + D (w − w̄)`; returns false without a `w̄`.
    fn compute_stage_steps(&mut self, nodes: &Nodes<'_, T>) -> Result<bool, OcpError> {
        if self.linearisation_point.len() != nodes.v.len() {
            return Ok(false);
        }
        let last_point = core::mem::take(&mut self.linearisation_point);
        let difference = last_point.iter().zip(nodes.v).map(|(&from, &to)| to - from).collect::<Vec<T>>();
        let result =
            self.expand_steps_at(&Nodes { v: &last_point, ..*nodes }, &Nodes { v: &difference, ..*nodes });
        self.linearisation_point = last_point;
        result.map(|()| true)
    }

    /// Computes `Δy = a + D Δw`.
    fn expand_steps_at(&mut self, nodes: &Nodes<'_, T>, steps: &Nodes<'_, T>) -> Result<(), OcpError> {
        let count = self.step_count();
        for (k, (interval, step)) in nodes.iter().zip(steps.iter()).enumerate() {
            let step_range = k * count..(k + 1) * count;
            let change = self.stage_steps.get_mut(step_range.clone()).unwrap_or_default();
            change.copy_from_slice(self.newton_increments.get(step_range.clone()).unwrap_or_default());
            let mut seeds = Seeds::<M, T, 1>::zeroed();
            copy_common(seeds.x0.as_mut_slice(), step.x);
            copy_common(seeds.u.as_mut_slice(), step.u);
            step.free.scatter_step(seeds.p.as_mut_slice(), step.w);
            let (x, u) = (vector(interval.x), vector(interval.u));
            in_interval(k, self.stage_differentiator.begin(&interval))?;
            in_interval(
                k,
                self.stage_differentiator.set_solution(self.stages.get(step_range).unwrap_or_default()),
            )?;
            let arguments = Arguments { x0: &x, u: &u, h: interval.h };
            in_interval(k, self.stage_differentiator.add_stage_derivatives(&arguments, &seeds, change))?;
        }
        Ok(())
    }

    /// Updates the stages by the step length `alpha`.
    fn take_step(&mut self, alpha: T) {
        add_scaled_steps::<M, S, T>(&mut self.stages, &self.stage_steps, alpha);
    }

    /// Evaluates all intervals at their stages: derivatives of `order` 1 or 2, and ends and
    /// algebraic states after one Newton iteration.
    fn differentiate(
        &mut self,
        nodes: &Nodes<'_, T>,
        differentiate_interval: impl for<'r> Fn(
            &'r mut Irk<M, B, S, T>,
            &Interval<'_, T>,
        ) -> Result<IntervalResult<'r, T>, Error>,
        is_second_order: bool,
        sink: Sink<'_, T>,
    ) -> Result<(), OcpError> {
        self.update_stages(nodes)?;
        let count = self.step_count();
        self.linearisation_point.clear();
        self.linearisation_point.extend_from_slice(nodes.v);
        for (k, interval) in nodes.iter().enumerate() {
            let step_range = k * count..(k + 1) * count;
            let stages = self.stages.get(step_range.clone()).unwrap_or_default();
            let increments = self.newton_increments.get_mut(step_range).unwrap_or_default();
            let residual = StageEquations::<M, T, S>::at_start(&interval, &self.coefficients, count)
                .end_and_residuals(stages, &[], T::ZERO)
                .1;
            in_interval(k, self.newton_integrator.begin(&interval))?;
            in_interval(k, self.newton_integrator.run.set_stages_of_steps(stages))?;
            let (x, u) = (vector(interval.x), vector(interval.u));
            let after_newton = *in_interval(k, self.newton_integrator.forward(&x, &u, interval.h))?;
            in_interval(k, self.newton_integrator.copy_stages(increments))?;
            for (increment, y) in increments.iter_mut().zip(stages) {
                let increment = increment.as_mut().as_flattened_mut().iter_mut();
                for (increment, &y) in increment.zip(y.as_ref().as_flattened()) {
                    *increment = *increment - y;
                }
            }
            in_interval(k, self.stage_differentiator.begin(&interval))?;
            in_interval(k, self.stage_differentiator.set_solution(stages))?;
            let step = in_interval(k, differentiate_interval(&mut self.stage_differentiator, &interval))?;
            let (mut gradient_x, mut gradient_u, mut gradient_p) =
                (VectorX::<M, T>::zeroed(), VectorU::<M, T>::zeroed(), VectorP::<M, T>::zeroed());
            let mut cost = IntegralTerms::default();
            if is_second_order {
                let after = IntervalResult::from(&after_newton);
                let add_changes = |of: [&[T]; 2], after: [&[T]; 2], to: &mut [T]| {
                    add_jacobian_change(interval.multipliers, of[0], after[0], to);
                    add_jacobian_change(interval.nu, of[1], after[1], to);
                };
                add_changes([step.dx, step.dz[0]], [after.dx, after.dz[0]], gradient_x.as_mut_slice());
                add_changes([step.du, step.dz[1]], [after.du, after.dz[1]], gradient_u.as_mut_slice());
                if interval.free.count() > 0 {
                    add_changes([step.dp, step.dz[2]], [after.dp, after.dz[2]], gradient_p.as_mut_slice());
                }
                (cost.x, cost.u, cost.p) =
                    (gradient_x.as_slice(), gradient_u.as_slice(), gradient_p.as_slice());
            }
            let (x, z) = (after_newton.nominal.x.as_slice(), after_newton.nominal.z0.as_slice());
            sink(k, &IntervalResult { x, z, cost, stage_residuals: residual, ..step });
        }
        Ok(())
    }
}

/// Adds `alpha` times the steps to the stages.
fn add_scaled_steps<M: Dae, const S: usize, T: Real>(
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
fn add_jacobian_change<T: Real>(weights: &[T], before: &[T], after: &[T], to: &mut [T]) {
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
        let count = self.step_count();
        if self.stages.len() != nodes.len() * count {
            self.interpolate_stages(nodes)?;
        }
        let alpha = match nodes.step_length {
            Some(alpha) => alpha,
            None if self.compute_stage_steps(nodes)? => T::ONE,
            None => T::ZERO,
        };
        for (k, interval) in nodes.iter().enumerate() {
            let step_range = k * count..(k + 1) * count;
            let [stages, change] = [&self.stages, &self.stage_steps]
                .map(|list| list.get(step_range.clone()).unwrap_or_default());
            let point = StageEquations::<M, T, S>::at_start(&interval, &self.coefficients, count);
            let (end, residual) = point.end_and_residuals(stages, change, alpha);
            sink(
                k,
                &IntervalResult {
                    x: end.x.as_slice(),
                    z: end.z0.as_slice(),
                    stage_residuals: residual,
                    ..IntervalResult::default()
                },
            );
        }
        Ok(())
    }

    fn linearise(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        self.differentiate(nodes, forward::<M, B, S, T>, false, sink)
    }

    /// Evaluates the polynomials through the current stages.
    fn inside(&mut self, nodes: &Nodes<'_, T>, parts: &[T], sink: Sink<'_, T>) -> Result<bool, OcpError> {
        let count = self.step_count();
        if self.stages.len() != nodes.len() * count {
            self.interpolate_stages(nodes)?;
        }
        let alpha = if self.compute_stage_steps(nodes)? { T::ONE } else { T::ZERO };
        for (k, interval) in nodes.iter().enumerate() {
            let step_range = k * count..(k + 1) * count;
            let [stages, change] = [&self.stages, &self.stage_steps]
                .map(|list| list.get(step_range.clone()).unwrap_or_default());
            let mut stages = stages.to_vec();
            add_scaled_steps::<M, S, T>(&mut stages, change, alpha);
            in_interval(k, self.stage_differentiator.begin(&interval))?;
            in_interval(k, self.stage_differentiator.set_solution(&stages))?;
            let visit = &mut |j, x: &[T], z: &[T]| {
                sink(k * parts.len() + j, &IntervalResult { x, z, ..IntervalResult::default() })
            };
            in_interval(k, self.stage_differentiator.states_at_fractions(&interval, parts, visit))?;
        }
        Ok(true)
    }

    fn initialise_stages(&mut self, nodes: &Nodes<'_, T>) -> Result<(), OcpError> {
        self.interpolate_stages(nodes)
    }

    fn expand_stage_steps(&mut self, nodes: &Nodes<'_, T>, steps: &Nodes<'_, T>) -> Result<(), OcpError> {
        self.expand_steps_at(nodes, steps)
    }

    fn apply_stage_action(&mut self, action: StageAction<T>) {
        match action {
            StageAction::Step(alpha) => self.take_step(alpha),
            StageAction::StoreBest => self.best_stages.copy_from_slice(&self.stages),
            StageAction::RestoreBest => self.stages.copy_from_slice(&self.best_stages),
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
    interval: &Interval<'_, T>,
) -> Result<IntervalResult<'r, T>, Error> {
    irk.forward(&vector(interval.x), &vector(interval.u), interval.h).map(IntervalResult::from)
}

fn hessian<'r, M: Dae, B, const S: usize, T: Real>(
    irk: &'r mut Irk<M, B, S, T>,
    interval: &Interval<'_, T>,
) -> Result<IntervalResult<'r, T>, Error> {
    let lambda = vector(interval.multipliers);
    irk.hessian_with_quadrature(
        &vector(interval.x),
        &vector(interval.u),
        interval.h,
        &lambda,
        interval.nu,
        None,
    )
    .map(IntervalResult::from)
}
