//! A bound of a state that dynamics alone determine: its multiplier holds a slack that is shorter
//! than the distance, and lets it go.

use super::ocps::line;
use super::{Test, objective_change_by_residuals};
use casados::ocp::{Exact, GeneralCost, HeapIpm, Horizon, Problem};
use casados::prelude::*;
use casados::qp::residuals;
use casados::{Erk, Rk4};

/// A culture that makes a protein and secretes it: secreted protein, all of it, cells, glucose and
/// volume; the feed. S. Park, W. F. Ramirez, "Optimal production of secreted protein in fed-batch
/// reactors", AIChE Journal 34 (1988).
#[ode]
fn culture(x: [f64; 5], u: [f64; 1]) -> [f64; 5] {
    let [secreted, all, cells, glucose, volume] = x;
    let growth = 21.87 * glucose / ((glucose + 0.4) * (glucose + 62.5));
    let secretion = 4.75 * growth / (0.12 + growth);
    let expression = glucose / (0.1 + glucose) * (-5.0 * glucose).exp();
    let dilution = u[0] / volume;
    [
        secretion * (all - secreted) - dilution * secreted,
        expression * cells - dilution * all,
        growth * cells - dilution * cells,
        -7.3 * growth * cells + dilution * (20.0 - glucose),
        u[0],
    ]
}

#[function]
fn loss(x: [f64; 5], _u: [f64; 1]) -> f64 {
    -x[0] * x[4]
}

/// As much secreted protein as possible. There is none at the start, where its bounds are. IPOPT
/// takes 152 iterations.
#[test]
fn state_at_its_bound() -> Test {
    let n = 60;
    let erk = Erk::<Culture, Rk4>::new(Options { steps: 2, ..Options::default() })?;
    let mut ocp = Problem::new(erk)
        .terminal_cost(GeneralCost::<Loss>::new())
        .on(Horizon::uniform(n, 15.0 / n as f64))?;
    ocp.fix_initial_state(&[0.0, 0.0, 1.0, 5.0, 1.0])?.bound("u", .., 0.0, 2.0)?;
    ocp.bound("x", .., 0.0, f64::INFINITY)?.bound("x[4]", .., 1.0, 30.0)?;
    line(&mut ocp, &[0.0, 0.0, 1.0, 5.0, 1.0], &[1.0, 1.0, 3.0, 1.0, 10.0], &[0.6])?;
    let mut ipm = HeapIpm::new(&ocp)?;
    let outcome = ipm.solve(&mut ocp)?;
    println!("{}{outcome}", ipm.log());
    assert!(outcome.is_converged(), "{outcome}");
    ocp.linearise(Exact::default())?;
    let (judged, _) = residuals(ocp.qp(), ocp.iterate());
    // To 1e-8 in units: that of forces is 10, and means of multipliers are below 100 of them.
    assert!(judged.largest() <= 1e-8, "{judged}");
    // IPOPT stops at residuals of 1e-6, and relaxes bounds by 1e-8.
    let tolerance = (1e-6 + 2.0 * 1e-8) * objective_change_by_residuals(&ocp);
    assert!((outcome.objective + 32.65959302317345).abs() <= tolerance, "{outcome}, {tolerance:e}");
    Ok(())
}
