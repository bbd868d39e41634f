//! Periodic states and shared controls: against one linear system, the limit cycle of a simulation,
//! the same problem with a state in place of a parameter, and data whose parameter is known.

use crate::Test;
use casados::ocp::{
    Constraint, Exact, Formulation, GeneralCost, HeapIpm, HeapOcp, HeapRealTime, HeapSqp, Horizon,
    LeastSquaresCost, Map, OcpError, Outcome, Problem, SecondOrder, Status,
};
use casados::prelude::*;
use casados::qp::{Condensing, HeapInteriorPoint, QpError, residuals};
use nalgebra::{DMatrix, DVector};

/// Who solves.
#[derive(Clone, Copy, Debug, PartialEq)]
enum By {
    Ipm,
    Sqp,
}

const BOTH_SOLVERS: [By; 2] = [By::Ipm, By::Sqp];

/// Solves, and checks the conditions of optimality by code that is not the solver's: the QP at the
/// iterate, element by element.
fn solve<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
    by: By,
    ocp: &mut HeapOcp<P>,
) -> Result<Outcome, Box<dyn std::error::Error>> {
    let (outcome, tolerance) = match by {
        By::Ipm => {
            let mut ipm = HeapIpm::new(ocp)?;
            let outcome = ipm.solve(ocp)?;
            assert_eq!(outcome.status, Status::Converged, "{outcome}\n{}", ipm.log());
            (outcome, ipm.options.tolerance)
        }
        By::Sqp => {
            let mut sqp = HeapSqp::new(ocp)?.exact(Exact::default());
            let outcome = sqp.solve(ocp)?;
            assert_eq!(outcome.status, Status::Converged, "{outcome}\n{}", sqp.log());
            (outcome, sqp.options.tolerance)
        }
    };
    let (judged, _) = residuals(ocp.qp(), ocp.iterate());
    assert!(judged.largest() <= tolerance, "{by:?} {judged}");
    Ok(outcome)
}

#[function]
fn drift(x: [f64; 2], u: [f64; 3]) -> [f64; 2] {
    [0.9 * x[0] + 0.5 * x[1] + u[1], -0.6 * x[0] + 1.3 * x[1] + u[0] + 0.3 * u[2]]
}

#[function]
fn place(x: [f64; 2], u: [f64; 3]) -> [f64; 5] {
    [x[0], 0.1 * x[1] + 0.2 * u[1], 0.3 * u[0], 0.5 * u[1] + 0.1 * x[0], 0.4 * u[2] - 0.2 * u[0]]
}

/// The conditions of optimality of a linear system with quadratic costs are one linear system,
/// which LU solves: with any of its controls shared, any of its states periodic, the first state
/// given or free.
#[test]
fn couplings_of_linear_systems() -> Test {
    const N: usize = 9;
    let reference = |k: usize| [if k < 5 { 1.0 } else { -0.4 }, 0.3, 0.1 * k as f64, -0.5, 0.2];
    let cases: [(&[usize], &[usize], bool); 7] = [
        (&[], &[1], true),
        (&[], &[1], false),
        (&[], &[0, 1, 2], true),
        (&[], &[0, 2], false),
        (&[0, 1], &[2], false),
        (&[1], &[1, 2], false),
        (&[1], &[1], true),
    ];
    for (periodic, shared, fixed) in cases {
        for by in BOTH_SOLVERS {
            let problem = Problem::new(Map::<Drift, f64>::new());
            let problem = problem.stage_cost(LeastSquaresCost::<Place>::diagonal(&[1.0; 5]));
            let mut ocp = problem.on(Horizon::uniform(N, 1.0))?;
            if fixed {
                ocp.fix_initial_state(&[0.4, -0.2])?;
            } else {
                ocp.free_initial_state();
            }
            periodic.iter().try_for_each(|i| ocp.periodic(&format!("x[{i}]")).map(|_| ()))?;
            shared.iter().try_for_each(|j| ocp.shared(&format!("u[{j}]")).map(|_| ()))?;
            for k in 0..N {
                ocp.set_reference(k..=k, &reference(k))?;
                // Guesses of shared controls are those of stage 0.
                ocp.guess_stage(k, &[0.1, 0.2], &[0.3, 0.1 * k as f64, 0.2])?;
            }
            ocp.guess_stage(N, &[0.7, 0.8], &[])?;
            let outcome = solve(by, &mut ocp)?;
            assert!(outcome.iterations <= 2, "{periodic:?} {shared:?} {by:?} {outcome}");

            let solution =
                solution_of_one_system(N, periodic, shared, fixed.then_some([0.4, -0.2]), reference)?;
            for k in 0..=N {
                let stage = ocp.stage(k)?;
                for (i, value) in stage.x.iter().chain(stage.u).enumerate() {
                    // The condition of the system is below 1e5; compliances leave 1e-9.
                    let error = (value - solution[5 * k + i]).abs();
                    assert!(error < 1e-8, "{periodic:?} {shared:?} {by:?} {k} {i} {error:e}");
                }
            }
            if !fixed {
                continue;
            }
            // One step in real time, from another point, is the solution of a linear system.
            ocp.guess(&[0.3, 0.9], &[0.2, -0.1, 0.4])?;
            let mut real_time = HeapRealTime::new(ocp)?;
            real_time.prepare()?.feedback(&[0.4, -0.2])?;
            for (k, stage) in real_time.ocp().iterate().stages().enumerate() {
                for (i, value) in stage.x.iter().chain(stage.u).enumerate() {
                    let error = (value - solution[5 * k + i]).abs();
                    assert!(error < 1e-7, "in real time: {periodic:?} {shared:?} {k} {i} {error:e}");
                }
            }
        }
    }
    Ok(())
}

/// Variables (x, u) of every stage, then multipliers.
fn solution_of_one_system(
    intervals: usize,
    periodic: &[usize],
    shared: &[usize],
    x0: Option<[f64; 2]>,
    reference: impl Fn(usize) -> [f64; 5],
) -> Result<DVector<f64>, &'static str> {
    let n = 5 * intervals + 2;
    let mut conditions: Vec<(Vec<(usize, f64)>, f64)> = Vec::new();
    let a = [[0.9, 0.5, 0.0, 1.0, 0.0], [-0.6, 1.3, 1.0, 0.0, 0.3]];
    for k in 0..intervals {
        for (i, row) in a.iter().enumerate() {
            let mut terms: Vec<_> = row.iter().enumerate().map(|(j, &a)| (5 * k + j, a)).collect();
            terms.push((5 * (k + 1) + i, -1.0));
            conditions.push((terms, 0.0));
        }
        for &j in shared.iter().filter(|_| k > 0) {
            conditions.push((vec![(5 * k + 2 + j, 1.0), (2 + j, -1.0)], 0.0));
        }
    }
    for &i in periodic {
        conditions.push((vec![(i, 1.0), (5 * intervals + i, -1.0)], 0.0));
    }
    for (i, x) in x0.into_iter().flatten().enumerate() {
        conditions.push((vec![(i, 1.0)], x));
    }
    let size = n + conditions.len();
    let (mut kkt, mut right) = (DMatrix::<f64>::zeros(size, size), DVector::<f64>::zeros(size));
    for (row, (terms, value)) in conditions.into_iter().enumerate() {
        for (column, factor) in terms {
            (kkt[(n + row, column)], kkt[(column, n + row)]) = (factor, factor);
        }
        right[n + row] = value;
    }
    let y = [
        [1.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.1, 0.0, 0.2, 0.0],
        [0.0, 0.0, 0.3, 0.0, 0.0],
        [0.1, 0.0, 0.0, 0.5, 0.0],
        [0.0, 0.0, -0.2, 0.0, 0.4],
    ];
    for k in 0..intervals {
        for (row, reference) in y.iter().zip(reference(k)) {
            for i in 0..5 {
                right[5 * k + i] += row[i] * reference;
                for j in 0..5 {
                    kkt[(5 * k + i, 5 * k + j)] += row[i] * row[j];
                }
            }
        }
    }
    kkt.lu().solve(&right).ok_or("singular")
}

/// Van der Pol's oscillator over one period of unknown length.
#[ode]
fn cycle(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [u[0] * x[1], u[0] * ((1.0 - x[0] * x[0]) * x[1] - x[0])]
}

#[function]
fn period(_x: [f64; 2], u: [f64; 1]) -> f64 {
    u[0]
}

/// Period and amplitude of van der Pol's equation with `μ = 1`, to 1e-12: simulated in Python from
/// maximum to maximum until both stay, RK4 with steps of 2e-3 and 1e-3, crossings by bisection.
const PERIOD: f64 = 6.66328685932;
const AMPLITUDE: f64 = 2.00861986087;

#[test]
fn limit_cycle() -> Test {
    for by in BOTH_SOLVERS {
        // Order eight over 60 intervals: errors are below 1e-10.
        let erk = Erk::<Cycle, DormandPrince8>::new(Options { steps: 4, ..Default::default() })?;
        let problem = Problem::new(erk).running_cost(GeneralCost::<Period>::new());
        let mut ocp = problem.on(Horizon::uniform(60, 1.0 / 60.0))?;
        ocp.free_initial_state().periodic("x")?.shared("u")?;
        ocp.bound("u", ..1, 5.0, 9.0)?.bound("x[1]", ..1, 0.0, 0.0)?.bound("x[0]", ..1, 0.5, 4.0)?;
        for k in 0..=60 {
            let (s, c) = (k as f64 * core::f64::consts::TAU / 60.0).sin_cos();
            ocp.guess_stage(k, &[2.0 * c, -2.0 * s], if k < 60 { &[6.3] } else { &[] })?;
        }
        let outcome = solve(by, &mut ocp)?;
        let first = ocp.stage(0)?;
        // What its tolerance leaves in the gaps: of the interior point 1e-8, else 1e-6.
        let tolerance = if by == By::Ipm { 1e-8 } else { 1e-6 };
        assert!((first.u[0] - PERIOD).abs() < tolerance, "{by:?} {outcome} {}", first.u[0]);
        assert!((first.x[0] - AMPLITUDE).abs() < tolerance, "{by:?} {}", first.x[0]);
        assert!((outcome.objective - PERIOD).abs() < tolerance, "{by:?} {outcome}");
    }
    Ok(())
}

/// A car, x = [position, heading, speed], u = [acceleration, curvature, duration].
#[ode]
fn car(x: [f64; 4], u: [f64; 3]) -> [f64; 4] {
    let [_, _, heading, speed] = x;
    let (s, c) = heading.sin_cos();
    [u[2] * speed * c, u[2] * speed * s, u[2] * speed * u[1], u[2] * u[0]]
}

#[function]
fn duration(_x: [f64; 4], u: [f64; 3]) -> f64 {
    u[2]
}

#[function]
fn distance(x: [f64; 4], _u: [f64; 3]) -> f64 {
    (x[0] - 5.0) * (x[0] - 5.0) + (x[1] - 0.2) * (x[1] - 0.2)
}

/// Objective of the same problem with the duration as a state (RK4, 40 intervals) by IPOPT 3.14
/// through CasADi 3.8.2, tolerance 1e-12, bounds not relaxed.
const REFERENCE_OBJECTIVE: f64 = 2.826135876986;

#[test]
fn free_end_time_as_shared_control() -> Test {
    for by in BOTH_SOLVERS {
        let erk = Erk::<Car, Rk4>::new(Options::default())?;
        let problem = Problem::new(erk)
            .running_cost(GeneralCost::<Duration>::new())
            .path_constraints(Constraint::<Distance>::new([1.0], [f64::INFINITY]));
        let mut ocp = problem.on(Horizon::uniform(40, 1.0 / 40.0))?;
        ocp.fix_initial_state(&[0.0, 0.0, 0.0, 1.0])?;
        ocp.bound("x[3]", 1.., 0.0, 5.0)?.bound("x[0]", 40.., 10.0, 10.0)?.bound("x[1]", 40.., 0.0, 0.0)?;
        ocp.bound("u[0]", .., -2.0, 2.0)?.bound("u[1]", .., -0.5, 0.5)?;
        ocp.shared("u[2]")?.bound("u[2]", ..1, 0.5, 50.0)?;
        for k in 0..=40 {
            let along = 10.0 * k as f64 / 40.0;
            let controls: &[f64] = if k < 40 { &[0.0, 0.0, 10.0] } else { &[] };
            ocp.guess_stage(k, &[along, 0.0, 0.0, 1.0], controls)?;
        }
        let outcome = solve(by, &mut ocp)?;
        assert!((outcome.objective - REFERENCE_OBJECTIVE).abs() < 1e-6, "{by:?} {outcome}");
        // Twice as many as IPOPT takes, with the duration as a state, at most.
        assert!(outcome.iterations <= 2 * 21, "{by:?} {outcome}");
        let of_first = ocp.stage(0)?.u[2];
        assert!((0..40).all(|k| ocp.stage(k).is_ok_and(|stage| stage.u[2] == of_first)));
    }
    Ok(())
}

/// A pendulum of unknown length and damping, whose angle is measured.
#[ode]
fn pendulum(x: [f64; 2], u: [f64; 2]) -> [f64; 2] {
    [x[1], -9.81 / u[0] * x[0].sin() - u[1] * x[1]]
}

#[function]
fn angle(x: [f64; 2], _u: [f64; 2]) -> f64 {
    x[0]
}

#[test]
fn parameters_from_exact_data() -> Test {
    let (length, damping, n) = (0.8, 0.3, 30);
    let mut truth = Erk::<Pendulum, Rk4>::new(Options::default())?;
    let mut x = nalgebra::vector![1.2, 0.0];
    let mut angles = Vec::new();
    for _ in 0..n {
        angles.push(x[0]);
        x = truth.solve(&x, &nalgebra::vector![length, damping], 0.1)?.x;
    }
    for by in BOTH_SOLVERS {
        let erk = Erk::<Pendulum, Rk4>::new(Options::default())?;
        let problem = Problem::new(erk).stage_cost(LeastSquaresCost::<Angle>::diagonal(&[1.0]));
        let mut ocp = problem.on(Horizon::uniform(n, 0.1))?;
        ocp.free_initial_state().shared("u")?.bound("u[0]", ..1, 0.2, 3.0)?.bound("u[1]", ..1, 0.0, 2.0)?;
        for (k, &angle) in angles.iter().enumerate() {
            ocp.set_reference(k..=k, &[angle])?.guess_stage(k, &[angle, 0.0], &[1.0, 0.1])?;
        }
        let outcome = solve(by, &mut ocp)?;
        let found = ocp.stage(0)?.u;
        // The costs vanish, so that multipliers do, too: bounds leave `μ ≤ 1e-9` over their slacks.
        assert!((found[0] - length).abs() < 1e-6 && (found[1] - damping).abs() < 1e-6, "{outcome} {found:?}");
        assert!(outcome.objective < 1e-12, "{outcome}");
    }
    Ok(())
}

#[test]
fn invalid_arguments() -> Test {
    let problem = Problem::new(Map::<Drift, f64>::new());
    let problem = problem.stage_cost(LeastSquaresCost::<Place>::diagonal(&[1.0; 5]));
    let mut ocp = problem.on(Horizon::uniform(3, 1.0))?;
    assert!(matches!(ocp.periodic("u[0]"), Err(OcpError::UnknownName { .. })));
    assert!(matches!(ocp.shared("x[0]"), Err(OcpError::UnknownName { .. })));
    // What condenses stages cannot couple them.
    ocp.fix_initial_state(&[0.0; 2])?.shared("u[1]")?.guess(&[1.0; 2], &[0.5; 3])?;
    let condensing = Condensing::new(2, HeapInteriorPoint::new());
    let outcome = HeapSqp::with_solver(&ocp, condensing)?.solve(&mut ocp)?;
    assert_eq!(outcome.status, Status::QpFailed(QpError::Coupled));
    Ok(())
}
