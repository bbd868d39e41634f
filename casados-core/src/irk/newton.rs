//! Newton's method on the stages of one step.
//!
//! ```text
//! J Δ = −f(y),   y ← y + Δ
//! ```
//!
//! Increments are measured relative to the size of each unknown, `‖Δ‖ = max_c max_i |Δ_ci| / max_i |y_ci|`: however
//! equations and unknowns are scaled. (For a derivative `ẋ` a change that rounds to none in `x` is none.) They shrink
//! by `θ`, so that the next one is expected to be `θ ‖Δ‖/(1−θ)` with a Jacobian that was kept (Hairer and Wanner,
//! Solving ODEs II, IV.8), and `θ² ‖Δ‖` with the current one, since then `θ` squares too. Both are asked unknown by
//! unknown: a norm of all would let a linear one, corrected at once, speak for a nonlinear one. It has converged as
//! soon as the next increment is below the tolerance. Where increments stop shrinking because the rounding errors of the model are
//! larger than expected, it has converged too if they are small, or if the residual is at the level of the rounding errors of its
//! terms: more cannot be known. (Where a model rests, unknowns are differences of large terms that cancel: they have no digits
//! by which an increment could be small.)
//!
//! Which Jacobian the iteration takes follows one rule ([`Jacobian::Auto`]): that of the last step or of the start
//! values is kept as long as the iterations that are still expected with it cost less than a new one. A new one, with
//! three stages or more, is the mean of those of the stages, whose system is solved in the eigenbasis of the tableau: it
//! costs a fraction of one with a Jacobian for each stage.
//!
//! Linear equations take one iteration; then their residual is looked at, and refined if digits were lost.
//!
//! All of this goes on in every lane at once: a lane that has converged waits for the others.

use super::increment::{Measure, PlaceResidual, Subtract, Update};
use super::record::{Coefficients, Work};
use crate::linalg::dispatch;
use crate::memory::{Fallback, Kept};
use crate::model::{ArrayK, ArrayX, Dae};
use crate::options::{Jacobian, Newton, Options};
use crate::scalar::Lanes;
use crate::statistics::Statistics;
use bytemuck::Zeroable;

/// Increments below this many ε are rounding errors.
const ROUNDING: f64 = 1.0;
/// Where sums over the steps are compensated, what an iteration leaves undone must not add up either: it has the same sign
/// in every step.
const LITTLE: f64 = 1.0 / 64.0;

/// The first mean Jacobian is that of start values, which may be far away: that increments grow with it is not its fault.
const FAR: usize = 1;
/// So often the mean Jacobian is renewed in a step before the stages' own are taken.
const MEANS: usize = 3;

/// Linear equations are refined so often if one iteration was not enough.
const REFINEMENTS: usize = 4;

/// How an iteration ended.
pub(crate) struct Solved<E: Lanes> {
    /// Which lanes have converged.
    pub converged: E::Mask,
    /// Whether the factors that are there are those of the solution.
    pub exact: bool,
}

/// What every lane is judged by.
struct Rule {
    tolerance: f64,
    /// Increments that no longer shrink are rounding errors below this.
    stagnation: f64,
    /// Every Jacobian is the current one.
    full: bool,
    /// The equations are linear, and the factors are theirs.
    exact: bool,
}

/// How far one lane is.
#[derive(Clone, Copy)]
struct Progress {
    state: State,
    /// The increment before.
    last: f64,
    /// How fast increments shrink, if that is known.
    rate: Option<f64>,
}

#[derive(Clone, Copy, PartialEq)]
enum State {
    Active,
    Converged,
    Failed,
}

impl Progress {
    /// After an increment, and what is expected of the next one: with factors that are `new` or older ones, the first
    /// in this step or a later one.
    fn judge(&mut self, rule: &Rule, increment: f64, next: f64, new: bool, first: bool) {
        if !increment.is_finite() {
            self.state = State::Failed;
            return;
        }
        let mut expected = increment;
        if first {
            // What the last step found out holds for its factors only; and too roughly to stop by it.
            self.rate = self.rate.filter(|_| !new);
        } else {
            self.rate = Some(increment / self.last);
            expected = if increment <= rule.stagnation && 2.0 * increment >= self.last { 0.0 } else { next };
        }
        self.last = increment;
        // Of linear equations the residual will tell.
        if expected <= rule.tolerance && !rule.exact {
            self.state = State::Converged;
        }
    }

    /// Whether increments grow.
    fn grows(&self) -> bool {
        self.state == State::Active && self.rate.is_some_and(|rate| rate > 1.0)
    }

    /// Whether increments no longer shrink.
    fn is_stuck(&self) -> bool {
        self.state == State::Active && self.rate.is_some_and(|rate| rate >= 0.5)
    }

    /// How many more increments are expected until the tolerance.
    fn remaining(&self, rule: &Rule) -> f64 {
        let (mut increment, mut count) = (self.last, 0.0);
        let rate = self.rate.unwrap_or(0.0);
        while increment > rule.tolerance && count < 64.0 {
            (increment, count) = (increment * rate, count + 1.0);
        }
        count
    }
}

/// More lanes than any register has.
const MOST_LANES: usize = 16;

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> Work<M, E, S, F> {
    /// The cost of new factors, in iterations with old ones: by blocks, and of the mean Jacobian in the eigenbasis.
    const RENEWAL: [f64; 2] = {
        let (operations, plan) = (&M::STRUCTURE.operations, &M::STRUCTURE.elimination);
        let (s, blocks) = (S as f64, plan.slots.len() as f64);
        let inverses = 4.0 * plan.pivots.len() as f64;
        // What is computed for all stages side by side counts once; a complex product is four real ones.
        let iteration = operations.residual as f64 + blocks * s + 1.0;
        let jacobian = operations.residual_jacobian as f64;
        let (updates, means) = (plan.products(s) + inverses, plan.products(1.0) + inverses);
        [(jacobian + updates * s * s) / iteration, (jacobian + means * 4.0) / iteration]
    };

    /// Whether factors by blocks cost no more than the iterations that they save where start values are near: with mean Jacobians, which are
    /// renewed up to three times, it took 7 to 12 of them, with blocks 4 or 5 (Robertson, Van der Pol, Oregonator, HIRES, Akzo Nobel).
    const EXACT: bool = Self::RENEWAL[0] <= 10.0;

    /// Solves the stages of a step from the start values in `y`.
    pub(crate) fn newton(
        &mut self,
        coefficients: &Coefficients<E, S>,
        options: &Options,
        step: usize,
        x: &ArrayX<M, E>,
        y: &mut ArrayK<M, [E; S]>,
        statistics: &mut Statistics,
    ) -> Solved<E> {
        let Newton { fixed_iterations, jacobian, .. } = options.newton;
        match fixed_iterations {
            Some(count) => self.iterate(coefficients, jacobian, count, step, x, y, statistics),
            None => self.converge(coefficients, options, step, x, y, statistics),
        }
    }

    /// Iterations until the increment is small enough. Of its own, or what it computes in `f64` is computed before it is known
    /// whether it is needed.
    #[inline(never)]
    fn converge(
        &mut self,
        coefficients: &Coefficients<E, S>,
        options: &Options,
        step: usize,
        x: &ArrayX<M, E>,
        y: &mut ArrayK<M, [E; S]>,
        statistics: &mut Statistics,
    ) -> Solved<E> {
        let Options { newton: options, compensated, .. } = options;
        let most = options.max_iterations;
        let rounding = if *compensated { LITTLE } else { ROUNDING } * E::EPSILON;
        let rule = Rule {
            tolerance: options.tolerance.max(rounding),
            stagnation: E::STAGNATION,
            full: options.jacobian == Jacobian::Full,
            // Of linear equations every step has one matrix, which may be that of all steps.
            exact: M::STRUCTURE.linear_in_state,
        };
        let h = self.inputs.time.step;
        let rate = Some(self.validity.rate).filter(|rate| *rate > 0.0);
        let start = Progress { state: State::Active, last: 0.0, rate };
        let (mut one, mut many);
        let lanes: &mut [Progress] = if const { E::LANES == 1 } {
            one = [start];
            &mut one
        } else {
            many = [start; MOST_LANES];
            many.get_mut(..E::LANES).unwrap_or_default()
        };
        let simplified = options.jacobian == Jacobian::Simplified;
        let adaptive = simplified || options.jacobian == Jacobian::Auto;
        let basis = coefficients.basis.as_ref().filter(|_| F::KEPT && adaptive && !rule.exact);
        // Exact factors of the step before are the best there are, and cost nothing.
        let mut mean = basis.is_some() && !self.validity.factors;
        let mut renewals = 0;
        let mut near = cfg!(feature = "alloc") && Self::EXACT && self.near && mean;
        let mut renew = if mean {
            !self.validity.mean
        } else if M::STRUCTURE.constant_matrix && self.validity.factors {
            false
        } else {
            rule.full || rule.exact || !(adaptive && self.validity.factors)
        };
        let mut iteration = 0;
        let mut active = mask::<E>(lanes, State::Active);
        loop {
            self.place(coefficients, step, x, y);
            // The first iteration of nonlinear equations is far away in any case.
            let compensate = *compensated && (iteration > 0 || rule.exact);
            if compensate {
                self.place_compensated(coefficients, x, y);
            }
            if renew {
                statistics.jacobians += 1;
                statistics.factorizations += 1;
                self.evaluate_jacobian();
                // Where the mean of the stages says too little about each of them, their own Jacobians are taken.
                mean = basis.is_some() && !near && (simplified || renewals < MEANS);
                renewals += 1;
                match (basis, self.mean.get_mut()) {
                    (Some(basis), Some(factors)) if mean => factors.factor(&self.linear.jacobian, basis, h),
                    _ => self.linear.factors.factor_by_plan(&self.linear.jacobian, &coefficients.a, h),
                }
            } else {
                statistics.residuals += 1;
                self.evaluate_residual();
            }
            if compensate {
                self.correct_residual();
            }
            if rule.exact && iteration > 0 {
                self.validity.factors = true;
                let satisfied = self.is_satisfied();
                if E::all(satisfied) || iteration == REFINEMENTS {
                    return Solved { converged: satisfied, exact: true };
                }
            }
            if !rule.exact && iteration > 1 && lanes.iter().any(Progress::is_stuck) {
                let satisfied = self.is_satisfied();
                let satisfied = cell(E::select(satisfied, E::from_f64(1.0), E::from_f64(0.0)));
                for (lane, progress) in lanes.iter_mut().enumerate() {
                    if progress.is_stuck() && E::lane(&satisfied, lane) > 0.0 {
                        progress.state = State::Converged;
                    }
                }
                if lanes.iter().all(|lane| lane.state != State::Active) {
                    return self.solved(lanes, mean);
                }
                active = mask::<E>(lanes, State::Active);
            }
            iteration += 1;
            statistics.iterations += 1;
            self.place_residual();
            match (basis, self.mean.get_mut()) {
                (Some(basis), Some(factors)) if mean => factors.solve(basis, &mut self.increment),
                _ => self.linear.factors.solve(&mut self.increment),
            }
            let floor = E::from_f64(rounding / rule.tolerance);
            let (size, next) = dispatch(Update::<M, E, S> {
                x,
                y,
                increment: &mut self.increment,
                weights: &mut self.weights,
                sizes: &mut self.sizes,
                active,
                h,
                floor,
                tolerance: E::from_f64(rule.tolerance),
                full: rule.full,
                measure: iteration == 1,
            });
            let (size, next) = (cell(size), cell(next));
            let mut some = false;
            for (lane, progress) in lanes.iter_mut().enumerate() {
                if progress.state == State::Active {
                    let (size, next) = (E::lane(&size, lane), E::lane(&next, lane));
                    progress.judge(&rule, size, next, renew, iteration == 1);
                    some |= progress.state != State::Active;
                }
            }
            if some && !rule.exact && iteration > 1 {
                // Once more, with the sizes that the unknowns have now.
                let (increment, weights) = (&self.increment, &mut self.weights);
                let again = cell(dispatch(Measure::<M, E, S> { x, y, increment, weights, h, floor }));
                for (lane, progress) in lanes.iter_mut().enumerate() {
                    let again = E::lane(&again, lane);
                    if progress.state == State::Converged && again > 2.0 * progress.last {
                        (progress.state, progress.last) = (State::Active, again);
                    }
                }
            }
            if some {
                active = mask::<E>(lanes, State::Active);
            }
            let slowest = lanes.iter().filter(|lane| lane.state == State::Active);
            let slowest = slowest.fold(None, |slowest: Option<f64>, lane| {
                Some(slowest.unwrap_or(0.0).max(lane.remaining(&rule)))
            });
            let Some(remaining) = slowest else { return self.solved(lanes, mean) };
            if iteration == most {
                (self.validity.factors, self.validity.mean) = (false, false);
                return Solved { converged: mask::<E>(lanes, State::Converged), exact: false };
            }
            if iteration > 1 && renewals > FAR && lanes.iter().any(Progress::grows) {
                // The mean of the stages does not do.
                renewals = MEANS;
            }
            // Those of a solution nearby do for all iterations, unless increments hardly shrink.
            near &= !lanes.iter().any(Progress::is_stuck);
            let cheap = basis.is_some() && (simplified || renewals < MEANS);
            // New factors take two more iterations themselves.
            renew = !rule.exact
                && (rule.full || adaptive && !near && remaining > 2.0 + Self::RENEWAL[usize::from(cheap)]);
        }
    }
}

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> Work<M, E, S, F> {
    /// So many iterations, whose increments nobody asks for: on a processor without an FPU for double precision they take
    /// no operation of it.
    #[allow(clippy::too_many_arguments)]
    fn iterate(
        &mut self,
        coefficients: &Coefficients<E, S>,
        jacobian: Jacobian,
        count: usize,
        step: usize,
        x: &ArrayX<M, E>,
        y: &mut ArrayK<M, [E; S]>,
        statistics: &mut Statistics,
    ) -> Solved<E> {
        let kept = self.validity.factors
            && (M::STRUCTURE.constant_matrix
                || jacobian == Jacobian::Simplified && !M::STRUCTURE.linear_in_state);
        for iteration in 0..count {
            self.place(coefficients, step, x, y);
            if kept || iteration > 0 && jacobian == Jacobian::Frozen {
                statistics.residuals += 1;
                self.evaluate_residual();
            } else {
                statistics.jacobians += 1;
                statistics.factorizations += 1;
                self.evaluate_jacobian();
                let h = self.inputs.time.step;
                self.linear.factors.factor_by_plan(&self.linear.jacobian, &coefficients.a, h);
            }
            statistics.iterations += 1;
            self.place_residual();
            self.linear.factors.solve(&mut self.increment);
            dispatch(Subtract { y: y.as_mut(), increment: self.increment.as_ref() });
        }
        let zero = E::from_f64(0.0);
        Solved { converged: E::le(zero, zero), exact: false }
    }

    /// The residual in the slots of the equations.
    fn place_residual(&mut self) {
        dispatch(PlaceResidual::<M, E, S> { f: &self.f, increment: &mut self.increment });
    }

    /// After the last iteration: no lane is active any more.
    fn solved(&mut self, lanes: &[Progress], mean: bool) -> Solved<E> {
        // Lanes that failed have no say in what the others do next.
        let good = lanes.iter().filter(|lane| lane.state == State::Converged);
        self.validity.rate = good.clone().fold(0.0, |rate, lane| lane.rate.unwrap_or(0.0).max(rate));
        let any = good.count() > 0;
        (self.validity.factors, self.validity.mean) = (any && !mean, any && mean);
        Solved { converged: mask::<E>(lanes, State::Converged), exact: false }
    }
}

/// The lanes that are in a state.
fn mask<E: Lanes>(lanes: &[Progress], state: State) -> E::Mask {
    let mut cell: E::Cell = Zeroable::zeroed();
    for (lane, progress) in lanes.iter().enumerate() {
        E::set_lane(&mut cell, lane, f64::from(u8::from(progress.state == state)));
    }
    E::lt(E::from_f64(0.0), E::load(&cell))
}

/// A number as it lies in memory.
fn cell<E: Lanes>(value: E) -> E::Cell {
    let mut cell: E::Cell = Zeroable::zeroed();
    value.store(&mut cell);
    cell
}
