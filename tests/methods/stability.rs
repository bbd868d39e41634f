//! The discrete stability function `R(z)`, through the integrators: `x₊ = R(λh) x` on `ẋ = λ x`.

use crate::{explicit, system};
use casados::{
    Butcher6, DormandPrince5, DormandPrince8, Erk, Euler, Gauss, Heun, Irk, Method, Midpoint, Options,
    RadauIIA, Rk4, Tableau,
};
use nalgebra::{Complex, SVector, vector};
use serde_json::Value;

system! {
    /// `ẋ = λ x` with a real `λ = p`.
    Real [1, 0, 0, 1] S |v, f| {
        f[0] = v[0] - v[2] * v[1];
    }
}
explicit!(Real: 0);

system! {
    /// `ẋ = λ x` in the complex plane, `λ = p₀ + i p₁`.
    Plane [2, 0, 0, 2] S |v, f| {
        let [re, im, a, b] = [v[2], v[3], v[4], v[5]];
        (f[0], f[1]) = (v[0] - (a * re - b * im), v[1] - (b * re + a * im));
    }
}
explicit!(Plane: 0 1);

/// `R(z)` of one step of length one, by an integrator of both systems.
macro_rules! stability {
    ($integrator:ident, $method:ty, $z:expr) => {{
        let (z, none) = ($z, SVector::zeros());
        if z.im == 0.0 {
            let mut integrator = $integrator::<Real, $method>::new(Options::default()).unwrap();
            integrator.set_parameters(&vector![z.re]).unwrap();
            let x = integrator.solve(&vector![1.0], &none, 1.0).unwrap_or_else(|e| panic!("z = {z}: {e}")).x;
            Complex::<f64>::new(x[0], 0.0)
        } else {
            let mut integrator = $integrator::<Plane, $method>::new(Options::default()).unwrap();
            integrator.set_parameters(&vector![z.re, z.im]).unwrap();
            let x =
                integrator.solve(&vector![1.0, 0.0], &none, 1.0).unwrap_or_else(|e| panic!("z = {z}: {e}")).x;
            Complex::<f64>::new(x[0], x[1])
        }
    }};
}

/// `(z, R(z))` of the exact Padé approximants.
fn reference(family: &str, s: usize) -> Vec<(Complex<f64>, Complex<f64>)> {
    let data: Value = serde_json::from_str(include_str!("../data/stability.json")).unwrap();
    let rows = data[family][s.to_string()].as_array().unwrap();
    let number = |row: &Value, i: usize| row[i].as_f64().unwrap();
    let rows: Vec<_> = rows
        .iter()
        .map(|row| {
            (
                Complex::<f64>::new(number(row, 0), number(row, 1)),
                Complex::<f64>::new(number(row, 2), number(row, 3)),
            )
        })
        .collect();
    assert!(rows.len() > 20);
    rows
}

macro_rules! for_stages {
    ($check:ident $method:ident: $($s:literal)*) => { $($check!($method, $s);)* };
}

#[test]
fn t03_stability_function_of_gauss() {
    macro_rules! check {
        ($method:ident, $s:literal) => {
            for (z, exact) in reference("gauss", $s) {
                let r = stability!(Irk, $method<$s>, z);
                let error = (r - exact).norm();
                assert!(error <= 1e-13 * (1.0 + exact.norm()), "s = {}, z = {z}: {r} {exact} {error:e}", $s);
                // On the imaginary axis no growth and no damping.
                if z.re == 0.0 {
                    let growth = (r.norm() - 1.0).abs();
                    assert!(growth <= 1e-14, "s = {}, z = {z}: |R| − 1 = {growth:e}", $s);
                }
            }
        };
    }
    for_stages!(check Gauss: 1 2 3 4 5 6 7 8 9);
}

#[test]
fn t03_stability_function_of_radau() {
    macro_rules! check {
        ($method:ident, $s:literal) => {
            for (z, exact) in reference("radauIIA", $s) {
                let r = stability!(Irk, $method<$s>, z);
                let error = (r - exact).norm();
                assert!(error <= 1e-13 * (1.0 + exact.norm()), "s = {}, z = {z}: {r} {exact} {error:e}", $s);
                if z.re == -1e12 {
                    assert!(r.norm() <= if $s == 1 { 1e-12 } else { 1e-11 }, "s = {}: {r}", $s);
                }
            }
        };
    }
    for_stages!(check RadauIIA: 1 2 3 4 5 6 7 8 9);
}

/// `R(z) = 1 + Σ_k z^k bᵀA^{k−1}1`, with the sum of the absolute values of all terms.
fn polynomial<const S: usize>(tableau: &Tableau<S>, z: Complex<f64>) -> (Complex<f64>, f64) {
    let (mut vector, mut sum, mut scale, mut power) = ([1.0; S], Complex::<f64>::new(1.0, 0.0), 1.0, z);
    let mut absolute = [1.0; S];
    for _ in 0..S {
        let dot = |x: &[f64; S], y: &[f64; S]| (0..S).map(|i| x[i] * y[i]).sum::<f64>();
        sum += power * dot(tableau.b(), &vector);
        scale += power.norm() * dot(&tableau.b().map(f64::abs), &absolute);
        vector = tableau.a().map(|row| dot(&row, &vector));
        absolute = tableau.a().map(|row| dot(&row.map(f64::abs), &absolute));
        power *= z;
    }
    (sum, scale)
}

#[test]
fn stability_functions_of_explicit_methods() {
    macro_rules! check {
        ($($method:ident)*) => {$(
            let tableau = <$method as Method<_>>::TABLEAU;
            for (re, im) in [(-1e12, 0.0), (-2.0, 0.0), (-0.5, 0.0), (-1e-12, 0.0), (0.7, 0.0), (0.0, 1.5), (-1.0, 2.0)] {
                let z = Complex::<f64>::new(re, im);
                let r = stability!(Erk, $method, z);
                let (exact, scale) = polynomial(&tableau, z);
                // Each term has S sums and products of at most S factors.
                let s = tableau.c().len() as f64;
                let error = (r - exact).norm();
                assert!(error <= 4.0 * s * f64::EPSILON * scale, "{} z = {z}: {r} {exact} {error:e}", tableau.name());
            }
            // The first terms of the exponential function, as many as the order says.
            let z = Complex::<f64>::new(-0.01, 0.0);
            let remainder = (stability!(Erk, $method, z).re - f64::exp(-0.01)).abs();
            let next = (1..=tableau.order() + 1).fold(1.0, |term, k| term * 0.01 / k as f64);
            assert!(remainder <= next + 4.0 * f64::EPSILON, "{}: {remainder:e}", tableau.name());
        )*};
    }
    check!(Euler Midpoint Heun Rk4 DormandPrince5 Butcher6 DormandPrince8);
}
