//! What an iterate is worth between its nodes: against closed forms, and a loop of refinement.

use crate::Test;
use casados::ocp::{Constraint, GeneralCost, HeapIpm, HeapSqp, Horizon, Map, OcpError, Problem};
use casados::prelude::*;
use casados::qp::Side;

fn tight_options() -> AdaptiveOptions {
    AdaptiveOptions { rtol: 1e-11, atol: 1e-12, ..Default::default() }
}

#[ode]
fn decay(x: [f64; 2], p: f64) -> [f64; 2] {
    [-x[0], p * x[1]]
}

/// Of Heun's method a step is `1 − h + h²/2`, the flow is `e^−h`: the defect is the difference.
#[test]
fn defects_of_intervals() -> Test {
    let times = [0.0, 0.1, 0.4, 1.0];
    let erk = Erk::<Decay, Heun>::new(Options::default())?;
    let mut ocp = Problem::new(erk).on(Horizon::nodes(&times))?;
    ocp.fix_initial_state(&[3.0, 0.5])?.set_parameters(.., &[0.0])?.guess(&[3.0, 0.5], &[])?;
    ocp.guess_by_simulation()?;
    let verification = ocp.verify(&mut Adaptive::<Decay, Radau>::new(tight_options())?)?;
    for k in 0..3 {
        let h: f64 = times[k + 1] - times[k];
        let expected = ocp.stage(k)?.x[0] * ((-h).exp() - (1.0 - h + 0.5 * h * h));
        let [defect, still] = [0, 1].map(|i| verification.defects()[2 * k + i]);
        assert_eq!((defect.interval, defect.state, still.state), (k, "x[0]", "x[1]"));
        assert!((defect.amount - expected).abs() < 1e-10, "{k}: {} {expected}", defect.amount);
        assert!((defect.relative - expected.abs() / 3.0).abs() < 1e-10 && still.amount.abs() < 1e-12);
    }
    let largest = verification.largest_defect().ok_or("none")?;
    assert_eq!((largest.interval, largest.state), (2, "x[0]"));
    assert_eq!(verification.intervals(1e-3), [1, 2]);
    assert!(verification.intervals(1.0).is_empty());
    let text = verification.to_string();
    assert!(text.starts_with("largest defect: ") && text.contains("of `x[0]` in interval 2 of 3"), "{text}");
    assert!(text.ends_with("no bound is violated between nodes"), "{text}");
    Ok(())
}

#[ode(duration = p)]
fn throw(x: [f64; 2], u: f64, _p: f64) -> [f64; 2] {
    [x[1], u]
}
#[function(duration = p)]
fn height(x: [f64; 2], _u: f64, _p: f64, t: f64) -> [f64; 2] {
    [x[0] - 1.0, x[0] + t]
}
#[function]
fn time(_x: [f64; 2], _u: f64, p: f64) -> f64 {
    p
}

/// A throw that is at its highest between two nodes: violations by name, at their times in seconds.
#[test]
fn violations_between_nodes_by_name() -> Test {
    let infinity = f64::INFINITY;
    let below = Constraint::<Height>::new([-infinity; 2], [-0.1, 3.5]);
    let mut ocp = Problem::new(Irk::<Throw, Gauss<2>>::new(Options::default())?)
        .terminal_cost(GeneralCost::<Time>::new())
        .path_constraints(below)
        .on(Horizon::free(2, 0.5..=10.0, 4.0))?;
    ocp.fix_initial_state(&[0.0, 2.0])?.bound("x[0]", .., -infinity, 0.5)?;
    // From 0 with 2 m/s against 2 m/s²: 1 m high after 1 s, back after 2 s, at the node.
    ocp.guess_stage(0, &[0.0, 2.0], &[-2.0])?.guess_stage(1, &[0.0, -2.0], &[2.0])?;
    ocp.guess_stage(2, &[0.0, 2.0], &[])?;
    let verification = ocp.verify(&mut Adaptive::<Throw, Radau>::new(tight_options())?)?;
    assert!(verification.largest_defect().ok_or("none")?.amount.abs() < 1e-9);
    let [state, first, ..] = verification.violations() else { return Err("too few".into()) };
    assert_eq!((state.name.as_str(), state.interval, state.side), ("x[0]", 0, Side::Upper));
    assert!((state.amount - 0.5).abs() < 1e-9 && (state.time - 1.0).abs() < 1e-12, "{state:?}");
    assert!((state.relative - 0.5).abs() < 1e-9);
    assert_eq!((first.name.as_str(), first.interval), ("Height[0]", 0));
    assert!((first.amount - 0.1).abs() < 1e-9 && (first.time - 1.0).abs() < 1e-12, "{first:?}");
    assert_eq!(verification.violations().len(), 2);
    assert_eq!(verification.intervals(0.2), [0]);
    assert!(verification.to_string().contains("of the upper bound of `x[0]` in interval 0, t = 1"));
    Ok(())
}

#[ode]
fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u - 9.81 * x[0].sin()]
}
#[function]
fn effort(_x: [f64; 2], u: f64) -> f64 {
    u * u
}

/// Intervals are halved until all defects are small; the grid is finer where it has to be.
#[test]
fn mesh_refinement() -> Test {
    let mut nodes: Vec<f64> = (0..=8).map(|k| 0.25 * f64::from(k)).collect();
    let mut guess = None;
    let mut counts = Vec::new();
    for _ in 0..8 {
        let n = nodes.len() - 1;
        let mut ocp = Problem::new(Erk::<Pendulum, Rk4>::new(Options::default())?)
            .running_cost(GeneralCost::<Effort>::new())
            .on(Horizon::nodes(&nodes))?;
        ocp.fix_initial_state(&[2.5, 0.0])?.bound("x", n.., 0.0, 0.0)?.guess(&[1.0, 0.0], &[0.0])?;
        if let Some(solution) = &guess {
            ocp.guess_from(solution)?;
        }
        assert!(HeapIpm::new(&ocp)?.solve(&mut ocp)?.is_converged());
        let verification = ocp.verify(&mut Adaptive::<Pendulum, Radau>::new(tight_options())?)?;
        let coarse = verification.intervals(1e-5);
        counts.push((n, coarse.len()));
        if coarse.is_empty() {
            break;
        }
        nodes = Horizon::refined(&nodes, &coarse);
        guess = Some(ocp.solution()?);
    }
    let (n, left) = *counts.last().ok_or("no turn")?;
    assert!(left == 0 && counts[0].1 > 0 && (9..256).contains(&n), "{counts:?}");
    let lengths: Vec<f64> = nodes.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let [least, most] = [f64::min, f64::max].map(|f| lengths.iter().copied().reduce(f).unwrap_or(0.0));
    assert!(least < most, "{lengths:?}");
    Ok(())
}

#[function]
fn double(x: f64) -> f64 {
    2.0 * x
}
#[ode]
fn growth(x: f64) -> f64 {
    x
}

#[test]
fn verification_of_maps() -> Test {
    let mut ocp = Problem::new(Map::<Double, f64>::new()).on(Horizon::uniform(2, 1.0))?;
    ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[])?;
    assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
    let error =
        ocp.verify(&mut Adaptive::<Growth, Radau>::new(tight_options())?).err().ok_or("it is verified")?;
    assert!(matches!(error, OcpError::Unsupported { .. }), "{error}");
    assert_eq!(Horizon::refined(&[0.0, 1.0], &[3]), [0.0, 1.0]);
    assert_eq!(Horizon::<f64>::refined(&[], &[0]), [] as [f64; 0]);
    Ok(())
}
