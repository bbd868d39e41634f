//! Periodic states and shared controls: random problems against clarabel, memory of the caller,
//! deadlines, and who refuses.

use crate::{Test, solve_to};
use casados::qp::Clarabel;
use casados::qp::{
    Condensing, HeapInteriorPoint, HeapQp, HeapSolution, InteriorPoint, QpError, QpSolver, QpStart, StageDims,
};

/// Numbers in −1 .. 1.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// Strictly convex, with bounds of controls and of a general constraint, some of them active. The
/// first state is given by two problems of three that have no periodic states.
pub fn problem(seed: u64, stages: usize) -> Result<HeapQp<f64>, QpError> {
    let mut random = Numbers(seed);
    let [nx, nu] = [4, 3];
    let mut dims = vec![StageDims::new(nx, nu, 1); stages];
    dims[stages - 1] = StageDims::new(nx, 0, 0);
    let mut qp = HeapQp::<f64>::new(&dims)?;
    for mut stage in qp.stages_mut() {
        let g: Vec<f64> = (0..64).map(|_| random.next()).collect();
        let h = |i: usize, j: usize| {
            (0..7).map(|c| g[c * 7 + i] * g[c * 7 + j]).sum::<f64>() + if i == j { 0.1 } else { 0.0 }
        };
        stage.q_mut().fill_with(h);
        stage.r_mut().fill_with(|i, j| h(nx + i, nx + j));
        stage.s_mut().fill_with(|i, j| h(nx + i, j));
        stage.gradient_x_mut().iter_mut().for_each(|q| *q = 3.0 * random.next());
        stage.gradient_u_mut().iter_mut().for_each(|r| *r = 3.0 * random.next());
        stage.a_mut().fill_with(|_, _| 0.7 * random.next());
        stage.b_mut().fill_with(|_, _| random.next());
        stage.offset_mut().iter_mut().for_each(|b| *b = 0.3 * random.next());
        stage.c_mut().fill_with(|_, _| random.next());
        stage.d_mut().fill_with(|_, _| random.next());
        for i in 0..stage.dims().nu {
            stage.u_bounds_mut().set(i, -0.6, 0.9);
        }
        if stage.dims().ng > 0 {
            stage.g_bounds_mut().set(0, -1.5, 1.5);
            // Never infeasible.
            stage.g_bounds_mut().soften(0, 2.0, 0.5);
        }
    }
    if seed % 8 == 1 && !seed.is_multiple_of(3) {
        qp.fix_initial_state(&[0.5, -0.3, 0.2, 0.1])?;
    }
    couple(seed, &mut qp);
    assert!(qp.view().is_coupled() || seed % 8 == 1);
    Ok(qp)
}

/// Makes states periodic, unless the first one may be given, and shares controls.
pub fn couple(seed: u64, qp: &mut HeapQp<f64>) {
    let [nx, nu] = [4, 3];
    let marks = seed % 8;
    let periodic = 1 + (seed / 8) as usize % nx;
    if marks != 1 {
        for i in 0..periodic {
            assert!(qp.make_periodic(i));
        }
    }
    for j in (0..nu).filter(|j| marks & (1 << j) > 0) {
        assert!(qp.share(j));
    }
}

/// Both find the same minimum. Products of slacks and multipliers of 1e-9, of at most 200 sides,
/// leave 2e-7 of the objective.
#[test]
fn minimum_of_clarabel() -> Test {
    for seed in 0..120 {
        let qp = problem(seed, 3 + seed as usize % 11)?;
        let mut solution = HeapSolution::new(qp.dims())?;
        let clarabel = Clarabel::new().solve(qp.view(), QpStart::Cold, solution.view_mut())?;
        let (found, own, _) = solve_to(1e-9, &qp)?;
        let difference = (clarabel.objective - own.objective).abs();
        assert!(difference < 2e-7 * (1.0 + own.objective.abs()), "{seed} {difference:e}");
        let points = found.stages().zip(solution.stages());
        for (a, b) in points.flat_map(|(a, b)| a.u.iter().zip(b.u)) {
            // Of the objective 1e-7 is `½ · 0.1 d²`.
            assert!((a - b).abs() < 2e-3, "{seed} {a} {b}");
        }
    }
    Ok(())
}

/// A warm start from the solution is the solution, by one factorisation.
#[test]
fn warm_starts() -> Test {
    for seed in 0..40 {
        let qp = problem(seed, 8)?;
        let (mut solution, cold, _) = solve_to(1e-9, &qp)?;
        let warm = HeapInteriorPoint::new().solve(qp.view(), QpStart::Warm, solution.view_mut())?;
        assert!((warm.objective - cold.objective).abs() < 1e-6 * (1.0 + cold.objective.abs()), "{seed}");
        assert!(warm.iterations <= cold.iterations, "{seed} {warm:?}");
    }
    Ok(())
}

/// Memory of the length that is said is enough, and less is an error.
#[test]
fn memory_of_the_caller() -> Test {
    let qp = problem(7 + 8, 6)?;
    let (mut numbers, indices) = InteriorPoint::<f64, (), ()>::memory(qp.dims(), 5 * 8, 5 * 2, 0);
    numbers += InteriorPoint::<f64, (), ()>::memory_of_coupling(qp.dims(), 2, 3);
    let solve = |numbers: usize| {
        let (mut numbers, mut indices) = (vec![0.0; numbers], vec![0; indices]);
        let mut solution = HeapSolution::new(qp.dims())?;
        InteriorPoint::in_memory(&mut numbers[..], &mut indices[..]).solve(
            qp.view(),
            QpStart::Cold,
            solution.view_mut(),
        )
    };
    let found = solve(numbers)?;
    let (_, own, _) = solve_to(1e-9, &qp)?;
    assert!((found.objective - own.objective).abs() < 1e-6);
    assert!(matches!(solve(numbers - 1), Err(QpError::Dimension { .. })));
    Ok(())
}

/// The clock ends a run; the iterate is there.
#[test]
fn deadlines() -> Test {
    let qp = problem(3, 8)?;
    let mut solution = HeapSolution::new(qp.dims())?;
    let mut left = 3;
    let mut over = || {
        left -= 1;
        left < 0
    };
    let error =
        HeapInteriorPoint::new().solve_until(qp.view(), QpStart::Cold, solution.view_mut(), &mut over);
    assert!(matches!(error, Err(QpError::OutOfTime { iterations: 3, .. })), "{error:?}");
    assert!(solution.stages().flat_map(|stage| stage.u).all(|u| u.is_finite() && *u != 0.0));
    Ok(())
}

#[test]
fn solvers_without_couplings() -> Test {
    let qp = problem(3, 8)?;
    let mut solution = HeapSolution::new(qp.dims())?;
    let mut condensing = Condensing::new(2, HeapInteriorPoint::new());
    let error = condensing.solve(qp.view(), QpStart::Cold, solution.view_mut());
    assert!(matches!(error, Err(QpError::Coupled)), "{error:?}");
    Ok(())
}
