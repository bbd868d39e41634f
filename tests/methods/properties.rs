//! Random differential-algebraic equations with known solutions.

use casados::{Gauss, Irk, Options, RadauIIA, dae, ode};
use nalgebra::{SMatrix, SVector};
use proptest::prelude::*;

/// Numbers between −1 and 1.
fn numbers(count: usize) -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(-1.0f64..1.0, count)
}

/// Linear systems `ẋ = A x` whose elements are parameters, row by row: `x = e^{Ah} x₀` and
/// `dx/dx₀ = e^{Ah}`.
macro_rules! linear_systems {
    ($($name:ident $model:ident $test:ident $n:literal $nn:literal;)*) => {$(
        #[ode]
        fn $name(x: [f64; $n], p: [f64; $nn]) -> [f64; $n] {
            let mut rates = [0.0; $n];
            for i in 0..$n {
                for j in 0..$n {
                    rates[i] += p[$n * i + j] * x[j];
                }
            }
            rates
        }
        proptest! {
            #![proptest_config(ProptestConfig { cases: 16, failure_persistence: None, ..Default::default() })]
            #[test]
            fn $test(p in numbers($nn), x0 in numbers($n), h in 0.1f64..2.0) {
                let (a, x0) = (SMatrix::<f64, $n, $n>::from_row_slice(&p), SVector::<f64, $n>::from_column_slice(&x0));
                let exact = (a * h).exp();
                let norm = a.abs().row_sum().amax() * h;
                // |A|h ≤ 8: eight steps have |A|h/8 ≤ 1, and the error of order 12 or 13 is below
                // ε. Roundings of the stages and of Padé's approximant in `exp`, a hundred,
                // grow as e^{|A|h}.
                let bound = 100.0 * f64::EPSILON * norm.exp();
                for method in 0..2 {
                    let options = Options { steps: 8, ..Default::default() };
                    let (p, none) = (SVector::from_column_slice(&p), SVector::zeros());
                    let (x, s) = if method == 0 {
                        let mut irk = Irk::<$model, Gauss<6>>::new(options).expect("valid");
                        irk.set_parameters(&p).expect("finite");
                        let step = irk.forward(&x0, &none, h).expect("a solution");
                        (step.x, step.dx_dx0)
                    } else {
                        let mut irk = Irk::<$model, RadauIIA<7>>::new(options).expect("valid");
                        irk.set_parameters(&p).expect("finite");
                        let step = irk.forward(&x0, &none, h).expect("a solution");
                        (step.x, step.dx_dx0)
                    };
                    prop_assert!((s - exact).amax() <= bound, "{:e} of {bound:e}", (s - exact).amax());
                    prop_assert!((x - exact * x0).amax() <= bound, "{:e} of {bound:e}", (x - exact * x0).amax());
                }
            }
        }
    )*};
}
linear_systems! {
    linear_one LinearOne linear_systems_of_one 1 1;
    linear_two LinearTwo linear_systems_of_two 2 4;
    linear_three LinearThree linear_systems_of_three 3 9;
    linear_four LinearFour linear_systems_of_four 4 16;
}

/// Fully implicit equations that the functions `x_i = a_i + b_i sin(ω_i t)`, `z = c cos(t) + a₀`
/// solve, whatever the matrices that couple them: p = (a, b, ω, c, couplings).
macro_rules! manufactured {
    ($($name:ident $model:ident $test:ident $n:literal $np:literal $equations:literal;)*) => {$(
        #[dae]
        fn $name(xdot: [f64; $n], x: [f64; $n], z: f64, p: [f64; $np], t: f64) -> [f64; $equations] {
            let (mut f, mut error) = ([0.0; $equations], [0.0; $n]);
            let z_error = z - (p[0] + p[3 * $n] * t.cos());
            for i in 0..$n {
                error[i] = x[i] - (p[i] + p[$n + i] * (p[2 * $n + i] * t).sin());
            }
            for i in 0..$n {
                let rate = xdot[i] - p[$n + i] * p[2 * $n + i] * (p[2 * $n + i] * t).cos();
                // A matrix of ẋ that depends on the state, couplings of all states, and of the
                // algebraic one.
                f[i] = (1.5 + 0.4 * x[i].sin()) * rate + p[3 * $n + 1] * z_error;
                for j in 0..$n {
                    f[i] += p[3 * $n + 2 + $n * i + j] * (error[j] + 0.3 * error[j] * error[j]);
                }
                f[$n] += error[i] * (1.0 + x[i] * z);
            }
            f[$n] += z_error * (2.0 + z * z);
            f
        }
        proptest! {
            #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..Default::default() })]
            #[test]
            fn $test(p in numbers($np), h in 0.1f64..1.0) {
                let solution = |t: f64| SVector::<f64, $n>::from_fn(|i, _| p[i] + p[$n + i] * (p[2 * $n + i] * t).sin());
                let algebraic = |t: f64| p[0] + p[3 * $n] * t.cos();
                let along = |t: f64, i: usize, block: usize| match block {
                    0 => 1.0,
                    1 => (p[2 * $n + i] * t).sin(),
                    _ => p[$n + i] * t * (p[2 * $n + i] * t).cos(),
                };
                let run = |steps: usize| {
                    let options = Options { steps, start: casados::options::Start::Given, ..Default::default() };
                    let mut irk = Irk::<$model, RadauIIA<4>>::new(options).expect("valid");
                    irk.set_parameters(&SVector::from_column_slice(&p)).expect("finite");
                    irk.set_start(&SVector::zeros(), &SVector::from([algebraic(0.0)])).expect("finite");
                    *irk.forward(&solution(0.0), &SVector::zeros(), h).expect("a solution")
                };
                let (coarse, fine) = (run(4), run(8));
                // The difference of two step numbers is the error of the longer steps, more than a
                // hundred times that of the shorter ones; and eight steps of twenty roundings,
                // which errors of the size of e^{3h n} propagate.
                let rounding = 160.0 * f64::EPSILON * (3.0 * h * $n as f64).exp();
                let error = (fine.x - solution(h)).amax();
                prop_assert!(error <= (fine.x - coarse.x).amax() + rounding, "{error:e}");
                let error = (fine.z[0] - algebraic(h)).abs();
                prop_assert!(error <= (fine.z - coarse.z).amax() + 10.0 * rounding, "{error:e} of z");
                // The solution knows nothing of the couplings: its derivatives by them are zero. By
                // the numbers that it is made of, start value included, they are known.
                for coupling in 3 * $n + 1..$np {
                    let error = fine.dx_dp.column(coupling).amax();
                    let tolerance = (fine.dx_dp - coarse.dx_dp).amax() + 10.0 * rounding;
                    prop_assert!(error <= tolerance, "coupling {coupling}: {error:e} of {tolerance:e}");
                }
                for block in 0..3 {
                    for i in 0..$n {
                        let column = fine.dx_dp.column(block * $n + i) + fine.dx_dx0.column(i) * along(0.0, i, block);
                        let mut expected = SVector::<f64, $n>::zeros();
                        expected[i] = along(h, i, block);
                        let error = (column - expected).amax();
                        let tolerance = (fine.dx_dp - coarse.dx_dp).amax()
                            + (fine.dx_dx0 - coarse.dx_dx0).amax()
                            + 10.0 * rounding;
                        prop_assert!(error <= tolerance, "{block}, {i}: {error:e} of {tolerance:e}");
                    }
                }
            }
        }
    )*};
}
manufactured! {
    manufactured_one ManufacturedOne manufactured_solutions_of_one 1 6 2;
    manufactured_two ManufacturedTwo manufactured_solutions_of_two 2 12 3;
    manufactured_three ManufacturedThree manufactured_solutions_of_three 3 20 4;
}
