//! Matrices over the unknowns of an estimate: the reduced Hessian, and the Gram matrix of active
//! constraints.

use super::get;
use super::unknowns::Unknowns;
use crate::linalg::{axpy, dot};
use crate::ocp::assembly::convexify::diagonalise;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::HeapOcp;
use crate::ocp::formulation::problem::Formulation;
use crate::qp::element::add;
use crate::qp::{Bounds, copy_common, marked_indices, part, zeros};
use crate::scalar::Real;
use alloc::vec::Vec;

/// A symmetric matrix of `n` unknowns, by columns, with both triangles.
pub(super) struct GramMatrix<T> {
    n: usize,
    pub data: Vec<T>,
}

impl<T: Real> GramMatrix<T> {
    pub fn new(n: usize) -> Result<Self, OcpError> {
        Ok(Self { n, data: zeros(n * n)? })
    }
    /// Adds `factor (a bᵀ + b aᵀ) / 2`.
    pub fn add_symmetric_product(&mut self, factor: T, a: &[T], b: &[T]) {
        let half = T::from_f64(0.5) * factor;
        for ((column, &x), &y) in self.data.chunks_exact_mut(self.n.max(1)).zip(a).zip(b) {
            axpy(half * y, a, column);
            axpy(half * x, b, column);
        }
    }
    /// `Bᵀ A B`, where `basis` has the columns of `B`.
    pub fn reduced(&self, basis: &[Vec<T>]) -> Result<Self, OcpError> {
        let mut result = Self::new(basis.len())?;
        let mut product = zeros(self.n)?;
        for (column, b) in result.data.chunks_exact_mut(basis.len().max(1)).zip(basis) {
            product.fill(T::ZERO);
            for (a, &factor) in self.data.chunks_exact(self.n.max(1)).zip(b) {
                axpy(factor, a, &mut product);
            }
            for (element, other) in column.iter_mut().zip(basis) {
                *element = dot(&product, other);
            }
        }
        Ok(result)
    }
    /// Eigenvalues with their eigenvectors, by Jacobi's method.
    pub fn eigenpairs(mut self) -> Result<Vec<(T, Vec<T>)>, OcpError> {
        let n = self.n;
        let mut vectors = zeros(n * n)?;
        (0..n).for_each(|i| add(&mut vectors, i * n + i, T::ONE));
        diagonalise(&mut self.data, &mut vectors, n.max(1), n);
        let value = |i: usize| get(&self.data, i * n + i);
        Ok(vectors.chunks_exact(n.max(1)).enumerate().map(|(i, v)| (value(i), v.to_vec())).collect())
    }
}

impl<P: Formulation<T>, T: Real> HeapOcp<P, T> {
    /// `Zᵀ H Z`
    pub(super) fn reduced_hessian(&self, unknowns: &Unknowns<T>) -> Result<GramMatrix<T>, OcpError> {
        let mut gram = GramMatrix::new(unknowns.count())?;
        for (k, stage) in self.qp().stages().enumerate() {
            let view = stage.arrays();
            for j in 0..view.n {
                for i in j..view.n {
                    let value = get(view.hessian, j * view.ld + i);
                    if value != T::ZERO {
                        let factor = if i == j { value } else { value + value };
                        gram.add_symmetric_product(factor, unknowns.row(k, i), unknowns.row(k, j));
                    }
                }
            }
        }
        Ok(gram)
    }

    /// `Σ c cᵀ` over the normalised gradients `c` of active constraints with respect to the
    /// unknowns in their units.
    pub(super) fn active_constraint_gram(
        &self,
        unknowns: &Unknowns<T>,
        units: &[T],
    ) -> Result<GramMatrix<T>, OcpError> {
        let n = unknowns.count();
        let mut gram = GramMatrix::new(n)?;
        let mut row = zeros(n)?;
        let mut add_row = |row: &mut [T]| {
            row.iter_mut().zip(units).for_each(|(c, &unit)| *c = *c * unit);
            let square = dot(row, row);
            if square > T::ZERO {
                gram.add_symmetric_product(T::ONE / square, row, row);
            }
            row.fill(T::ZERO);
        };
        let qp = self.qp();
        for ((k, stage), point) in qp.stages().enumerate().zip(self.iterate.stages()) {
            let view = stage.arrays();
            let nx = point.x.len();
            let values = || point.x.iter().chain(point.u);
            for (i, &x) in point.x.iter().enumerate() {
                let multipliers = [get(point.x_lower, i), get(point.x_upper, i)];
                if is_active(&stage.x_bounds(), i, x, multipliers) {
                    copy_common(&mut row, unknowns.row(k, i));
                    add_row(&mut row);
                }
            }
            for (j, &u) in point.u.iter().enumerate() {
                let multipliers = [get(point.u_lower, j), get(point.u_upper, j)];
                if is_active(&stage.u_bounds(), j, u, multipliers) {
                    copy_common(&mut row, unknowns.row(k, nx + j));
                    add_row(&mut row);
                }
            }
            for (g, (&lower, &upper)) in point.g_lower.iter().zip(point.g_upper).enumerate() {
                let column = part(view.matrix, (view.next + g) * view.ld, view.n);
                let value = column.iter().zip(values()).fold(T::ZERO, |sum, (&c, &v)| sum + c * v);
                if is_active(&stage.g_bounds(), g, value, [lower, upper]) {
                    for (i, &factor) in column.iter().enumerate() {
                        axpy(factor, unknowns.row(k, i), &mut row);
                    }
                    add_row(&mut row);
                }
            }
        }
        for i in marked_indices(qp.periodic()) {
            copy_common(&mut row, unknowns.row(0, i));
            axpy(-T::ONE, unknowns.row(self.intervals(), i), &mut row);
            add_row(&mut row);
        }
        Ok(gram)
    }
}

/// Whether a hard bound is active: an equation, or a bound whose multiplier is larger than its
/// slack.
fn is_active<T: Real>(bounds: &Bounds<'_, T>, i: usize, value: T, [lower, upper]: [T; 2]) -> bool {
    let at = |values: &[T]| get(values, i);
    let is_hard = |linear: &[T]| !at(linear).is_finite();
    let equation = at(bounds.lower) == at(bounds.upper);
    let below = lower > value - at(bounds.lower) && is_hard(bounds.lower_linear);
    let above = upper > at(bounds.upper) - value && is_hard(bounds.upper_linear);
    equation || below || above
}
