//! Phases with collocation: the same discrete solution as with integrators.

use super::kkt;
use crate::Test;
use casados::ocp::{
    Collocation, ExactFormulation, GeneralCost, HeapIpm, HeapOcp, HeapSqp, Horizon, Jump, Outcome, Phases,
    Problem,
};
use casados::prelude::*;

/// A pendulum that swings up for a free duration; then a weight is attached.
#[ode]
mod swings {
    #[ode(duration = p)]
    fn swing(x: [f64; 2], u: f64, _p: f64) -> [f64; 2] {
        [x[1], u - x[0].sin() - 0.1 * x[1] * x[1] * x[1]]
    }
    #[function]
    fn hang(x: [f64; 2], _u: f64, _p: f64) -> [f64; 2] {
        [x[0], 0.6 * x[1] - 0.1 * x[1] * x[0]]
    }
    #[function]
    fn effort(_x: [f64; 2], u: f64, _p: f64) -> f64 {
        0.3 + u * u
    }
    #[ode]
    fn heavier(x: [f64; 2], u: f64) -> [f64; 2] {
        [x[1], 0.5 * u - 1.5 * x[0].sin()]
    }
    #[function]
    fn effort_behind(_x: [f64; 2], u: f64) -> f64 {
        u * u
    }
}

type Failure = Box<dyn std::error::Error>;

/// Both phases with these dynamics.
macro_rules! phases {
    ($first:expr, $second:expr) => {{
        let mut first = Problem::new($first).running_cost(GeneralCost::<Effort>::new()).on(Horizon::free(
            8,
            0.2..=6.0,
            1.5,
        ))?;
        first.fix_initial_state(&[0.0, 0.0])?.guess(&[0.5, 0.5], &[0.5])?.bound("u", .., -1.5, 1.5)?;
        let mut second = Problem::new($second)
            .running_cost(GeneralCost::<EffortBehind>::new())
            .on(Horizon::uniform(6, 0.3))?;
        second.guess(&[1.0, 0.5], &[0.5])?.bound("x[0]", 6.., 1.8, 1.8)?.bound("x[1]", 6.., 0.0, 0.0)?;
        (first, second)
    }};
}

/// Returns the outcome, the duration of the first phase, and the controls of both.
fn solve<P, Q>(
    (mut first, mut second): (HeapOcp<P>, HeapOcp<Q>),
    by_sqp: bool,
) -> Result<(Outcome, f64, Vec<f64>), Failure>
where
    P: ExactFormulation<f64>,
    Q: ExactFormulation<f64>,
{
    let mut both = Phases::new(&mut first).then(Jump::<Hang>::new(), &mut second).join()?;
    let outcome = if by_sqp {
        HeapSqp::new(&both)?.solve(&mut both)?
    } else {
        HeapIpm::new(&both)?.solve(&mut both)?
    };
    assert!(outcome.is_converged(), "{outcome}");
    drop(both);
    let (one, other) = (first.solution()?, second.solution()?);
    let controls = one.control("u")?.iter().chain(other.control("u")?).copied().collect();
    Ok((outcome, one.end_time(), controls))
}

#[test]
fn solutions_are_those_of_integrators() -> Test {
    let swing = || Irk::<Swing, Gauss<2>>::new(Options::default());
    let heavier = || Irk::<Heavier, Gauss<2>>::new(Options::default());
    let expected = solve(phases!(swing()?, heavier()?), false)?;
    for by_sqp in [false, true] {
        let both = phases!(Collocation::new(swing()?)?, Collocation::new(heavier()?)?);
        let one = phases!(swing()?, Collocation::new(heavier()?)?);
        let other = phases!(Collocation::new(swing()?)?, heavier()?);
        for found in [solve(both, by_sqp)?, solve(one, by_sqp)?, solve(other, by_sqp)?] {
            let (of, to) = (found.0.objective, expected.0.objective);
            println!("{} {} {of} {to} {}", found.0.iterations, expected.0.iterations, found.1);
            assert!((of - to).abs() < 1e-6 * to, "{by_sqp}: {of} {to}");
            assert!((found.1 - expected.1).abs() < 1e-4, "{by_sqp}: {} {}", found.1, expected.1);
            for (a, b) in found.2.iter().zip(&expected.2) {
                assert!((a - b).abs() < 1e-4, "{by_sqp}: {a} {b}");
            }
        }
    }
    Ok(())
}

/// Checks the KKT conditions of the QP at the solution by separate code.
#[test]
fn conditions_of_optimality() -> Test {
    let swing = Collocation::new(Irk::<Swing, Gauss<2>>::new(Options::default())?)?;
    let heavier = Collocation::new(Irk::<Heavier, Gauss<2>>::new(Options::default())?)?;
    let (mut first, mut second) = phases!(swing, heavier);
    let mut both = Phases::new(&mut first).then(Jump::<Hang>::new(), &mut second).join()?;
    assert!(HeapIpm::new(&both)?.solve(&mut both)?.is_converged());
    kkt::check(&mut both)?;
    // A second run starts at the solution.
    let mut ipm = HeapIpm::new(&both)?;
    let outcome = ipm.solve(&mut both)?;
    assert!(outcome.is_converged(), "{outcome}");
    Ok(())
}
