//! Free parameters shared by several phases, and errors that contain the phase.

use super::kkt;
use crate::Test;
use casados::ocp::{Continuous, GeneralCost, HeapIpm, HeapSqp, Horizon, Jump, OcpError, Phases, Problem};
use casados::prelude::*;

/// The speed of a car that is pushed by 2 N for a free duration.
#[ode(duration = p.duration)]
mod push {
    pub struct Pushed {
        pub duration: f64,
        pub mass: f64,
    }
    pub fn push(_x: f64, p: &Pushed) -> f64 {
        2.0 / p.mass
    }
    #[function]
    fn time(_x: f64, _p: &Pushed) -> f64 {
        1.0
    }
}

/// The car is braked by 1 N for a second (speed), and rolls for another one (position, speed).
#[ode]
mod roll {
    pub struct Rolls {
        pub mass: f64,
        pub drag: f64,
    }
    #[ode]
    fn brake(_x: f64, p: &Rolls) -> f64 {
        -1.0 / p.mass
    }
    #[function]
    fn from_here(x: f64, _p: &Rolls) -> [f64; 2] {
        [0.0, x]
    }
    #[ode]
    fn rolling(x: [f64; 2], p: &Rolls) -> [f64; 2] {
        [x[1], -p.drag * x[1]]
    }
    #[function]
    fn lightness(_x: [f64; 2], p: &Rolls) -> f64 {
        4.0 / p.mass
    }
}

/// A metre after the last second: `v = (2 T − 1)/m = 1`, and `T + 4/m` is minimal for `m = √8`.
/// The mass is in the cost of the last phase, and in the dynamics of the others.
#[test]
fn parameters_are_shared() -> Test {
    for by_sqp in [false, true] {
        let mut push = Problem::new(Irk::<Push, Gauss<1>>::new(Options::default())?)
            .running_cost(GeneralCost::<Time>::new())
            .on(Horizon::free(3, 0.1..=20.0, 2.0))?;
        push.fix_initial_state(&[0.0])?.guess(&[1.0], &[])?.free("p.mass", 0.5..=9.0, 2.0)?;
        let mut brake =
            Problem::new(Irk::<Brake, Gauss<1>>::new(Options::default())?).on(Horizon::uniform(2, 0.5))?;
        brake.guess(&[1.0], &[])?.set_parameters(.., &[0.0; 2])?.free("p.mass", 0.1..=9.0, 3.0)?;
        let mut rolling = Problem::new(Irk::<Rolling, Gauss<2>>::new(Options::default())?)
            .terminal_cost(GeneralCost::<Lightness>::new())
            .on(Horizon::uniform(2, 0.5))?;
        rolling.guess(&[0.5, 1.0], &[])?.set_parameters(.., &[0.0; 2])?.bound("x[0]", 2.., 1.0, 1.0)?;
        rolling.free("p", 0.0..=9.0, 1.0)?.bound("p.drag", .., 0.0, 0.0)?;
        let mut drive = Phases::new(&mut push)
            .then(Continuous, &mut brake)
            .share("p.mass")
            .then(Jump::<FromHere>::new(), &mut rolling)
            .share("p.mass")
            .join()?;
        let outcome = if by_sqp {
            HeapSqp::new(&drive)?.solve(&mut drive)?
        } else {
            HeapIpm::new(&drive)?.solve(&mut drive)?
        };
        assert!(outcome.is_converged(), "{outcome}");
        kkt::check(&mut drive)?;
        drop(drive);
        let mass = 8.0_f64.sqrt();
        assert!((outcome.objective - (0.5 * (mass + 1.0) + 4.0 / mass)).abs() < 1e-7, "{outcome}");
        for found in [push.solution()?, brake.solution()?, rolling.solution()?] {
            assert!((found.parameter("p.mass")?[0] - mass).abs() < 1e-5);
        }
        assert!((push.solution()?.end_time() - 0.5 * (mass + 1.0)).abs() < 1e-5);
    }
    Ok(())
}

/// Bounds of both phases hold; each phase has the multipliers of its own bounds.
#[test]
fn bounds_of_shared_parameters() -> Test {
    let mut push = Problem::new(Irk::<Push, Gauss<1>>::new(Options::default())?)
        .running_cost(GeneralCost::<Time>::new())
        .on(Horizon::free(3, 0.1..=20.0, 2.0))?;
    push.fix_initial_state(&[0.0])?.guess(&[1.0], &[])?.free("p.mass", 0.5..=9.0, 2.0)?;
    let mut brake =
        Problem::new(Irk::<Brake, Gauss<1>>::new(Options::default())?).on(Horizon::uniform(2, 0.5))?;
    brake.guess(&[1.0], &[])?.set_parameters(.., &[0.0; 2])?.free("p.mass", 1.5..=9.0, 3.0)?;
    brake.bound("x", 2.., 1.0, 1.0)?;
    let mut drive = Phases::new(&mut push).then(Continuous, &mut brake).share("p.mass").join()?;
    assert!(HeapIpm::new(&drive)?.solve(&mut drive)?.is_converged());
    drop(drive);
    // The time is `(m + 1)/2`: a kilogram costs half a second.
    let (one, other) = (push.solution()?, brake.solution()?);
    assert!((one.parameter("p.mass")?[0] - 1.5).abs() < 1e-6);
    assert!((other.multiplier("p.mass")?[0] + 0.5).abs() < 1e-6, "{:?}", other.multiplier("p.mass")?);
    assert!(one.multiplier("p.mass")?[0].abs() < 1e-6, "{:?}", one.multiplier("p.mass")?);
    Ok(())
}

#[ode]
fn root(x: f64, _p: f64) -> f64 {
    x.sqrt()
}

#[test]
fn mistakes_are_named() -> Test {
    let mut push = Problem::new(Irk::<Push, Gauss<1>>::new(Options::default())?).on(Horizon::free(
        3,
        0.1..=20.0,
        2.0,
    ))?;
    push.fix_initial_state(&[0.0])?.guess(&[1.0], &[])?.set_parameters(.., &[0.0, 1.0])?;
    let mut brake =
        Problem::new(Irk::<Brake, Gauss<1>>::new(Options::default())?).on(Horizon::uniform(2, 0.5))?;
    brake.guess(&[1.0], &[])?.set_parameters(.., &[1.0, 0.0])?.free("p.mass", 0.1..=9.0, 3.0)?;
    for name in ["p.mass", "p.duration", "p.length"] {
        let error = Phases::new(&mut push).then(Continuous, &mut brake).share(name).join().err();
        let error = error.ok_or("it is shared")?;
        assert!(matches!(error, OcpError::Phase { phase: 1, model: "Brake", .. }), "{error}");
        assert!(error.to_string().contains("free in it and in the phase before"), "{error}");
    }
    // The first phase has no phase before it.
    let error = Phases::new(&mut push).share("p.mass").join().err().ok_or("it is shared")?;
    assert!(matches!(error, OcpError::Phase { phase: 0, .. }), "{error}");
    // Errors of an interval contain its phase.
    let mut below =
        Problem::new(Irk::<Root, Gauss<1>>::new(Options::default())?).on(Horizon::uniform(2, 0.5))?;
    below.guess(&[-1.0], &[])?.set_parameters(.., &[0.0])?;
    let mut both = Phases::new(&mut push).then(Continuous, &mut below).join()?;
    let error = HeapSqp::new(&both)?.solve(&mut both).err().ok_or("it has a value")?;
    assert!(matches!(error, OcpError::Integration { phase: Some(1), .. }), "{error}");
    assert!(error.to_string().contains("interval 0 of phase 1: "), "{error}");
    Ok(())
}
