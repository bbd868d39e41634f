//! What a step needs, and errors where it is not there: a finite Jacobian, a length.

use super::*;
use crate::irk::{eliminate, unknown_name};

impl<M: Dae, T: Real> Run<'_, M, T> {
    /// At the point that was reached, or in the middle of the step.
    ///
    /// # Errors
    /// A value that is not finite.
    pub(super) fn evaluate_jacobian(&mut self, middle: bool, step: usize) -> Result<(), Error> {
        let Base { point, middle: foreseen, f, jacobian, .. } = &mut *self.base;
        self.statistics.jacobians += 1;
        M::residual_jacobian::<T>(if middle { foreseen } else { point }, f, jacobian);
        let at = Place { step, stage: 0, iteration: 0 };
        if let Some((equation, value)) = not_finite(f.as_ref()) {
            return Err(Error::NonFiniteModel { quantity: Quantity::Residual, equation, value, at });
        }
        if let Some((entry, value)) = not_finite(jacobian.as_ref()) {
            let equation = M::STRUCTURE.jacobian.at(entry).0;
            return Err(Error::NonFiniteModel { quantity: Quantity::Jacobian, equation, value, at });
        }
        Ok(())
    }

    /// # Errors
    /// [`Error::StepSizeUnderflow`]
    pub(in crate::adaptive) fn check_step(&self, t: T, h: T, reason: Refusal) -> Result<(), Error> {
        let size = h.to_f64().abs();
        // Of the least numbers there is no tenth.
        let tenth = T::from_f64(0.1) * h;
        let part = if tenth == T::ZERO { h } else { tenth };
        if size.is_nan() || size <= 0.0 || size < self.options.min_step || t + part == t {
            let reason = self.singular_algebraic(reason).unwrap_or(reason);
            return Err(Error::StepSizeUnderflow { t: t.to_f64(), h: h.to_f64(), reason });
        }
        Ok(())
    }

    /// Whether `∂f/∂z` becomes singular at the point that was reached, where that may be the
    /// reason.
    fn singular_algebraic(&self, reason: Refusal) -> Option<Refusal> {
        let possible = matches!(reason, Refusal::Error | Refusal::NotConverged | Refusal::Singular);
        if M::Shape::NZ == 0 || !possible {
            return None;
        }
        let (mut f, mut jacobian) = (ArrayK::<M, T>::zeroed(), M::Jacobian::<T>::zeroed());
        M::jacobian_constants::<T>(&mut jacobian);
        M::residual_jacobian::<T>(&self.base.point, &mut f, &mut jacobian);
        let number = |of: &[T], at: usize| of.get(at).map_or(f64::NAN, |v| v.to_f64());
        let (entries, point) = (jacobian.as_ref(), self.base.point.as_ref());
        let found = eliminate::<M>(|entry| number(entries, entry), |variable| number(point, variable))?;
        let unknown = unknown_name::<M>(found.unknown.filter(|_| found.is_singular::<T>())?);
        Some(Refusal::SingularAlgebraic { unknown })
    }
}
