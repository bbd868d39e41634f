//! Free parameters: their QP against that of states without rates, solutions against closed forms
//! and published values, by every kind of dynamics, and mistakes by name.

use crate::Test;
use casados::ocp::{
    Constraint, ConvexCost, Exact, Formulation, GaussNewton, GeneralCost, HeapIpm, HeapOcp, HeapRealTime,
    HeapSqp, Horizon, Kind, LeastSquaresCost, Map, OcpError, Problem, PseudoHuber, SecondOrder,
    Sensitivities, Shooting, WithIntegral,
};
use casados::prelude::*;
use core::f64::consts::PI;
use nalgebra::matrix;

/// Two parameters in all terms, an algebraic state.
#[dae]
mod pumps {
    pub struct State {
        pub level: f64,
        pub speed: f64,
    }
    pub struct Setting {
        pub gain: f64,
        pub drag: f64,
    }

    fn equations(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
        [
            xdot[0] - x[1] * p[1].sin() + 0.1 * z * x[0],
            xdot[1] - u * p[0] + z * p[1] + 0.2 * x[1] * x[1],
            z * (1.0 + 0.1 * z * z) - x[0] * p[1] - 0.3 * x[1] * u,
        ]
    }
    #[dae]
    fn pump(xdot: &State, x: &State, z: f64, u: f64, p: &Setting) -> [f64; 3] {
        equations([xdot.level, xdot.speed], [x.level, x.speed], z, u, [p.gain, p.drag])
    }
    /// The drag as a state.
    #[dae]
    fn pump_with_state(xdot: [f64; 3], x: [f64; 3], z: f64, u: f64, p: f64) -> [f64; 4] {
        let [a, b, c] = equations([xdot[0], xdot[1]], [x[0], x[1]], z, u, [p, x[2]]);
        [a, b, xdot[2], c]
    }

    fn cost(x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> f64 {
        x[0] * p[1] * p[1] + z * x[1] * p[1] + u * u * p[0] + (x[0] * u * p[1]).sin()
    }
    #[function]
    fn price(x: &State, z: f64, u: f64, p: &Setting) -> f64 {
        cost([x.level, x.speed], z, u, [p.gain, p.drag])
    }
    #[function]
    fn price_with_state(x: [f64; 3], z: f64, u: f64, p: f64) -> f64 {
        cost([x[0], x[1]], z, u, [p, x[2]])
    }

    fn outputs(x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
        [x[0] * p[1] - z, u + p[0] * p[1], x[1] * p[1] * p[1]]
    }
    #[function]
    fn residuals(x: &State, z: f64, u: f64, p: &Setting) -> [f64; 3] {
        outputs([x.level, x.speed], z, u, [p.gain, p.drag])
    }
    #[function]
    fn residuals_with_state(x: [f64; 3], z: f64, u: f64, p: f64) -> [f64; 3] {
        outputs([x[0], x[1]], z, u, [p, x[2]])
    }

    #[function]
    fn end(x: &State, _z: f64, _u: f64, p: &Setting) -> [f64; 2] {
        [x.level * p.drag * p.drag, x.speed + p.drag * p.gain]
    }
    #[function]
    fn end_with_state(x: [f64; 3], _z: f64, _u: f64, p: f64) -> [f64; 2] {
        [x[0] * x[2] * x[2], x[1] + x[2] * p]
    }
}

/// What a stage of the QP says, over `(x₀, x₁, w, u)`: the Hessian, the gradient, rows of dynamics
/// with their constants, rows of constraints with their bounds.
pub fn stage_numbers<P: Formulation<f64>>(ocp: &HeapOcp<P>, states: usize) -> Vec<Vec<f64>> {
    let of = |stage: casados::qp::Stage<'_, f64>| {
        let dims = stage.dims();
        let n = dims.nx + dims.nu;
        let mut list = Vec::new();
        for j in 0..n {
            for i in j..n {
                let value = match (i.checked_sub(states), j.checked_sub(states)) {
                    (None, None) => stage.q().get(i, j),
                    (Some(i), None) => stage.s().get(i, j),
                    (Some(i), Some(j)) => stage.r().get(i, j),
                    (None, Some(_)) => None,
                };
                list.push(value.unwrap_or(f64::NAN));
            }
        }
        list.extend(stage.gradient_x().iter().chain(stage.gradient_u()));
        for i in 0..stage.offset().len().min(2) {
            list.extend((0..states).map(|j| stage.a().get(i, j).unwrap_or(f64::NAN)));
            list.extend((0..dims.nu).map(|j| stage.b().get(i, j).unwrap_or(f64::NAN)));
            list.push(stage.offset()[i]);
        }
        let bounds = stage.g_bounds();
        for i in 0..dims.ng {
            list.extend((0..states).map(|j| stage.c().get(i, j).unwrap_or(f64::NAN)));
            list.extend((0..dims.nu).map(|j| stage.d().get(i, j).unwrap_or(f64::NAN)));
            list.extend([bounds.lower[i], bounds.upper[i]]);
        }
        list
    };
    ocp.qp().stages().map(of).collect()
}

/// At any point, with any multipliers, columns of a free parameter are those of a state without a
/// rate in its place: exact Hessians and those of Gauss and Newton, of costs and constraints of
/// algebraic states, by two methods.
#[test]
fn quadratic_programs_by_constant_states() -> Test {
    const N: usize = 4;
    let irk = Options { steps: 2, ..Options::default() };
    let weights = matrix![2.0, 0.3, 0.0; 0.3, 1.0, 0.1; 0.0, 0.1, 0.5];
    let outer = || PseudoHuber { weights: [1.0, 0.5, 0.2], delta: [0.4, 1.0, 0.3] };
    let horizon = Horizon::uniform(N, 0.3);
    let (lower, upper) = ([-1.0, 0.0, 0.2], [2.0, 1.0, 0.3]);
    let mut free = Problem::new(Irk::<Pump, Gauss<2>>::new(irk)?)
        .running_cost((
            GeneralCost::<Price>::new(),
            (LeastSquaresCost::<Residuals>::new(&weights), ConvexCost::<Residuals, _>::new(outer())),
        ))
        .path_constraints(Constraint::<Residuals>::new(lower, upper))
        .terminal_cost((LeastSquaresCost::<End>::diagonal(&[0.5, 2.0]), GeneralCost::<End>::new()))
        .terminal_constraints(Constraint::<End>::new([0.1, -1.0], [0.5, 3.0]))
        .on(horizon)?;
    let mut with_state = Problem::new(Irk::<PumpWithState, Gauss<2>>::new(irk)?)
        .running_cost((
            GeneralCost::<PriceWithState>::new(),
            (
                LeastSquaresCost::<ResidualsWithState>::new(&weights),
                ConvexCost::<ResidualsWithState, _>::new(outer()),
            ),
        ))
        .path_constraints(Constraint::<ResidualsWithState>::new(lower, upper))
        .terminal_cost((
            LeastSquaresCost::<EndWithState>::diagonal(&[0.5, 2.0]),
            GeneralCost::<EndWithState>::new(),
        ))
        .terminal_constraints(Constraint::<EndWithState>::new([0.1, -1.0], [0.5, 3.0]))
        .on(horizon)?;
    for k in 0..=N {
        let gain = 1.0 + 0.1 * k as f64;
        free.set_parameters(k..=k, &[gain, f64::MAX])?;
        with_state.set_parameters(k..=k, &[gain])?;
    }
    free.free_initial_state().free("p.drag", 0.2..=2.0, 0.7)?;
    with_state.free_initial_state();
    for k in 0..=N {
        let t = k as f64;
        let (x, u) = ([0.4 + 0.1 * t, 0.2 - 0.2 * t.sin()], [0.3 * t.cos()]);
        let u = if k < N { &u[..] } else { &[] };
        free.guess_stage(k, &x, u)?;
        with_state.guess_stage(k, &[x[0], x[1], 0.7], u)?;
        let (a, b) = (free.iterate_mut().stage_mut(k), with_state.iterate_mut().stage_mut(k));
        let (a, b) = (a.ok_or("no stage")?, b.ok_or("no stage")?);
        for (i, multiplier) in [0.7, -0.4].into_iter().enumerate().take(a.dynamics.len()) {
            (a.dynamics[i], b.dynamics[i]) = (multiplier + 0.1 * t, multiplier + 0.1 * t);
        }
        for i in 0..a.g_upper.len() {
            (a.g_upper[i], b.g_upper[i]) = (0.3 * (i as f64 + 1.0), 0.3 * (i as f64 + 1.0));
            (a.g_lower[i], b.g_lower[i]) = (0.1 * t, 0.1 * t);
        }
    }
    let none = casados::ocp::Convexification::None;
    let check = |free: &HeapOcp<_>, with_state: &HeapOcp<_>, what: &str| {
        for (k, (a, b)) in stage_numbers(free, 2).iter().zip(stage_numbers(with_state, 3)).enumerate() {
            assert_eq!(a.len(), b.len(), "{what} {k}");
            for (i, (a, b)) in a.iter().zip(b).enumerate() {
                assert!((a - b).abs() < 1e-11 * (1.0 + b.abs()), "{what}, stage {k}, {i}: {a} {b}");
            }
        }
    };
    free.linearise(Exact { convexification: none })?;
    with_state.linearise(Exact { convexification: none })?;
    check(&free, &with_state, "exact");
    free.linearise(GaussNewton { convexification: none })?;
    with_state.linearise(GaussNewton { convexification: none })?;
    check(&free, &with_state, "Gauss-Newton");
    Ok(())
}

/// An oscillator whose stiffness is free, and half a period: no effort is needed where it fits.
#[ode]
fn spring(x: [f64; 2], u: f64, p: f64) -> [f64; 2] {
    [x[1], u - p * x[0]]
}
#[function]
fn effort(_x: [f64; 2], u: f64, _p: f64) -> f64 {
    u * u
}

fn half_a_period<P: Formulation<f64, Dynamics: SecondOrder<f64>> + Clone>(
    mut ocp: HeapOcp<P>,
    expected: f64,
    what: &str,
) -> Test {
    ocp.fix_initial_state(&[1.0, 0.0])?.free("p", 0.1..=50.0, 1.0)?;
    let last = ocp.intervals();
    ocp.bound("x[0]", last.., -1.0, -1.0)?.bound("x[1]", last.., 0.0, 0.0)?;
    for k in 0..=last {
        let x = [1.0 - 2.0 * k as f64 / last as f64, 0.0];
        ocp.guess_stage(k, &x, if k < last { &[0.0] } else { &[] })?;
    }
    let mut other = ocp.clone();
    let outcome = HeapIpm::new(&ocp)?.solve(&mut ocp)?;
    assert!(outcome.is_converged(), "{what}: {outcome}");
    let solution = ocp.dense_solution(2)?;
    let stiffness = solution.parameter("p")?;
    assert!((stiffness[0] - expected).abs() < 1e-4, "{what}: {} {expected}", stiffness[0]);
    assert!(stiffness.iter().all(|p| *p == stiffness[0]));
    let outcome = HeapSqp::new(&other)?.solve(&mut other)?;
    assert!(outcome.is_converged(), "{what} by SQP: {outcome}");
    let stiffness = other.solution()?.parameter("p")?[0];
    assert!((stiffness - expected).abs() < 1e-4, "{what} by SQP: {stiffness} {expected}");
    Ok(())
}

/// The stiffness whose half period is the horizon, by every kind of dynamics.
#[test]
fn stiffness_of_a_spring() -> Test {
    let irk = || Irk::<Spring, Gauss<4>>::new(Options::default());
    let cost = GeneralCost::<Effort>::new;
    let horizon = Horizon::uniform(10, 0.1);
    let expected = PI * PI;
    half_a_period(Problem::new(irk()?).running_cost(cost()).on(horizon)?, expected, "Irk")?;
    let erk = Erk::<Spring, Rk4>::new(Options { steps: 10, ..Options::default() })?;
    half_a_period(Problem::new(erk).running_cost(cost()).on(horizon)?, expected, "Erk")?;
    let batch = Batch::<Spring, Gauss<4>>::new(Options::default())?;
    half_a_period(
        Problem::new(Shooting::new(batch)).running_cost(cost()).on(horizon)?,
        expected,
        "Shooting",
    )?;
    let collocation = casados::ocp::Collocation::new(irk()?)?;
    half_a_period(Problem::new(collocation).running_cost(cost()).on(horizon)?, expected, "Collocation")?;
    let integral = WithIntegral::new(irk()?, Quadrature::<Effort>::new());
    half_a_period(Problem::new(integral).on(horizon)?, expected, "WithIntegral")?;
    Ok(())
}

/// What grows by a factor that is free, beside one that is given.
#[function]
fn growth(x: [f64; 2], _u: f64, p: [f64; 2]) -> [f64; 2] {
    [p[1] * x[0], p[0] * x[1]]
}
#[function]
fn sizes(x: [f64; 2], u: f64, _p: [f64; 2]) -> [f64; 3] {
    [x[0], x[1], u]
}

/// Data of a map, whose factor is known: by both solvers, in real time, from a saved solution and
/// from one of another grid.
#[test]
fn factor_from_data_by_name() -> Test {
    const N: usize = 6;
    let cost = || LeastSquaresCost::<Sizes>::diagonal(&[1.0; 3]);
    let problem = || {
        let mut ocp =
            Problem::new(Map::<Growth, f64>::new()).stage_cost(cost()).on(Horizon::uniform(N, 1.0))?;
        ocp.fix_initial_state(&[1.0, 1.0])?.set_parameters(.., &[0.5, f64::MAX])?;
        ocp.guess(&[1.0, 1.0], &[0.0])?.free("p[1]", .., 1.0)?;
        for k in 0..N {
            ocp.set_reference(k..=k, &[0.8_f64.powi(k as i32), 0.5_f64.powi(k as i32), 0.0])?;
        }
        Ok::<_, Box<dyn std::error::Error>>(ocp)
    };
    let mut ocp = problem()?;
    let text = ocp.to_string();
    assert!(text.contains("1 control u; 1 free parameter p[1]"), "{text}");
    assert!(HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?.is_converged());
    let solution = ocp.solution()?;
    assert!((solution.parameter("p[1]")?[0] - 0.8).abs() < 1e-7);
    assert_eq!(solution.parameter("p[0]")?[3], 0.5);
    let kinds = solution.series().iter().filter(|series| series.kind == Kind::Control);
    assert_eq!(kinds.map(|series| series.name.as_str()).collect::<Vec<_>>(), ["u"]);
    assert!(solution.csv().to_string().lines().next().is_some_and(|names| names.ends_with(",u,p[0],p[1]")));
    // The controls of a stage are those of the model.
    assert_eq!((ocp.stage(0)?.u.len(), ocp.stage(N)?.u.len()), (1, 0));

    let mut restored = problem()?;
    restored.restore(&solution)?;
    assert_eq!(restored.solution()?, solution);
    let mut guessed = problem()?;
    guessed.guess_from(&solution)?;
    assert_eq!(guessed.solution()?.parameter("p[1]")?, solution.parameter("p[1]")?);

    // A bound by name: data want more than it allows.
    ocp.bound("p[1]", .., 0.0, 0.7)?;
    assert!(ocp.to_string().contains("0 ≤ p[1] ≤ 0.7"), "{ocp}");
    assert!(HeapIpm::new(&ocp)?.solve(&mut ocp)?.is_converged());
    let bounded = ocp.solution()?;
    assert!((bounded.parameter("p[1]")?[0] - 0.7).abs() < 1e-6 && bounded.multiplier("p[1]")?[0] > 1e-3);

    let mut real_time = HeapRealTime::new(problem()?)?;
    for _ in 0..12 {
        let feedback = real_time.prepare()?.feedback(&[1.0, 1.0])?;
        assert_eq!(feedback.u.len(), 1);
    }
    assert!((real_time.ocp_mut().solution()?.parameter("p[1]")?[0] - 0.8).abs() < 1e-7);
    Ok(())
}

/// What cannot be is refused by name, and nothing is changed.
#[test]
fn invalid_arguments() -> Test {
    let mut ocp = Problem::new(Irk::<Spring, Gauss<2>>::new(Options::default())?)
        .running_cost(GeneralCost::<Effort>::new())
        .on(Horizon::uniform(4, 0.1))?;
    ocp.fix_initial_state(&[1.0, 0.0])?.guess(&[1.0, 0.0], &[0.0])?;
    let before = ocp.to_string();
    let mut refuse =
        |name: &str, range: [f64; 2], guess: f64| match ocp.free(name, range[0]..=range[1], guess) {
            Ok(_) => Err(format!("{name} {range:?} {guess} is accepted")),
            Err(error) => Ok(error),
        };
    let error = refuse("q", [0.0, 1.0], 0.5)?;
    assert!(matches!(error, OcpError::UnknownParameter { name, .. } if name.as_str() == "q"));
    assert_eq!(error.to_string(), "`Spring` has no parameter `q`: its parameters are `p`");
    let error = refuse("p", [1.0, 0.0], 0.5)?;
    assert!(matches!(error, OcpError::CrossedBounds { name: "p", .. }), "{error}");
    let error = refuse("p", [0.0, f64::NAN], 0.5)?;
    assert!(matches!(error, OcpError::InvalidValue { name: "p", .. }), "{error}");
    for guess in [2.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = refuse("p", [0.0, 1.0], guess)?;
        assert!(matches!(error, OcpError::OutOfRange { name: "p", .. }), "{error}");
    }
    assert_eq!(ocp.to_string(), before);
    // Bounds of a parameter that is given are no bounds.
    assert!(matches!(ocp.bound("p", .., 0.0, 1.0), Err(OcpError::UnknownName { .. })));
    // A solver of the problem before has other dimensions.
    let mut old = HeapSqp::new(&ocp)?;
    ocp.free("p", 0.0..=1.0, 0.5)?;
    assert!(matches!(old.solve(&mut ocp), Err(OcpError::Length { .. })));
    let mut sensitivities = Sensitivities::new(&ocp)?;
    let error = ocp.gains(&mut sensitivities).err();
    assert!(matches!(error, Some(OcpError::FreeParameters)), "{error:?}");
    // Free once more: another range and another guess.
    ocp.free("p", 0.0..=3.0, 2.0)?;
    let stage = ocp.solution()?;
    assert_eq!((stage.parameter("p")?[0], stage.get("p")?.upper[0]), (2.0, Some(3.0)));
    Ok(())
}
