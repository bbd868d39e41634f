//! The projection of a state onto the invariants, and its derivatives.
//!
//! The state nearest to `x̂` at which the invariants `y` vanish, with multipliers `ν`:
//!
//! ```text
//! F(x, ν; x̂, p, t) = (x − x̂ + Gᵀν, y) = 0        G = ∂y/∂x        K = ∂F/∂(x, ν)
//! ```
//!
//! Directions: `K d(x, ν) = dx̂ − F_p dp`. Adjoint: `Kᵀμ = (λ, 0)`, then `λ_x̂` are the first
//! elements of `μ` and `λ_p = −F_pᵀμ`. Second order: `−Dᵀ ∇²(μᵀF) D` with `D = d(x, ν, p)/dw`. The
//! macro generates `F` and its derivatives.

use super::Projectable;
use crate::error::{Error, Place, Quantity};
use crate::finite::find_non_finite;
use crate::function::{ArrayV, ArrayY, Function, MatrixYY};
use crate::model::{VectorP, VectorX};
use crate::scalar::Real;
use crate::shape::{Array, Matrix, Outputs, Shape, entry, update_entry};
use bytemuck::Zeroable;

/// Maximal number of Newton iterations.
const MAX_ITERATIONS: usize = 30;

/// The function `F`.
pub(super) type ProjectionFunction<M> = <M as Projectable>::Projection;
/// Number of equations of `F`.
pub(super) const fn equation_count<M: Projectable>() -> usize {
    <ProjectionFunction<M> as Function>::Outputs::NY
}
/// Index of `x̂` among the variables `(ẋ, x, ν, x̂, p, t)` of `F`.
const fn given_states_offset<M: Projectable>() -> usize {
    M::Shape::NX + equation_count::<M>()
}
/// Index of `p`.
const fn parameters_offset<M: Projectable>() -> usize {
    given_states_offset::<M>() + M::Shape::NX
}

/// The projection at a state.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(super) struct Kkt<M: Projectable, T: Real> {
    v: ArrayV<ProjectionFunction<M>, T>,
    f: ArrayY<ProjectionFunction<M>, T>,
    jacobian: <ProjectionFunction<M> as Function>::Jacobian<T>,
    /// `K`, then its factors: `L` with unit diagonal, and `U`.
    factors: MatrixYY<ProjectionFunction<M>, T>,
    /// The row that was swapped with each row.
    pivot_rows: ArrayY<ProjectionFunction<M>, usize>,
}

impl<M: Projectable, T: Real> Kkt<M, T> {
    /// Projects `x` onto the nearest state at which the invariants vanish, and factorises `K`
    /// there.
    ///
    /// # Errors
    /// [`Error::NotProjected`]
    pub fn project(&mut self, x: &mut VectorX<M, T>, p: &VectorP<M, T>, t: T) -> Result<(), Error> {
        let nx = M::Shape::NX;
        let v = self.v.as_mut();
        v.fill(T::ZERO);
        v[nx..2 * nx].copy_from_slice(x.as_slice());
        v[given_states_offset::<M>()..][..nx].copy_from_slice(x.as_slice());
        v[parameters_offset::<M>()..][..M::Shape::NP].copy_from_slice(p.as_slice());
        v[parameters_offset::<M>() + M::Shape::NP] = t;
        <ProjectionFunction<M> as Function>::jacobian_constants::<T>(&mut self.jacobian);
        let mut last_change = f64::INFINITY;
        for _ in 0..MAX_ITERATIONS {
            self.linearise()?;
            let mut step = self.f;
            self.solve(&mut step);
            let (mut moved, mut size) = (0.0f64, 0.0f64);
            for (index, step) in step.as_ref().iter().enumerate() {
                let value = self.v[nx + index] - *step;
                self.v[nx + index] = value;
                if index < nx {
                    (moved, size) = (moved.max(step.to_f64().abs()), size.max(value.to_f64().abs()));
                }
            }
            let relative_change = if size > 0.0 { moved / size } else { moved };
            // At rounding level the change stagnates.
            if relative_change <= 4.0 * T::EPSILON
                || (relative_change < 1e3 * T::EPSILON && relative_change > 0.25 * last_change)
            {
                self.linearise()?;
                x.as_mut_slice().copy_from_slice(&self.v.as_ref()[nx..2 * nx]);
                return Ok(());
            }
            last_change = relative_change;
        }
        Err(self.largest_violation_error())
    }

    /// Evaluates `F` and `K`, and factorises `K`.
    fn linearise(&mut self) -> Result<(), Error> {
        let (nx, count) = (M::Shape::NX, equation_count::<M>());
        <ProjectionFunction<M> as Function>::value_jacobian::<T>(&self.v, &mut self.f, &mut self.jacobian);
        self.factors.as_mut_slice().fill(T::ZERO);
        let pattern = &<ProjectionFunction<M> as Function>::STRUCTURE.jacobian;
        for ((row, variable), &value) in pattern.iter().zip(self.jacobian.as_ref()) {
            let column = variable.wrapping_sub(nx);
            if column < count {
                update_entry(&mut self.factors, row, column, |_| value);
            }
        }
        let finite =
            [self.f.as_ref(), self.factors.as_slice()].iter().all(|values| find_non_finite(values).is_none());
        if finite && self.factorise() { Ok(()) } else { Err(self.largest_violation_error()) }
    }

    /// Checks the derivatives by the parameters.
    ///
    /// # Errors
    /// [`Error::NonFiniteModel`] if the invariants have finite values, but a derivative by a
    /// parameter is not finite.
    pub fn check_parameters(&self) -> Result<(), Error> {
        // Invariants are reported first; the preceding rows are those of `Gᵀν`.
        let mut non_finite: Option<(usize, T)> = None;
        self.visit_parameter_jacobian(|row, _, value| {
            if !value.is_finite() && non_finite.is_none_or(|(last, _)| last < row) {
                non_finite = Some((row, value));
            }
        });
        let Some((row, value)) = non_finite else { return Ok(()) };
        let (equation, _) = invariant::<M>(row.saturating_sub(M::Shape::NX));
        let at = Place { step: 0, stage: 0, iteration: 0 };
        let (quantity, equation) = (Quantity::Jacobian, equation as usize);
        Err(Error::NonFiniteModel { quantity, equation, value: value.to_f64(), at })
    }

    /// Returns the error with the largest violation.
    fn largest_violation_error(&self) -> Error {
        let (mut largest_index, mut residual) = (0, 0.0f64);
        for (output, value) in self.f.as_ref()[M::Shape::NX..].iter().enumerate() {
            let value = value.to_f64();
            if value.is_nan() || value.abs() > residual.abs() {
                (largest_index, residual) = (output, value);
            }
        }
        let (equation, derivative) = invariant::<M>(largest_index);
        Error::NotProjected { equation, derivative, residual }
    }

    /// Factorises by Gaussian elimination with partial pivoting; returns whether the matrix is
    /// regular.
    fn factorise(&mut self) -> bool {
        let count = equation_count::<M>();
        for step in 0..count {
            let mut pivot = step;
            for row in step + 1..count {
                if self.factors[(row, step)].abs() > entry(&self.factors, pivot, step).abs() {
                    pivot = row;
                }
            }
            self.pivot_rows[step] = pivot;
            for column in 0..count {
                let pivot_element = entry(&self.factors, pivot, column);
                let current_element = core::mem::replace(&mut self.factors[(step, column)], pivot_element);
                update_entry(&mut self.factors, pivot, column, |_| current_element);
            }
            let diagonal = self.factors[(step, step)];
            if diagonal == T::ZERO || !diagonal.is_finite() {
                return false;
            }
            for row in step + 1..count {
                let factor = self.factors[(row, step)] / diagonal;
                self.factors[(row, step)] = factor;
                if factor != T::ZERO {
                    for column in step + 1..count {
                        let product = factor * self.factors[(step, column)];
                        self.factors[(row, column)] = self.factors[(row, column)] - product;
                    }
                }
            }
        }
        true
    }

    /// `b ← K⁻¹ b`
    pub fn solve(&self, b: &mut ArrayY<ProjectionFunction<M>, T>) {
        let count = equation_count::<M>();
        for step in 0..count {
            exchange(b.as_mut(), step, self.pivot_rows[step]);
        }
        for row in 0..count {
            for column in 0..row {
                b[row] = b[row] - self.factors[(row, column)] * b[column];
            }
        }
        for row in (0..count).rev() {
            for column in row + 1..count {
                b[row] = b[row] - self.factors[(row, column)] * b[column];
            }
            b[row] = b[row] / self.factors[(row, row)];
        }
    }

    /// `b ← K⁻ᵀ b`
    fn solve_transposed(&self, b: &mut ArrayY<ProjectionFunction<M>, T>) {
        let count = equation_count::<M>();
        for row in 0..count {
            for column in 0..row {
                b[row] = b[row] - self.factors[(column, row)] * b[column];
            }
            b[row] = b[row] / self.factors[(row, row)];
        }
        for row in (0..count).rev() {
            for column in row + 1..count {
                b[row] = b[row] - self.factors[(column, row)] * b[column];
            }
        }
        for step in (0..count).rev() {
            exchange(b.as_mut(), step, self.pivot_rows[step]);
        }
    }

    /// Returns `d(x, ν)` for a change of the given state and a change `dp` of the parameters.
    pub fn direction(
        &self,
        state_direction: impl Fn(usize) -> T,
        parameter_direction: impl Fn(usize) -> T,
    ) -> ArrayY<ProjectionFunction<M>, T> {
        let mut b = ArrayY::<ProjectionFunction<M>, T>::from_fn(|row| {
            if row < M::Shape::NX { state_direction(row) } else { T::ZERO }
        });
        self.visit_parameter_jacobian(|row, parameter, value| {
            if let Some(b) = b.as_mut().get_mut(row) {
                *b = *b - value * parameter_direction(parameter);
            }
        });
        self.solve(&mut b);
        b
    }

    /// Returns `μ` with `Kᵀμ = (λ, 0)`.
    pub fn multipliers(&self, lambda: &VectorX<M, T>) -> ArrayY<ProjectionFunction<M>, T> {
        let lambda = lambda.as_slice();
        let mut mu =
            ArrayY::<ProjectionFunction<M>, T>::from_fn(|row| lambda.get(row).copied().unwrap_or(T::ZERO));
        self.solve_transposed(&mut mu);
        mu
    }

    /// Visits the entries of `F_p`: row, parameter, value.
    pub fn visit_parameter_jacobian(&self, mut visit: impl FnMut(usize, usize, T)) {
        let pattern = &<ProjectionFunction<M> as Function>::STRUCTURE.jacobian;
        for ((row, variable), &value) in pattern.iter().zip(self.jacobian.as_ref()) {
            if let Some(parameter) = variable.checked_sub(parameters_offset::<M>()) {
                visit(row, parameter, value);
            }
        }
    }

    /// Evaluates the lower triangle of `∇²(μᵀF)` in the order of its pattern.
    pub fn hessian(
        &self,
        mu: &ArrayY<ProjectionFunction<M>, T>,
        hessian: &mut <ProjectionFunction<M> as Function>::Hessian<T>,
    ) {
        <ProjectionFunction<M> as Function>::hessian::<T>(&self.v, mu, hessian);
    }
}

/// Returns the equation of an invariant, and the order of its derivative.
fn invariant<M: Projectable>(index: usize) -> (u32, u32) {
    M::STRUCTURE.reduction.and_then(|reduction| reduction.invariant(index)).unwrap_or((0, 0))
}

/// Swaps two elements.
fn exchange<T: Copy>(b: &mut [T], first: usize, second: usize) {
    if let (Some(&one), Some(&pivot_element)) = (b.get(first), b.get(second)) {
        b[first] = pivot_element;
        b[second] = one;
    }
}

/// A variable of second derivatives of `F`: an element of `(x, ν)`, or a parameter. `F` is linear
/// in `x̂`.
pub(super) enum Variable {
    Unknown(usize),
    Parameter(usize),
}

/// Returns the variable of an index in the pattern of `∇²(μᵀF)`.
pub(super) fn variable<M: Projectable>(index: usize) -> Variable {
    match index.checked_sub(parameters_offset::<M>()) {
        Some(parameter) => Variable::Parameter(parameter),
        None => Variable::Unknown(index.saturating_sub(M::Shape::NX)),
    }
}
