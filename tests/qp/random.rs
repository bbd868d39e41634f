//! Random problems against clarabel.

use crate::solve_to;
use casados::qp::{
    Clarabel, Condensing, HeapInteriorPoint, HeapQp, HeapSolution, QpSolver, SecondOrderCone, StageDims,
    Start, residuals,
};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// The same problems in every run: with others, one in some thousands is beyond the most
/// iterations.
fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: RngSeed::Fixed(1),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// Numbers from a seed: a problem has too many for proptest to shrink.
struct Numbers(u64);

impl Numbers {
    /// In −1 .. 1.
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
    fn chance(&mut self, probability: f64) -> bool {
        self.next() * 0.5 + 0.5 < probability
    }
}

/// A problem with a point inside of all hard bounds; Hessians are `G Gᵀ` of random `G`, singular in
/// a third of the stages.
fn problem(dims: &[StageDims], seed: u64) -> Result<HeapQp<f64>, Box<dyn std::error::Error>> {
    let mut random = Numbers(seed);
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
fn size(solution: &HeapSolution<f64>) -> f64 {
    let all = solution.stages().flat_map(|s| {
        [s.dynamics, s.x_lower, s.x_upper, s.u_lower, s.u_upper, s.g_lower, s.g_upper].into_iter().flatten()
    });
    all.fold(1.0, |largest: f64, multiplier| largest.max(multiplier.abs()))
}

fn dims() -> impl Strategy<Value = Vec<StageDims>> {
    let stage = (1..9usize, 0..4usize, 0..3usize).prop_map(|(nx, nu, ng)| StageDims::new(nx, nu, ng));
    proptest::collection::vec(stage, 1..7)
}

proptest! {
    #![proptest_config(config(200))]

    /// Both find the same minimum. Products of slacks and multipliers of 1e-9, of at most 300
    /// sides, leave 3e-7 of the objective.
    #[test]
    fn same_minimum_as_clarabel(dims in dims(), seed: u64) {
        let qp = problem(&dims, seed).map_err(|e| TestCaseError::fail(e.to_string()))?;
        let mut solution = HeapSolution::new(&dims).map_err(|e| TestCaseError::fail(e.to_string()))?;
        let clarabel = Clarabel::new().solve(qp.view(), Start::Cold, solution.view_mut());
        let own = solve_to(1e-9, &qp);
        match (clarabel, own) {
            (Ok(clarabel), Ok((found, own, _))) => {
                let difference = (clarabel.objective - own.objective).abs();
                prop_assert!(difference <= 3e-7 * size(&found), "{clarabel:?} {own:?}");
            }
            // Free states at the start may make a problem unbounded; and clarabel gives up where a
            // Hessian is singular sooner. The residuals of what was found have been looked at.
            (Err(_), _) => {}
            (clarabel, own) => prop_assert!(false, "{clarabel:?} {:?}", own.map(|own| own.1)),
        }
    }
}

proptest! {
    #![proptest_config(config(100))]

    /// The problem with eliminated states has the same minimum, and what is expanded satisfies the
    /// conditions of optimality.
    #[test]
    fn condensed_is_uncondensed(dims in dims(), seed: u64, block in 1..5usize) {
        let fail = |e: &dyn std::fmt::Display| TestCaseError::fail(e.to_string());
        let qp = problem(&dims, seed).map_err(|e| fail(&e))?;
        let Ok((_, expected, _)) = solve_to(1e-9, &qp) else { return Ok(()) };
        let mut solver = Condensing::new(block, HeapInteriorPoint::new());
        solver.solver.options.tolerance = 1e-9;
        let mut solution = HeapSolution::new(&dims).map_err(|e| fail(&e))?;
        for start in [Start::Cold, Start::Warm] {
            let found = solver.solve(qp.view(), start, solution.view_mut()).map_err(|e| fail(&e))?;
            let (residuals, objective) = residuals(qp.view(), &solution);
            prop_assert!(residuals.largest() < 1e-8, "{residuals} {found:?}");
            prop_assert!((objective - expected.objective).abs() <= 3e-7 * size(&solution));
            // What it says of the objective includes what is constant in eliminated states.
            prop_assert!((objective - found.objective).abs() <= 3e-7 * size(&solution), "{found:?}");
        }
    }
}

proptest! {
    #![proptest_config(config(200))]

    /// From the solution of a problem nearby, with other linear terms and another state at the
    /// start, to the minimum that a cold start finds.
    #[test]
    fn warm_is_cold(dims in dims(), seed: u64, distance in 0..4_i32) {
        let fail = |e: &dyn std::fmt::Display| TestCaseError::fail(e.to_string());
        let mut qp = problem(&dims, seed).map_err(|e| fail(&e))?;
        let mut solver = HeapInteriorPoint::new();
        solver.options.tolerance = 1e-9;
        let mut solution = HeapSolution::new(&dims).map_err(|e| fail(&e))?;
        if solver.solve(qp.view(), Start::Cold, solution.view_mut()).is_err() {
            return Ok(());
        }
        disturb(&mut qp, seed, 10_f64.powi(-distance)).map_err(|e| fail(&*e))?;
        let Ok((_, cold, _)) = solve_to(1e-9, &qp) else { return Ok(()) };
        let warm = solver.solve(qp.view(), Start::Warm, solution.view_mut()).map_err(|e| fail(&e))?;
        let (residuals, objective) = residuals(qp.view(), &solution);
        prop_assert!(residuals.largest() < 1e-8, "{residuals} {warm:?}");
        prop_assert!((objective - cold.objective).abs() <= 3e-7 * size(&solution), "{warm:?} {cold:?}");
    }
}

/// Other gradients, offsets, and state at the start.
fn disturb(qp: &mut HeapQp<f64>, seed: u64, scale: f64) -> Result<(), Box<dyn std::error::Error>> {
    let mut random = Numbers(!seed);
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
fn few_active_sets_lie_between_neighbours() -> crate::Test {
    let (mut all, mut alone) = (0, 0);
    for seed in 0..200 {
        let dims: Vec<_> = (0..6).map(|k| StageDims::new(4, if k < 5 { 2 } else { 0 }, 1)).collect();
        let mut qp = problem(&dims, seed)?;
        let mut solver = HeapInteriorPoint::new();
        let mut solution = HeapSolution::new(&dims)?;
        if solver.solve(qp.view(), Start::Cold, solution.view_mut()).is_err() {
            continue;
        }
        disturb(&mut qp, seed, 0.01)?;
        let Ok(statistics) = solver.solve(qp.view(), Start::Warm, solution.view_mut()) else { continue };
        all += 1;
        alone += usize::from(statistics.active_sets == statistics.iterations);
    }
    println!("{alone} of {all}");
    assert!(all > 100 && 4 * alone > 3 * all, "{alone} of {all}");
    Ok(())
}

/// `min ½ |v − (3, 4)|²` in the cone `|v| ≤ 1`: the nearest point is `(0.6, 0.8)`.
#[test]
fn second_order_cone() -> crate::Test {
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
    clarabel.solve(qp.view(), Start::Cold, solution.view_mut())?;
    let u = solution.stage(0).ok_or("no stage")?.u;
    assert!((u[0] - 0.6).abs() < 1e-7 && (u[1] - 0.8).abs() < 1e-7, "{u:?}");
    clarabel.cones[0].count = 4;
    assert!(clarabel.solve(qp.view(), Start::Cold, solution.view_mut()).is_err());
    Ok(())
}

/// Clarabel's certificate names a constraint, and how large a violation must be at least.
#[test]
fn clarabel_finds_what_is_infeasible() -> crate::Test {
    let mut qp = HeapQp::<f64>::new(&[StageDims::new(1, 0, 1)])?;
    let mut stage = qp.stage_mut(0).ok_or("no stage")?;
    stage.q_mut().set(0, 0, 1.0);
    stage.c_mut().set(0, 0, 1.0);
    stage.x_bounds_mut().set(0, f64::NEG_INFINITY, 0.0);
    stage.g_bounds_mut().set(0, 1.0, f64::INFINITY);
    let mut solution = HeapSolution::new(qp.dims())?;
    let found = Clarabel::new().solve(qp.view(), Start::Cold, solution.view_mut());
    // Half of the distance, on either side.
    assert!(
        matches!(found, Err(casados::qp::QpError::Infeasible { stage: 0, index: 0, violation, .. }) if (violation - 0.5).abs() < 1e-6),
        "{found:?}"
    );
    Ok(())
}
