//! Derivatives of parts as one matrix, and those of the whole.

use super::Rows;
use crate::linalg::axpy;
use crate::model::{ArrayW, Dae};
use crate::result::{Forward, Hessian};
use crate::scalar::Real;
use crate::shape::{Array, Matrix, Shape, change, entry};

/// A row of `(A, B_u, B_p)` times `D`.
fn row<M: Dae, T: Real, A: Matrix<T>, B: Matrix<T>, C: Matrix<T>>(
    index: usize,
    v: &Rows<M, T>,
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

/// `V_{k+1}`
pub(super) fn advance<M: Dae, T: Real>(part: &Forward<M, T>, now: &Rows<M, T>, next: &mut Rows<M, T>) {
    for (index, next) in next.as_mut().iter_mut().enumerate() {
        *next = row::<M, T, _, _, _>(index, now, (&part.dx_dx0, &part.dx_du, &part.dx_dp));
    }
}

/// The derivatives at the end of the last part, which starts with `now` and ends with `next`.
pub(super) fn of_end<M: Dae, T: Real>(
    part: &Forward<M, T>,
    now: &Rows<M, T>,
    next: &Rows<M, T>,
    result: &mut Forward<M, T>,
) {
    let (nx, nu) = (M::Shape::NX, M::Shape::NU);
    let Forward { dx_dx0, dx_du, dx_dp, dz_dx0, dz_du, dz_dp, .. } = result;
    fill(dx_dx0, |r, c| next[r][c]);
    fill(dx_du, |r, c| next[r][nx + c]);
    fill(dx_dp, |r, c| next[r][nx + nu + c]);
    for index in 0..M::Shape::NZ {
        let sum = row::<M, T, _, _, _>(index, now, (&part.dz_dx0, &part.dz_du, &part.dz_dp));
        for (w, value) in sum.as_ref().iter().enumerate() {
            match w.checked_sub(nx) {
                None => change(dz_dx0, index, w, |_| *value),
                Some(input) if input < nu => change(dz_du, index, input, |_| *value),
                Some(input) => change(dz_dp, index, input - nu, |_| *value),
            }
        }
    }
}

/// `S += Dᵀ H D` with the Hessian of a part, where `D = (V, (0, 1))`.
pub(super) fn add<M: Dae, T: Real>(
    part: &Hessian<M, T>,
    v: &Rows<M, T>,
    [product, sum]: [&mut ArrayW<M, ArrayW<M, T>>; 2],
) {
    let (nx, nw) = (M::Shape::NX, M::Shape::NW);
    // G = H D
    for (r, row) in product.as_mut().iter_mut().enumerate() {
        *row = ArrayW::<M, T>::from_fn(|w| if w < nx { T::ZERO } else { element(part, r, w) });
        for (column, v) in v.as_ref().iter().enumerate() {
            axpy(element(part, r, column), v.as_ref(), row.as_mut());
        }
    }
    // S += Dᵀ G
    for (row, v) in product.as_ref().iter().zip(v.as_ref()) {
        for (sum, factor) in sum.as_mut().iter_mut().zip(v.as_ref()) {
            axpy(*factor, row.as_ref(), sum.as_mut());
        }
    }
    for index in nx..nw {
        axpy(T::ONE, product[index].as_ref(), sum[index].as_mut());
    }
}

/// An element of the whole Hessian.
fn element<M: Dae, T: Real>(from: &Hessian<M, T>, r: usize, c: usize) -> T {
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

/// The blocks of the sum, to the last bit symmetric: of two elements that differ by rounding the
/// lower one.
pub(super) fn split<M: Dae, T: Real>(sum: &ArrayW<M, ArrayW<M, T>>, result: &mut Hessian<M, T>) {
    let (nx, nu) = (M::Shape::NX, M::Shape::NU);
    let at = |r: usize, c: usize| if r >= c { sum[r][c] } else { sum[c][r] };
    fill(&mut result.h_xx, at);
    fill(&mut result.h_xu, |r, c| at(r, nx + c));
    fill(&mut result.h_uu, |r, c| at(nx + r, nx + c));
    fill(&mut result.h_xp, |r, c| at(r, nx + nu + c));
    fill(&mut result.h_up, |r, c| at(nx + r, nx + nu + c));
    fill(&mut result.h_pp, |r, c| at(nx + nu + r, nx + nu + c));
}

fn fill<T, A: Matrix<T>>(matrix: &mut A, element: impl Fn(usize, usize) -> T) {
    for c in 0..A::COLUMNS {
        for r in 0..A::ROWS {
            matrix[(r, c)] = element(r, c);
        }
    }
}
