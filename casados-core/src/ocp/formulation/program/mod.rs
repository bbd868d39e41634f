//! The interface between solvers and problems: the QP at the iterate, values at other points, and
//! names.
//!
//! A problem on one horizon implements it by its functions, phases by the horizons of their
//! problems.

pub(in crate::ocp) mod curvature;

use crate::ocp::formulation::error::{ConstraintName, OcpError};
use crate::ocp::formulation::functions::dynamics::StageAction;
use crate::ocp::formulation::instance::Ocp;
use crate::qp::{Qp, QpError, QpField, Side, Solution, StageDims};
use crate::scalar::Real;
use core::ops::Range;
use curvature::Curvature;

/// A nonlinear program whose QP has the stages of optimal control, as [`Sqp`](crate::ocp::Sqp) and
/// [`Ipm`](crate::ocp::Ipm) solve it.
///
/// Every [`Problem`](crate::ocp::Problem) is one, and so are `Phases` of several. Generic functions
/// require [`Formulation`](crate::ocp::Formulation), which implies it.
///
/// ```
/// use casados::ocp::{HeapOcp, HeapSqp, Horizon, LeastSquaresCost, Map, OcpError, Problem, Program};
/// use casados::prelude::*;
///
/// /// How many variables a program has.
/// fn variables<P: Program<f64>>(ocp: &HeapOcp<P>) -> usize {
///     ocp.qp().dims().iter().map(|stage| stage.nx + stage.nu).sum()
/// }
///
/// #[function]
/// fn push(x: f64, u: f64) -> f64 { x + u }
/// let ocp = Problem::new(Map::<Push, f64>::new()).on(Horizon::uniform(10, 0.1))?;
/// assert_eq!(variables(&ocp), 10 * 2 + 1);
/// # Ok::<(), OcpError>(())
/// ```
pub trait Program<T: Real>: Sized {
    /// The dynamics that a [`Curvature`] linearises.
    type Dynamics;
    /// Whether stages of intervals are variables.
    #[doc(hidden)]
    fn is_lifted(&self) -> bool {
        false
    }

    /// Writes the QP at the iterate, and its objective.
    #[doc(hidden)]
    fn linearise<C: Curvature<Self::Dynamics, T>, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
        curvature: C,
    ) -> Result<(), OcpError>;

    /// Writes the QP with first derivatives, for callers that do not use the Hessian.
    #[doc(hidden)]
    fn slopes<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
    ) -> Result<(), OcpError>;

    /// Returns the objective at a point, without penalties; writes the ends of all intervals,
    /// followed by the constraints of all stages, to `ends`.
    #[doc(hidden)]
    fn evaluate<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
        trial_point: &Solution<T, D, M>,
        ends: &mut [T],
    ) -> Result<T, OcpError>;

    /// Returns the parts of a problem that every program has.
    #[doc(hidden)]
    fn split<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
    ) -> ProgramParts<'_, T, D, M>;

    /// Returns ranges of stages with equal variables; `stages` is the number of all stages.
    #[doc(hidden)]
    fn spans(&self, stages: usize) -> impl Iterator<Item = Range<usize>>;

    /// Returns the name of a constraint of the QP.
    #[doc(hidden)]
    fn name<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &Ocp<Self, T, D, M>,
        place: (QpField, usize, usize),
        side: Side,
    ) -> ConstraintName;

    /// Returns the first non-finite derivative in the QP.
    #[doc(hidden)]
    fn derivative<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &Ocp<Self, T, D, M>,
        error: &QpError,
    ) -> Option<OcpError>;

    /// Returns the results at the end of a run: whether the problem is known to be convex, and the
    /// largest violation of a bound if it is needed.
    #[doc(hidden)]
    fn complete<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
        needs_violation: bool,
    ) -> (bool, Option<(ConstraintName, f64)>);

    /// Initialises stages that are variables at the iterate.
    #[doc(hidden)]
    fn initialise_stages<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
    ) -> Result<(), OcpError> {
        let _ = ocp;
        Ok(())
    }

    /// Expands a step of states and controls to the stages.
    #[doc(hidden)]
    fn expand_stage_steps<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
        step: &Solution<T, D, M>,
    ) -> Result<(), OcpError> {
        let _ = (ocp, step);
        Ok(())
    }

    /// Applies an action to the stages.
    #[doc(hidden)]
    fn apply_stage_action(&mut self, action: StageAction<T>) {
        let _ = action;
    }
}

/// The parts of a problem that every program has.
#[doc(hidden)]
#[derive(Debug)]
pub struct ProgramParts<'a, T, D, M> {
    pub(in crate::ocp) qp: &'a mut Qp<T, D, M>,
    pub(in crate::ocp) iterate: &'a Solution<T, D, M>,
    /// Lower and upper bounds of the constraints of all stages, as the user gave them.
    pub(in crate::ocp) given: [&'a [T]; 2],
    /// Workspace for three vectors over the variables of a stage.
    pub(in crate::ocp) scratch: &'a mut [T],
}

/// Returns the length of the ends of all intervals.
pub(in crate::ocp) const fn intervals_end(dims: &[StageDims]) -> usize {
    let (mut length, mut rest) = (0_usize, dims);
    while let Some((_, others)) = rest.split_first() {
        if let Some(next) = others.first() {
            length = length.saturating_add(next.nx);
        }
        rest = others;
    }
    length
}

/// Returns the length of the ends of all intervals and the constraints of all stages.
pub(in crate::ocp) const fn ends(dims: &[StageDims]) -> usize {
    let (mut length, mut rest) = (intervals_end(dims), dims);
    while let Some((first, others)) = rest.split_first() {
        length = length.saturating_add(first.ng);
        rest = others;
    }
    length
}

impl<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Returns the name of a constraint of the QP.
    #[must_use]
    pub fn name(&self, field: QpField, stage: usize, index: usize, side: Side) -> ConstraintName {
        P::name(self, (field, stage, index), side)
    }

    /// Returns the constraint that makes a QP infeasible.
    #[must_use]
    pub fn infeasible(&self, error: &QpError) -> Option<ConstraintName> {
        match *error {
            QpError::Infeasible { field, stage, index, side, .. } => {
                Some(self.name(field, stage, index, side))
            }
            _ => None,
        }
    }

    /// Returns the first non-finite derivative in the QP.
    pub(in crate::ocp) fn non_finite_derivative(&self, error: &QpError) -> Option<OcpError> {
        P::derivative(self, error)
    }
}
