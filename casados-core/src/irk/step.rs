//! The loop over the steps of an interval.

use super::newton::dense_fallback::unknown_name;
use super::newton::iteration::StageEquations;
use super::stages::compensated;
use super::stages::initial_guess::{InitialGuess, copy_algebraic_states};
use super::workspace::{FactorValidity, Linearization, StageWorkspace, Step};
use crate::error::{Error, Place};
use crate::finite::{check_output, find_non_finite};
use crate::irk::coefficients::Coefficients;
use crate::irk::coefficients::dot;
use crate::linalg::kernels;
use crate::memory::Fallback;
use crate::model::{ArrayK, ArrayX, Dae};
use crate::options::Options;
use crate::scalar::{Field, Lanes, Real};
use crate::shape::{InBounds, Matrix, Shape, copy_into};
use crate::statistics::Statistics;

/// The method, the options and the initial guess for an interval.
pub(crate) struct IntervalScheme<'a, M: Dae, E: Lanes, const S: usize> {
    pub coefficients: &'a Coefficients<E, S>,
    pub options: &'a Options,
    pub guess: InitialGuess<'a, M, E, S>,
}

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> StageWorkspace<M, E, S, F> {
    /// Prepares the first step of a call.
    pub(crate) fn begin_call(&mut self) {
        self.place_inputs();
        // Discards the factors of the last call, so that results are bitwise reproducible.
        self.validity = Default::default();
        self.compensation.as_mut().fill(E::from_f64(0.0));
    }

    /// Computes `x_{n+1} = x_n + h Σ_i b_i k_i`, and `z` at the ends of the interval.
    pub(crate) fn advance(
        &mut self,
        coefficients: &Coefficients<E, S>,
        compensate: bool,
        step: &Step<M, E, S>,
        n: usize,
        count: usize,
    ) {
        let h = self.inputs.time.step;
        let b = &coefficients.b;
        if const { F::INTERVALS } && compensate {
            let (x, compensation, y) = (self.x.as_mut(), self.compensation.as_mut(), step.y.as_ref());
            compensated::advance(x, compensation, y, b, h);
        } else {
            advance::<M, E, S>(&mut self.x, &step.y, b, h);
        }
        if n == 0 {
            interpolate_algebraic::<M, E, S>(
                self.result.z0.as_mut_slice(),
                &step.y,
                &coefficients.lagrange_start,
            );
        }
        if n + 1 == count {
            interpolate_algebraic::<M, E, S>(
                self.result.z.as_mut_slice(),
                &step.y,
                &coefficients.lagrange_end,
            );
            self.result.x.as_mut_slice().copy_from_slice(self.x.as_ref());
        }
    }
}

impl<M: Dae, T: Real, const S: usize, F: Fallback> StageWorkspace<M, T, S, F> {
    /// Integrates the interval: updates `x` from its start to its end. After each step calls
    /// `after_step` with the step, and with whether the factors in the workspace are those at its
    /// solution.
    ///
    /// # Errors
    /// Those of Newton's method; [`Error::Overflow`].
    pub(crate) fn integrate(
        &mut self,
        scheme: &IntervalScheme<'_, M, T, S>,
        steps: &mut [Step<M, T, S>],
        statistics: &mut Statistics,
        mut after_step: impl FnMut(&mut Self, usize, &Step<M, T, S>, bool, &mut Statistics) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.begin_call();
        let count = if const { F::INTERVALS } { steps.len() } else { 1 };
        for n in 0..count {
            let (earlier_steps, rest) = steps.split_at_mut(n);
            let (before, Some(step)) = (earlier_steps.last(), rest.first_mut()) else { break };
            step.x = self.x;
            let factors_at_solution = self.solve(scheme, n, before, step, statistics)?;
            self.advance(scheme.coefficients, scheme.options.compensated, step, n, count);
            if let Some((index, _)) = find_non_finite(self.x.as_ref()) {
                return Err(Error::Overflow { step: n, index });
            }
            after_step(self, n, step, factors_at_solution, statistics)?;
            statistics.steps += 1;
        }
        for z in [self.result.z0.as_slice(), self.result.z.as_slice()] {
            check_output(z, count - 1)?;
        }
        Ok(())
    }

    /// Solves for the stages of a step by the planned elimination, or if that fails by the dense
    /// fallback. Returns whether the factors in the workspace are those at the solution.
    fn solve(
        &mut self,
        scheme: &IntervalScheme<'_, M, T, S>,
        n: usize,
        previous: Option<&Step<M, T, S>>,
        step: &mut Step<M, T, S>,
        statistics: &mut Statistics,
    ) -> Result<bool, Error> {
        let IntervalScheme { coefficients, options, guess } = scheme;
        self.set_initial_guess(coefficients, guess, n, previous, &mut step.y);
        if matches!(guess, InitialGuess::Solution(_)) {
            return Ok(false);
        }
        let Step { x, y } = step;
        let mut undetermined = None;
        if M::STRUCTURE.elimination.has_plan() {
            let equations = StageEquations { coefficients, stored_linearization: None, n, x };
            let mut newton_result = self.newton(equations, options, y, statistics);
            if newton_result.needs_restart {
                self.set_initial_guess(coefficients, guess, n, previous, y);
                newton_result = self.newton(equations, options, y, statistics);
            }
            let finite = y.as_ref().as_flattened().iter().fold(true, |finite, y| finite & y.is_finite());
            if newton_result.converged && finite {
                return Ok(newton_result.factors_at_solution);
            }
            undetermined = newton_result.undetermined;
            self.set_initial_guess(coefficients, guess, n, None, y);
            if !matches!(guess, InitialGuess::Previous(_)) {
                copy_algebraic_states(previous, y);
            }
        }
        if !F::HAS_MEMORY {
            return Err(
                undetermined.map_or(Error::NotPivoted { step: n }, |unknown| singular_error::<M>(unknown, n))
            );
        }
        #[cfg(feature = "alloc")]
        let initial_y = *y;
        match self.newton_dense(coefficients, &options.newton, n, x, y, statistics) {
            // The check is repeated with the pivoted factors of the whole matrix.
            Ok(()) if undetermined.is_some() => match self.is_determined(coefficients, n, x, y).1 {
                Some(unknown) => Err(singular_error::<M>(unknown, n)),
                None => Ok(false),
            },
            Ok(()) => Ok(false),
            // Start values that are solutions up to rounding are accepted if Newton's method
            // diverges from them.
            Err(_) if cfg!(feature = "alloc") && self.start_near_solution => {
                self.set_initial_guess(coefficients, guess, n, None, y);
                Ok(false)
            }
            Err(error) => {
                if n == 0 {
                    return Err(self.explain_first_step(error, guess));
                }
                #[cfg(feature = "alloc")]
                let error = self.explain_fold(error, coefficients, (n, x), &initial_y, y);
                Err(error)
            }
        }
    }

    /// Linearises a step at its solution; `factors_at_solution` is whether the workspace has its
    /// factors already.
    ///
    /// # Errors
    /// A value of the model that is not finite, a singular matrix.
    pub(crate) fn linearize(
        &mut self,
        coefficients: &Coefficients<T, S>,
        n: usize,
        step: &Step<M, T, S>,
        factors_at_solution: bool,
        statistics: &mut Statistics,
    ) -> Result<(), Error> {
        self.linearize_planned(coefficients, None, n, step, factors_at_solution, statistics);
        self.check_model(n, 0)?;
        if !M::STRUCTURE.elimination.has_plan() {
            self.factor_dense(coefficients, n, 0, statistics)?;
        }
        Ok(())
    }
}

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> StageWorkspace<M, E, S, F> {
    /// Linearises a step at its solution, with the planned elimination if there is a plan; writes
    /// the factors to `to`, if given.
    pub(crate) fn linearize_planned(
        &mut self,
        coefficients: &Coefficients<E, S>,
        to: Option<&mut Linearization<M, E, S, F>>,
        n: usize,
        step: &Step<M, E, S>,
        factors_at_solution: bool,
        statistics: &mut Statistics,
    ) {
        self.place_stages(coefficients, n, &step.x, &step.y);
        statistics.jacobians += 1;
        self.evaluate_jacobian();
        let factors_current = factors_at_solution || M::STRUCTURE.constant_matrix && self.validity.factors;
        if !factors_current && M::STRUCTURE.elimination.has_plan() {
            statistics.factorizations += 1;
            let h = self.inputs.time.step;
            let Linearization { jacobian, factors } = &mut self.linearization;
            let factors = match to {
                Some(to) => {
                    copy_into(&mut to.jacobian, jacobian);
                    &mut to.factors
                }
                None => factors,
            };
            factors.factor_by_plan(jacobian, &coefficients.a, h);
            self.validity = FactorValidity { factors: true, shared: false, rate: 0.0 };
        }
    }
}

/// The error of equations that do not determine an unknown.
fn singular_error<M: Dae>(unknown: usize, step: usize) -> Error {
    Error::Singular { unknown: unknown_name::<M>(unknown), at: Place { step, stage: 0, iteration: 1 } }
}

/// Evaluates algebraic states at a point of the polynomial through the stages.
pub(crate) fn interpolate_algebraic<M: Dae, E: Lanes, const S: usize>(
    z: &mut [E],
    y: &ArrayK<M, [E; S]>,
    lagrange: &[E; S],
) {
    let y = y.as_ref().get(M::Shape::NX..).in_bounds().unwrap_or_default();
    combine(z, y, lagrange);
}

kernels! {
    /// `Σ_i weight_i y_i` of each unknown.
    fn combine [E: Field, const S: usize] [E, S] <A>(
        to: &'k mut [E],
        y: &'k [[E; S]],
        weights: &'k [E; S],
    ) {
        for (to, y) in to.iter_mut().zip(y) {
            *to = dot(weights, y);
        }
    }
}

kernels! {
    /// `x ← x + h Σ_i b_i k_i`
    fn advance [M: Dae, E: Lanes, const S: usize] [M, E, S] <A>(
        x: &'k mut ArrayX<M, E>,
        y: &'k ArrayK<M, [E; S]>,
        b: &'k [E; S],
        h: E,
    ) {
        for (x, k) in x.as_mut().iter_mut().zip(y.as_ref()) {
            *x = *x + h * dot(b, k);
        }
    }
}
