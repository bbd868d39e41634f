//! Bounds as springs: stiff ones where they are active, those of the barrier where solutions are
//! smoothed.

use super::get;
use crate::qp::Bounds;
use crate::scalar::Real;

/// What bounds add to the Hessian.
#[derive(Clone, Copy, Debug)]
pub(super) struct BoundStiffness<T> {
    /// Of active bounds: large beside the elements of the Hessians. What they give way by is its
    /// inverse.
    active_stiffness: T,
    /// The barrier parameter that the point solves; zero for active sets.
    mu: T,
    /// Slacks and multipliers below are small.
    tolerance: T,
    /// How many bounds have neither a slack nor a multiplier that is not small.
    pub weakly_active: usize,
}

impl<T: Real> BoundStiffness<T> {
    /// For Hessians with this largest element.
    pub fn new(largest: T, mu: T) -> Self {
        let root = T::from_f64(T::EPSILON).sqrt();
        let active = if largest > T::ZERO { largest / root } else { T::ONE / root };
        Self { active_stiffness: active, mu, tolerance: root.sqrt(), weakly_active: 0 }
    }

    /// What both sides of a bound add.
    pub fn stiffness_of_bound(
        &mut self,
        bounds: &Bounds<'_, T>,
        i: usize,
        value: T,
        [lower, upper]: [T; 2],
    ) -> T {
        let at = |values: &[T]| get(values, i);
        if at(bounds.lower) == at(bounds.upper) {
            return self.active_stiffness;
        }
        let (below, above) = (value - at(bounds.lower), at(bounds.upper) - value);
        self.stiffness_of_side(below, lower, at(bounds.lower_linear), at(bounds.lower_quadratic))
            + self.stiffness_of_side(above, upper, at(bounds.upper_linear), at(bounds.upper_quadratic))
    }

    /// What a side adds, from its slack, multiplier and penalties.
    fn stiffness_of_side(&mut self, slack: T, multiplier: T, linear: T, quadratic: T) -> T {
        if !slack.is_finite() {
            T::ZERO
        } else if self.mu > T::ZERO {
            self.smoothed_stiffness(slack, multiplier, linear, quadratic)
        } else {
            self.active_set_stiffness(slack, multiplier, linear, quadratic)
        }
    }

    /// Much where a side is active, its quadratic penalty where it is violated softly.
    fn active_set_stiffness(&mut self, slack: T, multiplier: T, linear: T, quadratic: T) -> T {
        let missing_multiplier = linear - quadratic * slack - multiplier;
        let is_weak = |a: T, b: T| a.abs() < self.tolerance && b.abs() < self.tolerance;
        self.weakly_active += usize::from(is_weak(slack, multiplier) || is_weak(slack, missing_multiplier));
        // Of a violation and the force that its multiplier lacks one is zero.
        if slack < T::ZERO && linear.is_finite() && -slack > missing_multiplier {
            quadratic
        } else if multiplier > slack {
            self.active_stiffness
        } else {
            T::ZERO
        }
    }

    /// `−dλ/dd` of `s λ = μ` with `s = d + e`, where the violation `e` has a barrier, too:
    /// `e (linear + quadratic e − λ) = μ`. It is none for hard sides.
    fn smoothed_stiffness(&self, distance: T, multiplier: T, linear: T, quadratic: T) -> T {
        let (mut slack, mut inverse_penalty_stiffness) = (distance, T::ZERO);
        if linear.is_finite() {
            // The positive root, without cancellation.
            let half = T::from_f64(0.5) * (linear - multiplier);
            let root = (half * half + quadratic * self.mu).sqrt();
            let violation = if half > T::ZERO { self.mu / (half + root) } else { (root - half) / quadratic };
            slack = slack + violation;
            inverse_penalty_stiffness = T::ONE / (quadratic + self.mu / (violation * violation));
        }
        // The one of both that is not small has the digits.
        let inverse_barrier_stiffness =
            if multiplier > slack { self.mu / (multiplier * multiplier) } else { slack * slack / self.mu };
        T::ONE / (inverse_barrier_stiffness + inverse_penalty_stiffness)
    }
}
