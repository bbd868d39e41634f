//! The loops of a collocation step, compiled for each instruction set. Stages are stored in groups
//! of four.

use crate::linalg::{Arithmetic, COMPLEX_PARTS, Complex, Kernel, slot};
use crate::model::{ArrayK, ArrayV, Dae};
use crate::scalar::{Lanes, Real, SideBySide};
use crate::shape::InBounds;
use core::marker::PhantomData;

/// The number of stages in a group.
pub const STAGES_PER_GROUP: usize = 4;

/// The values of an unknown at all stages.
pub type StageGroups<T, const G: usize> = [[T; STAGES_PER_GROUP]; G];

/// Evaluates the residual at four stages.
pub struct EvaluateResiduals<'a, M: Dae, T: Real> {
    pub points: &'a ArrayV<M, [T; STAGES_PER_GROUP]>,
    pub f: &'a mut ArrayK<M, [T; STAGES_PER_GROUP]>,
}

impl<M: Dae, T: Real> SideBySide<T, STAGES_PER_GROUP> for EvaluateResiduals<'_, M, T> {
    #[inline(always)]
    fn call<R: Lanes<Cell = [T; STAGES_PER_GROUP]>>(self) {
        M::residual::<R>(self.points, self.f);
    }
}

/// Computes `V⁻¹ f` in the slots of the equations.
pub struct TransformResiduals<'a, M: Dae, T, const S: usize, const G: usize> {
    pub left_eigenvectors: &'a [Complex<T, COMPLEX_PARTS>; S],
    pub f: [&'a [[T; STAGES_PER_GROUP]]; G],
    pub rows: &'a mut [[[Complex<T, COMPLEX_PARTS>; 1]; 1]],
    pub model: PhantomData<M>,
}

impl<M: Dae, T: Real, const S: usize, const G: usize> Kernel for TransformResiduals<'_, M, T, S, G> {
    type Number = T;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { left_eigenvectors: left, f, rows, .. } = self;
        for equation in 0..rows.len() {
            let mut values = [[T::ZERO; STAGES_PER_GROUP]; G];
            for (values, f) in values.iter_mut().zip(&f) {
                if let Some(f) = f.get(equation).in_bounds() {
                    *values = *f;
                }
            }
            let mut sum = Complex::zero();
            for (left, value) in left.iter().zip(values.as_flattened()) {
                for l in 0..COMPLEX_PARTS {
                    sum.parts[l] = A::subtract(sum.parts[l], -left.parts[l], *value);
                }
            }
            if let Some([[row]]) = rows.get_mut(slot::<M>(equation)).in_bounds() {
                *row = sum;
            }
        }
    }
}

/// See [`Collocation::apply_increment`].
pub struct ApplyIncrement<'a, 'b, T, const S: usize, const G: usize> {
    /// The columns of `−h A`.
    pub minus_ha: &'a [StageGroups<T, G>; S],
    /// The right eigenvectors: real parts and imaginary parts.
    pub right_eigenvectors: [&'a [StageGroups<T, G>]; 2],
    /// The states at the start of the step.
    pub x: &'a [T],
    pub scale: &'a [T],
    pub rows: &'a [[[Complex<T, COMPLEX_PARTS>; 1]; 1]],
    pub y: &'a mut [StageGroups<T, G>],
    pub points: &'a mut [&'b mut [[T; STAGES_PER_GROUP]]; G],
}

impl<T: Real, const S: usize, const G: usize> Kernel for ApplyIncrement<'_, '_, T, S, G> {
    type Number = T;
    type Output = StageGroups<T, G>;
    #[inline(always)]
    fn run<A: Arithmetic>(self) -> StageGroups<T, G> {
        let Self { minus_ha, right_eigenvectors: right, x, scale, rows, y, points } = self;
        let nx = x.len();
        let mut sums = [[T::ZERO; STAGES_PER_GROUP]; G];
        for (index, (unknown, &scale)) in y.iter_mut().zip(scale).enumerate() {
            // A local copy stays in registers.
            let before = *unknown;
            let mut y = before;
            if let Some([[row]]) = rows.get(index) {
                let (re, im) = row.parts.split_at(const { COMPLEX_PARTS / 2 });
                for (((re, im), right_re), right_im) in re.iter().zip(im).zip(right[0]).zip(right[1]) {
                    for ((y, right_re), right_im) in y.iter_mut().zip(right_re).zip(right_im) {
                        for ((y, right_re), right_im) in y.iter_mut().zip(right_re).zip(right_im) {
                            *y = A::subtract(A::subtract(*y, *right_re, *re), *right_im, *im);
                        }
                    }
                }
                *unknown = y;
            }
            if let Some(&x) = x.get(index) {
                let mut xi = [[x; STAGES_PER_GROUP]; G];
                for (a, &k) in minus_ha.iter().zip(y.as_flattened()) {
                    for (xi, a) in xi.iter_mut().zip(a) {
                        for (xi, a) in xi.iter_mut().zip(a) {
                            *xi = A::subtract(*xi, *a, k);
                        }
                    }
                }
                for g in 0..G {
                    if let Some(k) = points[g].get_mut(index).in_bounds() {
                        *k = y[g];
                    }
                    let Some(state) = points[g].get_mut(nx + index).in_bounds() else { continue };
                    for i in 0..STAGES_PER_GROUP {
                        let relative = (xi[g][i] - state[i]) * scale;
                        sums[g][i] = A::subtract(sums[g][i], -relative, relative);
                    }
                    *state = xi[g];
                }
            } else {
                for g in 0..G {
                    for i in 0..STAGES_PER_GROUP {
                        let relative = (y[g][i] - before[g][i]) * scale;
                        sums[g][i] = A::subtract(sums[g][i], -relative, relative);
                    }
                    if let Some(z) = points[g].get_mut(nx + index).in_bounds() {
                        *z = y[g];
                    }
                }
            }
        }
        sums
    }
}

/// Extrapolates the polynomial of the last step to the stages of this one.
pub struct ExtrapolateStages<'a, T, const S: usize, const G: usize> {
    /// The columns of the extrapolation weights.
    pub weights: [StageGroups<T, G>; S],
    pub from: &'a [[T; S]],
    pub to: &'a mut [StageGroups<T, G>],
}

impl<T: Real, const S: usize, const G: usize> Kernel for ExtrapolateStages<'_, T, S, G> {
    type Number = T;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        for (to, from) in self.to.iter_mut().zip(self.from) {
            let mut sum = [[T::ZERO; STAGES_PER_GROUP]; G];
            for (weights, &value) in self.weights.iter().zip(from) {
                for g in 0..G {
                    for i in 0..STAGES_PER_GROUP {
                        sum[g][i] = A::subtract(sum[g][i], -weights[g][i], value);
                    }
                }
            }
            *to = sum;
        }
    }
}
