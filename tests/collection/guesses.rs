//! Guesses that are not plain.

use crate::{Test, ocps};
use casados::ocp::{Formulation, HeapOcp, HeapSqp, SecondOrder};

/// A number from −1 to 1 for each stage and state.
fn noise(seed: f64, stage: usize, state: usize) -> f64 {
    let angle = 12.9898 * (stage as f64 + 1.0) + 78.233 * (state as f64 + 1.0) + 37.719 * seed;
    let value = angle.sin() * 4375.85453;
    2.0 * (value - value.floor()) - 1.0
}

/// Adds noise to the states of the guess: that part of how far each of them goes, and of 0.1.
fn disturb<P: Formulation<f64>>(ocp: &mut HeapOcp<P>, part: f64, seed: f64) -> Test {
    let last = ocp.intervals();
    let ends = (ocp.stage(0)?.x.to_vec(), ocp.stage(last)?.x.to_vec());
    for k in 0..=last {
        let x = ocp.iterate_mut().stage_mut(k).ok_or("no stage")?.x;
        for (i, (x, (a, b))) in x.iter_mut().zip(ends.0.iter().zip(&ends.1)).enumerate() {
            *x += part * ((a - b).abs() + 0.1) * noise(seed, k, i);
        }
    }
    Ok(())
}

fn converges<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(ocp: &mut HeapOcp<P>) -> Test {
    let mut sqp = HeapSqp::new(ocp)?;
    let outcome = sqp.solve(ocp)?;
    println!("{}{outcome}", sqp.log());
    if outcome.is_converged() { Ok(()) } else { Err(outcome.to_string().into()) }
}

/// Gaps of the guess are closed before violations are compared: the swing-up is feasible.
#[test]
fn disturbed_swing_ups() -> Test {
    for (part, seed) in [(0.1, 1.0), (0.1, 2.0), (0.3, 3.0), (0.3, 4.0)] {
        let mut ocp = ocps::mechanics::pendulum(ocps::GIVEN)?;
        disturb(&mut ocp, part, seed)?;
        converges(&mut ocp)?;
    }
    Ok(())
}

/// The same point at all nodes.
#[test]
fn a_chain_from_a_point() -> Test {
    let mut ocp = ocps::textbook::hanging_chain(ocps::GIVEN)?;
    ocp.guess(&[1.0, 0.0, 0.0], &[2.0])?;
    converges(&mut ocp)
}

/// The density of the atmosphere overflows below the ground, where bounds do not let the rocket be.
#[test]
fn a_guess_without_values() -> Test {
    for seed in [3.0, 4.0] {
        let mut ocp = ocps::flight::goddard(ocps::GIVEN)?;
        disturb(&mut ocp, 0.3, seed)?;
        assert!(ocp.linearise(casados::ocp::Exact::default()).is_err());
        converges(&mut ocp)?;
    }
    Ok(())
}
