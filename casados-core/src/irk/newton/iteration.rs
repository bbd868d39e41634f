//! Newton's method on the stages of one step.
//!
//! ```text
//! J Δ = f(y),   y ← y − Δ
//! ```
//!
//! Increments are measured relative to the size of each unknown,
//! `‖Δ‖ = max_c max_i |Δ_ci| / max_i |y_ci|`, which is invariant under scaling of equations and
//! unknowns. (A change of a derivative `ẋ` that rounds to zero in `x` counts as zero.) With
//! contraction rate `θ` the next increment is expected to be `θ ‖Δ‖/(1−θ)` with a constant Jacobian
//! (Hairer and Wanner, Solving ODEs II, IV.8), and `θ² ‖Δ‖` with the current one, since `θ` then
//! decreases quadratically. Both are evaluated for each unknown: in a norm over all unknowns a
//! linear one, which is exact after one iteration, would hide a nonlinear one. The iteration has
//! converged as soon as the next increment is expected to be below the tolerance. Increments
//! stagnate if rounding errors of the model are larger than expected. The iteration has then
//! converged if increments are small, or if the residual is at the level of the rounding errors of
//! its terms. (In a steady state the unknowns are differences of large terms that cancel, so that
//! relative increments remain large.)
//!
//! [Kinematic](crate::model::Kinematic) states, as `q` in `q̇ = v`, are no unknowns: their `k` is
//! computed from that of `v` before each iteration and after the last one; start values of it are
//! ignored.
//!
//! `jacobian_policy` chooses the Jacobian of the iteration. If an increment with an older Jacobian
//! exceeds the last one, in any unknown, it is [rejected](super::rejection): it may lead to another
//! root than Newton's method.
//!
//! Linear equations take one iteration. Their residual is then checked, with refinement if digits
//! were lost, and so is whether they [determine](super::near_singular) the solution.
//!
//! All lanes iterate together: a converged lane waits for the others.

use super::convergence::{ConvergenceTest, IncrementKind, Status};
use super::increment::{PlaceResidual, UpdateUnknowns, largest, subtract_increment};
use super::jacobian_policy::JacobianPolicy;
use super::norm::{KinematicScales, MeasureIncrement};
use super::rejection::exceeds_growth_bound;
use crate::irk::coefficients::Coefficients;
use crate::irk::workspace::{Linearization, StageWorkspace};
use crate::linalg::{Eigenbasis, dispatch};
use crate::memory::{Fallback, OptionalPlace};
use crate::model::{ArrayK, ArrayX, Dae};
use crate::options::{Jacobian, Newton, Options};
use crate::plan::PlanOf;
use crate::scalar::Lanes;
use crate::shape::copy;
use crate::statistics::Statistics;
use core::mem::take;

/// Increments below this many ε are rounding errors.
const INCREMENT_ROUNDING: f64 = 1.0;
/// With compensated sums over the steps the error of the iteration must be smaller, since it has
/// the same sign in every step and accumulates.
const COMPENSATED_INCREMENT_ROUNDING: f64 = 1.0 / 64.0;

/// Maximal number of refinements of linear equations.
const MAX_REFINEMENTS: usize = 4;

/// The equations of the stages of a step.
pub(crate) struct StageEquations<'a, M: Dae, E: Lanes, const S: usize, F: Fallback> {
    pub coefficients: &'a Coefficients<E, S>,
    /// The linearisation with the valid factors; `None` if they are in the workspace.
    pub stored_linearization: Option<&'a Linearization<M, E, S, F>>,
    /// Index of the step.
    pub n: usize,
    /// State at the start of the step.
    pub x: &'a ArrayX<M, E>,
}
copy!(['a, M: Dae, E: Lanes, const S: usize, F: Fallback] StageEquations<'a, M, E, S, F>);

/// The result of an iteration.
pub(crate) struct NewtonResult<E: Lanes> {
    /// Lanes that have converged.
    pub converged: E::Mask,
    /// Whether the iteration must restart from the initial guess: it does not contract with the
    /// factors of the preceding step.
    pub needs_restart: bool,
    /// Whether the factors in the workspace are those at the solution.
    pub factors_at_solution: bool,
    /// An unknown that linear equations do not determine, in a lane that did not converge for this
    /// reason.
    pub undetermined: Option<usize>,
}

/// Tolerances of relative increments.
#[derive(Clone, Copy)]
struct Tolerances {
    /// Tolerance of the iteration.
    tolerance: f64,
    /// Bound of rounding errors.
    rounding: f64,
}

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> StageWorkspace<M, E, S, F> {
    /// Solves for the stages of a step from the initial guess in `y`.
    pub(crate) fn newton(
        &mut self,
        equations: StageEquations<'_, M, E, S, F>,
        options: &Options,
        y: &mut ArrayK<M, [E; S]>,
        statistics: &mut Statistics,
    ) -> NewtonResult<E> {
        let StageEquations { coefficients, x, .. } = equations;
        let Newton { fixed_iterations, jacobian, .. } = options.newton;
        let solved = match fixed_iterations {
            Some(count) if const { F::INTERVALS } => {
                self.iterate_fixed(equations, jacobian, count, y, statistics)
            }
            _ => self.iterate_until_converged(equations, options, y, statistics),
        };
        self.reconstruct_kinematic(coefficients, x, y);
        if const { F::INTERVALS } && options.compensated {
            self.place_compensated(coefficients, x, y);
            self.reconstruct_compensated(y);
        }
        solved
    }

    /// Iterates until the increment is small enough. Not inlined, so that its `f64` operations are
    /// not executed before it is known whether they are needed.
    #[inline(never)]
    fn iterate_until_converged(
        &mut self,
        equations: StageEquations<'_, M, E, S, F>,
        options: &Options,
        y: &mut ArrayK<M, [E; S]>,
        statistics: &mut Statistics,
    ) -> NewtonResult<E> {
        let (StageEquations { coefficients, stored_linearization: mut kept, .. }, newton) =
            (equations, &options.newton);
        let linear = M::STRUCTURE.linear_in_state;
        let rounding = if options.compensated { COMPENSATED_INCREMENT_ROUNDING } else { INCREMENT_ROUNDING }
            * E::EPSILON;
        let tolerances = Tolerances { tolerance: newton.tolerance.max(rounding), rounding };
        let may_share = const { Self::MAY_SHARE_JACOBIAN } && newton.jacobian.is_adaptive() && !linear;
        let basis = coefficients.eigenbasis.as_ref().filter(|_| may_share);
        let mut policy = JacobianPolicy::<M, E, S>::start(
            newton.jacobian,
            basis.is_some(),
            self.validity,
            self.start_near_solution,
        );
        let mut test = ConvergenceTest::<E>::start(tolerances.tolerance, self.validity.rate, linear);
        let mut status = Status::default();
        let mut first_residual = E::from_f64(0.0);
        let mut iteration = 0;
        // Whether there is no last increment to compare with.
        let mut no_previous_increment = true;
        // Increments of kinematic states are never written: they remain zero.
        self.increment.as_mut().fill([[E::from_f64(0.0)]; S]);
        let mut omits_kinematic = self.omits_kinematic(policy.renew);
        loop {
            // The first iterate of nonlinear equations is too inaccurate for compensation.
            let compensate = options.compensated && (iteration > 0 || linear);
            self.place_iterate(equations, y, omits_kinematic, compensate);
            let checks_residual = policy.may_refresh_early && iteration == 1;
            if checks_residual || !policy.renew {
                statistics.residuals += 1;
                self.evaluate_residual();
            }
            let renews_early = checks_residual
                && policy
                    .contraction_too_slow(self.largest_residual() / first_residual, tolerances.tolerance);
            if policy.renew || renews_early {
                statistics.jacobians += 1;
                statistics.factorizations += 1;
                policy.on_renewal();
                let at_midpoint = policy.shared && !options.compensated;
                self.evaluate_iterate_jacobian(equations, y, at_midpoint, checks_residual);
                if !(policy.shared && self.factor_shared(basis)) {
                    kept = None;
                    self.factor_stages(coefficients);
                }
            }
            if policy.may_refresh_early && iteration == 0 {
                first_residual = self.largest_residual();
            }
            self.complete_residual(coefficients, take(&mut omits_kinematic), compensate);
            if linear
                && iteration > 0
                && let Some(solved) = self.linear_result(equations, y, iteration, policy.renewed_in_step)
            {
                return solved;
            }
            // The first increments may grow if the initial guess is far from the solution.
            if !linear && iteration > 2 && status.stagnates {
                test.accept_satisfied(self.residual_is_rounding());
                if !E::any(test.active) {
                    return self.newton_result(&test, policy.shared);
                }
            }
            iteration += 1;
            statistics.iterations += 1;
            if !(policy.shared && self.solve_shared(basis)) {
                self.place_residual();
                kept.unwrap_or(&self.linearization).factors.solve(&mut self.increment);
            }
            let next;
            (status, next) =
                self.apply_increment(equations, y, &mut test, &policy, tolerances, no_previous_increment);
            if !status.active {
                return self.newton_result(&test, policy.shared);
            }
            let rejected = exceeds_growth_bound(next)
                && !(linear || policy.renew || renews_early)
                && self.reject_growing_increments(y, next, policy.renewed_in_step);
            let needs_restart = rejected && !policy.renewed_in_step;
            if needs_restart || iteration == newton.max_iterations {
                (self.validity.factors, self.validity.shared) = (false, false);
                return NewtonResult {
                    converged: test.converged,
                    needs_restart,
                    factors_at_solution: false,
                    undetermined: None,
                };
            }
            policy.after_iteration(&status, iteration, renews_early);
            policy.renew |= rejected;
            no_previous_increment = rejected;
        }
    }

    /// Writes the variables at which the model is evaluated.
    #[inline(always)]
    fn place_iterate(
        &mut self,
        StageEquations { coefficients, n, x, .. }: StageEquations<'_, M, E, S, F>,
        y: &mut ArrayK<M, [E; S]>,
        omits_kinematic: bool,
        compensate: bool,
    ) {
        if omits_kinematic {
            self.place_stages(coefficients, n, x, y);
        } else {
            self.place_unknowns(coefficients, n, x, y);
        }
        if const { F::INTERVALS } && compensate {
            self.reconstruct_kinematic(coefficients, x, y);
            self.place_compensated(coefficients, x, y);
            self.reconstruct_compensated(y);
            self.place_compensated(coefficients, x, y);
        }
    }

    /// Evaluates the Jacobian, at all stages or at their midpoint, and the residual, unless it is
    /// known.
    #[inline(always)]
    fn evaluate_iterate_jacobian(
        &mut self,
        StageEquations { coefficients, n, x, .. }: StageEquations<'_, M, E, S, F>,
        y: &ArrayK<M, [E; S]>,
        at_midpoint: bool,
        residual: bool,
    ) {
        if at_midpoint {
            self.evaluate_midpoint_jacobian(coefficients, n, x, y, residual);
        } else {
            self.evaluate_jacobian();
        }
    }

    /// Adds the terms of kinematic states and of compensation to the residual of the model.
    #[inline(always)]
    fn complete_residual(
        &mut self,
        coefficients: &Coefficients<E, S>,
        omits_kinematic: bool,
        compensate: bool,
    ) {
        if omits_kinematic {
            self.eliminate_omitted(coefficients);
        }
        if const { F::INTERVALS } && compensate {
            self.correct_residual();
            self.eliminate_rounding(coefficients);
        }
    }

    /// Returns the largest residual of all stages.
    #[inline(always)]
    fn largest_residual(&self) -> E {
        largest(self.f.as_ref().as_flattened())
    }

    /// Returns the result for linear equations, unless the residual requires a refinement.
    #[inline(always)]
    fn linear_result(
        &mut self,
        StageEquations { coefficients, n, x, .. }: StageEquations<'_, M, E, S, F>,
        y: &mut ArrayK<M, [E; S]>,
        iteration: usize,
        factored: bool,
    ) -> Option<NewtonResult<E>> {
        self.validity.factors = true;
        let mut satisfied = self.residual_is_rounding();
        if !(E::all(satisfied) || iteration == MAX_REFINEMENTS) {
            return None;
        }
        let mut undetermined = None;
        // Reused factors have been checked already.
        if factored && self.has_small_pivot(x, y) {
            let (determined, unknown) = self.is_determined(coefficients, n, x, y);
            (satisfied, undetermined) = (E::and(satisfied, determined), unknown);
        }
        Some(NewtonResult {
            converged: satisfied,
            needs_restart: false,
            factors_at_solution: true,
            undetermined,
        })
    }

    /// `y ← y − Δ`; returns the status of the convergence test, and the growth of the increment.
    #[inline(always)]
    fn apply_increment(
        &mut self,
        StageEquations { coefficients, x, .. }: StageEquations<'_, M, E, S, F>,
        y: &mut ArrayK<M, [E; S]>,
        test: &mut ConvergenceTest<E>,
        policy: &JacobianPolicy<M, E, S>,
        Tolerances { tolerance, rounding }: Tolerances,
        no_previous_increment: bool,
    ) -> (Status, E) {
        let h = self.inputs.time.step;
        let floor = E::from_f64(rounding / tolerance);
        let Self { linearization: linear, points, increment, weights, increment_sizes: sizes, .. } = self;
        let (jacobian, points) = (F::Plan::<M>::jacobian(&linear.jacobian), F::Plan::<M>::v(points));
        let scales = &KinematicScales::<F::Plan<M>, E, S> { jacobian, points, a: &coefficients.a };
        let (plan, x, y) = (F::plan::<M>(), F::Plan::<M>::x(x), F::Plan::<M>::k_mut(y));
        let increment = F::Plan::<M>::k_mut(increment);
        let (weights, sizes) = (F::Plan::<M>::k_mut(weights), F::Plan::<M>::k_mut(sizes));
        let (size, next) = dispatch(UpdateUnknowns {
            plan,
            scales,
            x,
            y: &mut *y,
            increment: &mut *increment,
            weights: &mut *weights,
            sizes: &mut *sizes,
            active: test.active,
            h,
            floor,
            tolerance: E::from_f64(tolerance),
            full_newton: policy.full_newton,
            measures_sizes: no_previous_increment,
        });
        let increment_kind = if no_previous_increment {
            IncrementKind::First { new_factors: policy.renew }
        } else {
            IncrementKind::Subsequent
        };
        let status = test.update(increment_kind, size, next);
        if status.lane_stopped
            && status.sizes_outdated
            && !M::STRUCTURE.linear_in_state
            && !no_previous_increment
        {
            let measure = MeasureIncrement { plan, scales, x, y, increment, weights, sizes, h, floor };
            let again = dispatch(measure);
            return (test.update(IncrementKind::Remeasured, again, again), next);
        }
        (status, next)
    }
}

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> StageWorkspace<M, E, S, F> {
    /// Makes `count` iterations without a convergence test: on a processor without double-precision
    /// FPU they need no `f64` operations.
    fn iterate_fixed(
        &mut self,
        equations: StageEquations<'_, M, E, S, F>,
        jacobian: Jacobian,
        count: usize,
        y: &mut ArrayK<M, [E; S]>,
        statistics: &mut Statistics,
    ) -> NewtonResult<E> {
        let StageEquations { coefficients, stored_linearization: mut kept, .. } = equations;
        let factors_valid = self.validity.factors
            && (M::STRUCTURE.constant_matrix
                || jacobian == Jacobian::Simplified && !M::STRUCTURE.linear_in_state);
        // Increments of kinematic states are never written: they remain zero.
        self.increment.as_mut().fill([[E::from_f64(0.0)]; S]);
        for iteration in 0..count {
            let omits_kinematic = self.omits_kinematic(!factors_valid);
            self.place_iterate(equations, y, omits_kinematic, false);
            if factors_valid || iteration > 0 && jacobian == Jacobian::Frozen {
                statistics.residuals += 1;
                self.evaluate_residual();
            } else {
                statistics.jacobians += 1;
                statistics.factorizations += 1;
                self.evaluate_jacobian();
                kept = None;
                self.factor_stages(coefficients);
            }
            self.complete_residual(coefficients, omits_kinematic, false);
            statistics.iterations += 1;
            self.place_residual();
            kept.unwrap_or(&self.linearization).factors.solve(&mut self.increment);
            subtract_increment(y.as_mut(), self.increment.as_ref());
        }
        let zero = E::from_f64(0.0);
        NewtonResult {
            converged: E::le(zero, zero),
            needs_restart: false,
            factors_at_solution: false,
            undetermined: None,
        }
    }

    /// Whether stages may share a Jacobian: only three stages or more have an eigenbasis. An
    /// integrator of one step starts near its solution, where a shared Jacobian saves little in
    /// small models.
    const MAY_SHARE_JACOBIAN: bool =
        S > 2 && F::HAS_MEMORY && (F::INTERVALS || !JacobianPolicy::<M, E, S>::STAGE_FACTORS_ARE_CHEAP);

    /// Factorises the shared Jacobian; returns `false` without memory for it.
    #[inline(always)]
    fn factor_shared(&mut self, basis: Option<&Eigenbasis<E, S, S>>) -> bool {
        if const { Self::MAY_SHARE_JACOBIAN }
            && let (Some(basis), Some(factors)) = (basis, self.shared.get_mut())
        {
            factors.factor::<F>(
                &self.linearization.jacobian,
                self.first_stage_only,
                basis,
                self.inputs.time.step,
            );
            return true;
        }
        false
    }

    /// Solves with the factors of the shared Jacobian; returns `false` without memory for them.
    #[inline(always)]
    fn solve_shared(&mut self, basis: Option<&Eigenbasis<E, S, S>>) -> bool {
        if const { Self::MAY_SHARE_JACOBIAN }
            && let (Some(basis), Some(factors)) = (basis, self.shared.get_mut())
        {
            factors.solve::<F>(basis, &self.f, &mut self.increment);
            return true;
        }
        false
    }

    /// Factorises with the Jacobian of each stage.
    fn factor_stages(&mut self, coefficients: &Coefficients<E, S>) {
        let (Linearization { jacobian, factors }, h) = (&mut self.linearization, self.inputs.time.step);
        factors.factor_by_plan(jacobian, &coefficients.a, h);
    }

    /// Copies the residual to the slots of the equations.
    pub(in crate::irk) fn place_residual(&mut self) {
        let (plan, f) = (F::plan::<M>(), F::Plan::<M>::k(&self.f));
        dispatch(PlaceResidual { plan, f, increment: F::Plan::<M>::k_mut(&mut self.increment) });
    }

    /// Returns the result after the last iteration, when no lane is active.
    fn newton_result(&mut self, test: &ConvergenceTest<E>, shared: bool) -> NewtonResult<E> {
        self.validity.rate = test.slowest_rate();
        let any_converged = E::any(test.converged);
        (self.validity.factors, self.validity.shared) = (any_converged && !shared, any_converged && shared);
        NewtonResult {
            converged: test.converged,
            needs_restart: false,
            factors_at_solution: false,
            undetermined: None,
        }
    }
}
