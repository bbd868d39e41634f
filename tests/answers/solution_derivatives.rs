//! Adjoint derivatives of solutions, and derivatives of optimal values: against closed forms, and
//! central differences of problems that are solved again.

use crate::Test;
use crate::mass::{Both, Push};
use casados::ocp::{
    Constraint, Convexification, Exact, Formulation, GaussNewton, GeneralCost, HeapIpm, HeapOcp, HeapSqp,
    Horizon, LeastSquaresCost, Map, Problem, SecondOrder, Shooting, SolutionFactors, WithIntegral,
};
use casados::prelude::*;
use casados::qp::HeapSolution;
use casados::{LeastSquares, Quadrature};
use nalgebra::{Matrix2, Matrix2x1, Matrix3, Vector2, matrix};

pub const EXACT: Exact = Exact { convexification: Convexification::None };

/// A solution, its value, and what `SolutionFactors` says of it, by `(x₀, p)`.
pub struct SolutionDerivatives {
    value: f64,
    /// All states and controls.
    w: Vec<f64>,
    /// Which multipliers have a force.
    active: Vec<bool>,
    gradient: Vec<f64>,
    /// Row after row.
    hessian: Vec<Vec<f64>>,
    /// `λᵀ dw` for the seeds of [`seed`].
    adjoints: Vec<Vec<f64>>,
}

const SEEDS: usize = 3;

/// Elements of seeds, none of which is like another.
fn seed_entry(which: usize, element: usize) -> f64 {
    (1.3 * which as f64 + 0.7 * element as f64 + 0.2).sin()
}

/// Who solves.
#[derive(Clone, Copy)]
pub enum By {
    Sqp,
    /// The barrier problem with this parameter.
    Barrier(f64),
}

pub fn solved<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
    mut ocp: HeapOcp<P>,
    by: By,
) -> Result<SolutionDerivatives, Box<dyn std::error::Error>> {
    let mut factors = SolutionFactors::new(&ocp)?;
    let value = match by {
        By::Sqp => {
            let mut sqp = HeapSqp::new(&ocp)?;
            (sqp.options.tolerance, sqp.options.max_iterations) = (1e-10, 100);
            sqp.qp_solver.options.tolerance = 1e-12;
            let outcome = sqp.solve(&mut ocp)?;
            assert!(outcome.is_converged(), "{}{outcome}", sqp.log());
            outcome.objective
        }
        By::Barrier(mu) => {
            let mut ipm = HeapIpm::new(&ocp)?;
            (ipm.options.tolerance, ipm.options.final_mu) = (1e-11, mu);
            let outcome = ipm.solve(&mut ocp)?;
            assert!(outcome.is_converged(), "{}{outcome}", ipm.log());
            factors.smoothing = mu;
            // The value is that of the barrier problem, which the test of one bound has.
            f64::NAN
        }
    };
    ocp.factorise(EXACT, &mut factors)?;
    assert_eq!(factors.weakly_active(), 0);
    let gradient = [factors.value_gradient_x0(), factors.value_gradient_p()].concat();
    let (nx, np) = (factors.value_gradient_x0().len(), factors.value_gradient_p().len());
    let parts = factors.value_hessian();
    let element = |i: usize, j: usize| match (i < nx, j < nx) {
        (true, true) => parts.xx[j * nx + i],
        (true, false) => parts.xp[(j - nx) * nx + i],
        (false, true) => parts.xp[(i - nx) * nx + j],
        (false, false) => parts.pp[(j - nx) * np + i - nx],
    };
    let hessian = (0..nx + np).map(|i| (0..nx + np).map(|j| element(i, j)).collect()).collect();
    let mut adjoints = Vec::new();
    let mut lambda = HeapSolution::new(ocp.qp().dims())?;
    for which in 0..SEEDS {
        let mut element = 0;
        for k in 0..=ocp.intervals() {
            let stage = lambda.stage_mut(k).ok_or("no stage")?;
            for value in stage.x.iter_mut().chain(stage.u) {
                *value = seed_entry(which, element);
                element += 1;
            }
        }
        let adjoint = factors.adjoint(&lambda)?;
        adjoints.push([adjoint.x0, adjoint.p].concat());
    }
    let w = ocp.iterate().stages().flat_map(|stage| [stage.x, stage.u].concat()).collect();
    let active =
        ocp.iterate().stages().skip(1).flat_map(|s| [s.x_upper, s.u_lower, s.u_upper, s.g_upper].concat());
    let active = active.map(|multiplier| multiplier > 1e-4).collect();
    Ok(SolutionDerivatives { value, w, active, gradient, hessian, adjoints })
}

/// Central differences of order six.
fn difference(
    step: f64,
    f: impl Fn(f64) -> SolutionDerivatives,
    of: impl Fn(&SolutionDerivatives) -> Vec<f64>,
) -> Vec<f64> {
    let mut sum = Vec::new();
    for (distance, weight) in [(1.0, 45.0), (2.0, -9.0), (3.0, 1.0)] {
        let (plus, minus) = (of(&f(distance * step)), of(&f(-distance * step)));
        sum.resize(plus.len(), 0.0);
        for (sum, (plus, minus)) in sum.iter_mut().zip(plus.iter().zip(&minus)) {
            *sum += weight * (plus - minus) / (60.0 * step);
        }
    }
    sum
}

/// Value, gradient, Hessian and adjoints against differences of problems with other `(x₀, p)`.
pub fn check_by_differences(
    at: &[f64],
    by: By,
    solve: impl Fn(&[f64]) -> Result<SolutionDerivatives, Box<dyn std::error::Error>>,
    tolerance: f64,
) -> Test {
    let here = solve(at)?;
    for i in 0..at.len() {
        let moved = |distance: f64| {
            let mut at = at.to_vec();
            at[i] += distance;
            let there = solve(&at).expect("problems nearby have solutions");
            // Where the active set changes, so do derivatives.
            assert!(matches!(by, By::Barrier(_)) || there.active == here.active);
            there
        };
        let all = difference(STEP, moved, |s| [&[s.value], &s.gradient[..], &s.w].concat());
        let (value, rest) = all.split_at(1);
        let (gradient, w) = rest.split_at(at.len());
        if matches!(by, By::Sqp) {
            assert!((value[0] - here.gradient[i]).abs() < tolerance, "V {i} {value:?} {:?}", here.gradient);
        }
        for (j, slope) in gradient.iter().enumerate() {
            let error = (slope - here.hessian[i][j]).abs();
            assert!(error < tolerance * (1.0 + slope.abs()), "{i} {j} {slope} {}", here.hessian[i][j]);
        }
        for (which, adjoint) in here.adjoints.iter().enumerate() {
            let product: f64 = w.iter().enumerate().map(|(k, w)| seed_entry(which, k) * w).sum();
            let error = (product - adjoint[i]).abs();
            assert!(error < tolerance * (1.0 + product.abs()), "λ {which} {i} {product} {}", adjoint[i]);
        }
    }
    Ok(())
}

/// The linear-quadratic regulator: `V = ½ x₀ᵀ P x₀` by Riccati's recursion, and the closed loop.
#[test]
fn value_function_of_a_regulator() -> Test {
    let (a, b) = (Matrix2::new(1.0, 0.1, 0.0, 1.0), Matrix2x1::new(0.005, 0.1));
    let weights = matrix![2.0, 0.3, 0.1; 0.3, 1.0, 0.2; 0.1, 0.2, 0.5];
    let (q, s) =
        (weights.fixed_view::<2, 2>(0, 0).into_owned(), weights.fixed_view::<1, 2>(2, 0).into_owned());
    const N: usize = 25;
    let mut p = Matrix2::zeros();
    let mut gains = vec![];
    for _ in 0..N {
        let r = weights[(2, 2)] + (b.transpose() * p * b)[0];
        let gain = -(s + b.transpose() * p * a) / r;
        p = q + a.transpose() * p * a + (s + b.transpose() * p * a).transpose() * gain;
        gains.push(gain);
    }
    let mut ocp = Problem::new(Map::<Push, f64>::new())
        .stage_cost(LeastSquaresCost::<Both>::new(&weights))
        .on(Horizon::uniform(N, 0.1))?;
    let x0 = Vector2::new(1.0, -0.5);
    ocp.fix_initial_state(x0.as_slice())?.guess(&[0.0; 2], &[0.0])?;
    assert!(HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?.is_converged());
    let mut factors = SolutionFactors::new(&ocp)?;
    ocp.factorise(GaussNewton::default(), &mut factors)?;
    // Twenty-five products of matrices of size three: some hundred roundings.
    let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
    assert!(close(factors.value_hessian().xx, p.as_slice()));
    assert!(close(factors.value_gradient_x0(), (p * x0).as_slice()));
    let mut lambda = HeapSolution::new(ocp.qp().dims())?;
    let (mut closed, mut expected) = (Matrix2::identity(), Vector2::zeros());
    for k in 0..=N {
        let stage = lambda.stage_mut(k).ok_or("no stage")?;
        let (of_x, of_u) = (Vector2::new(seed_entry(0, k), seed_entry(1, k)), seed_entry(2, k));
        stage.x.copy_from_slice(of_x.as_slice());
        expected += closed.transpose() * of_x;
        if k < N {
            let gain = gains[N - 1 - k];
            stage.u[0] = of_u;
            expected += (gain * closed).transpose() * of_u;
            closed = (a + b * gain) * closed;
        }
    }
    assert!(close(factors.adjoint(&lambda)?.x0, expected.as_slice()));
    Ok(())
}

/// A pendulum whose length and a weight are parameters.
#[ode]
pub fn pendulum(x: [f64; 2], u: [f64; 1], p: [f64; 2]) -> [f64; 2] {
    [x[1], -p[0] * x[0].sin() + u[0] * x[0].cos()]
}
#[function]
pub fn tracking(x: [f64; 2], u: [f64; 1], p: [f64; 2]) -> [f64; 3] {
    [x[0] - 0.4 * p[0], 0.3 * p[1] * x[1] * x[1], 0.2 * p[1] * p[0] * u[0] + 0.1 * p[1] * x[0]]
}
#[function]
pub fn energy(x: [f64; 2], _u: [f64; 1], p: [f64; 2]) -> f64 {
    0.5 * x[1] * x[1] - p[0] * x[0].cos() + p[1] * p[1] * x[0] * x[0]
}
#[function]
pub fn work(x: [f64; 2], u: [f64; 1], p: [f64; 2]) -> f64 {
    p[0] * p[1] * u[0] * u[0] * (1.0 + x[0] * x[0])
}
#[function]
pub fn speed(x: [f64; 2], u: [f64; 1], p: [f64; 2]) -> f64 {
    p[1] * p[1] * x[1] + 0.1 * p[0] * u[0] * x[0]
}
#[function]
pub fn jump(x: [f64; 2], u: [f64; 1], p: [f64; 2]) -> [f64; 2] {
    [x[0] + 0.15 * x[1], x[1] + 0.15 * (u[0] * x[0].cos() - p[0] * p[1] * x[0].sin())]
}
pub const N: usize = 10;
pub const AT: [f64; 4] = [-0.8, 0.1, 1.3, 0.8];

const STEP: f64 = 5e-4;
/// Differences of solutions to 1e-10 over 5e-4, with weights of up to 3 and thirty elements of a
/// seed.
pub const TOLERANCE: f64 = 1e-5;

macro_rules! bounded {
    ($dynamics:expr, $at:expr) => {
        bounded!($dynamics, $at, x[0] <= -0.25, from 7)
    };
    ($dynamics:expr, $at:expr, x[0] <= $most:expr, from $stage:expr) => {{
        let mut ocp = Problem::new($dynamics)
            .running_cost((
                LeastSquaresCost::<Tracking>::diagonal(&[6.0, 3.0, 12.0]),
                GeneralCost::<Work>::new(),
            ))
            .terminal_cost(GeneralCost::<Energy>::new())
            .path_constraints(Constraint::<Speed>::new([f64::NEG_INFINITY], [0.5]))
            .on(Horizon::uniform(N, 0.15))?;
        let (x0, p) = $at.split_at(2);
        ocp.fix_initial_state(x0)?.bound("u", .., -2.0, 0.37)?.guess(x0, &[0.0])?.set_parameters(.., p)?;
        ocp.bound("x[0]", $stage.., f64::NEG_INFINITY, $most)?.soften("x[0]", $stage.., 0.1, 2.0)?;
        ocp
    }};
}
pub(crate) use bounded;

/// Dynamics of an integrator, of a batch and of a map, with active bounds of controls and a soft
/// bound of the last state that is violated by more than the differences move it: where it is just
/// reached, second derivatives jump.
#[test]
fn value_function_and_adjoints_by_differences() -> Test {
    macro_rules! check {
        ($dynamics:expr) => {{
            let mut ocp = bounded!($dynamics, AT, x[0] <= -0.05, from N);
            assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
            let stages = || ocp.iterate().stages();
            assert!((1..N).contains(&stages().filter(|stage| stage.u_upper.iter().any(|&m| m > 1e-3)).count()));
            assert!(stages().next_back().is_some_and(|last| last.x[0] > 0.01 && last.x_upper[0] > 0.11));
            check_by_differences(
                &AT,
                By::Sqp,
                |at| solved(bounded!($dynamics, at, x[0] <= -0.05, from N), By::Sqp),
                TOLERANCE,
            )?;
        }};
    }
    check!(Irk::<Pendulum, Gauss<2>>::new(Options::default())?);
    check!(Shooting::new(Batch::<Pendulum, Gauss<2>>::new(Options::default())?));
    check!(Map::<Jump, f64>::new());
    Ok(())
}

/// Integral costs with parameters: squares, and a general one.
#[test]
fn parameter_derivatives_of_integral_costs() -> Test {
    let squares = |at: &[f64]| {
        let irk = Irk::<Pendulum, Gauss<2>>::new(Options::default())?;
        let along = WithIntegral::new(irk, LeastSquares::<Tracking>::new(&Matrix3::identity()));
        solved(bounded!(along, at), By::Sqp)
    };
    check_by_differences(&AT, By::Sqp, squares, TOLERANCE)?;
    let general = |at: &[f64]| {
        let irk = Irk::<Pendulum, Gauss<2>>::new(Options::default())?;
        solved(bounded!(WithIntegral::new(irk, Quadrature::<Work>::new()), at), By::Sqp)
    };
    check_by_differences(&AT, By::Sqp, general, TOLERANCE)
}

/// `sinh z = c + …`: costs and constraints of algebraic states that depend on a parameter.
#[dae]
fn cart(xdot: [f64; 3], x: [f64; 3], z: [f64; 1], u: [f64; 1], p: [f64; 1]) -> [f64; 4] {
    [
        xdot[0] - x[1],
        xdot[1] + x[0].sin() * x[2] - z[0] - 0.5 * u[0],
        xdot[2],
        z[0].sinh() - 0.7 * x[2] - 0.4 * u[0] + 0.3 * p[0] * p[0] - 0.5 * x[2] * u[0] * p[0],
    ]
}
#[function]
fn place(x: [f64; 3], z: [f64; 1], u: [f64; 1], p: [f64; 1]) -> [f64; 3] {
    [x[0] - 0.2 * z[0], z[0] * z[0] + 0.1 * p[0], 0.5 * u[0] + z[0] * x[1]]
}
#[function]
fn power(x: [f64; 3], z: [f64; 1], u: [f64; 1], p: [f64; 1]) -> [f64; 2] {
    [x[1] * z[0] + 0.2 * p[0] * p[0] * z[0], u[0] + z[0] * z[0]]
}

#[test]
fn parameter_derivatives_of_algebraic_states() -> Test {
    let solve = |at: &[f64]| {
        let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
            .running_cost(LeastSquaresCost::<Place>::new(&matrix![
                2.0, 0.3, 0.0; 0.3, 1.0, -0.2; 0.0, -0.2, 0.5
            ]))
            .path_constraints(Constraint::<Power>::new([-0.1, -0.3], [0.05, 0.4]))
            .on(Horizon::uniform(8, 0.25))?;
        let (x0, p) = at.split_at(3);
        ocp.fix_initial_state(x0)?.bound("u", .., -1.0, 1.0)?.guess(x0, &[0.0])?.set_parameters(.., p)?;
        solved(ocp, By::Sqp)
    };
    check_by_differences(&[0.7, -0.2, 0.9, 0.6], By::Sqp, solve, TOLERANCE)
}
