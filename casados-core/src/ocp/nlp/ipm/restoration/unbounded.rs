//! Whether a problem is unbounded: a ray of points that satisfy all constraints, along which the
//! objective falls without end.
//!
//! ```text
//! v(α) = v + α d        f(v(α)) falls with α,  no distance to a bound shrinks by more than ε α ‖d‖
//! ```
//!
//! `d` is the step where variables have become very large, all sizes are in the units of rows, and
//! the objective is that of the problem, not of a model. A distance that shrinks as fast as `α`
//! grows would end the ray, however far the bound is. Where dynamics are not linear the states are
//! those that follow from the controls of a point on the ray.

use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::nlp::ipm::Ipm;
use crate::ocp::nlp::ipm::kkt::newton::kkt_view;
use crate::ocp::nlp::ipm::kkt::work::Work;
use crate::ocp::nlp::ipm::line_search::LineSearch;
use crate::ocp::nlp::ipm::state::State;
use crate::qp::element::set;
use crate::qp::interior::at;
use crate::qp::{Places, StageDims, Store, part};
use crate::scalar::Real;

/// How far the ray is followed, in steps as long as the variables are large: up to where numbers
/// end, or where a minimum that lies far away would show.
const LENGTHS: [f64; 10] = [1.0, 1e4, 1e8, 1e12, 1e16, 1e20, 1e24, 1e28, 1e32, 1e36];
/// Where a ray is none, variables may become so many times as large before the next one is tried.
const NEXT_RAY: f64 = 1e3;

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// Whether variables are very large, and the step is a ray along which the problem has no end.
    pub(in crate::ocp::nlp::ipm) fn is_unbounded<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_>,
    ) -> bool {
        let (v, _) = ocp.iterate.variables_and_costates();
        let diverges = v.iter().any(|v| v.abs().to_f64() > state.diverging_iterates);
        if !diverges || state.elastic.is_some() || state.lengths.alone {
            return false;
        }
        state.diverging_iterates *= NEXT_RAY;
        let lengths = state.lengths;
        let tolerance = self.options.tolerance.max(T::EPSILON);
        let Self { trial, numbers, indices, work, .. } = self;
        let mut work = Work::new(ocp.ends(), &state.capacity, work.as_mut());
        let mut ray = LineSearch { lengths: &lengths, numbers, indices, trial, work: &mut work };
        let unbounded = ray.has_no_end(ocp, tolerance);
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
    /// Whether the objective falls along the ray of the step, and no constraint ends it.
    fn has_no_end<P: Program<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>, tolerance: f64) -> bool {
        let force = self.lengths.sizes.force;
        let Some([size, step]) = self.sizes(ocp) else { return false };
        let Some(mut before) = self.along_ray(ocp, 0.0, tolerance * size) else { return false };
        let mut followed = 0;
        for length in LENGTHS {
            let Some(objective) = self.along_ray(ocp, length * size / step, tolerance) else { return false };
            if !objective.is_finite() {
                break;
            }
            let falls = before - objective > tolerance * force.max(before.abs());
            if !falls {
                return false;
            }
            (before, followed) = (objective, followed + 1);
        }
        followed > 0
    }

    /// The largest variable and the largest step, in units; nothing where one is zero.
    fn sizes<P: Program<T>>(&mut self, ocp: &Ocp<P, T, D, M>) -> Option<[f64; 2]> {
        let iterate = kkt_view(ocp.qp.view(), self.lengths, self.numbers, self.indices).ok()?;
        let sizes = [&*iterate.v, &*iterate.step].map(|numbers| {
            Places::<T>::new(iterate.qp.dims).fold(0.0, |largest: f64, place| {
                let own = part(numbers, place.row, place.n).iter();
                let units = part(self.work.units, place.row, place.n);
                own.zip(units).fold(largest, |m, (&v, &unit)| m.max((v / unit).abs().to_f64()))
            })
        });
        sizes.iter().all(|size| size.is_normal()).then_some(sizes)
    }

    /// The objective at a point of the ray, with the penalties of soft bounds: none where a
    /// constraint ends the ray, not a number where a function has no value. Violations may be
    /// `tolerance` times what the point has moved, and that at the iterate itself, where distances
    /// are kept.
    fn along_ray<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        alpha: f64,
        tolerance: f64,
    ) -> Option<f64> {
        self.place_trial(ocp, T::from_f64(alpha))?;
        let mut objective = ocp.rows_at(self.trial, self.work.ends, self.work.rows).unwrap_or(f64::NAN);
        let mut gaps = ocp.gaps_at(self.trial, self.work.ends, self.work.units);
        if P::LIFTED {
            gaps += ocp.stages[0].to_f64();
        } else if gaps > self.limit(ocp, alpha, tolerance) {
            // States that follow from the controls.
            if !ocp.simulate(self.trial, self.work.ends, self.work.units, f64::INFINITY) {
                return Some(f64::NAN);
            }
            objective = ocp.rows_at(self.trial, self.work.ends, self.work.rows).unwrap_or(f64::NAN);
            gaps = 0.0;
        }
        if !objective.is_finite() {
            return Some(f64::NAN);
        }
        let (violation, penalties) = self.shrinkage(ocp, alpha == 0.0)?;
        let limit = self.limit(ocp, alpha, tolerance);
        (gaps + violation <= limit).then_some(objective + penalties)
    }

    /// By how much the trial point may violate constraints.
    fn limit<P: Program<T>>(&self, ocp: &Ocp<P, T, D, M>, alpha: f64, tolerance: f64) -> f64 {
        if alpha == 0.0 {
            return tolerance;
        }
        let points = [&ocp.iterate, &*self.trial].map(|point| point.variables_and_costates().0);
        let moved = Places::<T>::new(ocp.qp().dims).fold(0.0, |largest: f64, place| {
            let [from, to] = points.map(|v| part(v, place.v, place.n));
            let pairs = from.iter().zip(to).zip(part(self.work.units, place.row, place.n));
            pairs.fold(largest, |m, ((&from, &to), &unit)| m.max(((to - from) / unit).abs().to_f64()))
        });
        tolerance * moved
    }

    /// By how much distances to hard bounds have shrunk at the trial point, or are violated at the
    /// `first` one, and residuals of equations, in units; what violations of soft bounds cost.
    fn shrinkage<P: Program<T>>(&mut self, ocp: &Ocp<P, T, D, M>, first: bool) -> Option<(f64, f64)> {
        let mut iterate = kkt_view(ocp.qp.view(), self.lengths, self.numbers, self.indices).ok()?;
        let (rows, units, kept) = (&*self.work.rows, &*self.work.units, &mut *self.work.slack_step);
        let mut sum = 0.0;
        if let Some(coupling) = &mut iterate.coupling {
            coupling.evaluate(iterate.qp, rows);
            sum += coupling.residual_sum();
        }
        let (sides, infinity) = (&iterate.sides, T::from_f64(f64::INFINITY));
        let residual = |row: u32, bound: T| at(rows, row) - bound;
        for (&row, &bound) in sides.equations.iter().zip(&*sides.equation_bound) {
            sum += (residual(row, bound) / at(units, row)).abs().to_f64();
        }
        let distance = |side: usize, row: u32, bound: T| {
            if side < sides.counts.lower { residual(row, bound) } else { -residual(row, bound) }
        };
        let mut penalties = 0.0;
        let costs = sides.linear.iter().zip(&*sides.quadratic).zip(&*sides.soft);
        for ((&linear, &quadratic), &side) in costs {
            let row = sides.rows.get(side as usize).copied().unwrap_or(0);
            let distance = distance(side as usize, row, at(sides.bound, side));
            let e = (-distance).to_f64().max(0.0);
            penalties += e * (linear.to_f64() + 0.5 * quadratic.to_f64() * e);
        }
        if first {
            kept.fill(T::ZERO);
            sides.soft.iter().for_each(|&side| set(kept, side as usize, -infinity));
        }
        for (i, (kept, (&row, &bound))) in
            kept.iter_mut().zip(sides.rows.iter().zip(&*sides.bound)).enumerate()
        {
            let distance = distance(i, row, bound);
            sum += ((*kept - distance) / at(units, row)).to_f64().max(0.0);
            if first && *kept == T::ZERO {
                *kept = distance;
            }
        }
        Some((sum, penalties))
    }
}
