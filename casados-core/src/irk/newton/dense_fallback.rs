//! The careful way: Newton's method with the current Jacobian in every iteration, or that of the
//! first one, as long as increments shrink by it, if it is to be [frozen](Jacobian::Frozen); the
//! whole matrix pivoted, and every value looked at. It is taken where there is no plan of
//! elimination, and where the fast way did not arrive: then it gives the solution, or says what is
//! wrong.
//!
//! A fixed number of iterations is made without a test. Others have converged as soon as one of
//! these holds, both of them invariant under scaling of equations and of variables:
//! - the residual of every equation is at rounding level, `|f_r| ≤ 4 ε Σ_c |∂f_r/∂v_c v_c|`;
//! - the increment that would come next, at most `θ/(1−θ) ‖Δ‖`, is below the tolerance.
//!
//! Where rounding errors of the model are larger than expected, residual and increments stop
//! shrinking. Then they have converged too if either is small: more cannot be known.

use crate::error::{Error, Place, Quantity};
use crate::finite::find_non_finite;
use crate::irk::coefficients::Coefficients;
use crate::irk::workspace::StageWorkspace;
use crate::linalg::slot;
use crate::memory::Fallback;
use crate::model::{ArrayK, ArrayX, Dae, Pattern};
use crate::options::{Jacobian, Newton};
use crate::scalar::Real;
use crate::statistics::Statistics;
use bytemuck::Zeroable;

/// Residuals below this many ε of their terms are rounding errors.
const RESIDUAL_ROUNDING: f64 = 4.0;
/// Residuals that no longer shrink are rounding errors of the model below this many ε of their
/// terms.
const STAGNATED_RESIDUAL: f64 = 256.0;

impl<M: Dae, T: Real, const S: usize, F: Fallback> StageWorkspace<M, T, S, F> {
    /// Solves the stages of a step from the start values in `y`.
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
                // Start values that happen to be good are not yet as good as what one iteration
                // makes of them.
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
            // The first Jacobian does as long as increments shrink to half; one that is no smaller
            // than the last one is not made.
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

    /// Factors of the Jacobian that is stored, the whole matrix pivoted.
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

    /// # Errors
    /// The first value of the model that is not finite: of the residual, which says more, or of the
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

    /// The largest residual relative to the magnitude of its terms, `|f_r| / Σ_c |∂f_r/∂v_c v_c|`,
    /// and its equation and stage. Rounding errors of the model are a few ε of this, however
    /// equations and variables are scaled.
    pub(crate) fn relative_residual(&self) -> (T, usize, usize) {
        let mut magnitude: ArrayK<M, [T; S]> = Zeroable::zeroed();
        let Pattern { rows, columns } = M::STRUCTURE.jacobian;
        for ((row, column), entry) in rows.iter().zip(columns).zip(self.linearization.jacobian.as_ref()) {
            let (magnitude, points) = (magnitude.as_mut(), self.points.as_ref());
            let (Some(magnitude), Some(point)) =
                (magnitude.get_mut(*row as usize), points.get(*column as usize))
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
                // A residual of zero is zero even where all terms are, and none is rounded finer
                // than normal numbers are. Terms that overflow say nothing.
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

    /// `y ← y − Δ`; the largest increment relative to the unknown, of which the largest stage
    /// counts.
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
            // No increment is none, also of zero; an unknown that became zero changed by all it
            // was.
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

    /// The increment by the factors that are there.
    pub(super) fn solve_dense(&mut self, coefficients: &Coefficients<T, S>) {
        for (equation, f) in self.f.as_ref().iter().enumerate() {
            if let Some(to) = self.increment.as_mut().get_mut(slot::<M>(equation)) {
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

/// Whether the increment that comes next is small enough, by how the last two shrank.
fn has_converged<T: Real>(size: T, last: T, tolerance: T) -> bool {
    let rate = size / last;
    // With the current Jacobian it will be less, but how much less differs from unknown to unknown.
    let expected_next = rate / (T::ONE - rate) * size;
    // A rate near one says nothing about the next increment.
    let contracts = rate + rate < T::ONE;
    contracts && expected_next <= tolerance || !contracts && size <= T::from_f64(T::STAGNATION)
}

/// The largest increment of an iteration.
struct Increment<T> {
    /// Relative to the unknown.
    size: T,
    unknown: usize,
}

/// Name of an unknown `(k, z)`: of `k` the state whose derivative it is.
pub(crate) fn unknown_name<M: Dae>(unknown: usize) -> &'static str {
    let (x, z) = (M::STRUCTURE.x, M::STRUCTURE.z);
    let name = if unknown < x.len() { x.get(unknown) } else { z.get(unknown - x.len()) };
    name.copied().unwrap_or("")
}
