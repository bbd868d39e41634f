//! What a run asks of a step with any number of stages.

use super::discontinuity::BranchChange;
use super::error_estimate::DefectFilter;
use super::newton_monitor::{FailureLocation, NewtonFailure, NewtonMonitor};
use crate::model::{ArrayK, ArrayV, ArrayX, Dae};
use crate::scalar::Real;
use alloc::vec::Vec;

/// The most stages.
pub(super) const MAX_STAGES: usize = 9;

/// Where a step begins and what it is measured by.
pub struct StepContext<'a, M: Dae, T: Real> {
    /// The variables at its start: a solution of the equations.
    pub start_point: &'a ArrayV<M, T>,
    /// Reciprocals of the tolerated errors of `(x, z)`, as the estimate of lower order needs them,
    pub estimator_scale: &'a ArrayK<M, T>,
    /// and how many times as large those of the tolerances are that were asked for.
    pub user_ratio: &'a ArrayK<M, T>,
    /// The largest of these factors.
    pub tolerance_ratio: f64,
    /// Whether `ẋ` and `z` there are those of a stage of the step before.
    pub derivatives_are_known: bool,
    /// Its length.
    pub h: T,
}

/// An error of the states, and `(hJ)⁻²` times it.
pub type FilteredDefect<M, T> = [ArrayX<M, T>; 2];

/// A step with any number of stages.
pub trait StageSolver<M: Dae, T: Real> {
    /// How many.
    fn stage_count(&self) -> usize;
    /// Factors of the Newton matrix; whether those of the plan hold.
    ///
    /// # Errors
    /// The unknown for which there is no pivot.
    fn factor(&mut self, jacobian: &M::Jacobian<T>, h: T) -> Result<bool, usize>;
    /// What kept the last iteration from converging, with the terms of each equation at the start
    /// of the step.
    fn failure_location(&self, start: &StepContext<'_, M, T>, jacobian: &M::Jacobian<T>) -> FailureLocation;
    /// From now on, whether every matrix is to be pivoted as a whole.
    fn set_pivoted(&mut self, pivoted: bool);
    /// Whether planned factors solve the systems that they are of; pivoted ones are as good as can
    /// be.
    fn are_factors_accurate(&self, start: &StepContext<'_, M, T>) -> bool;
    /// Starts from the same `ẋ` and `z` at all stages, those of the start of the step.
    fn begin_from_start(&mut self, point: &ArrayV<M, T>);
    /// Starts from the polynomial of the last accepted step, whose size is given relative to this
    /// one.
    fn extrapolate_last_step(&mut self, ratio: f64);
    /// The variables in the middle of the step from its start values.
    fn predict_midpoint(&self, start: &StepContext<'_, M, T>, middle: &mut ArrayV<M, T>);
    /// Takes over the last accepted step of another method.
    fn adopt_last_step(&mut self, other: &dyn StageSolver<M, T>);
    /// Solves the stages.
    ///
    /// # Errors
    /// [`Failure`]
    fn solve(
        &mut self,
        start: &StepContext<'_, M, T>,
        tolerance: f64,
        convergence: &mut NewtonMonitor,
        residuals: &mut usize,
    ) -> Result<(), NewtonFailure>;
    /// The estimated error relative to what is tolerated; `again` if a second, more careful look is
    /// to decide whether a large one is real.
    ///
    /// # Errors
    /// [`Failure::NotFinite`]
    fn estimate_error(
        &mut self,
        start: &StepContext<'_, M, T>,
        again: bool,
        residuals: &mut usize,
    ) -> Result<f64, NewtonFailure>;
    /// The largest defect at further points of a step in which the model changes its branch,
    /// relative to what the estimate tolerates.
    ///
    /// # Errors
    /// [`Failure::NotFinite`]
    fn largest_defect(
        &mut self,
        start: &StepContext<'_, M, T>,
        residuals: &mut usize,
    ) -> Result<f64, NewtonFailure>;
    /// How the model inside of the step is not that of its start.
    fn branch_change(&mut self, start: &StepContext<'_, M, T>) -> Option<BranchChange>;
    /// The variables where the estimate compares the derivative of the polynomial with the
    /// solution; whether that is the end of the step, and not its start.
    fn estimate_point(&self, start: &StepContext<'_, M, T>, point: &mut ArrayV<M, T>) -> bool;
    /// From a residual there to the estimated error of `(x, z)`, in its place.
    fn filter_residual(&mut self, h: T, residual: &mut ArrayK<M, T>);
    /// What a step of length `h` makes of the residual that was filtered last: see
    /// [`DefectFilter`].
    fn filtered_defect(&self, h: T) -> FilteredDefect<M, T>;
    /// How the size of the filtered defect is judged.
    fn defect_filter(&self) -> &DefectFilter;
    /// The unknowns of the step that was solved last, stages innermost, at the end of a list.
    fn append_unknowns(&self, to: &mut Vec<T>);
    /// The variables at the end of a step of length `h`; whether `ẋ` and `z` there are those of a
    /// stage: else they are extrapolated.
    fn end_point(&self, h: T, point: &mut ArrayV<M, T>) -> bool;
    /// The step is accepted.
    fn accept_step(&mut self);
    /// The unknowns `(k, z)` of the accepted step, stages innermost.
    fn accepted_unknowns(&self) -> &[T];
    /// The Lagrange polynomials of the nodes at `theta`.
    fn lagrange(&self, theta: f64) -> [f64; MAX_STAGES];
    /// Their integrals from zero to `theta`.
    fn weights(&self, theta: f64) -> [f64; MAX_STAGES];
}
