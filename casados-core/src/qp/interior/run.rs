//! The iterations of the interior point.

use super::iterate::Iterate;
use super::limits::ResidualTolerances;
use super::options::InteriorPointOptions;
use super::riccati::InitialStateKind;
use super::sides::PenaltyMode;
use super::terms::Terms;
use super::vector::{dot, largest_size};
use crate::qp::element::set;
use crate::qp::error::QpError;
use crate::qp::layout::{StageOffsetsIter, copy_common, part, part_mut};
use crate::qp::solution::SolutionView;
use crate::qp::solver::QpStart;
use crate::qp::statistics::{QpStatistics, nan_max};
use crate::scalar::{Packed, Real, Registers, compiled};

/// The settings of an attempt.
#[derive(Clone, Copy)]
pub struct Attempt {
    pub penalties: PenaltyMode,
    pub start: QpStart,
    /// Whether steps have proximal terms, for singular Hessians.
    pub proximal: bool,
    /// The statistics of earlier attempts.
    pub statistics: QpStatistics,
    /// The iteration count at which it ends.
    pub iterations: usize,
    /// Whether it ends if its multipliers are nearly a certificate of infeasibility.
    pub suspects: bool,
}

impl Attempt {
    /// Returns whether this is the first attempt.
    fn is_first(&self) -> bool {
        self.penalties == PenaltyMode::Given && !self.proximal && self.statistics.iterations == 0
    }
}

/// A run of the method.
pub struct Run<'r, 'a, 's, T> {
    pub iterate: &'r mut Iterate<'a, T>,
    pub options: &'r InteriorPointOptions,
    pub limits: ResidualTolerances<T>,
    /// Returns whether the time limit is reached.
    pub over: &'r mut dyn FnMut() -> bool,
    pub attempt: Attempt,
    pub solution: &'r mut SolutionView<'s, T>,
    pub result: &'r mut Result<QpStatistics, QpError>,
    /// Whether the multipliers are a certificate of infeasibility; with the objective, whether they
    /// nearly are.
    pub infeasible: &'r mut bool,
}

compiled! {
    /// See [`Run`].
    pub Runs: Run<'r, 'a, 's, T>
}

impl<T: Real> Registers<T> for Run<'_, '_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let Self { iterate, options, limits, over, mut attempt, solution, result, infeasible } = self;
        let warm = [&*solution.v, solution.lower, solution.upper];
        if attempt.start == QpStart::Warm && !warm.iter().all(|all| dot::<T, E>(all, all).is_finite()) {
            attempt.start = QpStart::Cold;
        }
        let tries = match attempt.start {
            QpStart::Warm => options.active_sets,
            // This is the solution if no bound is active.
            QpStart::Cold if attempt.is_first() => options.active_sets.min(1),
            QpStart::Cold => 0,
        };
        let tries = tries.min(attempt.iterations);
        if attempt.start == QpStart::Cold && tries > 0 {
            for zero in [&mut *solution.v, &mut *solution.lower, &mut *solution.upper] {
                zero.fill(T::ZERO);
            }
        }
        // A closure would be compiled for the baseline instruction set.
        *result = match iterate.by_active_sets::<E>((attempt.start, tries), &limits, over, solution) {
            Ok(statistics) => Ok(statistics),
            Err(statistics) => {
                if tries > 0 {
                    attempt.statistics = statistics;
                }
                if attempt.start == QpStart::Cold {
                    iterate.reset();
                }
                iterate.initialise::<E>(options, &attempt, &limits, solution);
                iterate.iterate_to_convergence::<E>(&attempt, &limits, over, solution, infeasible)
            }
        };
        if attempt.penalties == PenaltyMode::Hard {
            *infeasible = iterate.proves_infeasibility::<E>(solution.dynamics);
        }
        iterate.store(solution);
    }
}

/// The smallest accepted step length of the corrector.
const MIN_CORRECTOR_STEP: f64 = 0.3;

/// The terms of the residuals are evaluated again if `μ` has decreased by this factor.
const TERMS_UPDATE_RATIO: f64 = 0.01;

/// An iteration makes progress if it decreases the residuals by this factor; the maximum number of
/// iterations without progress.
const PROGRESS_RATIO: f64 = 0.9;
const MAX_IDLE_ITERATIONS: usize = 50;
/// The number of iterations without progress after which the correctors are assumed to cycle.
const CYCLE: usize = 8;

/// Slacks and multipliers keep at least this fraction of their values, or, near the solution, the
/// fraction `μ`.
const MAX_BOUNDARY_FRACTION: f64 = 0.005;

impl<T: Real> Iterate<'_, T> {
    /// Reads states and controls of a solution.
    pub fn load_point(&mut self, solution: &SolutionView<'_, T>) {
        for place in StageOffsetsIter::<T>::new(self.qp.dims) {
            copy_common(part_mut(self.v, place.row, place.n), part(solution.v, place.v, place.n));
        }
    }

    /// Sets the point and the multipliers to zero.
    fn reset(&mut self) {
        self.v.fill(T::ZERO);
        self.inequalities.multiplier.fill(T::ZERO);
        self.inequalities.equation_multipliers.fill(T::ZERO);
    }

    /// Writes the fixed initial state.
    pub fn load_initial_state(&mut self) {
        if let (InitialStateKind::Fixed, Some(stage)) = (self.first, self.qp.stage(0)) {
            let x0 = stage.x_bounds().lower;
            copy_common(part_mut(self.v, 0, x0.len()), x0);
        }
    }

    #[inline(always)]
    fn initialise<E: Packed<T>>(
        &mut self,
        options: &InteriorPointOptions,
        attempt: &Attempt,
        limits: &ResidualTolerances<T>,
        solution: &mut SolutionView<'_, T>,
    ) {
        let start = attempt.start;
        if start == QpStart::Warm {
            self.load_point(solution);
        }
        self.load_initial_state();
        self.evaluate_values::<E>();
        let cold = T::from_f64(options.start_mu).sqrt();
        let gap = self.gaps::<E>(self.measure).max(self.inequalities.violation(self.measure));
        let warm = gap.max(T::from_f64(options.warm_distance));
        let distance = match start {
            // Slacks and multipliers of a point with large violations are less reliable.
            QpStart::Warm if warm < cold => warm,
            // Slacks that are small compared with violations cause short steps.
            QpStart::Cold if attempt.proximal => gap.max(cold),
            _ => cold,
        };
        self.inequalities.initialise(start, distance, self.measure, solution);
        // Residuals depend on the slacks, which are set now.
        self.evaluate_side_residuals::<E>();
        self.first_gradient::<E>(limits, solution.dynamics);
        self.set_regularisation(attempt.proximal);
    }

    /// Evaluates the gradient before the first step. The open-loop recursion of the multipliers
    /// `π`, without factors yet, may grow so much that its rounding errors exceed the tolerance of
    /// the gradient; then `π` is set to zero. No step depends on `π`.
    #[inline(always)]
    pub fn first_gradient<E: Packed<T>>(&mut self, limits: &ResidualTolerances<T>, multipliers: &mut [T]) {
        self.evaluate_gradient::<E>(multipliers);
        let rounding = T::from_f64(T::EPSILON) * self.terms.gradient_terms;
        // NaN counts as large.
        let is_seen = rounding <= limits.of(self.terms).gradient_terms;
        if !is_seen {
            multipliers.fill(T::ZERO);
            self.gradient_with_costates::<E>(multipliers);
        }
    }

    #[inline(always)]
    fn iterate_to_convergence<E: Packed<T>>(
        &mut self,
        attempt: &Attempt,
        limits: &ResidualTolerances<T>,
        over: &mut dyn FnMut() -> bool,
        solution: &mut SolutionView<'_, T>,
        suspected: &mut bool,
    ) -> Result<QpStatistics, QpError> {
        let mut out_of_time = false;
        let Attempt { mut statistics, iterations: most, .. } = *attempt;
        let known_refinements = statistics.refinements;
        let (mut short, mut refine, mut share) = (0, false, T::from_f64(0.01));
        let mut known = self.mu;
        let (mut best, mut idle) = (T::from_f64(f64::INFINITY), 0);
        let first = (statistics.iterations, self.terms.gradient_terms.max(T::ONE));
        let stalled = loop {
            let mut residuals = self.residuals::<E>();
            let small = limits.satisfied_by(residuals, self.terms);
            // Terms change with the iterates.
            let old = limits.relative > T::ZERO && self.mu < T::from_f64(TERMS_UPDATE_RATIO) * known;
            if small || old {
                // The updated residuals are small: evaluate them at the point.
                let objective = self.evaluate::<E>(solution.dynamics);
                (residuals, known) = (self.evaluated_residuals::<E>(), self.mu);
                if objective.is_finite() && self.is_converged(residuals, limits) {
                    (statistics.objective, statistics.residuals) =
                        (objective.to_f64(), self.unscaled_residuals(residuals));
                    return Ok(statistics);
                }
                let Terms { gradient_terms: forces, condition_terms: values } = limits.of(self.terms);
                let apart = residuals.inequalities > values || residuals.complementarity > forces;
                if limits.satisfied_by(residuals, self.terms) {
                    // The residuals are small in units, but not without units relative to their
                    // terms.
                    share = share * T::from_f64(0.01);
                } else if small && apart {
                    // At the kink of a penalty multipliers have errors of the square root of their
                    // products.
                    share = share * T::from_f64(0.01);
                } else if small && statistics.refinements > known_refinements + 3 {
                    break true;
                } else {
                    // Multipliers and slacks have converged: the next step corrects the other
                    // residuals only.
                    refine = small;
                    statistics.refinements += usize::from(small);
                }
            }
            // Products far below the tolerance have no benefit, and cause weights that cancel the
            // digits of all other terms.
            let floor = share * limits.of(self.terms).gradient_terms * self.measure.objective;
            out_of_time = over();
            if out_of_time || statistics.iterations >= most {
                break false;
            }
            if attempt.suspects {
                let (done, judged) = (statistics.iterations - first.0, (residuals, limits));
                if self.suspects_infeasibility::<E>(done, first.1, judged, solution.dynamics) {
                    *suspected = true;
                    break true;
                }
            }
            // NaN makes no progress.
            let residual =
                nan_max(residuals.stationarity, nan_max(residuals.dynamics, residuals.inequalities));
            let residual = residual + self.mu / self.measure.objective;
            if residual < T::from_f64(PROGRESS_RATIO) * best {
                (best, idle) = (residual, 0);
            } else if idle > MAX_IDLE_ITERATIONS {
                break true;
            }
            idle += 1;
            self.inequalities.centring_targets(if refine { self.mu.max(floor) } else { T::ZERO });
            self.newton::<E>(true)?;
            statistics.factorisations += 1;
            statistics.regularised += self.riccati.regularised;
            let alpha = self.corrector_step::<E>(refine, floor, idle > CYCLE)?;
            statistics.iterations += 1;
            short = if alpha < T::from_f64(1e-3) { short + 1 } else { 0 };
            if !(alpha > T::ZERO && largest_size::<T, E>(self.step).is_finite()) || short > 4 {
                break true;
            }
            self.take_step::<E>(alpha);
            refine = false;
        };
        self.final_status::<E>(statistics, limits, [out_of_time, stalled], solution)
    }

    /// Adds Mehrotra's corrector to the step, for the second-order terms of the products, and
    /// returns the step length to the boundary.
    ///
    /// # Errors
    /// [`QpError::NotConvex`]
    #[inline(always)]
    fn corrector_step<E: Packed<T>>(
        &mut self,
        refine: bool,
        floor: T,
        is_cycling: bool,
    ) -> Result<T, QpError> {
        let (least, boundary) = (T::from_f64(T::EPSILON).sqrt(), T::from_f64(MAX_BOUNDARY_FRACTION));
        let distance = (self.mu / self.measure.objective).max(least);
        let keep = if distance < boundary { distance } else { boundary };
        let mut alpha = self.inequalities.step_to_boundary::<E>(keep);
        let has_products = self.mu > T::ZERO;
        if refine || !has_products {
            return Ok(alpha);
        }
        let after = self.inequalities.mu_after::<E>(alpha, self.mu);
        let ratio = after / self.mu;
        self.inequalities.corrector_targets((self.mu * ratio * ratio * ratio).max(floor));
        self.newton::<E>(false)?;
        alpha = self.inequalities.step_to_boundary::<E>(keep);
        if alpha < T::from_f64(MIN_CORRECTOR_STEP) || is_cycling {
            // The products differ too much for the corrector: a centring step makes them equal
            // first.
            self.inequalities.centring_targets(self.mu * T::from_f64(MIN_CORRECTOR_STEP));
            self.newton::<E>(false)?;
            alpha = self.inequalities.step_to_boundary::<E>(keep);
        }
        Ok(alpha)
    }

    /// Returns the status at the final point, after evaluating its residuals and the multipliers
    /// `π`.
    #[inline(always)]
    fn final_status<E: Packed<T>>(
        &mut self,
        mut statistics: QpStatistics,
        limits: &ResidualTolerances<T>,
        [out_of_time, stalled]: [bool; 2],
        solution: &mut SolutionView<'_, T>,
    ) -> Result<QpStatistics, QpError> {
        let objective = self.evaluate::<E>(solution.dynamics);
        let (judged, iterations) = (self.evaluated_residuals::<E>(), statistics.iterations);
        let residuals = self.unscaled_residuals(judged);
        let is_solved = self.is_converged(judged, limits) || self.is_converged_unscaled(limits);
        if objective.is_finite() && is_solved {
            (statistics.objective, statistics.residuals) = (objective.to_f64(), residuals);
            return Ok(statistics);
        }
        Err(if out_of_time {
            QpError::OutOfTime { iterations, residuals }
        } else if stalled {
            QpError::Stalled { iterations, residuals }
        } else {
            QpError::MaxIterations { iterations, residuals }
        })
    }

    /// Writes the point and its multipliers.
    pub fn store(&mut self, solution: &mut SolutionView<'_, T>) {
        for place in StageOffsetsIter::<T>::new(self.qp.dims) {
            copy_common(part_mut(solution.v, place.v, place.n), part(self.v, place.row, place.n));
        }
        solution.lower.fill(T::ZERO);
        solution.upper.fill(T::ZERO);
        let sides = &self.inequalities;
        for (i, (&row, &multiplier)) in sides.rows.iter().zip(&*sides.multiplier).enumerate() {
            let side = if i < sides.counts.lower { &mut *solution.lower } else { &mut *solution.upper };
            set(side, row as usize, multiplier);
        }
        let mut equation = |row: usize, force: T| {
            set(solution.lower, row, force.max(T::ZERO));
            set(solution.upper, row, (-force).max(T::ZERO));
        };
        for (&row, &free) in sides.equations.iter().zip(&*sides.equation_multipliers) {
            equation(row as usize, free);
        }
        if self.first == InitialStateKind::Fixed {
            for (row, &force) in self.initial.iter().enumerate() {
                equation(row, force);
            }
        }
    }
}
