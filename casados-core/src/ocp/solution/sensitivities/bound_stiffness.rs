//! Bounds as additions to the Hessian: stiff springs for active bounds, the barrier's Hessian for
//! smoothed solutions.

use super::get;
use crate::qp::Bounds;
use crate::scalar::Real;

/// The stiffness of bounds, which is added to the Hessian.
#[derive(Clone, Copy, Debug)]
pub(super) struct BoundStiffness<T> {
    /// The stiffness of active bounds: large compared to the Hessians. Its inverse is their
    /// compliance.
    active_stiffness: T,
    /// The barrier parameter of the iterate; zero for active sets.
    mu: T,
    /// Slacks and multipliers below this are small.
    tolerance: T,
    /// The number of bounds whose slack and multiplier are both small.
    pub weakly_active: usize,
}

impl<T: Real> BoundStiffness<T> {
    /// The stiffness for Hessians with this largest element, with this compliance of active bounds
    /// relative to it.
    pub fn new(largest: T, mu: T, compliance: T) -> Self {
        let root = T::from_f64(T::EPSILON).sqrt();
        let active = if largest > T::ZERO { largest / compliance } else { T::ONE / compliance };
        Self { active_stiffness: active, mu, tolerance: root.sqrt(), weakly_active: 0 }
    }

    /// The stiffness of a lower and an upper bound.
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

    /// Whether this stiffness is that of an active constraint, whose value is constant.
    pub fn is_active(&self, bounds: &Bounds<'_, T>, i: usize, stiffness: T) -> bool {
        let is_equation = get(bounds.lower, i) == get(bounds.upper, i);
        is_equation || self.mu == T::ZERO && stiffness >= self.active_stiffness
    }

    /// The stiffness of one bound, from its slack, multiplier and penalties.
    fn stiffness_of_side(&mut self, slack: T, multiplier: T, linear: T, quadratic: T) -> T {
        if !slack.is_finite() {
            T::ZERO
        } else if self.mu > T::ZERO {
            self.smoothed_stiffness(slack, multiplier, linear, quadratic)
        } else {
            self.active_set_stiffness(slack, multiplier, linear, quadratic)
        }
    }

    /// Large for an active bound, the quadratic penalty for a violated soft bound.
    fn active_set_stiffness(&mut self, slack: T, multiplier: T, linear: T, quadratic: T) -> T {
        let missing_multiplier = linear - quadratic * slack - multiplier;
        let is_weak = |a: T, b: T| a.abs() < self.tolerance && b.abs() < self.tolerance;
        self.weakly_active += usize::from(is_weak(slack, multiplier) || is_weak(slack, missing_multiplier));
        // Either the violation or the difference to the largest multiplier is zero.
        if slack < T::ZERO && linear.is_finite() && -slack > missing_multiplier {
            quadratic
        } else if multiplier > slack {
            self.active_stiffness
        } else {
            T::ZERO
        }
    }

    /// `−dλ/dd` of `s λ = μ` with `s = d + e`, where the violation `e` has a barrier, too:
    /// `e (linear + quadratic e − λ) = μ`. Hard bounds have no `e`.
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
        // Slack or multiplier, whichever is larger, is accurate.
        let inverse_barrier_stiffness =
            if multiplier > slack { self.mu / (multiplier * multiplier) } else { slack * slack / self.mu };
        T::ONE / (inverse_barrier_stiffness + inverse_penalty_stiffness)
    }
}
