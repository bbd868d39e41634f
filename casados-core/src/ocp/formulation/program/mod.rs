//! What solvers ask of a problem: the QP at its iterate, values at other points, and names.
//!
//! One horizon answers by its functions, phases by the horizons that they consist of.

pub(in crate::ocp) mod curvature;

use crate::ocp::formulation::error::{ConstraintName, OcpError};
use crate::ocp::formulation::functions::dynamics::StageAction;
use crate::ocp::formulation::instance::Ocp;
use crate::qp::{Qp, QpError, QpField, Side, Solution, StageDims};
use crate::scalar::Real;
use core::ops::Range;
use curvature::Curvature;

/// What [`Sqp`](crate::ocp::Sqp) and [`Ipm`](crate::ocp::Ipm) solve: a nonlinear program whose QP
/// has the stages of optimal control.
///
/// A [`Problem`](crate::ocp::Problem) is one, and so are `Phases` of several of them. Whoever is
/// generic over problems asks for [`Formulation`](crate::ocp::Formulation), of which every one is a
/// program.
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
    /// What a [`Curvature`] is of.
    type Dynamics;
    /// Whether stages of intervals are variables.
    #[doc(hidden)]
    const LIFTED: bool = false;

    /// Writes the QP at the iterate, and its objective.
    #[doc(hidden)]
    fn linearise<C: Curvature<Self::Dynamics, T>, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
        curvature: C,
    ) -> Result<(), OcpError>;

    /// The same with first derivatives, where the Hessian does not matter.
    #[doc(hidden)]
    fn slopes<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
    ) -> Result<(), OcpError>;

    /// The objective at some point, without penalties; in `ends` the ends of all intervals, then
    /// the constraints of all stages.
    #[doc(hidden)]
    fn evaluate<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
        trial_point: &Solution<T, D, M>,
        ends: &mut [T],
    ) -> Result<T, OcpError>;

    /// The parts of a problem that are there for each of its kind.
    #[doc(hidden)]
    fn split<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
    ) -> ProgramParts<'_, T, D, M>;

    /// Ranges of stages whose variables are the same, of so many stages.
    #[doc(hidden)]
    fn spans(&self, stages: usize) -> impl Iterator<Item = Range<usize>>;

    /// A constraint of the QP by its name.
    #[doc(hidden)]
    fn name<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &Ocp<Self, T, D, M>,
        place: (QpField, usize, usize),
        side: Side,
    ) -> ConstraintName;

    /// The derivative that makes a QP one without values.
    #[doc(hidden)]
    fn derivative<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &Ocp<Self, T, D, M>,
        error: &QpError,
    ) -> Option<OcpError>;

    /// What there is to say of a run that ends: whether the problem is known to be convex, and the
    /// bound that is violated most, if somebody `asks` for it.
    #[doc(hidden)]
    fn complete<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
        needs_violation: bool,
    ) -> (bool, Option<(ConstraintName, f64)>);

    /// Stages that are variables begin anew, at the iterate.
    #[doc(hidden)]
    fn initialise_stages<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
    ) -> Result<(), OcpError> {
        let _ = ocp;
        Ok(())
    }

    /// Their step, of one of states and controls.
    #[doc(hidden)]
    fn expand_stage_steps<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        ocp: &mut Ocp<Self, T, D, M>,
        step: &Solution<T, D, M>,
    ) -> Result<(), OcpError> {
        let _ = (ocp, step);
        Ok(())
    }

    /// What happens to them.
    #[doc(hidden)]
    fn apply_stage_action(&mut self, action: StageAction<T>) {
        let _ = action;
    }
}

/// What there is of a problem, whatever it is.
#[doc(hidden)]
#[derive(Debug)]
pub struct ProgramParts<'a, T, D, M> {
    pub(in crate::ocp) qp: &'a mut Qp<T, D, M>,
    pub(in crate::ocp) iterate: &'a Solution<T, D, M>,
    /// Lower and upper bounds of the constraints of all stages, as they were given.
    pub(in crate::ocp) given: [&'a [T]; 2],
    /// Room for three vectors over the variables of a stage.
    pub(in crate::ocp) scratch: &'a mut [T],
}

/// How many numbers the ends of all intervals are.
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

/// How many numbers the ends of all intervals and the constraints of all stages are.
pub(in crate::ocp) const fn ends(dims: &[StageDims]) -> usize {
    let (mut length, mut rest) = (intervals_end(dims), dims);
    while let Some((first, others)) = rest.split_first() {
        length = length.saturating_add(first.ng);
        rest = others;
    }
    length
}

impl<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// A constraint of the QP by its name in the problem.
    #[must_use]
    pub fn name(&self, field: QpField, stage: usize, index: usize, side: Side) -> ConstraintName {
        P::name(self, (field, stage, index), side)
    }

    /// The constraint that makes a QP infeasible.
    #[must_use]
    pub fn infeasible(&self, error: &QpError) -> Option<ConstraintName> {
        match *error {
            QpError::Infeasible { field, stage, index, side, .. } => {
                Some(self.name(field, stage, index, side))
            }
            _ => None,
        }
    }

    /// The derivative that makes a QP one without values.
    pub(in crate::ocp) fn non_finite_derivative(&self, error: &QpError) -> Option<OcpError> {
        P::derivative(self, error)
    }
}
