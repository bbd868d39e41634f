//! Newton's method on the stages of one step.
//!
//! ```text
//! J Δ = f(y),   y ← y − Δ
//! ```
//!
//! Increments are measured relative to the size of each unknown,
//! `‖Δ‖ = max_c max_i |Δ_ci| / max_i |y_ci|`: however equations and unknowns are scaled. (For a
//! derivative `ẋ` a change that rounds to none in `x` is none.) They shrink by `θ`, so that the
//! next one is expected to be `θ ‖Δ‖/(1−θ)` with a Jacobian that was kept (Hairer and Wanner,
//! Solving ODEs II, IV.8), and `θ² ‖Δ‖` with the current one, since then `θ` squares too. Both are
//! asked unknown by unknown: a norm of all would let a linear one, corrected at once, speak for a
//! nonlinear one. It has converged as soon as the next increment is below the tolerance. Where
//! increments stop shrinking because the rounding errors of the model are larger than expected, it
//! has converged too if they are small, or if the residual is at the level of the rounding errors
//! of its terms: more cannot be known. (Where a model rests, unknowns are differences of large
//! terms that cancel: they have no digits by which an increment could be small.)
//!
//! [Kinematic](crate::model::Kinematic) states, as `q` in `q̇ = v`, are no unknowns: their `k`
//! follows from that of `v` before each iteration and after the last, whatever start values are
//! given for it.
//!
//! Which Jacobian the iteration takes follows the rule of `jacobian_policy`. An increment by an
//! older one that is larger than the last one, in any unknown, is [not made](super::rejection): it
//! may lead to another root than Newton's method does.
//!
//! Linear equations take one iteration; then their residual is looked at, and refined if digits
//! were lost; and whether they [determine](super::near_singular) a solution.
//!
//! All of this goes on in every lane at once: a lane that has converged waits for the others.

use super::convergence::{ConvergenceTest, IncrementKind, Status};
use super::increment::{PlaceResidual, Update, largest, subtract_increment};
use super::jacobian_policy::Policy;
use super::norm::{KinematicScales, Measure};
use super::rejection::grows_much;
use crate::irk::coefficients::Coefficients;
use crate::irk::workspace::{Linearization, Work};
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
const ROUNDING: f64 = 1.0;
/// Where sums over the steps are compensated, what an iteration leaves undone must not add up
/// either: it has the same sign in every step.
const COMPENSATED_ROUNDING: f64 = 1.0 / 64.0;

/// Linear equations are refined so often if one iteration was not enough.
const REFINEMENTS: usize = 4;

/// The equations of the stages of a step.
pub(crate) struct StageEquations<'a, M: Dae, E: Lanes, const S: usize, F: Fallback> {
    pub coefficients: &'a Coefficients<E, S>,
    /// Where the factors are that are valid, if that is not where new ones are made.
    pub kept: Option<&'a Linearization<M, E, S, F>>,
    /// Which step.
    pub n: usize,
    /// The state at its start.
    pub x: &'a ArrayX<M, E>,
}
copy!(['a, M: Dae, E: Lanes, const S: usize, F: Fallback] StageEquations<'a, M, E, S, F>);

/// How an iteration ended.
pub(crate) struct Solved<E: Lanes> {
    /// Which lanes have converged.
    pub converged: E::Mask,
    /// It does not contract with the factors of the step before that it began with: the start
    /// values are to be set again.
    pub stale: bool,
    /// Whether the factors that are there are those of the solution.
    pub exact: bool,
    /// An unknown of linear equations that they do not determine, in some lane that has not
    /// converged for that.
    pub undetermined: Option<usize>,
}

/// What increments are held against.
#[derive(Clone, Copy)]
struct Tolerances {
    /// The increment that is small enough.
    tolerance: f64,
    /// The increment that is a rounding error.
    rounding: f64,
}

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> Work<M, E, S, F> {
    /// Solves the stages of a step from the start values in `y`.
    pub(crate) fn newton(
        &mut self,
        equations: StageEquations<'_, M, E, S, F>,
        options: &Options,
        y: &mut ArrayK<M, [E; S]>,
        statistics: &mut Statistics,
    ) -> Solved<E> {
        let StageEquations { coefficients, x, .. } = equations;
        let Newton { fixed_iterations, jacobian, .. } = options.newton;
        let solved = match fixed_iterations {
            Some(count) if const { F::INTERVALS } => self.iterate(equations, jacobian, count, y, statistics),
            _ => self.converge(equations, options, y, statistics),
        };
        self.reconstruct(coefficients, x, y);
        if const { F::INTERVALS } && options.compensated {
            self.place_compensated(coefficients, x, y);
            self.reconstruct_compensated(y);
        }
        solved
    }

    /// Iterations until the increment is small enough. Of its own, or what it computes in `f64` is
    /// computed before it is known whether it is needed.
    #[inline(never)]
    fn converge(
        &mut self,
        equations: StageEquations<'_, M, E, S, F>,
        options: &Options,
        y: &mut ArrayK<M, [E; S]>,
        statistics: &mut Statistics,
    ) -> Solved<E> {
        let (StageEquations { coefficients, mut kept, .. }, newton) = (equations, &options.newton);
        let exact = M::STRUCTURE.linear_in_state;
        let rounding = if options.compensated { COMPENSATED_ROUNDING } else { ROUNDING } * E::EPSILON;
        let tolerances = Tolerances { tolerance: newton.tolerance.max(rounding), rounding };
        let may_share = const { Self::SHARES } && newton.jacobian.is_adaptive() && !exact;
        let basis = coefficients.basis.as_ref().filter(|_| may_share);
        let mut policy = Policy::<M, E, S>::start(newton.jacobian, basis.is_some(), self.validity, self.near);
        let mut test = ConvergenceTest::<E>::start(tolerances.tolerance, self.validity.rate, exact);
        let mut status = Status::default();
        let mut first = E::from_f64(0.0);
        let mut iteration = 0;
        // Whether nothing is known of an increment before.
        let mut anew = true;
        // Nothing will be written where states are kinematic.
        self.increment.as_mut().fill([[E::from_f64(0.0)]; S]);
        let mut missing = self.is_missing(policy.renew);
        loop {
            // The first iteration of nonlinear equations is far away in any case.
            let compensate = options.compensated && (iteration > 0 || exact);
            self.place_iterate(equations, y, missing, compensate);
            let asked = policy.asks && iteration == 1;
            if asked || !policy.renew {
                statistics.residuals += 1;
                self.evaluate_residual();
            }
            let early = asked && policy.leaves_much(self.largest_residual() / first, tolerances.tolerance);
            if policy.renew || early {
                statistics.jacobians += 1;
                statistics.factorizations += 1;
                policy.renewed();
                let in_middle = policy.shared && !options.compensated;
                self.evaluate_jacobian_of(equations, y, in_middle, asked);
                if !(policy.shared && self.factor_shared(basis)) {
                    kept = None;
                    self.factor(coefficients);
                }
            }
            if policy.asks && iteration == 0 {
                first = self.largest_residual();
            }
            self.complete_residual(coefficients, take(&mut missing), compensate);
            if exact
                && iteration > 0
                && let Some(solved) = self.solved_linear(equations, y, iteration, policy.factored)
            {
                return solved;
            }
            // The first increments of what begins far away may grow.
            if !exact && iteration > 2 && status.stuck {
                test.accept(self.is_satisfied());
                if !E::any(test.active) {
                    return self.solved(&test, policy.shared);
                }
            }
            iteration += 1;
            statistics.iterations += 1;
            if !(policy.shared && self.solve_shared(basis)) {
                self.place_residual();
                kept.unwrap_or(&self.linear).factors.solve(&mut self.increment);
            }
            let next;
            (status, next) = self.apply_increment(equations, y, &mut test, &policy, tolerances, anew);
            if !status.active {
                return self.solved(&test, policy.shared);
            }
            let rejected = grows_much(next)
                && !(exact || policy.renew || early)
                && self.is_rejected(y, next, policy.factored);
            let stale = rejected && !policy.factored;
            if stale || iteration == newton.max_iterations {
                (self.validity.factors, self.validity.shared) = (false, false);
                return Solved { converged: test.converged, stale, exact: false, undetermined: None };
            }
            policy.after(&status, iteration, early);
            policy.renew |= rejected;
            anew = rejected;
        }
    }

    /// Writes what the model is evaluated at.
    #[inline(always)]
    fn place_iterate(
        &mut self,
        StageEquations { coefficients, n, x, .. }: StageEquations<'_, M, E, S, F>,
        y: &mut ArrayK<M, [E; S]>,
        missing: bool,
        compensate: bool,
    ) {
        if missing {
            self.place(coefficients, n, x, y);
        } else {
            self.place_unknowns(coefficients, n, x, y);
        }
        if const { F::INTERVALS } && compensate {
            self.reconstruct(coefficients, x, y);
            self.place_compensated(coefficients, x, y);
            self.reconstruct_compensated(y);
            self.place_compensated(coefficients, x, y);
        }
    }

    /// The residual, which may be there, and the Jacobian: at all stages, or in their middle.
    #[inline(always)]
    fn evaluate_jacobian_of(
        &mut self,
        StageEquations { coefficients, n, x, .. }: StageEquations<'_, M, E, S, F>,
        y: &ArrayK<M, [E; S]>,
        in_middle: bool,
        residual: bool,
    ) {
        if in_middle {
            self.evaluate_middle(coefficients, n, x, y, residual);
        } else {
            self.evaluate_jacobian();
        }
    }

    /// What the residual has beside the values of the model.
    #[inline(always)]
    fn complete_residual(&mut self, coefficients: &Coefficients<E, S>, missing: bool, compensate: bool) {
        if missing {
            self.eliminate_missing(coefficients);
        }
        if const { F::INTERVALS } && compensate {
            self.correct_residual();
            self.eliminate_rounded(coefficients);
        }
    }

    /// The largest residual of all stages.
    #[inline(always)]
    fn largest_residual(&self) -> E {
        largest(self.f.as_ref().as_flattened())
    }

    /// The end of linear equations, if their residual says so: one iteration solves them, but for
    /// digits that were lost.
    #[inline(always)]
    fn solved_linear(
        &mut self,
        StageEquations { coefficients, n, x, .. }: StageEquations<'_, M, E, S, F>,
        y: &mut ArrayK<M, [E; S]>,
        iteration: usize,
        factored: bool,
    ) -> Option<Solved<E>> {
        self.validity.factors = true;
        let mut satisfied = self.is_satisfied();
        if !(E::all(satisfied) || iteration == REFINEMENTS) {
            return None;
        }
        let mut undetermined = None;
        // Of old factors it is known already.
        if factored && self.has_small_pivot(x, y) {
            let (determined, unknown) = self.is_determined(coefficients, n, x, y);
            (satisfied, undetermined) = (E::and(satisfied, determined), unknown);
        }
        Some(Solved { converged: satisfied, stale: false, exact: true, undetermined })
    }

    /// `y ← y − Δ`, and what the convergence test says about the increment.
    #[inline(always)]
    fn apply_increment(
        &mut self,
        StageEquations { coefficients, x, .. }: StageEquations<'_, M, E, S, F>,
        y: &mut ArrayK<M, [E; S]>,
        test: &mut ConvergenceTest<E>,
        policy: &Policy<M, E, S>,
        Tolerances { tolerance, rounding }: Tolerances,
        anew: bool,
    ) -> (Status, E) {
        let h = self.inputs.time.step;
        let floor = E::from_f64(rounding / tolerance);
        let Self { linear, points, increment, weights, sizes, .. } = self;
        let (jacobian, points) = (F::Plan::<M>::jacobian(&linear.jacobian), F::Plan::<M>::v(points));
        let scales = &KinematicScales::<F::Plan<M>, E, S> { jacobian, points, a: &coefficients.a };
        let (plan, x, y) = (F::plan::<M>(), F::Plan::<M>::x(x), F::Plan::<M>::k_mut(y));
        let increment = F::Plan::<M>::k_mut(increment);
        let (weights, sizes) = (F::Plan::<M>::k_mut(weights), F::Plan::<M>::k_mut(sizes));
        let (size, next) = dispatch(Update {
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
            full: policy.full,
            measure: anew,
        });
        let kind = if anew { IncrementKind::First { new: policy.renew } } else { IncrementKind::Later };
        let status = test.take(kind, size, next);
        if status.changed && status.moved && !M::STRUCTURE.linear_in_state && !anew {
            let measure = Measure { plan, scales, x, y, increment, weights, sizes, h, floor };
            let again = dispatch(measure);
            return (test.take(IncrementKind::Again, again, again), next);
        }
        (status, next)
    }
}

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> Work<M, E, S, F> {
    /// So many iterations, whose increments nobody asks for: on a processor without an FPU for
    /// double precision they take no operation of it.
    fn iterate(
        &mut self,
        equations: StageEquations<'_, M, E, S, F>,
        jacobian: Jacobian,
        count: usize,
        y: &mut ArrayK<M, [E; S]>,
        statistics: &mut Statistics,
    ) -> Solved<E> {
        let StageEquations { coefficients, mut kept, .. } = equations;
        let valid = self.validity.factors
            && (M::STRUCTURE.constant_matrix
                || jacobian == Jacobian::Simplified && !M::STRUCTURE.linear_in_state);
        // Nothing will be written where states are kinematic.
        self.increment.as_mut().fill([[E::from_f64(0.0)]; S]);
        for iteration in 0..count {
            let missing = self.is_missing(!valid);
            self.place_iterate(equations, y, missing, false);
            if valid || iteration > 0 && jacobian == Jacobian::Frozen {
                statistics.residuals += 1;
                self.evaluate_residual();
            } else {
                statistics.jacobians += 1;
                statistics.factorizations += 1;
                self.evaluate_jacobian();
                kept = None;
                self.factor(coefficients);
            }
            self.complete_residual(coefficients, missing, false);
            statistics.iterations += 1;
            self.place_residual();
            kept.unwrap_or(&self.linear).factors.solve(&mut self.increment);
            subtract_increment(y.as_mut(), self.increment.as_ref());
        }
        let zero = E::from_f64(0.0);
        Solved { converged: E::le(zero, zero), stale: false, exact: false, undetermined: None }
    }

    /// Whether stages may share a Jacobian: of one stage or two there is no eigenbasis. A single
    /// step starts near its solution, where that saves little in small models.
    const SHARES: bool = S > 2 && F::HAS_MEMORY && (F::INTERVALS || !Policy::<M, E, S>::EXACT);

    /// Factors of the shared Jacobian, if there is memory for them.
    #[inline(always)]
    fn factor_shared(&mut self, basis: Option<&Eigenbasis<E, S, S>>) -> bool {
        if const { Self::SHARES }
            && let (Some(basis), Some(factors)) = (basis, self.shared.get_mut())
        {
            factors.factor::<F>(&self.linear.jacobian, self.first_only, basis, self.inputs.time.step);
            return true;
        }
        false
    }

    /// Solves with them.
    #[inline(always)]
    fn solve_shared(&mut self, basis: Option<&Eigenbasis<E, S, S>>) -> bool {
        if const { Self::SHARES }
            && let (Some(basis), Some(factors)) = (basis, self.shared.get_mut())
        {
            factors.solve::<F>(basis, &self.f, &mut self.increment);
            return true;
        }
        false
    }

    /// Factors by blocks.
    fn factor(&mut self, coefficients: &Coefficients<E, S>) {
        let (Linearization { jacobian, factors }, h) = (&mut self.linear, self.inputs.time.step);
        factors.factor_by_plan(jacobian, &coefficients.a, h);
    }

    /// The residual in the slots of the equations.
    pub(in crate::irk) fn place_residual(&mut self) {
        let (plan, f) = (F::plan::<M>(), F::Plan::<M>::k(&self.f));
        dispatch(PlaceResidual { plan, f, increment: F::Plan::<M>::k_mut(&mut self.increment) });
    }

    /// After the last iteration: no lane is active any more.
    fn solved(&mut self, test: &ConvergenceTest<E>, shared: bool) -> Solved<E> {
        self.validity.rate = test.slowest_rate();
        let any = E::any(test.converged);
        (self.validity.factors, self.validity.shared) = (any && !shared, any && shared);
        Solved { converged: test.converged, stale: false, exact: false, undetermined: None }
    }
}
