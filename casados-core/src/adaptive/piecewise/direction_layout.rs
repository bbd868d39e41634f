//! Derivatives over successive intervals with respect to all of their controls.

use crate::linalg::axpy;
use crate::model::Dae;
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};

/// The indices of the directions `W = (x₀, u₀, …, u_{N−1}, p)`.
pub struct DirectionLayout<M> {
    pub intervals: usize,
    pub model: core::marker::PhantomData<M>,
}

impl<M: Dae> DirectionLayout<M> {
    pub fn control_column(&self, k: usize) -> usize {
        M::Shape::NX + k * M::Shape::NU
    }

    pub fn parameter_column(&self) -> usize {
        self.control_column(self.intervals)
    }

    pub fn column_count(&self) -> usize {
        self.parameter_column() + M::Shape::NP
    }

    /// Computes `next = A V + (B at u_k, C at p)`, row by row.
    pub fn apply_chain_rule<T: Real>(
        &self,
        k: usize,
        a: &impl Matrix<T>,
        b: &impl Matrix<T>,
        c: &impl Matrix<T>,
        v: &[T],
        next: &mut [T],
    ) {
        let width = self.column_count();
        for (r, row) in next.chunks_exact_mut(width).enumerate().take(row_count(a)) {
            row.fill(T::ZERO);
            for (x, v) in v.chunks_exact(width).enumerate() {
                axpy(a[(r, x)], v, row);
            }
            for (column, element) in row[self.control_column(k)..].iter_mut().enumerate().take(M::Shape::NU) {
                *element = *element + b[(r, column)];
            }
            for (column, element) in row[self.parameter_column()..].iter_mut().enumerate() {
                *element = *element + c[(r, column)];
            }
        }
    }

    /// Adds `sum += g D`.
    pub fn add_gradient<T: Real>(&self, k: usize, gradient: &[T], v: &[T], sum: &mut [T]) {
        let (nx, nu) = (M::Shape::NX, M::Shape::NU);
        let (states, others) = gradient.split_at(nx);
        let (controls, parameters) = others.split_at(nu);
        for (g, v) in states.iter().zip(v.chunks_exact(self.column_count().max(1))) {
            axpy(*g, v, sum);
        }
        axpy(T::ONE, controls, &mut sum[self.control_column(k)..]);
        axpy(T::ONE, parameters, &mut sum[self.parameter_column()..]);
    }

    /// Adds `sum += Dᵀ H D`, the product `H D` first.
    pub fn add_projected_hessian<T: Real>(
        &self,
        k: usize,
        h: impl Fn(usize, usize) -> T,
        v: &[T],
        product: &mut [T],
        sum: &mut [T],
    ) {
        let (nx, nu, width) = (M::Shape::NX, M::Shape::NU, self.column_count());
        // The global index of a local direction that is not a state.
        let global = |w: usize| {
            if w < nx + nu { self.control_column(k) + w - nx } else { self.parameter_column() + w - nx - nu }
        };
        for (r, row) in product.chunks_exact_mut(width).enumerate().take(M::Shape::NW) {
            row.fill(T::ZERO);
            for (c, v) in v.chunks_exact(width).enumerate() {
                axpy(h(r, c), v, row);
            }
            for c in nx..M::Shape::NW {
                row[global(c)] = row[global(c)] + h(r, c);
            }
        }
        for (w, row) in product.chunks_exact(width).enumerate() {
            match v.chunks_exact(width).nth(w) {
                Some(v) => {
                    for (v, sum) in v.iter().zip(sum.chunks_exact_mut(width)) {
                        axpy(*v, row, sum);
                    }
                }
                None => axpy(T::ONE, row, &mut sum[global(w) * width..][..width]),
            }
        }
    }
}

fn row_count<T, A: Matrix<T>>(_: &A) -> usize {
    A::ROWS
}
