//! Equations that are linear hold after one full step of the interior point, whatever their
//! multipliers are.

use crate::Test;
use casados::ocp::{Constraint, Formulation, GeneralCost, HeapIpm, HeapOcp, Horizon, Problem, SecondOrder};
use casados::prelude::*;

#[ode]
fn cart(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u]
}

#[function]
fn effort(_x: [f64; 2], u: f64) -> f64 {
    u * u
}

#[function]
fn end(x: [f64; 2], _u: f64) -> [f64; 2] {
    [x[0] + x[1], x[0] - x[1]]
}

/// The first iteration goes all the way: refinement leaves equations `ε^(2/3)` of what their rows
/// are. Multipliers change from zero by `24 d` and more; regularisation alone would leave `√ε` of
/// that.
fn check_full_first_step<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
    mut ocp: HeapOcp<P>,
    size: f64,
) -> Test {
    ocp.fix_initial_state(&[0.0, 0.0])?.guess(&[0.0, 0.0], &[0.0])?;
    let mut ipm = HeapIpm::new(&ocp)?;
    let outcome = ipm.solve(&mut ocp)?;
    println!("{}{outcome}", ipm.log());
    assert!(outcome.is_converged(), "{outcome}");
    let [first, second, ..] = ipm.log().0 else { return Err("one step at least".into()) };
    // Bounds move the last state of the guess to the end; then it is gaps that are closed.
    let missed = first.residuals.inequalities.max(first.residuals.dynamics);
    assert!(first.step == 1.0 && missed >= 0.9 * size, "{}", first.residuals);
    let tolerance = f64::EPSILON.powf(2.0 / 3.0) * (1.0 + size);
    assert!(second.residuals.inequalities <= tolerance, "{} {tolerance:e}", second.residuals);
    Ok(())
}

macro_rules! problem {
    () => {
        Problem::new(Erk::<Cart, Rk4>::new(Options::default())?).running_cost(GeneralCost::<Effort>::new())
    };
}

#[test]
fn given_terminal_states() -> Test {
    for distance in [1.0, 50.0] {
        let mut ocp = problem!().on(Horizon::uniform(20, 0.05))?;
        ocp.bound("x[0]", 20.., distance, distance)?.bound("x[1]", 20.., 0.0, 0.0)?;
        check_full_first_step(ocp, distance)?;
    }
    Ok(())
}

#[test]
fn terminal_constraints() -> Test {
    for distance in [1.0, 50.0] {
        let to = [distance; 2];
        let ocp =
            problem!().terminal_constraints(Constraint::<End>::new(to, to)).on(Horizon::uniform(20, 0.05))?;
        check_full_first_step(ocp, distance)?;
    }
    Ok(())
}
