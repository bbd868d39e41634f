//! Error control of sensitivities: the error estimate of a step, applied to `V = dx/d(x₀, u, p)`.
//!
//! A step that the states accept is replayed, solved to rounding, and differentiated. Its estimate
//! is a linear function of the slopes of its stages, and so is that of a column of `V`, with the
//! derivatives `dk_i` of the slopes:
//!
//! ```text
//! δ = (f_ẋ Σ_i w_i dk_i + f_x V + f_z Z + f_w) e_c        E = −hμ (f_ẋ + hμ f_x | f_z)⁻¹ δ        implicit
//! E = h Σ_i e_i dk_i e_c                                                                        explicit
//! ```
//!
//! at the point of the estimate of implicit methods: the start of the step or, for a method without
//! a stage at the end, the end. An element of `E` is measured by `atol_r / s_c + rtol_r |V_rc|`,
//! with the magnitude `s_c` of the varied quantity (A. C. Hindmarsh, R. Serban, User documentation
//! for CVODES, "forward sensitivity analysis"); the largest error of all columns decides.

use super::consistent::Consistent;
use super::error_estimate::RelativeErrors;
use super::newton_monitor::NewtonFailure;
use super::pairs::EmbeddedPair;
use super::point::ModelPoint;
use super::replay::{DynStepDifferentiator, StepRecord};
use super::stages::{FilteredDefect, MAX_STAGES, StageSolver, StepContext};
use super::tolerances::{Tolerances, root_mean_square};
use crate::error::Error;
use crate::linalg::axpy;
use crate::memory::allocate;
use crate::model::{ArrayK, ArrayV, ArrayW, ArrayX, Dae, Ode};
use crate::scalar::Real;
use crate::shape::{Matrix, Plain, Shape};
use alloc::boxed::Box;
use alloc::vec::Vec;
use bytemuck::Zeroable;

/// Memory of derivatives, one row for each direction.
#[derive(Zeroable)]
#[zeroable(bound = "T: Zeroable")]
struct VariationalMemory<M: Dae, T: Plain> {
    /// The derivatives of `(x, z)` at the start of the step, and at its end.
    start_sensitivities: ArrayW<M, ArrayK<M, T>>,
    end_sensitivities: ArrayW<M, ArrayK<M, T>>,
    /// The derivatives of a sum of slopes with respect to `(x_n, u, p)`.
    local_derivatives: ArrayW<M, ArrayX<M, T>>,
    /// The derivatives of two such sums with respect to `(x₀, u, p)`.
    rate_derivatives: [ArrayW<M, ArrayX<M, T>>; 2],
    jacobian: M::Jacobian<T>,
    f: ArrayK<M, T>,
    point: ArrayV<M, T>,
    magnitudes: ArrayW<M, T>,
}

/// The sensitivities of a run.
pub struct Variational<M: Dae, T: Real> {
    differentiator: Box<dyn DynStepDifferentiator<M, T>>,
    memory: Box<VariationalMemory<M, T>>,
    /// The unknowns of the stages of a step.
    stage_unknowns: Vec<T>,
}

impl<M: Dae, T: Real> Variational<M, T> {
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub fn new(replays: Box<dyn DynStepDifferentiator<M, T>>) -> Result<Self, Error> {
        let mut memory: Box<VariationalMemory<M, T>> = allocate()?;
        M::jacobian_constants::<T>(&mut memory.jacobian);
        let (length, mut unknowns) = (M::Shape::NK * MAX_STAGES, Vec::new());
        unknowns
            .try_reserve_exact(length)
            .map_err(|_| Error::OutOfMemory { bytes: length * size_of::<T>() })?;
        Ok(Self { differentiator: replays, memory, stage_unknowns: unknowns })
    }

    /// Begins a run with the magnitudes of `(x₀, u, p)`; the default is the absolute value of each
    /// quantity.
    ///
    /// # Errors
    /// As [`Consistent::forward`].
    pub fn begin_run(
        &mut self,
        at: &ModelPoint<'_, M, T>,
        start: &ArrayK<M, T>,
        given: &ArrayW<M, T>,
        consistent: &mut Consistent<M, T>,
    ) -> Result<(), Error> {
        let (nx, VariationalMemory { start_sensitivities: before, magnitudes, .. }) =
            (M::Shape::NX, &mut *self.memory);
        for (direction, column) in before.as_mut().iter_mut().enumerate() {
            column.as_mut().fill(T::ZERO);
            if let Some(element) = column.as_mut()[..nx].get_mut(direction) {
                *element = T::ONE;
            }
        }
        let values = at.x.as_slice().iter().chain(at.u.as_slice()).chain(at.p.as_slice());
        for ((magnitude, given), value) in magnitudes.as_mut().iter_mut().zip(given.as_ref()).zip(values) {
            let known = if *given > T::ZERO { *given } else { value.abs() };
            *magnitude = if known > T::ZERO { known } else { T::ONE };
        }
        if const { M::Shape::NZ > 0 } {
            let forward = consistent.forward(at, start)?;
            let z = [forward.dz_dx0.as_slice(), forward.dz_du.as_slice(), forward.dz_dp.as_slice()];
            let columns = z.into_iter().flat_map(|matrix| matrix.chunks_exact(M::Shape::NZ));
            for (to, from) in before.as_mut().iter_mut().zip(columns) {
                to.as_mut()[nx..].copy_from_slice(from);
            }
        }
        Ok(())
    }

    /// Moves to the end of an accepted step.
    pub fn accept_step(&mut self) {
        let VariationalMemory { start_sensitivities: before, end_sensitivities: after, .. } =
            &mut *self.memory;
        before.as_mut().copy_from_slice(after.as_ref());
    }

    /// Computes the derivatives at the end of a step.
    fn differentiate_step(&mut self, step: &StepRecord<'_, M, T>) -> Result<(), Error> {
        let (nx, VariationalMemory { start_sensitivities: before, end_sensitivities: after, .. }) =
            (M::Shape::NX, &mut *self.memory);
        let forward = self.differentiator.forward(step)?;
        let x = [forward.dx_dx0.as_slice(), forward.dx_du.as_slice(), forward.dx_dp.as_slice()];
        let z = [forward.dz_dx0.as_slice(), forward.dz_du.as_slice(), forward.dz_dp.as_slice()];
        let own = |parts: [&'_ [T]; 3], rows: usize, direction: usize, to: &mut [T]| {
            let [_, u, p] = parts;
            let column = direction.wrapping_sub(nx).wrapping_mul(rows);
            let from = u.get(column..column.saturating_add(rows));
            let from = from.or_else(|| p.get(column.wrapping_sub(u.len())..)?.get(..rows));
            to.fill(T::ZERO);
            if let (true, Some(from)) = (direction >= nx, from) {
                to.copy_from_slice(from);
            }
        };
        for (direction, (before, after)) in before.as_ref().iter().zip(after.as_mut()).enumerate() {
            let (states, algebraic) = after.as_mut().split_at_mut(nx);
            own(x, states.len(), direction, states);
            own(z, algebraic.len(), direction, algebraic);
            for (j, v) in before.as_ref()[..nx].iter().enumerate() {
                axpy(*v, x[0].get(j * nx..(j + 1) * nx).unwrap_or_default(), states);
                let nz = algebraic.len();
                axpy(*v, z[0].get(j * nz..(j + 1) * nz).unwrap_or_default(), algebraic);
            }
        }
        Ok(())
    }

    /// Computes the derivatives of `Σ_i weight_i k_i` of the last step.
    fn set_rate_derivatives(&mut self, level: usize, weights: &[f64], which: usize) -> Result<(), Error> {
        let (
            nx,
            VariationalMemory {
                start_sensitivities: before,
                local_derivatives: local,
                rate_derivatives: slopes,
                ..
            },
        ) = (M::Shape::NX, &mut *self.memory);
        self.differentiator.rate_derivatives(level, weights, local)?;
        let Some(slopes) = slopes.get_mut(which) else { return Ok(()) };
        let (by_states, others) = local.as_ref().split_at(nx);
        for (direction, (slope, before)) in slopes.as_mut().iter_mut().zip(before.as_ref()).enumerate() {
            let slope = slope.as_mut();
            match direction.checked_sub(nx).and_then(|index| others.get(index)) {
                Some(own) => slope.copy_from_slice(own.as_ref()),
                None => slope.fill(T::ZERO),
            }
            for (v, local) in before.as_ref().iter().zip(by_states) {
                axpy(*v, local.as_ref(), slope);
            }
        }
        Ok(())
    }

    /// The estimated error of the sensitivities over an implicit step, relative to the tolerance;
    /// `again` as in [`StageSolver::estimate_error`].
    ///
    /// # Errors
    /// The step cannot be differentiated.
    pub fn implicit_error(
        &mut self,
        stages: &mut dyn StageSolver<M, T>,
        at: ModelPoint<'_, M, T>,
        level: usize,
        start: &StepContext<'_, M, T>,
        tolerances: &Tolerances<M, T>,
        again: bool,
    ) -> Result<f64, NewtonFailure> {
        let diverges = |_: Error| NewtonFailure::Diverges;
        self.stage_unknowns.clear();
        stages.append_unknowns(&mut self.stage_unknowns);
        let unknowns = core::mem::take(&mut self.stage_unknowns);
        let taken = self.differentiate_step(&StepRecord {
            start: at,
            h: start.h,
            stage_unknowns: &unknowns,
            order_index: level,
            stages_are_solved: true,
        });
        self.stage_unknowns = unknowns;
        taken.map_err(diverges)?;
        let at_end = stages.estimate_point(start, &mut self.memory.point);
        self.set_rate_derivatives(level, &stages.lagrange(if at_end { 1.0 } else { 0.0 }), 0)
            .map_err(diverges)?;
        let VariationalMemory {
            start_sensitivities: before,
            end_sensitivities: after,
            rate_derivatives: [slopes, _],
            jacobian,
            f,
            point,
            magnitudes,
            ..
        } = &mut *self.memory;
        M::residual_jacobian::<T>(point, f, jacobian);
        let there = if at_end { &*after } else { &*before };
        let mut worst = 0.0f64;
        for (direction, (slope, y)) in slopes.as_ref().iter().zip(there.as_ref()).enumerate() {
            let mut y = *y;
            let mut relative = 0.0;
            for look in 0..2 {
                let mut error = ArrayK::<M, T>::zeroed();
                variational_residual::<M, T>(jacobian, slope.as_ref(), y.as_ref(), direction, error.as_mut());
                stages.filter_residual(start.h, &mut error);
                // As for the states, the extrapolated `z` is discarded.
                let counted = if at_end { M::Shape::NX } else { M::Shape::NK };
                let states = [before.as_ref(), after.as_ref()]
                    .map(|v| v.get(direction).map_or(&[][..], |v| v.as_ref()));
                let magnitude = magnitudes[direction];
                let estimator = tolerances.estimator_tolerances.as_ref().iter().copied();
                let first = scaled_norm(&error.as_ref()[..counted], states, estimator, magnitude);
                let asked = tolerances.rtol.as_ref().iter().zip(tolerances.atol.as_ref());
                let scales = column_scales(states, asked.map(|(rtol, atol)| (*rtol, *atol)), magnitude);
                let [filtered, divided]: FilteredDefect<M, T> = stages.filtered_defect(start.h);
                let mut errors = RelativeErrors::default();
                for ((error, divided), scale) in filtered.as_ref().iter().zip(divided.as_ref()).zip(scales) {
                    errors.add((*error / scale).to_f64(), (*divided / scale).to_f64());
                }
                relative = stages.defect_filter().max_estimate(first, start.tolerance_ratio, &errors);
                if at_end || look > 0 || !(again && relative >= 1.0) {
                    break;
                }
                axpy(T::ONE, error.as_ref(), y.as_mut());
            }
            if !relative.is_finite() {
                return Err(NewtonFailure::Diverges);
            }
            worst = worst.max(relative);
        }
        Ok(worst)
    }
}

impl<M: Ode, T: Real> Variational<M, T> {
    /// The estimated error of the sensitivities over a step of an explicit pair; not finite if the
    /// step cannot be differentiated.
    pub fn explicit_error<B: EmbeddedPair<S>, const S: usize>(
        &mut self,
        step: &StepRecord<'_, M, T>,
        end: &[T],
        inputs: &[T],
        tolerances: impl Iterator<Item = (T, T)> + Clone,
    ) -> Result<f64, Error> {
        let (nx, (weights, last)) = (M::Shape::NX, B::ERROR_COEFFICIENTS);
        self.differentiate_step(step)?;
        self.set_rate_derivatives(0, &weights, 0)?;
        if let Some(coarse) = B::THIRD_ORDER {
            self.set_rate_derivatives(0, &coarse, 1)?;
        }
        let VariationalMemory {
            start_sensitivities: before,
            end_sensitivities: after,
            rate_derivatives: [fine, coarse],
            jacobian,
            f,
            point,
            magnitudes,
            ..
        } = &mut *self.memory;
        if last != 0.0 {
            point.as_mut().copy_from_slice(inputs);
            point.as_mut()[..nx].fill(T::ZERO);
            point.as_mut()[nx..2 * nx].copy_from_slice(end);
            if let Some(time) = point.as_mut().last_mut() {
                *time = step.start.t + step.h;
            }
            M::residual_jacobian::<T>(point, f, jacobian);
        }
        let (zero, mut worst) = (ArrayX::<M, T>::zeroed(), 0.0f64);
        for (direction, (before, after)) in before.as_ref().iter().zip(after.as_ref()).enumerate() {
            let mut error = fine.as_ref().get(direction).copied().unwrap_or(zero);
            if last != 0.0 {
                // ẋ = −f/c at ẋ = 0.
                let mut defect = ArrayK::<M, T>::zeroed();
                variational_residual::<M, T>(
                    jacobian,
                    zero.as_ref(),
                    after.as_ref(),
                    direction,
                    defect.as_mut(),
                );
                for (error, (row, coefficient)) in error.as_mut().iter_mut().zip(M::ROWS) {
                    *error = *error - T::from_f64(last / coefficient) * defect[*row as usize];
                }
            }
            let size = |error: &ArrayX<M, T>| {
                let states = [before, after].map(|v| v.as_ref());
                let relative = scaled_norm(error.as_ref(), states, tolerances.clone(), magnitudes[direction]);
                relative * step.h.abs().to_f64()
            };
            let fine = size(&error);
            let coarse = B::THIRD_ORDER.and_then(|_| coarse.as_ref().get(direction)).map(size);
            let combined = B::combined_estimate(fine, coarse);
            if !combined.is_finite() {
                return Ok(f64::NAN);
            }
            worst = worst.max(combined);
        }
        Ok(worst)
    }
}

/// `f_ẋ ẋ' + f_(x,z) y' + f_w e_c`
fn variational_residual<M: Dae, T: Real>(
    jacobian: &M::Jacobian<T>,
    slope: &[T],
    y: &[T],
    direction: usize,
    to: &mut [T],
) {
    let (nx, nk) = (M::Shape::NX, M::Shape::NK);
    // The index of a direction that is not a state, among the variables.
    let own = direction.checked_sub(nx).map(|index| nx + nk + index);
    for (entry, value) in jacobian.as_ref().iter().enumerate() {
        let (equation, variable) = M::STRUCTURE.jacobian.at(entry);
        let factor = if variable < nx {
            slope.get(variable).copied()
        } else if variable < nx + nk {
            y.get(variable - nx).copied()
        } else {
            (Some(variable) == own).then_some(T::ONE)
        };
        if let (Some(factor), Some(to)) = (factor, to.get_mut(equation)) {
            *to = *to + *value * factor;
        }
    }
}

/// The scales of a column, from the tolerances `(rtol, atol)` of the states.
fn column_scales<'a, T: Real>(
    [before, after]: [&'a [T]; 2],
    tolerances: impl Iterator<Item = (T, T)> + 'a,
    magnitude: T,
) -> impl Iterator<Item = T> + 'a {
    before
        .iter()
        .zip(after)
        .zip(tolerances)
        .map(move |((before, after), (rtol, atol))| atol / magnitude + rtol * before.abs().max(after.abs()))
}

/// The root mean square relative to the scales.
fn scaled_norm<'a, T: Real>(
    error: &[T],
    states: [&'a [T]; 2],
    tolerances: impl Iterator<Item = (T, T)> + 'a,
    magnitude: T,
) -> f64 {
    let mut sum = 0.0;
    for (error, scale) in error.iter().zip(column_scales(states, tolerances, magnitude)) {
        let relative = (*error / scale).to_f64();
        sum += relative * relative;
    }
    root_mean_square(sum, error.len())
}
