//! Events that happen at one time, and what is no crossing.

use super::{assert_close, options};
use casados::prelude::*;
use nalgebra::{matrix, vector};

/// Two clocks that run down.
#[ode]
fn two(_x: [f64; 2]) -> [f64; 2] {
    [-1.0, -1.0]
}

#[function]
fn first_clock(x: [f64; 2]) -> f64 {
    x[0]
}

#[function]
fn second_clock(x: [f64; 2]) -> f64 {
    x[1]
}

#[function]
fn wind_first(x: [f64; 2]) -> [f64; 2] {
    [x[0] + 1.0, x[1]]
}

#[function]
fn wind_second(x: [f64; 2]) -> [f64; 2] {
    [x[0], x[1] + 1.0]
}

/// Takes the second clock over zero.
#[function]
fn wind_first_and_turn_back_second(x: [f64; 2]) -> [f64; 2] {
    [x[0] + 1.0, x[1] - 0.25]
}

macro_rules! clocks {
    ($method:ty, $events:expr) => {
        Hybrid::new(Adaptive::<Two, $method>::new(options(1e-8)).unwrap(), $events).unwrap()
    };
}

const FIRST: fn() -> Event<Two> = || Event::jump::<FirstClock, WindFirst>(Crossing::Falling);
const SECOND: fn() -> Event<Two> = || Event::jump::<SecondClock, WindSecond>(Crossing::Falling);

macro_rules! all_happen {
    ($method:ty) => {{
        let mut hybrid = clocks!($method, &[FIRST(), SECOND()]);
        let (x0, u) = (vector![1.0, 1.0], vector![]);
        let solution = hybrid.solve(&x0, &u, 3.5).unwrap();
        let happened: Vec<usize> = solution.occurrences.iter().map(|at| at.event).collect();
        assert_eq!(happened, [0, 1, 0, 1, 0, 1]);
        for (k, at) in solution.occurrences.iter().enumerate() {
            assert_close([at.t], [(1 + k / 2) as f64], 1e-13);
        }
        assert_close(solution.nominal.x, [0.5, 0.5], 1e-13);
        // Each is wound up at its own time.
        let forward = hybrid.forward(&x0, &u, 3.5).unwrap();
        assert_close(forward.dx_dx0, matrix![1.0, 0.0; 0.0, 1.0], 1e-12);
        for (k, time) in forward.times.iter().enumerate() {
            assert_close(time.x0, if k % 2 == 0 { [1.0, 0.0] } else { [0.0, 1.0] }, 1e-12);
        }
        let adjoint = hybrid.adjoint(&x0, &u, 3.5, &vector![2.0, -3.0]).unwrap();
        assert_close(adjoint.grad_x0, [2.0, -3.0], 1e-12);
        let second = hybrid.hessian(&x0, &u, 3.5, &vector![2.0, -3.0]).unwrap();
        assert_close(second.h_xx, [0.0; 4], 1e-9);
        assert_close(hybrid.dense(2.25).unwrap().x, [0.75, 0.75], 1e-12);
        // Backwards in time, where they rise.
        let events = [
            Event::jump::<FirstClock, WindFirst>(Crossing::Rising),
            Event::jump::<SecondClock, WindSecond>(Crossing::Rising),
        ];
        let backwards = clocks!($method, &events).solve(&vector![-1.0, -1.0], &u, -1.5).unwrap().clone();
        assert_eq!(backwards.occurrences.len(), 2);
        assert_close(backwards.nominal.x, [1.5, 1.5], 1e-13);
    }};
}

#[test]
fn simultaneous_events() {
    all_happen!(Radau);
    all_happen!(DormandPrince5);
    all_happen!(Gauss<3>);
}

/// Within one step, and nearer to each other than a bisection tells apart.
#[test]
fn events_in_order_of_time() {
    for gap in [1e-3, 1e-6, 1e-9, 1e-12] {
        let mut hybrid = clocks!(Radau, &[FIRST(), SECOND()]);
        let solution = hybrid.solve(&vector![1.0 + gap, 1.0], &vector![], 1.5).unwrap();
        let happened: Vec<usize> = solution.occurrences.iter().map(|at| at.event).collect();
        assert_eq!(happened, [1, 0], "{gap}");
        assert_close([solution.occurrences[0].t, solution.occurrences[1].t], [1.0, 1.0 + gap], 1e-14);
        assert_close(solution.nominal.x, [0.5 + gap, 0.5], 1e-13);
    }
}

#[test]
fn order_of_simultaneous_events() {
    let end = || Event::terminal::<SecondClock>(Crossing::Falling);
    let (x0, u) = (vector![1.0, 1.0], vector![]);
    // Behind a jump: this happens before.
    let solution = clocks!(Radau, &[FIRST(), end()]).solve(&x0, &u, 3.5).unwrap().clone();
    assert!(solution.terminal);
    assert_close([solution.t], [1.0], 1e-13);
    assert_close(solution.nominal.x, [1.0, 0.0], 1e-13);
    assert_eq!(solution.occurrences.len(), 2);
    // Before it: the jump does not happen.
    let solution = clocks!(Radau, &[end(), FIRST()]).solve(&x0, &u, 3.5).unwrap().clone();
    assert!(solution.terminal);
    assert_close(solution.nominal.x, [0.0, 0.0], 1e-13);
    assert_eq!(solution.occurrences.len(), 1);
}

/// A jump that takes another function from zero, or from one side of it to the other: no crossing.
#[test]
fn sign_changes_by_jumps() {
    let jump = Event::jump::<FirstClock, WindFirstAndTurnBackSecond>(Crossing::Falling);
    for second in [1.0, 1.125] {
        let mut hybrid = clocks!(Radau, &[jump, SECOND()]);
        let solution = hybrid.solve(&vector![1.0, second], &vector![], 1.5).unwrap();
        assert_eq!(solution.occurrences.len(), 1, "{second}");
        assert_close(solution.nominal.x, [0.5, second - 1.75], 1e-13);
    }
    // Where it stays above zero it falls through it later.
    let mut hybrid = clocks!(Radau, &[jump, SECOND()]);
    assert_eq!(hybrid.solve(&vector![1.0, 1.375], &vector![], 1.5).unwrap().occurrences.len(), 2);
}

#[test]
fn event_functions_that_start_at_zero() {
    let mut hybrid = clocks!(Radau, &[FIRST(), Event::terminal::<SecondClock>(Crossing::Falling)]);
    let solution = hybrid.solve(&vector![0.0, 0.0], &vector![], 0.5).unwrap();
    assert!(solution.occurrences.is_empty());
    assert_close(solution.nominal.x, [-0.5, -0.5], 1e-14);
}

/// Frozen, they happen as long as it is at one time.
#[test]
fn frozen_simultaneous_events() {
    let mut hybrid = clocks!(Radau, &[FIRST(), SECOND()]);
    let u = vector![];
    hybrid.solve(&vector![1.0, 1.0], &u, 1.5).unwrap();
    hybrid.freeze().unwrap();
    let solution = hybrid.solve(&vector![1.2, 1.2], &u, 1.5).unwrap();
    assert_close(solution.nominal.x, [0.7, 0.7], 1e-12);
    let error = hybrid.solve(&vector![1.2, 1.1], &u, 1.5).unwrap_err();
    assert!(matches!(error, Error::StepSizeUnderflow { .. }), "{error}");
}

#[ode]
fn fall(x: [f64; 2]) -> [f64; 2] {
    [x[1], -10.0]
}

#[function]
fn floor(x: [f64; 2]) -> f64 {
    x[0]
}

#[function]
fn rebound(x: [f64; 2]) -> [f64; 2] {
    [x[0], -x[1]]
}

/// The steps of a call are counted over all events.
#[test]
fn max_steps_over_all_events() {
    let event = Event::jump::<Floor, Rebound>(Crossing::Falling);
    let options = AdaptiveOptions { max_steps: 40, max_step: 0.1, ..options(1e-8) };
    let mut hybrid = Hybrid::new(Adaptive::<Fall, Radau>::new(options).unwrap(), &[event]).unwrap();
    let error = hybrid.solve(&vector![0.5, 0.0], &vector![], 100.0).unwrap_err();
    let Error::TooManySteps { steps, .. } = error else { panic!("{error}") };
    assert_eq!(steps, 40);
    assert_eq!(hybrid.integrator().options().max_steps, 40);
}
