//! The initial guess of Newton's method: the unknowns of the stages before the first iteration.

use crate::irk::coefficients::{Coefficients, stage_values};
use crate::irk::workspace::{StageWorkspace, Step};
use crate::linalg::{kernels, minus_ha};
use crate::memory::Fallback;
use crate::model::{ArrayK, Dae};
use crate::scalar::{Field, Lanes};
use crate::shape::{Shape, copy_into};

/// The initial guess of the unknowns of the stages.
pub(crate) enum InitialGuess<'a, M: Dae, E: Lanes, const S: usize> {
    /// The nominal values of the model.
    Nominal,
    Zero,
    Given,
    Previous(&'a [Step<M, E, S>]),
    /// Stages that are a solution.
    Solution(&'a [Step<M, E, S>]),
}

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> StageWorkspace<M, E, S, F> {
    /// Sets the initial guess of step `n`. After the first step it extrapolates the preceding step;
    /// without extrapolation polynomials it copies the algebraic states of the preceding step.
    pub(crate) fn set_initial_guess(
        &mut self,
        coefficients: &Coefficients<E, S>,
        guess: &InitialGuess<'_, M, E, S>,
        n: usize,
        previous: Option<&Step<M, E, S>>,
        y: &mut ArrayK<M, [E; S]>,
    ) {
        self.identical_stages = false;
        match (guess, previous, &coefficients.lagrange_next) {
            (InitialGuess::Previous(steps) | InitialGuess::Solution(steps), ..) => {
                if let Some(step) = steps.get(n) {
                    copy_into(y, &step.y);
                }
            }
            (_, Some(before), Some(next)) if const { F::INTERVALS } => {
                extrapolate(before.y.as_ref(), next, y.as_mut());
            }
            (InitialGuess::Nominal | InitialGuess::Zero, ..) => {
                y.as_mut().fill([E::from_f64(0.0); S]);
                self.identical_stages = M::STRUCTURE.autonomous;
                if matches!(guess, InitialGuess::Nominal) {
                    for (y, start) in y.as_mut().iter_mut().zip(M::START) {
                        *y = [E::from_f64(*start); S];
                    }
                    self.identical_stages &= const { starts_at_rest::<M>() };
                }
            }
            (InitialGuess::Given, ..) => {
                for (y, given) in y.as_mut().iter_mut().zip(self.start_values.as_ref()) {
                    *y = [*given; S];
                }
            }
        }
        if coefficients.lagrange_next.is_none()
            && !matches!(guess, InitialGuess::Previous(_) | InitialGuess::Solution(_))
        {
            copy_algebraic_states(previous, y);
        }
    }
}

/// Copies the algebraic states of the last stage of the preceding step, which are on the same
/// branch.
pub(in crate::irk) fn copy_algebraic_states<M: Dae, E: Lanes, const S: usize>(
    previous: Option<&Step<M, E, S>>,
    y: &mut ArrayK<M, [E; S]>,
) {
    let Some(before) = previous else { return };
    for (y, before) in y.as_mut().iter_mut().zip(before.y.as_ref()).skip(M::Shape::NX) {
        if let Some(&last) = before.last() {
            *y = [last; S];
        }
    }
}

/// Whether every `ẋ` starts at zero, so that the stages are identical.
const fn starts_at_rest<M: Dae>() -> bool {
    let mut unknown = 0;
    while unknown < M::Shape::NX && unknown < M::START.len() {
        if M::START[unknown] != 0.0 {
            return false;
        }
        unknown += 1;
    }
    true
}

kernels! {
    /// Evaluates the polynomial through the stages at the stages of the next step.
    fn extrapolate [E: Field, const S: usize] [E, S] <A>(
        from: &'k [[E; S]],
        next: &'k [[E; S]; S],
        to: &'k mut [[E; S]],
    ) {
        // The matrix of Lagrange polynomials multiplies the stage values as `hA` multiplies
        // derivatives.
        let minus_next = minus_ha(next, E::from_f64(1.0));
        for (to, from) in to.iter_mut().zip(from) {
            *to = stage_values::<A, E, S>(E::from_f64(0.0), &minus_next, from);
        }
    }
}
