//! A problem on one horizon as a program.

use crate::ocp::formulation::error::{ConstraintName, OcpError};
use crate::ocp::formulation::functions::dynamics::{Dynamics, Nodes, StageAction};
use crate::ocp::formulation::instance::data::{Data, split};
use crate::ocp::formulation::instance::{Ocp, nodes};
use crate::ocp::formulation::problem::Formulation;
use crate::ocp::formulation::program::curvature::{Curvature, Slopes};
use crate::ocp::formulation::program::{Parts, Program};
use crate::qp::{QpError, QpField, Side, Solution, StageDims};
use crate::scalar::Real;
use core::ops::Range;

impl<P: Formulation<T>, T: Real> Program<T> for P {
    type Dynamics = P::Dynamics;
    const LIFTED: bool = P::Dynamics::LIFTED;

    fn linearise<C: Curvature<P::Dynamics, T>, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
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
        let Data { lower, upper, scratch, .. } = split::<P, T>(data.as_mut(), layout);
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
        asks: bool,
    ) -> (bool, Option<(ConstraintName, f64)>) {
        ocp.convexity_and_violation(asks)
    }

    fn begin_stages<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
    ) -> Result<(), OcpError> {
        let layout = ocp.layout();
        let data = split::<P, T>(ocp.data.as_mut(), layout);
        let (v, multipliers) = ocp.iterate.variables_and_costates();
        let p = (&*data.p, ocp.free.view());
        ocp.problem.parts().dynamics.begin_stages(&nodes::<P::Shape, T>(v, multipliers, &[], p, data.times))
    }

    fn expand_stages<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
        step: &Solution<T, D, M>,
    ) -> Result<(), OcpError> {
        let layout = ocp.layout();
        let data = split::<P, T>(ocp.data.as_mut(), layout);
        let (v, multipliers) = ocp.iterate.variables_and_costates();
        let nodes = nodes::<P::Shape, T>(v, multipliers, &[], (data.p, ocp.free.view()), data.times);
        let (step, _) = step.variables_and_costates();
        ocp.problem.parts().dynamics.expand_stages(&nodes, &Nodes { v: step, ..nodes })
    }

    fn move_stages(&mut self, action: StageAction<T>) {
        self.parts().dynamics.move_stages(action);
    }
}
