//! Tolerances of the user, of the error estimate and of Newton's method.
//!
//! ```text
//! estimator.0 = 0.1 rtol^((s+1)/(2s))        user_ratio = estimator.0 / rtol        estimator.1 = user_ratio · atol
//! scale       = 1 / (estimator.1 + estimator.0 |x|)              tolerance_ratio = max user_ratio
//! newton      = min(0.03, e^((s−1)/(s+1))) √min(1, 4/tolerance_ratio)        Radau IIA, e = min estimator.0
//!               min(0.03, e^(s/(s+1)))                                       Gauss
//! ```

use crate::model::{ArrayK, Dae};
use crate::scalar::{Real, Scalar};
use crate::shape::Plain;
use bytemuck::Zeroable;

/// If the estimator tolerance exceeds the user's by this factor or more, the second estimate has
/// full weight: the first one does not control components with order reduction. For smaller ratios
/// the second estimate fades out.
pub(super) const ORDER_REDUCTION_RATIO: f64 = 4.0;

/// Tolerances of `(x, z)`.
#[derive(Zeroable)]
#[zeroable(bound = "T: Zeroable")]
pub struct Tolerances<M: Dae, T: Plain> {
    /// The user's relative and absolute tolerances.
    pub rtol: ArrayK<M, T>,
    pub atol: ArrayK<M, T>,
    /// The relative and absolute tolerances of the first estimate.
    pub estimator_tolerances: ArrayK<M, (T, T)>,
    /// The reciprocals of the errors that they tolerate.
    pub scale: ArrayK<M, T>,
    /// The ratios of the estimator tolerances and the user's.
    pub user_ratio: ArrayK<M, T>,
    /// The largest of these ratios.
    pub tolerance_ratio: f64,
    /// The estimate is proportional to this power of `h`.
    pub estimate_order: f64,
    /// The tolerance of Newton's method.
    pub newton_tolerance: f64,
}

impl<M: Dae, T: Real> Tolerances<M, T> {
    /// Sets the tolerances of a method with this number of stages: its estimate has order `s`, its
    /// steps have order `2s − 1` or higher.
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
            ..
        } = self;
        let mut finest: f64 = 1.0;
        *tolerance_ratio = 0.0;
        let mut before = (T::ZERO, T::ZERO);
        let user_ratio = user_ratio.as_mut().iter_mut();
        for (((estimator, user_ratio), rtol), atol) in
            estimator.as_mut().iter_mut().zip(user_ratio).zip(rtol.as_ref()).zip(atol.as_ref())
        {
            // Usually all tolerances are equal.
            if before.0 != *rtol {
                before = (*rtol, T::from_f64(0.1 * Scalar::powf(rtol.to_f64(), exponent)));
            }
            *user_ratio = before.1 / *rtol;
            *tolerance_ratio = tolerance_ratio.max(user_ratio.to_f64());
            *estimator = (before.1, *user_ratio * *atol);
            finest = finest.min(before.1.to_f64());
        }
        // The error of the iteration has to be small relative to that of the step. It is similar in
        // successive steps, so that undamped errors accumulate with the number of steps, a power
        // −1/(2s) of the tolerance. The tolerance of Gauss methods, which damp nothing, is smaller
        // by this power; that of Radau methods is smaller by a power of the tolerance ratio. It
        // remains above rounding.
        let wanted = if damps {
            let spread = (ORDER_REDUCTION_RATIO / *tolerance_ratio).min(1.0);
            Scalar::powf(finest, (s - 1.0) / (s + 1.0)).min(0.03) * Scalar::sqrt(spread)
        } else {
            Scalar::powf(finest, s / (s + 1.0)).min(0.03)
        };
        let rounding = T::EPSILON / finest;
        *newton = wanted.max(10.0 * rounding);
    }

    /// Updates the scales of the estimator tolerances at the values `(x, z)`.
    pub fn update_scales(&mut self, states: &[T]) {
        let Self { estimator_tolerances: estimator, scale, .. } = self;
        for ((scale, (rtol, atol)), state) in scale.as_mut().iter_mut().zip(estimator.as_ref()).zip(states) {
            *scale = T::ONE / (*atol + *rtol * state.abs());
        }
    }

    /// Updates the scales of the user's tolerances at the values `(x, z)`.
    pub fn update_user_scales(&mut self, states: &[T]) {
        let Self { rtol, atol, scale, .. } = self;
        let tolerances = rtol.as_ref().iter().zip(atol.as_ref());
        for ((scale, (rtol, atol)), state) in scale.as_mut().iter_mut().zip(tolerances).zip(states) {
            *scale = T::ONE / (*atol + *rtol * state.abs());
        }
    }
}

/// Loops over more elements are separate functions, which are not unrolled.
pub(super) const MAX_UNROLLED_LENGTH: usize = 6;

/// `√(Σ (v scale)² / n)`; the scales are reciprocals of tolerances.
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

/// The root of the mean of squares.
pub(super) fn root_mean_square(sum: f64, count: usize) -> f64 {
    Scalar::sqrt(sum / count.max(1) as f64)
}
