//! The steps of an interval, one after the other.

use super::assemble::Purpose;
use super::evaluate::{dot, not_finite};
use super::record::{Coefficients, Step, Work};
use crate::error::Error;
use crate::model::{ArrayK, Dae};
use crate::options::Options;
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};
use crate::statistics::Statistics;

/// Where the unknowns of the stages start.
pub(crate) enum From<'a, M: Dae, T: Real, const S: usize> {
    Zero,
    Given,
    Record(&'a [Step<M, T, S>]),
}

impl<M: Dae, T: Real, const S: usize> Work<M, T, S> {
    /// Integrates the interval: `x` at its start becomes `x` at its end. After each step, `after` is called
    /// with what is known about it, and whether the Jacobian that is stored is that of its solution.
    ///
    /// # Errors
    /// Those of Newton's method; [`Error::Overflow`].
    pub(crate) fn integrate(
        &mut self,
        coefficients: &Coefficients<T, S>,
        options: &Options,
        from: &From<'_, M, T, S>,
        steps: &mut [Step<M, T, S>],
        statistics: &mut Statistics,
        mut after: impl FnMut(&mut Self, usize, &Step<M, T, S>, bool, &mut Statistics) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.place_inputs();
        let count = steps.len();
        for (n, step) in steps.iter_mut().enumerate() {
            step.x = self.x;
            self.start(from, n, &mut step.y);
            let mut solved = self.newton(coefficients, &options.newton, n, &step.x, &mut step.y, statistics);
            if solved.as_ref().is_err_and(lost_digits) && self.linear.factors.is_planned() {
                // The planned elimination may be to blame: once more, with the whole matrix pivoted.
                self.linear.factors.set_pivoted(true);
                self.start(from, n, &mut step.y);
                solved = self.newton(coefficients, &options.newton, n, &step.x, &mut step.y, statistics);
                self.linear.factors.set_pivoted(false);
            }
            let current = solved?;
            let h = self.inputs.time.step;
            for (x, k) in self.x.as_mut().iter_mut().zip(step.y.as_ref()) {
                *x = *x + h * dot(&coefficients.b, k);
            }
            if let Some((index, _)) = not_finite(self.x.as_ref()) {
                return Err(Error::Overflow { step: n, index });
            }
            if n == 0 {
                algebraic::<M, T, S>(self.result.z0.as_mut_slice(), &step.y, &coefficients.start);
            }
            if n + 1 == count {
                algebraic::<M, T, S>(self.result.z.as_mut_slice(), &step.y, &coefficients.end);
            }
            after(self, n, step, current, statistics)?;
            statistics.steps += 1;
            statistics.residual = statistics.residual.max(self.relative.0.to_f64());
        }
        self.result.x.as_mut_slice().copy_from_slice(self.x.as_ref());
        for z in [self.result.z0.as_slice(), self.result.z.as_slice()] {
            check(z, count - 1)?;
        }
        Ok(())
    }

    /// Start values of the stages of a step.
    fn start(&mut self, from: &From<'_, M, T, S>, n: usize, y: &mut ArrayK<M, [T; S]>) {
        match from {
            From::Zero => y.as_mut().fill([T::ZERO; S]),
            From::Given => {
                for (y, given) in y.as_mut().iter_mut().zip(self.given.as_ref()) {
                    *y = [*given; S];
                }
            }
            From::Record(record) => {
                if let Some(record) = record.get(n) {
                    *y = record.y;
                }
            }
        }
        self.relative = (T::ZERO, 0, 0);
    }

    /// The linearisation at the solution of a step: evaluated if it is not there, and factorised.
    ///
    /// # Errors
    /// A value of the model that is not finite, a singular matrix.
    pub(crate) fn linearize(
        &mut self,
        coefficients: &Coefficients<T, S>,
        n: usize,
        step: &Step<M, T, S>,
        current: bool,
        statistics: &mut Statistics,
    ) -> Result<(), Error> {
        if !current {
            self.place(coefficients, n, &step.x, &step.y);
            statistics.jacobians += 1;
            self.evaluate_jacobian(n, 0)?;
            self.relative = self.relative_residual();
        }
        self.linear.factor(coefficients, self.inputs.time.step, n, 0, Purpose::Sensitivities, statistics)
    }
}

/// Whether an iteration may have failed because its linear systems were solved badly.
fn lost_digits(error: &Error) -> bool {
    match error {
        Error::NotConverged { .. } | Error::Overflow { .. } => true,
        Error::NonFiniteModel { at, .. } => at.iteration > 0,
        _ => false,
    }
}

/// Algebraic states at a point of the polynomial through the stages.
pub(crate) fn algebraic<M: Dae, T: Real, const S: usize>(
    z: &mut [T],
    y: &ArrayK<M, [T; S]>,
    lagrange: &[T; S],
) {
    for (z, y) in z.iter_mut().zip(&y.as_ref()[M::Shape::NX..]) {
        *z = dot(lagrange, y);
    }
}

/// # Errors
/// [`Error::Overflow`] of the first element that is not finite.
pub(crate) fn check<T: Real>(values: &[T], step: usize) -> Result<(), Error> {
    match not_finite(values) {
        Some((index, _)) => Err(Error::Overflow { step, index }),
        None => Ok(()),
    }
}
