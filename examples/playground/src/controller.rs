//! The pendulum and its controller: one real-time iteration in each sample.

use crate::pushed::Pendulum;
use crate::shared::now;
use casados::ocp::{HeapRealTime, Horizon, LeastSquaresCost, OcpError, Problem};
use casados::prelude::*;
use core::f64::consts::{PI, TAU};
use nalgebra::{Vector1, Vector3, Vector4};

pub const INTERVALS: usize = 30;
/// Seconds from one control to the next.
const SAMPLE: f64 = 0.04;
/// Nearly hanging: on its way up it has to choose a side.
const HANGING: [f64; 4] = [0.0, PI - 0.002, 0.0, 0.0];
/// At the end of the horizon deviations weigh so many times more, and as if their weights were
/// these at least: so it comes back to the middle in time.
const END: [f64; 4] = [20.0, 20.0, 50.0, 50.0];
const LEAST: [f64; 4] = [1.0, 0.0, 0.1, 0.1];
/// The weight of the energy, as a multiple of that of the angle.
const ENERGY: f64 = 4.0;
/// Bounds of the track are soft, N/m: a push does not know them. Without a constant part: to leave
/// a bound the cart has to go beyond it first, and would rather stay.
const PENALTY: f64 = 3e4;

/// Weights of position, angle, velocity, rate and force; bounds of force (N) and position (m).
pub type Settings = [f64; 7];
pub const DEFAULT: Settings = [1.0, 10.0, 0.1, 0.1, 0.01, 15.0, 1.0];

/// The last two are `2 sin(angle/2)`, which is the angle near all upright positions and knows no
/// turns, and the energy of the ball as a part of what lifts it from the middle to the top: where
/// the force is too weak to lift it at once, that is what grows from swing to swing.
#[function]
fn deviation(x: [f64; 4], u: [f64; 1], _p: [f64; 3]) -> [f64; 6] {
    const LENGTH: f64 = 0.8; // m
    const G: f64 = 9.81; // m/s²
    let [position, angle, velocity, rate] = x;
    let energy = LENGTH * rate * rate / (2.0 * G) + angle.cos() - 1.0;
    [position, velocity, rate, u[0], 2.0 * (0.5 * angle).sin(), energy]
}

#[function]
fn end(x: [f64; 4], _u: [f64; 1], _p: [f64; 3]) -> [f64; 5] {
    const LENGTH: f64 = 0.8; // m
    const G: f64 = 9.81; // m/s²
    let [position, angle, velocity, rate] = x;
    let energy = LENGTH * rate * rate / (2.0 * G) + angle.cos() - 1.0;
    [position, velocity, rate, 2.0 * (0.5 * angle).sin(), energy]
}

/// State and force at each node.
pub type Plan = [[f64; 5]; INTERVALS + 1];
type Dynamics = Irk<Pendulum, Gauss<2>>;
type Controller = HeapRealTime<Problem<Dynamics, LeastSquaresCost<Deviation>, LeastSquaresCost<End>>>;

/// The controller, and what it controls.
pub struct Loop {
    controller: Controller,
    plant: Dynamics,
    pub x: [f64; 4],
    pub force: f64,
    /// Seconds since the last control.
    since: f64,
    plan: Plan,
    pub statistics: Statistics,
}

/// Of all samples.
#[derive(Clone, Copy, Default)]
pub struct Statistics {
    /// Milliseconds of both phases.
    pub phases: [f64; 2],
    pub samples: f64,
    /// Samples without a solution.
    pub lost: f64,
    /// Iterations of the last QP.
    pub iterations: f64,
    pub seconds: f64,
}

impl Loop {
    pub fn new() -> Result<Self, OcpError> {
        let integrator = || Dynamics::new(Options::default());
        let mut ocp = Problem::new(integrator()?)
            .stage_cost(LeastSquaresCost::<Deviation>::diagonal(&[1.0; 6]))
            .terminal_cost(LeastSquaresCost::<End>::diagonal(&[1.0; 5]))
            .on(Horizon::uniform(INTERVALS, SAMPLE))?;
        ocp.set_parameters(.., &[0.0; 3])?.fix_initial_state(&HANGING)?.guess(&HANGING, &[0.0])?;
        let mut controller = HeapRealTime::new(ocp)?;
        // A sample takes so long at most.
        let options = &mut controller.qp_solver.options;
        (options.max_iterations, options.locate) = (50, false);
        // The first control is due at once.
        let [position, angle, velocity, rate] = HANGING;
        let (statistics, plan) =
            (Statistics::default(), [[position, angle, velocity, rate, 0.0]; INTERVALS + 1]);
        Ok(Self { controller, plant: integrator()?, x: HANGING, force: 0.0, since: SAMPLE, plan, statistics })
    }

    pub fn apply(&mut self, settings: &Settings) -> Result<(), OcpError> {
        let [position, angle, velocity, rate, control, force, track] = *settings;
        let weights = [position, angle, velocity, rate];
        let at_end: [f64; 4] = core::array::from_fn(|i| END[i] * weights[i].max(LEAST[i]));
        let ocp = self.controller.ocp_mut();
        let problem = ocp.problem();
        problem.stage_cost =
            LeastSquaresCost::diagonal(&[position, velocity, rate, control, angle, ENERGY * angle]);
        let [position, angle, velocity, rate] = at_end;
        problem.terminal_cost =
            LeastSquaresCost::diagonal(&[position, velocity, rate, angle, ENERGY * angle]);
        ocp.bound("u", .., -force, force)?.bound("x[0]", 1.., -track, track)?;
        ocp.soften("x[0]", 1.., 0.0, PENALTY)?;
        Ok(())
    }

    pub fn advance(&mut self, seconds: f64, pushes: [f64; 3]) -> Result<(), OcpError> {
        self.plant.set_parameters(&Vector3::from(pushes))?;
        let mut left = seconds;
        while left > 0.0 {
            if SAMPLE - self.since < 1e-9 {
                self.sample()?;
            }
            let h = left.min(SAMPLE - self.since);
            self.x = self.plant.solve(&Vector4::from(self.x), &Vector1::new(self.force), h)?.x.into();
            self.since += h;
            left -= h;
        }
        self.statistics.seconds += seconds;
        Ok(())
    }

    /// A control from the state. Where there is none, the one that was planned before; and a new
    /// plan begins, where it is now.
    fn sample(&mut self) -> Result<(), OcpError> {
        let begin = now();
        let prepared = self.controller.prepare()?;
        let half = now();
        let feedback = prepared.feedback(&self.x).map(|feedback| feedback.statistics.iterations);
        let end = now();
        self.force = self.controller.ocp().stage(0)?.u[0];
        let statistics = &mut self.statistics;
        statistics.phases[0] += half - begin;
        statistics.phases[1] += end - half;
        statistics.samples += 1.0;
        match feedback {
            Ok(iterations) => statistics.iterations = iterations as f64,
            Err(_) => {
                statistics.lost += 1.0;
                self.controller.ocp_mut().guess(&self.x, &[0.0])?;
                self.controller.reset();
            }
        }
        self.plan = self.planned()?;
        self.controller.shift();
        self.since = 0.0;
        Ok(())
    }

    /// The upright angle that is nearest.
    pub fn upright(&self) -> f64 {
        TAU * (self.x[1] / TAU).round()
    }

    /// State and force at each node of the last plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    fn planned(&self) -> Result<Plan, OcpError> {
        let mut plan = [[0.0; 5]; INTERVALS + 1];
        for (node, numbers) in plan.iter_mut().enumerate() {
            let stage = self.controller.ocp().stage(node)?;
            numbers[..4].copy_from_slice(stage.x);
            numbers[4] = stage.u.first().copied().unwrap_or(0.0);
        }
        Ok(plan)
    }
}
