//! The interface of a step with any number of stages.

use super::discontinuity::BranchChange;
use super::error_estimate::DefectFilter;
use super::newton_monitor::{FailureLocation, NewtonFailure, NewtonMonitor};
use crate::model::{ArrayK, ArrayV, ArrayX, Dae};
use crate::scalar::Real;
use alloc::vec::Vec;

/// The maximum number of stages.
pub(super) const MAX_STAGES: usize = 9;

/// The start of a step, and its tolerances.
pub struct StepContext<'a, M: Dae, T: Real> {
    /// The variables at the start of the step: a solution of the equations.
    pub start_point: &'a ArrayV<M, T>,
    /// Reciprocals of the estimator tolerances of `(x, z)`.
    pub estimator_scale: &'a ArrayK<M, T>,
    /// Ratios of the estimator tolerances and the user's tolerances.
    pub user_ratio: &'a ArrayK<M, T>,
    /// The largest of these ratios.
    pub tolerance_ratio: f64,
    /// Whether `ẋ` and `z` at the start are those of a stage of the preceding step.
    pub derivatives_are_known: bool,
    /// The length of the step.
    pub h: T,
}

/// The filtered defect of the states, and `(hJ)⁻²` times it.
pub type FilteredDefect<M, T> = [ArrayX<M, T>; 2];

/// A step with any number of stages.
pub trait StageSolver<M: Dae, T: Real> {
    /// The number of stages.
    fn stage_count(&self) -> usize;
    /// Factorises the Newton matrix; returns whether the planned pivots hold.
    ///
    /// # Errors
    /// The unknown without a pivot.
    fn factor(&mut self, jacobian: &M::Jacobian<T>, h: T) -> Result<bool, usize>;
    /// The equation and unknown that prevented convergence, with the terms of each equation at the
    /// start of the step.
    fn failure_location(&self, start: &StepContext<'_, M, T>, jacobian: &M::Jacobian<T>) -> FailureLocation;
    /// Sets whether later matrices are factorised as a whole with pivoting.
    fn set_pivoted(&mut self, pivoted: bool);
    /// Whether the planned factors solve a test system accurately; pivoted factors are always
    /// accepted.
    fn are_factors_accurate(&self, start: &StepContext<'_, M, T>) -> bool;
    /// Sets the initial guess of all stages to `ẋ` and `z` at the start of the step.
    fn begin_from_start(&mut self, point: &ArrayV<M, T>);
    /// Sets the initial guess to the extrapolated polynomial of the last accepted step; `ratio` is
    /// the ratio of the step sizes.
    fn extrapolate_last_step(&mut self, ratio: f64);
    /// Predicts the variables in the middle of the step from the initial guess.
    fn predict_midpoint(&self, start: &StepContext<'_, M, T>, middle: &mut ArrayV<M, T>);
    /// Converts the last accepted step of another method.
    fn adopt_last_step(&mut self, other: &dyn StageSolver<M, T>);
    /// Solves the stages.
    ///
    /// # Errors
    /// [`NewtonFailure`]
    fn solve(
        &mut self,
        start: &StepContext<'_, M, T>,
        tolerance: f64,
        convergence: &mut NewtonMonitor,
        residuals: &mut usize,
    ) -> Result<(), NewtonFailure>;
    /// The estimated error relative to the estimator tolerance; with `again` a large one is
    /// evaluated a second time, at the corrected point.
    ///
    /// # Errors
    /// [`NewtonFailure::NotFinite`]
    fn estimate_error(
        &mut self,
        start: &StepContext<'_, M, T>,
        reevaluate_large_error: bool,
        residuals: &mut usize,
    ) -> Result<f64, NewtonFailure>;
    /// The largest defect at further points of a step in which the model changes its branch,
    /// relative to the estimator tolerance.
    ///
    /// # Errors
    /// [`NewtonFailure::NotFinite`]
    fn largest_defect(
        &mut self,
        start: &StepContext<'_, M, T>,
        residuals: &mut usize,
    ) -> Result<f64, NewtonFailure>;
    /// The strongest change of branches within the step.
    fn branch_change(&mut self, start: &StepContext<'_, M, T>) -> Option<BranchChange>;
    /// Writes the variables at the point of the defect; returns whether it is the end of the step,
    /// not the start.
    fn estimate_point(&self, start: &StepContext<'_, M, T>, point: &mut ArrayV<M, T>) -> bool;
    /// Replaces a residual at that point by the estimated error of `(x, z)`.
    fn filter_residual(&mut self, h: T, residual: &mut ArrayK<M, T>);
    /// The last residual, filtered for a step of length `h`: see [`DefectFilter`].
    fn filtered_defect(&self, h: T) -> FilteredDefect<M, T>;
    /// The filter and weights of the second estimate.
    fn defect_filter(&self) -> &DefectFilter;
    /// Appends the unknowns of the last solved step to a list, stages innermost.
    fn append_unknowns(&self, to: &mut Vec<T>);
    /// Writes the variables at the end of a step of length `h`; returns whether `ẋ` and `z` there
    /// are those of a stage, not extrapolated.
    fn end_point(&self, h: T, point: &mut ArrayV<M, T>) -> bool;
    /// Makes the solved step the accepted one.
    fn accept_step(&mut self);
    /// The unknowns `(k, z)` of the accepted step, stages innermost.
    fn accepted_unknowns(&self) -> &[T];
    /// The Lagrange polynomials of the nodes at `theta`.
    fn lagrange(&self, theta: f64) -> [f64; MAX_STAGES];
    /// Their integrals from zero to `theta`.
    fn weights(&self, theta: f64) -> [f64; MAX_STAGES];
}
