//! Models by hand for tests of the integrators alone: derivatives are those of `num-dual`, dense.
#![allow(dead_code)]

use casados::__private::{ArrayK, ArrayV};
use casados::{__private::Lanes, Dae, Shape};
use num_dual::{Dual64, HyperDual64};

/// A model whose residual is a function of any scalar.
pub trait Equations: Dae {
    /// `f(v)`
    fn equations<S: casados::__private::Scalar>(v: &[S], f: &mut [S]);
}

/// Number of variables of each block of the Jacobian, `(ẋ, x, z, u, p)`.
pub const fn block_widths<D: Shape>() -> [usize; 5] {
    [D::NX, D::NX, D::NZ, D::NU, D::NP]
}

/// Where each block of a dense Jacobian begins, and the end.
pub const fn blocks<D: Shape>() -> [usize; 6] {
    let (widths, mut begin, mut block) = (block_widths::<D>(), [0; 6], 0);
    while block < 5 {
        begin[block + 1] = begin[block] + D::NK * widths[block];
        block += 1;
    }
    begin
}

/// Rows and columns of a dense Jacobian with `N` entries: by block, row, column.
pub const fn dense<D: Shape, const N: usize>() -> [[u32; N]; 2] {
    let (widths, mut positions, mut entry, mut first, mut block) =
        (block_widths::<D>(), [[0; N]; 2], 0, 0, 0);
    while block < 5 {
        let mut row = 0;
        while row < D::NK {
            let mut column = 0;
            while column < widths[block] {
                positions[0][entry] = row as u32;
                positions[1][entry] = (first + column) as u32;
                entry += 1;
                column += 1;
            }
            row += 1;
        }
        first += widths[block];
        block += 1;
    }
    positions
}

/// Rows and columns of the lower triangle of a dense symmetric matrix with `N` entries.
pub const fn triangle<const N: usize>() -> [[u32; N]; 2] {
    let (mut positions, mut entry, mut row) = ([[0; N]; 2], 0, 0);
    while entry < N {
        let mut column = 0;
        while column <= row {
            positions[0][entry] = row;
            positions[1][entry] = column;
            entry += 1;
            column += 1;
        }
        row += 1;
    }
    positions
}

fn scalar_of_lane<S: Lanes>(values: &[S::Cell], lane: usize) -> Vec<f64> {
    values.iter().map(|value| S::lane(value, lane)).collect()
}

pub fn residual<M: Equations, S: Lanes>(v: &ArrayV<M, S::Cell>, f: &mut ArrayK<M, S::Cell>) {
    let v: Vec<S> = v.as_ref().iter().map(S::load).collect();
    let mut values = vec![S::from_f64(0.0); M::Shape::NK];
    M::equations(&v, &mut values);
    f.as_mut().iter_mut().zip(values).for_each(|(cell, value)| value.store(cell));
}

pub fn jacobian<M: Equations, S: Lanes>(v: &ArrayV<M, S::Cell>, jacobian: &mut [S::Cell]) {
    let pattern = M::STRUCTURE.jacobian;
    for l in 0..S::LANES {
        let v = scalar_of_lane::<S>(v.as_ref(), l);
        for variable in 0..v.len() - 1 {
            let v: Vec<_> = (0..v.len()).map(|i| Dual64::new(v[i], f64::from(i == variable))).collect();
            let mut f = vec![Dual64::from(0.0); M::Shape::NK];
            M::equations(&v, &mut f);
            for (entry, value) in jacobian.iter_mut().enumerate() {
                if pattern.at(entry).1 == variable {
                    S::set_lane(value, l, f[pattern.at(entry).0].eps);
                }
            }
        }
    }
}

pub fn adjoint<M: Equations, S: Lanes>(
    v: &ArrayV<M, S::Cell>,
    mu: &ArrayK<M, S::Cell>,
    gradient: &mut ArrayV<M, S::Cell>,
) {
    let mut values = vec![v.as_ref()[0]; M::STRUCTURE.jacobian.len()];
    jacobian::<M, S>(v, &mut values);
    gradient.as_mut().iter_mut().for_each(|cell| S::from_f64(0.0).store(cell));
    for (entry, value) in values.iter().enumerate() {
        let (row, column) = M::STRUCTURE.jacobian.at(entry);
        let sum = S::load(&gradient[column]) + S::load(&mu[row]) * S::load(value);
        sum.store(&mut gradient[column]);
    }
}

pub fn hessian<M: Equations, S: Lanes>(
    v: &ArrayV<M, S::Cell>,
    mu: &ArrayK<M, S::Cell>,
    hessian: &mut [S::Cell],
) {
    for l in 0..S::LANES {
        let (v, mu) = (scalar_of_lane::<S>(v.as_ref(), l), scalar_of_lane::<S>(mu.as_ref(), l));
        for (entry, value) in hessian.iter_mut().enumerate() {
            let (a, b) = M::STRUCTURE.hessian.at(entry);
            let one = |i: usize, j: usize| f64::from(i == j);
            let v: Vec<_> = (0..v.len()).map(|i| HyperDual64::new(v[i], one(i, a), one(i, b), 0.0)).collect();
            let mut f = vec![HyperDual64::from(0.0); mu.len()];
            M::equations(&v, &mut f);
            S::set_lane(value, l, f.iter().zip(&mu).map(|(f, mu)| f.eps1eps2 * mu).sum());
        }
    }
}

/// `system!(Name [NX, NZ, NU, NP], |v, f| body)`: a model with the residual `f(v)`, where `body`
/// may use the scalar type `S`.
#[macro_export]
macro_rules! system {
    ($(#[$doc:meta])* $name:ident [$nx:literal, $nz:literal, $nu:literal, $np:literal] $s:ident |$v:ident, $f:ident| $body:block) => {
        $(#[$doc])*
        struct $name;
        const _: () = {
            use casados::{__private::{ArrayK, ArrayV, Elimination, all, by_column, symmetric}, model::{Operations, Pattern, Structure}};
            const NV: usize = 2 * $nx + $nz + $nu + $np + 1;
            const JACOBIAN: usize = ($nx + $nz) * (NV - 1);
            const HESSIAN: usize = NV * (NV - 1) / 2;
            type D = casados::Dims<$nx, $nz, $nu, $np, { $nx + $nz }, NV, { $nx + $nu + $np }>;
            static DENSE: [[u32; JACOBIAN]; 2] = $crate::systems::dense::<D, JACOBIAN>();
            static TRIANGLE: [[u32; HESSIAN]; 2] = $crate::systems::triangle::<HESSIAN>();
            impl casados::Dae for $name {
                type Shape = D;
                type Jacobian<T: casados::__private::Plain> = [T; JACOBIAN];
                type Hessian<T: casados::__private::Plain> = [T; HESSIAN];
                type Factors<B: casados::__private::Plain> = [B; 0];
                const STRUCTURE: Structure = Structure {
                    name: stringify!($name),
                    x: &["x"; $nx],
                    z: &["z"; $nz],
                    u: &["u"; $nu],
                    p: &["p"; $np],
                    jacobian: Pattern { rows: &DENSE[0], columns: &DENSE[1] },
                    blocks: $crate::systems::blocks::<D>(),
                    by_column: &const {
                        by_column::<NV, { ($nx + $nz) * (NV - 1 - $nx) }>(
                            &Pattern { rows: &DENSE[0], columns: &DENSE[1] },
                            ($nx + $nz) * $nx,
                        )
                    },
                    constant: &[false; JACOBIAN],
                    hessian: Pattern { rows: &TRIANGLE[0], columns: &TRIANGLE[1] },
                    linear: &[false; $nx + $nz],
                    linear_in_state: false,
                    constant_matrix: false,
                    autonomous: false,
                    constant_rows: &[false; $nx + $nz],
                    trivial: &[],
                    quadratures: &[],
                    directions: &all::<{ $nx + $nu + $np }>(),
                    column_of_direction: &all::<{ $nx + $nu + $np }>(),
                    curved: &all::<{ 2 * $nx + $nz + $nu + $np }>(),
                    symmetric: &const {
                        symmetric::<{ NV - 1 }, { (NV - 1) * (NV - 1) }>(
                            &Pattern { rows: &TRIANGLE[0], columns: &TRIANGLE[1] },
                            &all::<{ NV - 1 }>(),
                        )
                    },
                    diagonal_controls: &[],
                    operations: Operations { residual: 0, residual_jacobian: 0, adjoint: 0, hessian: 0 },
                    elimination: Elimination::NONE,
                    reduction: None,
                };
                fn residual<S: casados::__private::Lanes>(v: &ArrayV<Self, S::Cell>, f: &mut ArrayK<Self, S::Cell>) {
                    $crate::systems::residual::<Self, S>(v, f);
                }
                fn jacobian_constants<S: casados::__private::Lanes>(_: &mut Self::Jacobian<S::Cell>) {}
                fn residual_jacobian<S: casados::__private::Lanes>(
                    v: &ArrayV<Self, S::Cell>,
                    f: &mut ArrayK<Self, S::Cell>,
                    jacobian: &mut Self::Jacobian<S::Cell>,
                ) {
                    $crate::systems::residual::<Self, S>(v, f);
                    $crate::systems::jacobian::<Self, S>(v, jacobian);
                }
                fn adjoint<S: casados::__private::Lanes>(v: &ArrayV<Self, S::Cell>, mu: &ArrayK<Self, S::Cell>, g: &mut ArrayV<Self, S::Cell>) {
                    $crate::systems::adjoint::<Self, S>(v, mu, g);
                }
                fn hessian<S: casados::__private::Lanes>(
                    v: &ArrayV<Self, S::Cell>,
                    mu: &ArrayK<Self, S::Cell>,
                    hessian: &mut Self::Hessian<S::Cell>,
                ) {
                    $crate::systems::hessian::<Self, S>(v, mu, hessian);
                }
            }
            impl $crate::systems::Equations for $name {
                fn equations<$s: casados::__private::Scalar>($v: &[$s], $f: &mut [$s]) $body
            }
        };
    };
}

/// Says that `f = ẋ − g`, row by row.
#[macro_export]
macro_rules! explicit {
    ($name:ident: $($row:literal)*) => {
        impl casados::Ode for $name {
            const ROWS: &'static [(u32, f64)] = &[$(($row, 1.0)),*];
        }
    };
}
