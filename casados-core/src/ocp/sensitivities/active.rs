//! Bounds that are active, as stiff springs.

use super::get;
use crate::qp::Bounds;
use crate::scalar::Real;

/// Active bounds weigh this much, relative to the largest element of the Hessians: what they miss
/// is its inverse.
pub(super) fn weight<T: Real>() -> T {
    T::ONE / T::from_f64(T::EPSILON).sqrt()
}

/// What a bound adds to the Hessian, from its slack, multiplier and penalties: much where it is
/// active, its quadratic penalty where it is violated softly.
fn stiffness<T: Real>(slack: T, multiplier: T, linear: T, quadratic: T, active: T) -> T {
    if !slack.is_finite() {
        T::ZERO
    } else if slack < T::ZERO && linear.is_finite() && -slack > linear - quadratic * slack - multiplier {
        // Of a violation and the force that its multiplier lacks one is zero.
        quadratic
    } else if multiplier > slack {
        active
    } else {
        T::ZERO
    }
}

/// What both sides of a bound add.
pub(super) fn both<T: Real>(bounds: &Bounds<'_, T>, i: usize, value: T, lower: T, upper: T, active: T) -> T {
    let at = |values: &[T]| get(values, i);
    if at(bounds.lower) == at(bounds.upper) {
        return active;
    }
    let (below, above) = (value - at(bounds.lower), at(bounds.upper) - value);
    stiffness(below, lower, at(bounds.lower_linear), at(bounds.lower_quadratic), active)
        + stiffness(above, upper, at(bounds.upper_linear), at(bounds.upper_quadratic), active)
}
