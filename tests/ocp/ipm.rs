//! The nonlinear interior point: against IPOPT, against closed forms, on periodic orbits and on
//! problems without a solution.

use crate::Test;
use casados::ocp::{
    Barrier, Constraint, Formulation, GeneralCost, HeapIpm, HeapOcp, Horizon, Ipm, IpmOptions,
    LeastSquaresCost, Map, OcpError, Part, Problem, SecondOrder, Status,
};
use casados::prelude::*;
use casados::qp::residuals;
use nalgebra::{DMatrix, DVector};

/// Solves, and checks the conditions of optimality by code that is not the solver's: the QP at the
/// iterate, element by element.
pub fn solve<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
    ocp: &mut HeapOcp<P>,
) -> Result<casados::ocp::Outcome, Box<dyn std::error::Error>> {
    let mut ipm = HeapIpm::new(ocp)?;
    let outcome = ipm.solve(ocp)?;
    assert_eq!(outcome.status, Status::Converged, "{outcome}\n{}", ipm.log());
    let (judged, _) = residuals(ocp.qp(), ocp.iterate());
    assert!(judged.largest() <= 1e-8, "{judged}");
    Ok(outcome)
}

/// A pendulum on a cart, M = 1, m = 0.1, l = 0.8, g = 9.81.
#[ode]
pub fn cart_pole(x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    let [_, theta, v, omega] = x;
    let (s, c) = theta.sin_cos();
    let d = 1.1 - 0.1 * c * c;
    [
        v,
        omega,
        (-0.08 * s * omega * omega + 0.981 * c * s + u[0]) / d,
        (-0.08 * c * s * omega * omega + u[0] * c + 1.1 * 9.81 * s) / (0.8 * d),
    ]
}

#[function]
pub fn effort(x: [f64; 4], u: [f64; 1]) -> f64 {
    1e-2 * (u[0] * u[0] + x[1] * x[1]) + 1e-3 * (x[0] * x[0] + x[2] * x[2] + x[3] * x[3])
}

/// Objective of the same problem (RK4 with two steps, 40 intervals of 0.05 s) by IPOPT 3.14 through
/// CasADi 3.8.2, tolerance 1e-12, bounds not relaxed.
const SWING_UP_OBJECTIVE: f64 = 21.742138737256;

pub fn swing_up()
-> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Box<dyn std::error::Error>> {
    let erk = Erk::<CartPole, Rk4>::new(Options { steps: 2, ..Default::default() })?;
    let problem = Problem::new(erk).stage_cost(GeneralCost::<Effort>::new());
    let mut ocp = problem.on(Horizon::uniform(40, 0.05))?;
    ocp.fix_initial_state(&[0.0, core::f64::consts::PI, 0.0, 0.0])?;
    ocp.bound("x", 40.., 0.0, 0.0)?;
    ocp.bound("u", .., -20.0, 20.0)?.bound("x[0]", 1..40, -1.5, 1.5)?;
    for k in 0..=40 {
        let angle = core::f64::consts::PI * (1.0 - k as f64 / 40.0);
        ocp.guess_stage(k, &[0.0, angle, 0.0, 0.0], if k < 40 { &[0.0] } else { &[] })?;
    }
    Ok(ocp)
}

#[test]
fn cart_pole_swings_up_from_a_straight_line() -> Test {
    for barrier in [Barrier::Monotone, Barrier::Adaptive] {
        let mut ocp = swing_up()?;
        let mut ipm = HeapIpm::new(&ocp)?;
        ipm.options.barrier = barrier;
        let outcome = ipm.solve(&mut ocp)?;
        println!("{barrier:?} {outcome}");
        // The barrier leaves `μ` for each of 158 bounds, of which the tolerance allows 1e-9.
        assert!(
            (outcome.objective - SWING_UP_OBJECTIVE).abs() < 1e-6,
            "{barrier:?} {outcome}\n{}",
            ipm.log()
        );
        assert!(outcome.is_converged() && residuals(ocp.qp(), ocp.iterate()).0.largest() <= 1e-8);
        // IPOPT takes 11.
        assert!(outcome.iterations <= 20, "{barrier:?} {outcome}");
    }
    Ok(())
}

/// From its own solution a warm start has nothing to do; from that of a problem nearby little.
#[test]
fn iterations_of_warm_starts() -> Test {
    let mut ocp = swing_up()?;
    let cold = solve(&mut ocp)?;
    let mut ipm = HeapIpm::new(&ocp)?;
    (ipm.options.warm_start, ipm.options.start_mu) = (true, 1e-8);
    let outcome = ipm.solve(&mut ocp)?;
    assert!(outcome.is_converged() && outcome.iterations <= 2, "{outcome}");
    ocp.fix_initial_state(&[0.02, core::f64::consts::PI, 0.0, 0.0])?;
    let outcome = ipm.solve(&mut ocp)?;
    assert!(outcome.is_converged() && 2 * outcome.iterations <= cold.iterations, "{outcome} {cold}");
    Ok(())
}

/// In memory that is given the run is the same, bit by bit; what is too short is refused.
#[test]
fn memory_of_the_caller() -> Test {
    let erk = Erk::<CartPole, Rk4>::new(Options { steps: 2, ..Default::default() })?;
    let problem = Problem::new(erk).stage_cost(GeneralCost::<Effort>::new());
    let (numbers, (of_solver, of_indices), dims) = lengths_of_memory(&problem);
    let mut memory = vec![0.0; numbers];
    let mut ocp = problem.on_horizon(Horizon::uniform(10, 0.05), &dims, &mut memory)?;
    let (mut memory, mut indices) = (vec![0.0; of_solver], vec![0; of_indices]);
    let short = memory.get_mut(1..).unwrap_or_default();
    let error = build(&ocp, &dims, short, &mut indices).err();
    assert!(matches!(error, Some(OcpError::Length { part: Part::Memory, .. })), "{error:?}");
    let mut ipm = build(&ocp, &dims, &mut memory, &mut indices)?;
    ocp.fix_initial_state(&[0.0, 0.3, 0.0, 0.0])?.bound("u", .., -20.0, 20.0)?.bound(
        "x[2]",
        10..,
        0.0,
        0.0,
    )?;
    ocp.guess(&[0.0; 4], &[0.0])?;
    let outcome = ipm.solve(&mut ocp)?;
    assert!(outcome.is_converged(), "{outcome}");

    let erk = Erk::<CartPole, Rk4>::new(Options { steps: 2, ..Default::default() })?;
    let problem = Problem::new(erk).stage_cost(GeneralCost::<Effort>::new());
    let mut other = problem.on(Horizon::uniform(10, 0.05))?;
    other.fix_initial_state(&[0.0, 0.3, 0.0, 0.0])?.bound("u", .., -20.0, 20.0)?.bound(
        "x[2]",
        10..,
        0.0,
        0.0,
    )?;
    other.guess(&[0.0; 4], &[0.0])?;
    let expected = HeapIpm::new(&other)?.solve(&mut other)?;
    assert_eq!((outcome.iterations, outcome.objective), (expected.iterations, expected.objective));
    for (a, b) in ocp.iterate().stages().zip(other.iterate().stages()) {
        assert_eq!((a.x, a.u, a.dynamics), (b.x, b.u, b.dynamics));
    }
    // One bound more than there is memory for.
    ocp.bound("x[0]", 5..6, -9.0, f64::INFINITY)?;
    assert!(matches!(ipm.solve(&mut ocp), Err(OcpError::Qp(_))));
    Ok(())
}

type Dims = [casados::qp::StageDims; 11];
type GivenIpm<'a> = Ipm<f64, &'a [casados::qp::StageDims], &'a mut [f64], &'a mut [u32]>;

/// Numbers of the problem, numbers and indices of the solver: 20 bounds and one equation.
fn lengths_of_memory<P: Formulation<f64> + InMemory>(_problem: &P) -> (usize, (usize, usize), Dims) {
    let dims = P::DIMS;
    (P::numbers(&dims), GivenIpm::memory::<P>(&dims, 20, 1), dims)
}

fn build<'a, P: Formulation<f64>, D, M>(
    _ocp: &casados::ocp::Ocp<P, f64, D, M>,
    dims: &'a [casados::qp::StageDims],
    numbers: &'a mut [f64],
    indices: &'a mut [u32],
) -> Result<GivenIpm<'a>, OcpError> {
    GivenIpm::in_memory::<P>(dims, 20, 1, numbers, indices)
}

/// What a problem says of itself.
trait InMemory {
    const DIMS: Dims;
    fn numbers(dims: &[casados::qp::StageDims]) -> usize;
}
impl<D, L, E, G, H> InMemory for Problem<D, L, E, G, H>
where
    Self: Formulation<f64>,
{
    const DIMS: Dims = Self::dims::<f64, 11>();
    fn numbers(dims: &[casados::qp::StageDims]) -> usize {
        Self::memory::<f64>(dims)
    }
}

/// Where rounding is in the way of the tolerance, what is acceptable is accepted.
#[test]
fn acceptable_points() -> Test {
    let mut ocp = swing_up()?;
    let mut ipm = HeapIpm::new(&ocp)?;
    ipm.options.tolerance = 1e-30;
    let outcome = ipm.solve(&mut ocp)?;
    assert_eq!(outcome.status, Status::Acceptable, "{outcome}\n{}", ipm.log());
    assert!(outcome.residuals.largest() < 1e-6 && outcome.iterations < 60, "{outcome}");
    Ok(())
}

/// A solver has the memory of the problem that it was made for.
#[test]
fn solver_of_another_problem() -> Test {
    let on = |intervals| -> Result<_, Box<dyn std::error::Error>> {
        let erk = Erk::<CartPole, Rk4>::new(Options { steps: 2, ..Default::default() })?;
        Ok(Problem::new(erk)
            .stage_cost(GeneralCost::<Effort>::new())
            .on(Horizon::uniform(intervals, 0.05))?)
    };
    let mut ipm = HeapIpm::new(&on(4)?)?;
    let mut other = on(5)?;
    other.fix_initial_state(&[0.0; 4])?;
    let error = ipm.solve(&mut other).err();
    let Some(OcpError::Length { part: Part::Dimensions, stage: 0, expected: 6, found: 5 }) = error else {
        return Err(format!("{error:?}").into());
    };
    Ok(())
}

/// A car, x = [position, heading, speed, duration], u = [acceleration, curvature].
#[ode]
fn car(x: [f64; 5], u: [f64; 2]) -> [f64; 5] {
    let [_, _, heading, speed, duration] = x;
    let (s, c) = heading.sin_cos();
    [duration * speed * c, duration * speed * s, duration * speed * u[1], duration * u[0], 0.0]
}

#[function]
fn duration(x: [f64; 5], _u: [f64; 2]) -> f64 {
    x[4]
}

#[function]
fn distance(x: [f64; 5], _u: [f64; 2]) -> f64 {
    (x[0] - 5.0) * (x[0] - 5.0) + (x[1] - 0.2) * (x[1] - 0.2)
}

/// As [`SWING_UP_OBJECTIVE`], of the car (RK4, 40 intervals).
const REFERENCE_OBJECTIVE: f64 = 2.826135876986;

fn race_problem(end: f64) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, OcpError> {
    let erk = Erk::<Car, Rk4>::new(Options::default())?;
    let problem = Problem::new(erk)
        .terminal_cost(GeneralCost::<Duration>::new())
        .path_constraints(Constraint::<Distance>::new([1.0], [f64::INFINITY]));
    let mut ocp = problem.on(Horizon::uniform(40, 1.0 / 40.0))?;
    ocp.free_initial_state();
    ocp.bound("x[3]", .., 0.0, 5.0)?.bound("x[4]", .., 0.5, end)?;
    for (name, value) in [("x[0]", 0.0), ("x[1]", 0.0), ("x[2]", 0.0), ("x[3]", 1.0)] {
        ocp.bound(name, ..1, value, value)?;
    }
    ocp.bound("x[0]", 40.., 10.0, 10.0)?.bound("x[1]", 40.., 0.0, 0.0)?;
    ocp.bound("u[0]", .., -2.0, 2.0)?.bound("u[1]", .., -0.5, 0.5)?;
    for k in 0..=40 {
        let along = 10.0 * k as f64 / 40.0;
        let controls: &[f64] = if k < 40 { &[0.0, 0.0] } else { &[] };
        ocp.guess_stage(k, &[along, 0.0, 0.0, 1.0, 10.0_f64.min(end)], controls)?;
    }
    Ok(ocp)
}

#[test]
fn minimum_time_car_around_a_disc() -> Test {
    for barrier in [Barrier::Monotone, Barrier::Adaptive] {
        let mut ocp = race_problem(50.0)?;
        let mut ipm = HeapIpm::new(&ocp)?;
        ipm.options.barrier = barrier;
        let outcome = ipm.solve(&mut ocp)?;
        println!("{barrier:?} {outcome}");
        assert!(
            (outcome.objective - REFERENCE_OBJECTIVE).abs() < 1e-6,
            "{barrier:?} {outcome}\n{}",
            ipm.log()
        );
        assert!(outcome.is_converged() && residuals(ocp.qp(), ocp.iterate()).0.largest() <= 1e-8);
        // IPOPT takes 21.
        assert!(outcome.iterations <= 30, "{barrier:?} {outcome}");
    }
    Ok(())
}

#[test]
fn infeasible_target() -> Test {
    // At most 5 m/s for one second do not make ten metres.
    let mut ocp = race_problem(1.0)?;
    let mut ipm = HeapIpm::new(&ocp)?;
    let outcome = ipm.solve(&mut ocp)?;
    let Status::Infeasible { constraint, violation } = outcome.status else {
        return Err(format!("{outcome}\n{}", ipm.log()).into());
    };
    assert!(violation > 1e-2, "{constraint} {violation}");
    Ok(())
}

#[function]
fn oscillate(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [0.9 * x[0] + 0.5 * x[1], -0.6 * x[0] + 1.3 * x[1] + u[0]]
}

#[function]
fn place(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [x[0], 0.3 * u[0]]
}

/// A linear system that is unstable, tracking a square wave around a period: the conditions of
/// optimality are one linear system, which LU solves.
#[test]
fn periodic_orbits_of_linear_systems() -> Test {
    const N: usize = 12;
    let reference = |k: usize| if k < 5 { 1.0 } else { -0.4 };
    for tied in [&["x"][..], &["x[1]"]] {
        let problem = Problem::new(Map::<Oscillate, f64>::new());
        let problem = problem.stage_cost(LeastSquaresCost::<Place>::diagonal(&[1.0; 2]));
        let mut ocp = problem.on(Horizon::uniform(N, 1.0))?;
        ocp.free_initial_state();
        tied.iter().try_for_each(|name| ocp.periodic(name).map(|_| ()))?;
        for k in 0..N {
            ocp.set_reference(k..=k, &[reference(k), 0.0])?;
        }
        ocp.guess(&[0.1, 0.2], &[0.3])?;
        let outcome = solve(&mut ocp)?;
        assert!(outcome.iterations <= 2, "{outcome}");

        // Variables (x, u) of every stage, then multipliers.
        let rows = 2 * N + if tied[0] == "x" { 2 } else { 1 };
        let n = 3 * N + 2;
        let mut kkt = DMatrix::<f64>::zeros(n + rows, n + rows);
        let mut right = DVector::<f64>::zeros(n + rows);
        let (a, b) = ([[0.9, 0.5], [-0.6, 1.3]], [0.0, 1.0]);
        let mut condition = |row: usize, column: usize, value: f64| {
            kkt[(n + row, column)] = value;
            kkt[(column, n + row)] = value;
        };
        for k in 0..N {
            for i in 0..2 {
                condition(2 * k + i, 3 * k, a[i][0]);
                condition(2 * k + i, 3 * k + 1, a[i][1]);
                condition(2 * k + i, 3 * k + 2, b[i]);
                condition(2 * k + i, 3 * (k + 1) + i, -1.0);
            }
        }
        for (row, i) in if tied[0] == "x" { vec![0, 1] } else { vec![1] }.into_iter().enumerate() {
            condition(2 * N + row, i, 1.0);
            condition(2 * N + row, 3 * N + i, -1.0);
        }
        for k in 0..N {
            (kkt[(3 * k, 3 * k)], kkt[(3 * k + 2, 3 * k + 2)]) = (1.0, 0.09);
            right[3 * k] = reference(k);
        }
        let solution = kkt.lu().solve(&right).ok_or("singular")?;
        for k in 0..=N {
            let stage = ocp.stage(k)?;
            for (i, value) in stage.x.iter().chain(stage.u).enumerate() {
                // The condition of the system is below 1e4.
                assert!((value - solution[3 * k + i]).abs() < 1e-10, "{k} {i}");
            }
        }
    }
    Ok(())
}

#[test]
fn invalid_arguments() -> Test {
    let problem =
        Problem::new(Map::<Oscillate, f64>::new()).stage_cost(LeastSquaresCost::<Place>::diagonal(&[1.0; 2]));
    let mut ocp = problem.on(Horizon::uniform(3, 1.0))?;
    assert!(matches!(ocp.periodic("y"), Err(OcpError::UnknownName { .. })));
    let mut ipm = HeapIpm::new(&ocp)?;
    assert!(matches!(ipm.solve(&mut ocp), Err(OcpError::Missing { part: Part::InitialState, .. })));
    ocp.free_initial_state().periodic("x")?;
    ipm.options = IpmOptions { tolerance: f64::NAN, ..ipm.options };
    assert!(matches!(ipm.solve(&mut ocp), Err(OcpError::InvalidOption { name: "tolerance", .. })));
    Ok(())
}
