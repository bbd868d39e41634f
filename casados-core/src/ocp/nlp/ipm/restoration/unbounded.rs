//! Test for unboundedness: a recession direction, a ray of feasible points along which the
//! objective decreases without bound.
//!
//! ```text
//! v(α) = v + α d        f(v(α)) falls with α,  no distance to a bound shrinks by more than ε α ‖d‖
//! ```
//!
//! `d` is the Newton step where variables are very large, in the units of rows. The test evaluates
//! the objective of the problem, not its quadratic model. A distance from a bound that decreases in
//! proportion to `α` ends the ray, however large it is. With nonlinear dynamics the states are
//! simulated with the controls of the point on the ray.

use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::nlp::ipm::Ipm;
use crate::ocp::nlp::ipm::kkt::newton::kkt_view;
use crate::ocp::nlp::ipm::kkt::workspace::Workspace;
use crate::ocp::nlp::ipm::line_search::LineSearch;
use crate::ocp::nlp::ipm::run_state::RunState;
use crate::qp::element::set;
use crate::qp::interior::at;
use crate::qp::{StageDims, StageOffsetsIter, Store, part};
use crate::scalar::{Real, Scalar};

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// Whether variables are very large, and the step is a recession direction.
    pub(in crate::ocp::nlp::ipm) fn is_unbounded<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_>,
    ) -> bool {
        let (v, _) = ocp.iterate.variables_and_costates();
        let diverges = v.iter().any(|v| v.abs().to_f64() > state.diverging_iterates_tol);
        if !diverges || state.elastic_penalty.is_some() || state.dimensions.in_restoration {
            return false;
        }
        state.diverging_iterates_tol *= self.options.advanced.unbounded.ray_retry_growth;
        let lengths = state.dimensions;
        let tolerance = self.options.tolerance.max(T::EPSILON);
        let Self {
            trial_point: trial,
            kkt_numbers: numbers,
            kkt_indices: indices,
            workspace: work,
            options,
            ..
        } = self;
        let mut work = Workspace::new(ocp.ends(), &state.max_dimensions, work.as_mut());
        let mut ray = LineSearch {
            dimensions: &lengths,
            kkt_numbers: numbers,
            kkt_indices: indices,
            trial_point: trial,
            workspace: &mut work,
            options: &options.advanced,
        };
        let unbounded = ray.is_recession_direction(ocp, tolerance);
        ocp.step_length = Some(T::ZERO);
        unbounded
    }
}

impl<T, D, M, N, I> LineSearch<'_, '_, T, D, M, N, I>
where
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
    N: Store<T>,
    I: Store<u32>,
{
    /// Whether the objective decreases along the ray of the step, and no constraint ends the ray.
    fn is_recession_direction<P: Program<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>, tolerance: f64) -> bool {
        let objective_unit = self.dimensions.scaling.objective_unit;
        let Some([size, step]) = self.variable_and_step_sizes(ocp) else { return false };
        let Some(mut last_objective) = self.objective_on_ray(ocp, 0.0, tolerance * size) else {
            return false;
        };
        let (mut accepted_points, options) = (0, self.options.unbounded);
        for point in 0..options.ray_points {
            let length = Scalar::powf(options.ray_length_ratio, point as f64);
            let Some(objective) = self.objective_on_ray(ocp, length * size / step, tolerance) else {
                return false;
            };
            if !objective.is_finite() {
                break;
            }
            let decreases = last_objective - objective > tolerance * objective_unit.max(last_objective.abs());
            if !decreases {
                return false;
            }
            (last_objective, accepted_points) = (objective, accepted_points + 1);
        }
        accepted_points > 0
    }

    /// The largest variable and the largest step, in units; `None` if one is zero.
    fn variable_and_step_sizes<P: Program<T>>(&mut self, ocp: &Ocp<P, T, D, M>) -> Option<[f64; 2]> {
        let iterate = kkt_view(ocp.qp.view(), self.dimensions, self.kkt_numbers, self.kkt_indices).ok()?;
        let sizes = [&*iterate.v, &*iterate.step].map(|numbers| {
            StageOffsetsIter::<T>::new(iterate.qp.dims).fold(0.0, |largest: f64, place| {
                let own = part(numbers, place.row, place.n).iter();
                let units = part(self.workspace.units, place.row, place.n);
                own.zip(units).fold(largest, |m, (&v, &unit)| m.max((v / unit).abs().to_f64()))
            })
        });
        sizes.iter().all(|size| size.is_normal()).then_some(sizes)
    }

    /// Returns the objective at a point of the ray, with the penalties of soft bounds: `None` if a
    /// constraint ends the ray, NaN if a function is not finite. Violations may be `tolerance`
    /// times the distance of the point from the iterate, and `tolerance` at the iterate, where the
    /// distances from the bounds are stored.
    fn objective_on_ray<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        alpha: f64,
        tolerance: f64,
    ) -> Option<f64> {
        self.write_trial_point(ocp, T::from_f64(alpha))?;
        let mut objective = ocp
            .row_values_at(self.trial_point, self.workspace.interval_ends, self.workspace.row_values)
            .unwrap_or(f64::NAN);
        let mut gaps = ocp.gap_sum_at(self.trial_point, self.workspace.interval_ends, self.workspace.units);
        if ocp.problem.is_lifted() {
            gaps += ocp.stage_residuals[0].to_f64();
        } else if gaps > self.violation_limit(ocp, alpha, tolerance) {
            // Simulates the states with the controls.
            if !ocp.close_gaps_by_simulation(
                self.trial_point,
                self.workspace.interval_ends,
                self.workspace.units,
                f64::INFINITY,
            ) {
                return Some(f64::NAN);
            }
            objective = ocp
                .row_values_at(self.trial_point, self.workspace.interval_ends, self.workspace.row_values)
                .unwrap_or(f64::NAN);
            gaps = 0.0;
        }
        if !objective.is_finite() {
            return Some(f64::NAN);
        }
        let (violation, penalties) = self.distance_decrease_and_penalties(ocp, alpha == 0.0)?;
        let limit = self.violation_limit(ocp, alpha, tolerance);
        (gaps + violation <= limit).then_some(objective + penalties)
    }

    /// The largest acceptable violation of the trial point.
    fn violation_limit<P: Program<T>>(&self, ocp: &Ocp<P, T, D, M>, alpha: f64, tolerance: f64) -> f64 {
        if alpha == 0.0 {
            return tolerance;
        }
        let points = [&ocp.iterate, &*self.trial_point].map(|point| point.variables_and_costates().0);
        let moved = StageOffsetsIter::<T>::new(ocp.qp().dims).fold(0.0, |largest: f64, place| {
            let [from, to] = points.map(|v| part(v, place.v, place.n));
            let pairs = from.iter().zip(to).zip(part(self.workspace.units, place.row, place.n));
            pairs.fold(largest, |m, ((&from, &to), &unit)| m.max(((to - from) / unit).abs().to_f64()))
        });
        tolerance * moved
    }

    /// Returns the decrease of the distances from hard bounds since the ray's origin (at the origin
    /// itself: the violations) plus the residuals of equations, in units; and the penalties of soft
    /// bounds.
    fn distance_decrease_and_penalties<P: Program<T>>(
        &mut self,
        ocp: &Ocp<P, T, D, M>,
        is_ray_origin: bool,
    ) -> Option<(f64, f64)> {
        let mut iterate =
            kkt_view(ocp.qp.view(), self.dimensions, self.kkt_numbers, self.kkt_indices).ok()?;
        let (rows, units, initial_distances) =
            (&*self.workspace.row_values, &*self.workspace.units, &mut *self.workspace.saved_slack_step);
        let mut sum = 0.0;
        if let Some(coupling) = &mut iterate.coupling {
            coupling.evaluate(iterate.qp, rows);
            sum += coupling.residual_sum();
        }
        let (inequalities, infinity) = (&iterate.inequalities, T::from_f64(f64::INFINITY));
        let residual = |row: u32, bound: T| at(rows, row) - bound;
        for (&row, &bound) in inequalities.equations.iter().zip(&*inequalities.equation_bound) {
            sum += (residual(row, bound) / at(units, row)).abs().to_f64();
        }
        let distance = |side: usize, row: u32, bound: T| {
            if side < inequalities.counts.lower { residual(row, bound) } else { -residual(row, bound) }
        };
        let mut penalties = 0.0;
        let costs = inequalities.linear.iter().zip(&*inequalities.quadratic).zip(&*inequalities.soft);
        for ((&linear, &quadratic), &side) in costs {
            let row = inequalities.rows.get(side as usize).copied().unwrap_or(0);
            let distance = distance(side as usize, row, at(inequalities.bound, side));
            let e = (-distance).to_f64().max(0.0);
            penalties += e * (linear.to_f64() + 0.5 * quadratic.to_f64() * e);
        }
        if is_ray_origin {
            initial_distances.fill(T::ZERO);
            inequalities.soft.iter().for_each(|&side| set(initial_distances, side as usize, -infinity));
        }
        for (i, (kept, (&row, &bound))) in
            initial_distances.iter_mut().zip(inequalities.rows.iter().zip(&*inequalities.bound)).enumerate()
        {
            let distance = distance(i, row, bound);
            sum += ((*kept - distance) / at(units, row)).to_f64().max(0.0);
            if is_ray_origin && *kept == T::ZERO {
                *kept = distance;
            }
        }
        Some((sum, penalties))
    }
}
