//! The chain rule over the parts of an interval: derivatives of each part as one matrix, and
//! derivatives of the whole interval.
//!
//! With `V = dx/dw` at the start of a part, its derivatives `(A, B)` by `x` and by `(u, p)`, and
//! `D = (V, (0, 1))`:
//!
//! ```text
//! V⁺ = A V + (0, B)        S += Dᵀ H D
//! ```

use crate::linalg::axpy;
use crate::model::{ArrayW, ArrayX, Dae};
use crate::result::{self, Forward, Hessian};
use crate::scalar::Real;
use crate::shape::{Array, Matrix, Shape, entry};

/// `dx/dw` in row-major order.
pub(crate) type StateSensitivities<M, T> = ArrayX<M, ArrayW<M, T>>;
/// A full symmetric matrix in row-major order.
pub(crate) type FullHessian<M, T> = ArrayW<M, ArrayW<M, T>>;

/// Sets `dx/dw` for `x = x₀`.
pub(crate) fn set_identity<M: Dae, T: Real>(v: &mut StateSensitivities<M, T>) {
    for (x, row) in v.as_mut().iter_mut().enumerate() {
        *row = ArrayW::<M, T>::from_fn(|w| if w == x { T::ONE } else { T::ZERO });
    }
}

/// Multiplies a row of `(A, B_u, B_p)` by `D`.
fn chain_row<M: Dae, T: Real, A: Matrix<T>, B: Matrix<T>, C: Matrix<T>>(
    index: usize,
    v: &StateSensitivities<M, T>,
    (by_x, by_u, by_p): (&A, &B, &C),
) -> ArrayW<M, T> {
    let (nx, nu) = (M::Shape::NX, M::Shape::NU);
    let mut sum = ArrayW::<M, T>::from_fn(|w| match w.checked_sub(nx) {
        None => T::ZERO,
        Some(input) if input < nu => entry(by_u, index, input),
        Some(input) => entry(by_p, index, input - nu),
    });
    for (column, v) in v.as_ref().iter().enumerate() {
        axpy(entry(by_x, index, column), v.as_ref(), sum.as_mut());
    }
    sum
}

/// Computes `V⁺`.
pub(crate) fn chain_states<M: Dae, T: Real>(
    part: &Forward<M, T>,
    current: &StateSensitivities<M, T>,
    next: &mut StateSensitivities<M, T>,
) {
    for (index, next) in next.as_mut().iter_mut().enumerate() {
        *next = chain_row::<M, T, _, _, _>(index, current, (&part.dx_dx0, &part.dx_du, &part.dx_dp));
    }
}

/// Writes the derivatives of the final states, from `V` at the end.
pub(crate) fn write_states<M: Dae, T: Real>(v: &StateSensitivities<M, T>, result: &mut Forward<M, T>) {
    for (index, row) in v.as_ref().iter().enumerate() {
        result::write_row(row.as_ref(), index, &mut result.dx_dx0, &mut result.dx_du, &mut result.dx_dp);
    }
}

/// Writes the derivatives of the final algebraic states; `v` is `V` at the start of the last part.
pub(crate) fn write_algebraic<M: Dae, T: Real>(
    part: &Forward<M, T>,
    v: &StateSensitivities<M, T>,
    result: &mut Forward<M, T>,
) {
    for index in 0..M::Shape::NZ {
        let row = chain_row::<M, T, _, _, _>(index, v, (&part.dz_dx0, &part.dz_du, &part.dz_dp));
        result::write_row(row.as_ref(), index, &mut result.dz_dx0, &mut result.dz_du, &mut result.dz_dp);
    }
}

/// `S += Dᵀ H D` with the Hessian of a part and the rows of `V`.
pub(crate) fn add_congruence<M: Dae, T: Real>(
    h: impl Fn(usize, usize) -> T,
    v: &[T],
    [product, sum]: [&mut FullHessian<M, T>; 2],
) {
    let (nx, nw) = (M::Shape::NX, M::Shape::NW);
    let v = || v.chunks_exact(nw.max(1)).take(nx);
    // G = H D
    for (r, row) in product.as_mut().iter_mut().enumerate() {
        *row = ArrayW::<M, T>::from_fn(|w| if w < nx { T::ZERO } else { h(r, w) });
        for (column, v) in v().enumerate() {
            axpy(h(r, column), v, row.as_mut());
        }
    }
    // S += Dᵀ G
    for (row, v) in product.as_ref().iter().zip(v()) {
        for (sum, factor) in sum.as_mut().iter_mut().zip(v) {
            axpy(*factor, row.as_ref(), sum.as_mut());
        }
    }
    for index in nx..nw {
        axpy(T::ONE, product[index].as_ref(), sum[index].as_mut());
    }
}

/// Returns an element of the full Hessian.
pub(crate) fn hessian_element<M: Dae, T: Real>(from: &Hessian<M, T>, r: usize, c: usize) -> T {
    let (nx, nu) = (M::Shape::NX, M::Shape::NU);
    let (i, j) = (r.min(c), r.max(c));
    if j < nx {
        entry(&from.h_xx, i, j)
    } else if j < nx + nu {
        if i < nx { entry(&from.h_xu, i, j - nx) } else { entry(&from.h_uu, i - nx, j - nx) }
    } else if i < nx {
        entry(&from.h_xp, i, j - nx - nu)
    } else if i < nx + nu {
        entry(&from.h_up, i - nx, j - nx - nu)
    } else {
        entry(&from.h_pp, i - nx - nu, j - nx - nu)
    }
}

/// Writes the blocks of a sum, bitwise symmetric: of two elements that differ by rounding the lower
/// one is used.
pub(crate) fn write_blocks<M: Dae, T: Real>(sum: &FullHessian<M, T>, result: &mut Hessian<M, T>) {
    let (nx, nu) = (M::Shape::NX, M::Shape::NU);
    let at = |r: usize, c: usize| if r >= c { sum[r][c] } else { sum[c][r] };
    fill_matrix(&mut result.h_xx, at);
    fill_matrix(&mut result.h_xu, |r, c| at(r, nx + c));
    fill_matrix(&mut result.h_uu, |r, c| at(nx + r, nx + c));
    fill_matrix(&mut result.h_xp, |r, c| at(r, nx + nu + c));
    fill_matrix(&mut result.h_up, |r, c| at(nx + r, nx + nu + c));
    fill_matrix(&mut result.h_pp, |r, c| at(nx + nu + r, nx + nu + c));
}

pub(crate) fn fill_matrix<T, A: Matrix<T>>(matrix: &mut A, element: impl Fn(usize, usize) -> T) {
    for c in 0..A::COLUMNS {
        for r in 0..A::ROWS {
            matrix[(r, c)] = element(r, c);
        }
    }
}
