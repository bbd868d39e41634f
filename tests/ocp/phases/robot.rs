//! The path-tracking robot of the users' guide of DIRCOL, section 2.7, in two phases as PROPT and
//! PSOPT have it: along one axis, then along the other.

use crate::Test;
use crate::phases::kkt;
use casados::ocp::{
    Continuous, ExactFormulation, GeneralCost, HeapIpm, HeapOcp, HeapSqp, Horizon, OcpError, Phases, Problem,
};
use casados::prelude::*;

/// Two joints, angles and rates, and the square of the distance from the path, integrated: along
/// the first axis.
#[ode]
mod path {
    #[ode]
    fn first_axis(x: [f64; 5], u: [f64; 2], t: f64) -> [f64; 5] {
        let d = [x[0] - 0.5 * t, x[1], x[2] - 0.5, x[3]];
        let angles = 100.0 * (d[0] * d[0] + d[1] * d[1]);
        [x[2], x[3], u[0], u[1], angles + 500.0 * (d[2] * d[2] + d[3] * d[3])]
    }
    #[ode]
    fn second_axis(x: [f64; 5], u: [f64; 2], t: f64) -> [f64; 5] {
        let d = [x[0] - 0.5, x[1] - 0.5 * (t - 1.0), x[2], x[3] - 0.5];
        let angles = 100.0 * (d[0] * d[0] + d[1] * d[1]);
        [x[2], x[3], u[0], u[1], angles + 500.0 * (d[2] * d[2] + d[3] * d[3])]
    }
    #[function]
    fn total(x: [f64; 5], _u: [f64; 2], _t: f64) -> f64 {
        x[4]
    }
}

type Phase<P> = Result<HeapOcp<P>, OcpError>;

fn first(n: usize) -> Phase<impl ExactFormulation<f64>> {
    let mut first = Problem::new(Irk::<FirstAxis, Gauss<3>>::new(Options::default())?)
        .on(Horizon::uniform(n, 1.0 / n as f64))?;
    first.fix_initial_state(&[0.0, 0.0, 0.5, 0.0, 0.0])?.bound("u", .., -10.0, 10.0)?;
    first.guess(&[0.25, 0.25, 0.25, 0.25, 0.0], &[0.0, 0.0])?;
    Ok(first)
}

/// With the clock of the whole.
fn second(n: usize) -> Phase<impl ExactFormulation<f64>> {
    let times: Vec<f64> = (0..=n).map(|k| 1.0 + k as f64 / n as f64).collect();
    let mut second = Problem::new(Irk::<SecondAxis, Gauss<3>>::new(Options::default())?)
        .terminal_cost(GeneralCost::<Total>::new())
        .on(Horizon::nodes(&times))?;
    second.bound("u", .., -10.0, 10.0)?.guess(&[0.25, 0.25, 0.25, 0.25, 0.0], &[0.0, 0.0])?;
    for (name, value) in [("x[0]", 0.5), ("x[1]", 0.5), ("x[2]", 0.0), ("x[3]", 0.5)] {
        second.bound(name, n.., value, value)?;
    }
    Ok(second)
}

#[test]
fn cost_of_a_robot_path() -> Test {
    // Full force from 0.025 s before the corner to as long behind it, and along the path elsewhere:
    // `½ ∫` of rates 10 s from zero on, and of angles 5 s², twice for each of two joints. It has a
    // node at each switch, so that the best stairs cost no more.
    let s: f64 = 0.025;
    let corner = 4.0 * (500.0 * 100.0 * s.powi(3) / 3.0 + 100.0 * 25.0 * s.powi(5) / 5.0);
    let mut objectives = Vec::new();
    for by_sqp in [false, true] {
        let (mut first, mut second) = (first(40)?, second(40)?);
        let mut robot = Phases::new(&mut first).then(Continuous, &mut second).join()?;
        let outcome = if by_sqp {
            HeapSqp::new(&robot)?.solve(&mut robot)?
        } else {
            HeapIpm::new(&robot)?.solve(&mut robot)?
        };
        assert!(outcome.is_converged(), "{outcome}");
        kkt::check(&mut robot)?;
        assert!(outcome.objective <= corner * (1.0 + 1e-6), "{} {corner}", outcome.objective);
        objectives.push(outcome.objective);
        drop(robot);
        // It is symmetric: the second joint takes up in reversed time what the first one gives.
        let (one, other) = (first.solution()?, second.solution()?);
        for k in 0..40 {
            let (a, b) = (one.control("u[0]")?[k], other.control("u[1]")?[39 - k]);
            assert!((a + b).abs() < 1e-3 * 10.0, "{k}: {a} {b}");
        }
        assert_eq!(other.times()[0], 1.0);
    }
    assert!((objectives[0] - objectives[1]).abs() < 1e-6);
    Ok(())
}
