//! A model written by hand, with a fault on request.

use crate::models::NONE;
use casados_core::model::{ArrayK, ArrayV, Dae, Elimination, GraphDae, Pattern, Structure, symmetric};
use casados_core::scalar::{Lanes, Scalar};
use casados_core::shape::{Dims, Plain};

/// `0 = ẋ − u sin x − z, 0 = z eˣ − p`, with a fault on request.
pub struct Example<const FAULT: u8>;

pub const NO_FAULT: u8 = 0;
pub const JACOBIAN_SIGN: u8 = 1;
pub const ADJOINT_LAST_DIGITS: u8 = 2;
pub const HESSIAN_TERM: u8 = 3;
pub const HESSIAN_PATTERN: u8 = 4;
pub const CONSTANT_NOT_WRITTEN: u8 = 5;
pub const FALSELY_LINEAR: u8 = 6;
pub const FALSELY_CONSTANT: u8 = 7;
pub const DIRECTION_MISSING: u8 = 8;
pub const NONLINEAR_VARIABLE_MISSING: u8 = 9;
pub const FALSE_QUADRATURE: u8 = 10;
pub const FALSELY_TRIVIAL: u8 = 11;
pub const FALSELY_LINEAR_IN_STATE: u8 = 12;
pub const FALSELY_CONSTANT_MATRIX: u8 = 13;
pub const FALSELY_AUTONOMOUS: u8 = 14;

fn residual<S: Scalar>(v: &[S], f: &mut [S]) {
    f[0] = v[0] - v[3] * v[1].sin() - v[2];
    f[1] = v[2] * v[1].exp() - v[4];
}

fn gradient<const FAULT: u8, S: Scalar>(v: &[S], mu: &[S], g: &mut [S]) {
    let (s, c) = v[1].sin_cos();
    let e = v[1].exp();
    g[0] = mu[0];
    g[1] = mu[1] * v[2] * e - mu[0] * v[3] * c;
    g[2] = mu[1] * e - mu[0];
    g[3] = -mu[0] * s;
    g[4] = -mu[1];
    g[5] = S::from_f64(0.0);
    if FAULT == ADJOINT_LAST_DIGITS {
        g[3] = g[3] * S::from_f64(1.0 + 1e-13);
    }
}

impl<const FAULT: u8> Dae for Example<FAULT> {
    type Shape = Dims<1, 1, 1, 1, 2, 6, 3>;
    type Jacobian<T: Plain> = [T; 7];
    type Hessian<T: Plain> = [T; 3];
    type Factors<B: Plain> = [B; 0];
    const STRUCTURE: Structure = Structure {
        name: "example",
        x: &["angle"],
        z: &["force"],
        u: &["torque"],
        p: &["level"],
        jacobian: Pattern { rows: &[0, 0, 1, 0, 1, 0, 1], columns: &[0, 1, 1, 2, 2, 3, 4] },
        blocks: [0, 1, 3, 5, 6, 7],
        by_column: &[1, 2, 3, 4, 5, 6],
        constant: &[true, false, false, true, false, false, true],
        hessian: Pattern {
            rows: &[1, 2, 3],
            // The pattern with a fault has (2, 2) in place of (2, 1).
            columns: if FAULT == HESSIAN_PATTERN { &[1, 2, 1] } else { &[1, 1, 1] },
        },
        linear: if FAULT == FALSELY_LINEAR { &[false, true] } else { &[false, false] },
        linear_in_state: FAULT == FALSELY_LINEAR_IN_STATE,
        constant_matrix: FAULT == FALSELY_CONSTANT_MATRIX,
        autonomous: FAULT == FALSELY_AUTONOMOUS,
        constant_rows: if FAULT == FALSELY_CONSTANT { &[false, true] } else { &[false, false] },
        trivial: if FAULT == FALSELY_TRIVIAL { &[0] } else { &[] },
        quadratures: if FAULT == FALSE_QUADRATURE { &[0] } else { &[] },
        directions: if FAULT == DIRECTION_MISSING { &[0, 1] } else { &[0, 1, 2] },
        column_of_direction: &[0, 1, 2],
        curved: if FAULT == NONLINEAR_VARIABLE_MISSING { &[1, 3] } else { &[1, 2, 3] },
        symmetric: &const { symmetric::<3, 5>(&Pattern { rows: &[1, 2, 3], columns: &[1, 1, 1] }, &[1, 2, 3]) },
        diagonal_controls: &[],
        operations: NONE,
        elimination: Elimination::NONE,
        reduction: None,
    };

    fn residual<S: Lanes>(v: &ArrayV<Self, S::Cell>, f: &mut ArrayK<Self, S::Cell>) {
        let v = &v.map(|cell| S::load(&cell));
        let (mut values, cells) = (f.map(|cell| S::load(&cell)), f);
        let f = &mut values;
        residual(v, f);
        if FAULT == FALSELY_AUTONOMOUS {
            f[0] = f[0] - v[5];
        }
        cells.iter_mut().zip(f).for_each(|(cell, value)| value.store(cell));
    }
    fn jacobian_constants<S: Lanes>(jacobian: &mut Self::Jacobian<S::Cell>) {
        let (mut values, cells) = (jacobian.map(|cell| S::load(&cell)), jacobian);
        let jacobian = &mut values;
        jacobian[0] = S::from_f64(1.0);
        jacobian[3] = S::from_f64(-1.0);
        if FAULT != CONSTANT_NOT_WRITTEN {
            jacobian[6] = S::from_f64(-1.0);
        }
        cells.iter_mut().zip(jacobian).for_each(|(cell, value)| value.store(cell));
    }
    fn residual_jacobian<S: Lanes>(
        v: &ArrayV<Self, S::Cell>,
        f: &mut ArrayK<Self, S::Cell>,
        jacobian: &mut Self::Jacobian<S::Cell>,
    ) {
        Self::residual::<S>(v, f);
        let v = &v.map(|cell| S::load(&cell));
        let (mut values, cells) = (jacobian.map(|cell| S::load(&cell)), jacobian);
        let jacobian = &mut values;
        let (s, c) = v[1].sin_cos();
        jacobian[1] = if FAULT == JACOBIAN_SIGN { v[3] * c } else { -v[3] * c };
        jacobian[2] = v[2] * v[1].exp();
        jacobian[4] = v[1].exp();
        jacobian[5] = -s;
        cells.iter_mut().zip(jacobian).for_each(|(cell, value)| value.store(cell));
    }
    fn adjoint<S: Lanes>(
        v: &ArrayV<Self, S::Cell>,
        mu: &ArrayK<Self, S::Cell>,
        g: &mut ArrayV<Self, S::Cell>,
    ) {
        let v = &v.map(|cell| S::load(&cell));
        let mu = &mu.map(|cell| S::load(&cell));
        let (mut values, cells) = (g.map(|cell| S::load(&cell)), g);
        let g = &mut values;
        gradient::<FAULT, S>(v, mu, g);
        cells.iter_mut().zip(g).for_each(|(cell, value)| value.store(cell));
    }
    fn hessian<S: Lanes>(
        v: &ArrayV<Self, S::Cell>,
        mu: &ArrayK<Self, S::Cell>,
        hessian: &mut Self::Hessian<S::Cell>,
    ) {
        let v = &v.map(|cell| S::load(&cell));
        let mu = &mu.map(|cell| S::load(&cell));
        let (mut values, cells) = (hessian.map(|cell| S::load(&cell)), hessian);
        let hessian = &mut values;
        let (s, c) = v[1].sin_cos();
        let e = v[1].exp();
        hessian[0] = mu[0] * v[3] * s;
        if FAULT != HESSIAN_TERM {
            hessian[0] = hessian[0] + mu[1] * v[2] * e;
        }
        hessian[1] = mu[1] * e;
        hessian[2] = -mu[0] * c;
        cells.iter_mut().zip(hessian).for_each(|(cell, value)| value.store(cell));
    }
}

impl<const FAULT: u8> GraphDae for Example<FAULT> {
    fn residual_of<S: Scalar>(v: &[S], f: &mut [S]) {
        residual(v, f);
    }
    fn adjoint_of<S: Scalar>(v: &[S], mu: &[S], g: &mut [S]) {
        gradient::<FAULT, S>(v, mu, g);
    }
}
