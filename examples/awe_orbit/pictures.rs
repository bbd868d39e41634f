//! What is drawn of a solution: the orbit with the attitude of the aircraft; states, controls and
//! constraints over time.

use crate::awe::Awe;
use crate::awe::awe::{LENGTH, State, TETHER_SCALE, TURBINE_SCALE, power};
use casados::plot::{Figure, Panel, Space};
use casados::prelude::*;
use casados::qp::HeapSolution;
use nalgebra::{Matrix3, SVector, Vector3};

/// The aircraft is drawn so many times larger than it is.
const AIRCRAFT_SCALE: f64 = 3.0;
/// Wing, fuselage, tailplane and fin: metres along the chord, the span and upwards.
const AIRCRAFT: [[[f64; 3]; 2]; 4] = [
    [[0.0, -2.75, 0.0], [0.0, 2.75, 0.0]],
    [[-0.6, 0.0, 0.0], [2.2, 0.0, 0.0]],
    [[2.2, -0.7, 0.0], [2.2, 0.7, 0.0]],
    [[2.2, 0.0, 0.0], [2.4, 0.0, 0.8]],
];

/// A solution.
pub struct Picture {
    states: Vec<State>,
    controls: Vec<[f64; 4]>,
    /// N
    tensions: Vec<f64>,
    h: f64,
}

impl Picture {
    /// Of an orbit with intervals of length `h`.
    ///
    /// # Errors
    /// Those of the integrator.
    pub fn of_orbit(solution: &HeapSolution, h: f64) -> Result<Self, casados::Error> {
        let mut irk = Irk::<Awe, RadauIIA<4>>::new(Options { start: Start::Zero, ..Default::default() })?;
        let (mut states, mut controls, mut tensions) = (Vec::new(), Vec::new(), Vec::new());
        for stage in solution.stages() {
            let x = SVector::<f64, 23>::from_column_slice(stage.x);
            states.push(State {
                q: x.fixed_rows::<3>(0).into(),
                dq: x.fixed_rows::<3>(3).into(),
                omega: x.fixed_rows::<3>(6).into(),
                r: Matrix3::from_column_slice(&stage.x[9..18]),
                delta: x.fixed_rows::<3>(18).into(),
                kappa: x[21],
                cost: x[22],
            });
            if stage.u.len() == 4 {
                controls.push(std::array::from_fn(|i| stage.u[i]));
                let step = irk.solve(&x, &SVector::from_column_slice(stage.u), h)?;
                tensions.push(TETHER_SCALE * step.z0[0] * LENGTH);
            }
        }
        Ok(Self { states, controls, tensions, h })
    }

    /// The orbit, with the aircraft at every other node.
    pub fn orbit_figure(&self) -> Figure {
        let space = Space::new("Orbit of most power; the aircraft three times its size")
            .axes(["with the wind, m", "across, m", "height, m"])
            .seen_from(-160.0, 12.0)
            .coloured("kW", self.states.iter().map(|state| (state.q.into(), power(state) / 1e3)));
        let space = self.states.iter().step_by(2).fold(space, |space, state| {
            let at = |point: [f64; 3]| (state.q + AIRCRAFT_SCALE * (state.r * Vector3::from(point))).into();
            AIRCRAFT.into_iter().fold(space, |space, line| space.outline(line.map(at)))
        });
        Figure::new().size(680, 560).with(space)
    }

    /// Six panels over time.
    pub fn time_panels(&self) -> Figure {
        let times = || (0..).map(|k| self.h * f64::from(k));
        let panel = |title: &str, unit: &str| Panel::new(title).x("time, s").y(unit);
        let of_state = |of: fn(&State) -> f64| times().zip(self.states.iter().map(of));
        let deflection = |i: usize| times().zip(self.states.iter().map(move |s| s.delta[i].to_degrees()));
        // Controls are held: the last one until the end.
        let held = self.controls.iter().chain(self.controls.last());
        let rate = |i: usize| times().zip(held.clone().map(move |u| u[i].to_degrees()));
        let three = ["aileron", "elevator", "rudder"];
        let deflections =
            (0..3).fold(panel("Deflections", "degrees"), |p, i| p.line(three[i], deflection(i)));
        let rates = (0..3).fold(panel("Their rates", "degrees/s"), |p, i| p.steps(three[i], rate(i)));
        let tension = times().zip(self.tensions.iter().map(|t| t / 1e3));
        Figure::new()
            .size(1000, 760)
            .with(panel("Tension of the tether", "kN").y_range(0.0..2.0).line("", tension).limit(1.8))
            .with(
                panel("Angles of attack and sideslip", "degrees")
                    .line("attack", of_state(|s| (air_velocity(s).z / air_velocity(s).x).to_degrees()))
                    .line("sideslip", of_state(|s| (air_velocity(s).y / air_velocity(s).x).to_degrees()))
                    .limit(9.0)
                    .limit(-6.0),
            )
            .with(rates)
            .column(1.0)
            .with(
                panel("Airspeed", "m/s")
                    .line("", of_state(|s| air_velocity(s).norm()))
                    .limit(10.0)
                    .limit(32.0),
            )
            .with(deflections)
            .with(
                panel("Drag coefficient of the turbines", "kg/m")
                    .line("", of_state(|s| TURBINE_SCALE * s.kappa)),
            )
    }
}

/// The velocity of the air in the frame of the aircraft.
fn air_velocity(state: &State) -> Vector3<f64> {
    let wind = 10.0 * ((state.q.z * state.q.z + 1.0).sqrt() / 100.0).powf(0.15);
    state.r.transpose() * (Vector3::new(wind, 0.0, 0.0) - state.dq)
}
