//! Start values of Newton's method in errors.

use super::dense_fallback::unknown_name;
use crate::error::{Error, Started};
use crate::finite::find_non_finite;
use crate::irk::jacobian_entries::entries;
use crate::irk::stages::initial_guess::InitialGuess;
use crate::irk::workspace::StageWorkspace;
use crate::memory::Fallback;
use crate::model::Dae;
use crate::scalar::Real;
use crate::shape::{InBounds, Shape};

/// Values of an algebraic state that are tried if an equation is undefined at its start value.
const TRIAL_VALUES: [f64; 4] = [1.0, -1.0, 1e-3, 1e3];

impl<M: Dae, T: Real, const S: usize, F: Fallback> StageWorkspace<M, T, S, F> {
    /// Returns the error of the first step as [`explain_with_start`](Self::explain_with_start)
    /// does; after a warm start it is unchanged.
    pub(in crate::irk) fn explain_first_step(
        &mut self,
        error: Error,
        guess: &InitialGuess<'_, M, T, S>,
    ) -> Error {
        let given = self.start_values;
        match guess {
            InitialGuess::Nominal => self.add_start_value(error, &|unknown| M::START.get(unknown).copied()),
            InitialGuess::Given => {
                self.add_start_value(error, &|unknown| given.as_ref().get(unknown).map(|z| z.to_f64()))
            }
            InitialGuess::Zero => self.add_start_value(error, &|_| None),
            InitialGuess::Previous(_) | InitialGuess::Solution(_) => error,
        }
    }

    /// Adds to the error the algebraic state that caused it, and its start value (zero without
    /// one). Errors of models without algebraic states are returned unchanged.
    #[cold]
    pub(in crate::irk) fn add_start_value(
        &mut self,
        error: Error,
        start: &dyn Fn(usize) -> Option<f64>,
    ) -> Error {
        if const { M::Shape::NZ == 0 } {
            return error;
        }
        let nx = M::Shape::NX;
        let started =
            |unknown| Started { unknown: unknown_name::<M>(unknown), value: start(unknown).unwrap_or(0.0) };
        match error {
            Error::NonFiniteModel { quantity, equation, value, at } => {
                let Some(unknown) = self.find_undefined_state(equation) else { return error };
                let started = started(unknown);
                Error::NonFiniteStart { quantity, equation, value, started, at }
            }
            Error::NotConverged { residual, equation, unknown, increment, at, .. } => {
                let own = (nx..M::Shape::NK).find(|index| unknown_name::<M>(*index) == unknown);
                let own = own.or_else(|| Self::find_algebraic(equation, &mut |_| true));
                let started = own.map(started);
                Error::NotConverged { residual, equation, unknown, increment, at, started }
            }
            other => other,
        }
    }

    /// Returns the first algebraic state of an equation that satisfies the predicate, as an
    /// unknown.
    fn find_algebraic(equation: usize, predicate: &mut dyn FnMut(usize) -> bool) -> Option<usize> {
        let [_, _, begin, end, ..] = M::STRUCTURE.blocks;
        for entry in begin..end {
            let Some((row, column)) = M::STRUCTURE.jacobian.get(entry).in_bounds() else { continue };
            let unknown = column.saturating_sub(M::Shape::NX);
            if row == equation && predicate(unknown) {
                return Some(unknown);
            }
        }
        None
    }

    /// Returns the algebraic state at whose value an equation is undefined, while it is defined at
    /// another one. Overwrites the points of the stages.
    fn find_undefined_state(&mut self, equation: usize) -> Option<usize> {
        Self::find_algebraic(equation, &mut |unknown| {
            let variable = unknown + M::Shape::NX;
            let Some(start) = self.points.as_ref().get(variable).in_bounds().copied() else { return false };
            let mut has_value = false;
            for value in TRIAL_VALUES {
                self.set_perturbed_stage_variable(variable, [T::from_f64(value); S]);
                self.evaluate_jacobian();
                has_value = self.is_equation_finite(equation);
                if has_value {
                    break;
                }
            }
            self.set_perturbed_stage_variable(variable, start);
            has_value
        })
    }

    /// Whether the residual of an equation and its row of the Jacobian are finite.
    fn is_equation_finite(&self, equation: usize) -> bool {
        let jacobian = self.linearization.jacobian.as_ref();
        for (row, _, values) in entries::<M, _>(jacobian) {
            if row == equation && find_non_finite(values).is_some() {
                return false;
            }
        }
        self.f.as_ref().get(equation).is_some_and(|f| find_non_finite(f).is_none())
    }

    fn set_perturbed_stage_variable(&mut self, variable: usize, value: [T; S]) {
        if let Some(point) = self.points.as_mut().get_mut(variable).in_bounds() {
            *point = value;
        }
    }
}
