//! Functions of a model's variables: values, patterns, and derivatives three ways (forward
//! differentiation through the emitted code, the complex step, formulas by hand).

use casados::function::FunctionStructure;
use casados::prelude::*;
use casados::testing::{Forward, Random};
use casados::{__private::Scalar, GraphFunction};
use nalgebra::Complex;

/// Every kind of argument: `v = (ẋ₀, ẋ₁, x₀, x₁, z, u₀, u₁, p, t)`.
#[function]
fn outputs(x: [f64; 2], z: f64, u: [f64; 2], p: f64, t: f64) -> [f64; 4] {
    let (s, c) = x[0].sin_cos();
    [s * x[1] * z + p * t, (u[0] * u[1]).exp() * c, 3.0 * x[1] - 2.0 * u[0], (z * z + p * p + 1.0).ln()]
}

const NV: usize = 9;
const NY: usize = 4;

/// `f` with a seed in each variable in turn: a matrix with a column for each.
fn tangent_columns<const N: usize>(
    v: &[f64; NV],
    f: impl Fn(&[f64; NV], usize) -> [f64; N],
) -> [[f64; NV]; N] {
    let mut matrix = [[0.0; NV]; N];
    // The last variable is the time.
    for column in 0..NV - 1 {
        for (row, value) in matrix.iter_mut().zip(f(v, column)) {
            row[column] = value;
        }
    }
    matrix
}

fn seeded<S: Scalar>(v: &[f64; NV], column: usize) -> [Forward<S>; NV] {
    core::array::from_fn(|i| Forward {
        re: S::from_f64(v[i]),
        d: S::from_f64(if i == column { 1.0 } else { 0.0 }),
    })
}

/// A step so small that its square is nothing beside one.
const STEP: f64 = 1e-100;

fn complex_step_columns(v: &[f64; NV], column: usize) -> [Complex<f64>; NV] {
    core::array::from_fn(|i| Complex::new(v[i], if i == column { STEP } else { 0.0 }))
}

/// All entries of the Jacobian, those outside of the pattern as zeros.
fn jacobian(v: &[f64; NV]) -> [[f64; NV]; NY] {
    let mut values = [0.0; 11];
    let mut y = [f64::NAN; NY];
    Outputs::jacobian_constants::<f64>(&mut values);
    Outputs::value_jacobian::<f64>(v, &mut y, &mut values);
    let mut matrix = [[0.0; NV]; NY];
    for (entry, value) in values.iter().enumerate() {
        let (row, column) = Outputs::STRUCTURE.jacobian.at(entry);
        matrix[row][column] = *value;
    }
    let mut alone = [f64::NAN; NY];
    Outputs::value::<f64>(v, &mut alone);
    assert_eq!(y, alone);
    matrix
}

fn hessian(v: &[f64; NV], mu: &[f64; NY]) -> [[f64; NV]; NV] {
    let mut values = <Outputs as Function>::Hessian::<f64>::default();
    Outputs::hessian::<f64>(v, mu, &mut values);
    let mut matrix = [[0.0; NV]; NV];
    for (entry, value) in values.iter().enumerate() {
        let (row, column) = Outputs::STRUCTURE.hessian.at(entry);
        assert!(row >= column);
        matrix[row][column] = *value;
        matrix[column][row] = *value;
    }
    matrix
}

/// Some thirty operations on numbers of size one to twenty: a relative error of 1e-14 of the
/// largest is hundred units of rounding.
fn assert_close(a: &[[f64; NV]], b: &[[f64; NV]]) {
    let largest = a.as_flattened().iter().fold(1.0, |m: f64, a| m.max(a.abs()));
    for (a, b) in a.as_flattened().iter().zip(b.as_flattened()) {
        assert!((a - b).abs() <= 1e-14 * largest, "{a} is not {b}");
    }
}

fn points() -> impl Iterator<Item = ([f64; NV], [f64; NY])> {
    let mut random = Random::new(7);
    (0..20).map(move |_| {
        (core::array::from_fn(|_| 1.5 * random.symmetric()), core::array::from_fn(|_| random.symmetric()))
    })
}

#[test]
fn values_of_functions() {
    for (v, _) in points() {
        let mut y = [0.0; NY];
        Outputs::value::<f64>(&v, &mut y);
        assert_eq!(y, outputs([v[2], v[3]], v[4], [v[5], v[6]], v[7], v[8]));
    }
}

#[test]
fn first_derivatives_by_three_methods() {
    for (v, mu) in points() {
        let own = jacobian(&v);
        let forward = tangent_columns(&v, |v, column| {
            let mut y = [Forward { re: 0.0, d: 0.0 }; NY];
            Outputs::value_of(&seeded::<f64>(v, column), &mut y);
            y.map(|y| y.d)
        });
        assert_close(&own, &forward);
        let complex = tangent_columns(&v, |v, column| {
            let mut y = [Complex::new(0.0, 0.0); NY];
            Outputs::value_of(&complex_step_columns(v, column), &mut y);
            y.map(|y| y.im / STEP)
        });
        assert_close(&own, &complex);

        let [_, _, x0, x1, z, u0, u1, p, t] = v;
        let (e, d) = ((u0 * u1).exp(), z * z + p * p + 1.0);
        let (s, c) = x0.sin_cos();
        let by_hand = [
            [0.0, 0.0, c * x1 * z, s * z, s * x1, 0.0, 0.0, t, 0.0],
            [0.0, 0.0, -e * s, 0.0, 0.0, u1 * e * c, u0 * e * c, 0.0, 0.0],
            [0.0, 0.0, 0.0, 3.0, 0.0, -2.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 2.0 * z / d, 0.0, 0.0, 2.0 * p / d, 0.0],
        ];
        assert_close(&own, &by_hand);

        let mut gradient = [f64::NAN; NV];
        Outputs::adjoint::<f64>(&v, &mu, &mut gradient);
        let product: [f64; NV] =
            core::array::from_fn(|column| own.iter().zip(mu).map(|(row, mu)| mu * row[column]).sum());
        assert_close(&[gradient], &[product]);
    }
}

#[test]
fn derivatives_by_the_time() {
    for (v, _) in points() {
        let mut rate = [f64::NAN; NY];
        Outputs::time_derivative::<f64>(&v, &mut rate);
        let mut y = [Complex::new(0.0, 0.0); NY];
        Outputs::value_of(&complex_step_columns(&v, NV - 1), &mut y);
        for (rate, y) in rate.iter().zip(y) {
            assert!((rate - y.im / STEP).abs() <= 1e-15);
        }
        assert_eq!(rate, [v[7], 0.0, 0.0, 0.0]);
    }
}

#[test]
fn second_derivatives_by_three_methods() {
    for (v, mu) in points() {
        let own = hessian(&v, &mu);
        let forward = tangent_columns(&v, |v, column| {
            let mut gradient = [Forward { re: 0.0, d: 0.0 }; NV];
            let mu = mu.map(|mu| Forward { re: mu, d: 0.0 });
            Outputs::adjoint_of(&seeded::<f64>(v, column), &mu, &mut gradient);
            gradient.map(|g| g.d)
        });
        assert_close(&own, &forward);
        let complex = tangent_columns(&v, |v, column| {
            let mut gradient = [Complex::new(0.0, 0.0); NV];
            let mu = mu.map(|mu| Complex::new(mu, 0.0));
            Outputs::adjoint_of(&complex_step_columns(v, column), &mu, &mut gradient);
            gradient.map(|g| g.im / STEP)
        });
        assert_close(&own, &complex);
        // Without the emitted adjoint: twice forward through the value.
        for (column, own) in own.iter().enumerate().take(NV - 1).skip(2) {
            let inner: [Forward<f64>; NV] = seeded(&v, column);
            for (row, own) in own.iter().enumerate().take(NV - 1).skip(2) {
                let v: [Forward<Forward<f64>>; NV] = core::array::from_fn(|i| Forward {
                    re: inner[i],
                    d: Forward { re: if i == row { 1.0 } else { 0.0 }, d: 0.0 },
                });
                let mut y = [v[0]; NY];
                Outputs::value_of(&v, &mut y);
                let second: f64 = y.iter().zip(mu).map(|(y, mu)| mu * y.d.d).sum();
                assert!((second - own).abs() <= 1e-13, "{second} is not {own}");
            }
        }
    }
}

#[test]
fn structure_of_functions() {
    let FunctionStructure { name, x, z, u, p, jacobian, blocks, constant, linear, variables, .. } =
        Outputs::STRUCTURE;
    assert_eq!(name, "Outputs");
    assert_eq!([x.len(), z.len(), u.len(), p.len()], [2, 1, 2, 1]);
    assert_eq!(x, ["x[0]", "x[1]"]);
    // x: rows 0, 0, 1, 2; z: rows 0, 3; u: rows 1, 1, 2; p: rows 0, 3.
    assert_eq!(blocks, [0, 0, 4, 6, 9, 11]);
    assert_eq!(jacobian.rows, [0, 0, 1, 2, 0, 3, 1, 1, 2, 0, 3]);
    assert_eq!(jacobian.columns, [2, 3, 2, 3, 4, 4, 5, 6, 5, 7, 7]);
    assert_eq!(linear, [false, false, true, false]);
    assert_eq!(constant.iter().filter(|constant| **constant).count(), 2);
    assert_eq!(variables, [2, 3, 4, 5, 6, 7]);
}

/// Structs, helpers, constants, and a size.
#[function(N = [2, 3])]
mod distance {
    pub struct State<const N: usize> {
        pub position: [f64; N],
        pub speed: f64,
    }
    const WEIGHT: f64 = 0.5;
    fn square(a: f64) -> f64 {
        a * a
    }
    #[model]
    pub fn distance<const N: usize>(x: State<N>) -> f64 {
        WEIGHT * x.position.iter().map(|position| square(*position)).sum::<f64>() + x.speed
    }
}

#[test]
fn modules_and_sizes() {
    let mut y = [0.0];
    Distance::<3>::value::<f64>(&[0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 0.0], &mut y);
    assert_eq!(y, [0.5 * 14.0 + 4.0]);
    Distance::<2>::value::<f64>(&[0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 0.0], &mut y);
    assert_eq!(y, [0.5 * 5.0 + 3.0]);
    assert_eq!(Distance::<2>::STRUCTURE.x, ["x.position[0]", "x.position[1]", "x.speed"]);
}

/// No output is an output too: a problem without constraints.
#[function]
fn nothing(_x: [f64; 2]) -> [f64; 0] {
    []
}

#[test]
fn no_outputs() {
    let mut y = [];
    Nothing::value::<f64>(&[0.0; 5], &mut y);
    assert!(Nothing::STRUCTURE.jacobian.is_empty());
}
