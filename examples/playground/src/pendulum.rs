//! The pendulum and its controller: one real-time iteration in each sample.

use crate::pushed::Pendulum;
use crate::shared::{One, now, outcome};
use casados::ocp::{HeapRealTime, Horizon, LeastSquaresCost, OcpError, Problem};
use casados::prelude::*;
use core::f64::consts::{PI, TAU};
use nalgebra::{Vector1, Vector3, Vector4};

const INTERVALS: usize = 40;
/// Seconds from one control to the next.
const SAMPLE: f64 = 0.04;
/// Nearly hanging: on its way up it has to choose a side.
const HANGING: [f64; 4] = [0.0, PI - 0.002, 0.0, 0.0];
/// At the end of the horizon deviations weigh so many times more.
const END: [f64; 4] = [20.0, 20.0, 50.0, 50.0];
/// Bounds of the track are soft, N and N/m: a push does not know them.
const PENALTIES: (f64, f64) = (100.0, 1000.0);
/// The angle may be so far from the upright position that it swings to before another turn is
/// nearer: so that it is not undecided when it hangs.
const UNDECIDED: f64 = PI + 0.5;

#[function]
fn deviation(x: [f64; 4], u: [f64; 1], _p: [f64; 3]) -> [f64; 5] {
    [x[0], x[1], x[2], x[3], u[0]]
}

#[function]
fn end(x: [f64; 4], _u: [f64; 1], _p: [f64; 3]) -> [f64; 4] {
    x
}

type Dynamics = Irk<Pendulum, Gauss<2>>;
type Controller = HeapRealTime<Problem<Dynamics, LeastSquaresCost<Deviation>, LeastSquaresCost<End>>>;

/// The controller, and what it controls.
struct Loop {
    controller: Controller,
    plant: Dynamics,
    x: [f64; 4],
    force: f64,
    /// Seconds since the last control.
    since: f64,
    /// Whole turns of the upright position that it swings to.
    turns: f64,
}

/// Weights of position, angle, velocity, rate and force; bounds of force (N) and position (m).
static SETTINGS: One<[f64; 7]> = One::new([1.0, 10.0, 0.1, 0.1, 0.01, 15.0, 1.0]);
/// State; force; milliseconds of both phases of all samples; numbers of samples, of
/// samples without a solution, of iterations of the last QP; the angle that is upright; seconds.
static STATE: One<[f64; 12]> = One::new([0.0; 12]);
/// State and force at each node.
static PLAN: One<[f64; 5 * (INTERVALS + 1)]> = One::new([0.0; 5 * (INTERVALS + 1)]);
static LOOP: One<Option<Loop>> = One::new(None);

#[unsafe(no_mangle)]
pub extern "C" fn pendulum_settings() -> *mut f64 {
    SETTINGS.place()
}

#[unsafe(no_mangle)]
pub extern "C" fn pendulum_state() -> *mut f64 {
    STATE.place()
}

#[unsafe(no_mangle)]
pub extern "C" fn pendulum_plan() -> *mut f64 {
    PLAN.place()
}

/// Nodes of the plan.
#[unsafe(no_mangle)]
pub extern "C" fn pendulum_nodes() -> usize {
    INTERVALS + 1
}

/// It hangs, and the controller knows nothing.
#[unsafe(no_mangle)]
pub extern "C" fn pendulum_reset() -> u32 {
    outcome(Loop::new().and_then(|mut new| {
        *STATE.get() = [0.0; 12];
        new.apply()?;
        new.show()?;
        *LOOP.get() = Some(new);
        Ok(())
    }))
}

/// The controller takes the settings over.
#[unsafe(no_mangle)]
pub extern "C" fn pendulum_apply() -> u32 {
    outcome(LOOP.get().as_mut().map_or(Ok(()), Loop::apply))
}

/// Time goes on by some seconds, while cart and ball are pushed by these forces.
#[unsafe(no_mangle)]
pub extern "C" fn pendulum_advance(seconds: f64, cart: f64, right: f64, up: f64) -> u32 {
    outcome(LOOP.get().as_mut().map_or(Ok(()), |the| the.advance(seconds, [cart, right, up])))
}

impl Loop {
    fn new() -> Result<Self, OcpError> {
        let integrator = || {
            Dynamics::new(Options::default()).map_err(|error| OcpError::Integration { interval: 0, error })
        };
        let mut ocp = Problem::new(integrator()?)
            .stage_cost(LeastSquaresCost::<Deviation>::diagonal(&[1.0; 5]))
            .terminal_cost(LeastSquaresCost::<End>::diagonal(&[1.0; 4]))
            .on(Horizon::uniform(INTERVALS, SAMPLE))?;
        ocp.set_parameters(.., &[0.0; 3])?.fix_initial_state(&HANGING)?.guess(&HANGING, &[0.0])?;
        let mut controller = HeapRealTime::new(ocp)?;
        // A sample takes so long at most.
        let options = &mut controller.qp_solver.options;
        (options.max_iterations, options.locate) = (50, false);
        // The first control is due at once.
        Ok(Self { controller, plant: integrator()?, x: HANGING, force: 0.0, since: SAMPLE, turns: 0.0 })
    }

    fn apply(&mut self) -> Result<(), OcpError> {
        let [position, angle, velocity, rate, control, force, track] = *SETTINGS.get();
        let weights = [position, angle, velocity, rate];
        let ocp = self.controller.ocp_mut();
        let problem = ocp.problem();
        problem.stage_cost = LeastSquaresCost::diagonal(&[position, angle, velocity, rate, control]);
        problem.terminal_cost = LeastSquaresCost::diagonal(&core::array::from_fn(|i| END[i] * weights[i]));
        ocp.bound("u", .., -force, force)?.bound("x[0]", 1.., -track, track)?;
        ocp.soften("x[0]", 1.., PENALTIES.0, PENALTIES.1)?;
        Ok(())
    }

    fn advance(&mut self, seconds: f64, pushes: [f64; 3]) -> Result<(), OcpError> {
        let failed = |error| OcpError::Integration { interval: 0, error };
        self.plant.set_parameters(&Vector3::from(pushes)).map_err(failed)?;
        let mut left = seconds;
        while left > 0.0 {
            if SAMPLE - self.since < 1e-9 {
                self.sample()?;
            }
            let h = left.min(SAMPLE - self.since);
            self.x = self
                .plant
                .solve(&Vector4::from(self.x), &Vector1::new(self.force), h)
                .map_err(failed)?
                .x
                .into();
            self.since += h;
            left -= h;
        }
        STATE.get()[11] += seconds;
        self.show()
    }

    /// A control from the state. Where there is none, the one that was planned before; and a new
    /// plan begins, where it is now.
    fn sample(&mut self) -> Result<(), OcpError> {
        self.turn()?;
        let begin = now();
        let prepared = self.controller.prepare()?;
        let half = now();
        let feedback = prepared.feedback(&self.x).map(|feedback| feedback.statistics.iterations);
        let end = now();
        self.force = self.controller.ocp().stage(0)?.u[0];
        let mut state = STATE.get();
        state[5] += half - begin;
        state[6] += end - half;
        state[7] += 1.0;
        match feedback {
            Ok(iterations) => state[9] = iterations as f64,
            Err(_) => {
                state[8] += 1.0;
                self.controller.ocp_mut().guess(&self.x, &[0.0])?;
                self.controller.reset();
            }
        }
        drop(state);
        self.plan()?;
        self.controller.shift();
        self.since = 0.0;
        Ok(())
    }

    /// The upright position that is nearest.
    fn turn(&mut self) -> Result<(), OcpError> {
        if (self.x[1] - TAU * self.turns).abs() > UNDECIDED {
            self.turns = (self.x[1] / TAU).round();
            let upright = TAU * self.turns;
            let ocp = self.controller.ocp_mut();
            ocp.set_reference(.., &[0.0, upright, 0.0, 0.0, 0.0])?;
            ocp.set_terminal_reference(&[0.0, upright, 0.0, 0.0])?;
        }
        Ok(())
    }

    fn show(&self) -> Result<(), OcpError> {
        let mut state = STATE.get();
        state[..4].copy_from_slice(&self.x);
        state[4] = self.force;
        state[10] = TAU * self.turns;
        Ok(())
    }

    fn plan(&self) -> Result<(), OcpError> {
        let mut plan = PLAN.get();
        for (node, numbers) in plan.chunks_exact_mut(5).enumerate() {
            let stage = self.controller.ocp().stage(node)?;
            numbers[..4].copy_from_slice(stage.x);
            numbers[4] = stage.u.first().copied().unwrap_or(0.0);
        }
        Ok(())
    }
}
