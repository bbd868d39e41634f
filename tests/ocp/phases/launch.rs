//! The ascent of a Delta III to a transfer orbit, in four phases: D. A. Benson, "A Gauss
//! pseudospectral transcription for optimal control", thesis, MIT 2004; J. T. Betts, "Practical
//! methods for optimal control and estimation using nonlinear programming", 2nd edition, example
//! 6.15; PSOPT's example `launch`.

use crate::Test;
use casados::ocp::{
    Constraint, ExactFormulation, GeneralCost, HeapIpm, HeapOcp, HeapSqp, Horizon, Jump, OcpError, Outcome,
    Phases, Problem,
};
use casados::prelude::*;
use nalgebra::{Vector3, vector};

/// Megametres, kiloseconds, tonnes. The direction of the thrust is linear in time, one at nodes and
/// divided by its length between them.
#[ode(linear = u)]
mod ascent {
    use nalgebra::Vector3;

    pub struct State {
        /// From the centre of the earth.
        pub place: Vector3<f64>,
        pub velocity: Vector3<f64>,
        pub mass: f64,
    }
    pub struct Stage {
        /// t·Mm/ks², or kN.
        pub thrust: f64,
        /// t/ks, or kg/s.
        pub flow: f64,
        /// What is left behind at the end, t.
        pub dropped: f64,
        /// ks
        pub duration: f64,
    }
    pub const MU: f64 = 398.6012;
    pub const RADIUS: f64 = 6.378145;
    pub const OMEGA: f64 = 7.29211585e-2;
    const SCALE_HEIGHT: f64 = 7.2e-3;
    /// Half of 1.225 kg/m³, with a drag coefficient of 0.5 and 4 π m².
    const DRAG: f64 = 0.5 * 1.225e3 * 0.5 * 4.0 * core::f64::consts::PI;

    fn rates(x: &State, u: [f64; 3], p: &Stage) -> State {
        let thrust = Vector3::new(u[0], u[1], u[2]).normalize() * (p.thrust / x.mass);
        let distance = x.place.norm();
        let air = x.velocity - Vector3::new(-OMEGA * x.place[1], OMEGA * x.place[0], 0.0);
        let drag = DRAG * ((RADIUS - distance) / SCALE_HEIGHT).exp() * air.norm() / x.mass;
        let gravity = x.place * (MU / (distance * distance * distance));
        State { place: x.velocity, velocity: thrust - air * drag - gravity, mass: -p.flow }
    }
    #[ode(linear = u)]
    pub fn burn(x: &State, u: [f64; 3], p: &Stage) -> State {
        rates(x, u, p)
    }
    #[ode(linear = u, duration = p.duration)]
    pub fn insertion(x: &State, u: [f64; 3], p: &Stage) -> State {
        rates(x, u, p)
    }
    #[function(linear = u)]
    fn direction(_x: &State, u: [f64; 3], _p: &Stage) -> f64 {
        u[0] * u[0] + u[1] * u[1] + u[2] * u[2]
    }
    #[function(linear = u)]
    fn separation(x: &State, _u: [f64; 3], p: &Stage) -> State {
        State { place: x.place, velocity: x.velocity, mass: x.mass - p.dropped }
    }
    #[function(linear = u)]
    fn payload(x: &State, _u: [f64; 3], _p: &Stage) -> f64 {
        -x.mass
    }

    fn cross(a: Vector3<f64>, b: Vector3<f64>) -> Vector3<f64> {
        Vector3::new(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    }
    /// Angular momentum, and the eccentricity vector along the line of nodes of the orbit that is
    /// asked for, and across it in its plane.
    #[function(linear = u)]
    fn orbit(x: &State, _u: [f64; 3], _p: &Stage) -> [f64; 5] {
        let momentum = cross(x.place, x.velocity);
        let eccentricity = cross(x.velocity, momentum) / MU - x.place / x.place.norm();
        let (inclination, node) = (28.5_f64.to_radians(), 269.8_f64.to_radians());
        let nodes = Vector3::new(node.cos(), node.sin(), 0.0);
        let (level, steep) = (inclination.cos(), inclination.sin());
        let across = Vector3::new(-node.sin() * level, node.cos() * level, steep);
        [momentum[0], momentum[1], momentum[2], eccentricity.dot(&nodes), eccentricity.dot(&across)]
    }
}
use ascent::{MU, OMEGA, RADIUS};

/// Tonnes, of one booster with its propellant and without, of the first stage, of the second one,
/// and the payload; when boosters and the first stage are burnt out, and how long the second stage
/// burns, in ks.
const BOOSTER: [f64; 2] = [19.290, 19.290 - 17.010];
const FIRST_STAGE: [f64; 2] = [104.380, 104.380 - 95.550];
const SECOND_STAGE: [f64; 2] = [19.300, 19.300 - 16.820];
const PAYLOAD: f64 = 4.164;
const BURNS: [f64; 3] = [0.0752, 0.261, 0.7];

/// What [`orbit`](ascent) is of an ellipse: `√(μ a (1 − e²))` along the normal, and `e` at the
/// argument of the perigee.
fn target_orbit() -> [f64; 5] {
    let (a, e) = (24.361140_f64, 0.7308_f64);
    let [i, node, perigee] = [28.5_f64, 269.8, 130.5].map(f64::to_radians);
    let h = (MU * a * (1.0 - e * e)).sqrt();
    let normal = [i.sin() * node.sin(), -i.sin() * node.cos(), i.cos()];
    [h * normal[0], h * normal[1], h * normal[2], e * perigee.cos(), e * perigee.sin()]
}

/// `[thrust, flow, dropped, duration]` of a phase.
fn stage(phase: usize) -> [f64; 4] {
    let boosters = 628.5;
    let flow = (BOOSTER[0] - BOOSTER[1]) / BURNS[0];
    let (first, first_flow) = (1083.1, (FIRST_STAGE[0] - FIRST_STAGE[1]) / BURNS[1]);
    match phase {
        0 => [6.0 * boosters + first, 6.0 * flow + first_flow, 6.0 * BOOSTER[1], 0.0752],
        1 => [3.0 * boosters + first, 3.0 * flow + first_flow, 3.0 * BOOSTER[1], 0.0752],
        2 => [first, first_flow, FIRST_STAGE[1], 0.1106],
        _ => [110.094, (SECOND_STAGE[0] - SECOND_STAGE[1]) / BURNS[2], 0.0, 0.7],
    }
}

type Burning<P> = Result<HeapOcp<P>, OcpError>;

/// A phase of known duration, with a guess that follows from one direction.
fn burning_phase(
    phase: usize,
    n: usize,
    x0: &mut [f64; 7],
    u: [f64; 3],
) -> Burning<impl ExactFormulation<f64> + use<>> {
    let p = stage(phase);
    let direction = Constraint::<Direction>::new([1.0], [1.0]);
    let mut burning = Problem::new(Irk::<Burn, Gauss<4>>::new(Options::default())?)
        .path_constraints(direction)
        .on(Horizon::uniform(n, p[3] / n as f64))?;
    burning.set_parameters(.., &p)?.guess(x0, &u)?.free_initial_state().guess_by_simulation()?;
    x0.copy_from_slice(&burning.stage(n)?.x[..7]);
    x0[6] -= p[2];
    Ok(burning)
}

fn last_phase(n: usize, x0: &[f64; 7], u: [f64; 3]) -> Burning<impl ExactFormulation<f64> + use<>> {
    let direction = Constraint::<Direction>::new([1.0], [1.0]);
    let orbit = target_orbit();
    let mut last = Problem::new(Irk::<Insertion, Gauss<4>>::new(Options::default())?)
        .path_constraints(direction)
        .terminal_constraints((
            Constraint::<Orbit>::new(orbit, orbit),
            Constraint::<Direction>::new([1.0], [1.0]),
        ))
        .terminal_cost(GeneralCost::<Payload>::new())
        .on(Horizon::free(n, 0.1..=0.7, 0.65))?;
    last.set_parameters(.., &stage(3))?.guess(x0, &u)?.free_initial_state().guess_by_simulation()?;
    Ok(last)
}

/// The outcome with so many intervals in each phase, the duration of the last one, and how much
/// thrusts differ from their directions.
fn solve_launch(n: usize, by_sqp: bool) -> Result<(Outcome, f64), Box<dyn std::error::Error>> {
    let latitude = 28.5_f64.to_radians();
    let place = Vector3::new(RADIUS * latitude.cos(), 0.0, RADIUS * latitude.sin());
    let velocity = vector![0.0, OMEGA * place[0], 0.0];
    let mass = PAYLOAD + SECOND_STAGE[0] + FIRST_STAGE[0] + 9.0 * BOOSTER[0];
    let start = [place[0], place[1], place[2], velocity[0], velocity[1], velocity[2], mass];
    let mut x = start;
    // Up, then to the east.
    let up = [latitude.cos(), 0.0, latitude.sin()];
    let east = [0.3 * up[0], 0.95, 0.3 * up[2]];
    let mut first = burning_phase(0, n, &mut x, up)?;
    let mut second = burning_phase(1, n, &mut x, east)?;
    let mut third = burning_phase(2, n, &mut x, east)?;
    let mut fourth = last_phase(n, &x, east)?;
    first.fix_initial_state(&start)?;
    let mut launch = Phases::new(&mut first)
        .then(Jump::<Separation>::new(), &mut second)
        .then(Jump::<Separation>::new(), &mut third)
        .then(Jump::<Separation>::new(), &mut fourth)
        .join()?;
    let outcome = if by_sqp {
        let mut sqp = HeapSqp::new(&launch)?;
        let outcome = sqp.solve(&mut launch)?;
        println!("{}", sqp.log());
        outcome
    } else {
        let mut ipm = HeapIpm::new(&launch)?;
        let outcome = ipm.solve(&mut launch)?;
        println!("{}", ipm.log());
        outcome
    };
    drop(launch);
    Ok((outcome, fourth.solution()?.end_time()))
}

#[test]
fn published_final_mass() -> Test {
    // Betts: 7529.712412 kg after 924.139 s.
    const MASS: f64 = 7.529712412;
    const END: f64 = 0.924139;
    // PSOPT, with 18 to 25 nodes of Chebyshev's polynomials in a phase.
    const PSOPT: f64 = 7.529661;
    for (n, by_sqp) in [(8, false), (8, true), (16, false)] {
        let (outcome, duration) = solve_launch(n, by_sqp)?;
        println!("{n} {by_sqp} {outcome} {:.9} {:.7}", -outcome.objective, duration + 0.261);
        assert!(outcome.is_converged(), "{n} {by_sqp}: {outcome}");
        assert!((-outcome.objective - MASS).abs() < 1e-4);
        assert!((-outcome.objective - PSOPT).abs() < 1e-4);
        assert!((duration + 0.261 - END).abs() < 1e-5);
    }
    Ok(())
}
