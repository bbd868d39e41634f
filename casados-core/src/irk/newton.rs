//! Newton's method on the stages of one step.
//!
//! ```text
//! J Δ = −f(y),   y ← y + Δ
//! ```
//!
//! It has converged as soon as one of these holds, both of them invariant under scaling of equations
//! and of variables:
//! - the residual of every equation is at rounding level, `|f_r| ≤ 4 ε Σ_c |∂f_r/∂v_c v_c|`;
//! - the increment that would come next is expected below the tolerance relative to the size of each
//!   unknown. The increments `‖Δ‖ = max_c |Δ_c| / |y_c|` shrink by `θ`, so the next one is `θ ‖Δ‖/(1−θ)` with a
//!   frozen Jacobian (Hairer and Wanner, Solving ODEs II, IV.8), and `θ² ‖Δ‖` with the current one, since
//!   then `θ` squares too.
//!
//! Where rounding errors of the model are larger than expected, residual and increments stop shrinking. Then
//! it has converged too if either is small: more cannot be known.

use super::assemble::{Purpose, unknown_name};
use super::record::{Coefficients, Work};
use crate::error::{Error, Place};
use crate::model::{ArrayK, ArrayX, Dae};
use crate::options::{Jacobian, Newton};
use crate::scalar::Real;
use crate::statistics::Statistics;

/// Residuals below this many ε of their terms are rounding errors.
const ROUNDING: f64 = 4.0;
/// Residuals that no longer shrink are rounding errors of the model below this many ε of their terms.
const NOISE: f64 = 256.0;

impl<M: Dae, T: Real, const S: usize> Work<M, T, S> {
    /// Solves the stages of a step from the start values in `y`; whether the Jacobian that is stored is
    /// that of the solution.
    ///
    /// # Errors
    /// A value of the model that is not finite, a singular matrix, no convergence.
    pub(crate) fn newton(
        &mut self,
        coefficients: &Coefficients<T, S>,
        options: &Newton,
        step: usize,
        x: &ArrayX<M, T>,
        y: &mut ArrayK<M, [T; S]>,
        statistics: &mut Statistics,
    ) -> Result<bool, Error> {
        let rounding = T::EPSILON * T::from_f64(ROUNDING);
        let noise = T::EPSILON * T::from_f64(NOISE);
        // Increments that no longer shrink are rounding errors below this, ε^(2/3).
        let small = T::EPSILON.cbrt() * T::EPSILON.cbrt();
        let tolerance = T::from_f64(options.tolerance).max(rounding);
        let full = options.jacobian == Jacobian::Full;
        let most = options.fixed_iterations.unwrap_or(options.max_iterations);
        let test = options.fixed_iterations.is_none();
        let mut last = Increment { size: T::ZERO, unknown: 0 };
        let mut iteration = 0;
        loop {
            self.place(coefficients, step, x, y);
            let current = full || iteration == 0;
            if current {
                statistics.jacobians += 1;
                self.evaluate_jacobian(step, iteration)?;
            } else {
                statistics.residuals += 1;
                self.evaluate_residual(step, iteration)?;
            }
            if test {
                let before = self.relative.0;
                self.relative = self.relative_residual();
                let (residual, equation, stage) = self.relative;
                let stuck = iteration > 1 && residual >= before;
                if residual <= rounding || stuck && residual <= noise {
                    return Ok(current);
                }
                if iteration == most {
                    return Err(Error::NotConverged {
                        residual: residual.to_f64(),
                        equation,
                        unknown: unknown_name::<M>(last.unknown),
                        increment: last.size.to_f64(),
                        at: Place { step, stage, iteration },
                    });
                }
            }
            if current {
                let h = self.inputs.time.step;
                self.linear.factor(coefficients, h, step, iteration, Purpose::Iteration, statistics)?;
            }
            self.linear.factors.solve(&mut self.residual);
            let increment = self.update(y);
            iteration += 1;
            statistics.iterations += 1;
            if !increment.size.is_finite() {
                return Err(Error::Overflow { step, index: increment.unknown });
            }
            if test {
                if iteration > 1 {
                    let rate = increment.size / last.size;
                    let next = if full {
                        rate * rate * increment.size
                    } else {
                        rate / (T::ONE - rate) * increment.size
                    };
                    // A rate near one says nothing about the next increment.
                    let shrinks = rate + rate < T::ONE;
                    if shrinks && next <= tolerance || !shrinks && increment.size <= small {
                        return Ok(false);
                    }
                }
                if increment.size == T::ZERO {
                    return Ok(false);
                }
            } else if iteration == most {
                return Ok(false);
            }
            last = increment;
        }
    }

    /// `y ← y − Δ` with `Δ` where the residual was; the largest increment relative to the unknown, of
    /// which the largest stage counts.
    fn update(&mut self, y: &mut ArrayK<M, [T; S]>) -> Increment<T> {
        let mut largest = Increment { size: T::ZERO, unknown: 0 };
        for (unknown, (y, delta)) in y.as_mut().iter_mut().zip(self.residual.as_ref()).enumerate() {
            let (mut size, mut change) = (T::ZERO, T::ZERO);
            for (y, [delta]) in y.iter_mut().zip(delta) {
                *y = *y - *delta;
                size = y.abs().max(size);
                if delta.abs() > change || !delta.is_finite() {
                    change = delta.abs();
                }
            }
            // No increment is none, also of zero; an unknown that became zero changed by all it was.
            let relative = if change == T::ZERO { T::ZERO } else { change / size.max(change) };
            if relative > largest.size || !relative.is_finite() {
                largest = Increment { size: relative, unknown };
            }
        }
        largest
    }
}

/// The largest increment of an iteration.
struct Increment<T> {
    /// Relative to the unknown.
    size: T,
    unknown: usize,
}
