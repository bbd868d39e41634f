//! Guesses from which a full step leads to nowhere.

use crate::Test;
use casados::ocp::{GeneralCost, Globalisation, HeapSqp, Horizon, Map, OcpError, Problem};
use casados::prelude::*;

#[function]
fn step(x: [f64; 1], u: [f64; 1]) -> [f64; 1] {
    [x[0] + u[0]]
}

/// Smallest at one.
#[function]
fn barrier(x: [f64; 1], _u: [f64; 1]) -> f64 {
    x[0] - x[0].ln()
}

/// Newton's step from three goes to `3 - 3 (3 - 1) = -3`, where there is no logarithm: a line
/// search shortens it.
#[test]
fn full_steps_outside_of_the_domain() -> Test {
    for globalisation in [Globalisation::FullStep, Globalisation::Merit, Globalisation::Filter] {
        let mut ocp = Problem::new(Map::<Step, f64>::new())
            .terminal_cost(GeneralCost::<Barrier>::new())
            .on(Horizon::uniform(1, 1.0))?;
        ocp.fix_initial_state(&[3.0])?.guess(&[3.0], &[0.0])?;
        let mut sqp = HeapSqp::new(&ocp)?;
        assert_eq!(sqp.options.globalisation, Globalisation::Merit);
        sqp.options.globalisation = globalisation;
        match sqp.solve(&mut ocp) {
            Err(OcpError::NonFiniteFunction { .. }) if globalisation == Globalisation::FullStep => {}
            Ok(outcome) if globalisation != Globalisation::FullStep => {
                println!("{}{outcome}", sqp.log());
                assert!(outcome.is_converged() && sqp.log().0[0].step < 1.0);
                // The second derivative there is one.
                assert!((ocp.stage(1)?.x[0] - 1.0).abs() < 1.1e-6);
            }
            other => return Err(format!("{globalisation:?}: {other:?}").into()),
        }
    }
    Ok(())
}
