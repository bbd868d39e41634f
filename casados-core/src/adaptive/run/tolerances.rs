//! What a run needs besides its steps: what is tolerated of them, and where derivatives begin.

use super::*;

impl<M: Dae, T: Real> Run<'_, M, T> {
    /// The identity, if derivatives take part.
    ///
    /// # Errors
    /// As [`Consistent::forward`].
    pub(in crate::adaptive) fn begin_sensitivities(&mut self, x0: &VectorX<M, T>, t: T) -> Result<(), Error> {
        let Some(sensitivities) = &mut self.sensitivities else { return Ok(()) };
        let Workspace { u, parameters, start, magnitudes, .. } = &*self.base;
        sensitivities.begin(&At { x: x0, u, p: parameters, t }, start, magnitudes, self.consistent)
    }

    /// Tolerances of the estimate: it is of lower order than the method, `s` instead of `2s − 1`.
    pub(super) fn tighten<B: Family>(&mut self, stages: usize) {
        let s = stages as f64;
        let exponent = (s + 1.0) / (2.0 * s);
        let Workspace { estimator, user_ratio, tolerance_ratio, rtol, atol, newton_tolerance, noise, .. } =
            &mut *self.base;
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
        let wanted = if B::ENDS_ON_STAGE {
            let spread = (ORDER_REDUCTION_RATIO / *tolerance_ratio).min(1.0);
            Scalar::powf(finest, (s - 1.0) / (s + 1.0)).min(0.03) * Scalar::sqrt(spread)
        } else {
            Scalar::powf(finest, s / (s + 1.0)).min(0.03)
        };
        let rounding = T::EPSILON / finest;
        (*newton_tolerance, *noise) = (wanted.max(10.0 * rounding), 100.0 * rounding);
        self.measure();
    }

    /// What is tolerated at the time that was reached.
    pub(in crate::adaptive) fn measure(&mut self) {
        let Workspace { estimator, scale, point, .. } = &mut *self.base;
        let states = &point.as_ref()[M::Shape::NX..];
        for ((scale, (rtol, atol)), state) in scale.as_mut().iter_mut().zip(estimator.as_ref()).zip(states) {
            *scale = T::ONE / (*atol + *rtol * state.abs());
        }
    }
}
