//! Blocks of derivatives, and what is checked of them.

use super::*;

/// Derivatives of `z` at the end of a step in all directions, row by row.
pub(super) fn algebraic<M: Dae, T: Real>(
    forward: &Forward<M, T>,
    v: &ArrayX<M, ArrayW<M, T>>,
    row: &mut ArrayW<M, T>,
    mut write: impl FnMut(&[T], usize),
) {
    let (nx, nu) = (M::Shape::NX, M::Shape::NU);
    for i in 0..M::Shape::NZ {
        for (w, element) in row.as_mut().iter_mut().enumerate() {
            *element = if w < nx {
                T::ZERO
            } else if w < nx + nu {
                forward.dz_du[(i, w - nx)]
            } else {
                forward.dz_dp[(i, w - nx - nu)]
            };
        }
        for (j, v) in v.as_ref().iter().enumerate() {
            axpy(forward.dz_dx0[(i, j)], v.as_ref(), row.as_mut());
        }
        write(row.as_ref(), i);
    }
}

/// The blocks of a Hessian as one matrix.
pub(in crate::adaptive) fn place<M: Dae, T: Real>(from: &Hessian<M, T>, to: &mut ArrayW<M, ArrayW<M, T>>) {
    let (nx, nu) = (M::Shape::NX, M::Shape::NU);
    for (r, row) in to.as_mut().iter_mut().enumerate() {
        for (c, element) in row.as_mut().iter_mut().enumerate() {
            let (i, j) = (r.min(c), r.max(c));
            *element = if j < nx {
                from.h_xx[(i, j)]
            } else if j < nx + nu {
                if i < nx { from.h_xu[(i, j - nx)] } else { from.h_uu[(i - nx, j - nx)] }
            } else if i < nx {
                from.h_xp[(i, j - nx - nu)]
            } else if i < nx + nu {
                from.h_up[(i - nx, j - nx - nu)]
            } else {
                from.h_pp[(i - nx - nu, j - nx - nu)]
            };
        }
    }
}

pub(in crate::adaptive) fn fill<T, A: Matrix<T>>(matrix: &mut A, element: impl Fn(usize, usize) -> T) {
    for c in 0..A::COLUMNS {
        for r in 0..A::ROWS {
            matrix[(r, c)] = element(r, c);
        }
    }
}

/// An error of a step is one of the run.
pub(super) fn in_step(mut error: Error, number: usize) -> Error {
    match &mut error {
        Error::NonFiniteModel { at, .. }
        | Error::NonFiniteFunction { at, .. }
        | Error::Singular { at, .. }
        | Error::NotConverged { at, .. } => at.step = number,
        Error::Overflow { step, .. } => *step = number,
        _ => {}
    }
    error
}
