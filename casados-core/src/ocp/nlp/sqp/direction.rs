//! The direction of a step: the QP at the iterate, regularised where it is not convex, with
//! penalties where it is infeasible.

use super::Sqp;
use super::scaled::{Way, penalties_end, penalties_mut};
use super::state::State;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::Convexification;
use crate::ocp::formulation::program::curvature::Curvature;
use crate::ocp::nlp::elastic::Worst;
use crate::ocp::solution::log::Iteration;
use crate::qp::{QpError, QpSolver, QpStart, QpStatistics, StageDims};
use crate::scalar::Real;

/// The first QP is solved to all digits where forces might be wrong by more, in units of the user.
const MOST_AT_FIRST: f64 = 1e-2;
/// Penalties grow by this where the objective is what holds violations back.
const PENALTY_FACTOR: f64 = 100.0;
/// Beside penalties of this multiple the objective counts nothing.
const MAX_PENALTY_FACTOR: f64 = 1e4;
/// QPs with hard bounds have this part of the iterations of QPs, and those with penalties so much
/// of what is left.
const HARD_SHARE: f64 = 0.35;
const ELASTIC_SHARE: f64 = 0.6;
/// What rounding may leave of forces as large as one: no QP is solved to more digits.
const QP_ROUNDING: f64 = 1e-13;
/// No direction makes violations smaller if the best one leaves this part of them.
const STATIONARY_VIOLATION: f64 = 1.0 - 1e-3;
/// Gaps are closed that are no more than this part of the violations of bounds.
const CLOSED_GAPS: f64 = 1e-2;
/// After so many steps with penalties in a row, gaps that are no more than the violations of bounds
/// are not closed any further: a step that closes them opens as large ones.
const STEPS_THAT_CLOSE_GAPS: usize = 4;
/// IPOPT's `resto_proximity_weight`: the curvature that keeps a point near the iterate, and the
/// digits of the QP, as parts of the penalty; then those of an easier QP.
const PROXIMITY_WEIGHTS: [(f64, f64); 2] = [(2e-5, QP_ROUNDING), (2e-3, 1e-9)];

/// What came of a QP.
pub(super) enum Direction {
    /// A step.
    Step,
    /// A proof that the sum of violations is stationary.
    Infeasible(Worst),
}

impl<S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Sqp<S, C, T, D, M> {
    pub(super) fn penalties<'s, P: Program<T>>(&'s self, ocp: &Ocp<P, T, D, M>) -> &'s [T] {
        self.work.as_ref().get(ocp.ends()..penalties_end(ocp)).unwrap_or_default()
    }

    /// Penalties in place of hard bounds.
    fn set_elastic<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        penalty: f64,
    ) {
        let memory = penalties_mut(self.work.as_mut(), ocp);
        if !state.elastic {
            ocp.remember_penalties(memory);
        }
        ocp.set_penalties(memory, Some(T::from_f64(penalty)), &[]);
        state.elastic = true;
        // Objectives with other penalties are not to be compared.
        state.search.filter.clear();
    }

    /// Bounds as they were given.
    pub(super) fn leave_elastic<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
    ) {
        if state.elastic {
            // What is remembered is in units.
            self.scale(ocp, state, Way::Into);
            ocp.set_penalties(self.penalties(ocp), None, &[]);
            self.scale(ocp, state, Way::Back);
            state.elastic = false;
            state.search.filter.clear();
        }
    }

    /// The QP at the iterate; in elastic mode if it has no solution otherwise.
    pub(super) fn direction<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        row: &mut Iteration,
    ) -> Result<Result<Direction, QpError>, OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        (state.feasibility_step, state.rewritten) = (false, false);
        state.residual = row.residuals.largest();
        self.scale(ocp, state, Way::Into);
        if state.sizes.is_some() {
            state.residual = ocp.residuals().0.largest();
        }
        let mut direction = self.direction_in_units(ocp, state, row);
        self.scale(ocp, state, Way::Back);
        if state.feasibility_step || state.rewritten {
            ocp.linearise(self.curvature)?;
        }
        if let (Ok(Direction::Infeasible(worst)), Some(_)) = (&mut direction, state.sizes) {
            *worst = self.in_problem(ocp, *worst);
        }
        Ok(direction)
    }

    /// The same where the QP, the iterate and all constants are in units.
    fn direction_in_units<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        row: &mut Iteration,
    ) -> Result<Direction, QpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        let forces = ocp.iterate.multipliers_mut().iter().fold(T::ZERO, |m, force| force.abs().max(m));
        let reduced = self.curvature.convexification() == Convexification::Reduced;
        let warm = self.options.warm_start && (row.iteration > 0 || reduced);
        let part = self.options.qp_accuracy * state.residual;
        // Without multipliers stationarity is the gradient, and says nothing of what is far away.
        let wrong = part * state.force();
        let begins = row.iteration == 0 && forces == T::ZERO && wrong > MOST_AT_FIRST;
        let permitted = if begins || state.exact { 0.0 } else { part };
        let scaled = state.sizes.is_some();
        let rounding = if scaled { ocp.rounding_of_gaps().max(ocp.rounding_of_forces()) } else { 0.0 };
        self.qp_solver.permit(permitted.max(QP_ROUNDING * forces.to_f64()).max(rounding));
        // After a step with penalties hard bounds, whose QP had no solution, are not tried again as
        // long as violations stay: a solution with penalties that violates nothing is one of
        // theirs.
        if core::mem::take(&mut state.stays_elastic) {
            return self.elastic_direction(ocp, state, row, None);
        }
        let start = if warm { QpStart::Warm } else { QpStart::Cold };
        self.begin_phase(state, row, HARD_SHARE);
        let Err(error) = self.regularised(ocp, state, start, row) else { return Ok(Direction::Step) };
        let may_help = matches!(
            error,
            QpError::Infeasible { .. } | QpError::MaxIterations { .. } | QpError::Stalled { .. }
        );
        if !(may_help && self.options.elastic) {
            return Err(error);
        }
        self.elastic_direction(ocp, state, row, Some(error))
    }

    /// The step where bounds have penalties, since the QP had no solution; or that violations stay.
    ///
    /// # Errors
    /// `known`, the error of the QP with hard bounds, where that with penalties has no solution
    /// either; that of the latter if there is none.
    fn elastic_direction<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        row: &mut Iteration,
        known: Option<QpError>,
    ) -> Result<Direction, QpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        // What is violated and what is possible are compared: by exact solutions.
        let penalty = self.options.elastic_penalty.max(state.penalty);
        self.set_elastic(ocp, state, penalty);
        self.qp_solver.permit(QP_ROUNDING * penalty);
        row.elastic = true;
        let (worst, bounds) = ocp.worst(self.penalties(ocp), &[]);
        let gaps = ocp.gaps();
        let before = bounds + gaps;
        if let (Some(error), 0.0) = (known, before) {
            // Nothing is violated that penalties could stand for.
            return Err(error);
        }
        self.begin_phase(state, row, ELASTIC_SHARE);
        if let Err(error) = self.regularised(ocp, state, QpStart::Cold, row) {
            if before == 0.0 {
                return Err(error);
            }
            // Without objective and curvature it is nearly a linear program.
            self.feasibility_step(ocp, state, row, before).map_err(|_| known.unwrap_or(error))?;
            return Ok(Self::take_feasibility_step(state, row));
        }
        let left = self.violation_of_solution(ocp);
        if left <= self.options.tolerance {
            // It is the solution with hard bounds, too.
            ocp.set_penalties(self.penalties(ocp), None, &[]);
            (state.elastic, row.elastic) = (false, false);
            return Ok(Direction::Step);
        }
        state.stays_elastic = true;
        match worst.filter(|worst| worst.violation > self.options.tolerance) {
            Some(worst) if left >= STATIONARY_VIOLATION * before => {
                Ok(self.steer(ocp, state, row, (worst, [bounds, gaps])))
            }
            _ => Ok(Direction::Step),
        }
    }

    /// What follows where penalties reduce violations of bounds and gaps by nothing: the QP that
    /// minimises these alone tells whether larger penalties would (R. H. Byrd, J. Nocedal, R. A.
    /// Waltz, "Steering exact penalty methods for nonlinear programming", Optim. Methods Softw. 23,
    /// 2008).
    fn steer<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        row: &mut Iteration,
        (worst, [bounds, gaps]): (Worst, [f64; 2]),
    ) -> Direction {
        self.trial.copy_from(&self.solution);
        let before = bounds + gaps;
        if self.feasibility_step(ocp, state, row, before).is_ok() {
            if self.violation_of_solution(ocp) < STATIONARY_VIOLATION * before {
                let largest = MAX_PENALTY_FACTOR * self.options.elastic_penalty;
                let penalty = self.options.elastic_penalty.max(state.penalty);
                state.penalty = (PENALTY_FACTOR * penalty).min(largest);
                return Self::take_feasibility_step(state, row);
            }
            let closes = gaps > CLOSED_GAPS * bounds && state.elastic_steps < STEPS_THAT_CLOSE_GAPS;
            if !(closes || gaps > bounds) {
                return Direction::Infeasible(worst);
            }
        }
        // Gaps are to be closed first, whatever that leaves of bounds. The QP has another objective
        // now, and is to be written again.
        (state.rewritten, state.penalty) = (true, 0.0);
        self.set_elastic(ocp, state, self.options.elastic_penalty);
        core::mem::swap(&mut self.solution, &mut self.trial);
        Direction::Step
    }

    /// QPs to come have a share of the iterations that are left.
    fn begin_phase(&self, state: &mut State<'_, T>, row: &Iteration, share: f64) {
        let left = self.options.max_qp_iterations.saturating_sub(row.qp_iterations);
        state.most_qp_iterations = row.qp_iterations + (share * left as f64) as usize;
    }

    /// The step to the nearest point; the QP has another objective than that of the iterate.
    fn take_feasibility_step(state: &mut State<'_, T>, row: &mut Iteration) -> Direction {
        (state.feasibility_step, row.regularisation) = (true, 0.0);
        Direction::Step
    }

    /// The point that violates the linearisation least, near the iterate:
    ///
    /// ```text
    /// min  θ(v) + ½ ε ‖v − v̄‖² / θ₀        θ: violations of bounds, θ₀: those at v̄, and gaps
    /// ```
    ///
    /// Afterwards penalties are those beside which the objective counts nothing.
    fn feasibility_step<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        row: &mut Iteration,
        violation: f64,
    ) -> Result<(), QpError> {
        let (one, alone) = (self.options.elastic_penalty, MAX_PENALTY_FACTOR * self.options.elastic_penalty);
        // Of soft bounds that were given there are costs.
        let soft = self.penalties(ocp).iter().any(|penalty| penalty.is_finite());
        let penalty = if soft { alone } else { one };
        self.set_elastic(ocp, state, penalty);
        self.begin_phase(state, row, 1.0);
        let mut result = Ok(());
        for (weight, digits) in PROXIMITY_WEIGHTS {
            self.qp_solver.permit(digits * penalty);
            ocp.forget_objective(T::from_f64(weight * penalty / violation));
            result = self.solve_qp(ocp, state, QpStart::Cold, row);
            if result.is_ok() {
                break;
            }
        }
        self.set_elastic(ocp, state, alone);
        result
    }

    /// The sum of violations that the solution of the QP leaves, by its linearisation.
    fn violation_of_solution<P: Program<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>) -> f64 {
        core::mem::swap(&mut ocp.iterate, &mut self.solution);
        let (_, sum) = ocp.worst(self.penalties(ocp), &[]);
        core::mem::swap(&mut ocp.iterate, &mut self.solution);
        sum
    }

    /// The QP with as much regularisation as it takes.
    fn regularised<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        start: QpStart,
        row: &mut Iteration,
    ) -> Result<(), QpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        if state.damping > row.regularisation {
            ocp.regularise(T::from_f64(state.damping - row.regularisation));
            row.regularisation = state.damping;
        }
        if self.curvature.convexification() != Convexification::Reduced {
            return self.solve_qp(ocp, state, start, row);
        }
        let (mut correction, mut delta) = (state.inertia, row.regularisation);
        let solve = |ocp: &Ocp<P, T, D, M>| self.solve_qp(ocp, state, start, row);
        let result = ocp.correct_inertia(&mut correction, &mut delta, solve);
        (state.inertia, row.regularisation) = (correction, delta);
        result
    }

    /// The QP from the iterate, with the iterations that are left of its share.
    fn solve_qp<P: Program<T>>(
        &mut self,
        ocp: &Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        start: QpStart,
        row: &mut Iteration,
    ) -> Result<(), QpError> {
        self.solution.copy_from(&ocp.iterate);
        let left = state.most_qp_iterations.saturating_sub(row.qp_iterations);
        if self.options.elastic && left == 0 {
            let iterations = row.qp_iterations;
            return Err(QpError::MaxIterations { iterations, residuals: row.residuals });
        }
        // Without penalties there is no other way out: the solver is to say what it can.
        self.qp_solver.limit(self.options.elastic.then_some(left));
        let mut asked = 0;
        let over = &mut || {
            asked += 1;
            state.is_over()
        };
        let result = self.qp_solver.solve_until(ocp.qp(), start, self.solution.view_mut(), over);
        self.qp_solver.limit(None);
        let took = match result {
            Ok(QpStatistics { iterations, .. })
            | Err(
                QpError::MaxIterations { iterations, .. }
                | QpError::Stalled { iterations, .. }
                | QpError::OutOfTime { iterations, .. },
            ) => iterations,
            // A solver asks in every iteration, and says no number where it finds such a QP.
            Err(_) => asked,
        };
        row.qp_iterations += took;
        result.map(drop)
    }
}
