//! Contraction test of real-time iterations: residuals of the optimality conditions at the plan,
//! and the ratio of actual and predicted reductions of the merit function.

use crate::linalg::dot;
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::instance::data::split_data;
use crate::ocp::formulation::problem::Formulation;
use crate::qp::{Residuals, Solution, StageDims, add_symmetric_product, part, part_mut};
use crate::scalar::Real;

/// The test for divergence of real-time iterations.
///
/// ```text
/// ρ = Σ_j w_j ared_j / Σ_j w_j pred_j        w_j = (1 − 1/samples)^(k − j)
/// ared = φ(v̄) − φ(v)        pred = φ(v̄) − q(v)        φ = f + Σ_i |λ_i| |c_i|⁻        q: the QP
/// ```
///
/// `v̄` is the plan at which the problem was linearised, `v` the solution of its QP with the
/// multipliers `λ`, both with the state and the parameters of this sample. `φ` is the exact `l₁`
/// merit function, where `f` includes penalties of soft bounds; `q` is its value in the QP.
///
/// Contracting iterations have a ratio near one. Iterations that cycle around a solution reduce
/// nothing, whatever the QPs predict. Near a solution they diverge if the contraction rate `κ`, the
/// spectral radius of `I − H⁻¹∇²L` on the null space of active constraints, is above one.
/// Disturbances, noise and moving references lengthen steps, but do not change the ratio.
///
/// Source: J. Nocedal, S. J. Wright, *Numerical Optimization*, 2nd edition, (4.4) and section 18.5;
/// contraction: M. Diehl, H. G. Bock, J. P. Schlöder, SIAM J. Control Optim. 43, 2005.
///
/// ```
/// use casados::ocp::ContractionTest;
///
/// let test = ContractionTest::default();
/// assert_eq!((test.samples, test.min_ratio, test.tolerance), (5, 0.1, 1e-6));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContractionTest {
    /// The number of iterations in the mean of the ratio, and the number required for a verdict.
    /// Default 5.
    pub samples: usize,
    /// Iterations with a smaller ratio are [`Contraction::Diverging`]. Default 0.1.
    pub min_ratio: f64,
    /// Iterations with a smaller predicted reduction, relative to the merit function or to one, are
    /// ignored. Repeated iterations in one sample end at residuals up to this. Default 1e-6, in
    /// single precision 1e-3.
    pub tolerance: f64,
}

impl Default for ContractionTest {
    fn default() -> Self {
        Self::new::<f64>()
    }
}

impl ContractionTest {
    pub(in crate::ocp) const fn new<T: Real>() -> Self {
        let tolerance = if T::EPSILON < 1e-10 { 1e-6 } else { 1e-3 };
        Self { samples: 5, min_ratio: 0.1, tolerance }
    }
}

/// The verdict on the contraction of real-time iterations; see [`ContractionTest`].
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(20, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// let mut controller = HeapRealTime::new(ocp)?.monitored()?;
/// let convergence = controller.prepare()?.feedback(&[1.0])?.convergence.ok_or("monitored")?;
/// assert_eq!(convergence.contraction, Contraction::Unknown); // of one sample
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Contraction {
    /// Too few iterations predicted more than the tolerance.
    Unknown,
    /// Iterations achieve the reductions that their QPs predict, or no reduction is left.
    Contracting,
    /// Iterations do not achieve the reductions that their QPs predict. Exact Hessians
    /// ([`HeapRealTime::exact`](crate::ocp::HeapRealTime::exact)) may contract, or additional costs
    /// of the quantities that oscillate.
    Diverging,
}

/// The convergence of real-time iterations.
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(20, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// let mut controller = HeapRealTime::new(ocp)?.monitored()?;
/// controller.prepare()?.feedback(&[1.0])?;
/// let convergence = controller.prepare()?.feedback(&[1.0])?.convergence.ok_or("monitored")?;
/// // A linear-quadratic problem is solved in one iteration.
/// assert!(convergence.residuals.largest() < 1e-6 && convergence.step_size < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Convergence {
    /// The residuals of the optimality conditions at the plan that was linearised, with its own
    /// first state as the initial state, as in [`Sqp`](crate::ocp::Sqp).
    pub residuals: Residuals,
    /// The largest change of a state or control from this plan to the next one.
    pub step_size: f64,
    /// `ρ` of [`ContractionTest`] over the iterations before this one; one before the first
    /// verdict.
    pub reduction_ratio: f64,
    /// The verdict of the test.
    pub contraction: Contraction,
}

/// State of the contraction test. Its functions are pointers: a controller without a monitor
/// contains none of their code.
pub(in crate::ocp) struct ContractionMonitor<P, T, D, M> {
    /// Weights of the merit function, in place of multipliers.
    weights: Solution<T, D, M>,
    /// Ends of intervals and constraints.
    ends: M,
    /// Whether the last iteration has not been evaluated.
    has_pending_iteration: bool,
    /// The sums of actual and of predicted reductions, and the number of iterations.
    reduction_sums: [f64; 2],
    iteration_count: usize,
    residuals: Residuals,
    residuals_fn: fn(&mut Ocp<P, T, D, M>) -> Residuals,
    step_size_fn: StepSizeFn<P, T, D, M>,
    reductions_fn: ReductionsFn<P, T, D, M>,
}

/// The largest change from the plan to the solution of its QP.
type StepSizeFn<P, T, D, M> = fn(&Ocp<P, T, D, M>, &Solution<T, D, M>) -> f64;

/// The actual and the predicted reduction of the step from the plan to the solution of its QP, and
/// the value of the merit function.
type ReductionsFn<P, T, D, M> =
    fn(&mut Ocp<P, T, D, M>, &Solution<T, D, M>, &mut Solution<T, D, M>, &mut [T]) -> [f64; 3];

/// The lengths of the memory of a monitor: for weights, and for ends of intervals.
pub(in crate::ocp) const fn memory_lens<T: Real>(dims: &[StageDims]) -> [usize; 2] {
    [Solution::<T, (), ()>::memory(dims), crate::ocp::formulation::program::ends(dims)]
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>
    ContractionMonitor<P, T, D, M>
{
    /// Creates a monitor in memory of the lengths [`memory_lens`].
    pub fn new(weights: Solution<T, D, M>, ends: M) -> Self {
        Self {
            weights,
            ends,
            has_pending_iteration: false,
            reduction_sums: [0.0; 2],
            iteration_count: 0,
            residuals: Residuals::default(),
            residuals_fn: plan_residuals::<P, T, D, M>,
            step_size_fn: largest_step::<P, T, D, M>,
            reductions_fn: reductions_of_step::<P, T, D, M>,
        }
    }

    /// Computes the residuals at the linearised plan.
    pub fn update_residuals(&mut self, ocp: &mut Ocp<P, T, D, M>) {
        self.residuals = (self.residuals_fn)(ocp);
    }

    /// Returns the convergence after the QP of the plan, the iterate, has been solved.
    pub fn convergence_at_solution(
        &mut self,
        ocp: &Ocp<P, T, D, M>,
        solution: &Solution<T, D, M>,
        test: &ContractionTest,
    ) -> Convergence {
        self.has_pending_iteration = true;
        let [actual, predicted] = self.reduction_sums;
        let reduction_ratio = if predicted > 0.0 { actual / predicted } else { 1.0 };
        let contraction = if self.iteration_count < test.samples {
            Contraction::Unknown
        } else if reduction_ratio < test.min_ratio {
            Contraction::Diverging
        } else {
            Contraction::Contracting
        };
        let (residuals, step_size) = (self.residuals, (self.step_size_fn)(ocp, solution));
        Convergence { residuals, step_size, reduction_ratio, contraction }
    }

    /// Evaluates the last iteration, from the plan `before` to the iterate. The QP must still be
    /// that of `before`.
    pub fn update_reductions(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        before: &mut Solution<T, D, M>,
        test: &ContractionTest,
    ) {
        if !core::mem::take(&mut self.has_pending_iteration) {
            return;
        }
        core::mem::swap(&mut ocp.iterate, before);
        let [actual, predicted, merit] =
            (self.reductions_fn)(ocp, before, &mut self.weights, self.ends.as_mut());
        core::mem::swap(&mut ocp.iterate, before);
        if predicted > test.tolerance * merit.abs().max(1.0) {
            // Large increases of the merit function count as the negative predicted reduction, so
            // that they are forgotten equally fast; so do non-finite values.
            let actual = if actual > -predicted { actual } else { -predicted };
            let decay = 1.0 - 1.0 / test.samples.max(1) as f64;
            self.reduction_sums =
                [decay * self.reduction_sums[0] + actual, decay * self.reduction_sums[1] + predicted];
            self.iteration_count = self.iteration_count.saturating_add(1);
        } else if self.reduction_sums[1] <= predicted.abs() {
            // No reduction is left.
            self.reduction_sums = [0.0; 2];
        }
    }

    /// Resets the test.
    pub fn reset(&mut self) {
        (self.has_pending_iteration, self.reduction_sums, self.iteration_count) = (false, [0.0; 2], 0);
    }
}

/// The residuals at the plan, with its first state as the initial state.
fn plan_residuals<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    ocp: &mut Ocp<P, T, D, M>,
) -> Residuals {
    let Ocp { qp, iterate, .. } = &mut *ocp;
    if let (Some(mut stage), Some(first)) = (qp.stage_mut(0), iterate.stages().next()) {
        let bounds = stage.x_bounds_mut();
        crate::qp::copy_common(bounds.lower, first.x);
        crate::qp::copy_common(bounds.upper, first.x);
    }
    ocp.residuals().0
}

/// See [`StepSizeFn`].
fn largest_step<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    ocp: &Ocp<P, T, D, M>,
    solution: &Solution<T, D, M>,
) -> f64 {
    let pairs = ocp.iterate.variables_and_costates().0.iter().zip(solution.variables_and_costates().0);
    pairs.fold(T::ZERO, |size, (&v, &w)| size.max((w - v).abs())).to_f64()
}

/// See [`ReductionsFn`].
fn reductions_of_step<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    ocp: &mut Ocp<P, T, D, M>,
    solution: &Solution<T, D, M>,
    weights: &mut Solution<T, D, M>,
    ends: &mut [T],
) -> [f64; 3] {
    if P::Dynamics::LIFTED {
        return [0.0; 3];
    }
    weights.copy_from(solution);
    weights.multipliers_mut().iter_mut().for_each(|weight| *weight = weight.abs());
    let current = ocp.objective_and_violation(weights);
    let slope = ocp.objective_slope(solution, current.objective - ocp.objective.to_f64());
    let predicted = current.violation - slope - 0.5 * step_curvature(ocp, solution);
    ocp.algebraic_is_current = false;
    let merit = current.objective + current.violation;
    let actual = match ocp.objective_and_violation_at(solution, weights, ends) {
        Ok(trial) => merit - trial.objective - trial.violation,
        Err(_) => f64::NEG_INFINITY,
    };
    [actual, predicted, merit]
}

/// `dᵀ H d` of the step from the iterate to a solution of its QP.
fn step_curvature<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    ocp: &mut Ocp<P, T, D, M>,
    solution: &Solution<T, D, M>,
) -> f64 {
    let layout = ocp.layout();
    let data = split_data::<P, T>(ocp.data.as_mut(), layout);
    let ((from, _), (to, _)) = (ocp.iterate.variables_and_costates(), solution.variables_and_costates());
    let (mut curvature, mut begin) = (T::ZERO, 0);
    for stage in ocp.qp.view().stages() {
        let view = stage.arrays();
        let (v, w) = (part(from, begin, view.ld), part(to, begin, view.ld));
        begin += view.ld;
        let (step, rest) = data.scratch.split_at_mut_checked(view.ld).unwrap_or_default();
        let hessian_times_step = part_mut(rest, 0, view.ld);
        for ((d, &w), &v) in step.iter_mut().zip(w).zip(v) {
            *d = w - v;
        }
        hessian_times_step.fill(T::ZERO);
        add_symmetric_product(hessian_times_step, view.hessian, view.ld, step, view.n);
        curvature = curvature + dot(hessian_times_step, step);
    }
    curvature.to_f64()
}
