//! Iterative refinement of forward derivatives, with residuals by tangents of the model.
//!
//! An entry of the Jacobian is a sum that rounds away its small terms. If a combination of several
//! equations is slow while each equation is fast (the mass balance of a chemical reaction over a
//! long step), the slow motion consists of these small terms. In a tangent of the model, terms that
//! equations share are rounded once and cancel. So
//!
//! ```text
//! r_i = f_ẋ dk_i + f_x (V_n + h Σ_j a_ij dk_j) + f_z dz_i + f_w
//! ```
//!
//! is computed by tangents, and corrected with the available factors (C. B. Moler, J. ACM 14,
//! 1967). The checksum over all directions decides whether a refinement is worthwhile.

use super::checksum::sum_accumulators;
use super::dense_fallback::write_column;
use super::output::DerivativeOutput;
use super::sweep::{ForwardSweep, LinearizedStep, StepOutputs};
use crate::irk::coefficients::{Coefficients, stage_values};
use crate::irk::directions::{Directions, panel, panel_mut, panels};
use crate::irk::workspace::StageWorkspace;
use crate::linalg::{Arithmetic, Kernel, PanelRow, dispatch, minus_ha, slot};
use crate::memory::Fallback;
use crate::model::{ArrayK, ArrayV, Dae};
use crate::scalar::{Lanes, Piece, Real, SideBySide, Tangent};
use crate::shape::{Array, InBounds, Shape};
use bytemuck::Zeroable;
use core::marker::PhantomData;

/// Corrections below this, in ε relative to the unknown, are not applied.
const CORRECTION_TOLERANCE: f64 = 4096.0;

/// Maximal number of refinements.
const MAX_REFINEMENTS: usize = 3;

impl<M: Dae, T: Real, R: Array<T>, const S: usize> ForwardSweep<M, T, R, S> {
    /// After a step whose derivatives satisfy the equations of the assembled Jacobian: corrects
    /// them, and the outputs that depend on them, if the tangents of the model differ.
    pub(in crate::irk) fn refine<D: Directions<T>, G: DerivativeOutput<T>, F: Fallback>(
        &mut self,
        work: &mut StageWorkspace<M, T, S, F>,
        linearized: LinearizedStep<'_, M, T, D, S, F>,
        outputs: &mut StepOutputs<'_, T, G>,
    ) {
        let LinearizedStep { coefficients, directions, .. } = linearized;
        let mut last_correction = f64::INFINITY;
        for _ in 0..MAX_REFINEMENTS {
            let correction = self.largest_correction(work, coefficients);
            // The negated comparison also ends the refinement if the correction is not a number.
            if !(correction > CORRECTION_TOLERANCE * T::EPSILON && correction < 0.5 * last_correction) {
                return;
            }
            last_correction = correction;
            self.refine_columns(work, coefficients, directions);
            self.update_outputs(work, linearized, outputs);
            // The next correction is about the square of this one.
            if correction * correction <= CORRECTION_TOLERANCE * T::EPSILON {
                return;
            }
            work.verify_forward(self, coefficients, directions, false);
        }
    }

    /// Returns the largest correction of the checksum, relative to each unknown; for a slope also
    /// relative to `V_n / h`. The checksum is the one that was checked in `backward_error`.
    fn largest_correction<F: Fallback>(
        &self,
        work: &mut StageWorkspace<M, T, S, F>,
        coefficients: &Coefficients<T, S>,
    ) -> f64 {
        let (nx, h) = (M::Shape::NX, work.inputs.time.step);
        work.evaluate_tangent();
        let StageWorkspace { variable_scratch: [sum, tangent], increment, linearization: linear, .. } = work;
        for (equation, tangent) in tangent.as_ref().iter().enumerate().take(M::Shape::NK) {
            if let Some(to) = increment.as_mut().get_mut(slot::<M>(equation)).in_bounds() {
                *to = tangent.map(|element| [element]);
            }
        }
        linear.solve((coefficients, h), increment);
        let mut largest = 0.0f64;
        for (unknown, correction) in increment.as_ref().iter().enumerate() {
            let variable = if unknown < nx { unknown } else { unknown + nx };
            let start =
                self.start_sums.as_ref().get(unknown).map_or(T::ZERO, |sum| sum_accumulators(sum) / h).abs();
            let size = sum.as_ref().get(variable).into_iter().flatten();
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

    /// Corrects every direction once.
    fn refine_columns<D: Directions<T>, F: Fallback>(
        &mut self,
        work: &mut StageWorkspace<M, T, S, F>,
        coefficients: &Coefficients<T, S>,
        directions: D,
    ) {
        let (nx, nk) = (M::Shape::NX, M::Shape::NK);
        panels!([D::COLUMNS, directions.columns()], T, S, column, W => {
            let mut right = ArrayK::<M, PanelRow<T, S, W>>::zeroed();
            for c in 0..W {
                let inputs = work.variable_scratch[0].as_mut().get_mut(nx + nk..).in_bounds().unwrap_or_default();
                for (index, input) in inputs.iter_mut().enumerate() {
                    let mut row = [T::ZERO; 1];
                    directions.add_scaled(nx + index, T::ONE, column + c, &mut row);
                    *input = [row[0]; S];
                }
                dispatch(ColumnDirection::<M, T, S, W> {
                    v: panel(self.v(), column, nx),
                    dy: panel(self.dy(), column, nk * S).as_chunks().0,
                    a: &coefficients.a,
                    h: work.inputs.time.step,
                    panel_column: c,
                    direction: work.variable_scratch[0].as_mut(),
                    model: PhantomData,
                });
                work.evaluate_tangent();
                for (equation, tangent) in work.variable_scratch[1].as_ref().iter().enumerate().take(nk) {
                    if let Some(rows) = right.as_mut().get_mut(slot::<M>(equation)).in_bounds() {
                        write_column(tangent, rows, c);
                    }
                }
            }
            work.linearization.solve::<W>((coefficients, work.inputs.time.step), &mut right);
            let dy = panel_mut::<T, W>(R::flat_mut(self.dy_mut()), column, nk * S);
            subtract_corrections(dy.as_flattened_mut(), right.as_ref().as_flattened().as_flattened());
        });
    }
}

/// `x ← x − Δ`, as a function that is executed rarely: its loop is not unrolled.
#[cfg_attr(feature = "std", inline(never))]
fn subtract_corrections<T: Real>(x: &mut [T], corrections: &[T]) {
    for (x, correction) in x.iter_mut().zip(corrections) {
        *x = *x - *correction;
    }
}

/// The direction of one column, `(dk, V_n + h Σ_j a_j dk_j, dz)` at all stages.
struct ColumnDirection<'a, M, T, const S: usize, const W: usize> {
    v: &'a [[T; W]],
    dy: &'a [PanelRow<T, S, W>],
    a: &'a [[T; S]; S],
    h: T,
    panel_column: usize,
    direction: &'a mut [[T; S]],
    model: PhantomData<M>,
}

impl<M: Dae, T: Real, const S: usize, const W: usize> Kernel for ColumnDirection<'_, M, T, S, W> {
    type Number = T;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { v, dy, a, h, panel_column: c, direction: probe, .. } = self;
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

impl<M: Dae, T: Real, const S: usize, F: Fallback> StageWorkspace<M, T, S, F> {
    /// Computes the tangent of the residual at all stages in the direction of the first array of
    /// `variable_scratch`, and stores it in the second.
    fn evaluate_tangent(&mut self) {
        let Self { points, variable_scratch: [directions, tangent], .. } = self;
        // Time is not a direction.
        if let Some(time) = directions.as_mut().last_mut() {
            *time = [T::ZERO; S];
        }
        if let Err(call) = T::side_by_side(StageTangents::<M, T, S> { points, directions, tangent }) {
            let StageTangents { points, directions, tangent } = call;
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
struct StageTangents<'a, M: Dae, E: Lanes, const S: usize> {
    points: &'a ArrayV<M, [E; S]>,
    directions: &'a ArrayV<M, [E; S]>,
    tangent: &'a mut ArrayV<M, [E; S]>,
}

impl<M: Dae, E: Lanes, const S: usize> SideBySide<E, S> for StageTangents<'_, M, E, S> {
    #[inline(always)]
    fn call<R: Lanes<Cell = [E; S]>>(self) {
        R::vectorize(RegisterTangents::<M, E, R, S> { stages: self, register: PhantomData });
    }
}

/// [`StageTangents`], compiled for a SIMD register.
struct RegisterTangents<'a, M: Dae, E: Lanes, R, const S: usize> {
    stages: StageTangents<'a, M, E, S>,
    register: PhantomData<R>,
}

impl<M: Dae, E: Lanes, R: Lanes<Cell = [E; S]>, const S: usize> Piece for RegisterTangents<'_, M, E, R, S> {
    #[inline(always)]
    fn run(self) {
        let StageTangents { points, directions, tangent } = self.stages;
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
