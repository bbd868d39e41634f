//! Forward derivatives to the digits that the equations determine, not only those of the assembled
//! Jacobian.
//!
//! An entry of the Jacobian is a sum that rounds away what is small in it. Where the sum of several
//! equations is slow while each is fast, as with the mass of a chemical reaction over a long step,
//! what is small is all there is of the slow motion. A tangent of the model has no such sums: terms
//! that equations share are rounded once, and cancel. So
//!
//! ```text
//! r_i = f_ẋ dk_i + f_x (V_n + h Σ_j a_ij dk_j) + f_z dz_i + f_w
//! ```
//!
//! is computed by tangents, and corrected with the factors that are there (iterative refinement; C.
//! B. Moler, J. ACM 14, 1967). One sum of all directions tells whether that is worth it.

use super::checksum::total;
use super::dense_fallback::put;
use super::output::Target;
use super::sweep::{Linearized, Outputs, Sweep};
use crate::irk::coefficients::{Coefficients, stage_values};
use crate::irk::directions::{Directions, panel, panel_mut, panels};
use crate::irk::workspace::Work;
use crate::linalg::{Arithmetic, Kernel, PanelRow, dispatch, minus_ha, slot};
use crate::memory::Fallback;
use crate::model::{ArrayK, ArrayV, Dae};
use crate::scalar::{Lanes, Piece, Real, SideBySide, Tangent};
use crate::shape::{Array, Shape};
use bytemuck::Zeroable;
use core::marker::PhantomData;

/// A correction below this many ε of its unknown is none.
const ROUNDING: f64 = 4096.0;

/// So often derivatives are refined.
const REFINEMENTS: usize = 3;

impl<M: Dae, T: Real, R: Array<T>, const S: usize> Sweep<M, T, R, S> {
    /// After a step whose derivatives satisfy their equations as the Jacobian has them: mends them,
    /// and what follows from them, where those of the model are others.
    pub(in crate::irk) fn refine<D: Directions<T>, G: Target<T>, F: Fallback>(
        &mut self,
        work: &mut Work<M, T, S, F>,
        of: Linearized<'_, M, T, D, S, F>,
        outputs: &mut Outputs<'_, T, G>,
    ) {
        let Linearized { coefficients, directions, .. } = of;
        let mut last = f64::INFINITY;
        for _ in 0..REFINEMENTS {
            let correction = self.correction(work, coefficients);
            // Also if it is not a number: then there is nothing to be refined with.
            if !(correction > ROUNDING * T::EPSILON && correction < 0.5 * last) {
                return;
            }
            last = correction;
            self.refine_columns(work, coefficients, directions);
            self.conclude(work, of, outputs);
            // Each correction is that part of the one before.
            if correction * correction <= ROUNDING * T::EPSILON {
                return;
            }
            work.verify_forward(self, coefficients, directions, false);
        }
    }

    /// The largest correction of the sum of all directions, relative to each unknown; of a slope
    /// also to what it changes, `V_n / h`. The sum is where it was tried on the equations.
    fn correction<F: Fallback>(&self, work: &mut Work<M, T, S, F>, coefficients: &Coefficients<T, S>) -> f64 {
        let (nx, h) = (M::Shape::NX, work.inputs.time.step);
        work.probe_tangent();
        let Work { probe: [sum, tangent], increment, linear, .. } = work;
        for (equation, tangent) in tangent.as_ref().iter().enumerate().take(M::Shape::NK) {
            if let Some(to) = increment.as_mut().get_mut(slot::<M>(equation)) {
                *to = tangent.map(|element| [element]);
            }
        }
        linear.solve((coefficients, h), increment);
        let mut largest = 0.0f64;
        for (unknown, correction) in increment.as_ref().iter().enumerate() {
            let own = if unknown < nx { unknown } else { unknown + nx };
            let start = self.start_sums.as_ref().get(unknown).map_or(T::ZERO, |sum| total(sum) / h).abs();
            let size = sum.as_ref().get(own).into_iter().flatten();
            let size = size.fold(start.max(T::from_f64(T::SMALLEST)), |size, sum| sum.abs().max(size));
            for [correction] in correction {
                let relative = (correction.abs() / size).to_f64();
                if relative.is_nan() {
                    return relative;
                }
                largest = largest.max(relative);
            }
        }
        largest
    }

    /// One correction of every direction.
    fn refine_columns<D: Directions<T>, F: Fallback>(
        &mut self,
        work: &mut Work<M, T, S, F>,
        coefficients: &Coefficients<T, S>,
        directions: D,
    ) {
        let (nx, nk) = (M::Shape::NX, M::Shape::NK);
        panels!([D::COLUMNS, directions.columns()], T, S, column, W => {
            let mut right = ArrayK::<M, PanelRow<T, S, W>>::zeroed();
            for c in 0..W {
                let inputs = work.probe[0].as_mut().get_mut(nx + nk..).unwrap_or_default();
                for (index, input) in inputs.iter_mut().enumerate() {
                    let mut row = [T::ZERO; 1];
                    directions.add(nx + index, T::ONE, column + c, &mut row);
                    *input = [row[0]; S];
                }
                dispatch(Aim::<M, T, S, W> {
                    v: panel(self.v(), column, nx),
                    dy: panel(self.dy(), column, nk * S).as_chunks().0,
                    a: &coefficients.a,
                    h: work.inputs.time.step,
                    c,
                    probe: work.probe[0].as_mut(),
                    model: PhantomData,
                });
                work.probe_tangent();
                for (equation, tangent) in work.probe[1].as_ref().iter().enumerate().take(nk) {
                    if let Some(rows) = right.as_mut().get_mut(slot::<M>(equation)) {
                        put(tangent, rows, c);
                    }
                }
            }
            work.linear.solve::<W>((coefficients, work.inputs.time.step), &mut right);
            let dy = panel_mut::<T, W>(R::flat_mut(self.dy_mut()), column, nk * S);
            correct(dy.as_flattened_mut(), right.as_ref().as_flattened().as_flattened());
        });
    }
}

/// `x ← x − Δ`. Seldom needed: a loop of its own is not unrolled.
#[cfg_attr(feature = "std", inline(never))]
fn correct<T: Real>(x: &mut [T], corrections: &[T]) {
    for (x, correction) in x.iter_mut().zip(corrections) {
        *x = *x - *correction;
    }
}

/// The direction of one column, `(dk, V_n + h Σ_j a_j dk_j, dz)` at all stages.
struct Aim<'a, M, T, const S: usize, const W: usize> {
    v: &'a [[T; W]],
    dy: &'a [PanelRow<T, S, W>],
    a: &'a [[T; S]; S],
    h: T,
    c: usize,
    probe: &'a mut [[T; S]],
    model: PhantomData<M>,
}

impl<M: Dae, T: Real, const S: usize, const W: usize> Kernel for Aim<'_, M, T, S, W> {
    type Number = T;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { v, dy, a, h, c, probe, .. } = self;
        if c >= W || probe.len() < M::Shape::NX + dy.len() {
            return;
        }
        let minus_ha = minus_ha(a, h);
        let (xdot, rest) = probe.split_at_mut(v.len());
        let (xi, z) = rest.split_at_mut(v.len());
        for (to, from) in xdot.iter_mut().chain(z).zip(dy) {
            *to = from.map(|row| row[c]);
        }
        for ((xi, row), dk) in xi.iter_mut().zip(v).zip(xdot.iter()) {
            *xi = stage_values::<A, T, S>(row[c], &minus_ha, dk);
        }
    }
}

impl<M: Dae, T: Real, const S: usize, F: Fallback> Work<M, T, S, F> {
    /// The tangent of the residual at all stages in the direction of the probe, beside it.
    fn probe_tangent(&mut self) {
        let Self { points, probe: [directions, tangent], .. } = self;
        // There are no derivatives by the time.
        if let Some(time) = directions.as_mut().last_mut() {
            *time = [T::ZERO; S];
        }
        if let Err(call) = T::side_by_side(AtStages::<M, T, S> { points, directions, tangent }) {
            let AtStages { points, directions, tangent } = call;
            for i in 0..S {
                let v = ArrayV::<M, Tangent<T>>::from_fn(|variable| Tangent {
                    value: points[variable][i],
                    derivative: directions[variable][i],
                });
                let mut f = ArrayK::<M, Tangent<T>>::zeroed();
                M::tangent::<T>(&v, &mut f);
                for (to, from) in tangent.as_mut().iter_mut().zip(f.as_ref()) {
                    to[i] = from.derivative;
                }
            }
        }
    }
}

/// Tangents at all stages in one call.
struct AtStages<'a, M: Dae, E: Lanes, const S: usize> {
    points: &'a ArrayV<M, [E; S]>,
    directions: &'a ArrayV<M, [E; S]>,
    tangent: &'a mut ArrayV<M, [E; S]>,
}

impl<M: Dae, E: Lanes, const S: usize> SideBySide<E, S> for AtStages<'_, M, E, S> {
    #[inline(always)]
    fn call<R: Lanes<Cell = [E; S]>>(self) {
        R::vectorize(InRegisters::<M, E, R, S> { stages: self, register: PhantomData });
    }
}

/// The same, compiled for the register.
struct InRegisters<'a, M: Dae, E: Lanes, R, const S: usize> {
    stages: AtStages<'a, M, E, S>,
    register: PhantomData<R>,
}

impl<M: Dae, E: Lanes, R: Lanes<Cell = [E; S]>, const S: usize> Piece for InRegisters<'_, M, E, R, S> {
    #[inline(always)]
    fn run(self) {
        let AtStages { points, directions, tangent } = self.stages;
        let v = ArrayV::<M, Tangent<R>>::from_fn(|variable| Tangent {
            value: R::load(&points[variable]),
            derivative: R::load(&directions[variable]),
        });
        let mut f = ArrayK::<M, Tangent<R>>::zeroed();
        M::tangent::<R>(&v, &mut f);
        for (to, from) in tangent.as_mut().iter_mut().zip(f.as_ref()) {
            from.derivative.store(to);
        }
    }
}
