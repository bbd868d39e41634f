//! A problem on one horizon.

use super::{Parts, Program};
use crate::ocp::assembly::curvature::{Curvature, Slopes};
use crate::ocp::formulation::error::{ConstraintName, OcpError};
use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::functions::cost::Cost;
use crate::ocp::formulation::functions::dynamics::{Dynamics, Nodes, StageAction};
use crate::ocp::formulation::instance::data::{Data, split};
use crate::ocp::formulation::instance::{Ocp, nodes};
use crate::ocp::formulation::problem::Problem;
use crate::ocp::solution::outcome::Outcome;
use crate::qp::{QpError, QpField, Side, Solution, StageDims};
use crate::scalar::Real;
use core::ops::Range;

impl<T: Real, I, L, E, G, H> Program<T> for Problem<I, L, E, G, H>
where
    I: Dynamics<T>,
    L: Cost<I::Shape, T>,
    E: Cost<I::Shape, T>,
    G: Constraints<I::Shape, T>,
    H: Constraints<I::Shape, T>,
{
    type Dynamics = I;
    const LIFTED: bool = I::LIFTED;

    fn linearise<C: Curvature<I, T>, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
        curvature: C,
    ) -> Result<(), OcpError> {
        ocp.linearise_with_observer(curvature, &mut |_, _| {})
    }

    fn slopes<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
    ) -> Result<(), OcpError> {
        ocp.linearise(Slopes)
    }

    fn evaluate<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
        at: &Solution<T, D, M>,
        ends: &mut [T],
    ) -> Result<T, OcpError> {
        ocp.evaluate_functions(at, ends)
    }

    fn split<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
    ) -> Parts<'_, T, D, M> {
        let layout = ocp.layout();
        let Ocp { qp, iterate, data, .. } = ocp;
        let Data { lower, upper, scratch, .. } = split::<Self, T>(data.as_mut(), layout);
        Parts { qp, iterate, given: [lower, upper], scratch }
    }

    fn spans(&self, stages: usize) -> impl Iterator<Item = Range<usize>> {
        core::iter::once(0..stages)
    }

    fn name<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &Ocp<Self, T, D, M>,
        (field, stage, index): (QpField, usize, usize),
        side: Side,
    ) -> ConstraintName {
        ocp.name_of_row(field, stage, index, side)
    }

    fn derivative<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &Ocp<Self, T, D, M>,
        error: &QpError,
    ) -> Option<OcpError> {
        ocp.derivative_without_value(error)
    }

    fn complete<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
        outcome: &mut Outcome,
    ) {
        ocp.complete_outcome(outcome);
    }

    fn begin_stages<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
    ) -> Result<(), OcpError> {
        let layout = ocp.layout();
        let data = split::<Self, T>(ocp.data.as_mut(), layout);
        let (v, multipliers) = ocp.iterate.variables_and_costates();
        let p = (&*data.p, ocp.free.view());
        ocp.problem.dynamics.begin_stages(&nodes::<I::Shape, T>(v, multipliers, &[], p, data.times))
    }

    fn expand_stages<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
        step: &Solution<T, D, M>,
    ) -> Result<(), OcpError> {
        let layout = ocp.layout();
        let data = split::<Self, T>(ocp.data.as_mut(), layout);
        let (v, multipliers) = ocp.iterate.variables_and_costates();
        let nodes = nodes::<I::Shape, T>(v, multipliers, &[], (data.p, ocp.free.view()), data.times);
        let (step, _) = step.variables_and_costates();
        ocp.problem.dynamics.expand_stages(&nodes, &Nodes { v: step, ..nodes })
    }

    fn move_stages(&mut self, action: StageAction<T>) {
        self.dynamics.move_stages(action);
    }
}
