//! How far a step goes.

use super::Sqp;
use super::acceptance::Line;
use super::options::Globalisation;
use super::scaled::Way;
use super::state::{State, Taken};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::Curvature;
use crate::ocp::nlp::filter::Measure;
use crate::ocp::nlp::watch::Watch;
use crate::ocp::solution::log::Iteration;
use crate::qp::{QpSolver, QpStart, Solution, StageDims};
use crate::scalar::Real;

/// Weights are at least this part of the largest multiplier: constraints without a force, as at
/// states that cost nothing, would be left far behind otherwise.
const MIN_WEIGHT: f64 = 1e-2;
/// `ρ`: the merit function shrinks by this part of the weighted violations at least, to first
/// order, where the Hessian curves downwards along the step, too (J. Nocedal, S. J. Wright,
/// "Numerical Optimization", equation (18.36)).
const RHO: f64 = 0.1;
/// A step of Gauss and Newton that is no longer is refused where gaps and violations count more
/// than the objective, if damping can be larger: a shorter step shrinks all linear gaps by the same
/// part, a damped one goes less far in what would have to go farthest.
const SHORTEST_UNDAMPED_STEP: f64 = 0.25;

impl<S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Sqp<S, C, T, D, M> {
    /// A line search from the iterate towards the solution of its QP. Nothing, if no step is short
    /// enough.
    ///
    /// # Errors
    /// [`OcpError`] of the linearisation at the iterate, if that has to be repeated.
    pub(super) fn search<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        row: &mut Iteration,
    ) -> Result<Option<Taken>, OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        let by = state.globalisation(&self.options);
        let weighted = by == Globalisation::Merit;
        let line = self.merit_model(ocp, state);
        let mut written = true;
        if state.search.full {
            if self.try_linearised(ocp, state, &line) {
                return Ok(Some(Taken { length: 1.0, corrected: false }));
            }
            written = false;
        }
        state.search.full = false;
        let passing = state.may_reject_short_steps && weighted && line.here.violation > line.slope.abs();
        let shortest = if passing { 2.0 * SHORTEST_UNDAMPED_STEP } else { self.options.shortest_step };
        let mut length = 1.0;
        while length >= shortest {
            // A point without a value is one that is not good enough.
            let there = self.measure_at(ocp, state, length);
            if let Some(there) = there
                && state.search.accepts(by, length, &line, &there)
            {
                let length = self.backtrack_to_minimiser(ocp, state, &line, length, there);
                return Ok(Some(Taken { length, corrected: false }));
            }
            if length == 1.0 && there.is_some_and(|there| there.is_finite()) {
                if !written {
                    ocp.linearise(self.curvature)?;
                    self.scale(ocp, state, Way::Into);
                    ocp.regularise(T::from_f64(row.regularisation));
                    self.scale(ocp, state, Way::Back);
                }
                if self.corrected(ocp, state, &line, row) {
                    return Ok(Some(Taken { length, corrected: true }));
                }
            }
            length *= 0.5;
        }
        Ok(None)
    }

    /// Weights of violations before the first line search: those of a filter are the inverses of
    /// units and stay.
    pub(super) fn forget_weights<P: Program<T>>(&mut self, ocp: &Ocp<P, T, D, M>, state: &State<'_, T>) {
        let weighted = state.globalisation(&self.options) == Globalisation::Merit;
        self.weights.multipliers_mut().fill(if weighted { T::ZERO } else { T::ONE });
        if !weighted {
            // The solution is written before it is read.
            self.scale_weights(ocp, state, Way::Back);
        }
    }

    /// What there is at a part of the step, if it has a value.
    fn measure_at<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &State<'_, T>,
        length: f64,
    ) -> Option<Measure> {
        let Self { solution, trial, work, weights, .. } = self;
        let ends = work.as_mut().get_mut(..ocp.ends()).unwrap_or_default();
        between(&ocp.iterate, solution, length, trial);
        ocp.measure(trial, weights, ends).ok().map(|there| there.over(state.force()))
    }

    /// Whether a step that is good enough may be better where it is shorter.
    fn shortens(&self, state: &State<'_, T>, line: &Line, length: f64, there: &Measure) -> bool {
        let weighted = state.globalisation(&self.options) == Globalisation::Merit;
        weighted && line.overshoots(length, there)
    }

    /// Takes a step that is good enough, or half of it, a quarter and so on, as long as the merit
    /// function says that its least is before, and shrinks. The length.
    fn backtrack_to_minimiser<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        line: &Line,
        mut length: f64,
        mut there: Measure,
    ) -> f64
    where
        C: Curvature<P::Dynamics, T>,
    {
        while self.shortens(state, line, length, &there) && 0.5 * length >= self.options.shortest_step {
            let half = self.measure_at(ocp, state, 0.5 * length);
            let Some(half) = half.filter(|half| half.is_finite() && half.merit() < there.merit()) else {
                between(&ocp.iterate, &self.solution, length, &mut self.trial);
                break;
            };
            (length, there) = (0.5 * length, half);
        }
        core::mem::swap(&mut ocp.iterate, &mut self.trial);
        state.search.full = length == 1.0;
        length
    }

    /// The line from the iterate to the solution of the QP, with new weights of violations.
    fn merit_model<P: Program<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>, state: &State<'_, T>) -> Line {
        let (here, slope) = self.update_weights(ocp, state);
        Line { here: here.over(state.force()), slope: slope / state.force() }
    }

    /// Objective and weighted violations at the iterate, with new weights, and the slope of the
    /// objective.
    fn update_weights<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &State<'_, T>,
    ) -> (Measure, f64) {
        if state.globalisation(&self.options) != Globalisation::Merit {
            let here = ocp.measure_here(&self.weights);
            let slope = ocp.slope(&self.solution, here.objective - ocp.objective.to_f64());
            return (here, slope);
        }
        self.scale_weights(ocp, state, Way::Into);
        let multipliers = self.solution.multipliers_mut();
        let largest = multipliers.iter().fold(T::ZERO, |largest, m| m.abs().max(largest));
        let (half, least) = (T::from_f64(0.5), T::from_f64(MIN_WEIGHT) * largest);
        // Those of this step count at least.
        self.weights.update_multipliers(&self.solution, |w, multiplier| {
            let size = multiplier.abs();
            size.max(half * (w + size)).max(least)
        });
        self.scale_weights(ocp, state, Way::Back);
        let here = ocp.measure_here(&self.weights);
        let slope = ocp.slope(&self.solution, here.objective - ocp.objective.to_f64());
        let factor = slope / ((1.0 - RHO) * here.violation);
        if !(factor > 1.0 && factor.is_finite()) {
            return (here, slope);
        }
        let factor = T::from_f64(factor);
        self.weights.multipliers_mut().iter_mut().for_each(|w| *w = factor * *w);
        (ocp.measure_here(&self.weights), slope)
    }

    /// The full step, tried by linearising there.
    fn try_linearised<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        line: &Line,
    ) -> bool
    where
        C: Curvature<P::Dynamics, T>,
    {
        let mut watch = Watch::start();
        let by = state.globalisation(&self.options);
        core::mem::swap(&mut ocp.iterate, &mut self.solution);
        let there = ocp.linearise(self.curvature);
        let there = there.map(|()| ocp.measure_here(&self.weights).over(state.force()));
        let seconds = watch.lap();
        let is_good = there.is_ok_and(|there| {
            !self.shortens(state, line, 1.0, &there) && state.search.accepts(by, 1.0, line, &there)
        });
        if is_good {
            state.search.linearised = Some(seconds);
            return true;
        }
        core::mem::swap(&mut ocp.iterate, &mut self.solution);
        false
    }

    /// The full step, with constraints corrected by their values at its end: they bend away.
    fn corrected<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        line: &Line,
        row: &mut Iteration,
    ) -> bool {
        let left = self.options.max_qp_iterations.saturating_sub(row.qp_iterations);
        if left == 0 {
            return false;
        }
        let ends = self.work.as_mut().get_mut(..ocp.ends()).unwrap_or_default();
        ocp.correct(&self.trial, ends);
        self.trial.copy_from(&self.solution);
        // It is the trial that is solved for, and scaled back.
        core::mem::swap(&mut self.solution, &mut self.trial);
        self.scale(ocp, state, Way::Into);
        self.qp_solver.limit(Some(left));
        let solved =
            self.qp_solver
                .solve_until(ocp.qp(), QpStart::Warm, self.solution.view_mut(), &mut || state.is_over());
        self.scale(ocp, state, Way::Back);
        core::mem::swap(&mut self.solution, &mut self.trial);
        self.qp_solver.limit(None);
        let Ok(statistics) = solved else { return false };
        let by = state.globalisation(&self.options);
        row.qp_iterations += statistics.iterations;
        let ends = self.work.as_mut().get_mut(..ocp.ends()).unwrap_or_default();
        let there = ocp.measure(&self.trial, &self.weights, ends).ok().map(|there| there.over(state.force()));
        let is_good = there.is_some_and(|there| state.search.accepts(by, 1.0, line, &there));
        if is_good {
            core::mem::swap(&mut ocp.iterate, &mut self.trial);
        }
        is_good
    }
}

/// `a + length (b − a)` of everything.
fn between<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    a: &Solution<T, D, M>,
    b: &Solution<T, D, M>,
    length: f64,
    target: &mut Solution<T, D, M>,
) {
    let length = T::from_f64(length);
    target.combine(a, b, |a, b| if length == T::ONE { b } else { a + length * (b - a) });
}
