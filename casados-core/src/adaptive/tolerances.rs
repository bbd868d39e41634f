//! Tolerances: what was asked for, and what the estimator and Newton's method make of it.
//!
//! ```text
//! estimator.0 = 0.1 rtol^((s+1)/(2s))        user_ratio = estimator.0 / rtol        estimator.1 = user_ratio · atol
//! scale       = 1 / (estimator.1 + estimator.0 |x|)              tolerance_ratio = max user_ratio
//! newton      = min(0.03, e^((s−1)/(s+1))) √min(1, 4/tolerance_ratio)        Radau IIA, e = min estimator.0
//!               min(0.03, e^(s/(s+1)))                                       Gauss
//! noise       = 100 ε / e
//! ```

use crate::model::{ArrayK, Dae};
use crate::scalar::{Real, Scalar};
use crate::shape::Plain;
use bytemuck::Zeroable;

/// Where the first estimate is asked for this much less than the solution, or even less, its
/// tolerance says nothing of components that lose their order; where it is asked for about as much,
/// it says all, and the second one fades out.
pub(super) const ORDER_REDUCTION_RATIO: f64 = 4.0;

/// Tolerances of `(x, z)`.
#[derive(Zeroable)]
#[zeroable(bound = "T: Zeroable")]
pub struct Tolerances<M: Dae, T: Plain> {
    /// As they were asked for,
    pub rtol: ArrayK<M, T>,
    pub atol: ArrayK<M, T>,
    /// as the estimate needs them, relative and absolute,
    pub estimator_tolerances: ArrayK<M, (T, T)>,
    /// the reciprocals of the errors that it tolerates,
    pub scale: ArrayK<M, T>,
    /// and how many times as large those of the tolerances are that were asked for.
    pub user_ratio: ArrayK<M, T>,
    /// The largest of these.
    pub tolerance_ratio: f64,
    /// The estimate behaves like `h` to this power.
    pub estimate_order: f64,
    /// Where Newton's method may stop.
    pub newton_tolerance: f64,
    /// Estimated errors that are smaller are of rounding.
    pub noise: f64,
}

impl<M: Dae, T: Real> Tolerances<M, T> {
    /// Those of a method with so many stages: its estimate is of order `s`, its steps of `2s − 1`
    /// or more.
    pub fn set_estimator_tolerances(&mut self, stages: usize, damps: bool) {
        let s = stages as f64;
        self.estimate_order = s + 1.0;
        let exponent = (s + 1.0) / (2.0 * s);
        let Self {
            estimator_tolerances: estimator,
            user_ratio,
            tolerance_ratio,
            rtol,
            atol,
            newton_tolerance: newton,
            noise,
            ..
        } = self;
        let mut finest: f64 = 1.0;
        *tolerance_ratio = 0.0;
        let mut before = (T::ZERO, T::ZERO);
        let user_ratio = user_ratio.as_mut().iter_mut();
        for (((estimator, user_ratio), rtol), atol) in
            estimator.as_mut().iter_mut().zip(user_ratio).zip(rtol.as_ref()).zip(atol.as_ref())
        {
            // Mostly they are all the same.
            if before.0 != *rtol {
                before = (*rtol, T::from_f64(0.1 * Scalar::powf(rtol.to_f64(), exponent)));
            }
            *user_ratio = before.1 / *rtol;
            *tolerance_ratio = tolerance_ratio.max(user_ratio.to_f64());
            *estimator = (before.1, *user_ratio * *atol);
            finest = finest.min(before.1.to_f64());
        }
        // Where the error of the iteration is small beside that of the step. It is the same in step
        // after step, and what is not damped adds up over as many as there are, like the tolerance
        // to the power of −1/(2s): of Gauss methods, which damp nothing, it is smaller by that, and
        // of Radau methods by a power of what superconvergence takes for granted. It stays above
        // rounding.
        let wanted = if damps {
            let spread = (ORDER_REDUCTION_RATIO / *tolerance_ratio).min(1.0);
            Scalar::powf(finest, (s - 1.0) / (s + 1.0)).min(0.03) * Scalar::sqrt(spread)
        } else {
            Scalar::powf(finest, s / (s + 1.0)).min(0.03)
        };
        let rounding = T::EPSILON / finest;
        (*newton, *noise) = (wanted.max(10.0 * rounding), 100.0 * rounding);
    }

    /// What the estimate tolerates at these `(x, z)`.
    pub fn update_scales(&mut self, states: &[T]) {
        let Self { estimator_tolerances: estimator, scale, .. } = self;
        for ((scale, (rtol, atol)), state) in scale.as_mut().iter_mut().zip(estimator.as_ref()).zip(states) {
            *scale = T::ONE / (*atol + *rtol * state.abs());
        }
    }

    /// What the user tolerates at these `(x, z)`.
    pub fn update_user_scales(&mut self, states: &[T]) {
        let Self { rtol, atol, scale, .. } = self;
        let tolerances = rtol.as_ref().iter().zip(atol.as_ref());
        for ((scale, (rtol, atol)), state) in scale.as_mut().iter_mut().zip(tolerances).zip(states) {
            *scale = T::ONE / (*atol + *rtol * state.abs());
        }
    }
}

/// Loops over more elements are functions of their own, and not unrolled.
pub(super) const MAX_UNROLLED_LENGTH: usize = 6;

/// `√(Σ (v/scale)² / n)`, with the reciprocals of the scales.
#[inline(always)]
pub(super) fn norm<T: Real>(values: &[T], scale: &[T]) -> f64 {
    let sum = if values.len() <= MAX_UNROLLED_LENGTH {
        sum_of_squares(values, scale)
    } else {
        looped_sum_of_squares(values, scale)
    };
    root_mean_square(sum.to_f64(), values.len())
}

#[inline(always)]
fn sum_of_squares<T: Real>(values: &[T], scale: &[T]) -> T {
    let mut sum = T::ZERO;
    for (value, scale) in values.iter().zip(scale) {
        let relative = *value * *scale;
        sum = sum + relative * relative;
    }
    sum
}

#[inline(never)]
fn looped_sum_of_squares<T: Real>(values: &[T], scale: &[T]) -> T {
    sum_of_squares(values, scale)
}

/// The root of a mean of squares.
pub(super) fn root_mean_square(sum: f64, count: usize) -> f64 {
    Scalar::sqrt(sum / count.max(1) as f64)
}
