//! Hessians from differences of gradients: published and exact solutions, judged element by element
//! by code that is not the solver's.

use crate::Test;
use casados::ocp::{
    Constraint, Formulation, GaussNewton, GeneralCost, HeapOcp, HeapSqp, Horizon, Map, Outcome, Problem,
    SecondOrder, Update, WithIntegral,
};
use casados::prelude::*;
use casados::qp::{HeapInteriorPoint, residuals};

const TOLERANCE: f64 = 1e-8;
const FREE: f64 = f64::INFINITY;
const BOTH: [Update; 2] = [Update::DampedBfgs, Update::RankOne];

/// Solves without second derivatives; judges the point by the first derivatives of its QP.
fn solved<P: Formulation<f64>>(
    ocp: &mut HeapOcp<P>,
    update: Update,
) -> Result<Outcome, Box<dyn std::error::Error>> {
    let mut sqp = HeapSqp::new(ocp)?.secant(update)?;
    sqp.options.tolerance = TOLERANCE;
    let outcome = sqp.solve(ocp)?;
    println!("{}{outcome}", sqp.log());
    assert!(outcome.is_converged(), "{outcome}");
    ocp.linearise(GaussNewton::default())?;
    let (judged, _) = residuals(ocp.qp(), ocp.iterate());
    assert!(judged.largest() <= 1.1 * TOLERANCE, "{judged}");
    Ok(outcome)
}

/// The solution with exact Hessians, to a tolerance far below the other one.
fn exact<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
    ocp: &mut HeapOcp<P>,
) -> Result<Outcome, Box<dyn std::error::Error>> {
    let mut sqp = HeapSqp::new(ocp)?;
    sqp.options.tolerance = 1e-2 * TOLERANCE;
    let outcome = sqp.solve(ocp)?;
    assert!(outcome.is_converged(), "{outcome}");
    Ok(outcome)
}

fn variables<P: Formulation<f64>>(ocp: &HeapOcp<P>) -> Vec<f64> {
    ocp.iterate().stages().flat_map(|stage| [stage.x, stage.u].concat()).collect()
}

/// The same point and objective as with exact Hessians.
fn agrees<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
    mut make: impl FnMut() -> Result<HeapOcp<P>, Box<dyn std::error::Error>>,
    most: [usize; 2],
) -> Test {
    let mut one = make()?;
    let expected = exact(&mut one)?;
    for (update, most) in BOTH.into_iter().zip(most) {
        let mut other = make()?;
        let found = solved(&mut other, update)?;
        println!("{update:?}: {} iterations, {} with exact Hessians", found.iterations, expected.iterations);
        assert!(found.iterations <= most, "{update:?}: {}", found.iterations);
        let pairs = variables(&one).into_iter().zip(variables(&other));
        let worst = pairs.fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()));
        assert!(worst < 1e-5, "{update:?}: {worst}");
        assert!((found.objective - expected.objective).abs() < 1e-7 * (1.0 + expected.objective.abs()));
    }
    Ok(())
}

/// Nothing happens in an interval: all that there is are a first state and a control.
#[function]
fn stays(x: [f64; 2], _u: [f64; 2]) -> [f64; 2] {
    x
}

/// Problem 71 of W. Hock, K. Schittkowski, "Test examples for nonlinear programming codes", 1981.
#[function]
fn hs71(x: [f64; 2], u: [f64; 2]) -> f64 {
    x[0] * u[1] * (x[0] + x[1] + u[0]) + u[0]
}
#[function]
fn hs71_constraints(x: [f64; 2], u: [f64; 2]) -> [f64; 2] {
    [x[0] * x[1] * u[0] * u[1], x[0] * x[0] + x[1] * x[1] + u[0] * u[0] + u[1] * u[1]]
}

#[test]
fn hock_schittkowski_71() -> Test {
    for update in BOTH {
        let mut ocp = Problem::new(Map::<Stays, f64>::new())
            .stage_cost(GeneralCost::<Hs71>::new())
            .path_constraints(Constraint::<Hs71Constraints>::new([25.0, 40.0], [FREE, 40.0]))
            .on(Horizon::uniform(1, 1.0))?;
        ocp.free_initial_state().bound("x", 0..=0, 1.0, 5.0)?.bound("u", .., 1.0, 5.0)?;
        ocp.guess(&[1.0, 5.0], &[5.0, 1.0])?;
        let outcome = solved(&mut ocp, update)?;
        assert!((outcome.objective - 17.0140173).abs() < 1e-7, "{}", outcome.objective);
        let point = ocp.stage(0)?;
        for (found, published) in
            point.x.iter().chain(point.u).zip([1.0, 4.742_999_4, 3.821_150_3, 1.379_408_2])
        {
            assert!((found - published).abs() < 1e-6, "{found} {published}");
        }
    }
    Ok(())
}

/// Problem 43 of the same (Rosen and Suzuki): −44 at (0, 1, 2, −1).
#[function]
fn hs43(x: [f64; 2], u: [f64; 2]) -> f64 {
    x[0] * x[0] + x[1] * x[1] + 2.0 * u[0] * u[0] + u[1] * u[1] - 5.0 * x[0] - 5.0 * x[1] - 21.0 * u[0]
        + 7.0 * u[1]
}
#[function]
fn hs43_constraints(x: [f64; 2], u: [f64; 2]) -> [f64; 3] {
    let [a, b, c, d] = [x[0], x[1], u[0], u[1]];
    [
        a * a + b * b + c * c + d * d + a - b + c - d,
        a * a + 2.0 * b * b + c * c + 2.0 * d * d - a - d,
        2.0 * a * a + b * b + c * c + 2.0 * a - b - d,
    ]
}

#[test]
fn hock_schittkowski_43() -> Test {
    for update in BOTH {
        let mut ocp = Problem::new(Map::<Stays, f64>::new())
            .stage_cost(GeneralCost::<Hs43>::new())
            .path_constraints(Constraint::<Hs43Constraints>::new([-FREE; 3], [8.0, 10.0, 5.0]))
            .on(Horizon::uniform(1, 1.0))?;
        ocp.free_initial_state().guess(&[0.0; 2], &[0.0; 2])?;
        let outcome = solved(&mut ocp, update)?;
        assert!((outcome.objective + 44.0).abs() < 1e-6, "{}", outcome.objective);
        let point = ocp.stage(0)?;
        for (found, expected) in point.x.iter().chain(point.u).zip([0.0, 1.0, 2.0, -1.0]) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
    }
    Ok(())
}

/// A pendulum that is balanced: dynamics curve, and their Hessian is indefinite.
#[ode]
fn swing(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [x[1], 9.81 * x[0].sin() + u[0] * x[0].cos()]
}
#[function]
fn effort(x: [f64; 2], u: [f64; 1]) -> f64 {
    5.0 * (1.0 - x[0].cos()) + 0.1 * x[1] * x[1] + 0.01 * u[0] * u[0]
}

fn erk() -> Result<Erk<Swing, Rk4>, casados::Error> {
    Erk::<Swing, Rk4>::new(Options::default())
}

#[test]
fn balanced_pendulum() -> Test {
    agrees(
        || {
            let mut ocp = Problem::new(erk()?)
                .running_cost(GeneralCost::<Effort>::new())
                .on(Horizon::uniform(20, 0.05))?;
            ocp.fix_initial_state(&[0.8, 0.0])?.bound("u", .., -15.0, 15.0)?.guess(&[0.0, 0.0], &[0.0])?;
            Ok(ocp)
        },
        [20, 20],
    )
}

/// The cost as an integral, whose Hessian no first-order method knows.
#[test]
fn costs_that_are_integrals() -> Test {
    agrees(
        || {
            let cost = Quadrature::<Effort, f64>::new();
            let mut ocp = Problem::new(WithIntegral::new(erk()?, cost)).on(Horizon::uniform(20, 0.05))?;
            ocp.fix_initial_state(&[0.8, 0.0])?.bound("u", .., -15.0, 15.0)?.guess(&[0.0, 0.0], &[0.0])?;
            Ok(ocp)
        },
        [20, 20],
    )
}

/// A mass in the shortest time, which is a control that all stages share; no cost curves.
#[ode]
fn hurried(x: [f64; 2], u: [f64; 2]) -> [f64; 2] {
    [u[1] * x[1], u[1] * (u[0] - 0.1 * x[1] * x[1])]
}
#[function]
fn time_and_effort(_x: [f64; 2], u: [f64; 2]) -> f64 {
    u[1] + 1e-2 * u[0] * u[0]
}

#[test]
fn shared_duration() -> Test {
    agrees(
        || {
            let mut ocp = Problem::new(Erk::<Hurried, Rk4>::new(Options::default())?)
                .running_cost(GeneralCost::<TimeAndEffort>::new())
                .on(Horizon::uniform(20, 0.05))?;
            ocp.free_initial_state().shared("u[1]")?.bound("x", 0..=0, 0.0, 0.0)?;
            ocp.bound("x[0]", 20..=20, 2.0, 2.0)?.bound("x[1]", 20..=20, 0.0, 0.0)?;
            ocp.bound("u[0]", .., -1.0, 1.0)?.bound("u[1]", .., 0.1, 10.0)?;
            ocp.guess(&[1.0, 0.5], &[0.0, 3.0])?;
            Ok(ocp)
        },
        [20, 20],
    )
}

/// A forced oscillator on a periodic orbit.
#[ode]
fn driven(x: [f64; 2], u: [f64; 1], t: f64) -> [f64; 2] {
    [x[1], -x[0] - 0.3 * x[0] * x[0] * x[0] - 0.2 * x[1] + t.sin() + u[0]]
}
#[function]
fn tracking(x: [f64; 2], u: [f64; 1]) -> f64 {
    (x[0] - 0.3).powi(4) + x[1] * x[1] + u[0] * u[0]
}

#[test]
fn periodic_states() -> Test {
    agrees(
        || {
            let n = 20;
            let mut ocp = Problem::new(Erk::<Driven, Rk4>::new(Options { steps: 2, ..Options::default() })?)
                .running_cost(GeneralCost::<Tracking>::new())
                .on(Horizon::uniform(n, core::f64::consts::TAU / n as f64))?;
            ocp.free_initial_state().periodic("x")?.guess(&[0.3, 0.0], &[0.0])?;
            Ok(ocp)
        },
        [20, 20],
    )
}

/// In memory that is given: an error where there is none for what is remembered, else the same
/// iterations as on the heap.
#[test]
fn given_memory() -> Test {
    type Balance = Problem<Map<Stays, f64>, GeneralCost<Hs43>>;
    use casados::ocp::{OcpError, Sqp};
    let make = || -> Result<_, Box<dyn std::error::Error>> {
        let mut ocp = Problem::new(Map::<Stays, f64>::new())
            .stage_cost(GeneralCost::<Hs43>::new())
            .on(Horizon::uniform(1, 1.0))?;
        ocp.free_initial_state().guess(&[0.0; 2], &[0.0; 2])?;
        Ok(ocp)
    };
    let mut heap = make()?;
    let expected = solved(&mut heap, Update::DampedBfgs)?;
    let dims = Balance::dims::<f64, 2>();
    let length = Sqp::<HeapInteriorPoint, _, f64, _, _>::memory::<Balance>(&dims);
    let history = Sqp::<HeapInteriorPoint, _, f64, _, _>::memory_of_secant(&dims);
    for (more, is_enough) in [(history - 1, false), (history, true)] {
        let mut memory = vec![0.0; length + more];
        let sqp = Sqp::in_memory::<Balance>(HeapInteriorPoint::new(), &dims, &mut memory)?;
        let sqp = sqp.secant(Update::DampedBfgs);
        if !is_enough {
            assert!(matches!(sqp, Err(OcpError::Qp(_))));
            continue;
        }
        let mut of_problem = vec![0.0; Balance::memory::<f64>(&dims)];
        let mut ocp = Problem::new(Map::<Stays, f64>::new())
            .stage_cost(GeneralCost::<Hs43>::new())
            .on_horizon(Horizon::uniform(1, 1.0), &dims, &mut of_problem)?;
        ocp.free_initial_state().guess(&[0.0; 2], &[0.0; 2])?;
        let mut sqp = sqp?;
        sqp.options.tolerance = TOLERANCE;
        let found = sqp.solve(&mut ocp)?;
        assert_eq!((found.iterations, found.objective), (expected.iterations, expected.objective));
    }
    Ok(())
}
