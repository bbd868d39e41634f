//! Twenty problems of optimal control from plain guesses with default options, against IPOPT: its
//! minima and its iterations (`tests/data/ocp/collection.json`), and what is said of problems that
//! have no solution.

mod active_state_bounds;
mod guesses;
mod infeasible;
mod limits;
mod minimum_time_climb;
#[path = "../../examples/models/ocps/mod.rs"]
mod ocps;
mod problem_kinds;
mod restarts;
mod short_steps;
mod units;

use casados::ocp::{Exact, Formulation, HeapOcp, HeapSqp, Iteration, Outcome, Part, SecondOrder, Status};
use casados::qp::{Side, residuals};
use reference_data::Record;

type Test = Result<(), Box<dyn std::error::Error>>;

/// Solves with default options; returns the outcome and the iterations.
fn solve<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
    ocp: &mut HeapOcp<P>,
) -> Result<(Outcome, Vec<Iteration>), Box<dyn std::error::Error>> {
    let mut sqp = HeapSqp::new(ocp)?;
    let outcome = sqp.solve(ocp)?;
    println!("{}{outcome}", sqp.log());
    assert!(sqp.log().0.iter().all(|row| row.qp_iterations <= sqp.options.max_qp_iterations));
    // The bounds that are hard are as hard as they were, whatever happened.
    let linear = |b: casados::qp::Bounds<'_, f64>| b.lower_linear.iter().all(|p| p.is_infinite());
    assert!(ocp.qp().stages().all(|stage| linear(stage.x_bounds()) && linear(stage.u_bounds())));
    Ok((outcome, sqp.log().0.to_vec()))
}

/// A solution by default, judged element by element by code that is not the solver's; then a
/// better one, compared with a minimum of IPOPT's.
fn solved<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
    name: &str,
    ocp: &mut HeapOcp<P>,
) -> Result<Vec<Iteration>, Box<dyn std::error::Error>> {
    let (outcome, log) = solve(ocp)?;
    assert!(outcome.is_converged(), "{outcome}");
    ocp.linearise(Exact::default())?;
    let (judged, _) = residuals(ocp.qp(), ocp.iterate());
    assert!(judged.largest() <= 1e-6, "{judged}");

    let mut sqp = HeapSqp::new(ocp)?;
    sqp.options.tolerance = FINE_TOLERANCE;
    sqp.qp_solver.options.tolerance = 0.1 * FINE_TOLERANCE;
    let fine = sqp.solve(ocp)?;
    println!("{}{fine}", sqp.log());
    assert!(fine.is_converged(), "{fine}");
    let terms = objective_change_by_residuals(ocp);
    let record = Record::load("ocp/collection.json")?.record("problems")?.record(name)?;
    // IPOPT's tolerance is a tenth of ours.
    let tolerance = 1.1 * FINE_TOLERANCE * terms;
    let nearest =
        record.list("minima")?.into_iter().map(|f| (fine.objective - f).abs()).fold(f64::INFINITY, f64::min);
    println!("{name}: {nearest:e} from a minimum, {tolerance:e} allowed");
    assert!(nearest <= tolerance, "{} {nearest:e} {tolerance:e}", fine.objective);
    // Half as many again as IPOPT's, at most.
    let theirs = record.number("iterations")?;
    assert!(outcome.iterations as f64 <= 1.5 * theirs, "{outcome}");
    Ok(log)
}
const FINE_TOLERANCE: f64 = 1e-9;

/// What residuals of one change the objective by, to first order: gaps and violations by their
/// multipliers, complementarity by one for each bound.
fn objective_change_by_residuals<P: Formulation<f64>>(ocp: &HeapOcp<P>) -> f64 {
    let mut terms = 0.0;
    for stage in ocp.iterate().stages() {
        terms += stage.dynamics.iter().map(|pi| pi.abs()).sum::<f64>();
        for bounds in
            [stage.x_lower, stage.x_upper, stage.u_lower, stage.u_upper, stage.g_lower, stage.g_upper]
        {
            terms += bounds.iter().map(|lambda| 1.0 + lambda.abs()).sum::<f64>();
        }
    }
    terms
}

macro_rules! all_are_solved {
    ($($theme:ident::$name:ident),* $(,)?) => {$(
        #[test]
        fn $name() -> Test {
            solved(stringify!($name), &mut ocps::$theme::$name(ocps::GIVEN)?).map(drop)
        }
    )*};
}
ocps::each_ocp!(all_are_solved);

/// Algebraic states are eliminated stage by stage, so that both models have the same discrete map:
/// the same iterations and the same trajectories, to what the tolerance of the solver leaves.
#[test]
fn batch_reactor_with_algebraic_states() -> Test {
    let (mut implicit, mut explicit) = ocps::processes::batch_reactors(ocps::GIVEN)?;
    let ((dae, _), (ode, _)) = (solve(&mut implicit)?, solve(&mut explicit)?);
    assert!(dae.is_converged() && ode.is_converged() && dae.iterations == ode.iterations, "{dae} {ode}");
    for k in 0..implicit.intervals() {
        let (dae, ode) = (implicit.stage(k)?, explicit.stage(k)?);
        let x = dae.x.iter().zip(ode.x).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let u = (dae.u[0] / ode.u[0] - 1.0).abs();
        println!("{k}: {x:e} {u:e}");
        assert!(x < 1e-9 && u < 1e-6, "{k} {x:e} {u:e}");
    }
    // And that of IPOPT by another method of order four: ten times 0.025⁴ lie between them.
    let record = Record::load("ocp/collection.json")?.record("problems")?.record("batch_reactor")?;
    let minimum = record.list("minima")?.into_iter().fold(f64::INFINITY, f64::min);
    println!("{} {minimum}", dae.objective);
    assert!((dae.objective - minimum).abs() < 4e-6, "{} {minimum}", dae.objective);
    Ok(())
}

/// All of them in fewer iterations than IPOPT takes.
#[test]
fn total_iterations() -> Test {
    let record = Record::load("ocp/collection.json")?.record("problems")?;
    let (mut mine, mut theirs) = (0, 0.0);
    macro_rules! count {
        ($($theme:ident::$name:ident),* $(,)?) => {$(
            mine += solve(&mut ocps::$theme::$name(ocps::GIVEN)?)?.0.iterations;
            theirs += record.record(stringify!($name))?.number("iterations")?;
        )*};
    }
    ocps::each_ocp!(count);
    assert!(f64::from(u32::try_from(mine)?) <= theirs, "{mine} {theirs}");
    Ok(())
}

/// The last step needs no regularisation, and leaves less than a hundredth of the residuals.
#[test]
fn quadratic_convergence() -> Test {
    for log in [
        solve(&mut ocps::flight::quadrotor(ocps::GIVEN)?)?.1,
        solve(&mut ocps::vehicles::car(ocps::GIVEN)?)?.1,
    ] {
        assert!(log.len() <= 41);
        let [.., before, last] = &*log else { return Err("too short".into()) };
        assert!(last.regularisation == 0.0);
        assert!(last.residuals.largest() < 1e-2 * before.residuals.largest());
    }
    Ok(())
}

/// One second is not enough for 50 m from rest: the end is missed, and it is said by how much at
/// the iterate that is handed back.
#[test]
fn car_in_too_little_time() -> Test {
    let mut ocp = ocps::vehicles::car_within(1.0, ocps::GIVEN)?;
    let (outcome, _) = solve(&mut ocp)?;
    let Status::Infeasible { constraint, violation } = outcome.status else {
        return Err(outcome.to_string().into());
    };
    assert!(outcome.iterations < 50);
    let n = ocp.intervals();
    assert_eq!((constraint.part, constraint.stage, constraint.side), (Part::StateBounds, n, Side::Lower));
    // With an acceleration of 3 m/s² at most, the way in a second is below 1.5 m.
    assert_eq!(constraint.name, "x[0]");
    assert!((violation - (50.0 - ocp.stage(n)?.x[0])).abs() < 1e-12);
    assert!(violation > 48.5 && violation <= 50.0, "{violation}");
    Ok(())
}

/// Walls on opposite sides, three stages or 0.75 s apart: 3 m at a speed of 2 m/s at most.
#[test]
fn walls_on_opposite_sides() -> Test {
    let (outcome, _) = solve(&mut ocps::vehicles::walls(ocps::GIVEN)?)?;
    let Status::Infeasible { violation, .. } = outcome.status else {
        return Err(outcome.to_string().into());
    };
    // Both walls together are missed by 1.5 m at least, one of them by half of that.
    assert!(violation > 0.75 - 1e-3, "{violation}");
    Ok(())
}
