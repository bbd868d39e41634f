//! Problems with closed-form solutions: end state, first and second derivatives by all variables,
//! integrated until only rounding is left.
//!
//! `tests/data/analytic/analytic.json` holds the closed forms evaluated to 32 digits at 130 digits
//! of working precision. Tolerances come from `check_exact`: the difference between two numbers of
//! steps bounds the discretisation error, samples of the rounding error stand for condition times
//! epsilon. `limit` in each test is what the tolerance itself may be at most, relative to the
//! largest entry, so that no test passes by being unable to tell.

use casados::options::Start;
use casados::testing::{Exact, Report, check_exact};
use casados::{Dae, DormandPrince8, Erk, Gauss, Heap, Integrator, Irk, Options, RadauIIA, dae, ode};
use nalgebra::SVector;
use serde_json::Value;

/// `ẋ = λx + u` (Dahlquist)
#[ode]
fn dahlquist(x: [f64; 1], u: [f64; 1], p: [f64; 1]) -> [f64; 1] {
    let [lambda] = p;
    [lambda * x[0] + u[0]]
}

/// `ẋ = λ(x − sin t) + cos t + u` (Prothero and Robinson)
#[ode]
fn prothero_robinson(x: [f64; 1], u: [f64; 1], p: [f64; 1], t: f64) -> [f64; 1] {
    let [lambda] = p;
    [lambda * (x[0] - t.sin()) + t.cos() + u[0]]
}

/// Growth with a limit `K`.
#[ode]
fn logistic(x: [f64; 1], u: [f64; 1], p: [f64; 1]) -> [f64; 1] {
    let [limit] = p;
    [u[0] * x[0] * (1.0 - x[0] / limit)]
}

/// The tangent: it has a pole at `t = π/2` for `u = 1`, `x₀ = 0`.
#[ode]
fn riccati(x: [f64; 1], u: [f64; 1]) -> [f64; 1] {
    [1.0 + u[0] * x[0].powi(2)]
}

#[ode]
fn bernoulli(x: [f64; 1], u: [f64; 1], p: [f64; 1]) -> [f64; 1] {
    [p[0] * x[0] + u[0] * x[0].powi(3)]
}

#[ode]
fn oscillator(x: [f64; 2], u: [f64; 1], p: [f64; 2]) -> [f64; 2] {
    let [position, velocity] = x;
    let [omega, zeta] = p;
    [velocity, -omega * omega * position - 2.0 * zeta * omega * velocity + u[0]]
}

/// A Jordan block.
#[ode]
fn jordan(x: [f64; 4], p: [f64; 1]) -> [f64; 4] {
    core::array::from_fn(|i| if i < 3 { p[0] * x[i] + x[i + 1] } else { p[0] * x[i] })
}

/// Two bodies, in the plane.
#[ode]
fn kepler(x: [f64; 4]) -> [f64; 4] {
    let [x, y, vx, vy] = x;
    let r3 = x.hypot(y).powi(3);
    [vx, vy, -x / r3, -y / r3]
}

/// `ẋ = Ax + Bz + Eu`, `0 = Cx + Dz + Fu`
#[dae]
fn linear(xdot: [f64; 2], x: [f64; 2], z: [f64; 2], u: [f64; 1]) -> [f64; 4] {
    const A: [[f64; 2]; 2] = [[-1.0, 0.5], [0.2, -3.0]];
    const B: [[f64; 2]; 2] = [[1.0, 0.0], [0.3, -1.0]];
    const E: [f64; 2] = [0.1, 1.0];
    const C: [[f64; 2]; 2] = [[1.0, 2.0], [0.0, 1.0]];
    const D: [[f64; 2]; 2] = [[4.0, 1.0], [1.0, 2.0]];
    const F: [f64; 2] = [-1.0, 0.5];
    let product = |m: [[f64; 2]; 2], v: [f64; 2], i: usize| m[i][0] * v[0] + m[i][1] * v[1];
    let mut residual = [0.0; 4];
    for i in 0..2 {
        residual[i] = xdot[i] - (product(A, x, i) + product(B, z, i) + E[i] * u[0]);
        residual[2 + i] = product(C, x, i) + product(D, z, i) + F[i] * u[0];
    }
    residual
}

#[dae]
fn cubic(xdot: [f64; 1], x: [f64; 1], z: [f64; 1], u: [f64; 1]) -> [f64; 2] {
    [xdot[0] + x[0] * z[0], z[0] - u[0] * x[0] * x[0]]
}

#[dae]
fn state_dependent_mass(xdot: [f64; 1], x: [f64; 1], u: [f64; 1]) -> [f64; 1] {
    [(1.0 + x[0] * x[0]) * xdot[0] + u[0] * x[0]]
}

/// Two branches: the start value of `ẋ` chooses.
#[dae]
fn square(xdot: [f64; 1], x: [f64; 1], u: [f64; 1]) -> [f64; 1] {
    [xdot[0] * xdot[0] - u[0] * u[0] * x[0] * x[0]]
}

/// The problem of Kaps: the solution is the same for every `ε`, the stiffness is `1/ε`.
#[ode]
fn kaps(x: [f64; 2], p: [f64; 1]) -> [f64; 2] {
    let [y1, y2] = x;
    let [epsilon] = p;
    [-(1.0 / epsilon + 2.0) * y1 + y2 * y2 / epsilon, y1 - y2 - y2 * y2]
}

/// A problem of the collection.
struct Problem {
    point: Vec<f64>,
    h: f64,
    exact: Exact,
}

fn problem(name: &str) -> Problem {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/data/analytic/analytic.json");
    let text = std::fs::read_to_string(path).expect("the collection is there");
    let all: Value = serde_json::from_str(&text).expect("the collection is JSON");
    let all = all.as_array().expect("the collection is a list");
    let found = all.iter().find(|entry| entry["name"] == name).expect("the problem is in the collection");
    let number = |value: &Value| -> f64 {
        value.as_str().expect("numbers are strings").parse().expect("a decimal number")
    };
    let list =
        |value: &Value| -> Vec<f64> { value.as_array().map_or(vec![], |a| a.iter().map(number).collect()) };
    let rows = |value: &Value| -> Vec<Vec<f64>> {
        value.as_array().map_or(vec![], |a| a.iter().map(list).collect())
    };
    let matrices = found["hessian"].as_array().map_or(vec![], |a| a.iter().map(rows).collect());
    Problem {
        point: list(&found["point"]),
        h: number(&found["T"]),
        exact: Exact { states: list(&found["x_T"]), first: rows(&found["gradient"]), second: matrices },
    }
}

/// Passes, with tolerances that can tell.
fn assert_report(report: Report, limit: f64) {
    println!("{report}");
    report.assert();
    for row in &report.rows {
        assert!(row.tolerance <= limit * row.scale.max(1e-300), "the tolerance is above {limit:e}\n{report}");
    }
}

/// Integrates a problem with two numbers of steps and compares. The point is `(x₀, u, p)`.
macro_rules! check {
    ($integrator:ident::<$model:ty, $method:ty>, $name:expr, $steps:expr, $limit:expr) => {{
        let problem = problem($name);
        let at = |steps| {
            $integrator::<$model, $method>::new(Options { steps, ..Default::default() })
                .expect("options are valid")
        };
        run::<$model, _, _, _, _>(at($steps / 2), at($steps), &problem, $limit);
    }};
}

fn run<M, I, const NX: usize, const NU: usize, const NP: usize>(
    mut coarse: I,
    mut fine: I,
    problem: &Problem,
    limit: f64,
) where
    M: Dae,
    M::Shape: casados::Shape<
            VectorX<f64> = SVector<f64, NX>,
            VectorU<f64> = SVector<f64, NU>,
            VectorP<f64> = SVector<f64, NP>,
        >,
    I: Integrator<Model = M, Number = f64, Memory = Heap>,
{
    let (x0, rest) = problem.point.split_at(NX);
    let (u, p) = rest.split_at(NU);
    let report = check_exact::<M, I>(
        &mut coarse,
        &mut fine,
        &SVector::from_column_slice(x0),
        &SVector::from_column_slice(u),
        &SVector::from_column_slice(p),
        problem.h,
        &problem.exact,
    );
    assert_report(report.expect("the problem can be solved"), limit);
}

// Not stiff: implicit methods of high order and an explicit one.

#[test]
fn dahlquist_mild() {
    check!(Irk::<Dahlquist, Gauss<5>>, "dahlquist_lambda-1", 8, 1e-12);
    check!(Irk::<Dahlquist, RadauIIA<5>>, "dahlquist_lambda-10", 64, 1e-11);
    check!(Erk::<Dahlquist, DormandPrince8>, "dahlquist_lambda-1", 32, 1e-12);
    check!(Erk::<Dahlquist, DormandPrince8>, "dahlquist_lambda-10", 256, 1e-11);
}

#[test]
fn logistic_growth() {
    check!(Irk::<Logistic, Gauss<5>>, "logistic", 16, 1e-12);
    check!(Erk::<Logistic, DormandPrince8>, "logistic", 64, 1e-11);
}

#[test]
fn riccati_tangent() {
    check!(Irk::<Riccati, Gauss<6>>, "riccati_tan_blowup", 32, 1e-11);
    check!(Erk::<Riccati, DormandPrince8>, "riccati_tan_blowup", 128, 1e-11);
}

#[test]
fn bernoulli_cubic() {
    check!(Irk::<Bernoulli, Gauss<5>>, "bernoulli_cubic", 16, 1e-12);
    check!(Erk::<Bernoulli, DormandPrince8>, "bernoulli_cubic", 64, 1e-12);
}

#[test]
fn oscillators() {
    check!(Irk::<Oscillator, Gauss<6>>, "oscillator_undamped", 32, 1e-11);
    check!(Irk::<Oscillator, Gauss<6>>, "oscillator_underdamped", 64, 1e-11);
    check!(Erk::<Oscillator, DormandPrince8>, "oscillator_undamped", 128, 1e-11);
    check!(Erk::<Oscillator, DormandPrince8>, "oscillator_underdamped", 256, 1e-11);
}

/// Orbits: the far end of an eccentric one amplifies errors by the norm of the state transition
/// matrix, 100, its square in second derivatives.
#[test]
fn kepler_orbits() {
    check!(Irk::<Kepler, Gauss<6>>, "kepler_e0.0", 64, 1e-11);
    check!(Irk::<Kepler, Gauss<6>>, "kepler_e0.6", 256, 1e-9);
    check!(Erk::<Kepler, DormandPrince8>, "kepler_e0.0", 256, 1e-11);
}

// A nilpotent Jordan block: its solution is a polynomial of degree three.
#[test]
fn jordan_blocks() {
    check!(Irk::<Jordan, Gauss<2>>, "jordan4_nilpotent", 2, 1e-2);
    check!(Irk::<Jordan, Gauss<5>>, "jordan4_nilpotent", 8, 1e-12);
    check!(Irk::<Jordan, Gauss<5>>, "jordan4_defective_-1", 8, 1e-12);
    check!(Irk::<Jordan, RadauIIA<5>>, "jordan4_defective_-1e3", 64, 1e-10);
    check!(Erk::<Jordan, DormandPrince8>, "jordan4_defective_-1", 32, 1e-12);
}

// Stiff: Radau IIA.

#[test]
fn dahlquist_stiff() {
    check!(Irk::<Dahlquist, RadauIIA<5>>, "dahlquist_lambda-1000", 64, 1e-12);
    check!(Irk::<Dahlquist, RadauIIA<5>>, "dahlquist_lambda-1000000", 64, 1e-11);
    check!(Irk::<Dahlquist, RadauIIA<5>>, "dahlquist_lambda-100000000", 64, 1e-11);
}

#[test]
fn prothero_robinson_stiff() {
    check!(Irk::<ProtheroRobinson, RadauIIA<5>>, "prothero_robinson_lambda-1e1", 32, 1e-11);
    check!(Irk::<ProtheroRobinson, RadauIIA<5>>, "prothero_robinson_lambda-1e4", 32, 1e-11);
    check!(Irk::<ProtheroRobinson, RadauIIA<5>>, "prothero_robinson_lambda-1e8", 32, 1e-11);
}

#[test]
fn oscillator_overdamped() {
    check!(Irk::<Oscillator, RadauIIA<5>>, "oscillator_overdamped_stiff", 128, 1e-10);
}

/// No derivatives are known in closed form, but the solution is, whatever the stiffness.
#[test]
fn kaps_every_stiffness() {
    for (name, epsilon) in [("kaps_eps1e-2", 1e-2), ("kaps_eps1e-6", 1e-6), ("kaps_eps1e-12", 1e-12)] {
        let problem = Problem { point: vec![1.0, 1.0, epsilon], ..problem(name) };
        let at = |steps| {
            Irk::<Kaps, RadauIIA<5>>::new(Options { steps, ..Default::default() }).expect("options are valid")
        };
        run::<Kaps, _, _, _, _>(at(16), at(32), &problem, 1e-10);
    }
}

// Differential-algebraic and implicit.

#[test]
fn linear_dae() {
    // The algebraic states at the end are those of the collocation polynomial: of order s with
    // Gauss.
    check!(Irk::<Linear, Gauss<8>>, "linear_dae_index1", 32, 1e-11);
    check!(Irk::<Linear, RadauIIA<5>>, "linear_dae_index1", 32, 1e-11);
}

#[test]
fn cubic_dae() {
    check!(Irk::<Cubic, Gauss<8>>, "nonlinear_dae_cubic", 32, 1e-11);
    check!(Irk::<Cubic, RadauIIA<5>>, "nonlinear_dae_cubic", 32, 1e-11);
}

#[test]
fn implicit_mass() {
    check!(Irk::<StateDependentMass, Gauss<5>>, "state_dependent_mass", 32, 1e-11);
}

/// The start value of `ẋ` selects the branch `ẋ < 0`.
#[test]
fn implicit_branch() {
    let problem = problem("fully_implicit_square");
    let at = |steps| {
        let mut irk =
            Irk::<Square, Gauss<5>>::new(Options { steps, start: Start::Given, ..Default::default() })
                .expect("options are valid");
        irk.set_start(&SVector::from([-1.0]), &SVector::zeros()).expect("a finite start");
        irk
    };
    run::<Square, _, _, _, _>(at(16), at(32), &problem, 1e-11);
}

/// Beyond the pole there is no solution, and none is reported.
#[test]
fn riccati_behind_the_pole() {
    let mut irk = Irk::<Riccati, Gauss<6>>::new(Options { steps: 64, ..Default::default() })
        .expect("options are valid");
    let result = irk.solve(&SVector::from([0.0]), &SVector::from([1.0]), 1.6);
    assert!(result.is_err(), "{:?}", result.map(|step| step.x));
}

/// No problem of the collection is left out.
#[test]
fn coverage_of_the_collection() {
    let text = include_str!("../data/analytic/analytic.json");
    let all: Value = serde_json::from_str(text).expect("the collection is JSON");
    let here = include_str!("analytic.rs");
    for entry in all.as_array().expect("the collection is a list") {
        let name = entry["name"].as_str().expect("a name");
        assert!(here.contains(&format!("\"{name}\"")), "{name} is not checked");
    }
}
