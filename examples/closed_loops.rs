//! Ten thousand closed loops of a predictive controller, each with another plant and other
//! disturbances: how often costs and violations occur. A picture in `plots/closed_loops.svg`.
//!
//! ```text
//! cargo run --release --features parallel --example closed_loops [LOOPS] [FOLDER]
//! ```

use casados::ocp::{
    ClosedLoop, HeapRealTime, Horizon, LeastSquaresCost, OcpError, Problem, Sample, closed_loop,
    closed_loops, plant,
};
use casados::plot::{Figure, Panel};
use casados::prelude::*;
use nalgebra::vector;
use std::error::Error;
use std::path::PathBuf;

/// A pendulum that stands at zero: angle rad, rate rad/s; torque; gravity over length 1/s² and
/// friction 1/s, of which the controller knows the means alone.
#[ode]
fn pendulum(x: [f64; 2], u: f64, p: [f64; 2]) -> [f64; 2] {
    [x[1], p[0] * x[0].sin() - p[1] * x[1] + u]
}
#[function]
fn deviation(x: [f64; 2], u: f64, _p: [f64; 2]) -> [f64; 3] {
    [x[0], x[1], u]
}

const MEAN_PARAMETERS: [f64; 2] = [9.81, 0.5];
const SAMPLES: usize = 60;

/// Numbers between −1 and 1 (splitmix64: Steele, Lea, Flood, OOPSLA 2014).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// As many loops, each begun with a plan of zeros: results depend on the number of the loop alone.
fn run_loops(count: usize) -> Result<Vec<Result<ClosedLoop, OcpError>>, OcpError> {
    let make = || {
        let mut ocp = Problem::new(Erk::<Pendulum, Rk4>::new(Options::default())?)
            .running_cost(LeastSquaresCost::<Deviation>::diagonal(&[10.0, 0.1, 0.01]))
            .on(Horizon::uniform(20, 0.05))?;
        ocp.fix_initial_state(&[0.0; 2])?.set_parameters(.., &MEAN_PARAMETERS)?.bound("u", .., -6.0, 6.0)?;
        ocp.bound("x[1]", 1.., -1.5, 1.5)?.soften("x[1]", 1.., 10.0, 10.0)?;
        let plant = Erk::<Pendulum, Rk4>::new(Options { steps: 2, ..Default::default() })?;
        Ok((HeapRealTime::new(ocp)?, plant))
    };
    closed_loops(count, make, |(controller, erk), index| {
        controller.reset();
        controller.ocp_mut().guess(&[0.0; 2], &[0.0])?;
        let mut random = Numbers(index as u64);
        let p = vector![
            MEAN_PARAMETERS[0] * (1.0 + 0.3 * random.next()),
            MEAN_PARAMETERS[1] * (1.0 + random.next())
        ];
        let x0 = [0.4 * random.next(), 0.5 * random.next()];
        let pushes = |_: Sample<f64>, x: &mut [f64]| x[1] += 0.05 * random.next();
        closed_loop(controller, plant(erk, &p), pushes, &x0, SAMPLES)
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let count = arguments.next().map_or(Ok(10_000), |count| count.parse())?;
    let folder = PathBuf::from(arguments.next().unwrap_or_else(|| "plots".into()));
    let begin = std::time::Instant::now();
    let runs = run_loops(count)?.into_iter().collect::<Result<Vec<_>, _>>()?;
    let seconds = begin.elapsed().as_secs_f64();
    let costs: Vec<f64> = runs.iter().map(ClosedLoop::cost).collect();
    let far = |run: &&ClosedLoop| !run.trajectory.violations(0.1).is_empty();
    let fallen = |run: &&ClosedLoop| {
        run.trajectory.state("x[0]").is_ok_and(|angle| angle.iter().any(|angle| angle.abs() > 1.5))
    };
    println!("{count} loops of {SAMPLES} samples in {seconds:.1} s");
    println!(
        "{} have a rate of 1.6 rad/s or more, {} fall",
        runs.iter().filter(far).count(),
        runs.iter().filter(fallen).count()
    );
    let mut some = Panel::new("The first fifty").x("time, s").y("angle, rad");
    for run in runs.iter().take(50) {
        let angle = run.trajectory.state("x[0]")?;
        some = some.line("", run.trajectory.times().iter().copied().zip(angle.iter().copied()));
    }
    let shares = Panel::histogram([("cost of a loop", &costs[..])]).title("Shares of all").x("cost");
    let figure = Figure::new().size(900, 320).with(shares).column(1.0).with(some);
    figure.save(folder.join("closed_loops.svg"))?;
    Ok(())
}

/// Loops stay upright, whatever the plant, and are what they are whoever else runs.
#[test]
fn upright_loops() -> Result<(), Box<dyn Error>> {
    let (all, some) = (run_loops(60)?, run_loops(20)?);
    for (run, other) in all.iter().zip(&some) {
        let (Ok(run), Ok(other)) = (run, other) else { return Err("a loop has no end".into()) };
        assert_eq!(run.costs, other.costs);
        assert!(run.failures.is_empty() && run.durations.len() == SAMPLES);
        assert!(run.trajectory.state("x[0]")?.iter().all(|angle| angle.abs() < 0.6));
        assert!(run.trajectory.control("u")?.iter().all(|u| u.abs() <= 6.0 + 1e-6));
    }
    assert_eq!(all.len(), 60);
    Ok(())
}
