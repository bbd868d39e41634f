//! Compensated sums for long runs: rounding errors of single steps accumulate, with the same errors
//! at the same points of a periodic orbit. With
//! [`Options::compensated`](crate::Options::compensated) four quantities are therefore computed
//! with more digits than those of `x`:
//!
//! - `x` itself, by a compensation (E. Hairer, R. I. McLachlan, A. Razakarivony, "Achieving
//!   Brouwer's law with implicit Runge-Kutta methods", BIT 48, 2008), and the change of a step,
//!   `h Σ_i b_i k_i`, to twice the digits;
//! - the sums of the stages, `ξ_i + δ_i = x + h Σ_j a_ij k_j`: the model is evaluated at `ξ_i`, and
//!   `f_x δ_i` is added to its residual, for which the Jacobian of any iteration is accurate
//!   enough;
//! - the coefficients of symplectic methods, corrected so that `b_i a_ij + b_j a_ji = b_i b_j`
//!   holds to twice the digits. A method that is symplectic, with order conditions that hold to
//!   rounding, has no drift of quadratic invariants; a method that is symplectic to rounding only
//!   has a drift that grows with every step.
//!
//! The rounding errors of the model remain. Products are exact on machines with a fused
//! multiply-add instruction; on others only sums are compensated.

use crate::irk::coefficients::Coefficients;
use crate::irk::coefficients::dot;
use crate::irk::jacobian_entries::entries;
use crate::irk::workspace::StageWorkspace;
use crate::linalg::{Arithmetic, Kernel, axpy_compensated, dispatch, dot_compensated, kernels, two_product};
use crate::memory::Fallback;
use crate::model::{ArrayK, ArrayX, Dae};
use crate::scalar::{Field, Lanes, two_sum};
use crate::shape::{InBounds, Shape};

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> StageWorkspace<M, E, S, F> {
    /// Writes `ξ_i` to the points, and stores `δ_i` for
    /// [`correct_residual`](Self::correct_residual).
    pub(crate) fn place_compensated(
        &mut self,
        coefficients: &Coefficients<E, S>,
        x: &ArrayX<M, E>,
        y: &ArrayK<M, [E; S]>,
    ) {
        let states = M::Shape::NX..2 * M::Shape::NX;
        let [beyond, _] = &mut self.variable_scratch;
        dispatch(PlaceCompensated {
            points: self.points.as_mut().get_mut(states.clone()).in_bounds().unwrap_or_default(),
            stage_compensation: beyond.as_mut().get_mut(states).in_bounds().unwrap_or_default(),
            x: x.as_ref(),
            compensation: self.compensation.as_ref(),
            y: y.as_ref(),
            a: &coefficients.a,
            b: &coefficients.b,
            symplectic: coefficients.tableau.is_symplectic(),
            h: self.inputs.time.step,
        });
    }

    /// `f ← f + f_x δ`, with the available Jacobian.
    pub(crate) fn correct_residual(&mut self) {
        let (begin, end) = (M::Shape::NX, 2 * M::Shape::NX);
        let (jacobian, [beyond, _]) = (self.linearization.jacobian.as_ref(), &self.variable_scratch);
        for (r, c, values) in entries::<M, _>(jacobian) {
            if !(begin..end).contains(&c) {
                continue;
            }
            if let (Some(f), Some(beyond)) =
                (self.f.as_mut().get_mut(r).in_bounds(), beyond.as_ref().get(c).in_bounds())
            {
                for ((f, value), beyond) in f.iter_mut().zip(values).zip(beyond) {
                    *f = *f + *value * *beyond;
                }
            }
        }
    }
}

struct PlaceCompensated<'a, E, const S: usize> {
    points: &'a mut [[E; S]],
    stage_compensation: &'a mut [[E; S]],
    x: &'a [E],
    compensation: &'a [E],
    y: &'a [[E; S]],
    a: &'a [[E; S]; S],
    b: &'a [E; S],
    symplectic: bool,
    h: E,
}

impl<E: Field, const S: usize> Kernel for PlaceCompensated<'_, E, S> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { points, stage_compensation: beyond, x, compensation, y, a, b, symplectic, h } = self;
        let correction =
            if symplectic { symplectic_correction::<A, E, S>(a, b) } else { [[E::from_f64(0.0); S]; S] };
        let states = x.iter().zip(compensation).zip(y);
        for ((xi, beyond), ((&x, &compensation), k)) in points.iter_mut().zip(beyond).zip(states) {
            for ((xi, beyond), (a, more)) in xi.iter_mut().zip(beyond).zip(a.iter().zip(&correction)) {
                let [sum, lost] = dot_compensated::<A, E>(a.iter().zip(k));
                [*xi, *beyond] = axpy_compensated::<A, E>([x, compensation], h, [sum, lost + dot(more, k)]);
            }
        }
    }
}

/// The correction of `A` beyond its digits for `b_i a_ij + b_j a_ji = b_i b_j`.
#[inline(always)]
fn symplectic_correction<A: Arithmetic, E: Field, const S: usize>(
    a: &[[E; S]; S],
    b: &[E; S],
) -> [[E; S]; S] {
    let mut correction = [[E::from_f64(0.0); S]; S];
    for i in 0..S {
        for j in 0..=i {
            let [whole, rest] = two_product::<A, E>(b[i], b[j]);
            let [above, rest_above] = two_product::<A, E>(b[i], a[i][j]);
            let [below, rest_below] = two_product::<A, E>(b[j], a[j][i]);
            let [part, lost] = two_sum(whole, -above);
            let missing = (part - below) + (lost + (rest - rest_above - rest_below));
            let half = missing * E::from_f64(0.5);
            correction[i][j] = half / b[i];
            correction[j][i] = half / b[j];
        }
    }
    correction
}

kernels! {
    /// `x + e ← x + e + h Σ_i b_i k_i`, with the compensation `e` below the last digit of `x`.
    pub(in crate::irk) fn advance [E: Field, const S: usize] [E, S] <A>(
        x: &'k mut [E],
        compensation: &'k mut [E],
        y: &'k [[E; S]],
        b: &'k [E; S],
        h: E,
    ) {
        for ((x, compensation), k) in x.iter_mut().zip(compensation).zip(y) {
            [*x, *compensation] = axpy_compensated::<A, E>([*x, *compensation], h, dot_compensated::<A, E>(b.iter().zip(k)));
        }
    }
}
