//! Detects nearly singular linear equations, whose solution consists of rounding errors.
//!
//! One iteration of Newton's method solves linear equations, with residuals at rounding level even
//! if the matrix is nearly singular. (Nonlinear equations do not converge then.) A pivot that is
//! small relative to the terms of its equation triggers the check: Newton's method is applied to a
//! few perturbed points. From each of them one iteration leads to the solution, up to the rounding
//! errors of the residual there, so that the solution is known to the digits that the results have
//! in common (stochastic arithmetic: J. Vignes, Math. Comput. Simul. 35 (1993)). The residuals are
//! those of the model, so that stiffness of the matrix is irrelevant. The dense fallback decides
//! whether the planned elimination is the cause.

use super::increment::subtract_increment;
use crate::irk::coefficients::Coefficients;
use crate::irk::workspace::StageWorkspace;
use crate::linalg::kinematic;
use crate::memory::Fallback;
use crate::model::{ArrayK, ArrayX, Dae};
use crate::scalar::{Lanes, Scalar};
use crate::shape::InBounds;

/// A pivot is small if rounding errors of the terms of its equation, divided by the pivot, exceed
/// this fraction of the unknown: fewer than five digits are left.
const SMALL_PIVOT: f64 = 1.0 / 65536.0;
/// Number of perturbed points.
const PERTURBED_POINTS: usize = 4;
/// Largest relative perturbation of the unknowns: large enough to change all rounding errors.
const MAX_PERTURBATION: f64 = 0.5;
/// Smallest change of a state in a step, relative to the state, for the size of its derivative: in
/// a steady state the derivative consists of rounding errors.
const MIN_RELATIVE_CHANGE: f64 = 1.0 / 64.0;
/// Maximal relative difference between solutions.
const MAX_SOLUTION_SPREAD: f64 = 1.0 / 32.0;

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> StageWorkspace<M, E, S, F> {
    /// Whether a pivot is so small relative to the terms of its equation that `y` may consist of
    /// rounding errors. The magnitudes of the terms are those of
    /// [`residual_is_rounding`](Self::residual_is_rounding).
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
                factors.blocks.get(pivot.block as usize).in_bounds(),
                y.as_ref().get(slot).in_bounds(),
                self.equation_magnitudes.as_ref().get(equation).in_bounds(),
            ) else {
                continue;
            };
            let amplified = inverse[0][0].abs() * terms[0];
            // The first stage is sufficient in most cases.
            if E::any(E::lt(bound * y[0].abs(), amplified)) {
                let unknown_size = unknown_size(y, x.as_ref().get(slot).copied(), h);
                small = E::or(small, E::lt(bound * unknown_size, amplified));
            }
        }
        E::any(small)
    }

    /// Returns the lanes in which `y` is determined to more than a digit, and an unknown that is
    /// not determined in one of the others.
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
                // Kinematic states are not iterated.
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

    /// Applies one iteration to `y`.
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

/// The size of an unknown at its stages. For a derivative at least [`MIN_RELATIVE_CHANGE`] of the
/// state per step; infinite for a step of length zero, in which it has no effect. Values below the
/// normal numbers count as their limit.
fn unknown_size<E: Lanes, const S: usize>(y: &[E; S], x: Option<E>, h: E) -> E {
    let smallest = E::from_f64(E::SMALLEST / E::EPSILON);
    let own = y.iter().fold(smallest, |size, y| y.abs().max(size));
    let infinite = E::from_f64(f64::INFINITY);
    x.map_or(own, |x| {
        let smallest_derivative = E::from_f64(MIN_RELATIVE_CHANGE) * x.abs() / h;
        E::select(Scalar::eq(h, E::from_f64(0.0)), infinite, smallest_derivative.max(own))
    })
}
