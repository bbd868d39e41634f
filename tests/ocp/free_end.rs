//! Free end times: the QP against that of time scaled by hand, closed forms, published values, and
//! mistakes by name.

use crate::Test;
use casados::ocp::{
    Collocation, Constraint, Exact, Formulation, GaussNewton, GeneralCost, HeapIpm, HeapOcp, HeapSqp,
    Horizon, LeastSquaresCost, OcpError, Problem, WithIntegral,
};
use casados::prelude::*;
use core::f64::consts::PI;

/// A model with the time, an algebraic state and rates that are not explicit, in seconds; and with
/// the time scaled by hand, the duration as a state.
#[dae]
mod pumps {
    fn equations(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, t: f64) -> [f64; 3] {
        [
            (1.0 + 0.1 * x[0] * x[0]) * xdot[0] + 0.3 * xdot[1] - x[1] * t.cos() + 0.1 * z * x[0],
            xdot[1] + 0.05 * xdot[1] * xdot[1] * xdot[1] - u + z + 0.2 * x[1] * x[1] * t,
            z * (1.0 + 0.1 * z * z) - x[0] * (0.5 * t).sin() - 0.3 * x[1] * u,
        ]
    }
    #[dae(duration = p)]
    fn in_seconds(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, _p: f64, t: f64) -> [f64; 3] {
        equations(xdot, x, z, u, t)
    }
    #[dae]
    fn by_hand(xdot: [f64; 3], x: [f64; 3], z: f64, u: f64, t: f64) -> [f64; 4] {
        let [_, _, duration] = x;
        let rates = [xdot[0] / duration, xdot[1] / duration];
        let [a, b, c] = equations(rates, [x[0], x[1]], z, u, duration * t);
        [duration * a, duration * b, xdot[2], c]
    }

    fn cost(x: [f64; 2], z: f64, u: f64, p: f64, t: f64) -> f64 {
        x[0] * x[0] * (2.0 + t.sin()) + z * x[1] + u * u + 0.1 * p * p * x[1]
    }
    #[function(duration = p)]
    fn price(x: [f64; 2], z: f64, u: f64, p: f64, t: f64) -> f64 {
        cost(x, z, u, p, t)
    }
    #[function]
    fn price_by_hand(x: [f64; 3], z: f64, u: f64, t: f64) -> f64 {
        x[2] * cost([x[0], x[1]], z, u, x[2], x[2] * t)
    }
    #[function(duration = p)]
    fn limit(x: [f64; 2], z: f64, u: f64, p: f64, t: f64) -> [f64; 2] {
        [x[0] * t + z * u, p * p * x[1]]
    }
    #[function]
    fn limit_by_hand(x: [f64; 3], z: f64, u: f64, t: f64) -> [f64; 2] {
        [x[0] * t * x[2] + z * u, x[2] * x[2] * x[1]]
    }
    #[function]
    fn end(x: [f64; 2], _z: f64, _u: f64, p: f64, _t: f64) -> f64 {
        x[0] * p
    }
    #[function]
    fn end_by_hand(x: [f64; 3], _z: f64, _u: f64, _t: f64) -> f64 {
        x[0] * x[2]
    }
}

#[test]
fn quadratic_programs_by_scaled_time() -> Test {
    const N: usize = 4;
    let parts = [0.0, 0.1, 0.4, 0.7, 1.0];
    let options = Options { steps: 2, ..Options::default() };
    let (lower, upper) = ([-1.0, 0.0], [2.0, 1.0]);
    let mut free = Problem::new(Irk::<InSeconds, RadauIIA<2>>::new(options)?)
        .running_cost(GeneralCost::<Price>::new())
        .path_constraints(Constraint::<Limit>::new(lower, upper))
        .terminal_cost(GeneralCost::<End>::new())
        .on(Horizon::free_nodes(&parts, 0.5..=4.0, 1.7))?;
    let mut by_hand = Problem::new(Irk::<ByHand, RadauIIA<2>>::new(options)?)
        .running_cost(GeneralCost::<PriceByHand>::new())
        .path_constraints(Constraint::<LimitByHand>::new(lower, upper))
        .terminal_cost(GeneralCost::<EndByHand>::new())
        .on(Horizon::nodes(&parts))?;
    free.free_initial_state();
    by_hand.free_initial_state();
    for k in 0..=N {
        let t = k as f64;
        let (x, u) = ([0.4 + 0.1 * t, 0.2 - 0.2 * t.sin()], [0.3 * t.cos()]);
        let u = if k < N { &u[..] } else { &[] };
        free.guess_stage(k, &x, u)?;
        by_hand.guess_stage(k, &[x[0], x[1], 1.7], u)?;
        let (a, b) = (free.iterate_mut().stage_mut(k), by_hand.iterate_mut().stage_mut(k));
        let (a, b) = (a.ok_or("no stage")?, b.ok_or("no stage")?);
        for (i, multiplier) in [0.7, -0.4].into_iter().enumerate().take(a.dynamics.len()) {
            (a.dynamics[i], b.dynamics[i]) = (multiplier + 0.1 * t, multiplier + 0.1 * t);
        }
        for i in 0..a.g_upper.len() {
            (a.g_upper[i], b.g_upper[i]) = (0.3 * (i as f64 + 1.0), 0.3 * (i as f64 + 1.0));
            (a.g_lower[i], b.g_lower[i]) = (0.1 * t, 0.1 * t);
        }
    }
    let none = casados::ocp::Convexification::None;
    free.linearise(Exact { convexification: none })?;
    by_hand.linearise(Exact { convexification: none })?;
    for (k, (a, b)) in stage_numbers(&free, 2).iter().zip(stage_numbers(&by_hand, 3)).enumerate() {
        assert_eq!(a.len(), b.len(), "{k}");
        for (i, (a, b)) in a.iter().zip(b).enumerate() {
            assert!((a - b).abs() < 1e-10 * (1.0 + b.abs()), "stage {k}, {i}: {a} {b}");
        }
    }
    // Objectives, and the gradient without second derivatives.
    let (one, other) = (free.residuals().1, by_hand.residuals().1);
    assert!((one - other).abs() < 1e-12 * other.abs(), "{one} {other}");
    free.linearise(GaussNewton { convexification: none })?;
    assert!((free.residuals().1 - other).abs() < 1e-12 * other.abs());
    Ok(())
}

/// As in the tests of free parameters.
fn stage_numbers<P: Formulation<f64>>(ocp: &HeapOcp<P>, states: usize) -> Vec<Vec<f64>> {
    crate::free_parameters::stage_numbers(ocp, states)
}

/// A car that goes a distance from rest to rest, with bounded acceleration: `2 √(s/a)`.
#[ode(duration = p.duration)]
mod car {
    pub struct Trip {
        pub duration: f64,
        pub limit: f64,
    }
    pub fn car(x: [f64; 2], u: f64, _p: &Trip) -> [f64; 2] {
        [x[1], u]
    }
    #[function]
    fn time(_x: [f64; 2], _u: f64, _p: &Trip) -> f64 {
        1.0
    }
    #[function]
    fn duration(_x: [f64; 2], _u: f64, p: &Trip) -> f64 {
        p.duration
    }
    #[function]
    fn force(_x: [f64; 2], u: f64, p: &Trip) -> [f64; 2] {
        [u - p.limit, -u - p.limit]
    }
    #[function]
    fn clock(_x: [f64; 2], _u: f64, _p: &Trip, t: f64) -> f64 {
        t
    }
}

#[test]
fn minimum_time_car() -> Test {
    const N: usize = 20;
    let expected = 2.0 * (100.0_f64 / 2.0).sqrt();
    let irk = || Irk::<Car, Gauss<2>>::new(Options::default());
    let free = Horizon::free(N, 1.0..=60.0, 20.0);
    let below = Constraint::<Force>::new([f64::NEG_INFINITY; 2], [0.0; 2]);
    let mut running =
        Problem::new(irk()?).running_cost(GeneralCost::<Time>::new()).path_constraints(below).on(free)?;
    let mut terminal = Problem::new(irk()?)
        .terminal_cost(GeneralCost::<Duration>::new())
        .path_constraints(below)
        .on(free)?;
    running.set_parameters(.., &[f64::MAX, 2.0])?;
    terminal.set_parameters(.., &[f64::MAX, 2.0])?;
    running.fix_initial_state(&[0.0; 2])?.guess(&[50.0, 5.0], &[0.0])?;
    running.bound("x[0]", N.., 100.0, 100.0)?.bound("x[1]", N.., 0.0, 0.0)?;
    terminal.fix_initial_state(&[0.0; 2])?.guess(&[50.0, 5.0], &[0.0])?;
    terminal.bound("x[0]", N.., 100.0, 100.0)?.bound("x[1]", N.., 0.0, 0.0)?;
    assert!(HeapIpm::new(&running)?.solve(&mut running)?.is_converged());
    assert!(HeapSqp::new(&terminal)?.solve(&mut terminal)?.is_converged());
    for (solution, what) in [(running.solution()?, "running"), (terminal.solution()?, "terminal")] {
        let end = solution.end_time();
        assert!((end - expected).abs() < 1e-5, "{what}: {end} {expected}");
        assert_eq!(solution.parameter("p.duration")?[0], end);
        assert!((solution.times()[N / 4] - 0.25 * end).abs() < 1e-14 * end);
        assert!((solution.state("x[1]")?[N / 2] - 2.0 * end / 2.0).abs() < 1e-4, "{what}");
    }
    let text = running.to_string();
    assert!(text.starts_with("Car: 20 intervals, t from 0 to p.duration, which is free\n"), "{text}");
    assert!(text.contains("1 ≤ p.duration ≤ 60\n"), "{text}");
    // Another grid takes it as a guess, by times as parts of the whole.
    let mut finer = Problem::new(irk()?)
        .running_cost(GeneralCost::<Time>::new())
        .path_constraints(below)
        .on(Horizon::free(2 * N, 1.0..=60.0, 3.0))?;
    finer.set_parameters(.., &[f64::MAX, 2.0])?.fix_initial_state(&[0.0; 2])?;
    let solution = running.solution()?;
    finer.guess_from(&solution)?;
    assert_eq!(finer.solution()?.end_time(), solution.end_time());
    assert_eq!(finer.stage(10)?.x, running.stage(5)?.x);
    Ok(())
}

/// Steering by a thrust of constant size: position, height, their rates; a direction.
#[ode(duration = p)]
fn thrust(x: [f64; 4], u: f64, _p: f64) -> [f64; 4] {
    let (s, c) = u.sin_cos();
    [x[2], x[3], 100.0 * c, 100.0 * s]
}
#[function]
fn thrust_time(_x: [f64; 4], _u: f64, p: f64) -> f64 {
    p
}

/// Linear tangent steering (PSOPT, COPS 3.0): 0.5545709.
#[test]
fn linear_tangent_steering() -> Test {
    let n = 40;
    let mut ocp = Problem::new(Erk::<Thrust, Rk4>::new(Options::default())?)
        .terminal_cost(GeneralCost::<ThrustTime>::new())
        .on(Horizon::free(n, 0.01..=10.0, 1.0))?;
    ocp.fix_initial_state(&[0.0; 4])?.bound("u", .., -PI / 2.0, PI / 2.0)?;
    ocp.bound("x[1]", n.., 5.0, 5.0)?.bound("x[2]", n.., 45.0, 45.0)?.bound("x[3]", n.., 0.0, 0.0)?;
    for k in 0..=n {
        let part = k as f64 / n as f64;
        ocp.guess_stage(k, &[0.0, 5.0 * part, 45.0 * part, 0.0], if k < n { &[0.0] } else { &[] })?;
    }
    let outcome = HeapIpm::new(&ocp)?.solve(&mut ocp)?;
    assert!(outcome.is_converged(), "{outcome}");
    let end = ocp.solution()?.end_time();
    assert!((end - 0.5545709).abs() < 1e-4 * 0.55, "{end}");
    Ok(())
}

/// A bead on a wire: position, depth below the start, speed; the angle of the wire.
#[ode(duration = p)]
fn bead(x: [f64; 3], u: f64, _p: f64) -> [f64; 3] {
    let (s, c) = u.sin_cos();
    [x[2] * s, x[2] * c, 9.80665 * c]
}
#[function]
fn one(_x: [f64; 3], _u: f64, _p: f64) -> f64 {
    1.0
}

/// The brachistochrone, ten metres ahead and five down (dymos): 1.8016, with the time as a running
/// cost, by both solvers and by collocation.
#[test]
fn brachistochrone() -> Test {
    let n = 40;
    let horizon = Horizon::free(n, 0.1..=20.0, 2.0);
    let cost = GeneralCost::<One>::new;
    let erk = Erk::<Bead, Rk4>::new(Options::default())?;
    let collocation = Collocation::new(Irk::<Bead, Gauss<2>>::new(Options::default())?)?;
    let mut shooting = prepared_problem(Problem::new(erk).running_cost(cost()).on(horizon)?)?;
    let mut collocated = prepared_problem(Problem::new(collocation).running_cost(cost()).on(horizon)?)?;
    let mut by_sqp = shooting.clone();
    assert!(HeapIpm::new(&shooting)?.solve(&mut shooting)?.is_converged());
    assert!(HeapIpm::new(&collocated)?.solve(&mut collocated)?.is_converged());
    assert!(HeapSqp::new(&by_sqp)?.solve(&mut by_sqp)?.is_converged());
    let ends = [shooting.solution()?, collocated.solution()?, by_sqp.solution()?].map(|s| s.end_time());
    for end in ends {
        assert!((end - 1.8016).abs() < 1e-4 * 1.8, "{ends:?}");
    }
    Ok(())
}

fn prepared_problem<P: Formulation<f64>>(
    mut ocp: HeapOcp<P>,
) -> Result<HeapOcp<P>, Box<dyn std::error::Error>> {
    let n = ocp.intervals();
    ocp.fix_initial_state(&[0.0; 3])?.bound("u", .., 0.0, 3.2)?;
    ocp.bound("x[0]", n.., 10.0, 10.0)?.bound("x[1]", n.., 5.0, 5.0)?;
    for k in 0..=n {
        let part = k as f64 / n as f64;
        ocp.guess_stage(k, &[10.0 * part, 5.0 * part, 10.0 * part], if k < n { &[1.0] } else { &[] })?;
    }
    Ok(ocp)
}

#[function]
fn effort_of_nothing(_x: [f64; 2], u: f64) -> f64 {
    u
}
#[ode]
fn cart(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u]
}

/// What cannot be is refused by name.
#[test]
fn invalid_arguments() -> Test {
    let irk = || Irk::<Car, Gauss<2>>::new(Options::default());
    let none = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
        .stage_cost(LeastSquaresCost::<EffortOfNothing>::diagonal(&[1.0]))
        .on(Horizon::free(4, 1.0..=2.0, 1.5));
    let error = none.err().ok_or("it has no duration")?;
    assert!(matches!(error, OcpError::FixedEndTime { model: "Cart" }));
    assert!(error.to_string().contains("`#[ode(duration = p.duration)]`"), "{error}");
    let on = |horizon: Horizon<'_, f64>| -> Result<OcpError, Box<dyn std::error::Error>> {
        Ok(Problem::new(irk()?).on(horizon).err().ok_or("it is accepted")?)
    };
    assert!(matches!(on(Horizon::free(4, 1.0..=2.0, 3.0))?, OcpError::OutOfRange { name: "p.duration", .. }));
    assert!(matches!(
        on(Horizon::free(4, 2.0..=1.0, 1.5))?,
        OcpError::CrossedBounds { name: "p.duration", .. }
    ));
    for range in [0.0..=1.0, -1.0..=1.0, f64::NAN..=1.0] {
        assert!(matches!(on(Horizon::free(4, range, 0.5))?, OcpError::Times { .. }));
    }
    assert!(matches!(on(Horizon::free(0, 1.0..=2.0, 1.5))?, OcpError::Missing { .. }));
    for parts in [&[0.0, 0.5, 0.9][..], &[0.1, 0.5, 1.0], &[0.0, 0.7, 0.6, 1.0]] {
        assert!(matches!(on(Horizon::free_nodes(parts, 1.0..=2.0, 1.5))?, OcpError::Times { .. }));
    }
    let clock =
        Problem::new(irk()?).running_cost(GeneralCost::<Clock>::new()).on(Horizon::free(4, 1.0..=2.0, 1.5));
    assert!(matches!(clock.err(), Some(OcpError::DependsOnTime { function: "Clock" })));
    let integral = Problem::new(WithIntegral::new(irk()?, Quadrature::<Time>::new()));
    let integral = integral.on(Horizon::free(4, 1.0..=2.0, 1.5));
    assert!(matches!(integral.err(), Some(OcpError::Unsupported { .. })));
    Ok(())
}
