//! Evaluation of the model at the stages, and of the collocation polynomial.

use super::*;

impl<M: Dae, T: Real, const S: usize, const G: usize> Collocation<M, T, S, G> {
    /// Evaluates the residual at all stages and writes the right-hand sides of the linear systems.
    pub(super) fn evaluate_stages(&mut self) {
        let StageMemory {
            stage_points: points,
            stage_residuals: f,
            right_hand_sides: rows,
            defect_point: point,
            defect_residual: f_point,
            ..
        } = &mut *self.memory;
        for (group, (points, f)) in points.iter().zip(f.iter_mut()).enumerate() {
            if let Err(call) = T::side_by_side(EvaluateResiduals::<M, T> { points, f }) {
                let EvaluateResiduals { points, f } = call;
                for lane in 0..STAGES_PER_GROUP.min(S - STAGES_PER_GROUP * group) {
                    copy_lane(points.as_ref(), lane, point.as_mut());
                    M::residual::<T>(point, f_point);
                    for (to, from) in f.as_mut().iter_mut().zip(f_point.as_ref()) {
                        to[lane..].fill(*from);
                    }
                }
            }
        }
        dispatch(TransformResiduals::<M, T, S, G> {
            left_eigenvectors: self.scheme.basis.left_vectors(),
            f: from_fn(|group| f[group].as_ref()),
            rows: rows.as_mut(),
            model: PhantomData,
        });
    }

    /// Applies the increment, `y ← y − Δ`, if there is one, and updates the variables at the
    /// stages. Returns the sum of squares of the changes of `(ξ, z)` relative to the tolerances.
    pub(super) fn apply_increment(&mut self, start: &StepContext<'_, M, T>, increment: bool) -> f64 {
        let StageMemory { stage_unknowns: y, stage_points: points, right_hand_sides: rows, .. } =
            &mut *self.memory;
        let mut points = points.each_mut().map(|points| points.as_mut());
        let (re, im) = self.scheme.right_eigenvectors.split_at(COMPLEX_PARTS / 2);
        let sum = dispatch(ApplyIncrement {
            minus_ha: &self.scheme.minus_ha,
            // The lanes that belong to eigenvalues.
            right_eigenvectors: [&re[..S.div_ceil(2)], &im[..S.div_ceil(2)]],
            x: &start.start_point.as_ref()[M::Shape::NX..2 * M::Shape::NX],
            scale: start.estimator_scale.as_ref(),
            rows: if increment { rows.as_ref() } else { &[] },
            y: y.as_mut(),
            points: &mut points,
        });
        Scheme::<T, S, G>::sum_over_stages(&sum)
    }

    /// Evaluates `x_n + h Σ_i b_i k_i`, and the polynomials of `ẋ` and `z` at the end.
    pub(super) fn evaluate_end(&self, h: T, point: &mut ArrayV<M, T>) {
        let (end, b) = (self.scheme.lagrange_values(1.0), self.scheme.quadrature_weights());
        evaluate_polynomial::<M, T, S, G>(&self.memory.stage_unknowns, [&end, &b], h, point);
    }
}

/// Moves a point from `x_n` to a point of the step: `x_n + h Σ_i b_i k_i` with the `integrals` of
/// the Lagrange polynomials there, and `ẋ` and `z` with their `values`.
pub(super) fn evaluate_polynomial<M: Dae, T: Real, const S: usize, const G: usize>(
    y: &ArrayK<M, StageGroups<T, G>>,
    [values, integrals]: [&[T; S]; 2],
    h: T,
    point: &mut ArrayV<M, T>,
) {
    let nx = M::Shape::NX;
    let (k, z) = y.as_ref().split_at(nx);
    let (xdot, others) = point.as_mut().split_at_mut(nx);
    let (x, others) = others.split_at_mut(nx);
    weighted_stage_sums(values, k, xdot);
    weighted_stage_sums(values, z, others);
    let mut change = ArrayX::<M, T>::zeroed();
    weighted_stage_sums(integrals, k, change.as_mut());
    axpy(h, change.as_ref(), x);
}

/// `Σ_i weight_i y_i` for several unknowns.
#[inline(always)]
pub(super) fn weighted_stage_sums<T: Real, const S: usize, const G: usize>(
    weights: &[T; S],
    y: &[StageGroups<T, G>],
    to: &mut [T],
) {
    if to.len() <= MAX_UNROLLED_LENGTH {
        unrolled_stage_sums(weights, y, to)
    } else {
        looped_stage_sums(weights, y, to)
    }
}

#[inline(always)]
fn unrolled_stage_sums<T: Real, const S: usize, const G: usize>(
    weights: &[T; S],
    y: &[StageGroups<T, G>],
    to: &mut [T],
) {
    for (to, y) in to.iter_mut().zip(y) {
        if let Some(y) = y.as_flattened().first_chunk() {
            *to = dot(weights, y);
        }
    }
}

#[inline(never)]
fn looped_stage_sums<T: Real, const S: usize, const G: usize>(
    weights: &[T; S],
    y: &[StageGroups<T, G>],
    to: &mut [T],
) {
    unrolled_stage_sums(weights, y, to);
}

/// Copies one lane of a group; a separate loop, which is not unrolled.
#[inline(never)]
pub(super) fn copy_lane<T: Real>(group: &[[T; STAGES_PER_GROUP]], lane: usize, to: &mut [T]) {
    for (to, from) in to.iter_mut().zip(group) {
        *to = from[lane];
    }
}

/// Copies the variables at the last stage, which the last lane of the last group repeats.
pub(super) fn copy_last_stage<V: AsRef<[[T; STAGES_PER_GROUP]]>, T: Real>(groups: &[V], to: &mut [T]) {
    copy_lane(groups.last().map_or(&[], AsRef::as_ref), STAGES_PER_GROUP - 1, to);
}
