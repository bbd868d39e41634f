//! Goddard's rocket, as one phase and as three, and the reentry of the shuttle.

use crate::Test;
use casados::ocp::{Continuous, GeneralCost, HeapIpm, HeapSqp, Horizon, Phases, Problem};
use casados::prelude::*;

/// Distance from the centre of the earth, speed and mass, all relative; `u` is the thrust.
#[ode(duration = p)]
pub mod rocket {
    pub struct State {
        pub distance: f64,
        pub speed: f64,
        pub mass: f64,
    }
    pub fn rocket(x: &State, u: f64, _p: f64) -> State {
        let drag = 310.0 * x.speed * x.speed * (-500.0 * (x.distance - 1.0)).exp();
        let gravity = 1.0 / (x.distance * x.distance);
        State { distance: x.speed, speed: (u - drag) / x.mass - gravity, mass: -2.0 * u }
    }
    /// The same model with a thrust linear in time.
    #[ode(linear = u, duration = p)]
    pub fn throttled(x: &State, u: f64, p: f64) -> State {
        rocket(x, u, p)
    }
    #[function]
    pub fn depth(x: &State, _u: f64, _p: f64) -> f64 {
        -x.distance
    }
}

const COPS: f64 = 1.01283;
pub const THRUST: f64 = 3.5;

/// Maximum altitude with a propellant of 0.4 of the mass.
#[test]
fn goddards_rocket() -> Test {
    const N: usize = 50;
    let mut ocp = Problem::new(Irk::<Rocket, Gauss<2>>::new(Options::default())?)
        .terminal_cost(GeneralCost::<Depth>::new())
        .on(Horizon::free(N, 0.05..=1.0, 0.2))?;
    ocp.fix_initial_state(&[1.0, 0.0, 1.0])?.bound("x.mass", N.., 0.6, 0.6)?.bound("u", .., 0.0, THRUST)?;
    for k in 0..=N {
        let part = k as f64 / N as f64;
        let x = [1.0 + 0.01 * part, 0.2 * part * (1.0 - part), 1.0 - 0.4 * part];
        ocp.guess_stage(k, &x, if k < N { &[0.5 * THRUST] } else { &[] })?;
    }
    let outcome = HeapIpm::new(&ocp)?.solve(&mut ocp)?;
    assert!(outcome.is_converged(), "{outcome}");
    assert!((outcome.objective + COPS).abs() < 1e-5, "{outcome}");
    Ok(())
}

/// Full thrust, singular arc, coasting; both switching times and the end time are free.
#[test]
fn goddards_rocket_in_phases() -> Test {
    let rocket = || Irk::<Rocket, Gauss<3>>::new(Options::default());
    for by_sqp in [false, true] {
        let mut burn = Problem::new(rocket()?).on(Horizon::free(4, 0.002..=0.2, 0.02))?;
        let mut singular = Problem::new(Irk::<Throttled, Gauss<3>>::new(Options::default())?)
            .on(Horizon::free(8, 0.002..=0.2, 0.05))?;
        let mut coast = Problem::new(rocket()?)
            .terminal_cost(GeneralCost::<Depth>::new())
            .on(Horizon::free(8, 0.01..=0.5, 0.12))?;
        burn.fix_initial_state(&[1.0, 0.0, 1.0])?.guess(&[1.0, 0.05, 0.95], &[THRUST])?;
        burn.bound("u", .., THRUST, THRUST)?;
        singular.guess(&[1.005, 0.1, 0.75], &[1.5])?.bound("u", .., 0.0, THRUST)?;
        singular.bound("x.mass", 8.., 0.6, 0.6)?;
        coast.guess(&[1.01, 0.05, 0.6], &[0.0])?.bound("u", .., 0.0, 0.0)?;
        let mut flight =
            Phases::new(&mut burn).then(Continuous, &mut singular).then(Continuous, &mut coast).join()?;
        let outcome = if by_sqp {
            HeapSqp::new(&flight)?.solve(&mut flight)?
        } else {
            HeapIpm::new(&flight)?.solve(&mut flight)?
        };
        assert!(outcome.is_converged(), "{outcome}");
        assert!((outcome.objective + COPS).abs() < 1e-5, "{outcome}");
    }
    Ok(())
}

/// Feet, seconds, radians; angle of attack in degrees.
#[ode(duration = p)]
mod reentry {
    pub struct State {
        pub height: f64,
        pub latitude: f64,
        pub speed: f64,
        /// The flight path angle.
        pub slope: f64,
        pub azimuth: f64,
    }
    pub struct Angles {
        pub attack: f64,
        pub bank: f64,
    }
    const MASS: f64 = 203_000.0 / 32.174;
    const RADIUS: f64 = 20_902_900.0;
    const MU: f64 = 0.140_765_39e17;

    pub fn reentry(x: &State, u: &Angles, _p: f64) -> State {
        let (v, attack) = (x.speed, u.attack);
        let pressure = 0.5 * 0.002378 * (-x.height / 23_800.0).exp() * v * v * 2690.0;
        let lift = (-0.20704 + 0.029244 * attack) * pressure / MASS;
        let drag = (0.07854 - 0.61592e-2 * attack + 0.621408e-3 * attack * attack) * pressure / MASS;
        let r = RADIUS + x.height;
        let gravity = MU / (r * r);
        let (ss, cs) = x.slope.sin_cos();
        let (sa, ca) = x.azimuth.sin_cos();
        let (sb, cb) = u.bank.sin_cos();
        State {
            height: v * ss,
            latitude: v / r * cs * ca,
            speed: -drag - gravity * ss,
            slope: lift / v * cb + cs * (v / r - gravity / v),
            azimuth: lift * sb / (v * cs) + v / r * cs * sa * x.latitude.tan(),
        }
    }
    #[function]
    fn to_the_south(x: &State, _u: &Angles, _p: f64) -> f64 {
        -x.latitude
    }
}

/// The largest cross-range, in degrees (PSOPT's example `shuttle_reentry`: 34.14120; the problem is
/// in J. T. Betts, "Practical methods for optimal control and estimation using nonlinear
/// programming").
#[test]
fn reentry_of_the_shuttle() -> Test {
    const N: usize = 60;
    let degree = core::f64::consts::PI / 180.0;
    let erk = Erk::<Reentry, Rk4>::new(Options { steps: 3, ..Options::default() })?;
    let mut ocp = Problem::new(erk).terminal_cost(GeneralCost::<ToTheSouth>::new()).on(Horizon::free(
        N,
        500.0..=4000.0,
        2000.0,
    ))?;
    ocp.fix_initial_state(&[260_000.0, 0.0, 25_600.0, -degree, 90.0 * degree])?;
    ocp.bound("x.height", N.., 80_000.0, 80_000.0)?.bound("x.speed", N.., 2500.0, 2500.0)?;
    ocp.bound("x.slope", N.., -5.0 * degree, -5.0 * degree)?;
    ocp.bound("x.height", ..N, 0.0, 300_000.0)?.bound("x.latitude", .., -89.0 * degree, 89.0 * degree)?;
    ocp.bound("x.speed", ..N, 1.0, 40_000.0)?.bound("x.slope", ..N, -89.0 * degree, 89.0 * degree)?;
    ocp.bound("u.attack", .., -90.0, 90.0)?.bound("u.bank", .., -89.0 * degree, degree)?;
    for k in 0..=N {
        let part = k as f64 / N as f64;
        let x = [
            260_000.0 - 180_000.0 * part,
            0.0,
            25_600.0 - 23_100.0 * part,
            -degree * (1.0 + 4.0 * part),
            90.0 * degree,
        ];
        ocp.guess_stage(k, &x, if k < N { &[10.0, -0.5] } else { &[] })?;
    }
    let outcome = HeapIpm::new(&ocp)?.solve(&mut ocp)?;
    assert!(outcome.is_converged(), "{outcome}");
    assert!((-outcome.objective / degree - 34.1412).abs() < 1e-4 * 34.1412, "{outcome}");
    Ok(())
}
