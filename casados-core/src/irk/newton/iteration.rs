//! Newton's method on the stages of one step.
//!
//! ```text
//! J Δ = −f(y),   y ← y + Δ
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
//! Which Jacobian the iteration takes follows one rule ([`Jacobian::Auto`]): that of the last step
//! or of the start values is kept as long as the iterations that are still expected with it cost
//! less than a new one. How many that are is known from two increments by the same; of the first
//! one, which begins far away with a Jacobian of its own, the residual that it leaves tells. A new
//! one, with three stages or more, is the mean of those of the stages, or that in their middle
//! where they are not evaluated side by side. Its system is solved in the eigenbasis of the
//! tableau, in numbers that may be [coarse](Lanes::Coarse): it costs a fraction of one with a
//! Jacobian for each stage.
//!
//! Linear equations take one iteration; then their residual is looked at, and refined if digits
//! were lost; and whether they [determine](super::near_singular) a solution.
//!
//! All of this goes on in every lane at once: a lane that has converged waits for the others.

use super::convergence::{Look, Progress, Verdict, remaining};
use super::increment::{Largest, PlaceResidual, Subtract, Update};
use super::norm::{Followed, Measure};
use crate::irk::coefficients::Coefficients;
use crate::irk::workspace::{Linearization, Work};
use crate::linalg::{Eigenbasis, dispatch};
use crate::memory::{Fallback, Kept};
use crate::model::{ArrayK, ArrayX, Dae};
use crate::options::{Jacobian, Newton, Options};
use crate::scalar::Lanes;
use crate::statistics::Statistics;
use bytemuck::Zeroable;

/// Increments below this many ε are rounding errors.
const ROUNDING: f64 = 1.0;
/// Where sums over the steps are compensated, what an iteration leaves undone must not add up
/// either: it has the same sign in every step.
const LITTLE: f64 = 1.0 / 64.0;

/// The first mean Jacobian is that of start values, which may be far away: that increments grow
/// with it is not its fault.
const FAR: usize = 1;
/// So often the mean Jacobian is renewed in a step before the stages' own are taken.
const MEANS: usize = 3;

/// So many iterations new factors still take themselves: by blocks, and of the mean Jacobian, with
/// which increments never shrink quadratically. (With two, 17 masses had a factorisation more and
/// 65 had two more, in one iteration less: 12 and 20 % more time.)
const STILL: [f64; 2] = [2.0, 3.0];

/// Linear equations are refined so often if one iteration was not enough.
const REFINEMENTS: usize = 4;

/// How an iteration ended.
pub(crate) struct Solved<E: Lanes> {
    /// Which lanes have converged.
    pub converged: E::Mask,
    /// Whether the factors that are there are those of the solution.
    pub exact: bool,
    /// An unknown of linear equations that they do not determine, in some lane that has not
    /// converged for that.
    pub undetermined: Option<usize>,
}

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> Work<M, E, S, F> {
    /// The operations of an iteration with old factors: what is computed for all stages side by
    /// side counts once.
    const ITERATION: f64 = {
        let blocks = M::STRUCTURE.elimination.slots.len() as f64;
        M::STRUCTURE.operations.residual as f64 + blocks * S as f64 + 1.0
    };

    /// The cost of new factors, in iterations with old ones: by blocks, and of the mean Jacobian in
    /// the eigenbasis.
    const RENEWAL: [f64; 2] = {
        let (operations, plan) = (&M::STRUCTURE.operations, &M::STRUCTURE.elimination);
        let (s, inverses) = (S as f64, 4.0 * plan.pivots.len() as f64);
        // A complex product is four real ones.
        let jacobian = operations.residual_jacobian as f64;
        // One for all stages, where they are not evaluated side by side.
        let middle = if E::LANES > 1 { jacobian / s } else { jacobian };
        let (products, terms) = (plan.products() + inverses, plan.assembly.len() as f64);
        let of_blocks = (jacobian + (products + terms / s) * s * s) / Self::ITERATION;
        [of_blocks, (middle + (products + terms) * 4.0) / Self::ITERATION]
    };

    /// The cost of a residual, in iterations.
    const RESIDUAL: f64 = M::STRUCTURE.operations.residual as f64 / Self::ITERATION;

    /// Whether factors by blocks cost no more than the iterations that they save where start values
    /// are near: with mean Jacobians, which are renewed up to three times, it took 7 to 12 of them,
    /// with blocks 4 or 5 (Robertson, Van der Pol, Oregonator, HIRES, Akzo Nobel).
    const EXACT: bool = Self::RENEWAL[0] <= 10.0;

    /// Solves the stages of a step from the start values in `y`.
    #[allow(clippy::too_many_arguments)]
    pub(crate) fn newton(
        &mut self,
        coefficients: &Coefficients<E, S>,
        kept: Option<&Linearization<M, E, S, F>>,
        options: &Options,
        step: usize,
        x: &ArrayX<M, E>,
        y: &mut ArrayK<M, [E; S]>,
        statistics: &mut Statistics,
    ) -> Solved<E> {
        let Newton { fixed_iterations, jacobian, .. } = options.newton;
        let solved = match fixed_iterations {
            Some(count) => self.iterate(coefficients, kept, jacobian, count, step, x, y, statistics),
            None => self.converge(coefficients, kept, options, step, x, y, statistics),
        };
        self.reconstruct(coefficients, x, y);
        if options.compensated {
            self.place_compensated(coefficients, x, y);
            self.reconstruct_compensated(y);
        }
        solved
    }

    /// Iterations until the increment is small enough. Of its own, or what it computes in `f64` is
    /// computed before it is known whether it is needed.
    #[inline(never)]
    #[allow(clippy::too_many_arguments)]
    fn converge(
        &mut self,
        coefficients: &Coefficients<E, S>,
        mut kept: Option<&Linearization<M, E, S, F>>,
        options: &Options,
        step: usize,
        x: &ArrayX<M, E>,
        y: &mut ArrayK<M, [E; S]>,
        statistics: &mut Statistics,
    ) -> Solved<E> {
        let Options { newton: options, compensated, .. } = options;
        let most = options.max_iterations;
        let rounding = if *compensated { LITTLE } else { ROUNDING } * E::EPSILON;
        let tolerance = options.tolerance.max(rounding);
        let (full, exact) = (options.jacobian == Jacobian::Full, M::STRUCTURE.linear_in_state);
        let h = self.inputs.time.step;
        let mut progress = Progress::<E>::start(tolerance, self.validity.rate, exact);
        let mut verdict = Verdict::default();
        let simplified = options.jacobian == Jacobian::Simplified;
        let adaptive = options.jacobian.is_adaptive();
        let basis = coefficients.basis.as_ref().filter(|_| F::KEPT && adaptive && !exact);
        // Exact factors of the step before are the best there are, and cost nothing.
        let mut mean = basis.is_some() && !self.validity.factors;
        let mut renewals = 0;
        // Of old factors it is known already.
        let mut factored = false;
        let mut near = cfg!(feature = "alloc") && Self::EXACT && self.near && mean;
        let mut renew = if mean {
            !self.validity.mean
        } else if M::STRUCTURE.constant_matrix && self.validity.factors {
            false
        } else {
            // Of linear equations every step has one matrix, which may be that of all steps.
            full || exact || !(adaptive && self.validity.factors)
        };
        // Whether the residual that the first increment leaves is asked how good its Jacobian is.
        let ask = adaptive && renew && !near && !exact && !full && !M::STRUCTURE.constant_matrix;
        let mut first = E::from_f64(0.0);
        let mut iteration = 0;
        // Nothing will be written where states are kinematic.
        self.increment.as_mut().fill([[E::from_f64(0.0)]; S]);
        let mut missing = self.is_missing(renew);
        loop {
            if missing {
                self.place(coefficients, step, x, y);
            } else {
                self.place_unknowns(coefficients, step, x, y);
            }
            // The first iteration of nonlinear equations is far away in any case.
            let compensate = *compensated && (iteration > 0 || exact);
            if compensate {
                self.reconstruct(coefficients, x, y);
                self.place_compensated(coefficients, x, y);
                self.reconstruct_compensated(y);
                self.place_compensated(coefficients, x, y);
            }
            let asked = ask && iteration == 1;
            if asked || !renew {
                statistics.residuals += 1;
                self.evaluate_residual();
            }
            let early = asked && self.leaves_much(first, tolerance, basis.is_some());
            if renew || early {
                statistics.jacobians += 1;
                statistics.factorizations += 1;
                // Where the mean of the stages says too little about each of them, their own
                // Jacobians are taken.
                mean = basis.is_some() && !near && (simplified || renewals < MEANS);
                renewals += usize::from(renew);
                factored = true;
                if mean && !*compensated {
                    self.evaluate_middle(coefficients, step, x, y, asked);
                } else {
                    self.evaluate_jacobian();
                }
                if !(mean && self.factor_mean(basis)) {
                    kept = None;
                    self.factor(coefficients);
                }
            }
            if ask && iteration == 0 {
                first = dispatch(Largest { residual: self.f.as_ref().as_flattened() });
            }
            if core::mem::take(&mut missing) {
                self.eliminate_missing(coefficients);
            }
            if compensate {
                self.correct_residual();
                self.eliminate_rounded(coefficients);
            }
            if exact && iteration > 0 {
                self.validity.factors = true;
                let mut satisfied = self.is_satisfied();
                if E::all(satisfied) || iteration == REFINEMENTS {
                    let mut undetermined = None;
                    if factored && self.has_small_pivot(x, y) {
                        let (determined, unknown) = self.is_determined(coefficients, step, x, y);
                        (satisfied, undetermined) = (E::and(satisfied, determined), unknown);
                    }
                    return Solved { converged: satisfied, exact: true, undetermined };
                }
            }
            // The first increments of what begins far away may grow.
            if !exact && iteration > 2 && verdict.stuck {
                progress.accept(self.is_satisfied());
                if !E::any(progress.active) {
                    return self.solved(&progress, mean);
                }
            }
            iteration += 1;
            statistics.iterations += 1;
            if !(mean && self.solve_mean(basis)) {
                self.place_residual();
                kept.unwrap_or(&self.linear).factors.solve(&mut self.increment);
            }
            let floor = E::from_f64(rounding / tolerance);
            let followed = &Followed::<M, E, S> {
                jacobian: &self.linear.jacobian,
                points: &self.points,
                a: &coefficients.a,
            };
            let (size, next) = dispatch(Update::<M, E, S> {
                followed,
                x,
                y,
                increment: &mut self.increment,
                weights: &mut self.weights,
                sizes: &mut self.sizes,
                active: progress.active,
                h,
                floor,
                tolerance: E::from_f64(tolerance),
                full,
                measure: iteration == 1,
            });
            let look = if iteration == 1 { Look::First { new: renew } } else { Look::Later };
            verdict = progress.judge(look, size, next);
            if verdict.changed && verdict.moved && !exact && iteration > 1 {
                let Self { increment, weights, sizes, .. } = self;
                let measure = Measure::<M, E, S> { followed, x, y, increment, weights, sizes, h, floor };
                let again = dispatch(measure);
                verdict = progress.judge(Look::Again, again, again);
            }
            if !verdict.active {
                return self.solved(&progress, mean);
            }
            if iteration == most {
                (self.validity.factors, self.validity.mean) = (false, false);
                return Solved { converged: progress.converged, exact: false, undetermined: None };
            }
            if iteration > 1 && renewals > FAR && verdict.grows {
                // The mean of the stages does not do.
                renewals = MEANS;
            }
            // Those of a solution nearby do for all iterations, unless increments hardly shrink.
            near &= !verdict.stuck;
            let cheap = basis.is_some() && (simplified || renewals < MEANS);
            let expensive = STILL[usize::from(cheap)] + Self::RENEWAL[usize::from(cheap)];
            // The first increment of new factors against the last of old ones does not tell how
            // good the new ones are.
            let fresh = early || renew && iteration > 1;
            let slow = verdict.remaining > expensive && (!fresh || verdict.grows);
            renew = !exact && (full || adaptive && !near && slow);
        }
    }
}

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> Work<M, E, S, F> {
    /// So many iterations, whose increments nobody asks for: on a processor without an FPU for
    /// double precision they take no operation of it.
    #[allow(clippy::too_many_arguments)]
    fn iterate(
        &mut self,
        coefficients: &Coefficients<E, S>,
        mut kept: Option<&Linearization<M, E, S, F>>,
        jacobian: Jacobian,
        count: usize,
        step: usize,
        x: &ArrayX<M, E>,
        y: &mut ArrayK<M, [E; S]>,
        statistics: &mut Statistics,
    ) -> Solved<E> {
        let valid = self.validity.factors
            && (M::STRUCTURE.constant_matrix
                || jacobian == Jacobian::Simplified && !M::STRUCTURE.linear_in_state);
        // Nothing will be written where states are kinematic.
        self.increment.as_mut().fill([[E::from_f64(0.0)]; S]);
        for iteration in 0..count {
            let missing = self.is_missing(!valid);
            if missing {
                self.place(coefficients, step, x, y);
            } else {
                self.place_unknowns(coefficients, step, x, y);
            }
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
            if missing {
                self.eliminate_missing(coefficients);
            }
            statistics.iterations += 1;
            self.place_residual();
            kept.unwrap_or(&self.linear).factors.solve(&mut self.increment);
            dispatch(Subtract { y: y.as_mut(), increment: self.increment.as_ref() });
        }
        let zero = E::from_f64(0.0);
        Solved { converged: E::le(zero, zero), exact: false, undetermined: None }
    }

    /// Factors of the mean Jacobian, if there is memory for them. Of one stage or two there is no
    /// eigenbasis, and nothing is compiled.
    #[inline(always)]
    fn factor_mean(&mut self, basis: Option<&Eigenbasis<E, S, S>>) -> bool {
        if const { S > 2 }
            && let (Some(basis), Some(factors)) = (basis, self.mean.get_mut())
        {
            factors.factor(&self.linear.jacobian, self.first_only, basis, self.inputs.time.step);
            return true;
        }
        false
    }

    /// Solves with them.
    #[inline(always)]
    fn solve_mean(&mut self, basis: Option<&Eigenbasis<E, S, S>>) -> bool {
        if const { S > 2 }
            && let (Some(basis), Some(factors)) = (basis, self.mean.get_mut())
        {
            factors.solve(basis, &self.f, &mut self.increment);
            return true;
        }
        false
    }

    /// Factors by blocks.
    fn factor(&mut self, coefficients: &Coefficients<E, S>) {
        let (Linearization { jacobian, factors }, h) = (&mut self.linear, self.inputs.time.step);
        factors.factor_by_plan(jacobian, &coefficients.a, h);
    }

    /// Whether the residual that an increment leaves, of the `first` one, lets so many iterations
    /// be expected that new factors cost less. Where it leaves more than a sixteenth, those of
    /// where it led to would soon be renewed as well. Where it leaves more than there was, another
    /// increment by the same factors would be longer than the first, and may lead to another root
    /// than Newton's method does.
    fn leaves_much(&self, first: E, tolerance: f64, cheap: bool) -> bool {
        let left = dispatch(Largest { residual: self.f.as_ref().as_flattened() }) / first;
        let expensive = STILL[usize::from(cheap)] + Self::RESIDUAL + Self::RENEWAL[usize::from(cheap)];
        let mut cell: E::Cell = Zeroable::zeroed();
        left.store(&mut cell);
        let lanes = || (0..E::LANES).map(|lane| E::lane(&cell, lane));
        let slowest = lanes().filter(|&left| left < 1.0 / 16.0).fold(0.0, f64::max);
        remaining(true, 1.0, slowest, tolerance) > expensive || lanes().any(|left| left >= 1.0)
    }

    /// The residual in the slots of the equations.
    pub(in crate::irk) fn place_residual(&mut self) {
        dispatch(PlaceResidual::<M, E, S> { f: &self.f, increment: &mut self.increment });
    }

    /// After the last iteration: no lane is active any more.
    fn solved(&mut self, progress: &Progress<E>, mean: bool) -> Solved<E> {
        self.validity.rate = progress.slowest_rate();
        let any = E::any(progress.converged);
        (self.validity.factors, self.validity.mean) = (any && !mean, any && mean);
        Solved { converged: progress.converged, exact: false, undetermined: None }
    }
}
