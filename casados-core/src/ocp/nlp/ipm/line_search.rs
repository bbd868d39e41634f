//! How far a step goes: the filter line search with second-order corrections.

use super::kkt::lengths::Lengths;
use super::kkt::measure;
use super::kkt::newton::{evaluate_values, kkt_view, kkt_view_of_new_qp, refine};
use super::kkt::work::Work;
use super::state::State;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::nlp::filter::{
    ETA_PHI, Filter, GAMMA_PHI, GAMMA_THETA, Measure, S_PHI, S_THETA, objective_decides,
};
use crate::qp::interior::Iterate;
use crate::qp::{Places, Solution, StageDims, Store, copy_common, part, part_mut};
use crate::scalar::{Real, Scalar};

/// `γ_α`
const ALPHA_MIN_FRAC: f64 = 0.05;
/// Corrections of one step.
const MAX_SOC: usize = 4;
/// `κ_soc`: a correction that leaves more of the violation is the last one.
const KAPPA_SOC: f64 = 0.99;

/// What is known before a line search.
#[derive(Clone, Copy, Debug)]
pub(super) struct FilterModel {
    pub here: Measure,
    /// `∇φᵀ d`, in units of forces.
    pub slope: f64,
    /// What rounding leaves of a difference of barrier functions.
    pub noise: f64,
    /// `θ_min`: below this violation the barrier function may decide.
    pub small_violation: f64,
    /// No step leaves more violation.
    pub most: f64,
    pub mu: f64,
    /// `δ_w`
    pub delta: f64,
    /// Violations up to this one are rounding errors.
    pub rounding: f64,
}

impl FilterModel {
    /// Whether the barrier function decides after a step of this length.
    fn decides(&self, alpha: f64) -> bool {
        self.here.violation <= self.small_violation
            && objective_decides(alpha, self.slope, self.here.violation)
    }

    /// The shortest step that can be accepted (equation (23)).
    fn shortest(&self) -> f64 {
        let Measure { violation, .. } = self.here;
        let mut least: f64 = GAMMA_THETA;
        if self.slope < 0.0 {
            least = least.min(GAMMA_PHI * violation / -self.slope);
            if violation <= self.small_violation {
                let powers = (Scalar::powf(violation, S_THETA), Scalar::powf(-self.slope, S_PHI));
                least = least.min(powers.0 / powers.1);
            }
        }
        (ALPHA_MIN_FRAC * least).max(1e-14)
    }

    /// Whether neither the violation nor the barrier function changes by more than rounding errors:
    /// the step changes multipliers.
    fn is_rounding(&self, there: &Measure) -> bool {
        self.here.violation <= self.rounding
            && there.violation <= self.rounding
            && (there.objective - self.here.objective).abs() <= self.noise
    }

    /// Whether a point after a step of this length is good enough; the filter grows where the
    /// barrier function does not decide.
    pub fn accepts(&self, filter: &mut Filter, alpha: f64, there: &Measure) -> bool {
        let noise = self.noise;
        if self.is_rounding(there) {
            return true;
        }
        if !there.is_finite() || there.violation > self.most || !filter.admits(there, noise) {
            return false;
        }
        if self.decides(alpha) {
            return there.objective <= self.here.objective + ETA_PHI * alpha * self.slope + noise;
        }
        filter.improves(there, &self.here, noise)
    }
}

/// A step that was accepted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Accepted {
    pub alpha: f64,
    pub corrected: bool,
}

/// What a line search finds.
#[derive(Clone, Copy, Debug)]
pub(super) enum SearchOutcome {
    /// A step.
    Step(Accepted),
    /// No step is short enough.
    Nothing,
    /// The time was over before.
    OutOfTime,
}

/// The memory that a line search works on.
pub(super) struct LineSearch<'r, 'w, T, D, M, N, I> {
    pub lengths: &'r Lengths,
    pub numbers: &'r mut N,
    pub indices: &'r mut I,
    pub trial: &'r mut Solution<T, D, M>,
    pub work: &'r mut Work<'w, T>,
}

impl<T, D, M, N, I> LineSearch<'_, '_, T, D, M, N, I>
where
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
    N: Store<T>,
    I: Store<u32>,
{
    /// Whether the filter accepts a step of this length; a point without a value is not accepted.
    pub fn accepts<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        filter: &mut Filter,
        expected: &FilterModel,
        alpha: f64,
    ) -> bool {
        self.measure(ocp, expected.mu, alpha).is_some_and(|there| expected.accepts(filter, alpha, &there))
    }

    /// Halves the step until the filter accepts it.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]; points without a value are not good enough.
    pub fn search<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_>,
        expected: &FilterModel,
        longest: f64,
        tau: f64,
    ) -> Result<SearchOutcome, OcpError> {
        let State { filter, over, .. } = state;
        let mut alpha = longest;
        let shortest = expected.shortest();
        while alpha >= shortest {
            let there = self.measure(ocp, expected.mu, alpha);
            if there.is_some_and(|there| expected.accepts(filter, alpha, &there)) {
                return Ok(SearchOutcome::Step(Accepted { alpha, corrected: false }));
            }
            // Corrections know nothing of stages.
            let bends = !P::LIFTED && there.is_some_and(|there| there.violation >= expected.here.violation);
            if alpha == longest
                && bends
                && let Some(alpha) = self.correct(ocp, filter, expected, tau)?
            {
                return Ok(SearchOutcome::Step(Accepted { alpha, corrected: true }));
            }
            if over() {
                return Ok(SearchOutcome::OutOfTime);
            }
            alpha *= 0.5;
        }
        Ok(SearchOutcome::Nothing)
    }

    /// Barrier function and violation after a part of the step; nothing where a function has no
    /// value.
    pub fn measure<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        mu: f64,
        alpha: f64,
    ) -> Option<Measure> {
        self.place_trial(ocp, T::from_f64(alpha))?;
        let objective = ocp.rows_at(self.trial, self.work.ends, self.work.rows).ok()?;
        let objective = if self.lengths.alone { 0.0 } else { objective };
        ocp.step_length = Some(T::ZERO);
        let mut gaps = ocp.gaps_at(self.trial, self.work.ends, self.work.units);
        if P::LIFTED {
            gaps += ocp.stages[0].to_f64();
        }
        let mut iterate = kkt_view(ocp.qp.view(), self.lengths, self.numbers, self.indices).ok()?;
        let slacks = part(self.work.slacks, 0, self.lengths.counts.pair_count());
        let mut violation =
            gaps + measure::violations(&mut iterate.sides, self.work.rows, slacks, self.work.units);
        if let Some(coupling) = &mut iterate.coupling {
            coupling.evaluate(iterate.qp, self.work.rows);
            violation += coupling.residual_sum();
        }
        let (penalties, barrier) = measure::penalties_and_barrier(&iterate.sides, slacks);
        Some(Measure {
            objective: (objective + penalties + mu * barrier) / self.lengths.sizes.force,
            violation,
        })
    }

    /// The point and the slacks after a part of the step.
    pub fn place_trial<P: Program<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>, part_of_step: T) -> Option<()> {
        ocp.step_length = Some(part_of_step);
        let iterate = kkt_view(ocp.qp.view(), self.lengths, self.numbers, self.indices).ok()?;
        self.trial.copy_from(&ocp.iterate);
        let to = self.trial.view_mut();
        for place in Places::<T>::new(iterate.qp.dims) {
            let v = part_mut(to.v, place.v, place.n);
            let from = part(iterate.v, place.row, place.n).iter().zip(part(iterate.step, place.row, place.n));
            for (v, (&from, &step)) in v.iter_mut().zip(from) {
                *v = from + part_of_step * step;
            }
        }
        let steps = iterate.sides.slack.iter().zip(&mut *iterate.sides.slack_step);
        for (slack, (&from, &mut step)) in self.work.slacks.iter_mut().zip(steps) {
            *slack = from + part_of_step * step;
        }
        Some(())
    }

    /// Second-order corrections: constraints take their values at the point that was tried.
    /// Afterwards the step is what was accepted, or what it was before.
    fn correct<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        filter: &mut Filter,
        expected: &FilterModel,
        tau: f64,
    ) -> Result<Option<f64>, OcpError> {
        {
            let iterate = kkt_view(ocp.qp.view(), self.lengths, self.numbers, self.indices)?;
            copy_common(self.work.step, iterate.step);
            copy_common(self.work.slack_step, iterate.sides.slack_step);
            copy_common(self.work.multiplier_step, iterate.sides.multiplier_step);
            copy_common(self.work.free_step, iterate.sides.free_step);
        }
        let mut violation = expected.here.violation;
        let mut accepted = None;
        for _ in 0..MAX_SOC {
            ocp.correct(self.trial, self.work.ends);
            let (solved, alpha) = {
                let qp = ocp.qp.view();
                let mut iterate =
                    kkt_view_of_new_qp(qp, self.lengths, self.numbers, self.indices, self.work.units)?;
                iterate.units = self.work.units;
                // Sides keep their slacks; the gradient stays what it was.
                evaluate_values(&mut iterate);
                let (mu, delta) = (T::from_f64(expected.mu), T::from_f64(expected.delta));
                let solved = super::kkt::newton::step(&mut iterate, mu, delta)
                    .and_then(|()| refine(&mut iterate, self.work.units));
                (solved, longest(iterate.sides.slack, iterate.sides.slack_step, tau))
            };
            if solved.is_err() {
                break;
            }
            let Some(there) = self.measure(ocp, expected.mu, alpha) else { break };
            if expected.accepts(filter, alpha, &there) {
                accepted = Some(alpha);
                break;
            }
            if there.violation > KAPPA_SOC * violation {
                break;
            }
            violation = there.violation;
        }
        if accepted.is_none() {
            let iterate: Iterate<'_, T> = kkt_view(ocp.qp.view(), self.lengths, self.numbers, self.indices)?;
            copy_common(iterate.step, self.work.step);
            copy_common(iterate.sides.slack_step, self.work.slack_step);
            copy_common(iterate.sides.multiplier_step, self.work.multiplier_step);
            copy_common(iterate.sides.free_step, self.work.free_step);
        }
        Ok(accepted)
    }
}

/// The longest step after which `1 − τ` of every number is left, at most 1.
pub(super) fn longest<T: Real>(values: &[T], steps: &[T], tau: f64) -> f64 {
    let mut ratio = 1.0f64;
    for (&value, &step) in values.iter().zip(steps) {
        let (value, step) = (value.to_f64(), step.to_f64());
        if step < 0.0 && -step * ratio > tau * value {
            ratio = tau * value / -step;
        }
    }
    ratio
}
