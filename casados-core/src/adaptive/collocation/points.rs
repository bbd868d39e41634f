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
                    for (to, from) in point.as_mut().iter_mut().zip(points.as_ref()) {
                        *to = from[lane];
                    }
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
    pub(super) fn advance(&mut self, start: &Start<'_, M, T>, increment: bool) -> f64 {
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
        let (nx, point) = (M::Shape::NX, point.as_mut());
        let (b, end) = (self.scheme.weights(), self.scheme.values(1.0));
        for (index, y) in self.memory.y.as_ref().iter().enumerate() {
            let Some(y) = y.as_flattened().first_chunk() else { continue };
            if index < nx {
                point[index] = dot(&end, y);
                point[nx + index] = point[nx + index] + h * dot(&b, y);
            } else {
                point[nx + index] = dot(&end, y);
            }
        }
    }
}
