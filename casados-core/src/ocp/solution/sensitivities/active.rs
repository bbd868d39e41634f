//! Bounds as springs: stiff ones where they are active, those of the barrier where solutions are
//! smoothed.

use super::get;
use crate::qp::Bounds;
use crate::scalar::Real;

/// What bounds add to the Hessian.
#[derive(Clone, Copy, Debug)]
pub(super) struct Springs<T> {
    /// Of active bounds: large beside the elements of the Hessians. What they give way by is its
    /// inverse.
    active: T,
    /// The barrier parameter that the point solves; zero for active sets.
    mu: T,
    /// Slacks and multipliers below are small.
    small: T,
    /// How many bounds have neither a slack nor a multiplier that is not small.
    pub weak: usize,
}

impl<T: Real> Springs<T> {
    /// For Hessians with this largest element.
    pub fn new(largest: T, mu: T) -> Self {
        let root = T::from_f64(T::EPSILON).sqrt();
        let active = if largest > T::ZERO { largest / root } else { T::ONE / root };
        Self { active, mu, small: root.sqrt(), weak: 0 }
    }

    /// What both sides of a bound add.
    pub fn both(&mut self, bounds: &Bounds<'_, T>, i: usize, value: T, [lower, upper]: [T; 2]) -> T {
        let at = |values: &[T]| get(values, i);
        if at(bounds.lower) == at(bounds.upper) {
            return self.active;
        }
        let (below, above) = (value - at(bounds.lower), at(bounds.upper) - value);
        self.side(below, lower, at(bounds.lower_linear), at(bounds.lower_quadratic))
            + self.side(above, upper, at(bounds.upper_linear), at(bounds.upper_quadratic))
    }

    /// What a side adds, from its slack, multiplier and penalties.
    fn side(&mut self, slack: T, multiplier: T, linear: T, quadratic: T) -> T {
        if !slack.is_finite() {
            T::ZERO
        } else if self.mu > T::ZERO {
            self.smooth(slack, multiplier, linear, quadratic)
        } else {
            self.active(slack, multiplier, linear, quadratic)
        }
    }

    /// Much where a side is active, its quadratic penalty where it is violated softly.
    fn active(&mut self, slack: T, multiplier: T, linear: T, quadratic: T) -> T {
        let lacks = linear - quadratic * slack - multiplier;
        let is_weak = |a: T, b: T| a.abs() < self.small && b.abs() < self.small;
        self.weak += usize::from(is_weak(slack, multiplier) || is_weak(slack, lacks));
        // Of a violation and the force that its multiplier lacks one is zero.
        if slack < T::ZERO && linear.is_finite() && -slack > lacks {
            quadratic
        } else if multiplier > slack {
            self.active
        } else {
            T::ZERO
        }
    }

    /// `−dλ/dd` of `s λ = μ` with `s = d + e`, where the violation `e` has a barrier, too:
    /// `e (linear + quadratic e − λ) = μ`. It is none for hard sides.
    fn smooth(&self, distance: T, multiplier: T, linear: T, quadratic: T) -> T {
        let (mut slack, mut gives) = (distance, T::ZERO);
        if linear.is_finite() {
            // The positive root, without cancellation.
            let half = T::from_f64(0.5) * (linear - multiplier);
            let root = (half * half + quadratic * self.mu).sqrt();
            let violation = if half > T::ZERO { self.mu / (half + root) } else { (root - half) / quadratic };
            slack = slack + violation;
            gives = T::ONE / (quadratic + self.mu / (violation * violation));
        }
        // The one of both that is not small has the digits.
        let ratio =
            if multiplier > slack { self.mu / (multiplier * multiplier) } else { slack * slack / self.mu };
        T::ONE / (ratio + gives)
    }
}
