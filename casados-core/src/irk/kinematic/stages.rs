//! Kinematic states in Newton's method: `k_q` at the stages, before and after the iterations.

use super::{has_kinematic_states, minus_c};
use crate::irk::coefficients::Coefficients;
use crate::irk::coefficients::nodes;
use crate::irk::coefficients::stage_values;
use crate::irk::workspace::StageWorkspace;
use crate::linalg::{kernels, minus_ha};
use crate::memory::Fallback;
use crate::model::{ArrayK, ArrayX, Dae};
use crate::plan::{Plan, PlanOf, StructureTable};
use crate::scalar::Lanes;
use crate::shape::InBounds;

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> StageWorkspace<M, E, S, F> {
    /// Computes `k_q`.
    pub(in crate::irk) fn reconstruct_kinematic(
        &mut self,
        coefficients: &Coefficients<E, S>,
        x: &ArrayX<M, E>,
        y: &mut ArrayK<M, [E; S]>,
    ) {
        if const { !has_kinematic_states::<M>() } {
            return;
        }
        let Self { linearization: linear, points, compensation, inputs, .. } = self;
        let (jacobian, a, h) = (F::Plan::<M>::jacobian(&linear.jacobian), &coefficients.a, inputs.time.step);
        let (points, y) = (F::Plan::<M>::v_mut(points), F::Plan::<M>::k_mut(y));
        let x = [F::Plan::<M>::x(x), F::Plan::<M>::x(compensation)];
        reconstruct_stages(F::plan::<M>(), jacobian, points, x, y, a, h);
    }

    /// Whether the model and its Jacobian are evaluated once for all stages: with `k_q = 0` the
    /// stages are identical. [`eliminate_omitted`](Self::eliminate_omitted) then adds the omitted
    /// terms. Only for three stages or more that are not evaluated in one SIMD register.
    pub(in crate::irk) fn omits_kinematic(&mut self, jacobian: bool) -> bool {
        if const { !has_kinematic_states::<M>() } {
            return false;
        }
        self.identical_stages &= jacobian && E::LANES > 1 && S > 2;
        self.identical_stages
    }

    /// Adds the terms of the omitted `k_q` to the residual. The stages share one Jacobian;
    /// `h c_i k_q`, the omitted change of `x`, differs between stages by the node `c_i` only.
    pub(in crate::irk) fn eliminate_omitted(&mut self, coefficients: &Coefficients<E, S>) {
        if const { !has_kinematic_states::<M>() } {
            return;
        }
        let Self { f, points, linearization: linear, inputs, .. } = self;
        let (jacobian, a, h) = (F::Plan::<M>::jacobian(&linear.jacobian), &coefficients.a, inputs.time.step);
        let (points, f) = (F::Plan::<M>::v_mut(points), F::Plan::<M>::k_mut(f));
        eliminate_missing(F::plan::<M>(), jacobian, points, f, a, h);
    }

    /// Computes `k_q` from [compensated](crate::irk::stages::compensated) sums.
    pub(in crate::irk) fn reconstruct_compensated(&mut self, y: &mut ArrayK<M, [E; S]>) {
        if const { !has_kinematic_states::<M>() } {
            return;
        }
        let jacobian = F::Plan::<M>::jacobian(&self.linearization.jacobian);
        let (points, y) = (F::Plan::<M>::v_mut(&mut self.points), F::Plan::<M>::k_mut(y));
        reconstruct_compensated(F::plan::<M>(), jacobian, points, y);
    }

    /// Eliminates the rounding errors of `k_q` from the residuals of the dependent equations.
    pub(in crate::irk) fn eliminate_rounding(&mut self, coefficients: &Coefficients<E, S>) {
        if const { !has_kinematic_states::<M>() } {
            return;
        }
        let Self { f, linearization: linear, inputs, .. } = self;
        let (jacobian, a, h) = (F::Plan::<M>::jacobian(&linear.jacobian), &coefficients.a, inputs.time.step);
        eliminate_rounded(F::plan::<M>(), jacobian, F::Plan::<M>::k_mut(f), a, h);
    }
}

/// `k_q` at the stages, from `v` at these points.
#[inline(always)]
pub(in crate::irk) fn kinematic_derivative<M: Plan, E: Lanes, const S: usize>(
    plan: M,
    state: usize,
    jacobian: &[[E; S]],
    points: &[[E; S]],
) -> Option<[E; S]> {
    let kinematic = plan.kinematic(state)?;
    let (mut k, minus_c) = (*points.get(kinematic.velocity as usize)?, minus_c(kinematic, jacobian)?);
    for k in &mut k {
        *k = -(minus_c * *k);
    }
    Some(k)
}

kernels! {
    /// See [`StageWorkspace::reconstruct_kinematic`]; the second element of `x` is the
    /// compensation.
    fn reconstruct_stages [M: Plan, E: Lanes, const S: usize] [M, E, S] <A>(
        plan: M,
        jacobian: &'k M::Jacobian<[E; S]>,
        points: &'k mut M::V<[E; S]>,
        x: [&'k M::X<E>; 2],
        y: &'k mut M::K<[E; S]>,
        a: &'k [[E; S]; S],
        h: E,
    ) {
        let ([x, rest], y, points) = (x.map(|x| x.as_ref()), y.as_mut(), points.as_mut());
        let jacobian = jacobian.as_ref();
        let minus_ha = minus_ha(a, h);
        for state in 0..StructureTable::Kinematic.row_count(plan.structure()) {
            let Some(kinematic) = plan.kinematic(state) else { continue };
            if let Some(v) = plan.velocity(kinematic)
                && let (Some(&x), Some(&rest), Some(k)) =
                    (x.get(v).in_bounds(), rest.get(v).in_bounds(), y.get(v).in_bounds())
                && let Some(xi) = points.get_mut(plan.nx() + v).in_bounds()
            {
                *xi = stage_values::<A, E, S>(rest, &minus_ha, k);
                for xi in xi {
                    *xi = *xi + x;
                }
            }
            if let (Some(y), Some(k)) = (y.get_mut(state).in_bounds(), kinematic_derivative(plan, state, jacobian, points)) {
                *y = k;
            }
        }
    }

    /// See [`StageWorkspace::eliminate_omitted`].
    fn eliminate_missing [M: Plan, E: Lanes, const S: usize] [M, E, S] <A>(
        plan: M,
        jacobian: &'k M::Jacobian<[E; S]>,
        points: &'k mut M::V<[E; S]>,
        f: &'k mut M::K<[E; S]>,
        a: &'k [[E; S]; S],
        h: E,
    ) {
        let (nodes, points, f, jacobian) = (nodes(a, h), points.as_mut(), f.as_mut(), jacobian.as_ref());
        for dependent in plan.structure().elimination.dependents {
            let kinematic = plan.kinematic(dependent.state as usize);
            let omitted = kinematic.and_then(|of| f.get(of.equation as usize)).map(|own| own[0]);
            let (Some(omitted), Some((row, _, values))) =
                (omitted, plan.entry(jacobian, dependent.entry as usize))
            else {
                continue;
            };
            let Some(f) = f.get_mut(row).in_bounds() else { continue };
            let product = values[0] * omitted;
            for (f, &node) in f.iter_mut().zip(&nodes) {
                let derivative = (dependent.entry as usize) < plan.structure().blocks[1];
                *f = A::subtract(*f, product, if derivative { E::from_f64(1.0) } else { node });
            }
        }
        for state in 0..StructureTable::Kinematic.row_count(plan.structure()) {
            let Some(kinematic) = plan.kinematic(state) else { continue };
            let Some(own) = f.get_mut(kinematic.equation as usize).in_bounds() else { continue };
            let omitted = core::mem::replace(own, [E::from_f64(0.0); S])[0];
            for k in points.get_mut(state).into_iter().flatten() {
                *k = *k - omitted;
            }
        }
    }

    /// See [`StageWorkspace::reconstruct_compensated`].
    fn reconstruct_compensated [M: Plan, E: Lanes, const S: usize] [M, E, S] <A>(
        plan: M,
        jacobian: &'k M::Jacobian<[E; S]>,
        points: &'k mut M::V<[E; S]>,
        y: &'k mut M::K<[E; S]>,
    ) {
        let (points, y, jacobian) = (points.as_mut(), y.as_mut(), jacobian.as_ref());
        for state in 0..StructureTable::Kinematic.row_count(plan.structure()) {
            let k = kinematic_derivative(plan, state, jacobian, points);
            if let (Some(k), Some(point), Some(y)) =
                (k, points.get_mut(state).in_bounds(), y.get_mut(state).in_bounds())
            {
                (*point, *y) = (k, k);
            }
        }
    }

    /// See [`StageWorkspace::eliminate_rounding`].
    fn eliminate_rounded [M: Plan, E: Lanes, const S: usize] [M, E, S] <A>(
        plan: M,
        jacobian: &'k M::Jacobian<[E; S]>,
        f: &'k mut M::K<[E; S]>,
        a: &'k [[E; S]; S],
        h: E,
    ) {
        let (minus_ha, f, jacobian) = (minus_ha(a, h), f.as_mut(), jacobian.as_ref());
        for dependent in plan.structure().elimination.dependents {
            let kinematic = plan.kinematic(dependent.state as usize);
            let residual = kinematic.and_then(|of| f.get(of.equation as usize)).copied();
            let (Some(mut residual), Some((row, _, values))) =
                (residual, plan.entry(jacobian, dependent.entry as usize))
            else {
                continue;
            };
            if dependent.entry as usize >= plan.structure().blocks[1] {
                residual = stage_values::<A, E, S>(E::from_f64(0.0), &minus_ha, &residual);
            }
            if let Some(f) = f.get_mut(row).in_bounds() {
                A::subtract_products(f, values, &residual);
            }
        }
    }
}
