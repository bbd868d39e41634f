//! The program of joined phases: each phase provides its stages, links the steps between phases.

use super::dynamics::PhaseDynamics;
use super::link::{Link, PhaseEnd};
use super::phase::{Kind, Phase, PhaseSize, PhaseStart};
use super::{JoinedPhase, Phases, TrialPoint, stage_conversion};
use crate::linalg::dot;
use crate::ocp::assembly::convexify::convexify;
use crate::ocp::formulation::error::{ConstraintName, OcpError, Part};
use crate::ocp::formulation::functions::dynamics::{StageAction, add_stage_residuals};
use crate::ocp::formulation::functions::node_evaluation::QuadraticTerms;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::curvature::{Convexification, Curvature};
use crate::ocp::formulation::program::{Program, ProgramParts, intervals_end};
use crate::qp::{
    Arrays, Qp, QpError, QpField, Side, Solution, SolutionStage, StageDims, add_symmetric_product, check,
    copy_common, part, part_mut, take_mut,
};
use crate::scalar::Real;
use core::ops::Range;

/// For `f64` and `f32` only: with a generic number this implementation would conflict with that for
/// every [`Formulation`](crate::ocp::Formulation).
macro_rules! programs {
    ($($number:ty),*) => {$(
        impl Program<$number> for Phases<'_, $number> {
            type Dynamics = PhaseDynamics;

            fn is_lifted(&self) -> bool {
                self.phases.iter().any(|phase| phase.problem.is_lifted())
            }

            fn initialise_stages<D: AsRef<[StageDims]>, M: AsRef<[$number]> + AsMut<[$number]>>(
                ocp: &mut Ocp<Self, $number, D, M>,
            ) -> Result<(), OcpError> {
                ocp.problem.load(ocp.iterate.stages());
                ocp.problem.each_phase(|phase, _| phase.initialise_stages())
            }

            fn expand_stage_steps<D: AsRef<[StageDims]>, M: AsRef<[$number]> + AsMut<[$number]>>(
                ocp: &mut Ocp<Self, $number, D, M>,
                step: &Solution<$number, D, M>,
            ) -> Result<(), OcpError> {
                ocp.problem.load(ocp.iterate.stages());
                ocp.problem.load_trials(step.stages());
                ocp.problem.each_phase(|phase, trial| phase.expand_stage_steps(&trial.point))
            }

            fn apply_stage_action(&mut self, action: StageAction<$number>) {
                self.phases.iter_mut().for_each(|phase| phase.problem.apply_stage_action(action));
            }

            fn linearise<C, D: AsRef<[StageDims]>, M: AsRef<[$number]> + AsMut<[$number]>>(
                ocp: &mut Ocp<Self, $number, D, M>,
                curvature: C,
            ) -> Result<(), OcpError>
            where
                C: Curvature<PhaseDynamics, $number>,
            {
                write(ocp, Kind { exact: C::EXACT, convexification: curvature.convexification() })
            }

            fn slopes<D: AsRef<[StageDims]>, M: AsRef<[$number]> + AsMut<[$number]>>(
                ocp: &mut Ocp<Self, $number, D, M>,
            ) -> Result<(), OcpError> {
                write(ocp, Kind { exact: false, convexification: Convexification::None })
            }

            fn evaluate<D: AsRef<[StageDims]>, M: AsRef<[$number]> + AsMut<[$number]>>(
                ocp: &mut Ocp<Self, $number, D, M>,
                at: &Solution<$number, D, M>,
                ends: &mut [$number],
            ) -> Result<$number, OcpError> {
                let length = intervals_end(ocp.qp.dims());
                ocp.problem.set_step_length(ocp.step_length);
                let objective =
                    ocp.problem.evaluate(at, ends.split_at_mut_checked(length).unwrap_or_default())?;
                ocp.stage_residuals = ocp.problem.stage_residuals();
                Ok(objective)
            }

            fn split<D: AsRef<[StageDims]>, M: AsRef<[$number]> + AsMut<[$number]>>(
                ocp: &mut Ocp<Self, $number, D, M>,
            ) -> ProgramParts<'_, $number, D, M> {
                let Ocp { qp, iterate, data, .. } = ocp;
                let rows = qp.dims().iter().map(|stage| stage.ng).sum();
                let (lower, rest) = data.as_mut().split_at_mut_checked(rows).unwrap_or_default();
                let (upper, scratch) = rest.split_at_mut_checked(rows).unwrap_or_default();
                ProgramParts { qp, iterate, given: [lower, upper], scratch }
            }

            fn spans(&self, _: usize) -> impl Iterator<Item = Range<usize>> {
                let phases = self.phases.iter().map(|phase| phase.first..phase.first + phase.start.size.intervals + 1);
                core::iter::once(0..1).chain(phases)
            }

            fn name<D: AsRef<[StageDims]>, M: AsRef<[$number]> + AsMut<[$number]>>(
                ocp: &Ocp<Self, $number, D, M>,
                place: (QpField, usize, usize),
                side: Side,
            ) -> ConstraintName {
                ocp.problem.name_of_row(place, side)
            }

            fn derivative<D: AsRef<[StageDims]>, M: AsRef<[$number]> + AsMut<[$number]>>(
                ocp: &Ocp<Self, $number, D, M>,
                error: &QpError,
            ) -> Option<OcpError> {
                let of_phase = |(index, phase): (usize, &JoinedPhase<'_, $number>)| {
                    Some(phase.problem.derivative(error)?.in_phase(index))
                };
                ocp.problem.phases.iter().enumerate().find_map(of_phase).or_else(|| {
                    // A non-finite number in no phase belongs to a link.
                    let Err(QpError::InvalidValue { stage, value, .. }) = check(ocp.qp.view()) else { return None };
                    let (index, phase) = ocp.problem.at(stage)?;
                    let function = phase.link.as_ref()?.name();
                    let stage = stage - phase.first;
                    Some(OcpError::NonFiniteFunction { function, stage, output: 0, value, phase: None }.in_phase(index))
                })
            }

            fn complete<D: AsRef<[StageDims]>, M: AsRef<[$number]> + AsMut<[$number]>>(
                ocp: &mut Ocp<Self, $number, D, M>,
                asks: bool,
            ) -> (bool, Option<(ConstraintName, f64)>) {
                let Ocp { problem, iterate, step_length, .. } = ocp;
                problem.set_step_length(*step_length);
                problem.load(iterate.stages());
                let (mut is_convex, mut worst) = (true, None);
                for (index, phase) in problem.phases.iter_mut().enumerate() {
                    let (of_phase, violated) = phase.problem.complete(asks);
                    is_convex &= of_phase && phase.link.as_ref().is_none_or(|link| link.is_linear());
                    if let Some((name, violation)) = violated
                        && worst.is_none_or(|(_, largest)| violation > largest)
                    {
                        worst = Some((ConstraintName { phase: Some(index), ..name }, violation));
                    }
                }
                (is_convex, worst)
            }
        }
    )*};
}

programs!(f64, f32);

/// Writes the QP at the iterate.
fn write<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    ocp: &mut Ocp<Phases<'_, T>, T, D, M>,
    kind: Kind,
) -> Result<(), OcpError> {
    write_linearised(ocp, kind, |_, phase| phase.linearise(kind))
}

/// Writes the QP with exact Hessians at the iterate, from phases that `linearise` linearises.
pub(super) fn write_with<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    ocp: &mut Ocp<Phases<'_, T>, T, D, M>,
    linearise: impl FnMut(usize, &mut dyn Phase<T>) -> Result<T, OcpError>,
) -> Result<(), OcpError> {
    write_linearised(ocp, Kind { exact: true, convexification: Convexification::None }, linearise)
}

/// Writes the QP at the iterate. `linearise` writes that of a phase, and returns its objective.
fn write_linearised<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    ocp: &mut Ocp<Phases<'_, T>, T, D, M>,
    kind: Kind,
    mut linearise: impl FnMut(usize, &mut dyn Phase<T>) -> Result<T, OcpError>,
) -> Result<(), OcpError> {
    ocp.problem.load(ocp.iterate.stages());
    ocp.problem.set_step_length(ocp.step_length);
    let mut objective = T::ZERO;
    for (index, phase) in ocp.problem.phases.iter_mut().enumerate() {
        let of_phase = linearise(index, phase.problem).map_err(|error| error.in_phase(index))?;
        objective = objective + of_phase;
    }
    ocp.objective = objective;
    ocp.stage_residuals = ocp.problem.stage_residuals();
    let Ocp { problem, qp, iterate, data, .. } = ocp;
    let rows = 2 * qp.dims().iter().map(|stage| stage.ng).sum::<usize>();
    let scratch = data.as_mut().get_mut(rows..).unwrap_or_default();
    problem.write_qp(qp, iterate, scratch, kind)
}

/// Writes the ends of the intervals of a phase, with its parameters as constant states, and its
/// constraints.
fn write_ends<T: Real>(size: PhaseSize, trial: &TrialPoint<T>, ends: &mut &mut [T], values: &mut &mut [T]) {
    let PhaseSize { nx, free, intervals, .. } = size;
    let (phi, g) = trial.ends.split_at_checked(intervals * nx).unwrap_or_default();
    for (k, point) in trial.point.stages().enumerate().take(intervals) {
        let (x, w) = take_mut(ends, nx + free).split_at_mut_checked(nx).unwrap_or_default();
        copy_common(x, part(phi, k * nx, nx));
        copy_common(w, point.u);
    }
    copy_common(take_mut(values, g.len()), g);
}

impl<T: Real> JoinedPhase<'_, T> {
    /// Writes the start of the next phase: the states by the link, and the decided variables.
    fn write_start(
        &mut self,
        trial: &TrialPoint<T>,
        last_stage: &SolutionStage<'_, T>,
        starts: &mut &mut [T],
    ) -> Result<(), OcpError> {
        let (Some(next), Some(link)) = (&self.next_start, &mut self.link) else { return Ok(()) };
        let start = take_mut(starts, next.size.nx + next.size.free);
        let Some(last) = trial.point.stages().next_back() else { return Ok(()) };
        link.value(self.problem.phase_end(last), part_mut(start, 0, next.size.given_states))?;
        let previous_stage = last_stage.x.get(self.start.size.nx..).unwrap_or_default();
        stage_conversion::write_start_state(next, last_stage.u, previous_stage, start);
        Ok(())
    }
}

/// Writes the link to the QP at the last stage of a phase, at its point `v` with the multipliers
/// `pi`.
fn write_link_to_qp<T: Real>(
    link: &mut dyn Link<T>,
    end: PhaseEnd<'_, T>,
    (size, begin): (PhaseSize, &PhaseStart),
    arrays: &mut Arrays<'_, T>,
    (v, pi): (&[T], &[T]),
    scratch: &mut [T],
    Kind { exact, convexification }: Kind,
) -> Result<(), OcpError> {
    let Arrays { n, ld, next: states, matrix, hessian, gradient, offset, .. } = arrays;
    let (n, ld, next) = (*n, *ld, begin.size);
    let columns = part_mut(matrix, 0, *states * ld);
    columns.fill(T::ZERO);
    offset.fill(T::ZERO);
    link.linearise(end, part_mut(offset, 0, next.given_states), (&mut *columns, ld))?;
    for (offset, column) in offset.iter_mut().zip(columns.chunks_exact(ld.max(1))).take(next.given_states) {
        *offset = *offset - dot(column, v);
    }
    let variable_count = size.nx + size.free;
    stage_conversion::write_start_columns(begin, [size.nx, variable_count], columns, ld);
    if exact {
        // The gradient at zero is `∇f − H v`; it changes with `H`.
        add_symmetric_product(gradient, hessian, ld, v, n);
        let mut terms = QuadraticTerms { free: end.free, gradient: &mut [], hessian, ld };
        link.add_hessian(end, part(pi, 0, next.given_states), &mut terms);
        convexify(convexification, hessian, ld, variable_count, scratch);
        let product = part_mut(scratch, 0, ld);
        product.fill(T::ZERO);
        add_symmetric_product(product, hessian, ld, v, n);
        gradient.iter_mut().zip(&*product).for_each(|(g, &product)| *g = *g - product);
    }
    Ok(())
}

impl<T: Real> Phases<'_, T> {
    /// Sets the step length of lifted stages for the next evaluation.
    fn set_step_length(&mut self, step_length: Option<T>) {
        self.phases.iter_mut().for_each(|phase| phase.problem.set_step_length(step_length));
    }

    /// Returns the sum and the largest of the residuals of the equations of lifted stages.
    fn stage_residuals(&self) -> [T; 2] {
        let residuals = self.phases.iter().map(|phase| phase.problem.stage_residuals());
        residuals.fold([T::ZERO; 2], add_stage_residuals)
    }

    /// Loads the stages of each phase as its trial point.
    fn load_trials<'s>(&mut self, mut stages: impl Iterator<Item = SolutionStage<'s, T>>) {
        let mut previous_stage = stages.next();
        for (phase, trial) in self.phases.iter().zip(&mut self.trial_points) {
            previous_stage =
                stage_conversion::load_phase(&phase.start, &mut stages, &mut trial.point, previous_stage);
        }
    }

    /// Runs a function for each phase and its trial point.
    ///
    /// # Errors
    /// The first error of a phase, with its number.
    fn each_phase(
        &mut self,
        mut run: impl FnMut(&mut dyn Phase<T>, &TrialPoint<T>) -> Result<(), OcpError>,
    ) -> Result<(), OcpError> {
        for (index, (phase, trial)) in self.phases.iter_mut().zip(&self.trial_points).enumerate() {
            run(phase.problem, trial).map_err(|error| error.in_phase(index))?;
        }
        Ok(())
    }

    /// Returns the objective at a point; writes the ends of all intervals, then constraints, to
    /// `ends`.
    fn evaluate<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        &mut self,
        trial_point: &Solution<T, D, M>,
        (mut ends, mut values): (&mut [T], &mut [T]),
    ) -> Result<T, OcpError> {
        let (mut objective, mut stages) = (T::ZERO, trial_point.stages());
        let Phases { phases, trial_points, initial_state } = self;
        let mut previous_stage = stages.next();
        if let (Some(JoinedPhase { start: begin, .. }), Some(start_variables)) =
            (phases.first(), previous_stage)
        {
            let first = take_mut(&mut ends, begin.size.nx + begin.size.free);
            copy_common(first, initial_state);
            stage_conversion::write_start_state(begin, start_variables.u, &[], first);
        }
        for (index, (phase, trial)) in phases.iter_mut().zip(trial_points).enumerate() {
            let last =
                stage_conversion::load_phase(&phase.start, &mut stages, &mut trial.point, previous_stage);
            let cost = phase.problem.evaluate(&trial.point, &mut trial.ends);
            objective = objective + cost.map_err(|error| error.in_phase(index))?;
            write_ends(phase.start.size, trial, &mut ends, &mut values);
            if let Some(last) = &last {
                phase.write_start(trial, last, &mut ends).map_err(|error| error.in_phase(index))?;
            }
            previous_stage = last;
        }
        Ok(objective)
    }

    /// Writes the QPs of all phases, with the links between them, to the QP of the joined problem.
    fn write_qp<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        &mut self,
        qp: &mut Qp<T, D, M>,
        iterate: &Solution<T, D, M>,
        scratch: &mut [T],
        kind: Kind,
    ) -> Result<(), OcpError> {
        let ((v, _), mut begin) = (iterate.variables_and_costates(), 0);
        let (mut stages, mut points) = (qp.stages_mut(), iterate.stages());
        if let (Some(mut to), Some(point), Some(first)) = (stages.next(), points.next(), self.phases.first())
        {
            let Arrays { ld, matrix, hessian, gradient, offset, .. } = to.arrays();
            [&mut *matrix, hessian, gradient, &mut *offset].into_iter().for_each(|list| list.fill(T::ZERO));
            copy_common(offset, &self.initial_state);
            stage_conversion::write_start_columns(&first.start, [0, point.x.len()], matrix, ld);
            begin += ld;
        }
        for (index, JoinedPhase { problem, link, start: phase, next_start: next, .. }) in
            self.phases.iter_mut().enumerate()
        {
            for (from, stage_point) in problem.qp().stages().zip(problem.iterate().stages()) {
                let (Some(mut to), Some(point)) = (stages.next(), points.next()) else { return Ok(()) };
                let mut arrays = to.arrays();
                stage_conversion::copy_stage_qp(phase.size, &from, &mut arrays);
                let v = part(v, begin, arrays.ld);
                begin += arrays.ld;
                // In the QP of a phase its last stage has no dynamics.
                if let (Some(next), Some(link), true) = (&*next, &mut *link, stage_point.dynamics.is_empty())
                {
                    let (end, sizes, point_and_costates) =
                        (problem.phase_end(stage_point), (phase.size, next), (v, point.dynamics));
                    write_link_to_qp(
                        link.as_mut(),
                        end,
                        sizes,
                        &mut arrays,
                        point_and_costates,
                        scratch,
                        kind,
                    )
                    .map_err(|error| error.in_phase(index))?;
                }
            }
        }
        Ok(())
    }

    /// Returns the name of a constraint of the QP in its phase.
    fn name_of_row(&self, (field, stage, index): (QpField, usize, usize), side: Side) -> ConstraintName {
        let unnamed = (Part::Dimensions, "");
        let find_name = || {
            let found = self.at(stage);
            let has_start_variables =
                found.is_none_or(|(_, phase)| stage == phase.first + phase.start.size.intervals);
            let (number, place) = if has_start_variables && field == QpField::ControlBounds {
                let number = found.map_or(0, |(number, _)| number + 1);
                let begin = &self.phases.get(number)?.start;
                let states = begin.size.free_start_states().len();
                let state = (QpField::StateBounds, 0, begin.size.given_states + index);
                let parameter = index
                    .checked_sub(states)
                    .and_then(|start_variables| begin.parameters().nth(start_variables));
                (number, parameter.map_or(state, |w| (QpField::ControlBounds, 0, w)))
            } else {
                let (number, phase) = found?;
                let (k, PhaseSize { nx, free, .. }) = (stage - phase.first, phase.start.size);
                let place = match field {
                    QpField::StateBounds if index >= nx => (QpField::ControlBounds, k, index - nx),
                    QpField::ControlBounds => (field, k, index + free),
                    _ => (field, k, index),
                };
                (number, place)
            };
            let name = self.phases.get(number)?.problem.name(place, side);
            Some(ConstraintName { phase: Some(number), ..name })
        };
        let (part, name) = unnamed;
        find_name().unwrap_or(ConstraintName { part, stage, name, output: 0, point: 0, side, phase: None })
    }
}
