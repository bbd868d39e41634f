//! A ball that hits the ground at a time that is found.

use crate::Test;
use casados::ocp::{
    ExactFormulation, GeneralCost, HeapIpm, HeapOcp, HeapSqp, Horizon, Jump, OcpError, Phases, Problem,
};
use casados::prelude::*;

/// Height and speed, in m and m/s, and the place along the ground; a wind that is a control.
///
/// - `t`: s
#[ode(duration = p.duration)]
mod ball {
    pub struct State {
        pub height: f64,
        pub speed: f64,
        pub place: f64,
        pub drift: f64,
    }
    pub struct Flight {
        pub duration: f64,
        pub gravity: f64,
    }
    pub fn ball(x: &State, u: f64, p: &Flight) -> State {
        State { height: x.speed, speed: -p.gravity, place: x.drift, drift: u }
    }
    /// What the ground leaves of the speed, and of the drift.
    #[function]
    fn impact(x: &State, _u: f64, _p: &Flight) -> [f64; 4] {
        [x.height, -0.8 * x.speed, x.place, 0.9 * x.drift]
    }
    #[function]
    fn effort(_x: &State, u: f64, _p: &Flight) -> f64 {
        u * u
    }
}

const GRAVITY: f64 = 9.81;

/// A ball that falls from a height and bounces `count` times, with a wind; durations of flights are
/// free.
fn flight_problem(
    count: usize,
    n: usize,
    guess: f64,
) -> Result<Vec<HeapOcp<impl ExactFormulation<f64>>>, OcpError> {
    let flight = |index: usize| {
        let mut flight = Problem::new(Irk::<Ball, Gauss<2>>::new(Options::default())?)
            .running_cost(GeneralCost::<Effort>::new())
            .on(Horizon::free(n, 0.01..=10.0, guess))?;
        flight.set_parameters(.., &[0.0, GRAVITY])?.guess(&[0.5, 0.0, 0.0, 0.0], &[0.0])?;
        if index < count {
            flight.bound("x.height", n.., 0.0, 0.0)?;
        } else {
            // At the top.
            flight.bound("x.speed", n.., 0.0, 0.0)?.bound("x.place", n.., 1.0, 1.0)?;
        }
        Ok(flight)
    };
    let mut flights = (0..=count).map(flight).collect::<Result<Vec<_>, OcpError>>()?;
    flights[0].fix_initial_state(&[2.0, 0.0, 0.0, 0.0])?;
    Ok(flights)
}

/// The times of flights: they fall by `½ g T²`, rise with what an impact leaves of the speed.
fn exact_durations(count: usize) -> Vec<f64> {
    let fall = (2.0 * 2.0 / GRAVITY).sqrt();
    let speed = |bounces: i32| GRAVITY * fall * 0.8_f64.powi(bounces);
    (0..=count)
        .map(|index| match index {
            0 => fall,
            _ if index < count => 2.0 * speed(index as i32) / GRAVITY,
            _ => speed(index as i32) / GRAVITY,
        })
        .collect()
}

#[test]
fn times_of_impact() -> Test {
    for count in [1, 3] {
        for by_sqp in [false, true] {
            let mut flights = flight_problem(count, 6, 0.6)?;
            let (first, others) = flights.split_first_mut().ok_or("none")?;
            let bounces =
                others.iter_mut().fold(Phases::new(first), |all, next| all.then(Jump::<Impact>::new(), next));
            let mut bounces = bounces.join()?;
            let outcome = if by_sqp {
                HeapSqp::new(&bounces)?.solve(&mut bounces)?
            } else {
                HeapIpm::new(&bounces)?.solve(&mut bounces)?
            };
            assert!(outcome.is_converged(), "{count} {by_sqp}: {outcome}");
            drop(bounces);
            for (index, (flight, expected)) in flights.iter_mut().zip(exact_durations(count)).enumerate() {
                let solution = flight.solution()?;
                assert!((solution.end_time() - expected).abs() < 1e-7, "{index}: {}", solution.end_time());
                let fall: f64 = solution.state("x.speed")?[0] - solution.state("x.speed")?[6];
                assert!((fall - GRAVITY * expected).abs() < 1e-6);
                // The parameter that is not found is what was set.
                assert_eq!(solution.parameter("p.gravity")?[0], GRAVITY);
            }
        }
    }
    Ok(())
}

/// The best wind of one bounce, by Pontryagin's principle in closed form: it falls linearly in each
/// flight, with the multipliers of the place and of the drift, of which the impact leaves 0.9. Both
/// flights last as long as gravity says.
#[test]
fn multipliers_across_an_impact() -> Test {
    let mut flights = flight_problem(1, 200, 0.6)?;
    let [first, second] = &mut flights[..] else { return Err("two".into()) };
    let mut bounce = Phases::new(first).then(Jump::<Impact>::new(), second).join()?;
    let outcome = HeapIpm::new(&bounce)?.solve(&mut bounce)?;
    assert!(outcome.is_converged(), "{outcome}");
    drop(bounce);
    let [t1, t2] = exact_durations(1)[..] else { return Err("two".into()) };
    // u₂ = ½ λ (t₂ − t), u₁ = ½ λ (t₁ − t + 0.9 t₂), where λ is the multiplier of the place: a
    // metre is ½ λ times the integral of the squares of what ½ λ is multiplied by.
    let squares = (t2.powi(3) + (t1 + 0.9 * t2).powi(3) - (0.9 * t2).powi(3)) / 3.0;
    let lambda = 2.0 / squares;
    let (one, other) = (flights[0].solution()?, flights[1].solution()?);
    let start = 0.5 * lambda * (t1 + 0.9 * t2);
    // The control of an interval is the mean of the line in it. Of the squares stairs lose the
    // twelfth of those of an interval, 2e-6 of them.
    let h = t1 / 200.0;
    let first = one.control("u")?[0];
    assert!((first - (start - 0.25 * lambda * h)).abs() < 2e-5 * start, "{first} {start}");
    let h = t2 / 200.0;
    let first = other.control("u")?[0];
    assert!((first - 0.5 * lambda * (t2 - 0.5 * h)).abs() < 2e-5 * start, "{first}");
    assert!((outcome.objective - 0.25 * lambda * lambda * squares).abs() < 2e-5 * outcome.objective);
    Ok(())
}

/// From guesses a tenth to three times the durations of flights. Equations determine the durations:
/// steps from feasible points change only multipliers.
#[test]
fn distant_guesses_of_durations() -> Test {
    for guess in [0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 1.0, 2.0] {
        for by_sqp in [false, true] {
            let mut flights = flight_problem(1, 6, guess)?;
            let [first, second] = &mut flights[..] else { return Err("two".into()) };
            let mut bounce = Phases::new(first).then(Jump::<Impact>::new(), second).join()?;
            let outcome = if by_sqp {
                HeapSqp::new(&bounce)?.solve(&mut bounce)?
            } else {
                HeapIpm::new(&bounce)?.solve(&mut bounce)?
            };
            assert!(outcome.is_converged(), "{guess} {by_sqp}: {outcome}");
            drop(bounce);
            for (flight, expected) in flights.iter_mut().zip(exact_durations(1)) {
                assert!((flight.solution()?.end_time() - expected).abs() < 1e-7);
            }
        }
    }
    Ok(())
}
