//! Units: of forces by the objective, of constraints by their gradients, and how large multipliers
//! are.
//!
//! A. Wächter, L. T. Biegler, Math. Program. 106 (2006), equations (5) and (6), and section 3.8.

use crate::qp::interior::Iterate;
use crate::qp::{Places, QpView, Residuals, add_symmetric, assign, part, part_mut};
use crate::scalar::Real;

/// `g_max`: gradients of the objective that are larger are so many units.
const LARGE: f64 = 100.0;
/// Gradients that are smaller are so many units.
const SMALL: f64 = 1e-2;
/// `s_max`: a mean multiplier that is larger relaxes tolerances.
const MEAN: f64 = 100.0;

/// The unit of forces at a point where the QP was written without second derivatives of
/// constraints: gradients of the objective are from `SMALL` to `LARGE` of it. What counts is the
/// largest derivative by a variable, or what that changes by where the variable changes by one or
/// by its size: at many guesses gradients vanish.
pub(super) fn unit_of_forces<T: Real>(qp: QpView<'_, T>, v: &[T], scratch: &mut [T]) -> f64 {
    let mut size = 0.0_f64;
    for (place, stage) in Places::<T>::new(qp.dims).zip(qp.stages()) {
        let view = stage.arrays();
        let (v, gradient) = (part(v, place.v, place.ld), part_mut(scratch, 0, place.ld));
        assign(gradient, part(view.gradient, 0, place.ld));
        add_symmetric(gradient, view.hessian, place.ld, v, place.n);
        let curvatures = view.hessian.iter().step_by(place.ld + 1);
        for ((&slope, &curvature), &v) in gradient.iter().zip(curvatures).zip(v).take(place.n) {
            let change = curvature.abs() * v.abs().max(T::ONE);
            size = size.max(slope.abs().to_f64()).max(change.to_f64());
        }
    }
    unit(size)
}

/// The unit in which a size is from `SMALL` to `LARGE`, nearest to one.
fn unit(size: f64) -> f64 {
    if !(size > 0.0 && size.is_finite()) {
        return 1.0;
    }
    if size > LARGE {
        size / LARGE
    } else if size < SMALL {
        size / SMALL
    } else {
        1.0
    }
}

/// Residuals in units of forces, relative to the mean sizes of multipliers where these are large:
/// `s_d` is that of all of them, `s_c` that of sides.
pub(super) fn relative<T: Real>(
    residuals: &Residuals,
    iterate: &Iterate<'_, T>,
    pi: &[T],
    force: f64,
) -> (Residuals, f64) {
    let sides = &iterate.sides;
    let sum = |values: &[T]| values.iter().fold(0.0, |sum, value| sum + value.abs().to_f64());
    let of_sides = sum(sides.multiplier);
    let of_equations = sum(pi) + sum(sides.free);
    let mean = |sum: f64, count: usize| (sum / force / count.max(1) as f64 / MEAN).max(1.0);
    let pairs = sides.counts.pairs();
    let all = mean(of_sides + of_equations, pairs + sides.counts.equations + pi.len());
    let mut relative = *residuals;
    let of_products = force * mean(of_sides, pairs);
    relative.stationarity /= force * all;
    relative.complementarity /= of_products;
    (relative, of_products)
}
