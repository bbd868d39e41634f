//! The chain of masses against reference objectives and trajectories of independent
//! implementations: `tests/data/ocp`.

use crate::Test;
use crate::chain_model::Chain;
use crate::chain_problem;
use casados::__private::Scalar;
use casados::ocp::{Convexification, Exact, Globalisation, HeapSqp, Shooting};
use casados::prelude::*;
use casados::qp::{Condensing, HeapInteriorPoint};
use nalgebra::{SVector, Vector3};
use reference_data::Record;

/// The problem of a size with dynamics.
macro_rules! problem {
    ($nx:literal, $record:expr, $dynamics:expr) => {
        chain_problem::problem!($nx, $record.list("xrest")?, $record.list("x0")?, $dynamics)
    };
}

/// Gauss-Legendre of `S` stages, all intervals at once.
macro_rules! batch {
    ($nx:literal, $stages:literal, $steps:literal) => {
        Shooting::new(Batch::<Chain<$nx>, Gauss<$stages>>::new(Options {
            steps: $steps,
            ..Default::default()
        })?)
    };
}

/// Solved with full steps from the start that is known, in the number of iterations that is known.
macro_rules! solves {
    ($name:ident, $file:literal, $nx:literal, $stages:literal x $steps:literal, $key:literal, $iterations:literal) => {
        #[test]
        fn $name() -> Test {
            let record = Record::load($file)?;
            let mut ocp = problem!($nx, &record, batch!($nx, $stages, $steps));
            let solver = Condensing::new(5, HeapInteriorPoint::new());
            let mut sqp = HeapSqp::with_solver(&ocp, solver)?.gauss_newton();
            let outcome = sqp.solve(&mut ocp)?;
            println!("{}{outcome}", sqp.log());
            assert!(outcome.is_converged());
            assert_eq!(outcome.iterations, $iterations);
            let expected = record.number($key)?;
            // The references agree among themselves to eight digits where they have nine or ten.
            assert!((outcome.objective - expected).abs() < 1e-8 * expected, "{}", outcome.objective);
            Ok(())
        }
    };
}
solves!(three_masses, "ocp/chain_3.json", 9, 2 x 2, "objective_gl2x2", 6);
solves!(four_masses, "ocp/chain_4.json", 15, 2 x 2, "objective_gl2x2", 8);
solves!(five_masses, "ocp/chain_5.json", 21, 2 x 2, "objective_gl2x2", 7);
solves!(six_masses, "ocp/chain_6.json", 27, 2 x 2, "objective_gl2x2", 7);
solves!(seven_masses, "ocp/chain_7.json", 33, 2 x 2, "objective_gl2x2", 7);
solves!(three_masses_order_eight, "ocp/chain_3.json", 9, 4 x 4, "objective_gl4x4", 6);
solves!(seven_masses_order_eight, "ocp/chain_7.json", 33, 4 x 4, "objective_gl4x4", 7);

/// With an explicit method all intervals at once lead where one after the other do: functions
/// differ by rounding, and both solutions have residuals of `1e-10`. Multiplied by the inverse of
/// the Hessian, which is 0.004 for controls (`R Ts/2` twice) and 0.4 and more for states, that is
/// 2.5e-8 and 2.5e-10; twice, as each has its own.
#[test]
fn batches_of_explicit_methods() -> Test {
    let record = Record::load("ocp/chain_3.json")?;
    let options = Options { steps: 4, ..Default::default() };
    macro_rules! solution {
        ($dynamics:expr, $of:ident $(($argument:expr))?) => {{
            let mut ocp = problem!(9, &record, $dynamics);
            let mut sqp = HeapSqp::new(&ocp)?.$of($($argument)?);
            (sqp.options.tolerance, sqp.qp_solver.options.tolerance) = (1e-10, 1e-11);
            let outcome = sqp.solve(&mut ocp)?;
            assert!(outcome.is_converged(), "{outcome}");
            let stages: Vec<_> = ocp.iterate().stages().map(|s| (s.x.to_vec(), s.u.to_vec())).collect();
            (outcome.iterations, stages)
        }};
    }
    macro_rules! same {
        ($of:ident $(($argument:expr))?) => {{
            let together = Shooting::new(Batch::<Chain<9>, Rk4>::new(options)?);
            let (many, found) = solution!(together, $of $(($argument))?);
            let (one, expected) = solution!(Erk::<Chain<9>, Rk4>::new(options)?, $of $(($argument))?);
            // One more where the last residual is just above the tolerance.
            assert!(usize::abs_diff(many, one) <= 1, "{many} {one}");
            for (k, (found, expected)) in found.iter().zip(&expected).enumerate() {
                for (a, b) in found.0.iter().zip(&expected.0) {
                    assert!((a - b).abs() < 5e-10, "stage {k}: {a} {b}");
                }
                for (a, b) in found.1.iter().zip(&expected.1) {
                    assert!((a - b).abs() < 5e-8, "stage {k}: {a} {b}");
                }
            }
        }};
    }
    same!(gauss_newton);
    same!(exact(Exact { convexification: Convexification::Project }));
    Ok(())
}

/// A solver of QPs whose own tolerances are relative, and larger than what is asked for: it is told
/// what is needed.
#[test]
fn accuracy_of_clarabel() -> Test {
    let record = Record::load("ocp/chain_6.json")?;
    let mut ocp = problem!(27, &record, batch!(27, 2, 2));
    let mut sqp = HeapSqp::with_solver(&ocp, casados::qp::Clarabel::new())?.gauss_newton();
    sqp.options.tolerance = 1e-9;
    let outcome = sqp.solve(&mut ocp)?;
    println!("{}{outcome}", sqp.log());
    assert!(outcome.is_converged(), "{outcome}");
    let expected = record.number("objective_gl2x2")?;
    assert!((outcome.objective - expected).abs() < 1e-8 * expected, "{}", outcome.objective);
    Ok(())
}

/// The whole trajectory, where there is one.
macro_rules! follows {
    ($name:ident, $file:literal, $nx:literal) => {
        #[test]
        fn $name() -> Test {
            let record = Record::load($file)?;
            let mut ocp = problem!($nx, &record, batch!($nx, 2, 2));
            let mut sqp = HeapSqp::new(&ocp)?.gauss_newton();
            sqp.qp_solver.options.tolerance = 1e-10;
            sqp.options.tolerance = 1e-9;
            assert!(sqp.solve(&mut ocp)?.is_converged());
            let (x, u) = (record.numbers("X", 41 * $nx)?, record.numbers("U", 120)?);
            // The reference has a residual of 1e-6, and multiplied by the inverse of a Hessian of
            // 0.004 (R Ts/2 twice) that may be 2.5e-4 in `u`; in states, whose Hessian is 0.4 and
            // more, 2.5e-6.
            for (k, stage) in ocp.iterate().stages().enumerate() {
                for (a, b) in stage.x.iter().zip(&x[k * $nx..]) {
                    assert!((a - b).abs() < 2.5e-6, "stage {k}: {a} {b}");
                }
                for (a, b) in stage.u.iter().zip(&u[(k * 3).min(117)..]) {
                    assert!((a - b).abs() < 2.5e-4, "stage {k}: {a} {b}");
                }
            }
            Ok(())
        }
    };
}
follows!(trajectory_of_three_masses, "ocp/chain_3.json", 9);
follows!(trajectory_of_five_masses, "ocp/chain_5.json", 21);
follows!(trajectory_of_seven_masses, "ocp/chain_7.json", 33);

/// The same solution with the Hessian of the Lagrangian, whichever way it is made convex, with and
/// without line search.
#[test]
fn solution_with_exact_hessians() -> Test {
    let record = Record::load("ocp/chain_3.json")?;
    let expected = record.number("objective_gl2x2")?;
    for (convexification, globalisation) in [
        (Convexification::Project, Globalisation::FullStep),
        (Convexification::Mirror, Globalisation::FullStep),
        (Convexification::LevenbergMarquardt, Globalisation::FullStep),
        (Convexification::Project, Globalisation::Merit),
        (Convexification::Mirror, Globalisation::Filter),
    ] {
        let mut ocp = problem!(9, &record, batch!(9, 2, 2));
        let mut sqp = HeapSqp::new(&ocp)?.exact(Exact { convexification });
        sqp.options.globalisation = globalisation;
        let outcome = sqp.solve(&mut ocp)?;
        println!("{convexification:?} {globalisation:?}\n{}{outcome}", sqp.log());
        assert!(outcome.is_converged());
        assert!((outcome.objective - expected).abs() < 1e-8 * expected);
    }
    Ok(())
}

/// Gauss-Newton with line searches: the same solution.
#[test]
fn solution_with_line_searches() -> Test {
    let record = Record::load("ocp/chain_3.json")?;
    let expected = record.number("objective_gl2x2")?;
    for globalisation in [Globalisation::Merit, Globalisation::Filter] {
        let mut ocp = problem!(9, &record, batch!(9, 2, 2));
        let mut sqp = HeapSqp::new(&ocp)?.gauss_newton();
        sqp.options.globalisation = globalisation;
        let outcome = sqp.solve(&mut ocp)?;
        println!("{globalisation:?}\n{}{outcome}", sqp.log());
        assert!(outcome.is_converged());
        assert!((outcome.objective - expected).abs() < 1e-8 * expected);
    }
    Ok(())
}

/// Integrators of single intervals, on the heap and in static memory, give what a batch gives.
#[test]
fn solution_with_single_intervals() -> Test {
    let record = Record::load("ocp/chain_3.json")?;
    let expected = record.number("objective_gl2x2")?;
    let options = Options { steps: 2, ..Default::default() };
    let mut objectives = Vec::new();
    let mut ocp = problem!(9, &record, Irk::<Chain<9>, Gauss<2>>::new(options)?);
    objectives.push(HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?);
    type Small = Irk<Chain<9>, Gauss<2>, f64, Inline<casados::mode::Forward, 2>>;
    let mut ocp = problem!(9, &record, Small::inline(options)?);
    objectives.push(HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?);
    for outcome in objectives {
        assert!(outcome.is_converged() && outcome.iterations == 6);
        assert!((outcome.objective - expected).abs() < 1e-8 * expected);
    }
    Ok(())
}

/// At rest, velocities and accelerations are differences that cancel: all intervals are integrated
/// side by side nevertheless.
#[test]
fn steady_states() -> Test {
    let record = Record::load("ocp/chain_5.json")?;
    let mut ocp = problem!(21, &record, batch!(21, 2, 2));
    ocp.linearise(casados::ocp::GaussNewton::default())?;
    let statistics = *ocp.problem().dynamics.batch().statistics();
    assert_eq!((statistics.redone, statistics.alone, statistics.work.dense), (0, 0, 0));
    Ok(())
}

/// The conditions of optimality, with costs written by hand and derivatives of single integrations
/// by differences.
#[test]
fn independent_optimality_conditions() -> Test {
    const NX: usize = 9;
    let record = Record::load("ocp/chain_3.json")?;
    let mut ocp = problem!(9, &record, batch!(9, 2, 2));
    let mut sqp = HeapSqp::new(&ocp)?.gauss_newton();
    assert!(sqp.solve(&mut ocp)?.is_converged());
    let rest = record.vector::<NX>("xrest")?;
    let mut irk = Irk::<Chain<NX>, Gauss<2>>::new(Options { steps: 2, ..Default::default() })?;
    let weight = SVector::<f64, NX>::from_fn(|i, _| if (3..6).contains(&i) { 4.0 } else { 2.0 });
    let (ts, step) = (0.2, 1e-5);
    let stages: Vec<_> = ocp.iterate().stages().collect();
    let mut arriving = SVector::<f64, NX>::zeros();
    for (k, stage) in stages.iter().enumerate() {
        let x = SVector::<f64, NX>::from_column_slice(stage.x);
        let factor = if k < 40 { ts } else { 1.0 };
        let mut gradient = weight.component_mul(&(x - rest)) * factor - arriving;
        for i in 0..NX {
            gradient[i] += stage.x_upper[i] - stage.x_lower[i];
        }
        if let Some(next) = stages.get(k + 1) {
            let u = Vector3::from_column_slice(stage.u);
            let pi = SVector::<f64, NX>::from_column_slice(stage.dynamics);
            let mut phi = |x: &SVector<f64, NX>, u: &Vector3<f64>| irk.solve(x, u, ts).map(|end| end.x);
            let miss = phi(&x, &u)? - SVector::<f64, NX>::from_column_slice(next.x);
            assert!(miss.amax() < 1e-6);
            // Central differences: φ''' h² / 6 of 1e-10 and roundings of 1e-16 / h, times
            // multipliers of up to 10.
            for i in 0..NX {
                let d = SVector::<f64, NX>::from_fn(|j, _| if i == j { step } else { 0.0 });
                gradient[i] += pi.dot(&(phi(&(x + d), &u)? - phi(&(x - d), &u)?)) / (2.0 * step);
            }
            for i in 0..3 {
                let d = Vector3::from_fn(|j, _| if i == j { step } else { 0.0 });
                let dynamics = pi.dot(&(phi(&x, &(u + d))? - phi(&x, &(u - d))?)) / (2.0 * step);
                let bounds = stage.u_upper[i] - stage.u_lower[i];
                assert!((ts * 0.02 * u[i] + dynamics + bounds).abs() < 1.1e-6);
                assert!(u[i].abs() <= 1.0 + 1e-6);
                assert!(stage.u_upper[i] * (1.0 - u[i]) < 1e-6 && stage.u_lower[i] * (1.0 + u[i]) < 1e-6);
                assert!(stage.u_upper[i] >= 0.0 && stage.u_lower[i] >= 0.0);
            }
            arriving = pi;
        }
        assert!(gradient.amax() < 1.1e-6, "stage {k}: {gradient}");
        for i in [1, 4] {
            if (1..40).contains(&k) {
                assert!(x[i] >= -0.05 - 1e-6 && stage.x_lower[i] * Scalar::abs(x[i] + 0.05) < 1e-6);
            }
        }
    }
    Ok(())
}
