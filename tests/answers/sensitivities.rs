//! Derivatives of solutions against differences of problems that are solved again, and against the
//! regulator.

use crate::Test;
use crate::mass::{Both, Push};
use casados::LeastSquares;
use casados::ocp::{
    Constraint, Convexification, Exact, GaussNewton, GeneralCost, HeapSqp, Horizon, LeastSquaresCost, Map,
    OcpError, Problem, Sensitivities, WithIntegral,
};
use casados::prelude::*;

/// A pendulum with a length that does not change: a parameter as a state.
#[ode]
fn pendulum(x: [f64; 3], u: [f64; 1]) -> [f64; 3] {
    [x[1], -x[2] * x[0].sin() + u[0] * x[0].cos(), 0.0]
}

#[function]
fn tracking(x: [f64; 3], u: [f64; 1]) -> [f64; 3] {
    [x[0] - 0.5, 0.3 * x[1] * x[1], 0.2 * u[0]]
}

#[function]
fn energy(x: [f64; 3], _u: [f64; 1]) -> f64 {
    0.5 * x[1] * x[1] - x[0].cos()
}

#[function]
fn speed(x: [f64; 3], u: [f64; 1]) -> f64 {
    x[1] + 0.1 * u[0] * x[0]
}

/// With bounds of controls, a constraint of the path and a soft bound that are active somewhere.
#[test]
fn sensitivities_by_differences() -> Test {
    let n = 12;
    let mut ocp = Problem::new(Irk::<Pendulum, Gauss<2>>::new(Options::default())?)
        .stage_cost(LeastSquaresCost::<Tracking>::diagonal(&[1.0; 3]))
        .terminal_cost(GeneralCost::<Energy>::new())
        .path_constraints(Constraint::<Speed>::new([f64::NEG_INFINITY], [0.75]))
        .on(Horizon::uniform(n, 0.15))?;
    let x0 = [-0.8, 0.1, 1.3];
    ocp.fix_initial_state(&x0)?.bound("u", .., -2.0, 2.0)?.guess(&x0, &[0.0])?;
    ocp.bound("x[0]", 4.., f64::NEG_INFINITY, 0.1)?.soften("x[0]", 4.., 0.1, 2.0)?;
    let exact = Exact { convexification: Convexification::None };
    let mut sqp = HeapSqp::new(&ocp)?;
    sqp.options.globalisation = casados::ocp::Globalisation::Merit;
    (sqp.options.tolerance, sqp.options.max_iterations) = (1e-9, 100);
    sqp.qp_solver.options.tolerance = 1e-11;
    let outcome = sqp.solve(&mut ocp)?;
    println!("{}{outcome}", sqp.log());
    assert!(outcome.is_converged());
    let stages: Vec<_> = ocp.iterate().stages().collect();
    // All three are active somewhere, and nothing is active everywhere.
    let active =
        |f: &dyn Fn(&casados::qp::SolutionStage<'_, f64>) -> bool| stages.iter().filter(|s| f(s)).count();
    assert!((1..n).contains(&active(&|s| s.u_upper.iter().any(|&m| m > 1e-3))));
    assert!((1..n).contains(&active(&|s| s.g_upper.iter().any(|&m| m > 1e-3))));
    assert!((1..n).contains(&active(&|s| s.x[0] > 0.101)));
    drop(stages);

    let mut result = Sensitivities::new(&ocp)?;
    ocp.differentiate(exact, &mut result)?;
    let step = 1e-5;
    for direction in 0..3 {
        let mut sides = Vec::new();
        for sign in [1.0, -1.0] {
            let mut x0 = x0;
            x0[direction] += sign * step;
            ocp.fix_initial_state(&x0)?;
            assert!(sqp.solve(&mut ocp)?.is_converged());
            let all: Vec<(Vec<f64>, Vec<f64>)> =
                ocp.iterate().stages().map(|stage| (stage.x.to_vec(), stage.u.to_vec())).collect();
            sides.push(all);
        }
        for (k, (plus, minus)) in sides[0].iter().zip(&sides[1]).enumerate() {
            let pairs = plus.0.iter().zip(&minus.0).zip(&result.dx(k)[direction * 3..]);
            let du = result.du(k.min(n - 1)).get(direction..).unwrap_or_default();
            for ((a, b), derivative) in pairs.chain(plus.1.iter().zip(&minus.1).zip(du)) {
                let difference = (a - b) / (2.0 * step);
                // Solutions to 1e-9 over 2e-5, and complementarity of 1e-11 over multipliers of
                // 1e-3: 1e-4 in all.
                assert!((difference - derivative).abs() < 1e-4, "{k} {direction}: {difference} {derivative}");
            }
        }
    }
    // Feedback at the first stage is the derivative of the first control, up to the compliance `∛ε`
    // of active bounds: relative to the scale of the Hessian, it is multiplied by the change of the
    // bound's force, which is below one here.
    for (gain, derivative) in result.gain(0).iter().zip(result.du(0)) {
        assert!((gain - derivative).abs() <= f64::EPSILON.cbrt(), "{gain} {derivative}");
    }
    Ok(())
}

/// A long horizon without bounds: gains of the regulator, and `x_k = dx_k/dx₀ x₀`, since everything
/// is linear.
#[test]
fn sensitivities_of_linear_problems() -> Test {
    let mut ocp = Problem::new(Map::<Push, f64>::new())
        .stage_cost(LeastSquaresCost::<Both>::diagonal(&[2.0, 1.0, 0.5]))
        .on(Horizon::uniform(25, 0.1))?;
    let x0 = [1.0, -0.3];
    let mut result = Sensitivities::new(&ocp)?;
    assert!(matches!(ocp.differentiate(GaussNewton::default(), &mut result), Err(OcpError::Missing { .. })));
    ocp.fix_initial_state(&x0)?.guess(&[0.0; 2], &[0.0])?;
    assert!(HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?.is_converged());
    ocp.differentiate(GaussNewton::default(), &mut result)?;
    for (k, stage) in ocp.iterate().stages().enumerate() {
        let (dx, gain) = (result.dx(k), result.gain(k));
        for i in 0..2 {
            // Twenty-five products of small matrices.
            assert!((dx[i] * x0[0] + dx[2 + i] * x0[1] - stage.x[i]).abs() < 1e-13);
        }
        if k < 25 {
            assert!((gain[0] * stage.x[0] + gain[1] * stage.x[1] - stage.u[0]).abs() < 1e-12);
        }
    }
    Ok(())
}

/// A pendulum whose length and a weight are parameters.
mod parameters {
    use casados::prelude::*;

    #[ode]
    pub fn pendulum(x: [f64; 2], u: [f64; 1], p: [f64; 2]) -> [f64; 2] {
        [x[1], -p[0] * x[0].sin() + u[0] * x[0].cos()]
    }
    #[function]
    pub fn tracking(x: [f64; 2], u: [f64; 1], p: [f64; 2]) -> [f64; 3] {
        [x[0] - 0.4 * p[0], 0.3 * p[1] * x[1] * x[1], 0.2 * u[0] + 0.1 * p[1] * x[0]]
    }
    #[function]
    pub fn energy(x: [f64; 2], _u: [f64; 1], p: [f64; 2]) -> f64 {
        0.5 * x[1] * x[1] - p[0] * x[0].cos() + p[1] * x[0] * x[0]
    }
    #[function]
    pub fn speed(x: [f64; 2], u: [f64; 1], p: [f64; 2]) -> f64 {
        p[1] * x[1] + 0.1 * p[0] * u[0] * x[0]
    }
    #[function]
    pub fn push(x: [f64; 2], u: [f64; 1], p: [f64; 2]) -> [f64; 2] {
        [x[0] + 0.15 * x[1], x[1] + 0.15 * (u[0] * x[0].cos() - p[0] * x[0].sin())]
    }
}

/// The same, where both are states that do not change.
mod states {
    use casados::prelude::*;

    #[ode]
    pub fn pendulum(x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
        [x[1], -x[2] * x[0].sin() + u[0] * x[0].cos(), 0.0, 0.0]
    }
    #[function]
    pub fn tracking(x: [f64; 4], u: [f64; 1]) -> [f64; 3] {
        [x[0] - 0.4 * x[2], 0.3 * x[3] * x[1] * x[1], 0.2 * u[0] + 0.1 * x[3] * x[0]]
    }
    #[function]
    pub fn energy(x: [f64; 4], _u: [f64; 1]) -> f64 {
        0.5 * x[1] * x[1] - x[2] * x[0].cos() + x[3] * x[0] * x[0]
    }
    #[function]
    pub fn speed(x: [f64; 4], u: [f64; 1]) -> f64 {
        x[3] * x[1] + 0.1 * x[2] * u[0] * x[0]
    }
    #[function]
    pub fn push(x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
        [x[0] + 0.15 * x[1], x[1] + 0.15 * (u[0] * x[0].cos() - x[2] * x[0].sin()), x[2], x[3]]
    }
}

const P: [f64; 2] = [1.3, 0.8];

/// A problem with this dynamics, solved, and its derivatives; `full` is the initial state, with
/// parameters behind it that are states.
macro_rules! solved {
    ($module:ident, $dynamics:expr, $full:expr, $p:expr, $curvature:expr) => {{
        let mut ocp = Problem::new($dynamics)
            .stage_cost(LeastSquaresCost::<$module::Tracking>::diagonal(&[1.0, 0.5, 2.0]))
            .terminal_cost(GeneralCost::<$module::Energy>::new())
            .path_constraints(Constraint::<$module::Speed>::new([f64::NEG_INFINITY], [0.5]))
            .terminal_constraints(Constraint::<$module::Energy>::new([f64::NEG_INFINITY], [5.0]))
            .on(Horizon::uniform(N, 0.15))?;
        let mut result = Sensitivities::new(&ocp)?;
        ocp.fix_initial_state(&$full)?.bound("u", .., -2.0, 1.2)?.guess(&$full, &[0.0])?;
        if !$p.is_empty() {
            ocp.set_parameters(.., &$p)?;
        }
        let mut sqp = HeapSqp::new(&ocp)?;
        sqp.options.globalisation = casados::ocp::Globalisation::Merit;
        (sqp.options.tolerance, sqp.options.max_iterations) = (1e-10, 100);
        sqp.qp_solver.options.tolerance = 1e-12;
        assert!(sqp.solve(&mut ocp)?.is_converged(), "{}", sqp.log());
        ocp.differentiate($curvature, &mut result)?;
        (ocp, result)
    }};
}

macro_rules! integrator {
    ($module:ident) => {
        Irk::<$module::Pendulum, Gauss<2>>::new(Options::default())?
    };
}

const N: usize = 12;
const EXACT: Exact = Exact { convexification: Convexification::None };

/// Parameters are states that do not change, and need no columns of their own: dynamics of an
/// integrator, of one with an integral, of a map; exact and of Gauss and Newton. Constraints are
/// active somewhere.
#[test]
fn sensitivities_by_parameters_as_states() -> Test {
    macro_rules! compare {
        ($dynamics:ident, $curvature:expr) => {{
            let x0 = [-0.8, 0.1, P[0], P[1]];
            let (ocp, with) = solved!(parameters, $dynamics!(parameters), [x0[0], x0[1]], P, $curvature);
            let (_, without) = solved!(states, $dynamics!(states), x0, [0.0; 0], $curvature);
            let count = ocp.iterate().stages().filter(|s| s.g_upper.iter().any(|&m| m > 1e-3)).count();
            assert!((1..N).contains(&count), "{count}");
            let mut largest = 0.0_f64;
            for k in 0..=N {
                for p in 0..2 {
                    let (dx, other) = (&with.dx_dp(k)[2 * p..][..2], &without.dx(k)[4 * (2 + p)..][..2]);
                    let (du, others) = if k < N {
                        (&with.du_dp(k)[p..=p], &without.du(k)[2 + p..=2 + p])
                    } else {
                        (&[][..], &[][..])
                    };
                    for (a, b) in dx.iter().chain(du).zip(other.iter().chain(others)) {
                        largest = largest.max(a.abs());
                        // Two solutions to 1e-10, whose multipliers are at least 1e-3; bounds as
                        // springs of 1e8.
                        assert!((a - b).abs() < 1e-6, "{k} {p}: {a} {b}");
                    }
                }
            }
            assert!(largest > 0.1);
        }};
    }
    macro_rules! integral {
        ($module:ident) => {
            WithIntegral::new(
                integrator!($module),
                LeastSquares::<$module::Tracking>::new(&nalgebra::Matrix3::identity()),
            )
        };
    }
    macro_rules! map {
        ($module:ident) => {
            Map::<$module::Push, f64>::new()
        };
    }
    compare!(integrator, EXACT);
    compare!(integral, EXACT);
    compare!(map, EXACT);
    compare!(integrator, GaussNewton { convexification: Convexification::None });
    compare!(integral, GaussNewton { convexification: Convexification::None });
    Ok(())
}

/// Differences of solutions with other parameters.
#[test]
fn parameter_sensitivities_by_differences() -> Test {
    let x0 = [-0.8, 0.1];
    let (ocp, result) = solved!(parameters, integrator!(parameters), x0, P, EXACT);
    let bounded = ocp.iterate().stages().filter(|s| s.u_upper.iter().any(|&m| m > 1e-3)).count();
    assert!((1..N).contains(&bounded), "{bounded}");
    let step = 1e-5;
    for p in 0..2 {
        let mut sides = Vec::new();
        for sign in [1.0, -1.0] {
            let mut other = P;
            other[p] += sign * step;
            let (ocp, _) = solved!(parameters, integrator!(parameters), x0, other, EXACT);
            sides.push(ocp.iterate().stages().map(|s| [s.x, s.u].concat()).collect::<Vec<_>>());
        }
        for (k, (plus, minus)) in sides[0].iter().zip(&sides[1]).enumerate() {
            let dx = &result.dx_dp(k)[2 * p..][..2];
            let du = if k < N { &result.du_dp(k)[p..=p] } else { &[] };
            for ((a, b), derivative) in plus.iter().zip(minus).zip(dx.iter().chain(du)) {
                let difference = (a - b) / (2.0 * step);
                // Solutions to 1e-10 over 2e-5, multipliers of 1e-3.
                assert!((difference - derivative).abs() < 1e-4, "{k} {p}: {difference} {derivative}");
            }
        }
    }
    Ok(())
}

/// A stage that there is not has no derivatives, however large its number is.
#[test]
fn sensitivities_at_missing_stages() -> Test {
    let ocp = Problem::new(Irk::<Pendulum, Gauss<2>>::new(Options::default())?)
        .terminal_cost(GeneralCost::<Energy>::new())
        .on(Horizon::uniform(3, 0.1))?;
    let result = Sensitivities::<f64>::new(&ocp)?;
    assert_eq!([result.dx(3).len(), result.du(2).len(), result.gain(2).len()], [9, 3, 3]);
    // Products with the sizes of matrices overflow.
    for stage in [4, usize::MAX, usize::MAX / 9 + 1, 1 << 63] {
        assert!(result.dx(stage).is_empty() && result.dx_dp(stage).is_empty());
        assert!(
            result.du(stage).is_empty() && result.du_dp(stage).is_empty() && result.gain(stage).is_empty()
        );
    }
    Ok(())
}

/// An unstable chain that nothing but its controls costs: it is left alone, and grows beyond all
/// numbers.
#[function]
fn steep(x: f64, u: f64, _p: f64) -> f64 {
    1e100 * x + u
}
#[function]
fn little(_x: f64, u: f64, p: f64) -> f64 {
    u - p
}

#[test]
fn sensitivities_that_are_not_finite() -> Test {
    let mut ocp = Problem::new(Map::<Steep, f64>::new())
        .stage_cost(LeastSquaresCost::<Little>::diagonal(&[1.0]))
        .on(Horizon::uniform(5, 1.0))?;
    ocp.fix_initial_state(&[0.0])?.set_parameters(.., &[0.0])?.guess(&[0.0], &[0.0])?;
    let mut result = Sensitivities::<f64>::new(&ocp)?;
    // Three intervals make 1e300 of a one, four no number.
    let error = ocp.differentiate(GaussNewton::default(), &mut result).expect_err("1e400");
    assert!(matches!(error, OcpError::NonFiniteSensitivity { stage: 4, of: "x", by: "x", .. }), "{error}");
    assert!((result.dx(3)[0] / 1e300 - 1.0).abs() < 1e-12);
    assert_eq!(
        error.to_string(),
        "stage 4: the derivative of the solution `x` by `x` is inf: scale states, controls and costs to about one"
    );
    Ok(())
}
