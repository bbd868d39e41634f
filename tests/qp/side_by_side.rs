//! Problems side by side in registers: verdicts are those of single solves, solutions those to
//! their tolerance, and neighbours change nothing.

use crate::Test;
use crate::known_solutions::{Numbers, invalid_numbers, numbers};
use crate::runs::{Counts, seeds};
use casados::qp::{
    BatchInteriorPoint, HeapInteriorPoint, HeapQp, HeapSolution, QpError, QpInstance, QpSolver, QpStart,
    StageDims, residuals,
};
use reference_data::Record;

const INFINITY: f64 = f64::INFINITY;

/// A positive definite matrix whose eigenvalues are one and more: `1 + G Gᵀ`.
fn definite_matrix(random: &mut Numbers, n: usize) -> Vec<Vec<f64>> {
    let g: Vec<Vec<f64>> = (0..n).map(|_| (0..n).map(|_| random.next()).collect()).collect();
    let product = |i: usize, j: usize| g[i].iter().zip(&g[j]).map(|(a, b)| a * b).sum::<f64>();
    (0..n).map(|i| (0..n).map(|j| product(i, j) + if i == j { 1.0 } else { 0.0 }).collect()).collect()
}

/// What is wrong with a problem.
#[derive(Clone, Copy, PartialEq)]
enum Fault {
    None,
    NotFinite,
    NotConvex,
    CrossedBounds,
    SoftControl,
    StateBound,
}

/// A problem in which controls have bounds: of both sides, of one, none, or equal ones.
fn problem(random: &mut Numbers, dims: &[StageDims], fault: Fault) -> Result<HeapQp<f64>, QpError> {
    let mut qp = HeapQp::new(dims)?;
    let (last, at) = (dims.len() - 1, random.below(dims.len() - 1));
    for (k, mut stage) in qp.stages_mut().enumerate() {
        let StageDims { nx, nu, .. } = dims[k];
        let h = definite_matrix(random, nx + nu);
        stage.q_mut().fill_with(|i, j| h[i][j]);
        stage.gradient_x_mut().iter_mut().for_each(|g| *g = random.next());
        if k == last {
            break;
        }
        stage.r_mut().fill_with(|i, j| h[nx + i][nx + j]);
        stage.s_mut().fill_with(|i, j| h[nx + i][j]);
        stage.gradient_u_mut().iter_mut().for_each(|g| *g = 3.0 * random.next());
        stage.a_mut().fill_with(|i, j| 0.5 * random.next() + if i == j { 0.7 } else { 0.0 });
        stage.b_mut().fill_with(|_, _| random.next());
        stage.offset_mut().iter_mut().for_each(|b| *b = 0.3 * random.next());
        for i in 0..nu {
            let (middle, half) = (0.5 * random.next(), random.next().abs());
            let (lower, upper) = match random.below(6) {
                0 => (-INFINITY, middle),
                1 => (middle, INFINITY),
                2 => (-INFINITY, INFINITY),
                3 if random.chance(0.3) => (middle, middle),
                _ => (middle - half, middle + half),
            };
            stage.u_bounds_mut().set(i, lower, upper);
        }
        if k != at {
            continue;
        }
        match fault {
            Fault::None => {}
            Fault::NotFinite if random.chance(0.5) => stage.q_mut().set(0, 0, f64::NAN),
            Fault::NotFinite => stage.offset_mut()[0] = INFINITY,
            Fault::NotConvex => stage.r_mut().set(0, 0, -50.0),
            Fault::CrossedBounds => stage.u_bounds_mut().set(0, 1.0, -1.0),
            Fault::SoftControl => stage.u_bounds_mut().soften(0, 0.5, 1.0),
            Fault::StateBound => stage.x_bounds_mut().set(0, -1e3, 1e3),
        }
    }
    let x0: Vec<f64> = (0..dims[0].nx).map(|_| 2.0 * random.next()).collect();
    qp.fix_initial_state(&x0)?;
    Ok(qp)
}

/// Problems of which neighbours mostly have the same dimensions.
fn random_instances(seed: u64, count: usize) -> Result<Vec<QpInstance>, QpError> {
    let mut random = Numbers::new(seed);
    let (mut instances, mut dims) = (Vec::new(), Vec::new());
    for i in 0..count {
        if i == 0 || random.chance(0.03) {
            let (nx, nu) = (1 + random.below(9), 1 + random.below(5));
            dims = vec![StageDims::new(nx, nu, 0); 2 + random.below(12)];
            if let Some(last) = dims.last_mut() {
                last.nu = 0;
            }
        }
        let fault = match random.below(25) {
            0 => Fault::NotFinite,
            1 => Fault::NotConvex,
            2 => Fault::CrossedBounds,
            3 => Fault::SoftControl,
            4 => Fault::StateBound,
            _ => Fault::None,
        };
        let qp = problem(&mut random, &dims, fault)?;
        let mut solution = HeapSolution::new(&dims)?;
        if random.chance(0.3) {
            invalid_numbers(&mut random, &mut solution);
        }
        instances.push(QpInstance { qp, solution });
    }
    Ok(instances)
}

/// The Hessian is one at least, so that a point is as far from the solution as its residuals, times
/// what the dynamics make of them: below 1e3 here. With a tolerance of 1e-10 each number is off by
/// less than 1e-7, multipliers too.
fn assert_close(together: &HeapSolution<f64>, alone: &HeapSolution<f64>) {
    let largest = numbers(alone).fold(1.0, |most: f64, b| most.max(b.abs()));
    let pairs = numbers(together).zip(numbers(alone));
    let apart = pairs.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
    assert!(apart < 1e-7 * largest, "{apart} of {largest}");
}

#[test]
fn verdicts_of_batches() -> Test {
    let mut counts = Counts::new("problems side by side, some not convex, NaN or with other bounds");
    let mut batch = BatchInteriorPoint::new();
    batch.options.tolerance = 1e-10;
    let mut single = HeapInteriorPoint::new();
    single.options.tolerance = 1e-10;
    let mut sets = 0;
    for seed in seeds(12) {
        let mut all = random_instances(seed, 1 + 23 * seed as usize)?;
        for start in [QpStart::Cold, QpStart::Warm] {
            let mut alone = all.clone();
            let statuses = batch.solve(&mut all, start)?.to_vec();
            for ((status, together), instance) in statuses.iter().zip(&all).zip(&mut alone) {
                let QpInstance { qp, solution } = instance;
                let found = single.solve(qp.view(), start, solution.view_mut());
                counts.count_result(&found);
                let (Ok(statistics), Ok(_)) = (status, &found) else {
                    let verdict =
                        |result: &Result<_, QpError>| result.as_ref().err().map(std::mem::discriminant);
                    assert_eq!(verdict(&status.map(|_| ())), verdict(&found.map(|_| ())), "{status:?}");
                    continue;
                };
                assert_close(&together.solution, solution);
                // What is said of the point is true.
                let (found, objective) = residuals(qp.view(), &together.solution);
                assert!(found.largest() <= 1e-10, "{found}");
                assert!((objective - statistics.objective).abs() <= 1e-9 * (1.0 + objective.abs()));
                assert!(statistics.residuals.largest() <= 1e-10);
                if start == QpStart::Cold {
                    sets = sets.max(statistics.active_sets);
                }
            }
        }
    }
    println!("{counts}");
    // A single solve tries one set only before it is an interior point.
    assert!(sets > 1, "problems were solved together");
    for verdict in ["Ok", "NotConvex", "InvalidValue", "CrossedBounds"] {
        assert!(counts.count_of(verdict) > 0, "{counts}");
    }
    Ok(())
}

#[test]
fn independence_of_neighbours() -> Test {
    let mut random = Numbers::new(5);
    let mut dims = [StageDims::new(6, 3, 0); 9];
    dims[8].nu = 0;
    let good = (0..21).map(|_| problem(&mut random, &dims, Fault::None)).collect::<Result<Vec<_>, _>>()?;
    let solve = |faults: &[(usize, Fault)]| -> Result<Vec<QpInstance>, QpError> {
        let mut instances = Vec::new();
        for qp in &good {
            instances.push(QpInstance { qp: qp.clone(), solution: HeapSolution::new(&dims)? });
        }
        for &(index, fault) in faults {
            instances[index].qp = problem(&mut Numbers::new(9), &dims, fault)?;
        }
        let mut batch = BatchInteriorPoint::new();
        let statuses = batch.solve(&mut instances, QpStart::Cold)?;
        for (index, status) in statuses.iter().enumerate() {
            assert_eq!(status.is_err(), faults.iter().any(|fault| fault.0 == index), "{index}: {status:?}");
        }
        Ok(instances)
    };
    let all = solve(&[])?;
    // In the places of others, so that the groups are the same.
    let faults = [(2, Fault::NotFinite), (11, Fault::NotConvex), (20, Fault::NotFinite)];
    for (index, (a, b)) in all.iter().zip(&solve(&faults)?).enumerate() {
        if faults.iter().all(|fault| fault.0 != index) {
            assert_close(&a.solution, &b.solution);
        }
    }
    Ok(())
}

/// The 128 control-bounded LQRs of J. Frey et al., "Differentiable nonlinear model predictive
/// control" (arXiv 2505.01353, table 1).
#[test]
fn linear_quadratic_regulators() -> Test {
    let record = Record::load("ocp/lqr.json")?;
    let [a, b, x0] = ["A", "B", "x0"].map(|key| record.vectors(key).map(|rows| rows.concat()));
    let (a, b, offset, x0) = (a?, b?, record.list("b")?, x0?);
    let (n, nx, nu) = (20, offset.len(), b.len() / offset.len());
    let mut dims = vec![StageDims::new(nx, nu, 0); n + 1];
    dims[n].nu = 0;
    for (most, expected) in [(1e4, 1..=1), (1.0, 2..=6)] {
        let mut instances = Vec::new();
        for x0 in x0.chunks_exact(nx) {
            let mut qp = HeapQp::new(&dims)?;
            for (k, mut stage) in qp.stages_mut().enumerate() {
                stage.q_mut().set_diagonal(vec![1.0; nx]);
                if k == n {
                    break;
                }
                stage.a_mut().fill_with(|i, j| a[i * nx + j]);
                stage.b_mut().fill_with(|i, j| b[i * nu + j]);
                stage.r_mut().set_diagonal(vec![1.0; nu]);
                stage.offset_mut().copy_from_slice(&offset);
                (0..nu).for_each(|i| stage.u_bounds_mut().set(i, -most, most));
            }
            qp.fix_initial_state(x0)?;
            instances.push(QpInstance { qp, solution: HeapSolution::new(&dims)? });
        }
        let mut batch = BatchInteriorPoint::new();
        let statuses = batch.solve(&mut instances, QpStart::Cold)?;
        let iterations: usize = statuses.iter().flatten().map(|statistics| statistics.iterations).sum();
        assert!(statuses.iter().all(Result::is_ok) && expected.contains(&(iterations / 128)), "{iterations}");
        let mut single = HeapInteriorPoint::new();
        single.options.tolerance = 1e-10;
        let mut solution = HeapSolution::new(&dims)?;
        for QpInstance { qp, solution: together } in &instances {
            single.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
            let pairs = together.stages().zip(solution.stages());
            let apart = pairs.flat_map(|(a, b)| a.u.iter().zip(b.u)).map(|(a, b)| (a - b).abs());
            assert!(apart.fold(0.0, f64::max) < 1e-8);
        }
    }
    Ok(())
}
