//! Dense fallback: Newton's method with partial pivoting of the whole matrix and checks of every
//! value. The Jacobian is updated in every iteration; a [frozen](Jacobian::Frozen) one as soon as
//! increments do not halve. It is used without a planned elimination order, and after the planned
//! elimination has failed: then it either converges or returns the error.
//!
//! A fixed number of iterations has no convergence test. Otherwise the iteration has converged if
//! one of these conditions holds, both invariant under scaling of equations and variables:
//! - the residual of every equation is at rounding level, `|f_r| ≤ 4 ε Σ_c |∂f_r/∂v_c v_c|`;
//! - the expected next increment, at most `θ/(1−θ) ‖Δ‖`, is below the tolerance.
//!
//! If rounding errors of the model are larger than expected, residual and increments stagnate. The
//! iteration has then converged if the residual is below 256 ε of its terms or the increments are
//! below the bound for stagnation.

use crate::error::{Error, Place, Quantity};
use crate::finite::find_non_finite;
use crate::irk::coefficients::Coefficients;
use crate::irk::workspace::StageWorkspace;
use crate::linalg::slot;
use crate::memory::Fallback;
use crate::model::{ArrayK, ArrayX, Dae, Pattern};
use crate::options::{Jacobian, Newton};
use crate::scalar::Real;
use crate::shape::InBounds;
use crate::statistics::Statistics;
use bytemuck::Zeroable;

/// Bound of rounding errors of a residual, in ε relative to its terms.
const RESIDUAL_ROUNDING: f64 = 4.0;
/// Bound of a stagnating residual that counts as rounding error, in ε relative to its terms.
const STAGNATED_RESIDUAL: f64 = 256.0;

impl<M: Dae, T: Real, const S: usize, F: Fallback> StageWorkspace<M, T, S, F> {
    /// Solves for the stages of a step from the initial guess in `y`.
    ///
    /// # Errors
    /// A value of the model that is not finite, a singular matrix, no convergence.
    pub(crate) fn newton_dense(
        &mut self,
        coefficients: &Coefficients<T, S>,
        options: &Newton,
        step: usize,
        x: &ArrayX<M, T>,
        y: &mut ArrayK<M, [T; S]>,
        statistics: &mut Statistics,
    ) -> Result<(), Error> {
        let (rounding, noise) =
            (T::from_f64(T::EPSILON * RESIDUAL_ROUNDING), T::from_f64(T::EPSILON * STAGNATED_RESIDUAL));
        let tolerance = T::from_f64(options.tolerance).max(rounding);
        let mut frozen = options.jacobian == Jacobian::Frozen;
        let max_iterations = options.fixed_iterations.unwrap_or(options.max_iterations);
        let tests_convergence = options.fixed_iterations.is_none();
        let mut last_increment = Increment { size: T::ZERO, unknown: 0 };
        let mut last_residual = T::ZERO;
        let mut iteration = 0;
        self.validity.factors = false;
        loop {
            self.place_stages(coefficients, step, x, y);
            let evaluates_jacobian = !frozen || iteration == 0;
            if evaluates_jacobian {
                statistics.jacobians += 1;
                self.evaluate_jacobian();
            } else {
                statistics.residuals += 1;
                self.evaluate_residual();
            }
            self.check_model(step, iteration)?;
            if tests_convergence {
                let (residual, equation, stage) = self.relative_residual();
                let stagnates = iteration > 1 && residual >= last_residual;
                last_residual = residual;
                // At least one iteration is made, even from an accurate initial guess.
                if iteration > 0 && residual <= rounding || stagnates && residual <= noise {
                    return Ok(());
                }
                if iteration == max_iterations {
                    return Err(Error::NotConverged {
                        residual: residual.to_f64(),
                        equation,
                        unknown: unknown_name::<M>(last_increment.unknown),
                        increment: last_increment.size.to_f64(),
                        at: Place { step, stage, iteration },
                        started: None,
                    });
                }
            }
            if evaluates_jacobian {
                self.factor_dense(coefficients, step, iteration, statistics)?;
            }
            self.solve_dense(coefficients);
            let increment = self.subtract_dense_increment(y);
            iteration += 1;
            statistics.iterations += 1;
            // The first Jacobian is kept while increments halve; an increment that does not shrink
            // is undone.
            let is_rounding = increment.size <= T::from_f64(T::STAGNATION);
            if tests_convergence
                && !evaluates_jacobian
                && !is_rounding
                && increment.size + increment.size >= last_increment.size
            {
                frozen = false;
                if increment.size >= last_increment.size {
                    self.undo_increment(y);
                    continue;
                }
            }
            if !increment.size.is_finite() {
                return Err(Error::Overflow { step, index: increment.unknown });
            }
            let converged = || iteration > 1 && has_converged(increment.size, last_increment.size, tolerance);
            if tests_convergence && (converged() || increment.size == T::ZERO)
                || !tests_convergence && iteration == max_iterations
            {
                return Ok(());
            }
            last_increment = increment;
        }
    }

    /// Factorises the stored Jacobian with partial pivoting of the whole matrix.
    ///
    /// # Errors
    /// [`Error::Singular`]
    pub(crate) fn factor_dense(
        &mut self,
        coefficients: &Coefficients<T, S>,
        step: usize,
        iteration: usize,
        statistics: &mut Statistics,
    ) -> Result<(), Error> {
        let h = self.inputs.time.step;
        statistics.factorizations += 1;
        statistics.dense += usize::from(M::STRUCTURE.elimination.has_plan());
        self.linearization.factors.factor_dense(&self.linearization.jacobian, &coefficients.a, h).map_err(
            |singular| match singular {
                Some((unknown, stage)) => Error::Singular {
                    unknown: unknown_name::<M>(unknown),
                    at: Place { step, stage, iteration },
                },
                None => Error::NotPivoted { step },
            },
        )
    }

    /// Checks that the model has finite values.
    ///
    /// # Errors
    /// The first non-finite value: of the residual, which is more informative, or else of the
    /// Jacobian.
    pub(crate) fn check_model(&self, step: usize, iteration: usize) -> Result<(), Error> {
        let (f, jacobian) = (self.f.as_ref(), self.linearization.jacobian.as_ref());
        let error = |quantity, equation, stage, value| Error::NonFiniteModel {
            quantity,
            equation,
            value,
            at: Place { step, stage, iteration },
        };
        if let Some((index, value)) = find_non_finite(f.as_flattened()) {
            return Err(error(Quantity::Residual, index / S, index % S, value));
        }
        if let Some((index, value)) = find_non_finite(jacobian.as_flattened()) {
            return Err(error(Quantity::Jacobian, M::STRUCTURE.jacobian.at(index / S).0, index % S, value));
        }
        Ok(())
    }

    /// Returns the largest residual relative to the magnitude of its terms,
    /// `|f_r| / Σ_c |∂f_r/∂v_c v_c|`, with its equation and stage. Rounding errors of the model are
    /// a few ε of it, independently of the scaling of equations and variables.
    pub(crate) fn relative_residual(&self) -> (T, usize, usize) {
        let mut magnitude: ArrayK<M, [T; S]> = Zeroable::zeroed();
        let Pattern { rows, columns } = M::STRUCTURE.jacobian;
        for ((row, column), entry) in rows.iter().zip(columns).zip(self.linearization.jacobian.as_ref()) {
            let (magnitude, points) = (magnitude.as_mut(), self.points.as_ref());
            let (Some(magnitude), Some(point)) =
                (magnitude.get_mut(*row as usize).in_bounds(), points.get(*column as usize).in_bounds())
            else {
                continue;
            };
            for ((magnitude, entry), point) in magnitude.iter_mut().zip(entry).zip(point) {
                *magnitude = *magnitude + (*entry * *point).abs();
            }
        }
        let mut largest = (T::ZERO, 0, 0);
        for (equation, (f, magnitude)) in self.f.as_ref().iter().zip(magnitude.as_ref()).enumerate() {
            for (stage, (f, magnitude)) in f.iter().zip(magnitude).enumerate() {
                // A zero residual is zero even if all its terms are zero; sums below the normal
                // numbers count as the smallest normal number; if the terms overflow, the relative
                // residual is one.
                let relative = if *f == T::ZERO {
                    T::ZERO
                } else if magnitude.is_finite() {
                    f.abs() / magnitude.max(T::from_f64(T::SMALLEST))
                } else {
                    T::ONE
                };
                if relative > largest.0 || !relative.is_finite() {
                    largest = (relative, equation, stage);
                }
            }
        }
        largest
    }

    /// `y ← y − Δ`; returns the largest increment relative to its unknown, at the stage where the
    /// unknown is largest.
    fn subtract_dense_increment(&self, y: &mut ArrayK<M, [T; S]>) -> Increment<T> {
        let mut largest = Increment { size: T::ZERO, unknown: 0 };
        for (unknown, (y, delta)) in y.as_mut().iter_mut().zip(self.increment.as_ref()).enumerate() {
            let (mut size, mut change) = (T::ZERO, T::ZERO);
            for (y, [delta]) in y.iter_mut().zip(delta) {
                *y = *y - *delta;
                size = y.abs().max(size);
                if delta.abs() > change || !delta.is_finite() {
                    change = delta.abs();
                }
            }
            // A zero increment counts as zero, also for an unknown of zero; an unknown that became
            // zero changed by its whole value.
            let relative = if change == T::ZERO {
                T::ZERO
            } else {
                change / size.max(change).max(T::from_f64(T::SMALLEST))
            };
            if relative > largest.size || !relative.is_finite() {
                largest = Increment { size: relative, unknown };
            }
        }
        largest
    }

    /// Solves for the increment with the available factors.
    pub(super) fn solve_dense(&mut self, coefficients: &Coefficients<T, S>) {
        for (equation, f) in self.f.as_ref().iter().enumerate() {
            if let Some(to) = self.increment.as_mut().get_mut(slot::<M>(equation)).in_bounds() {
                for (to, f) in to.iter_mut().zip(f) {
                    *to = [*f];
                }
            }
        }
        self.linearization.solve((coefficients, self.inputs.time.step), &mut self.increment);
    }

    /// `y ← y + Δ`
    fn undo_increment(&self, y: &mut ArrayK<M, [T; S]>) {
        for (y, delta) in y.as_mut().iter_mut().zip(self.increment.as_ref()) {
            for (y, [delta]) in y.iter_mut().zip(delta) {
                *y = *y + *delta;
            }
        }
    }
}

/// Whether the expected next increment, from the rate of the last two, is small enough.
fn has_converged<T: Real>(size: T, last: T, tolerance: T) -> bool {
    let rate = size / last;
    // With a current Jacobian the rate decreases too, but differently for each unknown.
    let expected_next = rate / (T::ONE - rate) * size;
    // A rate above one half does not predict the next increment.
    let contracts = rate + rate < T::ONE;
    contracts && expected_next <= tolerance || !contracts && size <= T::from_f64(T::STAGNATION)
}

/// The largest increment of an iteration.
struct Increment<T> {
    /// The increment relative to its unknown.
    size: T,
    unknown: usize,
}

/// Returns the name of an unknown `(k, z)`; for `k` the name of the state.
pub(crate) fn unknown_name<M: Dae>(unknown: usize) -> &'static str {
    let (x, z) = (M::STRUCTURE.x, M::STRUCTURE.z);
    let name = if unknown < x.len() { x.get(unknown) } else { z.get(unknown - x.len()) };
    name.copied().unwrap_or("")
}
