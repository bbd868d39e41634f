//! Consistent states: the states nearest to given ones that satisfy the invariants of a model.
//!
//! ```text
//! min ½ |x − x̂|²    with  y(x, p, t) = 0,  x_j = x̂_j of those that are held
//! ```
//!
//! Gauss-Newton method: with `G = ∂y/∂x` in the columns of free states,
//! `x ← x̂ + G⁺ (G (x − x̂) − y)`. The factorisation `G = L Q` by Gram-Schmidt with
//! reorthogonalisation shows which invariant depends on the preceding ones. An invariant of fixed
//! states only is ignored if they satisfy it.

use super::{Constrained, Inconsistent};
use crate::error::Argument;
use crate::finite::find_non_finite;
use crate::function::{ArrayV, ArrayY, Function, MatrixYX, MatrixYY};
use crate::model::{ArrayX, Dae, VectorP, VectorX};
use crate::scalar::Real;
use crate::shape::{Array, Matrix, Outputs, Shape, update_entry};
use crate::structure::name_matches;
use bytemuck::Zeroable;
use core::marker::PhantomData;

/// Maximal number of iterations.
const MAX_ITERATIONS: usize = 200;
/// The size of a state that is zero.
const MIN_STATE_SIZE: f64 = 1e-30;

/// Computes the states nearest to given ones that satisfy the invariants of a model.
///
/// ```
/// use casados::prelude::*;
/// use casados::Consistent;
/// use nalgebra::vector;
///
/// /// A pendulum on a circle of radius one.
/// #[dae(index_reduction)]
/// fn pendulum(xdot: [f64; 4], x: [f64; 4], z: f64) -> [f64; 5] {
///     let circle = x[0] * x[0] + x[1] * x[1] - 1.0;
///     [xdot[0] - x[2], xdot[1] - x[3], xdot[2] + z * x[0], xdot[3] + z * x[1] + 9.81, circle]
/// }
///
/// let guess = vector![0.7, -0.5, 0.2, 0.1];
/// let x = Consistent::<Pendulum>::new().hold("x[0]")?.solve(&guess, &vector![], 0.0)?;
/// assert_eq!(x[0], 0.7);
/// assert!((x[1] + 0.51f64.sqrt()).abs() < 1e-15);
/// # Ok::<(), casados::Inconsistent>(())
/// ```
#[derive(Clone, Copy, Debug)]
#[must_use = "`hold` returns another one, which holds more"]
pub struct Consistent<M: Constrained> {
    held: ArrayX<M, bool>,
    model: PhantomData<M>,
}

impl<M: Constrained> Default for Consistent<M> {
    fn default() -> Self {
        Self::new()
    }
}

/// The function of the invariants of a model.
type Invariants<M> = <M as Constrained>::Invariants;

/// The workspace of an iteration.
#[derive(Zeroable)]
#[zeroable(bound = "")]
struct ConsistencyWorkspace<M: Constrained, T: Real> {
    v: ArrayV<Invariants<M>, T>,
    y: ArrayY<Invariants<M>, T>,
    jacobian: <Invariants<M> as Function>::Jacobian<T>,
    /// `G`, then `Q`.
    rows: MatrixYX<Invariants<M>, T>,
    /// `L`
    lower: MatrixYY<Invariants<M>, T>,
    /// `Σ |G_ij| |x_j|` over the fixed states; zero without fixed states.
    held_magnitude: ArrayY<Invariants<M>, T>,
    correction: ArrayX<M, T>,
}

impl<M: Constrained> Consistent<M> {
    /// Returns a solver with all states free.
    pub fn new() -> Self {
        Self { held: ArrayX::<M, bool>::from_fn(|_| false), model: PhantomData }
    }

    /// Fixes a state at its given value: `x[0]`, or all elements of an array or struct, `x`.
    ///
    /// # Errors
    /// [`Inconsistent::NoSuchState`]
    pub fn hold(mut self, name: &'static str) -> Result<Self, Inconsistent> {
        let mut iterate = false;
        for (held, state) in self.held.as_mut().iter_mut().zip(M::STRUCTURE.x) {
            if name_matches(name, state) {
                (*held, iterate) = (true, true);
            }
        }
        if iterate { Ok(self) } else { Err(Inconsistent::NoSuchState { name }) }
    }

    /// Returns the states nearest to `x` in the Euclidean norm.
    ///
    /// # Errors
    /// [`Inconsistent`]; far from the constraints the iteration may fail although consistent states
    /// exist.
    pub fn solve<T: Real>(
        &self,
        x: &VectorX<M, T>,
        p: &VectorP<M, T>,
        t: T,
    ) -> Result<VectorX<M, T>, Inconsistent> {
        for (argument, values) in
            [(Argument::X0, x.as_slice()), (Argument::P, p.as_slice()), (Argument::T, &[t])]
        {
            if let Some((index, value)) = find_non_finite(values) {
                let name = crate::finite::element_name::<M>(argument, index);
                return Err(Inconsistent::NonFiniteInput { argument, index, name, value });
            }
        }
        let mut work = ConsistencyWorkspace::<M, T>::new(p, t);
        let (mut iterate, mut last_change) = (*x, f64::INFINITY);
        let epsilon = T::EPSILON;
        for _ in 0..MAX_ITERATIONS {
            work.linearise(&self.held, &iterate)?;
            work.factorise()?;
            let change = work.gauss_newton_step(x, &mut iterate);
            // At rounding level the change stagnates.
            if change <= 4.0 * epsilon || (change < 1e3 * epsilon && change > 0.5 * last_change) {
                return Ok(iterate);
            }
            last_change = change;
        }
        work.linearise(&self.held, &iterate)?;
        let (output, residual) = work.largest_violation();
        let (equation, derivative) = equation_and_derivative::<M>(output);
        Err(Inconsistent::NotConverged { equation, derivative, residual })
    }
}

/// Returns the equation of an invariant, and the order of its derivative.
fn equation_and_derivative<M: Dae>(output: usize) -> (u32, u32) {
    M::STRUCTURE.reduction.and_then(|reduction| reduction.invariant(output)).unwrap_or((output as u32, 0))
}

impl<M: Constrained, T: Real> ConsistencyWorkspace<M, T> {
    fn new(p: &VectorP<M, T>, t: T) -> Self {
        let mut work = Self::zeroed();
        let v = work.v.as_mut();
        let (start, end) = (M::Shape::NV - 1 - M::Shape::NP, M::Shape::NV - 1);
        v[start..end].copy_from_slice(p.as_slice());
        v[end] = t;
        <Invariants<M> as Function>::jacobian_constants::<T>(&mut work.jacobian);
        work
    }

    /// Evaluates the invariants and `G`.
    fn linearise(&mut self, held: &ArrayX<M, bool>, x: &VectorX<M, T>) -> Result<(), Inconsistent> {
        let nx = M::Shape::NX;
        self.v.as_mut()[nx..2 * nx].copy_from_slice(x.as_slice());
        <Invariants<M> as Function>::value_jacobian::<T>(&self.v, &mut self.y, &mut self.jacobian);
        self.rows.as_mut_slice().fill(T::ZERO);
        self.held_magnitude.as_mut().fill(T::ZERO);
        let pattern = &<Invariants<M> as Function>::STRUCTURE.jacobian;
        let mut non_finite = find_non_finite(self.y.as_ref());
        for ((output, variable), &value) in pattern.iter().zip(self.jacobian.as_ref()) {
            if !value.is_finite() {
                non_finite = non_finite.or(Some((output, value.to_f64())));
            }
            let state = variable.wrapping_sub(nx);
            match (
                held.as_ref().get(state),
                x.as_slice().get(state),
                self.held_magnitude.as_mut().get_mut(output),
            ) {
                (Some(false), ..) => update_entry(&mut self.rows, output, state, |_| value),
                (Some(true), Some(x), Some(sum)) => {
                    *sum = *sum + value.abs() * (x.abs() + T::from_f64(MIN_STATE_SIZE));
                }
                _ => {}
            }
        }
        let Some((output, value)) = non_finite else { return Ok(()) };
        let (equation, derivative) = equation_and_derivative::<M>(output);
        Err(Inconsistent::NonFinite { equation, derivative, value })
    }

    /// Factorises `G = L Q`.
    fn factorise(&mut self) -> Result<(), Inconsistent> {
        let (ny, nx) = (<Invariants<M> as Function>::Outputs::NY, M::Shape::NX);
        self.lower.as_mut_slice().fill(T::ZERO);
        for i in 0..ny {
            let norm = |rows: &MatrixYX<Invariants<M>, T>| {
                (0..nx).fold(T::ZERO, |sum, state| sum + rows[(i, state)] * rows[(i, state)]).sqrt()
            };
            let row_norm = norm(&self.rows);
            let rounding = T::from_f64(16.0 * T::EPSILON) * self.held_magnitude[i];
            if row_norm == T::ZERO && self.held_magnitude[i] > T::ZERO && self.y[i].abs() <= rounding {
                self.y[i] = T::ZERO;
                self.lower[(i, i)] = T::ONE;
                continue;
            }
            for _ in 0..2 {
                for j in 0..i {
                    let product = (0..nx)
                        .fold(T::ZERO, |sum, state| sum + self.rows[(i, state)] * self.rows[(j, state)]);
                    self.lower[(i, j)] = self.lower[(i, j)] + product;
                    for state in 0..nx {
                        self.rows[(i, state)] = self.rows[(i, state)] - product * self.rows[(j, state)];
                    }
                }
            }
            let remaining_norm = norm(&self.rows);
            // The remainder of dependent rows consists of rounding errors, up to the square root of
            // ε relative to the row.
            let independent = remaining_norm.to_f64() * remaining_norm.to_f64()
                > T::EPSILON * row_norm.to_f64() * row_norm.to_f64();
            if !independent {
                let (equation, derivative) = equation_and_derivative::<M>(i);
                let residual = self.y[i].to_f64();
                return Err(Inconsistent::Dependent { equation, derivative, residual });
            }
            self.lower[(i, i)] = remaining_norm;
            for state in 0..nx {
                self.rows[(i, state)] = self.rows[(i, state)] / remaining_norm;
            }
        }
        Ok(())
    }

    /// Computes the next iterate; returns its change relative to the size of the states, or NaN if
    /// it is not finite.
    fn gauss_newton_step(&mut self, given: &VectorX<M, T>, found: &mut VectorX<M, T>) -> f64 {
        let (ny, nx) = (<Invariants<M> as Function>::Outputs::NY, M::Shape::NX);
        let (given, iterate) = (given.as_slice(), found.as_mut_slice());
        self.correction.as_mut().fill(T::ZERO);
        // Replaces `y` by `L⁻¹ y`, and subtracts the component of `x − x̂` in the rows of `Q`.
        for i in 0..ny {
            let mut value = self.y[i];
            for j in 0..i {
                value = value - self.lower[(i, j)] * self.y[j];
            }
            self.y[i] = value / self.lower[(i, i)];
            let projection = (0..nx)
                .fold(T::ZERO, |sum, state| sum + self.rows[(i, state)] * (iterate[state] - given[state]));
            for state in 0..nx {
                self.correction[state] =
                    self.correction[state] + self.rows[(i, state)] * (projection - self.y[i]);
            }
        }
        let (mut change, mut size) = (0.0f64, 0.0f64);
        for state in 0..nx {
            let next = given[state] + self.correction[state];
            change = change.max((next - iterate[state]).to_f64().abs());
            size = size.max(next.to_f64().abs());
            iterate[state] = next;
        }
        // A maximum does not preserve NaN.
        if find_non_finite(iterate).is_some() {
            return f64::NAN;
        }
        if size > 0.0 { change / size } else { change }
    }

    /// Returns the invariant with the largest violation.
    fn largest_violation(&self) -> (usize, f64) {
        let mut largest = (0, 0.0f64);
        for (output, value) in self.y.as_ref().iter().enumerate() {
            if value.to_f64().abs() > largest.1.abs() {
                largest = (output, value.to_f64());
            }
        }
        largest
    }
}
