//! Two-point boundary value problems: no control, no cost, and layers. Solutions grow by up to e¹⁰⁰
//! along the horizon, so that the QP of all stages is solved by a sparse factorisation with pivots.
//!
//! `Gauss<4>` has order eight, with steps below half the width of the layers: errors are below
//! 1e-10. Gaps up to the solver's tolerance, 1e-8, are multiplied by the condition of the boundary
//! value problem, about one.

use crate::Test;
use casados::ocp::{HeapSqp, Horizon, Problem};
use casados::prelude::*;
use casados::qp::Clarabel;

/// `ε y″ = y`: a layer at each end. The parameter is ε.
#[ode]
fn two_layers(x: [f64; 2], p: f64) -> [f64; 2] {
    [x[1], x[0] / p]
}

/// `ε y″ = −2 t y′` on [−1, 1]: a shock at the turning point, an error function (Ascher, Mattheij,
/// Russell, *Numerical Solution of Boundary Value Problems*, SIAM 1995).
#[ode]
fn shock(x: [f64; 2], p: f64, t: f64) -> [f64; 2] {
    [x[1], -2.0 * t * x[1] / p]
}

/// Nodes that are closer where the solution changes: `[from, to]` in `n` intervals each.
fn nodes(pieces: &[([f64; 2], usize)]) -> Vec<f64> {
    let mut times = vec![pieces[0].0[0]];
    for &([from, to], n) in pieces {
        times.extend((1..=n).map(|k| from + (to - from) * k as f64 / n as f64));
    }
    times
}

/// The first state of `$model` at the nodes, which has `$ends` at the ends.
macro_rules! solution {
    ($model:ty, $times:expr, $parameter:expr, $ends:expr) => {{
        let (times, ends): (&[f64], [f64; 2]) = (&$times, $ends);
        let n = times.len() - 1;
        let dynamics = Irk::<$model, Gauss<4>>::new(Options::default())?;
        let mut ocp = Problem::new(dynamics).on(Horizon::nodes(times))?;
        ocp.free_initial_state().set_parameters(.., &[$parameter])?;
        ocp.bound("x[0]", ..1, ends[0], ends[0])?.bound("x[0]", n.., ends[1], ends[1])?;
        let mut sqp = HeapSqp::with_solver(&ocp, Clarabel::new())?;
        let outcome = sqp.solve(&mut ocp)?;
        assert!(outcome.is_converged(), "{}{outcome}", sqp.log());
        ocp.solution()?.state("x[0]")?.to_vec()
    }};
}

#[test]
fn layers_at_both_ends() -> Test {
    for epsilon in [1e-2, 1e-3, 1e-4_f64] {
        let width = epsilon.sqrt();
        let near = 20.0 * width;
        let times = match near < 0.5 {
            true => nodes(&[([0.0, near], 50), ([near, 1.0 - near], 20), ([1.0 - near, 1.0], 50)]),
            false => nodes(&[([0.0, 1.0], 50)]),
        };
        let x = solution!(TwoLayers, times, epsilon, [1.0, 1.0]);
        for (t, x) in times.iter().zip(&x) {
            let exact = ((-t / width).exp() + ((t - 1.0) / width).exp()) / (1.0 + (-1.0 / width).exp());
            assert!((x - exact).abs() < 1e-8, "ε {epsilon}, t {t}: {x}, but {exact}");
        }
    }
    Ok(())
}

/// From −1 to 1 through `erf(t/√ε)/erf(1/√ε)`; references by Abramowitz and Stegun, table 7.1.
#[test]
fn shock_at_a_turning_point() -> Test {
    let epsilon = 0.01_f64;
    let times = nodes(&[([-1.0, -0.3], 20), ([-0.3, 0.3], 60), ([0.3, 1.0], 20)]);
    let x = solution!(Shock, times, epsilon, [-1.0, 1.0]);
    // t/√ε = 0.5, 1, 1.5, 2 at t = 0.05, 0.1, 0.15, 0.2; erf(10) is one to all digits.
    for (t, erf) in [(0.05, 0.5204998778), (0.1, 0.8427007929), (0.15, 0.9661051465), (0.2, 0.9953222650)] {
        for (t, exact) in [(t, erf), (-t, -erf)] {
            let k = times.iter().position(|&node| (node - t).abs() < 1e-9).ok_or("no node")?;
            assert!((x[k] - exact).abs() < 1e-8, "t {t}: {}, but {exact}", x[k]);
        }
    }
    Ok(())
}
