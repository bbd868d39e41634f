//! Kinematic states in iterations of Newton's method: `k_q` at the stages, before and after.

use super::{count, is_any, minus_c, velocity};
use crate::irk::coefficients::Coefficients;
use crate::irk::coefficients::nodes;
use crate::irk::coefficients::stage_values;
use crate::irk::jacobian_entries::entry;
use crate::irk::workspace::Work;
use crate::linalg::{kernels, kinematic, minus_ha};
use crate::memory::Fallback;
use crate::model::{ArrayK, ArrayV, ArrayX, Dae};
use crate::scalar::Lanes;
use crate::shape::Shape;

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> Work<M, E, S, F> {
    /// Writes `k_q`.
    pub(in crate::irk) fn reconstruct(
        &mut self,
        coefficients: &Coefficients<E, S>,
        x: &ArrayX<M, E>,
        y: &mut ArrayK<M, [E; S]>,
    ) {
        if const { !is_any::<M>() } {
            return;
        }
        let Self { linear, points, compensation, inputs, .. } = self;
        let (jacobian, a, h) = (&linear.jacobian, &coefficients.a, inputs.time.step);
        reconstruct_stages::<M, E, S>(jacobian, points, x, compensation, y, a, h);
    }

    /// Whether stages are all alike while `k_q = 0`, so that the model, with its Jacobian, is
    /// evaluated there once; what is missing is [eliminated](Self::eliminate_missing) then. Where
    /// stages are evaluated side by side that spares nothing, and of two stages little.
    pub(in crate::irk) fn is_missing(&mut self, jacobian: bool) -> bool {
        if const { !is_any::<M>() } {
            return false;
        }
        self.alike &= jacobian && E::LANES > 1 && S > 2;
        self.alike
    }

    /// The residual as it would be with `k_q`, by a Jacobian that all stages share as they share
    /// the point where it is: what `k_q` adds to `x` differs between them only by the nodes.
    pub(in crate::irk) fn eliminate_missing(&mut self, coefficients: &Coefficients<E, S>) {
        if const { !is_any::<M>() } {
            return;
        }
        let Self { f, points, linear, inputs, .. } = self;
        let (jacobian, a, h) = (&linear.jacobian, &coefficients.a, inputs.time.step);
        eliminate_missing::<M, E, S>(jacobian, points, f, a, h);
    }

    /// Writes what follows from [compensated](crate::irk::stages::compensated) sums, to its last
    /// digit.
    pub(in crate::irk) fn reconstruct_compensated(&mut self, y: &mut ArrayK<M, [E; S]>) {
        if const { !is_any::<M>() } {
            return;
        }
        reconstruct_compensated::<M, E, S>(&self.linear.jacobian, &mut self.points, y);
    }

    /// Takes from the residual of the others what is missing in `k_q` beyond its digits.
    pub(in crate::irk) fn eliminate_rounded(&mut self, coefficients: &Coefficients<E, S>) {
        if const { !is_any::<M>() } {
            return;
        }
        let Self { f, linear, inputs, .. } = self;
        let (jacobian, a, h) = (&linear.jacobian, &coefficients.a, inputs.time.step);
        eliminate_rounded::<M, E, S>(jacobian, f, a, h);
    }
}

/// `k_q` at the stages, from `v` at these points.
#[inline(always)]
pub(in crate::irk) fn derivative<M: Dae, E: Lanes, const S: usize>(
    state: usize,
    jacobian: &M::Jacobian<[E; S]>,
    points: &[[E; S]],
) -> Option<[E; S]> {
    let of = kinematic::<M>(state)?;
    let (mut k, minus_c) = (*points.get(of.velocity as usize)?, minus_c::<M, E, S>(of, jacobian)?);
    for k in &mut k {
        *k = -(minus_c * *k);
    }
    Some(k)
}

kernels! {
    /// See [`Work::reconstruct`]; `compensation` is what `x` has beyond its digits.
    fn reconstruct_stages [M: Dae, E: Lanes, const S: usize] [M, E, S] <A>(
        jacobian: &'k M::Jacobian<[E; S]>,
        points: &'k mut ArrayV<M, [E; S]>,
        x: &'k ArrayX<M, E>,
        compensation: &'k ArrayX<M, E>,
        y: &'k mut ArrayK<M, [E; S]>,
        a: &'k [[E; S]; S],
        h: E,
    ) {
        let (points, y) = (points.as_mut(), y.as_mut());
        let minus_ha = minus_ha(a, h);
        for state in 0..count::<M>() {
            let Some(of) = kinematic::<M>(state) else { continue };
            if let Some(v) = velocity::<M>(of)
                && let (Some(&x), Some(&rest), Some(k)) =
                    (x.as_ref().get(v), compensation.as_ref().get(v), y.get(v))
                && let Some(xi) = points.get_mut(M::Shape::NX + v)
            {
                *xi = stage_values::<A, E, S>(rest, &minus_ha, k);
                for xi in xi {
                    *xi = *xi + x;
                }
            }
            if let (Some(y), Some(k)) = (y.get_mut(state), derivative::<M, E, S>(state, jacobian, points)) {
                *y = k;
            }
        }
    }

    /// See [`Work::eliminate_missing`].
    fn eliminate_missing [M: Dae, E: Lanes, const S: usize] [M, E, S] <A>(
        jacobian: &'k M::Jacobian<[E; S]>,
        points: &'k mut ArrayV<M, [E; S]>,
        f: &'k mut ArrayK<M, [E; S]>,
        a: &'k [[E; S]; S],
        h: E,
    ) {
        let nodes = nodes(a, h);
        for dependent in M::STRUCTURE.elimination.dependents {
            let of = kinematic::<M>(dependent.state as usize);
            let missing = of.and_then(|of| f.as_ref().get(of.equation as usize)).map(|own| own[0]);
            let (Some(missing), Some((row, _, values))) =
                (missing, entry::<M, _>(jacobian, dependent.entry as usize))
            else {
                continue;
            };
            let Some(f) = f.as_mut().get_mut(row) else { continue };
            let share = values[0] * missing;
            for (f, &node) in f.iter_mut().zip(&nodes) {
                let derivative = (dependent.entry as usize) < M::STRUCTURE.blocks[1];
                *f = A::subtract(*f, share, if derivative { E::from_f64(1.0) } else { node });
            }
        }
        for state in 0..count::<M>() {
            let Some(of) = kinematic::<M>(state) else { continue };
            let Some(own) = f.as_mut().get_mut(of.equation as usize) else { continue };
            let missing = core::mem::replace(own, [E::from_f64(0.0); S])[0];
            for k in points.as_mut().get_mut(state).into_iter().flatten() {
                *k = *k - missing;
            }
        }
    }

    /// See [`Work::reconstruct_compensated`].
    fn reconstruct_compensated [M: Dae, E: Lanes, const S: usize] [M, E, S] <A>(
        jacobian: &'k M::Jacobian<[E; S]>,
        points: &'k mut ArrayV<M, [E; S]>,
        y: &'k mut ArrayK<M, [E; S]>,
    ) {
        for state in 0..count::<M>() {
            let k = derivative::<M, E, S>(state, jacobian, points.as_ref());
            if let (Some(k), Some(point), Some(y)) =
                (k, points.as_mut().get_mut(state), y.as_mut().get_mut(state))
            {
                (*point, *y) = (k, k);
            }
        }
    }

    /// See [`Work::eliminate_rounded`].
    fn eliminate_rounded [M: Dae, E: Lanes, const S: usize] [M, E, S] <A>(
        jacobian: &'k M::Jacobian<[E; S]>,
        f: &'k mut ArrayK<M, [E; S]>,
        a: &'k [[E; S]; S],
        h: E,
    ) {
        let minus_ha = minus_ha(a, h);
        for dependent in M::STRUCTURE.elimination.dependents {
            let of = kinematic::<M>(dependent.state as usize);
            let residual = of.and_then(|of| f.as_ref().get(of.equation as usize)).copied();
            let (Some(mut residual), Some((row, _, values))) =
                (residual, entry::<M, _>(jacobian, dependent.entry as usize))
            else {
                continue;
            };
            if dependent.entry as usize >= M::STRUCTURE.blocks[1] {
                residual = stage_values::<A, E, S>(E::from_f64(0.0), &minus_ha, &residual);
            }
            if let Some(f) = f.as_mut().get_mut(row) {
                A::subtract_products(f, values, &residual);
            }
        }
    }
}
