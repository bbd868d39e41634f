//! The stages as points of the model, and the polynomial through them.

use super::*;

impl<M: Dae, T: Real, const S: usize, const G: usize> Collocation<M, T, S, G> {
    /// The residual at all stages, and from there to the rows of the linear systems.
    pub(super) fn evaluate(&mut self) {
        let Memory { points, f, rows, point, f_point, .. } = &mut *self.memory;
        for (group, (points, f)) in points.iter().zip(f.iter_mut()).enumerate() {
            if let Err(call) = T::side_by_side(Residual::<M, T> { points, f }) {
                let Residual { points, f } = call;
                for lane in 0..GROUP.min(S - GROUP * group) {
                    take(points.as_ref(), lane, point.as_mut());
                    M::residual::<T>(point, f_point);
                    for (to, from) in f.as_mut().iter_mut().zip(f_point.as_ref()) {
                        to[lane..].fill(*from);
                    }
                }
            }
        }
        dispatch(Split::<M, T, S, G> {
            left: self.scheme.basis.left(),
            f: from_fn(|group| f[group].as_ref()),
            rows: rows.as_mut(),
            model: PhantomData,
        });
    }

    /// `y ← y − Δ` with `Δ` from the rows if there are any, and the stages moved there: the sum of
    /// the squares of the changes of `(ξ, z)` relative to what is tolerated.
    pub(super) fn advance(&mut self, start: &StepContext<'_, M, T>, increment: bool) -> f64 {
        let Memory { y, points, rows, .. } = &mut *self.memory;
        let mut points = points.each_mut().map(|points| points.as_mut());
        let (re, im) = self.scheme.right.split_at(PARTS / 2);
        let sum = dispatch(Advance {
            minus_ha: &self.scheme.minus_ha,
            // Of the lanes that there are eigenvalues for.
            right: [&re[..S.div_ceil(2)], &im[..S.div_ceil(2)]],
            x: &start.point.as_ref()[M::Shape::NX..2 * M::Shape::NX],
            scale: start.scale.as_ref(),
            rows: if increment { rows.as_ref() } else { &[] },
            y: y.as_mut(),
            points: &mut points,
        });
        Scheme::<T, S, G>::total(&sum)
    }

    /// `x_n + h Σ_i b_i k_i`, and the polynomials of `ẋ` and `z` at the end.
    pub(super) fn extrapolate(&self, h: T, point: &mut ArrayV<M, T>) {
        let (end, b) = (self.scheme.values(1.0), self.scheme.weights());
        evaluate_polynomial::<M, T, S, G>(&self.memory.y, [&end, &b], h, point);
    }
}

/// From `x_n` to a point of the step: `x_n + h Σ_i b_i k_i` with the `integrals` of the Lagrange
/// polynomials there, and `ẋ` and `z` with their `values`.
pub(super) fn evaluate_polynomial<M: Dae, T: Real, const S: usize, const G: usize>(
    y: &ArrayK<M, Groups<T, G>>,
    [values, integrals]: [&[T; S]; 2],
    h: T,
    point: &mut ArrayV<M, T>,
) {
    let nx = M::Shape::NX;
    let (k, z) = y.as_ref().split_at(nx);
    let (xdot, others) = point.as_mut().split_at_mut(nx);
    let (x, others) = others.split_at_mut(nx);
    combine(values, k, xdot);
    combine(values, z, others);
    let mut change = ArrayX::<M, T>::zeroed();
    combine(integrals, k, change.as_mut());
    axpy(h, change.as_ref(), x);
}

/// `Σ_i weight_i y_i` of some unknowns.
#[inline(always)]
pub(super) fn combine<T: Real, const S: usize, const G: usize>(
    weights: &[T; S],
    y: &[Groups<T, G>],
    to: &mut [T],
) {
    if to.len() <= FEW { combine_each(weights, y, to) } else { combine_many(weights, y, to) }
}

#[inline(always)]
fn combine_each<T: Real, const S: usize, const G: usize>(weights: &[T; S], y: &[Groups<T, G>], to: &mut [T]) {
    for (to, y) in to.iter_mut().zip(y) {
        if let Some(y) = y.as_flattened().first_chunk() {
            *to = dot(weights, y);
        }
    }
}

#[inline(never)]
fn combine_many<T: Real, const S: usize, const G: usize>(weights: &[T; S], y: &[Groups<T, G>], to: &mut [T]) {
    combine_each(weights, y, to);
}

/// Values in one lane of a group: a loop of its own, which is not unrolled.
#[inline(never)]
pub(super) fn take<T: Real>(group: &[[T; GROUP]], lane: usize, to: &mut [T]) {
    for (to, from) in to.iter_mut().zip(group) {
        *to = from[lane];
    }
}

/// Variables at the last stage, which the last lane of the last group repeats.
pub(super) fn last_stage<V: AsRef<[[T; GROUP]]>, T: Real>(groups: &[V], to: &mut [T]) {
    take(groups.last().map_or(&[], AsRef::as_ref), GROUP - 1, to);
}
