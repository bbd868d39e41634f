//! Dimensions of functions.

use super::{Array, Matrix, Plain, Shape};
use nalgebra::{SMatrix, SVector};

/// The number of outputs of a function, with the arrays and matrices that depend on it.
pub trait Outputs: 'static {
    /// Number of outputs.
    const NY: usize;
    /// `[T; NY]`
    type ArrayY<T: Plain>: Array<T>;
    /// `SVector<T, NY>`
    type VectorY<T: Plain>: Matrix<T>;
    /// `SMatrix<T, NY, NY>`
    type MatrixYY<T: Plain>: Matrix<T>;
    /// `SMatrix<T, NY, NX>`
    type MatrixYX<D: Shape, T: Plain>: Matrix<T>;
    /// `SMatrix<T, NY, NZ>`
    type MatrixYZ<D: Shape, T: Plain>: Matrix<T>;
    /// `SMatrix<T, NY, NU>`
    type MatrixYU<D: Shape, T: Plain>: Matrix<T>;
    /// `SMatrix<T, NY, NP>`
    type MatrixYP<D: Shape, T: Plain>: Matrix<T>;
}

/// `NY` outputs.
#[derive(Clone, Copy, Debug)]
pub struct Count<const NY: usize>;

impl<const NY: usize> Outputs for Count<NY> {
    const NY: usize = NY;
    type ArrayY<T: Plain> = [T; NY];
    type VectorY<T: Plain> = SVector<T, NY>;
    type MatrixYY<T: Plain> = SMatrix<T, NY, NY>;
    type MatrixYX<D: Shape, T: Plain> = D::MatrixCX<T, NY>;
    type MatrixYZ<D: Shape, T: Plain> = D::MatrixCZ<T, NY>;
    type MatrixYU<D: Shape, T: Plain> = D::MatrixCU<T, NY>;
    type MatrixYP<D: Shape, T: Plain> = D::MatrixCP<T, NY>;
}
