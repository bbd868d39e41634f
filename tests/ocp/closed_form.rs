//! Small problems with solutions that are known.

use crate::Test;
use casados::ocp::{
    Convexification, Exact, GaussNewton, GeneralCost, Globalisation, HeapSqp, Horizon, LeastSquaresCost, Map,
    Problem, WithIntegral,
};
use casados::prelude::*;
use nalgebra::{Matrix2, Matrix2x1, RowVector2, SMatrix, Vector2};

/// A mass that is pushed, in discrete time: exact for a control that is constant over an interval
/// of 0.1.
#[function]
fn push(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [x[0] + 0.1 * x[1] + 0.005 * u[0], x[1] + 0.1 * u[0]]
}

#[function]
fn both(x: [f64; 2], u: [f64; 1]) -> [f64; 3] {
    [x[0], x[1], u[0]]
}

#[function]
fn position_and_speed(x: [f64; 2], _u: [f64; 1]) -> [f64; 2] {
    x
}

#[ode]
fn mass(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [x[1], u[0]]
}

/// Without bounds it is the linear-quadratic regulator: its Riccati recursion, with coupled
/// weights.
#[test]
fn regulator() -> Test {
    let a = Matrix2::new(1.0, 0.1, 0.0, 1.0);
    let b = Matrix2x1::new(0.005, 0.1);
    let weights = SMatrix::<f64, 3, 3>::new(2.0, 0.3, 0.1, 0.3, 1.0, 0.2, 0.1, 0.2, 0.5);
    let q = weights.fixed_view::<2, 2>(0, 0).into_owned();
    let s = weights.fixed_view::<1, 2>(2, 0).into_owned();
    let end = Matrix2::new(5.0, 1.0, 1.0, 3.0);
    let n = 30;
    let mut p = end;
    let mut gains = vec![RowVector2::zeros(); n];
    for gain in gains.iter_mut().rev() {
        let r = weights[(2, 2)] + (b.transpose() * p * b)[0];
        *gain = -(s + b.transpose() * p * a) / r;
        p = q + a.transpose() * p * a + (s + b.transpose() * p * a).transpose() * *gain;
    }

    let mut ocp = Problem::new(Map::<Push, f64>::new())
        .stage_cost(LeastSquaresCost::<Both>::new(&weights))
        .terminal_cost(LeastSquaresCost::<PositionAndSpeed>::new(&end))
        .on(Horizon::uniform(n, 0.1))?;
    ocp.fix_initial_state(&[1.0, -0.5])?.guess(&[0.0; 2], &[0.0])?;
    let mut sqp = HeapSqp::new(&ocp)?.gauss_newton();
    let outcome = sqp.solve(&mut ocp)?;
    // It is a QP.
    assert!(outcome.is_converged() && outcome.iterations == 1);
    let mut x = Vector2::new(1.0, -0.5);
    // ½ xᵀPx is what it costs.
    assert!((outcome.objective - 0.5 * (x.transpose() * p * x)[0]).abs() < 1e-12);
    for (k, stage) in ocp.iterate().stages().enumerate() {
        // Thirty steps of matrices with norms near one: some hundred roundings.
        assert!((x - Vector2::from_column_slice(stage.x)).amax() < 1e-13);
        if let Some(gain) = gains.get(k) {
            let u = (gain * x)[0];
            assert!((u - stage.u[0]).abs() < 1e-12);
            x = a * x + b * u;
        }
    }
    Ok(())
}

/// The same with exact Hessians: a least-squares cost of linear functions has no more.
#[test]
fn exact_hessians_of_quadratic_problems() -> Test {
    let mut results = Vec::new();
    for exact in [false, true] {
        let mut ocp = Problem::new(Map::<Push, f64>::new())
            .running_cost(LeastSquaresCost::<Both>::diagonal(&[1.0, 1.0, 0.1]))
            .on(Horizon::nodes(&[0.0, 0.1, 0.3, 0.4]))?;
        ocp.fix_initial_state(&[1.0, 0.0])?;
        ocp.bound("u", .., -1.0, 1.0)?.guess(&[0.0; 2], &[0.0])?;
        if exact {
            ocp.linearise(Exact::default())?;
        } else {
            ocp.linearise(GaussNewton::default())?;
        }
        let stage = ocp.qp().stage(1).ok_or("no stage")?;
        // A running cost is multiplied by the length of its interval.
        assert!((stage.r().get(0, 0).ok_or("no element")? - 0.02).abs() < 1e-16);
        results.push((stage.q().get(0, 0), stage.q().get(1, 1), stage.r().get(0, 0), stage.s().get(0, 0)));
    }
    assert_eq!(results[0], results[1]);
    Ok(())
}

/// Position, speed, and the time that everything takes: `dx/dτ = T f(x, u)`, `τ ∈ [0, 1]`.
#[ode]
fn hurried(x: [f64; 3], u: [f64; 1]) -> [f64; 3] {
    [x[2] * x[1], x[2] * u[0], 0.0]
}

#[function]
fn duration(x: [f64; 3], _u: [f64; 1]) -> f64 {
    x[2]
}

/// From rest to rest over a distance `d` with `|u| ≤ 1` takes `2 √d`: full speed ahead, and back
/// (bang-bang).
#[test]
fn shortest_time() -> Test {
    for globalisation in [Globalisation::Merit, Globalisation::Filter] {
        let n = 20;
        let mut ocp = Problem::new(Irk::<Hurried, Gauss<2>>::new(Options::default())?)
            .terminal_cost(GeneralCost::<Duration>::new())
            .on(Horizon::uniform(n, 1.0 / n as f64))?;
        ocp.free_initial_state();
        ocp.bound("x[0]", 0..1, 0.0, 0.0)?.bound("x[1]", 0..1, 0.0, 0.0)?;
        ocp.bound("x[0]", n..=n, 4.0, 4.0)?.bound("x[1]", n..=n, 0.0, 0.0)?;
        ocp.bound("x[2]", .., 0.1, 20.0)?.bound("u", .., -1.0, 1.0)?;
        ocp.guess(&[2.0, 1.0, 5.0], &[0.0])?;
        let mut sqp = HeapSqp::new(&ocp)?;
        sqp.options.globalisation = globalisation;
        sqp.options.tolerance = 1e-8;
        let outcome = sqp.solve(&mut ocp)?;
        println!("{}{outcome}", sqp.log());
        assert!(outcome.is_converged());
        // The switch is at a node, and Gauss of two stages integrates cubic polynomials exactly.
        assert!((outcome.objective - 4.0).abs() < 1e-6, "{}", outcome.objective);
        for (k, stage) in ocp.iterate().stages().take(n).enumerate() {
            let expected = if k < n / 2 { 1.0 } else { -1.0 };
            assert!((stage.u[0] - expected).abs() < 1e-5, "{k} {}", stage.u[0]);
        }
    }
    Ok(())
}

#[function]
fn effort(x: [f64; 2], u: [f64; 1]) -> f64 {
    0.5 * (x[0] * x[0] + u[0] * u[0])
}

#[function]
fn deviation(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [x[0], u[0]]
}

/// `½ ∫ x₁² + u² dt` as a square, as an integral of a general function, and with exact Hessians:
/// one solution, whose objective is that of a fine discretisation by hand.
#[test]
fn integral_costs() -> Test {
    let (n, h) = (10, 0.2);
    let options = Options::default();
    let irk = || Irk::<Mass, Gauss<3>>::new(options);
    let x0 = [1.0, 0.5];

    let squares = LeastSquares::<Deviation>::new(&Matrix2::identity());
    let mut ocp = Problem::new(WithIntegral::new(irk()?, squares)).on(Horizon::uniform(n, h))?;
    ocp.fix_initial_state(&x0)?.guess(&x0, &[0.0])?;
    let first = HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?;
    // It is a QP.
    assert!(first.is_converged() && first.iterations == 1);

    let mut general =
        Problem::new(WithIntegral::new(irk()?, Quadrature::<Effort>::new())).on(Horizon::uniform(n, h))?;
    general.fix_initial_state(&x0)?.guess(&x0, &[0.0])?;
    // Semidefinite Hessians of stages are to stay as they are.
    let exact = Exact { convexification: Convexification::None };
    let second = HeapSqp::new(&general)?.exact(exact).solve(&mut general)?;
    assert!(second.is_converged() && second.iterations == 1);
    // Both QPs are the same but for roundings, and have no inequalities.
    assert!((first.objective - second.objective).abs() < 1e-12);
    for (a, b) in ocp.iterate().stages().zip(general.iterate().stages()) {
        assert!(a.x.iter().chain(a.u).zip(b.x.iter().chain(b.u)).all(|(a, b)| (a - b).abs() < 1e-9));
    }

    // Position and control are polynomials of degree two at most: their integrals by hand.
    let mut sum = 0.0;
    for stage in ocp.iterate().stages().take(n) {
        let (c0, c1, c2) = (stage.x[0], stage.x[1], 0.5 * stage.u[0]);
        let square = c0 * c0 * h
            + c0 * c1 * h.powi(2)
            + (c1 * c1 + 2.0 * c0 * c2) * h.powi(3) / 3.0
            + c1 * c2 * h.powi(4) / 2.0
            + c2 * c2 * h.powi(5) / 5.0;
        sum += 0.5 * (square + stage.u[0] * stage.u[0] * h);
    }
    assert!((sum - first.objective).abs() < 1e-13 * n as f64);
    Ok(())
}

/// Parameters and times of stages: `x₊ = x + h (u + p t)` with costs that make `u` zero.
#[ode]
fn drift(_x: [f64; 1], u: [f64; 1], p: [f64; 1], t: f64) -> [f64; 1] {
    [u[0] + p[0] * t]
}

#[function]
fn input(_x: [f64; 1], u: [f64; 1], p: [f64; 1], t: f64) -> f64 {
    u[0] - p[0] * t
}

#[test]
fn parameters_and_times_of_stages() -> Test {
    let times = [0.0, 0.5, 0.7, 1.0];
    let mut ocp = Problem::new(Erk::<Drift, Rk4>::new(Options::default())?)
        .stage_cost(LeastSquaresCost::<Input>::diagonal(&[1.0]))
        .on(Horizon::nodes(&times))?;
    ocp.fix_initial_state(&[1.0])?.guess(&[0.0], &[0.0])?;
    let p = [2.0, 3.0, 5.0, 7.0];
    for (k, p) in p.iter().enumerate() {
        ocp.set_parameters(k..=k, &[*p])?;
    }
    let outcome = HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?;
    assert!(outcome.is_converged());
    let mut x = 1.0;
    for (k, stage) in ocp.iterate().stages().enumerate() {
        assert!((stage.x[0] - x).abs() < 1e-13);
        if k < 3 {
            let (a, b) = (times[k], times[k + 1]);
            assert!((stage.u[0] - p[k] * a).abs() < 1e-13);
            x += p[k] * a * (b - a) + p[k] * 0.5 * (b * b - a * a);
        }
    }
    Ok(())
}

#[test]
fn single_precision() -> Test {
    let mut ocp = Problem::new(Map::<Push, f32>::new())
        .stage_cost(LeastSquaresCost::<Both, f32>::diagonal(&[1.0, 1.0, 0.1]))
        .on(Horizon::<f32>::uniform(20, 0.1))?;
    ocp.fix_initial_state(&[1.0, 0.0])?.bound("u", .., -0.5, 0.5)?.guess(&[0.0; 2], &[0.0])?;
    let mut sqp = HeapSqp::<_, _, f32>::new(&ocp)?;
    let outcome = sqp.solve(&mut ocp)?;
    assert!(outcome.is_converged(), "{outcome}");
    assert!((ocp.stage(0)?.u[0] + 0.5).abs() < 1e-3);
    Ok(())
}

#[function]
fn squares(x: f64, u: f64) -> f64 {
    x + u * u - u
}

#[function]
fn state(x: f64, _u: f64) -> f64 {
    x
}

/// Curvature that is in the dynamics alone: `x_N = x₀ + Σ u_k² − u_k` is smallest at `u_k = ½`,
/// where it is `x₀ − N/4`. The solver that is made without more words finds it; the Hessian of
/// Gauss and Newton is zero, and has no minimum to go to.
#[test]
fn default_hessians() -> Test {
    const INTERVALS: usize = 4;
    let mut ocp = Problem::new(Map::<Squares, f64>::new())
        .terminal_cost(GeneralCost::<State>::new())
        .on(Horizon::uniform(INTERVALS, 1.0))?;
    ocp.fix_initial_state(&[3.0])?.guess(&[3.0], &[0.2])?;
    let outcome = HeapSqp::new(&ocp)?.solve(&mut ocp)?;
    assert!(outcome.is_converged(), "{outcome}");
    assert!((outcome.objective - (3.0 - INTERVALS as f64 / 4.0)).abs() < 1e-9, "{outcome}");
    for stage in 0..INTERVALS {
        assert!((ocp.stage(stage)?.u[0] - 0.5).abs() < 1e-6);
    }
    Ok(())
}
