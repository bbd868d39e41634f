//! The program of joined phases: each phase provides its stages, links the steps between phases.

use super::link::{Link, PhaseEnd};
use super::phase::{Kind, PhaseSize};
use super::{JoinedPhase, Phases, TrialPoint, stage_conversion};
use crate::linalg::dot;
use crate::ocp::assembly::convexify::convexify;
use crate::ocp::formulation::error::{ConstraintName, OcpError, Part};
use crate::ocp::formulation::functions::dynamics::{Nodes, Sink};
use crate::ocp::formulation::functions::node_evaluation::QuadraticTerms;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::curvature::Convexification;
use crate::ocp::formulation::program::curvature::{Curvature, Exact, GaussNewton};
use crate::ocp::formulation::program::{Program, ProgramParts, intervals_end};
use crate::qp::{
    Arrays, Qp, QpError, QpField, Side, Solution, SolutionStage, StageDims, add_symmetric, check,
    copy_common, part, part_mut, take_mut,
};
use crate::scalar::Real;
use alloc::vec::Vec;
use core::ops::Range;

/// The type of dynamics that a [`Curvature`] of [`Phases`] is generic over; each phase linearises
/// its own.
///
/// No value has this type.
///
/// ```
/// use casados::ocp::{Curvature, Exact, PhaseDynamics};
///
/// fn is_exact<C: Curvature<PhaseDynamics, f64>>(_: C) -> bool { C::EXACT }
/// assert!(is_exact(Exact::default()));
/// ```
#[derive(Clone, Copy, Debug)]
pub enum PhaseDynamics {}

macro_rules! curvatures {
    ($($number:ty, $curvature:ty, $exact:expr;)*) => {$(
        impl Curvature<PhaseDynamics, $number> for $curvature {
            const EXACT: bool = $exact;
            fn convexification(&self) -> Convexification {
                self.convexification
            }
            fn run(
                self,
                dynamics: &mut PhaseDynamics,
                _: &Nodes<'_, $number>,
                _: Sink<'_, $number>,
            ) -> Result<(), OcpError> {
                match *dynamics {}
            }
        }
    )*};
}

curvatures! {
    f64, Exact, true;
    f32, Exact, true;
    f64, GaussNewton, false;
    f32, GaussNewton, false;
}

/// For `f64` and `f32` only: with a generic number this implementation would conflict with that for
/// every [`Formulation`](crate::ocp::Formulation).
macro_rules! programs {
    ($($number:ty),*) => {$(
        impl Program<$number> for Phases<'_, $number> {
            type Dynamics = PhaseDynamics;

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
                ocp.problem.evaluate(at, ends.split_at_mut_checked(length).unwrap_or_default())
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
                let phases = self.phases.iter().map(|phase| phase.first..phase.first + phase.size.intervals + 1);
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
                ocp.problem.phases.iter().find_map(|phase| phase.problem.derivative(error)).or_else(|| {
                    // A non-finite number in no phase belongs to a link.
                    let Err(QpError::InvalidValue { stage, value, .. }) = check(ocp.qp.view()) else { return None };
                    let (_, phase) = ocp.problem.at(stage)?;
                    let function = phase.link.as_ref()?.name();
                    let stage = stage - phase.first;
                    Some(OcpError::NonFiniteFunction { function, stage, output: 0, value })
                })
            }

            fn complete<D: AsRef<[StageDims]>, M: AsRef<[$number]> + AsMut<[$number]>>(
                ocp: &mut Ocp<Self, $number, D, M>,
                asks: bool,
            ) -> (bool, Option<(ConstraintName, f64)>) {
                let Ocp { problem, iterate, .. } = ocp;
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

/// Writes the QP at the iterate, and returns the objective.
fn write<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    ocp: &mut Ocp<Phases<'_, T>, T, D, M>,
    kind: Kind,
) -> Result<(), OcpError> {
    ocp.problem.load(ocp.iterate.stages());
    let mut objective = T::ZERO;
    for phase in &mut ocp.problem.phases {
        objective = objective + phase.problem.linearise(kind)?;
    }
    ocp.objective = objective;
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
        next: PhaseSize,
        trial: &TrialPoint<T>,
        last_stage: &SolutionStage<'_, T>,
        start: &mut [T],
    ) -> Result<(), OcpError> {
        let (Some(link), Some(last)) = (&mut self.link, trial.point.stages().next_back()) else {
            return Ok(());
        };
        link.value(self.problem.phase_end(last), part_mut(start, 0, next.given_states))?;
        stage_conversion::write_start_state(next, last_stage.u, start);
        Ok(())
    }
}

/// Writes the link to the QP at the last stage of a phase, at its point `v` with the multipliers
/// `pi`.
fn write_link_to_qp<T: Real>(
    link: &mut dyn Link<T>,
    end: PhaseEnd<'_, T>,
    [size, next]: [PhaseSize; 2],
    arrays: &mut Arrays<'_, T>,
    (v, pi): (&[T], &[T]),
    scratch: &mut [T],
    Kind { exact, convexification }: Kind,
) -> Result<(), OcpError> {
    let Arrays { n, ld, next: next_state_count, matrix, hessian, gradient, offset, .. } = arrays;
    let (n, ld) = (*n, *ld);
    let columns = part_mut(matrix, 0, *next_state_count * ld);
    columns.fill(T::ZERO);
    offset.fill(T::ZERO);
    link.linearise(end, part_mut(offset, 0, next.given_states), (&mut *columns, ld))?;
    for (offset, column) in offset.iter_mut().zip(columns.chunks_exact(ld.max(1))).take(next.given_states) {
        *offset = *offset - dot(column, v);
    }
    let variable_count = size.nx + size.free;
    stage_conversion::write_start_columns(next, variable_count, columns, ld);
    if exact {
        // The gradient at zero is `∇f − H v`; it changes with `H`.
        add_symmetric(gradient, hessian, ld, v, n);
        let mut terms = QuadraticTerms { free: end.free, gradient: &mut [], hessian, ld };
        link.add_hessian(end, part(pi, 0, next.given_states), &mut terms);
        convexify(convexification, hessian, ld, variable_count, scratch);
        let product = part_mut(scratch, 0, ld);
        product.fill(T::ZERO);
        add_symmetric(product, hessian, ld, v, n);
        gradient.iter_mut().zip(&*product).for_each(|(g, &product)| *g = *g - product);
    }
    Ok(())
}

impl<T: Real> Phases<'_, T> {
    /// Returns the objective at a point; writes the ends of all intervals, then constraints, to
    /// `ends`.
    fn evaluate<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        &mut self,
        trial_point: &Solution<T, D, M>,
        (mut ends, mut values): (&mut [T], &mut [T]),
    ) -> Result<T, OcpError> {
        let (mut objective, mut stages) = (T::ZERO, trial_point.stages());
        let mut next_sizes: Vec<_> = self.phases.iter().map(|phase| phase.size).collect();
        let Phases { phases, trial_points: trials, initial_state: start } = self;
        let mut nexts = next_sizes.drain(..);
        let mut previous_stage = stages.next();
        if let (Some(size), Some(start_variables)) = (nexts.next(), previous_stage) {
            let first = take_mut(&mut ends, size.nx + size.free);
            copy_common(first, start);
            stage_conversion::write_start_state(size, start_variables.u, first);
        }
        for (phase, trial) in phases.iter_mut().zip(trials) {
            let last =
                stage_conversion::load_phase(phase.size, &mut stages, &mut trial.point, previous_stage);
            objective = objective + phase.problem.evaluate(&trial.point, &mut trial.ends)?;
            write_ends(phase.size, trial, &mut ends, &mut values);
            if let (Some(next), Some(last)) = (nexts.next(), last) {
                phase.write_start(next, trial, &last, take_mut(&mut ends, next.nx + next.free))?;
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
        let next_sizes = self.next_sizes();
        if let (Some(mut to), Some(point), Some(first)) = (stages.next(), points.next(), self.phases.first())
        {
            let Arrays { ld, matrix, hessian, gradient, offset, .. } = to.arrays();
            [&mut *matrix, hessian, gradient, &mut *offset].into_iter().for_each(|list| list.fill(T::ZERO));
            copy_common(offset, &self.initial_state);
            stage_conversion::write_start_columns(first.size, point.x.len(), matrix, ld);
            begin += ld;
        }
        for (JoinedPhase { problem, link, size, .. }, next) in self.phases.iter_mut().zip(next_sizes) {
            for (from, stage_point) in problem.qp().stages().zip(problem.iterate().stages()) {
                let (Some(mut to), Some(point)) = (stages.next(), points.next()) else { return Ok(()) };
                let mut arrays = to.arrays();
                stage_conversion::copy_stage_qp(*size, &from, &mut arrays);
                let v = part(v, begin, arrays.ld);
                begin += arrays.ld;
                // In the QP of a phase its last stage has no dynamics.
                if let (Some(next), Some(link), true) = (next, &mut *link, stage_point.dynamics.is_empty()) {
                    let (end, sizes, point_and_costates) =
                        (problem.phase_end(stage_point), [*size, next], (v, point.dynamics));
                    write_link_to_qp(
                        link.as_mut(),
                        end,
                        sizes,
                        &mut arrays,
                        point_and_costates,
                        scratch,
                        kind,
                    )?;
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
                found.is_none_or(|(_, phase)| stage == phase.first + phase.size.intervals);
            let (number, place) = if has_start_variables && field == QpField::ControlBounds {
                let number = found.map_or(0, |(number, _)| number + 1);
                let PhaseSize { given_states: given, .. } = self.phases.get(number)?.size;
                let states = self.phases.get(number)?.size.free_start_states().len();
                let state = (QpField::StateBounds, 0, given + index);
                let parameter = index.checked_sub(states);
                (number, parameter.map_or(state, |w| (QpField::ControlBounds, 0, w)))
            } else {
                let (number, phase) = found?;
                let (k, PhaseSize { nx, free, .. }) = (stage - phase.first, phase.size);
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
