//! How far a step goes: the filter line search with second-order corrections.

use super::filter::{Filter, Pair, is_better, noise};
use super::measure;
use super::newton::{Lengths, attach, evaluate_values};
use super::work::Work;
use crate::ocp::error::OcpError;
use crate::ocp::instance::Ocp;
use crate::ocp::problem::Formulation;
use crate::qp::interior::Iterate;
use crate::qp::{Places, Solution, StageDims, Store, assign, part, part_mut};
use crate::scalar::{Real, Scalar};

/// `η_φ`
const ARMIJO: f64 = 1e-8;
/// `s_φ`
const POWER_PHI: f64 = 2.3;
/// `s_θ`
const POWER_THETA: f64 = 1.1;
/// `γ_α`
const SAFETY: f64 = 0.05;
/// Corrections of one step.
const CORRECTIONS: usize = 4;
/// `κ_soc`: a correction that leaves more of the violation is the last one.
const CORRECTED: f64 = 0.99;

/// What is known before a line search.
#[derive(Clone, Copy, Debug)]
pub(super) struct Expected {
    pub here: Pair,
    /// `∇φᵀ d`
    pub slope: f64,
    /// Below this violation the barrier function may decide.
    pub theta_min: f64,
    pub mu: f64,
    /// `δ_w`
    pub delta: f64,
}

impl Expected {
    /// Whether the barrier function is expected to shrink far more than there is violation.
    fn decides(&self, alpha: f64) -> bool {
        self.slope < 0.0
            && self.here.theta <= self.theta_min
            && alpha * Scalar::powf(-self.slope, POWER_PHI) > Scalar::powf(self.here.theta, POWER_THETA)
    }

    /// The shortest step that can be accepted.
    fn shortest(&self) -> f64 {
        let Pair { theta, .. } = self.here;
        let mut least: f64 = 1e-5;
        if self.slope < 0.0 {
            least = least.min(1e-8 * theta / -self.slope);
            if theta <= self.theta_min {
                least = least.min(Scalar::powf(theta, POWER_THETA) / Scalar::powf(-self.slope, POWER_PHI));
            }
        }
        (SAFETY * least).max(1e-14)
    }

    /// Whether a point after a step of this length is good enough; entries of the filter grow.
    pub fn accepts(&self, filter: &mut Filter, alpha: f64, there: &Pair) -> bool {
        if !there.is_finite() || !filter.admits(there) {
            return false;
        }
        let shrinks = there.phi <= self.here.phi + ARMIJO * alpha * self.slope + noise(&self.here);
        if self.decides(alpha) {
            return shrinks;
        }
        if !is_better(there, &self.here) {
            return false;
        }
        if !shrinks || !self.decides(alpha) {
            let Pair { theta, phi } = self.here;
            filter.add(Pair { theta: (1.0 - 1e-5) * theta, phi: phi - 1e-8 * theta });
        }
        true
    }
}

/// A step that was accepted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Accepted {
    pub alpha: f64,
    pub corrected: bool,
}

/// The memory that a line search works on.
pub(super) struct Room<'r, 'w, T, D, M, N, I> {
    pub lengths: &'r Lengths,
    pub numbers: &'r mut N,
    pub indices: &'r mut I,
    pub trial: &'r mut Solution<T, D, M>,
    pub work: &'r mut Work<'w, T>,
}

impl<T, D, M, N, I> Room<'_, '_, T, D, M, N, I>
where
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
    N: Store<T>,
    I: Store<u32>,
{
    /// Halves the step until the filter accepts it.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]; points without a value are not good enough.
    pub fn search<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        filter: &mut Filter,
        expected: &Expected,
        longest: f64,
        tau: f64,
    ) -> Result<Option<Accepted>, OcpError> {
        let mut alpha = longest;
        let shortest = expected.shortest();
        while alpha >= shortest {
            let there = self.pair(ocp, expected.mu, alpha);
            if there.is_some_and(|there| expected.accepts(filter, alpha, &there)) {
                return Ok(Some(Accepted { alpha, corrected: false }));
            }
            let bends = there.is_some_and(|there| there.theta >= expected.here.theta);
            if alpha == longest
                && bends
                && let Some(alpha) = self.correct(ocp, filter, expected, tau)?
            {
                return Ok(Some(Accepted { alpha, corrected: true }));
            }
            alpha *= 0.5;
        }
        Ok(None)
    }

    /// The pair after a part of the step; nothing where a function has no value.
    fn pair<P: Formulation<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>, mu: f64, alpha: f64) -> Option<Pair> {
        let part_of_step = T::from_f64(alpha);
        {
            let iterate = attach(ocp.qp.view(), self.lengths, self.numbers, self.indices).ok()?;
            self.trial.copy_from(&ocp.iterate);
            let to = self.trial.view_mut();
            for place in Places::<T>::new(iterate.qp.dims) {
                let v = part_mut(to.v, place.v, place.n);
                let from =
                    part(iterate.v, place.row, place.n).iter().zip(part(iterate.step, place.row, place.n));
                for (v, (&from, &step)) in v.iter_mut().zip(from) {
                    *v = from + part_of_step * step;
                }
            }
            let steps = iterate.sides.slack.iter().zip(&mut *iterate.sides.slack_step);
            for (slack, (&from, &mut step)) in self.work.slacks.iter_mut().zip(steps) {
                *slack = from + part_of_step * step;
            }
        }
        let objective = ocp.rows_at(self.trial, self.work.ends, self.work.rows).ok()?;
        let gaps = ocp.gaps_at(self.trial, self.work.ends);
        let mut iterate = attach(ocp.qp.view(), self.lengths, self.numbers, self.indices).ok()?;
        let slacks = part(self.work.slacks, 0, self.lengths.counts.pairs());
        let mut theta = gaps + measure::violations(&mut iterate.sides, self.work.rows, slacks);
        if let Some(coupling) = &mut self.work.coupling {
            coupling.evaluate(iterate.qp, self.work.rows);
            theta += coupling.violation();
        }
        let (penalties, barrier) = measure::penalties_and_barrier(&iterate.sides, slacks);
        Some(Pair { theta, phi: objective + penalties + mu * barrier })
    }

    /// Second-order corrections: constraints take their values at the point that was tried.
    /// Afterwards the step is what was accepted, or what it was before.
    fn correct<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        filter: &mut Filter,
        expected: &Expected,
        tau: f64,
    ) -> Result<Option<f64>, OcpError> {
        {
            let iterate = attach(ocp.qp.view(), self.lengths, self.numbers, self.indices)?;
            assign(self.work.step, iterate.step);
            assign(self.work.slack_step, iterate.sides.slack_step);
            assign(self.work.multiplier_step, iterate.sides.multiplier_step);
        }
        let mut violation = expected.here.theta;
        let mut accepted = None;
        for _ in 0..CORRECTIONS {
            ocp.correct(self.trial, self.work.ends);
            let (solved, alpha) = {
                let mut iterate = attach(ocp.qp.view(), self.lengths, self.numbers, self.indices)?;
                // Sides keep their slacks; the gradient stays what it was.
                evaluate_values(&mut iterate);
                let (mu, delta) = (T::from_f64(expected.mu), T::from_f64(expected.delta));
                if let Some(coupling) = &mut self.work.coupling {
                    // The conditions are linear: no correction of theirs.
                    coupling.evaluate(iterate.qp, iterate.v);
                }
                let solved = super::newton::step(&mut iterate, self.work.coupling.as_mut(), mu, delta);
                (solved, longest(iterate.sides.slack, iterate.sides.slack_step, tau))
            };
            if solved.is_err() {
                break;
            }
            let Some(there) = self.pair(ocp, expected.mu, alpha) else { break };
            if expected.accepts(filter, alpha, &there) {
                accepted = Some(alpha);
                break;
            }
            if there.theta > CORRECTED * violation {
                break;
            }
            violation = there.theta;
        }
        if accepted.is_none() {
            let iterate: Iterate<'_, T> = attach(ocp.qp.view(), self.lengths, self.numbers, self.indices)?;
            assign(iterate.step, self.work.step);
            assign(iterate.sides.slack_step, self.work.slack_step);
            assign(iterate.sides.multiplier_step, self.work.multiplier_step);
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
