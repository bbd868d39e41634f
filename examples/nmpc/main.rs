//! Nonlinear model predictive control by real-time iterations: a pendulum swings up and is pushed,
//! a chain of masses is disturbed; what a sample takes, and the worst of many.
//!
//! ```text
//! cargo run --release --example nmpc [PICTURE.svg]
//! ```

#[path = "../models/chain.rs"]
#[allow(dead_code)]
mod chain;
#[path = "../models/chain_problem.rs"]
mod chain_problem;
#[path = "../models/pendulum.rs"]
mod pendulum;

use casados::ocp::{HeapRealTime, HeapSqp, Horizon, LeastSquaresCost, Problem, Shooting};
use casados::plot::{Figure, Panel};
use casados::prelude::*;
use chain::Chain;
use nalgebra::{SVector, Vector1, Vector3, Vector4, vector};
use pendulum::Pendulum;
use reference_data::Record;
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

const USAGE: &str = "usage: cargo run --release --example nmpc [PICTURE.svg]";

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args_os().skip(1).collect();
    let picture = match &arguments[..] {
        [] => PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/plots/nmpc.svg")),
        [path] if path.as_encoded_bytes().ends_with(b".svg") => PathBuf::from(path),
        _ => {
            eprintln!("{USAGE}");
            return ExitCode::FAILURE;
        }
    };
    match run().and_then(|drawing| Ok(drawing.figure().save(&picture)?)) {
        Ok(()) => {
            println!("\n{}", picture.display());
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("nmpc: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<Picture, Box<dyn Error>> {
    println!("Milliseconds                     median     99.9 %      worst");
    let mut picture = Picture::default();
    pendulum(&mut picture)?;
    chain(&mut picture)?;
    Ok(picture)
}

/// Something over time.
type Curve = (&'static str, Vec<(f64, f64)>);

/// What is drawn.
#[derive(Default)]
struct Picture {
    pendulum: Vec<Curve>,
    chain: Vec<Curve>,
    /// Milliseconds of samples, by what they are of.
    times: Vec<(String, Vec<f64>)>,
}

impl Picture {
    fn figure(&self) -> Figure {
        let over_time = |title: &str, curves: &[Curve]| {
            let panel = Panel::new(title).x("time, s");
            curves.iter().fold(panel, |panel, (name, points)| panel.line(*name, points.iter().copied()))
        };
        let times = Panel::histogram(self.times.iter().map(|(name, times)| (name, times.as_slice())));
        Figure::new()
            .size(1100, 640)
            .with(over_time("A pendulum swings up, and is pushed every four seconds", &self.pendulum))
            .with(over_time("A chain, disturbed every four seconds: metres from references", &self.chain))
            .column(1.0)
            .with(times.title("Time of a phase, shares of all samples").x("ms"))
    }
}

/// Seconds of both phases, sample by sample.
#[derive(Default)]
struct Latency {
    prepare: Vec<f64>,
    feedback: Vec<f64>,
}

impl Latency {
    fn report(mut self, name: &str, picture: &mut Picture) {
        for (phase, times) in [("prepare", &mut self.prepare), ("feedback", &mut self.feedback)] {
            times.sort_unstable_by(f64::total_cmp);
            let at = |part: f64| 1e3 * times[((times.len() - 1) as f64 * part).round() as usize];
            let label = format!("{name}, {phase}");
            println!("{label:<28} {:>10.4} {:>10.4} {:>10.4}", at(0.5), at(0.999), at(1.0));
            picture.times.push((label, times.iter().map(|time| 1e3 * time).collect()));
        }
    }
}

/// Position, angle from above, their rates, and the force.
#[casados::function]
fn deviation(x: [f64; 4], u: [f64; 1]) -> [f64; 5] {
    [x[0], x[1], x[2], x[3], u[0]]
}

#[casados::function]
fn end(x: [f64; 4], _u: [f64; 1]) -> [f64; 4] {
    x
}

/// From below to above in a second, and pushed every four seconds.
fn pendulum(picture: &mut Picture) -> Result<(), Box<dyn Error>> {
    const SAMPLES: usize = 2000;
    const SAMPLE: f64 = 0.05;
    let q = [2e3, 2e3, 2e-2, 2e-2];
    let irk = Irk::<Pendulum, Gauss<2>>::new(Options::default())?;
    let mut ocp = Problem::new(irk)
        .running_cost(LeastSquaresCost::<Deviation>::diagonal(&[q[0], q[1], q[2], q[3], 2e-2]))
        .terminal_cost(LeastSquaresCost::<End>::diagonal(&q))
        .on(Horizon::uniform(20, SAMPLE))?;
    let mut x = Vector4::new(0.0, std::f64::consts::PI, 0.0, 0.0);
    ocp.fix_initial_state(x.as_slice())?.bound("u", .., -80.0, 80.0)?;
    ocp.guess(x.as_slice(), &[0.0])?;
    // The first plan is a solution; from then on there is one iteration in each sample.
    HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?;
    let mut controller = HeapRealTime::new(ocp)?;
    let mut plant = Irk::<Pendulum, Gauss<4>>::new(Options { steps: 4, ..Default::default() })?;
    let (mut latency, mut angle, mut force) = (Latency::default(), Vec::new(), Vec::new());
    for sample in 0..SAMPLES {
        let begin = Instant::now();
        let prepared = controller.prepare()?;
        latency.prepare.push(begin.elapsed().as_secs_f64());
        let begin = Instant::now();
        let u = Vector1::new(prepared.feedback(x.as_slice())?.u[0]);
        latency.feedback.push(begin.elapsed().as_secs_f64());
        let t = sample as f64 * SAMPLE;
        if t < 12.0 {
            angle.push((t, x[1]));
            force.push((t, u[0] / 80.0));
        }
        x = plant.solve(&x, &u, SAMPLE)?.x;
        if sample % 80 == 79 {
            // A push against the ball, left and right in turn.
            x[3] += if sample % 160 == 79 { 2.0 } else { -2.5 };
        }
        controller.shift();
    }
    if x[1].abs() > 0.5 {
        return Err(format!("the pendulum is not upright: {x}").into());
    }
    picture.pendulum = vec![("angle, rad", angle), ("force / 80 N", force)];
    latency.report("pendulum, 20 intervals", picture);
    Ok(())
}

/// Three masses whose velocities are disturbed every four seconds.
fn chain(picture: &mut Picture) -> Result<(), Box<dyn Error>> {
    const SAMPLES: usize = 1000;
    const NX: usize = 9;
    let record = Record::load("ocp/chain_3.json")?;
    let (rest, x0) = (record.list("xrest")?, record.list("x0")?);
    let newton = Newton { tolerance: 1e-9, ..Default::default() };
    let options = Options { steps: 2, start: Start::Warm, newton, ..Default::default() };
    let batch = Batch::<Chain<NX>, Gauss<2>>::new(options)?;
    let mut ocp = chain_problem::problem!(9, rest.clone(), x0, Shooting::new(batch));
    // Disturbances know no walls: it is soft.
    ocp.soften("x", .., 1e3, 1e3)?;
    HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?;
    let mut controller = HeapRealTime::new(ocp)?;
    let mut plant = Irk::<Chain<NX>, Gauss<4>>::new(Options { steps: 2, ..Default::default() })?;
    let mut x = SVector::<f64, NX>::from_column_slice(&record.list("x0")?);
    let rest = SVector::<f64, NX>::from_column_slice(&rest);
    let (mut latency, mut distance) = (Latency::default(), [Vec::new(), Vec::new()]);
    let mut state = 1_u64;
    for sample in 0..SAMPLES {
        let begin = Instant::now();
        let prepared = controller.prepare()?;
        latency.prepare.push(begin.elapsed().as_secs_f64());
        let begin = Instant::now();
        let u = Vector3::from_column_slice(prepared.feedback(x.as_slice())?.u);
        latency.feedback.push(begin.elapsed().as_secs_f64());
        if sample < 100 {
            for (i, curve) in distance.iter_mut().enumerate() {
                let apart = (x - rest).fixed_rows::<3>(3 * i).norm();
                curve.push((0.2 * sample as f64, apart));
            }
        }
        x = plant.solve(&x, &u, 0.2)?.x;
        if sample % 20 == 19 {
            let push = vector![0, 1, 2].map(|_: i32| {
                // Knuth's linear congruential generator.
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
            });
            for (velocity, push) in x.iter_mut().skip(6).zip(push.iter()) {
                *velocity += 2.0 * push;
            }
        }
        controller.shift();
    }
    let [mass, end] = distance;
    picture.chain = vec![("mass", mass), ("end", end)];
    latency.report("chain of 3, 40 intervals", picture);
    Ok(())
}
