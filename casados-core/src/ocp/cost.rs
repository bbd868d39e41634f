//! Costs at the nodes.

use super::error::{OcpError, Part};
use super::point::{Cross, Terms, There, parameter, position};
use crate::function::{ArrayV, ArrayY, Function, FunctionStructure, MatrixYY};
use crate::scalar::Real;
use crate::shape::{Array, Matrix, Outputs, Plain, Shape};
use bytemuck::Zeroable;
use core::ops::Range;

/// A cost at a node, as a function of `(x, z, u, p, t)`: `()` is none, and a pair of costs is their sum.
pub trait Cost<S: Shape, T: Real> {
    /// How many numbers a reference has.
    const REFERENCES: usize;
    /// Whether the Hessian that [`Cost::add`] adds is positive semidefinite where an exact one is not asked for.
    const CONVEX: bool;

    /// Whether it depends on what is there only, and has weights that make sense.
    ///
    /// # Errors
    /// [`OcpError::NotThere`], [`OcpError::InvalidValue`]
    #[doc(hidden)]
    fn check(&self, there: There) -> Result<(), OcpError>;

    /// The value at a point.
    ///
    /// # Errors
    /// [`OcpError::NonFiniteFunction`]
    #[doc(hidden)]
    fn value(&mut self, v: &S::ArrayV<T>, reference: &[T], stage: usize) -> Result<T, OcpError>;

    /// The value at a point times a factor; adds gradient and Hessian times this factor.
    ///
    /// # Errors
    /// [`OcpError::NonFiniteFunction`]
    #[doc(hidden)]
    fn add(
        &mut self,
        v: &S::ArrayV<T>,
        reference: &[T],
        at: At<'_, T>,
        terms: &mut Terms<'_, T>,
    ) -> Result<T, OcpError>;

    /// Adds what parameters change of the gradient, times the factor.
    ///
    /// # Errors
    /// [`OcpError::NonFiniteFunction`]
    #[doc(hidden)]
    fn cross(
        &mut self,
        v: &S::ArrayV<T>,
        reference: &[T],
        at: At<'_, T>,
        cross: &mut Cross<'_, T>,
    ) -> Result<(), OcpError>;
}

/// Where, how much, and whether the Hessian is to be exact.
#[derive(Clone, Copy, Debug)]
pub struct At<'a, T> {
    pub(super) stage: usize,
    pub(super) factor: T,
    pub(super) exact: bool,
    /// `(x, u)`, if the gradient is to be that of the quadratic model at zero: `∇f − H (x, u)` with the Hessian `H` that is added, which is
    /// [convex](Cost::CONVEX). Else it is empty.
    pub(super) from: &'a [T],
}

impl<S: Shape, T: Real> Cost<S, T> for () {
    const REFERENCES: usize = 0;
    const CONVEX: bool = true;
    fn check(&self, _: There) -> Result<(), OcpError> {
        Ok(())
    }
    fn value(&mut self, _: &S::ArrayV<T>, _: &[T], _: usize) -> Result<T, OcpError> {
        Ok(T::ZERO)
    }
    fn add(&mut self, _: &S::ArrayV<T>, _: &[T], _: At<'_, T>, _: &mut Terms<'_, T>) -> Result<T, OcpError> {
        Ok(T::ZERO)
    }
    fn cross(
        &mut self,
        _: &S::ArrayV<T>,
        _: &[T],
        _: At<'_, T>,
        _: &mut Cross<'_, T>,
    ) -> Result<(), OcpError> {
        Ok(())
    }
}

/// References lie one after the other.
impl<S: Shape, T: Real, A: Cost<S, T>, B: Cost<S, T>> Cost<S, T> for (A, B) {
    const REFERENCES: usize = A::REFERENCES + B::REFERENCES;
    const CONVEX: bool = A::CONVEX && B::CONVEX;
    fn check(&self, there: There) -> Result<(), OcpError> {
        self.0.check(there)?;
        self.1.check(there)
    }
    fn value(&mut self, v: &S::ArrayV<T>, reference: &[T], stage: usize) -> Result<T, OcpError> {
        let (first, second) = reference.split_at_checked(A::REFERENCES).unwrap_or_default();
        Ok(self.0.value(v, first, stage)? + self.1.value(v, second, stage)?)
    }
    fn add(
        &mut self,
        v: &S::ArrayV<T>,
        reference: &[T],
        at: At<'_, T>,
        terms: &mut Terms<'_, T>,
    ) -> Result<T, OcpError> {
        let (first, second) = reference.split_at_checked(A::REFERENCES).unwrap_or_default();
        Ok(self.0.add(v, first, at, terms)? + self.1.add(v, second, at, terms)?)
    }
    fn cross(
        &mut self,
        v: &S::ArrayV<T>,
        reference: &[T],
        at: At<'_, T>,
        cross: &mut Cross<'_, T>,
    ) -> Result<(), OcpError> {
        let (first, second) = reference.split_at_checked(A::REFERENCES).unwrap_or_default();
        self.0.cross(v, first, at, cross)?;
        self.1.cross(v, second, at, cross)
    }
}

/// `½ (y − r)ᵀ W (y − r)` of the outputs `y(x, z, u, p, t)` of a function and a reference `r`, which every stage has for itself.
///
/// Its Hessian is `JᵀWJ`, that of Gauss and Newton; the exact one has the second derivatives of `y` too.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct LeastSquaresCost<F: Function, T: Plain = f64> {
    weights: MatrixYY<F, T>,
    /// Zero if `W` is diagonal.
    coupled: usize,
    y: ArrayY<F, T>,
    mu: ArrayY<F, T>,
    jacobian: F::Jacobian<T>,
    hessian: F::Hessian<T>,
}

impl<F: Function, T: Real> LeastSquaresCost<F, T> {
    /// With the weights `W`, which are symmetric.
    #[must_use]
    pub fn new(weights: &MatrixYY<F, T>) -> Self {
        let mut cost: Self = Zeroable::zeroed();
        cost.set_weights(weights);
        F::jacobian_constants::<T>(&mut cost.jacobian);
        cost
    }

    /// With a weight for each output.
    #[must_use]
    pub fn diagonal(weights: &ArrayY<F, T>) -> Self {
        let mut matrix: MatrixYY<F, T> = Zeroable::zeroed();
        for (i, &weight) in weights.as_ref().iter().enumerate() {
            matrix[(i, i)] = weight;
        }
        Self::new(&matrix)
    }

    /// Other weights.
    pub fn set_weights(&mut self, weights: &MatrixYY<F, T>) {
        let elements = || (0..F::Outputs::NY).flat_map(|i| (0..i).map(move |j| (i, j)));
        self.coupled =
            usize::from(elements().any(|(i, j)| weights[(i, j)] != T::ZERO || weights[(j, i)] != T::ZERO));
        self.weights = *weights;
    }

    /// `μ = W (y − r)`, and `½ (y − r)ᵀ μ`.
    #[inline(always)]
    fn square(&mut self, reference: &[T], stage: usize) -> Result<T, OcpError> {
        let Self { weights, coupled, y, mu, .. } = self;
        for (y, &r) in y.as_mut().iter_mut().zip(reference) {
            *y = *y - r;
        }
        weigh::<F, T>(weights, *coupled, y, mu);
        let products = y.as_ref().iter().zip(mu.as_ref()).map(|(y, mu)| *y * *mu);
        let square = products.fold(T::ZERO, |sum, product| sum + product);
        let value = T::from_f64(0.5) * square;
        if value.is_finite() {
            return Ok(value);
        }
        let (output, value) = crate::irk::not_finite(y.as_ref()).unwrap_or((0, value.to_f64()));
        Err(OcpError::NonFiniteFunction { function: F::STRUCTURE.name, stage, output, value })
    }
}

/// `μ = W y`
#[inline(always)]
fn weigh<F: Function, T: Real>(
    weights: &MatrixYY<F, T>,
    coupled: usize,
    y: &ArrayY<F, T>,
    mu: &mut ArrayY<F, T>,
) {
    for (k, mu) in mu.as_mut().iter_mut().enumerate() {
        *mu = if coupled == 0 {
            weights[(k, k)] * y[k]
        } else {
            let products = y.as_ref().iter().enumerate().map(|(l, y)| weights[(k, l)] * *y);
            products.fold(T::ZERO, |sum, product| sum + product)
        };
    }
}

/// Entries of the Jacobian in one row that belong to `x`, to `z` and to `u`, row by row.
struct Rows {
    structure: FunctionStructure,
    begins: [usize; 3],
    row: usize,
}

impl Rows {
    #[inline(always)]
    fn new<F: Function>() -> Self {
        let structure = F::STRUCTURE;
        Self { structure, begins: [structure.blocks[1], structure.blocks[2], structure.blocks[3]], row: 0 }
    }
}

impl Iterator for Rows {
    type Item = [Range<usize>; 3];
    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        let (rows, blocks) = (self.structure.jacobian.rows, self.structure.blocks);
        let mut ranges = [0..0, 0..0, 0..0];
        let ends = [blocks[2], blocks[3], blocks[4]];
        for ((range, begin), end) in ranges.iter_mut().zip(&mut self.begins).zip(ends) {
            let start = *begin;
            while *begin < end && rows.get(*begin).is_some_and(|&row| row as usize == self.row) {
                *begin += 1;
            }
            *range = start..*begin;
        }
        self.row += 1;
        Some(ranges)
    }
}

/// The entries, as positions and values.
#[inline(always)]
fn entries<'a, F: Function, T: Real>(
    ranges: [Range<usize>; 3],
    jacobian: &'a [T],
) -> impl Iterator<Item = (usize, T)> + Clone + 'a {
    let [x, z, u] = ranges;
    x.chain(u).chain(z).filter_map(move |entry| {
        let (_, variable) = F::STRUCTURE.jacobian.get(entry)?;
        Some((position::<F::Shape>(variable)?, *jacobian.get(entry)?))
    })
}

impl<F: Function, T: Real> Cost<F::Shape, T> for LeastSquaresCost<F, T> {
    const REFERENCES: usize = F::Outputs::NY;
    const CONVEX: bool = true;

    fn check(&self, there: There) -> Result<(), OcpError> {
        for (index, value) in self.weights.as_slice().iter().enumerate() {
            if !value.is_finite() {
                let value = value.to_f64();
                return Err(OcpError::InvalidValue { part: Part::Weights, stage: 0, index, value });
            }
        }
        there.check::<F>()
    }

    fn value(&mut self, v: &ArrayV<F, T>, reference: &[T], stage: usize) -> Result<T, OcpError> {
        F::value::<T>(v, &mut self.y);
        self.square(reference, stage)
    }

    fn add(
        &mut self,
        v: &ArrayV<F, T>,
        reference: &[T],
        at: At<'_, T>,
        terms: &mut Terms<'_, T>,
    ) -> Result<T, OcpError> {
        F::value_jacobian::<T>(v, &mut self.y, &mut self.jacobian);
        let value = self.square(reference, at.stage)?;
        let Self { weights, coupled, y, mu, jacobian, hessian } = self;
        let jacobian = jacobian.as_ref();
        // `Jᵀ W (y − r) − JᵀWJ v = JᵀW (y − r − J v)`
        let moved = |y: T, row: [Range<usize>; 3]| {
            entries::<F, T>(row, jacobian)
                .fold(y, |y, (i, value)| y - value * at.from.get(i).copied().unwrap_or(T::ZERO))
        };
        if !at.from.is_empty() && *coupled != 0 {
            for (y, row) in y.as_mut().iter_mut().zip(Rows::new::<F>()) {
                *y = moved(*y, row);
            }
            weigh::<F, T>(weights, *coupled, y, mu);
        }
        for ((k, row), mu) in Rows::new::<F>().enumerate().take(F::Outputs::NY).zip(mu.as_ref()) {
            let weight = at.factor * weights[(k, k)];
            let slope = if !at.from.is_empty() && *coupled == 0 {
                weight * moved(y[k], row.clone())
            } else {
                at.factor * *mu
            };
            let row = entries::<F, T>(row, jacobian);
            for (i, value) in row.clone() {
                terms.slope(i, slope * value);
            }
            if *coupled == 0 {
                multiply(terms, weight, row.clone(), row);
                continue;
            }
            for (l, other) in Rows::new::<F>().enumerate().take(F::Outputs::NY) {
                let weight = at.factor * weights[(k, l)];
                multiply(terms, weight, row.clone(), entries::<F, T>(other, jacobian));
            }
        }
        if at.exact && !F::STRUCTURE.hessian.is_empty() {
            F::hessian::<T>(v, mu, hessian);
            terms.curvature::<F>(hessian, at.factor);
        }
        Ok(at.factor * value)
    }

    fn cross(
        &mut self,
        v: &ArrayV<F, T>,
        reference: &[T],
        at: At<'_, T>,
        cross: &mut Cross<'_, T>,
    ) -> Result<(), OcpError> {
        F::value_jacobian::<T>(v, &mut self.y, &mut self.jacobian);
        self.square(reference, at.stage)?;
        let Self { weights, mu, jacobian, hessian, .. } = self;
        let entries = || jacobian.as_ref().iter().zip(F::STRUCTURE.jacobian.iter());
        for (&a, (k, variable)) in entries() {
            let Some(i) = position::<F::Shape>(variable) else { continue };
            for (&b, (l, variable)) in entries() {
                let Some(p) = parameter::<F::Shape>(variable) else { continue };
                cross.add(i, p, at.factor * weights[(k, l)] * a * b);
            }
        }
        if at.exact && !F::STRUCTURE.hessian.is_empty() {
            F::hessian::<T>(v, mu, hessian);
            cross.curvature::<F>(hessian, at.factor);
        }
        Ok(())
    }
}

/// Adds the lower triangle of `weight · a bᵀ`.
#[inline(always)]
fn multiply<T: Real>(
    terms: &mut Terms<'_, T>,
    weight: T,
    a: impl Iterator<Item = (usize, T)>,
    b: impl Iterator<Item = (usize, T)> + Clone,
) {
    if weight == T::ZERO {
        return;
    }
    for (i, a) in a {
        for (j, b) in b.clone() {
            if i >= j {
                terms.curve(i, j, weight * a * b);
            }
        }
    }
}

/// The sum of all outputs `y(x, z, u, p, t)` of a function, with its exact Hessian.
///
/// If that is not positive semidefinite, the stages are made convex.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct GeneralCost<F: Function, T: Plain = f64> {
    y: ArrayY<F, T>,
    mu: ArrayY<F, T>,
    gradient: ArrayV<F, T>,
    hessian: F::Hessian<T>,
}

impl<F: Function, T: Plain> GeneralCost<F, T> {
    /// The cost of a function.
    #[must_use]
    pub fn new() -> Self {
        Self::zeroed()
    }
}

impl<F: Function, T: Plain> Default for GeneralCost<F, T> {
    fn default() -> Self {
        Self::zeroed()
    }
}

impl<F: Function, T: Real> Cost<F::Shape, T> for GeneralCost<F, T> {
    const REFERENCES: usize = 0;
    const CONVEX: bool = F::STRUCTURE.hessian.is_empty();

    fn check(&self, there: There) -> Result<(), OcpError> {
        there.check::<F>()
    }

    fn value(&mut self, v: &ArrayV<F, T>, _: &[T], stage: usize) -> Result<T, OcpError> {
        F::value::<T>(v, &mut self.y);
        let sum = self.y.as_ref().iter().fold(T::ZERO, |sum, &y| sum + y);
        if sum.is_finite() {
            return Ok(sum);
        }
        let (output, value) = crate::irk::not_finite(self.y.as_ref()).unwrap_or((0, sum.to_f64()));
        Err(OcpError::NonFiniteFunction { function: F::STRUCTURE.name, stage, output, value })
    }

    fn add(
        &mut self,
        v: &ArrayV<F, T>,
        reference: &[T],
        at: At<'_, T>,
        terms: &mut Terms<'_, T>,
    ) -> Result<T, OcpError> {
        let value = self.value(v, reference, at.stage)?;
        self.mu = Array::from_fn(|_| T::ONE);
        F::adjoint::<T>(v, &self.mu, &mut self.gradient);
        for (variable, &slope) in self.gradient.as_ref().iter().enumerate() {
            if let Some(i) = position::<F::Shape>(variable) {
                terms.slope(i, at.factor * slope);
            }
        }
        if !F::STRUCTURE.hessian.is_empty() {
            F::hessian::<T>(v, &self.mu, &mut self.hessian);
            terms.curvature::<F>(&self.hessian, at.factor);
        }
        Ok(at.factor * value)
    }

    fn cross(
        &mut self,
        v: &ArrayV<F, T>,
        _: &[T],
        at: At<'_, T>,
        cross: &mut Cross<'_, T>,
    ) -> Result<(), OcpError> {
        if !F::STRUCTURE.hessian.is_empty() {
            self.mu = Array::from_fn(|_| T::ONE);
            F::hessian::<T>(v, &self.mu, &mut self.hessian);
            cross.curvature::<F>(&self.hessian, at.factor);
        }
        Ok(())
    }
}
