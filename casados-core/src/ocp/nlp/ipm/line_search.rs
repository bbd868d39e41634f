//! Filter line search with second-order corrections.

use super::kkt::barrier_function;
use super::kkt::dimensions::KktDimensions;
use super::kkt::newton::{evaluate_linear_residuals, kkt_view, kkt_view_of_new_qp, refine_step};
use super::kkt::workspace::Workspace;
use super::run_state::RunState;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::nlp::advanced::{AdvancedIpmOptions, FilterOptions};
use crate::ocp::nlp::filter::{Filter, FilterPair};
use crate::qp::interior::Iterate;
use crate::qp::{Solution, StageDims, StageOffsetsIter, Store, copy_common, part, part_mut};
use crate::scalar::{Real, Scalar};

/// The filter's model of the barrier function along the search direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct FilterModel {
    pub current: FilterPair,
    /// The slope `∇φᵀ d`, in units of the objective.
    pub slope: f64,
    /// The rounding error of a difference of barrier functions.
    pub noise: f64,
    /// `θ_min`: the switching condition requires a violation of at most this.
    pub theta_min: f64,
    /// The largest acceptable violation of a step.
    pub max_violation: f64,
    pub mu: f64,
    /// `δ_w`
    pub delta_w: f64,
    /// Violations up to this one are rounding errors.
    pub rounding_violation: f64,
    /// The residual that refinement leaves in equations, as a fraction of their values; zero
    /// without equations.
    pub equation_residual: f64,
}

impl FilterModel {
    /// Whether the barrier function must decrease sufficiently for a step of this length.
    fn switching_condition_holds(&self, options: &FilterOptions, alpha: f64) -> bool {
        self.current.violation <= self.theta_min
            && options.switching_condition_holds(alpha, self.slope, self.current.violation)
    }

    /// The shortest acceptable step (equation (23)).
    fn min_alpha(&self, options: &AdvancedIpmOptions) -> f64 {
        let (FilterPair { violation, .. }, filter) = (self.current, &options.filter);
        let mut smallest_ratio = filter.gamma_theta;
        if self.slope < 0.0 {
            smallest_ratio = smallest_ratio.min(filter.gamma_phi * violation / -self.slope);
            if violation <= self.theta_min {
                let powers =
                    (Scalar::powf(violation, filter.s_theta), Scalar::powf(-self.slope, filter.s_phi));
                smallest_ratio = smallest_ratio.min(powers.0 / powers.1);
            }
        }
        (options.line_search.alpha_min_frac * smallest_ratio).max(options.line_search.min_alpha)
    }

    /// Whether violation and barrier function change by rounding errors and by the residuals that
    /// refinement leaves in equations only: the step changes multipliers.
    fn changes_only_rounding(&self, trial_pair: &FilterPair) -> bool {
        let noise = self.noise + self.equation_residual * self.current.objective.abs();
        self.current.violation <= self.rounding_violation
            && trial_pair.violation <= self.rounding_violation
            && (trial_pair.objective - self.current.objective).abs() <= noise
    }

    /// Whether the point at this step length is acceptable. Adds the iterate to the filter if the
    /// switching condition does not hold.
    pub fn accepts(&self, filter: &mut Filter, alpha: f64, trial_pair: &FilterPair) -> bool {
        let noise = self.noise;
        if self.changes_only_rounding(trial_pair) {
            return true;
        }
        if !trial_pair.is_finite()
            || trial_pair.violation > self.max_violation
            || !filter.is_acceptable(trial_pair, noise)
        {
            return false;
        }
        let options = &filter.options;
        if self.switching_condition_holds(options, alpha) {
            let decrease = options.eta_phi * alpha * self.slope;
            return trial_pair.objective <= self.current.objective + decrease + noise;
        }
        filter.augment_if_improved(trial_pair, &self.current, noise)
    }
}

/// An accepted step.
#[derive(Clone, Copy, Debug)]
pub(super) struct AcceptedStep {
    pub alpha: f64,
    pub corrected: bool,
}

/// The result of a line search.
#[derive(Clone, Copy, Debug)]
pub(super) enum LineSearchOutcome {
    /// An accepted step.
    Step(AcceptedStep),
    /// No step above the shortest one is acceptable.
    NoStep,
    /// The deadline has passed.
    OutOfTime,
}

/// The memory of a line search.
pub(super) struct LineSearch<'r, 'w, T, D, M, N, I> {
    pub dimensions: &'r KktDimensions,
    pub kkt_numbers: &'r mut N,
    pub kkt_indices: &'r mut I,
    pub trial_point: &'r mut Solution<T, D, M>,
    pub workspace: &'r mut Workspace<'w, T>,
    pub options: &'r AdvancedIpmOptions,
}

impl<T, D, M, N, I> LineSearch<'_, '_, T, D, M, N, I>
where
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
    N: Store<T>,
    I: Store<u32>,
{
    /// Whether the filter accepts a step of this length. A point with a non-finite function is not
    /// accepted.
    pub fn accepts<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        filter: &mut Filter,
        model: &FilterModel,
        alpha: f64,
    ) -> bool {
        self.evaluate_trial(ocp, model.mu, alpha).is_some_and(|there| model.accepts(filter, alpha, &there))
    }

    /// Halves the step until the filter accepts it.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]; a point with a non-finite function is rejected.
    pub fn search<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_>,
        model: &FilterModel,
        max_alpha: f64,
        tau: f64,
    ) -> Result<LineSearchOutcome, OcpError> {
        let RunState { filter, deadline_passed: over, .. } = state;
        let mut alpha = max_alpha;
        let min_alpha = model.min_alpha(self.options);
        while alpha >= min_alpha {
            let trial_pair = self.evaluate_trial(ocp, model.mu, alpha);
            if trial_pair.is_some_and(|there| model.accepts(filter, alpha, &there)) {
                return Ok(LineSearchOutcome::Step(AcceptedStep { alpha, corrected: false }));
            }
            // Second-order corrections ignore lifted stages.
            let violation_grows = !ocp.problem.is_lifted()
                && trial_pair.is_some_and(|there| there.violation >= model.current.violation);
            if alpha == max_alpha
                && violation_grows
                && let Some(alpha) = self.second_order_correction(ocp, filter, model, tau)?
            {
                return Ok(LineSearchOutcome::Step(AcceptedStep { alpha, corrected: true }));
            }
            if over() {
                return Ok(LineSearchOutcome::OutOfTime);
            }
            alpha *= self.options.line_search.alpha_red_factor;
        }
        Ok(LineSearchOutcome::NoStep)
    }

    /// Returns barrier function and violation at a step length; `None` if a function is not finite.
    pub fn evaluate_trial<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        mu: f64,
        alpha: f64,
    ) -> Option<FilterPair> {
        self.write_trial_point(ocp, T::from_f64(alpha))?;
        let objective = ocp
            .row_values_at(self.trial_point, self.workspace.interval_ends, self.workspace.row_values)
            .ok()?;
        let objective = if self.dimensions.in_restoration { 0.0 } else { objective };
        ocp.step_length = Some(T::ZERO);
        let mut gaps = ocp.gap_sum_at(self.trial_point, self.workspace.interval_ends, self.workspace.units);
        if ocp.problem.is_lifted() {
            gaps += ocp.stage_residuals[0].to_f64();
        }
        let mut iterate =
            kkt_view(ocp.qp.view(), self.dimensions, self.kkt_numbers, self.kkt_indices).ok()?;
        let slacks = part(self.workspace.trial_slacks, 0, self.dimensions.counts.pair_count());
        let mut violation = gaps
            + barrier_function::violation_sum(
                &mut iterate.inequalities,
                self.workspace.row_values,
                slacks,
                self.workspace.units,
            );
        if let Some(coupling) = &mut iterate.coupling {
            coupling.evaluate(iterate.qp, self.workspace.row_values);
            violation += coupling.residual_sum();
        }
        let (penalties, barrier) = barrier_function::penalties_and_barrier(&iterate.inequalities, slacks);
        Some(FilterPair {
            objective: (objective + penalties + mu * barrier) / self.dimensions.scaling.objective_unit,
            violation,
        })
    }

    /// Writes the trial point and its slacks.
    pub fn write_trial_point<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        part_of_step: T,
    ) -> Option<()> {
        ocp.step_length = Some(part_of_step);
        let iterate = kkt_view(ocp.qp.view(), self.dimensions, self.kkt_numbers, self.kkt_indices).ok()?;
        self.trial_point.copy_from(&ocp.iterate);
        let to = self.trial_point.view_mut();
        for place in StageOffsetsIter::<T>::new(iterate.qp.dims) {
            let v = part_mut(to.v, place.v, place.n);
            let from = part(iterate.v, place.row, place.n).iter().zip(part(iterate.step, place.row, place.n));
            for (v, (&from, &step)) in v.iter_mut().zip(from) {
                *v = from + part_of_step * step;
            }
        }
        let steps = iterate.inequalities.slack.iter().zip(&mut *iterate.inequalities.slack_step);
        for (slack, (&from, &mut step)) in self.workspace.trial_slacks.iter_mut().zip(steps) {
            *slack = from + part_of_step * step;
        }
        Some(())
    }

    /// Computes second-order corrections, with the constraint values of the trial point. Restores
    /// the step if no correction is accepted.
    fn second_order_correction<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        filter: &mut Filter,
        model: &FilterModel,
        tau: f64,
    ) -> Result<Option<f64>, OcpError> {
        {
            let iterate = kkt_view(ocp.qp.view(), self.dimensions, self.kkt_numbers, self.kkt_indices)?;
            copy_common(self.workspace.saved_step, iterate.step);
            copy_common(self.workspace.saved_slack_step, iterate.inequalities.slack_step);
            copy_common(self.workspace.saved_multiplier_step, iterate.inequalities.multiplier_step);
            copy_common(
                self.workspace.saved_equation_multipliers,
                iterate.inequalities.equation_multiplier_steps,
            );
        }
        let mut violation = model.current.violation;
        let mut accepted = None;
        for _ in 0..self.options.line_search.max_soc {
            ocp.set_second_order_correction(self.trial_point, self.workspace.interval_ends);
            let (solved, alpha) = {
                let qp = ocp.qp.view();
                let mut iterate = kkt_view_of_new_qp(
                    qp,
                    self.dimensions,
                    self.kkt_numbers,
                    self.kkt_indices,
                    self.workspace.units,
                )?;
                iterate.units = self.workspace.units;
                // Slacks and gradient are unchanged.
                evaluate_linear_residuals(&mut iterate);
                let (mu, delta) = (T::from_f64(model.mu), T::from_f64(model.delta_w));
                let solved = super::kkt::newton::newton_step(&mut iterate, mu, delta)
                    .and_then(|()| refine_step(&mut iterate, self.workspace.units, &self.options.newton));
                (
                    solved,
                    max_step_to_boundary(iterate.inequalities.slack, iterate.inequalities.slack_step, tau),
                )
            };
            if solved.is_err() {
                break;
            }
            let Some(trial_pair) = self.evaluate_trial(ocp, model.mu, alpha) else { break };
            if model.accepts(filter, alpha, &trial_pair) {
                accepted = Some(alpha);
                break;
            }
            if trial_pair.violation > self.options.line_search.kappa_soc * violation {
                break;
            }
            violation = trial_pair.violation;
        }
        if accepted.is_none() {
            let iterate: Iterate<'_, T> =
                kkt_view(ocp.qp.view(), self.dimensions, self.kkt_numbers, self.kkt_indices)?;
            copy_common(iterate.step, self.workspace.saved_step);
            copy_common(iterate.inequalities.slack_step, self.workspace.saved_slack_step);
            copy_common(iterate.inequalities.multiplier_step, self.workspace.saved_multiplier_step);
            copy_common(
                iterate.inequalities.equation_multiplier_steps,
                self.workspace.saved_equation_multipliers,
            );
        }
        Ok(accepted)
    }
}

/// The longest step, at most 1, that leaves at least `1 − τ` of every value.
pub(super) fn max_step_to_boundary<T: Real>(values: &[T], steps: &[T], tau: f64) -> f64 {
    let mut ratio = 1.0f64;
    for (&value, &step) in values.iter().zip(steps) {
        let (value, step) = (value.to_f64(), step.to_f64());
        if step < 0.0 && -step * ratio > tau * value {
            ratio = tau * value / -step;
        }
    }
    ratio
}
