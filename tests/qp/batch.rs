//! Batches of problems: each is solved, or refused, as it is alone, to the bit.

use crate::Test;
use crate::infeasible::move_bounds;
use crate::known_solutions::{HessianKind, Numbers, PLAIN, ProblemKind, numbers, problem};
use crate::runs::{Counts, seeds};
use casados::qp::{BatchInteriorPoint, HeapInteriorPoint, HeapSolution, QpInstance, QpSolver, QpStart};

/// Problems of other dimensions; bounds of a half contradict each other now and then, and a tenth
/// has NaN in its data.
fn random_instances(seed: u64, count: usize) -> Result<Vec<QpInstance>, Box<dyn std::error::Error>> {
    let mut random = Numbers::new(seed);
    let mut instances = Vec::new();
    for _ in 0..count {
        let hessian = if random.chance(0.5) { HessianKind::Definite } else { HessianKind::LowRank };
        let mut qp = problem(&mut random, &ProblemKind { hessian, ..PLAIN })?.qp;
        if random.chance(0.5) {
            move_bounds(&mut random, &mut qp)?;
        }
        if random.chance(0.1) {
            let k = random.below(qp.dims().len());
            let mut stage = qp.stage_mut(k).ok_or("no stage")?;
            if random.chance(0.5) {
                stage.q_mut().set(0, 0, f64::NAN);
            } else {
                stage.x_bounds_mut().set(0, f64::NAN, 1.0);
            }
        }
        let solution = HeapSolution::new(qp.dims())?;
        instances.push(QpInstance { qp, solution });
    }
    Ok(instances)
}

#[test]
fn batches_and_single_solves() -> Test {
    let mut counts = Counts::new("batches of problems, some infeasible, some NaN");
    let mut batch = BatchInteriorPoint::new();
    // Side by side they are solved to the tolerance: see `together`.
    batch.together = false;
    for seed in seeds(8) {
        let mut all = random_instances(seed, 1 + 13 * seed as usize)?;
        for start in [QpStart::Cold, QpStart::Warm] {
            let mut alone = all.clone();
            let statuses = batch.solve(&mut all, start)?;
            assert_eq!(statuses.len(), alone.len());
            for (status, instance) in statuses.iter().zip(&mut alone) {
                let QpInstance { qp, solution } = instance;
                let found = HeapInteriorPoint::new().solve(qp.view(), start, solution.view_mut());
                assert_eq!(format!("{status:?}"), format!("{found:?}"));
                counts.count_result(&found);
            }
            for (together, alone) in all.iter().zip(&alone) {
                let pairs = numbers(&together.solution).zip(numbers(&alone.solution));
                assert!(pairs.into_iter().all(|(a, b)| a.to_bits() == b.to_bits()));
            }
        }
    }
    println!("{counts}");
    assert!(
        counts.count_of("Infeasible") > 0 && counts.count_of("InvalidValue") > 0 && counts.count_of("Ok") > 0,
        "{counts}"
    );
    assert!(batch.solve(&mut [], QpStart::Cold)?.is_empty());
    Ok(())
}
