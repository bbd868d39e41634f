//! What a run remembers.

use super::barrier::Progress;
use super::direction::Regularisation;
use super::lengths::Lengths;
use crate::ocp::filter::Filter;
use crate::ocp::log::Iteration;

/// `γ_φ`
pub(super) const MARGIN: f64 = 1e-8;

/// What a run remembers from one iteration to the next.
pub(super) struct State<'c> {
    /// Whether the time is over.
    pub over: &'c mut dyn FnMut() -> bool,
    pub lengths: Lengths,
    /// The barrier parameter.
    pub mu: f64,
    /// What an adaptive one remembers.
    pub progress: Progress,
    pub filter: Filter,
    /// `θ_min`: below this violation the barrier function may decide.
    pub small_violation: f64,
    pub regularisation: Regularisation,
    /// `δ_w` of the step.
    pub delta: f64,
    /// The penalty, if bounds are soft.
    pub elastic: Option<f64>,
    /// The violation that the last penalty left.
    pub stationary_violation: f64,
    /// Iterations one after the other whose residuals are acceptable.
    pub acceptable: usize,
    /// Whether slacks and multipliers are those of the bounds as they are, hard or soft.
    pub has_slacks: bool,
    /// Whether the filter has the bound of violations that belongs to these slacks.
    pub has_filter: bool,
    /// The largest residual of the best iterate.
    pub best_residual: f64,
    /// That iterate.
    pub best_iteration: Iteration,
}
