//! Dimensions of a model as types, for arrays in static memory.
//!
//! Stable Rust has no `[T; M::NX]` in generic code. So the dimensions of a model are a type,
//! [`Dims`], and [`Shape`] maps an element type to the arrays and matrices of these dimensions.

mod in_bounds;
mod outputs;

pub(crate) use in_bounds::InBounds;
pub use outputs::{Count, Outputs};

use bytemuck::Zeroable;
use core::fmt::Debug;
use core::ops::{Deref, DerefMut, Index, IndexMut};
use nalgebra::{SMatrix, SVector};

/// An element of static memory: `Copy`, and valid if all its bytes are zero.
pub trait Plain: Copy + Zeroable + Debug + PartialEq + Send + Sync + 'static {}
impl<T: Copy + Zeroable + Debug + PartialEq + Send + Sync + 'static> Plain for T {}

/// Implements `Copy` without the bounds of a derive.
macro_rules! copy {
    ([$($generics:tt)*] $type:ty) => {
        impl<$($generics)*> Clone for $type {
            #[inline(always)]
            fn clone(&self) -> Self {
                *self
            }
        }
        impl<$($generics)*> Copy for $type {}
    };
}
pub(crate) use copy;

/// Implements [`Plain`] for a struct of plain fields, without the bounds that a derive would put on
/// its parameters.
macro_rules! plain {
    ([$($generics:tt)*] $type:ty { $($field:ident),* $(,)? }) => {
        crate::shape::copy!([$($generics)*] $type);
        crate::shape::compared!([$($generics)*] $type { $($field),* });
    };
}
pub(crate) use plain;

/// The same for a struct with a list among its fields.
#[cfg(feature = "alloc")]
macro_rules! listed {
    ([$($generics:tt)*] $type:ty { $($field:ident),* $(,)? }) => {
        impl<$($generics)*> Clone for $type {
            fn clone(&self) -> Self {
                Self { $($field: self.$field.clone()),* }
            }
        }
        crate::shape::compared!([$($generics)*] $type { $($field),* });
    };
}
#[cfg(feature = "alloc")]
pub(crate) use listed;

macro_rules! compared {
    ([$($generics:tt)*] $type:ty { $($field:ident),* $(,)? }) => {
        impl<$($generics)*> PartialEq for $type {
            fn eq(&self, other: &Self) -> bool {
                true $(&& self.$field == other.$field)*
            }
        }
        impl<$($generics)*> core::fmt::Debug for $type {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                // The name only: `stringify` includes the generic parameters.
                let name = stringify!($type);
                f.debug_struct(name.split('<').next().unwrap_or(name).trim_end())$(.field(stringify!($field), &self.$field))*.finish()
            }
        }
    };
}
pub(crate) use compared;

/// Aligned to cache lines on machines with wide registers, where loads across cache lines are
/// split. Only with `std`: other targets choose their memory layout.
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
#[cfg_attr(all(target_arch = "x86_64", feature = "std"), repr(C, align(64)))]
pub struct Aligned<V>(pub V);

impl<V> Deref for Aligned<V> {
    type Target = V;
    #[inline(always)]
    fn deref(&self) -> &V {
        &self.0
    }
}

impl<V> DerefMut for Aligned<V> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut V {
        &mut self.0
    }
}

/// `to = from` without a copy on the stack, which an assignment makes in unoptimised programs.
#[inline(always)]
pub(crate) fn copy_into<V: Copy>(to: &mut V, from: &V) {
    core::slice::from_mut(to).copy_from_slice(core::slice::from_ref(from));
}

mod sealed {
    /// No other type implements [`Array`](super::Array).
    pub trait Sealed {}
    impl<T, const N: usize> Sealed for [T; N] {}
}

/// `[T; N]` with a length of the model.
pub trait Array<T>:
    sealed::Sealed + Plain + Index<usize, Output = T> + IndexMut<usize> + AsRef<[T]> + AsMut<[T]>
{
    /// The number of elements.
    const LEN: usize;
    /// `[f(0), f(1), ...]`
    fn from_fn(f: impl FnMut(usize) -> T) -> Self;
    /// The elements of all arrays in order.
    fn flat(arrays: &[Self]) -> &[T];
    /// The elements of all arrays in order.
    fn flat_mut(arrays: &mut [Self]) -> &mut [T];
    /// `W` elements from `begin` on.
    fn chunk<const W: usize>(&self, begin: usize) -> Option<&[T; W]>;
    /// `W` elements from `begin` on.
    fn chunk_mut<const W: usize>(&mut self, begin: usize) -> Option<&mut [T; W]>;
}

impl<T: Plain, const N: usize> Array<T> for [T; N] {
    const LEN: usize = N;
    #[inline(always)]
    fn from_fn(f: impl FnMut(usize) -> T) -> Self {
        core::array::from_fn(f)
    }
    #[inline(always)]
    fn flat(arrays: &[Self]) -> &[T] {
        arrays.as_flattened()
    }
    #[inline(always)]
    fn flat_mut(arrays: &mut [Self]) -> &mut [T] {
        arrays.as_flattened_mut()
    }
    #[inline(always)]
    fn chunk<const W: usize>(&self, begin: usize) -> Option<&[T; W]> {
        if const { N == W } {
            return self.first_chunk();
        }
        match self.get(begin..) {
            Some(columns) => columns.first_chunk(),
            None => None,
        }
    }
    #[inline(always)]
    fn chunk_mut<const W: usize>(&mut self, begin: usize) -> Option<&mut [T; W]> {
        if const { N == W } {
            return self.first_chunk_mut();
        }
        match self.get_mut(begin..) {
            Some(columns) => columns.first_chunk_mut(),
            None => None,
        }
    }
}

/// A nalgebra matrix or vector with dimensions of the model, column-major.
pub trait Matrix<T>: Plain + Index<(usize, usize), Output = T> + IndexMut<(usize, usize)> {
    /// The number of rows.
    const ROWS: usize;
    /// The number of columns.
    const COLUMNS: usize;
    /// The elements in column-major order.
    fn as_slice(&self) -> &[T];
    /// The elements in column-major order.
    fn as_mut_slice(&mut self) -> &mut [T];
}

/// Returns an element whose indices come from a table; zero if it does not exist.
pub(crate) fn entry<T: Plain, A: Matrix<T>>(matrix: &A, row: usize, column: usize) -> T {
    matrix.as_slice().get(row + column * A::ROWS).copied().unwrap_or_else(T::zeroed)
}

/// Changes an element whose indices come from a table.
pub(crate) fn update_entry<T: Plain, A: Matrix<T>>(
    matrix: &mut A,
    row: usize,
    column: usize,
    by: impl FnOnce(T) -> T,
) {
    if let Some(element) = matrix.as_mut_slice().get_mut(row + column * A::ROWS) {
        *element = by(*element);
    }
}

impl<T: Plain, const R: usize, const C: usize> Matrix<T> for SMatrix<T, R, C> {
    const ROWS: usize = R;
    const COLUMNS: usize = C;
    #[inline(always)]
    fn as_slice(&self) -> &[T] {
        self.as_slice()
    }
    #[inline(always)]
    fn as_mut_slice(&mut self) -> &mut [T] {
        self.as_mut_slice()
    }
}

/// The dimensions of a model, with their arrays and matrices.
///
/// Three index sets are used everywhere:
/// - unknowns of a stage `(k, z)`, length `NK = NX + NZ`: the rows and columns of the Newton
///   matrix;
/// - variables of the model `(ẋ, x, z, u, p, t)`, length `NV = 2 NX + NZ + NU + NP + 1`;
/// - directions of sensitivities `w = (x₀, u, p)`, length `NW = NX + NU + NP`.
///
/// ```
/// use casados::prelude::*;
/// use casados::Shape;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1], p: [f64; 1]) -> [f64; 2] {
///     [x[1], p[0] * u[0]]
/// }
///
/// /// How many directions first derivatives have.
/// const fn directions<M: Dae>() -> usize {
///     <M::Shape as Shape>::NW
/// }
/// assert_eq!(directions::<Cart>(), 2 + 1 + 1);
/// ```
pub trait Shape: 'static {
    /// Differential states.
    const NX: usize;
    /// Algebraic states.
    const NZ: usize;
    /// Controls.
    const NU: usize;
    /// Parameters.
    const NP: usize;
    /// Unknowns of a stage: `NX + NZ`.
    const NK: usize;
    /// Variables of the model, including the time: `2 NX + NZ + NU + NP + 1`.
    const NV: usize;
    /// Directions of sensitivities: `NX + NU + NP`.
    const NW: usize;
    /// Columns of the memory for directions, `NW` or more.
    const NC: usize;

    /// `[T; NX]`
    type ArrayX<T: Plain>: Array<T>;
    /// `[T; NZ]`
    type ArrayZ<T: Plain>: Array<T>;
    /// `[T; NU]`
    type ArrayU<T: Plain>: Array<T>;
    /// `[T; NP]`
    type ArrayP<T: Plain>: Array<T>;
    /// `[T; NK]`
    type ArrayK<T: Plain>: Array<T>;
    /// `[T; NV]`
    type ArrayV<T: Plain>: Array<T>;
    /// `[T; NW]`
    type ArrayW<T: Plain>: Array<T>;
    /// `[T; NC]`
    type ArrayC<T: Plain>: Array<T>;

    /// `SVector<T, NX>`
    type VectorX<T: Plain>: Matrix<T>;
    /// `SVector<T, NZ>`
    type VectorZ<T: Plain>: Matrix<T>;
    /// `SVector<T, NU>`
    type VectorU<T: Plain>: Matrix<T>;
    /// `SVector<T, NP>`
    type VectorP<T: Plain>: Matrix<T>;
    /// `SMatrix<T, NX, NX>`
    type MatrixXX<T: Plain>: Matrix<T>;
    /// `SMatrix<T, NX, NU>`
    type MatrixXU<T: Plain>: Matrix<T>;
    /// `SMatrix<T, NX, NP>`
    type MatrixXP<T: Plain>: Matrix<T>;
    /// `SMatrix<T, NZ, NX>`
    type MatrixZX<T: Plain>: Matrix<T>;
    /// `SMatrix<T, NZ, NU>`
    type MatrixZU<T: Plain>: Matrix<T>;
    /// `SMatrix<T, NZ, NP>`
    type MatrixZP<T: Plain>: Matrix<T>;
    /// `SMatrix<T, NU, NU>`
    type MatrixUU<T: Plain>: Matrix<T>;
    /// `SMatrix<T, NU, NP>`
    type MatrixUP<T: Plain>: Matrix<T>;
    /// `SMatrix<T, NP, NP>`
    type MatrixPP<T: Plain>: Matrix<T>;
    /// `SMatrix<T, NX, C>`: one column per seed.
    type MatrixXC<T: Plain, const C: usize>: Matrix<T>;
    /// `SMatrix<T, NZ, C>`
    type MatrixZC<T: Plain, const C: usize>: Matrix<T>;
    /// `SMatrix<T, NU, C>`
    type MatrixUC<T: Plain, const C: usize>: Matrix<T>;
    /// `SMatrix<T, NP, C>`
    type MatrixPC<T: Plain, const C: usize>: Matrix<T>;
    /// `SMatrix<T, C, NX>`: one row for each output of a function.
    type MatrixCX<T: Plain, const C: usize>: Matrix<T>;
    /// `SMatrix<T, C, NZ>`
    type MatrixCZ<T: Plain, const C: usize>: Matrix<T>;
    /// `SMatrix<T, C, NU>`
    type MatrixCU<T: Plain, const C: usize>: Matrix<T>;
    /// `SMatrix<T, C, NP>`
    type MatrixCP<T: Plain, const C: usize>: Matrix<T>;
}

/// The dimensions of a model. `NK`, `NV` and `NW` follow from the first four (see [`Shape`]); they
/// are written out because stable Rust cannot add in a type.
///
/// ```
/// use casados::prelude::*;
/// use casados::{Dims, Shape};
///
/// #[dae]
/// fn tank(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: f64) -> [f64; 3] {
///     [xdot[0] + z, xdot[1] - z, z - u * p * x[0]]
/// }
///
/// // nx, nz, nu, np; nk = nx + nz, nv = 2 nx + nz + nu + np + 1, nw = nx + nu + np; and the columns
/// // of derivatives in memory: nw, in whole panels.
/// fn has_dimensions<M: Dae<Shape = Dims<2, 1, 1, 1, 3, 8, 4, 8>>>() -> [usize; 3] {
///     [M::Shape::NK, M::Shape::NV, M::Shape::NW]
/// }
/// assert_eq!(has_dimensions::<Tank>(), [3, 8, 4]);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Dims<
    const NX: usize,
    const NZ: usize,
    const NU: usize,
    const NP: usize,
    const NK: usize,
    const NV: usize,
    const NW: usize,
    const NC: usize = NW,
>;

impl<
    const NX: usize,
    const NZ: usize,
    const NU: usize,
    const NP: usize,
    const NK: usize,
    const NV: usize,
    const NW: usize,
    const NC: usize,
> Shape for Dims<NX, NZ, NU, NP, NK, NV, NW, NC>
{
    const NX: usize = NX;
    const NZ: usize = NZ;
    const NU: usize = NU;
    const NP: usize = NP;
    const NK: usize = {
        assert!(NK == NX + NZ, "NK must be NX + NZ");
        NK
    };
    const NV: usize = {
        assert!(NV == 2 * NX + NZ + NU + NP + 1, "NV must be 2 NX + NZ + NU + NP + 1");
        NV
    };
    const NW: usize = {
        assert!(NW == NX + NU + NP, "NW must be NX + NU + NP");
        NW
    };
    const NC: usize = {
        assert!(NC >= NW, "NC must be NW or more");
        NC
    };
    type ArrayX<T: Plain> = [T; NX];
    type ArrayZ<T: Plain> = [T; NZ];
    type ArrayU<T: Plain> = [T; NU];
    type ArrayP<T: Plain> = [T; NP];
    type ArrayK<T: Plain> = [T; NK];
    type ArrayV<T: Plain> = [T; NV];
    type ArrayW<T: Plain> = [T; NW];
    type ArrayC<T: Plain> = [T; NC];
    type VectorX<T: Plain> = SVector<T, NX>;
    type VectorZ<T: Plain> = SVector<T, NZ>;
    type VectorU<T: Plain> = SVector<T, NU>;
    type VectorP<T: Plain> = SVector<T, NP>;
    type MatrixXX<T: Plain> = SMatrix<T, NX, NX>;
    type MatrixXU<T: Plain> = SMatrix<T, NX, NU>;
    type MatrixXP<T: Plain> = SMatrix<T, NX, NP>;
    type MatrixZX<T: Plain> = SMatrix<T, NZ, NX>;
    type MatrixZU<T: Plain> = SMatrix<T, NZ, NU>;
    type MatrixZP<T: Plain> = SMatrix<T, NZ, NP>;
    type MatrixUU<T: Plain> = SMatrix<T, NU, NU>;
    type MatrixUP<T: Plain> = SMatrix<T, NU, NP>;
    type MatrixPP<T: Plain> = SMatrix<T, NP, NP>;
    type MatrixXC<T: Plain, const C: usize> = SMatrix<T, NX, C>;
    type MatrixZC<T: Plain, const C: usize> = SMatrix<T, NZ, C>;
    type MatrixUC<T: Plain, const C: usize> = SMatrix<T, NU, C>;
    type MatrixPC<T: Plain, const C: usize> = SMatrix<T, NP, C>;
    type MatrixCX<T: Plain, const C: usize> = SMatrix<T, C, NX>;
    type MatrixCZ<T: Plain, const C: usize> = SMatrix<T, C, NZ>;
    type MatrixCU<T: Plain, const C: usize> = SMatrix<T, C, NU>;
    type MatrixCP<T: Plain, const C: usize> = SMatrix<T, C, NP>;
}
