//! Problems with and without feasible points, told apart by clarabel: no verdict is false, and how
//! many iterations it takes is printed.

use crate::Test;
use crate::known_solutions::{HessianKind, Numbers, PLAIN, ProblemKind, problem};
use crate::runs::{case_multiplier, prints_verdicts};
use casados::qp::{Clarabel, HeapInteriorPoint, HeapQp, HeapSolution, QpError, QpSolver, QpStart, residuals};

const TOLERANCE: f64 = 1e-8;

/// Moves one or two bounds by 0.01 to 100, which other bounds may forbid.
pub fn move_bounds(random: &mut Numbers, qp: &mut HeapQp<f64>) -> Test {
    for _ in 0..1 + random.below(2) {
        let k = random.below(qp.dims().len());
        let (dims, up, distance) = (qp.dims()[k], random.chance(0.5), random.power(2.0));
        let mut stage = qp.stage_mut(k).ok_or("no stage")?;
        let (mut bounds, count) = if dims.ng > 0 && random.chance(0.5) {
            (stage.g_bounds_mut(), dims.ng)
        } else if k > 0 && random.chance(0.7) {
            (stage.x_bounds_mut(), dims.nx)
        } else {
            (stage.u_bounds_mut(), dims.nu)
        };
        if count == 0 {
            continue;
        }
        let i = random.below(count);
        let now = [bounds.lower[i], bounds.upper[i]].into_iter().find(|bound| bound.is_finite());
        let moved = now.unwrap_or(0.0) + if up { distance } else { -distance };
        if random.chance(0.3) {
            bounds.set(i, moved, moved);
        } else if up {
            bounds.set(i, moved, f64::INFINITY);
        } else {
            bounds.set(i, f64::NEG_INFINITY, moved);
        }
    }
    Ok(())
}

/// The median, the ninth tenth and the largest.
fn quantiles(mut iterations: Vec<usize>) -> String {
    iterations.sort_unstable();
    let at = |part: f64| iterations[(part * (iterations.len() - 1) as f64) as usize];
    format!("{} | {} | {} | {}", iterations.len(), at(0.5), at(0.9), at(1.0))
}

/// With at most thirty iterations, for a caller with ways out of its own: an infeasible problem is
/// said to be one, or nothing is said; and so is one feasible problem of a hundred, since
/// multipliers are nearly a proof only.
#[test]
fn check_iteration_limit() -> Test {
    const MAX_ITERATIONS: usize = 30;
    let (mut suspected, mut told, mut count) = ([0, 0], [0, 0], [0, 0]);
    for seed in 1..=400 {
        let mut random = Numbers::new(seed);
        let mut qp = problem(&mut random, &PLAIN)?.qp;
        if seed % 2 == 0 {
            move_bounds(&mut random, &mut qp)?;
        }
        let mut solution = HeapSolution::new(qp.dims())?;
        let feasible = match Clarabel::new().solve(qp.view(), QpStart::Cold, solution.view_mut()) {
            Ok(_) => 1,
            Err(QpError::Infeasible { .. }) => 0,
            Err(_) => continue,
        };
        let mut solver = HeapInteriorPoint::new();
        solver.limit(Some(MAX_ITERATIONS));
        let mut asked = 0;
        let mut over = || {
            asked += 1;
            false
        };
        let found = solver.solve_until(qp.view(), QpStart::Cold, solution.view_mut(), &mut over);
        assert!(asked <= MAX_ITERATIONS + 1, "{seed}: {asked}");
        count[feasible] += 1;
        match found {
            Ok(statistics) => {
                assert!(feasible == 1 && statistics.iterations <= MAX_ITERATIONS, "{seed}");
                let (r, _) = residuals(qp.view(), &solution);
                assert!(r.largest() < 1e2 * TOLERANCE, "{seed}: {r}");
                told[1] += 1;
            }
            Err(QpError::Infeasible { violation, .. }) => {
                assert!(violation > 0.0, "{seed}: {violation:e}");
                suspected[feasible] += 1;
                told[0] += 1;
            }
            Err(QpError::MaxIterations { .. } | QpError::Stalled { .. }) => {}
            Err(error) => return Err(format!("{seed}: {error}").into()),
        }
    }
    println!("{count:?} {told:?} {suspected:?}");
    assert!(count[0] >= 30 && count[1] >= 200, "{count:?}");
    assert!(100 * suspected[1] <= count[1], "{suspected:?} of {count:?}");
    assert!(5 * suspected[0] >= 4 * count[0], "{suspected:?} of {count:?}");
    Ok(())
}

/// Iterations are what the solver asks the clock for: errors have no number of them.
fn check_verdicts(name: &str, kind: &ProblemKind) -> Test {
    let (mut feasible, mut infeasible, mut given_up) = (Vec::new(), Vec::new(), 0);
    let count = 500 * case_multiplier() as usize;
    let mut seed = 0;
    while feasible.len() < count || infeasible.len() < count {
        seed += 1;
        let mut random = Numbers::new(seed);
        let mut qp = problem(&mut random, kind)?.qp;
        if feasible.len() >= count || random.chance(0.6) {
            move_bounds(&mut random, &mut qp)?;
        }
        let mut solution = HeapSolution::new(qp.dims())?;
        let oracle = Clarabel::new().solve(qp.view(), QpStart::Cold, solution.view_mut());
        let mut asked = 0;
        let mut over = || {
            asked += 1;
            false
        };
        let found =
            HeapInteriorPoint::new().solve_until(qp.view(), QpStart::Cold, solution.view_mut(), &mut over);
        if prints_verdicts() {
            println!("{name}, {seed}: {asked} {oracle:?} {found:?}");
        }
        match (oracle, found) {
            (Ok(_), Ok(_)) => {
                let (r, _) = residuals(qp.view(), &solution);
                assert!(r.largest() < 1e2 * TOLERANCE, "{name}, {seed}: {r}");
                feasible.push(asked);
            }
            (Err(QpError::Infeasible { .. }), Err(QpError::Infeasible { violation, .. })) => {
                assert!(violation > TOLERANCE, "{name}, {seed}: {violation:e}");
                infeasible.push(asked);
            }
            (Ok(_) | Err(QpError::Infeasible { .. }), Err(QpError::MaxIterations { .. })) => given_up += 1,
            (Ok(_) | Err(QpError::Infeasible { .. }), Err(QpError::Stalled { .. })) => given_up += 1,
            // Crossed bounds are refused, and what clarabel gives up says nothing.
            (_, Err(QpError::CrossedBounds { .. })) | (Err(_), _) => {}
            (oracle, found) => return Err(format!("{name}, {seed}: {oracle:?}, {found:?}").into()),
        }
    }
    println!("| {name} | feasible | {} |", quantiles(feasible));
    println!("| {name} | infeasible | {} |", quantiles(infeasible));
    assert!(given_up <= 2 * case_multiplier(), "{given_up}");
    Ok(())
}

#[test]
fn strictly_convex() -> Test {
    check_verdicts("strictly convex", &PLAIN)
}

#[test]
fn low_rank_and_degenerate() -> Test {
    check_verdicts(
        "low rank, degenerate",
        &ProblemKind { hessian: HessianKind::LowRank, degenerate: true, ..PLAIN },
    )
}
