//! Controls that are linear in time, and integrals by name: the QP against that of a model which
//! has these states itself, closed forms, published values, and results by name.

use crate::Test;
use crate::free_parameters::stage_numbers;
use casados::ocp::{
    Constraint, Convexification, Exact, GeneralCost, HeapIpm, HeapSqp, Horizon, Kind, OcpError, Problem,
};
use casados::prelude::*;

/// A linear control beside a constant one, and two integrals.
///
/// - `t`: s
#[dae(linear = u.push, integrals(work = u.push * x.speed * z, heat = u.brake * u.brake))]
mod sledge {
    /// The sledge.
    pub struct State {
        /// Place, m.
        pub place: f64,
        /// Speed, m/s.
        pub speed: f64,
    }
    pub struct Control {
        /// Brake, N.
        pub brake: f64,
        /// Push, N.
        pub push: f64,
    }
    pub fn sledge(xdot: &State, x: &State, z: f64, u: &Control, p: f64) -> [f64; 3] {
        [
            xdot.place - x.speed,
            xdot.speed - u.push * p + z * u.brake,
            z - x.speed * x.speed - 0.1 * u.push * x.place,
        ]
    }
    #[function]
    fn price(x: &State, z: f64, u: &Control, p: f64, du: &Control) -> f64 {
        x.place * u.push * p + u.brake * u.brake * z + 0.1 * du.push * du.push * x.speed
    }
    #[function]
    fn limit(x: &State, z: f64, u: &Control, _p: f64) -> f64 {
        u.push * x.speed + z
    }
    #[function]
    fn end(x: &State, _z: f64, _u: &Control, _p: f64, q: [f64; 2]) -> f64 {
        x.place * q[0] + q[1] * q[1]
    }
}

/// The same with states `(place, speed, push, work, heat)`, controls `(brake, rate of the push)`.
#[dae]
fn by_hand(xdot: [f64; 5], x: [f64; 5], z: f64, u: [f64; 2], p: f64) -> [f64; 6] {
    [
        xdot[0] - x[1],
        xdot[1] - x[2] * p + z * u[0],
        z - x[1] * x[1] - 0.1 * x[2] * x[0],
        xdot[2] - u[1],
        xdot[3] - x[2] * x[1] * z,
        xdot[4] - u[0] * u[0],
    ]
}
#[function]
fn price_by_hand(x: [f64; 5], z: f64, u: [f64; 2], p: f64) -> f64 {
    x[0] * x[2] * p + u[0] * u[0] * z + 0.1 * u[1] * u[1] * x[1]
}
#[function]
fn limit_by_hand(x: [f64; 5], z: f64, _u: [f64; 2], _p: f64) -> f64 {
    x[2] * x[1] + z
}
#[function]
fn end_by_hand(x: [f64; 5], _z: f64, _u: [f64; 2], _p: f64) -> f64 {
    x[0] * x[3] + x[4] * x[4]
}

/// At any point with any multipliers, with constraints at points inside.
#[test]
fn quadratic_programs_by_states() -> Test {
    const N: usize = 3;
    let irk = Options { steps: 2, ..Options::default() };
    let mut ocp = Problem::new(Irk::<Sledge, Gauss<2>>::new(irk)?)
        .running_cost(GeneralCost::<Price>::new())
        .path_constraints(Constraint::<Limit>::new([-1.0], [2.0]))
        .terminal_cost(GeneralCost::<End>::new())
        .on(Horizon::uniform(N, 0.3))?;
    let mut other = Problem::new(Irk::<ByHand, Gauss<2>>::new(irk)?)
        .running_cost(GeneralCost::<PriceByHand>::new())
        .path_constraints(Constraint::<LimitByHand>::new([-1.0], [2.0]))
        .terminal_cost(GeneralCost::<EndByHand>::new())
        .on(Horizon::uniform(N, 0.3))?;
    ocp.inside(&[0.4])?.free_initial_state().set_parameters(.., &[1.2])?;
    other.inside(&[0.4])?.free_initial_state().set_parameters(.., &[1.2])?;
    ocp.guess(&[0.5, 0.7], &[0.3, -0.4])?;
    assert_eq!((ocp.stage(N)?.x, ocp.stage(0)?.u), (&[0.5, 0.7, -0.4, 0.0, 0.0][..], &[0.3, 0.0][..]));
    let number = |k: usize, i: usize| (1.7 * k as f64 + 0.9 * i as f64 + 0.2).sin();
    for k in 0..=N {
        for iterate in [ocp.iterate_mut(), other.iterate_mut()] {
            let stage = iterate.stage_mut(k).ok_or("no stage")?;
            stage.x.iter_mut().enumerate().for_each(|(i, x)| *x = number(k, i));
            stage.u.iter_mut().enumerate().for_each(|(i, u)| *u = number(k + 7, i));
            stage.dynamics.iter_mut().enumerate().for_each(|(i, pi)| *pi = number(k + 9, i));
            stage.g_upper.iter_mut().enumerate().for_each(|(i, mu)| *mu = number(k + 5, i).abs());
        }
    }
    let none = Exact { convexification: Convexification::None };
    ocp.linearise(none)?;
    other.linearise(none)?;
    for (k, (one, two)) in stage_numbers(&ocp, 5).iter().zip(&stage_numbers(&other, 5)).enumerate() {
        assert_eq!(one.len(), two.len());
        for (i, (a, b)) in one.iter().zip(two).enumerate() {
            // Expressions may be simplified in another order: a few roundings.
            assert!(a == b || (a - b).abs() < 1e-12 * (1.0 + b.abs()), "stage {k}, {i}: {a} {b}");
        }
    }
    Ok(())
}

/// From rest to rest as fast as possible with a bounded jerk, over 4 m with 16 m/s³: the jerk is
/// `+ − − +` in quarters, and `T³ = 32 s / j`.
#[ode(linear = u, duration = p)]
mod train {
    fn train(x: [f64; 2], u: f64, _p: f64) -> [f64; 2] {
        [x[1], u]
    }
    #[function]
    fn time(_x: [f64; 2], _u: f64, p: f64) -> f64 {
        p
    }
}

#[test]
fn bounds_of_rates() -> Test {
    const N: usize = 4;
    let mut ocp = Problem::new(Erk::<Train, Rk4>::new(Options::default())?)
        .terminal_cost(GeneralCost::<Time>::new())
        .on(Horizon::free(N, 0.1..=20.0, 3.0))?;
    ocp.fix_initial_state(&[0.0, 0.0])?.guess(&[2.0, 1.0], &[0.0])?;
    ocp.bound("x[0]", N.., 4.0, 4.0)?.bound("x[1]", N.., 0.0, 0.0)?;
    // The acceleration is zero at both ends: at the first one too, where states are given.
    ocp.bound("u", ..1, 0.0, 0.0)?.bound("u", N.., 0.0, 0.0)?.bound("du", .., -16.0, 16.0)?;
    let mut by_sqp = ocp.clone();
    assert!(HeapIpm::new(&ocp)?.solve(&mut ocp)?.is_converged());
    assert!(HeapSqp::new(&by_sqp)?.solve(&mut by_sqp)?.is_converged());
    for ocp in [&mut ocp, &mut by_sqp] {
        let solution = ocp.solution()?;
        assert!((solution.end_time() - 2.0).abs() < 1e-6, "{}", solution.end_time());
        for (found, expected) in solution.control("u")?.iter().zip([0.0, 8.0, 0.0, -8.0, 0.0]) {
            assert!((found - expected).abs() < 1e-4, "{found} {expected}");
        }
        assert_eq!((solution.control("u")?.len(), solution.rate("du")?.len()), (N + 1, N));
        // Half of the way up it has half of the acceleration; in quarters it is a line.
        let dense = ocp.dense_solution(1)?;
        assert!((dense.control("u")?[1] - 4.0).abs() < 1e-4);
        assert_eq!(dense.control("u")?.len(), dense.times().len());
    }
    Ok(())
}

/// A chain of length 4 between points at heights 1 and 3, a metre apart: COPS 3.0, problem 4 (E. D.
/// Dolan, J. J. Moré, T. S. Munson, ANL/MCS-TM-273, 2004), whose value is 5.06848.
#[ode(linear = u, integrals(energy = x * (1.0 + u * u).sqrt(), length = (1.0 + u * u).sqrt()))]
mod chain {
    fn chain(_x: f64, u: f64) -> f64 {
        u
    }
    #[function]
    fn energy_of(_x: f64, _u: f64, q: [f64; 2]) -> f64 {
        q[0]
    }
}

#[test]
fn length_of_a_hanging_chain() -> Test {
    const N: usize = 50;
    let mut ocp = Problem::new(Erk::<Chain, Rk4>::new(Options { steps: 2, ..Options::default() })?)
        .terminal_cost(GeneralCost::<EnergyOf>::new())
        .on(Horizon::uniform(N, 1.0 / N as f64))?;
    ocp.fix_initial_state(&[1.0])?.bound("x", N.., 3.0, 3.0)?.bound("length", N.., 4.0, 4.0)?;
    for k in 0..=N {
        let t = k as f64 / N as f64;
        ocp.guess_stage(k, &[1.0 + 4.0 * t * t - 2.0 * t], &[8.0 * t - 2.0])?;
    }
    let outcome = HeapIpm::new(&ocp)?.solve(&mut ocp)?;
    assert!(outcome.is_converged(), "{outcome}");
    assert!((outcome.objective - 5.06848).abs() < 1e-4, "{}", outcome.objective);
    let solution = ocp.solution()?;
    let (energy, length) = (solution.integral("energy")?, solution.integral("length")?);
    assert!((energy[N] - outcome.objective).abs() < 1e-9 && (length[N] - 4.0).abs() < 1e-6);
    assert_eq!((energy[0], length.len()), (0.0, N + 1));
    Ok(())
}

/// Bryson and Denham: from rest to rest in the opposite direction, under a ceiling `l = 1/9`. With
/// the least effort `½ ∫ u²` it is `4 / (9 l) = 4` (A. E. Bryson, W. F. Denham, S. E. Dreyfus,
/// "Optimal programming problems with inequality constraints I", AIAA Journal 1, 1963), and `u` is
/// linear up to a third, zero up to two, and linear: on this grid nothing is lost but what the
/// ceiling lets through.
#[ode(linear = u, integrals(effort = 0.5 * u * u))]
mod ceiling {
    fn ceiling(x: [f64; 2], u: f64) -> [f64; 2] {
        [x[1], u]
    }
    #[function]
    fn all_effort(_x: [f64; 2], _u: f64, q: f64) -> f64 {
        q
    }
}

#[test]
fn constraint_between_nodes() -> Test {
    const N: usize = 15;
    let solved = |points: &[f64]| {
        let mut ocp = Problem::new(Irk::<Ceiling, Gauss<2>>::new(Options::default())?)
            .terminal_cost(GeneralCost::<AllEffort>::new())
            .on(Horizon::uniform(N, 1.0 / N as f64))?;
        ocp.inside(points)?.fix_initial_state(&[0.0, 1.0])?.guess(&[0.05, 0.0], &[-1.0])?;
        ocp.bound("x[0]", .., f64::NEG_INFINITY, 1.0 / 9.0)?;
        ocp.bound("x[0]", N.., 0.0, 0.0)?.bound("x[1]", N.., -1.0, -1.0)?;
        let outcome = HeapSqp::new(&ocp)?.solve(&mut ocp)?;
        assert!(outcome.is_converged(), "{outcome}");
        let solution = ocp.dense_solution(15)?;
        let highest = solution.state("x[0]")?.iter().fold(0.0, |highest: f64, &x| highest.max(x));
        Ok::<_, Box<dyn std::error::Error>>((outcome.objective, highest - 1.0 / 9.0))
    };
    let ((at_nodes, over), (at_points, above)) = (solved(&[])?, solved(&[0.25, 0.5, 0.75])?);
    // The tolerance of sequential quadratic programming.
    assert!((at_nodes - 4.0).abs() < 1e-6 && (at_points - 4.0).abs() < 1e-6, "{at_nodes} {at_points}");
    // Between nodes there is a way through the ceiling, between points hardly one.
    assert!(over > 1e-5 && above < 0.1 * over, "{over:e} {above:e}");
    Ok(())
}

#[test]
fn names_of_linear_controls_and_integrals() -> Test {
    let mut ocp = Problem::new(Irk::<Sledge, Gauss<2>>::new(Options::default())?)
        .running_cost(GeneralCost::<Price>::new())
        .on(Horizon::uniform(2, 0.3))?;
    ocp.set_parameters(.., &[1.2])?.fix_initial_state(&[0.0, 1.0])?.guess(&[0.5, 0.7], &[0.3, -0.4])?;
    ocp.bound("u.push", .., -1.0, 2.0)?.bound("du.push", .., -3.0, 4.0)?.bound("heat", 2.., 0.0, 0.5)?;
    let solution = ocp.solution()?;
    assert!(
        solution.csv().to_string().starts_with("t,x.place,x.speed,z,u.brake,u.push,du.push,work,heat,p\n")
    );
    let push = solution.get("u.push")?;
    assert_eq!((push.kind, push.values.len(), push.unit.as_str()), (Kind::Control, 3, "N"));
    assert_eq!((push.lower[0], push.upper[2]), (Some(-1.0), Some(2.0)));
    let rate = solution.get("du.push")?;
    assert_eq!((rate.kind, rate.lower[1], rate.unit.as_str()), (Kind::Rate, Some(-3.0), "N/s"));
    assert_eq!(solution.get("heat")?.kind, Kind::Integral);
    assert_eq!(solution.get("heat")?.upper[2], Some(0.5));
    let text = ocp.to_string();
    for line in [
        "2 states x.place, x.speed; 1 linear control u.push; 2 integrals work, heat; 2 controls u.brake, du.push",
        "-1 ≤ u.push ≤ 2 at stages 0..=2",
        "-3 ≤ du.push ≤ 4 at stages 0..=1",
        "work = 0 at stage 0",
    ] {
        assert!(text.contains(line), "{text}");
    }
    // It becomes the iterate again, and the guess of a finer problem.
    let mut other = ocp.clone();
    other.guess(&[0.0, 0.0], &[0.0, 0.0])?;
    assert_eq!(other.restore(&solution)?.solution()?, solution);
    let mut fine = Problem::new(Irk::<Sledge, Gauss<2>>::new(Options::default())?)
        .running_cost(GeneralCost::<Price>::new())
        .on(Horizon::uniform(4, 0.15))?;
    fine.set_parameters(.., &[1.2])?.fix_initial_state(&[0.0, 1.0])?;
    ocp.guess_stage(0, &[0.5, 0.7], &[0.3, 0.6])?;
    fine.guess_from(&ocp.solution()?)?;
    assert!((fine.stage(1)?.x[2] - 0.1).abs() < 1e-15);
    // Lengths are those of the model as it was written.
    let length = ocp.fix_initial_state(&[0.0; 5]).err().ok_or("five are too many")?;
    assert!(matches!(length, OcpError::Length { expected: 2, found: 5, .. }), "{length}");
    Ok(())
}
