//! A problem on one horizon as a program.

use crate::ocp::formulation::error::{ConstraintName, OcpError};
use crate::ocp::formulation::functions::dynamics::{Dynamics, Nodes, StageAction};
use crate::ocp::formulation::instance::data::{Data, split_data};
use crate::ocp::formulation::instance::{Ocp, interval_nodes};
use crate::ocp::formulation::problem::Formulation;
use crate::ocp::formulation::program::curvature::{Curvature, FirstOrder};
use crate::ocp::formulation::program::{Program, ProgramParts};
use crate::qp::{QpError, QpField, Side, Solution, StageDims};
use crate::scalar::Real;
use core::ops::Range;

impl<P: Formulation<T>, T: Real> Program<T> for P {
    type Dynamics = P::Dynamics;

    #[inline(always)]
    fn is_lifted(&self) -> bool {
        P::Dynamics::LIFTED
    }

    fn linearise<C: Curvature<P::Dynamics, T>, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
        curvature: C,
    ) -> Result<(), OcpError> {
        ocp.linearise_with_observer(curvature, &mut |_, _| {})
    }

    fn slopes<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
    ) -> Result<(), OcpError> {
        ocp.linearise(FirstOrder)
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
    ) -> ProgramParts<'_, T, D, M> {
        let layout = ocp.layout();
        let Ocp { qp, iterate, data, .. } = ocp;
        let Data { lower, upper, scratch, .. } = split_data::<P, T>(data.as_mut(), layout);
        ProgramParts { qp, iterate, given: [lower, upper], scratch }
    }

    fn spans(&self, stages: usize) -> impl Iterator<Item = Range<usize>> {
        core::iter::once(0..stages)
    }

    fn name<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &Ocp<Self, T, D, M>,
        (field, stage, index): (QpField, usize, usize),
        side: Side,
    ) -> ConstraintName {
        ocp.constraint_name(field, stage, index, side)
    }

    fn derivative<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &Ocp<Self, T, D, M>,
        error: &QpError,
    ) -> Option<OcpError> {
        ocp.find_non_finite_derivative(error)
    }

    fn complete<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
        asks: bool,
    ) -> (bool, Option<(ConstraintName, f64)>) {
        ocp.convexity_and_violation(asks)
    }

    fn initialise_stages<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
    ) -> Result<(), OcpError> {
        let layout = ocp.layout();
        let data = split_data::<P, T>(ocp.data.as_mut(), layout);
        let (v, multipliers) = ocp.iterate.variables_and_costates();
        let p = (&*data.p, ocp.free.view());
        ocp.problem.parts().dynamics.initialise_stages(&interval_nodes::<P::Shape, T>(
            v,
            multipliers,
            &[],
            p,
            data.times,
        ))
    }

    fn expand_stage_steps<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
        step: &Solution<T, D, M>,
    ) -> Result<(), OcpError> {
        let layout = ocp.layout();
        let data = split_data::<P, T>(ocp.data.as_mut(), layout);
        let (v, multipliers) = ocp.iterate.variables_and_costates();
        let nodes = interval_nodes::<P::Shape, T>(v, multipliers, &[], (data.p, ocp.free.view()), data.times);
        let (step, _) = step.variables_and_costates();
        ocp.problem.parts().dynamics.expand_stage_steps(&nodes, &Nodes { v: step, ..nodes })
    }

    fn apply_stage_action(&mut self, action: StageAction<T>) {
        self.parts().dynamics.apply_stage_action(action);
    }
}
