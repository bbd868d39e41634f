//! Random problems with a feasible point and convex objectives, against clarabel.
//!
//! `Infeasible` and `NotConvex` are false of each of them. What may happen is that a problem is
//! unbounded, or, of some in ten thousand, that the solver gives up: then it says what residuals it
//! reached, and so does a solver that never saw another problem.

use crate::known_solutions::{Numbers, numbers};
use crate::runs::{Counts, prints_verdicts, seeds};
use crate::{Test, solve_to};
use casados::qp::{
    Clarabel, Condensing, HeapInteriorPoint, HeapQp, HeapSolution, QpError, QpSolver, QpStart, QpStatistics,
    SecondOrderCone, StageDims, residuals,
};

const TOLERANCE: f64 = 1e-9;

/// A problem with a point inside of all hard bounds; Hessians are `G Gᵀ` of random `G`, singular in
/// a third of the stages.
fn problem(dims: &[StageDims], seed: u64) -> Result<HeapQp<f64>, QpError> {
    let mut random = Numbers::new(seed);
    let mut qp = HeapQp::<f64>::new(dims)?;
    let mut x: Vec<f64> = (0..dims[0].nx).map(|_| random.next()).collect();
    let x0 = x.clone();
    for (k, mut stage) in qp.stages_mut().enumerate() {
        let StageDims { nx, nu, ng } = dims[k];
        let n = nx + nu;
        let rank = if random.chance(0.33) { n.saturating_sub(1) } else { n + 1 };
        let g: Vec<f64> = (0..n * rank).map(|_| random.next()).collect();
        let h = |i: usize, j: usize| (0..rank).map(|c| g[c * n + i] * g[c * n + j]).sum::<f64>();
        stage.q_mut().fill_with(h);
        stage.r_mut().fill_with(|i, j| h(nx + i, nx + j) + if i == j { 1e-3 } else { 0.0 });
        stage.s_mut().fill_with(|i, j| h(nx + i, j));
        stage.gradient_x_mut().iter_mut().for_each(|q| *q = 3.0 * random.next());
        stage.gradient_u_mut().iter_mut().for_each(|r| *r = 3.0 * random.next());
        // Not far from stable: states of size 1, as the tolerances suppose.
        stage.a_mut().fill_with(|_, _| 0.4 * random.next());
        stage.b_mut().fill_with(|_, _| random.next());
        stage.offset_mut().iter_mut().for_each(|b| *b = 0.3 * random.next());
        stage.c_mut().fill_with(|_, _| random.next());
        stage.d_mut().fill_with(|_, _| random.next());
        let u: Vec<f64> = (0..nu).map(|_| random.next()).collect();
        let product = |block: casados::qp::Block<'_, f64>, v: &[f64], i: usize| {
            v.iter().enumerate().map(|(j, v)| block.get(i, j).unwrap_or(0.0) * v).sum::<f64>()
        };
        let c: Vec<f64> = (0..ng)
            .map(|i| product(stage.c_mut().as_block(), &x, i) + product(stage.d_mut().as_block(), &u, i))
            .collect();
        let next = dims.get(k + 1).map_or(0, |dims| dims.nx);
        let coming: Vec<f64> = (0..next)
            .map(|i| {
                let sum = product(stage.a_mut().as_block(), &x, i) + product(stage.b_mut().as_block(), &u, i);
                sum + stage.offset_mut()[i]
            })
            .collect();
        for kind in 0..3 {
            let (point, mut bounds) = match kind {
                0 => (&x, stage.x_bounds_mut()),
                1 => (&u, stage.u_bounds_mut()),
                _ => (&c, stage.g_bounds_mut()),
            };
            for (i, &point) in point.iter().enumerate() {
                let mut side = |sign: f64| {
                    let distance = sign * (0.05 + 0.5 * random.next().abs());
                    if random.chance(0.6) { point + distance } else { sign * f64::INFINITY }
                };
                let (lower, upper) = (side(-1.0), side(1.0));
                if kind < 2 || lower.is_finite() || upper.is_finite() {
                    bounds.set(i, lower, upper);
                }
                if random.chance(0.1) {
                    // Out of reach, and soft.
                    bounds.set(i, point + 5.0, f64::INFINITY);
                    bounds.soften(i, 0.5 + random.next().abs(), if random.chance(0.5) { 0.0 } else { 1.0 });
                } else if random.chance(0.1) {
                    bounds.set(i, point, point);
                }
            }
        }
        x = coming;
    }
    if random.chance(0.7) {
        qp.fix_initial_state(&x0)?;
    }
    Ok(qp)
}

/// How much of the objective one unit of a violated condition is worth, at least 1: the largest
/// multiplier.
fn violation_price(solution: &HeapSolution<f64>) -> f64 {
    let all = solution.stages().flat_map(|s| {
        [s.dynamics, s.x_lower, s.x_upper, s.u_lower, s.u_upper, s.g_lower, s.g_upper].into_iter().flatten()
    });
    all.fold(1.0, |largest: f64, multiplier| largest.max(multiplier.abs()))
}

fn dims(seed: u64) -> Vec<StageDims> {
    let mut random = Numbers::new(seed ^ 0xd1f0);
    let stages = 1 + random.below(6);
    (0..stages).map(|_| StageDims::new(1 + random.below(8), random.below(4), random.below(3))).collect()
}

fn solve_and_count(counts: &mut Counts, seed: u64, found: &Result<QpStatistics, QpError>) {
    counts.count_result(found);
    if prints_verdicts() && found.is_err() {
        println!("{counts} {seed}: {found:?}");
    }
}

/// Solves; a solver that never saw another problem says the same of what was not solved.
fn solve<S: QpSolver<f64>>(
    solver: &mut S,
    fresh: impl FnOnce() -> S,
    qp: &HeapQp<f64>,
    start: QpStart,
    solution: &mut HeapSolution<f64>,
) -> Result<QpStatistics, QpError> {
    let mut other = solution.clone();
    let found = solver.solve(qp.view(), start, solution.view_mut());
    match &found {
        Ok(_) => {
            let (r, _) = residuals(qp.view(), solution);
            assert!(r.largest() < 10.0 * TOLERANCE, "{r}");
        }
        Err(error) => {
            let again = fresh().solve(qp.view(), start, other.view_mut());
            assert_eq!(format!("{:?}", Err::<QpStatistics, _>(error)), format!("{again:?}"));
            assert!(numbers(solution).zip(numbers(&other)).all(|(a, b)| a.to_bits() == b.to_bits()));
        }
    }
    found
}

fn interior_point_options() -> HeapInteriorPoint<f64> {
    let mut solver = HeapInteriorPoint::new();
    solver.options.tolerance = TOLERANCE;
    solver
}

/// Products of slacks and multipliers of 1e-9, of at most 300 sides, leave 3e-7 of the objective.
fn assert_same_minimum(a: f64, b: f64, solution: &HeapSolution<f64>) -> bool {
    (a - b).abs() <= 3e-7 * violation_price(solution)
}

/// No verdict is false, and no more than one problem in a thousand is given up that has a solution.
fn assert_verdicts(counts: &Counts, unbounded: u64) {
    println!("{counts}");
    let given_up = counts.count_of_any(&["Stalled", "MaxIterations"]);
    assert_eq!(counts.count_of("Ok") + given_up, counts.all(), "{counts}");
    assert!(1000 * (given_up - unbounded) <= counts.all().max(1000), "{counts}");
}

/// Both find the same minimum.
#[test]
fn minimum_of_clarabel() -> Test {
    let (mut counts, mut unbounded) = (Counts::new("feasible, convex; beside clarabel"), 0);
    let mut solver = interior_point_options();
    for seed in seeds(200) {
        let dims = dims(seed);
        let qp = problem(&dims, seed)?;
        let mut solution = HeapSolution::new(&dims)?;
        let clarabel = Clarabel::new().solve(qp.view(), QpStart::Cold, solution.view_mut());
        let own = solve(&mut solver, interior_point_options, &qp, QpStart::Cold, &mut solution);
        solve_and_count(&mut counts, seed, &own);
        match (clarabel, own) {
            (Ok(clarabel), Ok(own)) => {
                let same = assert_same_minimum(clarabel.objective, own.objective, &solution);
                assert!(same, "{seed}: {clarabel:?} {own:?}");
            }
            // Free states at the start may make a problem unbounded.
            (Err(_), Err(_)) => unbounded += 1,
            // Clarabel gives up where a Hessian is singular sooner.
            _ => {}
        }
    }
    assert_verdicts(&counts, unbounded);
    Ok(())
}

/// The problem with eliminated states has the same minimum, and what is expanded satisfies the
/// conditions of optimality.
#[test]
fn condensing() -> Test {
    let mut counts = Counts::new("feasible, convex; states eliminated");
    for seed in seeds(100) {
        let dims = dims(!seed);
        let qp = problem(&dims, !seed)?;
        let Ok((_, expected, _)) = solve_to(TOLERANCE, &qp) else { continue };
        let fresh = || Condensing::new(1 + seed as usize % 4, interior_point_options());
        let mut solver = fresh();
        let mut solution = HeapSolution::new(&dims)?;
        for start in [QpStart::Cold, QpStart::Warm] {
            let found = solve(&mut solver, fresh, &qp, start, &mut solution);
            solve_and_count(&mut counts, seed, &found);
            let Ok(found) = found else { continue };
            let (_, objective) = residuals(qp.view(), &solution);
            assert!(assert_same_minimum(objective, expected.objective, &solution), "{seed}: {found:?}");
            // What it says of the objective includes what is constant in eliminated states.
            assert!(assert_same_minimum(objective, found.objective, &solution), "{seed}: {found:?}");
        }
    }
    assert_verdicts(&counts, 0);
    Ok(())
}

/// From the solution of a problem nearby, with other linear terms and another state at the start,
/// to the minimum that a cold start finds.
#[test]
fn warm_starts() -> Test {
    let mut counts = Counts::new("feasible, convex; from a solution nearby");
    let mut solver = interior_point_options();
    for seed in seeds(200) {
        let dims = dims(seed ^ (1 << 40));
        let mut qp = problem(&dims, seed ^ (1 << 40))?;
        let mut solution = HeapSolution::new(&dims)?;
        if solve(&mut solver, interior_point_options, &qp, QpStart::Cold, &mut solution).is_err() {
            continue;
        }
        disturb(&mut qp, seed, 10_f64.powi(-(seed as i32 % 4)))?;
        let Ok((_, cold, _)) = solve_to(TOLERANCE, &qp) else { continue };
        let warm = solve(&mut solver, interior_point_options, &qp, QpStart::Warm, &mut solution);
        solve_and_count(&mut counts, seed, &warm);
        if let Ok(warm) = warm {
            let (_, objective) = residuals(qp.view(), &solution);
            assert!(assert_same_minimum(objective, cold.objective, &solution), "{seed}: {warm:?} {cold:?}");
        }
    }
    assert_verdicts(&counts, 0);
    Ok(())
}

/// Other gradients, offsets, and state at the start.
fn disturb(qp: &mut HeapQp<f64>, seed: u64, scale: f64) -> Test {
    let mut random = Numbers::new(!seed);
    for mut stage in qp.stages_mut() {
        stage.gradient_x_mut().iter_mut().for_each(|q| *q += scale * random.next());
        stage.gradient_u_mut().iter_mut().for_each(|r| *r += scale * random.next());
        stage.offset_mut().iter_mut().for_each(|b| *b += 0.1 * scale * random.next());
    }
    let stage = qp.view().stage(0).ok_or("no stage")?;
    let bounds = stage.x_bounds();
    let mut x0 = bounds.lower.to_vec();
    if bounds.lower == bounds.upper {
        x0.iter_mut().for_each(|x| *x += 0.1 * scale * random.next());
        qp.fix_initial_state(&x0)?;
    }
    Ok(())
}

/// Most problems nearby are solved by active sets alone.
#[test]
fn active_sets_of_neighbouring_problems() -> Test {
    let (mut all, mut alone) = (0, 0);
    for seed in 0..200 {
        let dims: Vec<_> = (0..6).map(|k| StageDims::new(4, if k < 5 { 2 } else { 0 }, 1)).collect();
        let mut qp = problem(&dims, seed)?;
        let mut solver = HeapInteriorPoint::new();
        let mut solution = HeapSolution::new(&dims)?;
        if solver.solve(qp.view(), QpStart::Cold, solution.view_mut()).is_err() {
            continue;
        }
        disturb(&mut qp, seed, 0.01)?;
        let Ok(statistics) = solver.solve(qp.view(), QpStart::Warm, solution.view_mut()) else { continue };
        all += 1;
        alone += usize::from(statistics.active_sets == statistics.iterations);
    }
    println!("{alone} of {all}");
    assert!(all > 100 && 4 * alone > 3 * all, "{alone} of {all}");
    Ok(())
}

/// `min ½ |v − (3, 4)|²` in the cone `|v| ≤ 1`: the nearest point is `(0.6, 0.8)`.
#[test]
fn second_order_cone() -> Test {
    let mut qp = HeapQp::<f64>::new(&[StageDims::new(0, 2, 3)])?;
    let mut stage = qp.stage_mut(0).ok_or("no stage")?;
    stage.r_mut().set_diagonal([1.0, 1.0]);
    stage.gradient_u_mut().copy_from_slice(&[-3.0, -4.0]);
    // (0, u₀, u₁) − (−1, 0, 0) is in the cone.
    stage.d_mut().set(1, 0, 1.0);
    stage.d_mut().set(2, 1, 1.0);
    stage.g_bounds_mut().lower.copy_from_slice(&[-1.0, 0.0, 0.0]);
    let mut clarabel = Clarabel::new();
    clarabel.cones = vec![SecondOrderCone { stage: 0, first: 0, count: 3 }];
    let mut solution = HeapSolution::new(qp.dims())?;
    clarabel.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
    let u = solution.stage(0).ok_or("no stage")?.u;
    assert!((u[0] - 0.6).abs() < 1e-7 && (u[1] - 0.8).abs() < 1e-7, "{u:?}");
    clarabel.cones[0].count = 4;
    assert!(clarabel.solve(qp.view(), QpStart::Cold, solution.view_mut()).is_err());
    Ok(())
}

/// Clarabel's certificate names a constraint, and how large a violation must be at least.
#[test]
fn infeasibility_certificates_of_clarabel() -> Test {
    let mut qp = HeapQp::<f64>::new(&[StageDims::new(1, 0, 1)])?;
    let mut stage = qp.stage_mut(0).ok_or("no stage")?;
    stage.q_mut().set(0, 0, 1.0);
    stage.c_mut().set(0, 0, 1.0);
    stage.x_bounds_mut().set(0, f64::NEG_INFINITY, 0.0);
    stage.g_bounds_mut().set(0, 1.0, f64::INFINITY);
    let mut solution = HeapSolution::new(qp.dims())?;
    let found = Clarabel::new().solve(qp.view(), QpStart::Cold, solution.view_mut());
    // Half of the distance, on either side.
    assert!(
        matches!(found, Err(casados::qp::QpError::Infeasible { stage: 0, index: 0, violation, .. }) if (violation - 0.5).abs() < 1e-6),
        "{found:?}"
    );
    Ok(())
}
