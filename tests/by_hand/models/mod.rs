//! Small models, written by hand.
#![allow(dead_code)]

pub mod pendulum;
mod rod;
mod shifted;

#[allow(unused_imports)] // Each program takes a part.
pub use rod::{N, Rod};
#[allow(unused_imports)]
pub use shifted::Shifted;

use casados_core::model::{ArrayK, ArrayV, Elimination, Operations, Pattern, Structure, symmetric};
use casados_core::shape::Plain;
use casados_core::{Dae, Dims, Lanes};

/// No counts: these models are not generated.
pub const NONE: Operations = Operations { residual: 0, residual_jacobian: 0, adjoint: 0, hessian: 0 };

/// `∇(μᵀ f)` from the Jacobian.
pub fn adjoint_of_jacobian<M: Dae, S: Lanes>(
    v: &ArrayV<M, S::Cell>,
    mu: &ArrayK<M, S::Cell>,
    gradient: &mut ArrayV<M, S::Cell>,
    mut jacobian: M::Jacobian<S::Cell>,
    mut f: ArrayK<M, S::Cell>,
) {
    M::jacobian_constants::<S>(&mut jacobian);
    M::residual_jacobian::<S>(v, &mut f, &mut jacobian);
    for cell in gradient.as_mut() {
        S::from_f64(0.0).store(cell);
    }
    for (entry, value) in jacobian.as_ref().iter().enumerate() {
        let (row, column) = M::STRUCTURE.jacobian.at(entry);
        let sum = S::load(&gradient[column]) + S::load(&mu[row]) * S::load(value);
        sum.store(&mut gradient[column]);
    }
}

/// `μᵀ f` is differentiated by `adjoint_of_jacobian`, for a model with `[S; $k]` equations and
/// `[S; $j]` entries.
macro_rules! adjoint {
    ($j:literal, $k:literal) => {
        fn adjoint<S: Lanes>(
            v: &ArrayV<Self, S::Cell>,
            mu: &ArrayK<Self, S::Cell>,
            gradient: &mut ArrayV<Self, S::Cell>,
        ) {
            crate::models::adjoint_of_jacobian::<Self, S>(v, mu, gradient, [v[0]; $j], [v[0]; $k]);
        }
    };
}

/// A fully implicit, nonlinear model with everything: variables `(ẋ₀, ẋ₁, x₀, x₁, z, u, p, t)`,
///
/// ```text
/// ẋ₀ (1 + x₀²) + ẋ₁ x₀ − x₁ z − u t = 0
/// ẋ₁ − p sin x₀ + z = 0
/// z + z³ − x₀ x₁ − u² − p = 0
/// ```
pub struct Nonlinear;

impl Dae for Nonlinear {
    type Shape = Dims<2, 1, 1, 1, 3, 8, 4>;
    type Jacobian<T: Plain> = [T; 15];
    type Hessian<T: Plain> = [T; 8];
    type Factors<B: Plain> = [B; 0];
    const STRUCTURE: Structure = Structure {
        name: "nonlinear",
        x: &["x[0]", "x[1]"],
        z: &["z"],
        u: &["u"],
        p: &["p"],
        jacobian: Pattern {
            rows: &[0, 0, 1, 0, 0, 1, 2, 2, 0, 1, 2, 0, 2, 1, 2],
            columns: &[0, 1, 1, 2, 3, 2, 2, 3, 4, 4, 4, 5, 5, 6, 6],
        },
        blocks: [0, 3, 8, 11, 13, 15],
        by_column: &[3, 5, 6, 4, 7, 8, 9, 10, 11, 12, 13, 14],
        constant: &[false; 15],
        hessian: Pattern { rows: &[2, 2, 2, 3, 4, 4, 5, 6], columns: &[0, 1, 2, 2, 3, 4, 5, 2] },
        linear: &[false; 3],
        linear_in_state: false,
        constant_matrix: false,
        autonomous: false,
        constant_rows: &[false; 3],
        trivial: &[],
        quadratures: &[],
        directions: &[0, 1, 2, 3],
        column_of_direction: &[0, 1, 2, 3],
        curved: &[0, 1, 2, 3, 4, 5, 6],
        symmetric: &const {
            symmetric::<7, 13>(
                &Pattern { rows: &[2, 2, 2, 3, 4, 4, 5, 6], columns: &[0, 1, 2, 2, 3, 4, 5, 2] },
                &[0, 1, 2, 3, 4, 5, 6],
            )
        },
        diagonal_controls: &[],
        operations: NONE,
        elimination: Elimination::NONE,
        reduction: None,
    };

    fn residual<S: Lanes>(v: &ArrayV<Self, S::Cell>, f: &mut ArrayK<Self, S::Cell>) {
        let v = &v.map(|cell| S::load(&cell));
        let (mut values, cells) = (f.map(|cell| S::load(&cell)), f);
        let f = &mut values;
        let [k0, k1, x0, x1, z, u, p, t] = *v;
        let one = S::from_f64(1.0);
        f[0] = k0 * (one + x0 * x0) + k1 * x0 - x1 * z - u * t;
        f[1] = k1 - p * x0.sin() + z;
        f[2] = z + z * z * z - x0 * x1 - u * u - p;
        cells.iter_mut().zip(f).for_each(|(cell, value)| value.store(cell));
    }
    fn jacobian_constants<S: Lanes>(_: &mut [S::Cell; 15]) {}
    fn residual_jacobian<S: Lanes>(
        v: &ArrayV<Self, S::Cell>,
        f: &mut ArrayK<Self, S::Cell>,
        j: &mut [S::Cell; 15],
    ) {
        Self::residual::<S>(v, f);
        let v = &v.map(|cell| S::load(&cell));
        let (mut values, cells) = (j.map(|cell| S::load(&cell)), j);
        let j = &mut values;
        let [k0, k1, x0, x1, z, u, p, t] = *v;
        let n = S::from_f64;
        *j = [
            n(1.0) + x0 * x0,
            x0,
            n(1.0),
            n(2.0) * k0 * x0 + k1,
            -z,
            -p * x0.cos(),
            -x1,
            -x0,
            -x1,
            n(1.0),
            n(1.0) + n(3.0) * z * z,
            -t,
            n(-2.0) * u,
            -x0.sin(),
            n(-1.0),
        ];
        cells.iter_mut().zip(j).for_each(|(cell, value)| value.store(cell));
    }
    adjoint!(15, 3);
    fn hessian<S: Lanes>(v: &ArrayV<Self, S::Cell>, mu: &ArrayK<Self, S::Cell>, h: &mut [S::Cell; 8]) {
        let v = &v.map(|cell| S::load(&cell));
        let mu = &mu.map(|cell| S::load(&cell));
        let (mut values, cells) = (h.map(|cell| S::load(&cell)), h);
        let h = &mut values;
        let [k0, _, x0, _, z, _, p, _] = *v;
        let n = S::from_f64;
        *h = [
            mu[0] * n(2.0) * x0,
            mu[0],
            mu[0] * n(2.0) * k0 + mu[1] * p * x0.sin(),
            -mu[2],
            -mu[0],
            mu[2] * n(6.0) * z,
            n(-2.0) * mu[2],
            -mu[1] * x0.cos(),
        ];
        cells.iter_mut().zip(h).for_each(|(cell, value)| value.store(cell));
    }
}

/// `ẋ = p x + u`, and `z = x`.
pub struct Linear;

impl Dae for Linear {
    type Shape = Dims<1, 1, 1, 1, 2, 6, 3>;
    type Jacobian<T: Plain> = [T; 6];
    type Hessian<T: Plain> = [T; 1];
    type Factors<B: Plain> = [B; 0];
    const STRUCTURE: Structure = Structure {
        name: "linear",
        x: &["x"],
        z: &["z"],
        u: &["u"],
        p: &["p"],
        jacobian: Pattern { rows: &[0, 0, 1, 1, 0, 0], columns: &[0, 1, 1, 2, 3, 4] },
        blocks: [0, 1, 3, 4, 5, 6],
        by_column: &[1, 2, 3, 4, 5],
        constant: &[true, false, true, true, true, false],
        hessian: Pattern { rows: &[4], columns: &[1] },
        linear: &[false, true],
        linear_in_state: false,
        constant_matrix: false,
        autonomous: false,
        constant_rows: &[false; 2],
        trivial: &[],
        quadratures: &[],
        directions: &[0, 1, 2],
        column_of_direction: &[0, 1, 2],
        curved: &[1, 4],
        symmetric: &const { symmetric::<2, 2>(&Pattern { rows: &[4], columns: &[1] }, &[1, 4]) },
        diagonal_controls: &[],
        operations: NONE,
        elimination: Elimination::NONE,
        reduction: None,
    };
    fn residual<S: Lanes>(v: &ArrayV<Self, S::Cell>, f: &mut ArrayK<Self, S::Cell>) {
        let v = &v.map(|cell| S::load(&cell));
        let (mut values, cells) = (f.map(|cell| S::load(&cell)), f);
        let f = &mut values;
        let [k, x, z, u, p, _] = *v;
        *f = [k - p * x - u, z - x];
        cells.iter_mut().zip(f).for_each(|(cell, value)| value.store(cell));
    }
    fn jacobian_constants<S: Lanes>(j: &mut [S::Cell; 6]) {
        let (mut values, cells) = (j.map(|cell| S::load(&cell)), j);
        let j = &mut values;
        let one = S::from_f64(1.0);
        (j[0], j[2], j[3], j[4]) = (one, -one, one, -one);
        cells.iter_mut().zip(j).for_each(|(cell, value)| value.store(cell));
    }
    fn residual_jacobian<S: Lanes>(
        v: &ArrayV<Self, S::Cell>,
        f: &mut ArrayK<Self, S::Cell>,
        j: &mut [S::Cell; 6],
    ) {
        Self::residual::<S>(v, f);
        let v = &v.map(|cell| S::load(&cell));
        let (mut values, cells) = (j.map(|cell| S::load(&cell)), j);
        let j = &mut values;
        (j[1], j[5]) = (-v[4], -v[1]);
        cells.iter_mut().zip(j).for_each(|(cell, value)| value.store(cell));
    }
    adjoint!(6, 2);
    fn hessian<S: Lanes>(_: &ArrayV<Self, S::Cell>, mu: &ArrayK<Self, S::Cell>, h: &mut [S::Cell; 1]) {
        let mu = &mu.map(|cell| S::load(&cell));
        let (mut values, cells) = (h.map(|cell| S::load(&cell)), h);
        let h = &mut values;
        *h = [-mu[0]];
        cells.iter_mut().zip(h).for_each(|(cell, value)| value.store(cell));
    }
}

/// `ẋ = √x − u` where the root is NaN below zero, and `u z = x`, singular at `u = 0`.
pub struct Fragile;

impl Dae for Fragile {
    type Shape = Dims<1, 1, 1, 0, 2, 5, 2>;
    type Jacobian<T: Plain> = [T; 6];
    type Hessian<T: Plain> = [T; 2];
    type Factors<B: Plain> = [B; 0];
    const STRUCTURE: Structure = Structure {
        name: "fragile",
        x: &["level"],
        z: &["ratio"],
        u: &["u"],
        p: &[],
        jacobian: Pattern { rows: &[0, 0, 1, 1, 0, 1], columns: &[0, 1, 1, 2, 3, 3] },
        blocks: [0, 1, 3, 4, 6, 6],
        by_column: &[1, 2, 3, 4, 5],
        constant: &[false; 6],
        hessian: Pattern { rows: &[1, 3], columns: &[1, 2] },
        linear: &[false; 2],
        linear_in_state: false,
        constant_matrix: false,
        autonomous: false,
        constant_rows: &[false; 2],
        trivial: &[],
        quadratures: &[],
        directions: &[0, 1],
        column_of_direction: &[0, 1],
        curved: &[1, 2, 3],
        symmetric: &const { symmetric::<3, 3>(&Pattern { rows: &[1, 3], columns: &[1, 2] }, &[1, 2, 3]) },
        diagonal_controls: &[],
        operations: NONE,
        elimination: Elimination::NONE,
        reduction: None,
    };
    fn residual<S: Lanes>(v: &ArrayV<Self, S::Cell>, f: &mut ArrayK<Self, S::Cell>) {
        let v = &v.map(|cell| S::load(&cell));
        let (mut values, cells) = (f.map(|cell| S::load(&cell)), f);
        let f = &mut values;
        let [k, x, z, u, _] = *v;
        *f = [k - x.sqrt() + u, u * z - x];
        cells.iter_mut().zip(f).for_each(|(cell, value)| value.store(cell));
    }
    fn jacobian_constants<S: Lanes>(_: &mut [S::Cell; 6]) {}
    fn residual_jacobian<S: Lanes>(
        v: &ArrayV<Self, S::Cell>,
        f: &mut ArrayK<Self, S::Cell>,
        j: &mut [S::Cell; 6],
    ) {
        Self::residual::<S>(v, f);
        let v = &v.map(|cell| S::load(&cell));
        let (mut values, cells) = (j.map(|cell| S::load(&cell)), j);
        let j = &mut values;
        let [_, x, z, u, _] = *v;
        let one = S::from_f64(1.0);
        *j = [one, S::from_f64(-0.5) / x.sqrt(), -one, u, one, z];
        cells.iter_mut().zip(j).for_each(|(cell, value)| value.store(cell));
    }
    adjoint!(6, 2);
    fn hessian<S: Lanes>(v: &ArrayV<Self, S::Cell>, mu: &ArrayK<Self, S::Cell>, h: &mut [S::Cell; 2]) {
        let v = &v.map(|cell| S::load(&cell));
        let mu = &mu.map(|cell| S::load(&cell));
        let (mut values, cells) = (h.map(|cell| S::load(&cell)), h);
        let h = &mut values;
        *h = [mu[0] * S::from_f64(0.25) / (v[1] * v[1].sqrt()), mu[1]];
        cells.iter_mut().zip(h).for_each(|(cell, value)| value.store(cell));
    }
}

/// No differential states: `z³ = u`.
pub struct Algebraic;

impl Dae for Algebraic {
    type Shape = Dims<0, 1, 1, 0, 1, 3, 1>;
    type Jacobian<T: Plain> = [T; 2];
    type Hessian<T: Plain> = [T; 1];
    type Factors<B: Plain> = [B; 0];
    const STRUCTURE: Structure = Structure {
        name: "algebraic",
        x: &[],
        z: &["z"],
        u: &["u"],
        p: &[],
        jacobian: Pattern { rows: &[0, 0], columns: &[0, 1] },
        blocks: [0, 0, 0, 1, 2, 2],
        by_column: &[0, 1],
        constant: &[false, true],
        hessian: Pattern { rows: &[0], columns: &[0] },
        linear: &[false],
        linear_in_state: false,
        constant_matrix: false,
        autonomous: false,
        constant_rows: &[false; 1],
        trivial: &[],
        quadratures: &[],
        directions: &[0],
        column_of_direction: &[0],
        curved: &[0],
        symmetric: &const { symmetric::<1, 1>(&Pattern { rows: &[0], columns: &[0] }, &[0]) },
        diagonal_controls: &[],
        operations: NONE,
        elimination: Elimination::NONE,
        reduction: None,
    };
    fn residual<S: Lanes>(v: &ArrayV<Self, S::Cell>, f: &mut ArrayK<Self, S::Cell>) {
        let v = &v.map(|cell| S::load(&cell));
        let (mut values, cells) = (f.map(|cell| S::load(&cell)), f);
        let f = &mut values;
        let [z, u, _] = *v;
        *f = [z * z * z - u];
        cells.iter_mut().zip(f).for_each(|(cell, value)| value.store(cell));
    }
    fn jacobian_constants<S: Lanes>(j: &mut [S::Cell; 2]) {
        let (mut values, cells) = (j.map(|cell| S::load(&cell)), j);
        let j = &mut values;
        j[1] = S::from_f64(-1.0);
        cells.iter_mut().zip(j).for_each(|(cell, value)| value.store(cell));
    }
    fn residual_jacobian<S: Lanes>(
        v: &ArrayV<Self, S::Cell>,
        f: &mut ArrayK<Self, S::Cell>,
        j: &mut [S::Cell; 2],
    ) {
        Self::residual::<S>(v, f);
        let v = &v.map(|cell| S::load(&cell));
        let (mut values, cells) = (j.map(|cell| S::load(&cell)), j);
        let j = &mut values;
        j[0] = S::from_f64(3.0) * v[0] * v[0];
        cells.iter_mut().zip(j).for_each(|(cell, value)| value.store(cell));
    }
    adjoint!(2, 1);
    fn hessian<S: Lanes>(v: &ArrayV<Self, S::Cell>, mu: &ArrayK<Self, S::Cell>, h: &mut [S::Cell; 1]) {
        let v = &v.map(|cell| S::load(&cell));
        let mu = &mu.map(|cell| S::load(&cell));
        let (mut values, cells) = (h.map(|cell| S::load(&cell)), h);
        let h = &mut values;
        *h = [mu[0] * S::from_f64(6.0) * v[0]];
        cells.iter_mut().zip(h).for_each(|(cell, value)| value.store(cell));
    }
}
