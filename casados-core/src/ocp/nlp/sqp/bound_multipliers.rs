//! Multipliers of bounds of variables at a distant origin, from the stationarity.

use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::qp::element::set;
use crate::qp::interior::at;
use crate::qp::{
    Bounds, SolutionStageMut, StageDims, StageOffsetsIter, add_symmetric_product, copy_common, part, part_mut,
};
use crate::scalar::Real;

impl<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Sets the multipliers of hard bounds of states and controls that are active up to `rounding`
    /// such that the stationarity residual of the variable vanishes, or is as small as non-negative
    /// multipliers allow. `scratch` has memory for the variables of a stage.
    ///
    /// The QP solver computes a multiplier from the distance to its bound (`λ₊ = λ − W d`). If the
    /// last digit of the variable is above `λ / W` the distance is rounded to zero, and the
    /// multiplier stays zero at an exact solution.
    pub(super) fn bound_multipliers_by_stationarity(&mut self, rounding: f64, scratch: &mut [T]) {
        let Self { qp, iterate, .. } = self;
        let qp = qp.view();
        if qp.is_coupled() {
            return;
        }
        let rounding = T::from_f64(rounding);
        for (place, stage) in StageOffsetsIter::<T>::new(qp.dims).zip(qp.stages()) {
            let view = stage.arrays();
            let gradient = part_mut(scratch, 0, place.ld);
            copy_common(gradient, part(view.gradient, 0, place.ld));
            let v = part(iterate.variables_and_costates().0, place.v, place.ld);
            add_symmetric_product(gradient, view.hessian, place.ld, v, place.n);
            let columns = view.matrix.chunks_exact(place.ld.max(1));
            if let Some(point) = iterate.stage(place.stage) {
                let of_constraints = point.g_upper.iter().zip(point.g_lower).map(|(&u, &l)| u - l);
                let multipliers = point.dynamics.iter().copied().chain(of_constraints);
                for (column, multiplier) in columns.zip(multipliers) {
                    gradient.iter_mut().zip(column).for_each(|(g, &a)| *g = *g + multiplier * a);
                }
            }
            let previous = place.stage.checked_sub(1).and_then(|previous| iterate.stage(previous));
            let costates = previous.map_or(&[][..], |previous| previous.dynamics);
            gradient.iter_mut().zip(costates).for_each(|(g, &costate)| *g = *g - costate);
            let Some(SolutionStageMut { x, u, x_lower, x_upper, u_lower, u_upper, .. }) =
                iterate.stage_mut(place.stage)
            else {
                continue;
            };
            let nx = x.len();
            let (of_x, of_u) = gradient.split_at_checked(nx).unwrap_or_default();
            update(stage.x_bounds(), (x, of_x), [x_lower, x_upper], rounding);
            update(stage.u_bounds(), (u, of_u), [u_lower, u_upper], rounding);
        }
    }
}

/// Updates the multipliers `λ` of bounds of variables with the gradients `g`: `g − λ_l + λ_u = 0`.
fn update<T: Real>(
    Bounds { lower, upper, lower_linear, upper_linear, .. }: Bounds<'_, T>,
    (values, gradients): (&[T], &[T]),
    [of_lower, of_upper]: [&mut [T]; 2],
    rounding: T,
) {
    for (i, (&value, &gradient)) in values.iter().zip(gradients).enumerate() {
        let index = i as u32;
        let is_active = |bounds: &[T], penalties: &[T]| {
            (value - at(bounds, index)).abs() <= rounding && !at(penalties, index).is_finite()
        };
        let [at_lower, at_upper] = [is_active(lower, lower_linear), is_active(upper, upper_linear)];
        if at_lower && gradient >= T::ZERO {
            set(of_lower, i, gradient);
            set(of_upper, i, T::ZERO);
        } else if at_upper && gradient <= T::ZERO {
            set(of_upper, i, -gradient);
            set(of_lower, i, T::ZERO);
        }
    }
}
