//! Whether linear equations determine their solution, or only the digits that rounding has left of
//! a matrix that is singular.
//!
//! One iteration of Newton's method solves them, and leaves residuals at rounding level however
//! large the condition of the matrix is. Nonlinear equations that are as bad do not converge; of
//! linear ones nothing would be seen. A pivot that is small beside the terms of its equation is the
//! reason to look: an iteration leads from any point to the solution of linear equations, so that
//! from a few points around it solutions differ by what rounding makes of the residual there, and
//! are known to the digits that they have in common (stochastic arithmetic: J. Vignes, Math.
//! Comput. Simul. 35 (1993)). What is looked at are residuals as the model evaluates them: a matrix
//! may be as stiff as it likes. Where the planned elimination is to blame, pivoting the whole
//! matrix tells.

use super::increment::subtract_increment;
use crate::irk::coefficients::Coefficients;
use crate::irk::workspace::StageWorkspace;
use crate::linalg::kinematic;
use crate::memory::Fallback;
use crate::model::{ArrayK, ArrayX, Dae};
use crate::scalar::{Lanes, Scalar};

/// A pivot is small if what it is divided by this leaves less of the terms of its equation, in
/// units of rounding: five digits are left.
const SMALL_PIVOT: f64 = 1.0 / 65536.0;
/// Points that are tried.
const PERTURBED_POINTS: usize = 4;
/// How far away they are at most, in parts of the unknowns: far enough that nothing is rounded as
/// it was.
const MAX_PERTURBATION: f64 = 0.5;
/// Where a state rests its derivative has no digits: a change in a step below this part of the
/// state counts as one of this size.
const MIN_RELATIVE_CHANGE: f64 = 1.0 / 64.0;
/// Solutions that differ by this part of themselves are none.
const MAX_SOLUTION_SPREAD: f64 = 1.0 / 32.0;

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> StageWorkspace<M, E, S, F> {
    /// Whether a pivot is so small beside the terms of its equation, which were just
    /// [found](Self::is_satisfied), that `y` may be rounding errors.
    pub(in crate::irk) fn has_small_pivot(&self, x: &ArrayX<M, E>, y: &ArrayK<M, [E; S]>) -> bool {
        let factors = self.linearization.factors.planned();
        let h = self.inputs.time.step.abs();
        let bound = E::from_f64(SMALL_PIVOT / E::EPSILON);
        let mut small = E::lt(h, h);
        for pivot in M::STRUCTURE.elimination.pivots {
            if pivot.identity {
                continue;
            }
            let (slot, equation) = (pivot.slot as usize, pivot.equation as usize);
            let (Some(inverse), Some(y), Some(terms)) = (
                factors.blocks.get(pivot.block as usize),
                y.as_ref().get(slot),
                self.equation_magnitudes.as_ref().get(equation),
            ) else {
                continue;
            };
            let amplified = inverse[0][0].abs() * terms[0];
            // Mostly that is all there is to be asked.
            if E::any(E::lt(bound * y[0].abs(), amplified)) {
                let unknown_size = unknown_size(y, x.as_ref().get(slot).copied(), h);
                small = E::or(small, E::lt(bound * unknown_size, amplified));
            }
        }
        E::any(small)
    }

    /// The lanes in which `y` is a solution to more than a digit, and an unknown that is not in the
    /// others.
    #[cold]
    #[inline(never)]
    pub(in crate::irk) fn is_determined(
        &mut self,
        coefficients: &Coefficients<E, S>,
        step: usize,
        x: &ArrayX<M, E>,
        y: &ArrayK<M, [E; S]>,
    ) -> (E::Mask, Option<usize>) {
        let (h, zero) = (self.inputs.time.step.abs(), E::from_f64(0.0));
        let reference = self.newton_iterate(coefficients, step, x, y);
        let (mut good, mut undetermined, mut seed) = (E::le(zero, zero), None, 1u32);
        for _ in 0..PERTURBED_POINTS {
            let mut perturbed = *y;
            for y in perturbed.as_mut().as_flattened_mut() {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let part = f64::from(seed >> 8) * (1.0 / f64::from(1u32 << 23)) - 1.0;
                *y = *y + *y * E::from_f64(MAX_PERTURBATION * part);
            }
            let other = self.newton_iterate(coefficients, step, x, &perturbed);
            for (unknown, (reference, other)) in reference.as_ref().iter().zip(other.as_ref()).enumerate() {
                // Those of kinematic states are not iterated.
                if kinematic::<M>(unknown).is_some() {
                    continue;
                }
                let unknown_size = unknown_size(reference, x.as_ref().get(unknown).copied(), h);
                let mut difference = zero;
                for (&reference, &other) in reference.iter().zip(other) {
                    difference = (reference - other).abs().max(difference);
                }
                let agrees = E::le(difference, E::from_f64(MAX_SOLUTION_SPREAD) * unknown_size);
                if !E::all(agrees) {
                    undetermined = Some(unknown);
                }
                good = E::and(good, agrees);
            }
        }
        (good, undetermined)
    }

    /// What an iteration makes of `y`.
    fn newton_iterate(
        &mut self,
        coefficients: &Coefficients<E, S>,
        step: usize,
        x: &ArrayX<M, E>,
        y: &ArrayK<M, [E; S]>,
    ) -> ArrayK<M, [E; S]> {
        self.place_unknowns(coefficients, step, x, y);
        self.evaluate_residual();
        self.place_residual();
        self.linearization.factors.solve(&mut self.increment);
        let mut y = *y;
        subtract_increment(y.as_mut(), self.increment.as_ref());
        y
    }
}

/// The size of an unknown at its stages; of a derivative at least one by which a state changes in a
/// step by a part of itself, and infinite in an interval without length, in which it changes
/// nothing. Below normal numbers there are no digits to be lost.
fn unknown_size<E: Lanes, const S: usize>(y: &[E; S], x: Option<E>, h: E) -> E {
    let smallest = E::from_f64(E::SMALLEST / E::EPSILON);
    let own = y.iter().fold(smallest, |size, y| y.abs().max(size));
    let infinite = E::from_f64(f64::INFINITY);
    x.map_or(own, |x| {
        let smallest_derivative = E::from_f64(MIN_RELATIVE_CHANGE) * x.abs() / h;
        E::select(Scalar::eq(h, E::from_f64(0.0)), infinite, smallest_derivative.max(own))
    })
}
