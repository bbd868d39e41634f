//! Stage equations of an interval, evaluated at stages that need not satisfy them.

use crate::irk::{Coefficients, dot};
use crate::model::{ArrayK, ArrayV, ArrayX, Dae, VectorP, VectorX, VectorZ};
use crate::ocp::formulation::functions::dynamics::Interval;
use crate::qp::{copy_common, nan_max};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};
use bytemuck::Zeroable;

/// The end of an interval by its stages.
pub(super) struct IntervalEnd<M: Dae, T: Real> {
    /// The state at the end of the interval.
    pub x: VectorX<M, T>,
    /// The algebraic states at its start.
    pub z0: VectorZ<M, T>,
}

/// Evaluates the stage equations of an interval, step by step.
pub(super) struct StageEquations<'a, M: Dae, T: Real, const S: usize> {
    coefficients: &'a Coefficients<T, S>,
    /// The state at the start of the step.
    x: ArrayX<M, T>,
    /// The variables at the current stage.
    v: ArrayV<M, T>,
    /// The length of a step, and the time at the start of the interval.
    h: T,
    t: T,
}

impl<'a, M: Dae, T: Real, const S: usize> StageEquations<'a, M, T, S> {
    /// The equations at the start of an interval with this number of steps.
    pub fn at_start(interval: &Interval<'_, T>, coefficients: &'a Coefficients<T, S>, steps: usize) -> Self {
        let (mut x, mut v) = (ArrayX::<M, T>::zeroed(), ArrayV::<M, T>::zeroed());
        copy_common(x.as_mut(), interval.x);
        let inputs = v.as_mut().get_mut(2 * M::Shape::NX + M::Shape::NZ..).unwrap_or_default();
        let p: VectorP<M, T> = interval.parameters();
        for (to, &from) in inputs.iter_mut().zip(interval.u.iter().chain(p.as_slice())) {
            *to = from;
        }
        Self { coefficients, x, v, h: interval.h / T::from_whole(steps), t: interval.t }
    }

    /// Returns the end of the interval by the stages `y + α Δy`, and the sum and the maximum of
    /// `|h f|` at these stages.
    pub fn end_and_residuals(
        mut self,
        stages: &[ArrayK<M, [T; S]>],
        stage_steps: &[ArrayK<M, [T; S]>],
        alpha: T,
    ) -> (IntervalEnd<M, T>, [T; 2]) {
        let mut end = IntervalEnd::<M, T> { x: VectorX::<M, T>::zeroed(), z0: VectorZ::<M, T>::zeroed() };
        let (mut sum, mut largest) = (T::ZERO, T::ZERO);
        for (n, y) in stages.iter().enumerate() {
            let mut y = *y;
            if let Some(change) = stage_steps.get(n).filter(|_| alpha != T::ZERO) {
                for (y, &change) in
                    y.as_mut().as_flattened_mut().iter_mut().zip(change.as_ref().as_flattened())
                {
                    *y = *y + alpha * change;
                }
            }
            for i in 0..S {
                let f = self.residual(&y, n, i);
                for &f in f.as_ref() {
                    let size = (self.h * f).abs();
                    sum = sum + size;
                    largest = nan_max(largest, size);
                }
            }
            if n == 0 {
                let algebraic = y.as_ref().get(M::Shape::NX..).unwrap_or_default();
                for (z, y) in end.z0.as_mut_slice().iter_mut().zip(algebraic) {
                    *z = dot(&self.coefficients.lagrange_start, y);
                }
            }
            for (x, k) in self.x.as_mut().iter_mut().zip(y.as_ref()) {
                *x = *x + self.h * dot(&self.coefficients.b, k);
            }
        }
        copy_common(end.x.as_mut_slice(), self.x.as_ref());
        (end, [sum, largest])
    }

    /// `f(k_i, x + h Σ_j a_ij k_j, u, z_i, p, t + (n + c_i) h)`
    fn residual(&mut self, y: &ArrayK<M, [T; S]>, n: usize, i: usize) -> ArrayK<M, T> {
        let (nx, nz) = (M::Shape::NX, M::Shape::NZ);
        let Self { coefficients: Coefficients { a, c, .. }, x, v, h, t } = self;
        let (h, stage_weights) = (*h, a.get(i).copied().unwrap_or([T::ZERO; S]));
        let (slopes, algebraic) = y.as_ref().split_at(nx.min(y.as_ref().len()));
        let v = v.as_mut();
        let (xdot, rest) = v.split_at_mut(nx);
        let (states, rest) = rest.split_at_mut(nx);
        for (((xdot, state), slope), &x) in xdot.iter_mut().zip(states).zip(slopes).zip(x.as_ref()) {
            (*xdot, *state) = (slope[i], x + h * dot(&stage_weights, slope));
        }
        for (z, y) in rest.iter_mut().take(nz).zip(algebraic) {
            *z = y[i];
        }
        if let Some(time) = rest.last_mut() {
            *time = *t + (T::from_whole(n) + c[i]) * h;
        }
        let mut f = ArrayK::<M, T>::zeroed();
        M::residual::<T>(&self.v, &mut f);
        f
    }
}
