//! What a constraint is off by over time: a pendulum in Cartesian coordinates without
//! stabilisation, with Baumgarte's, and projected after every step.
//!
//! ```text
//! cargo run --release --example drift [PICTURE.svg]
//! ```

use casados::plot::{Figure, Panel};
use casados::prelude::*;
use casados::{Integrator, Projected};
use nalgebra::{Vector4, vector};
use std::error::Error;
use std::path::PathBuf;

/// Of length one, and mass one: `z` is the tension over the length.
#[dae(index_reduction)]
fn plain(xdot: [f64; 4], x: [f64; 4], z: f64) -> [f64; 5] {
    let [px, py, vx, vy] = x;
    [xdot[0] - vx, xdot[1] - vy, xdot[2] + z * px, xdot[3] + z * py + 9.81, px * px + py * py - 1.0]
}

/// Errors decay within a second.
#[dae(index_reduction(baumgarte = 1.0))]
fn slow(xdot: [f64; 4], x: [f64; 4], z: f64) -> [f64; 5] {
    let [px, py, vx, vy] = x;
    [xdot[0] - vx, xdot[1] - vy, xdot[2] + z * px, xdot[3] + z * py + 9.81, px * px + py * py - 1.0]
}

/// Errors decay within a step or two.
#[dae(index_reduction(baumgarte = 20.0))]
fn fast(xdot: [f64; 4], x: [f64; 4], z: f64) -> [f64; 5] {
    let [px, py, vx, vy] = x;
    [xdot[0] - vx, xdot[1] - vy, xdot[2] + z * px, xdot[3] + z * py + 9.81, px * px + py * py - 1.0]
}

/// The same equations as the first.
#[dae(index_reduction(projection))]
fn held(xdot: [f64; 4], x: [f64; 4], z: f64) -> [f64; 5] {
    let [px, py, vx, vy] = x;
    [xdot[0] - vx, xdot[1] - vy, xdot[2] + z * px, xdot[3] + z * py + 9.81, px * px + py * py - 1.0]
}

const STEP: f64 = 0.02;
const STEPS: usize = 100_000;

/// The largest error of the length within each stretch of time, at the end of the stretch.
type Curve = Vec<(f64, f64)>;

fn run<I>(mut integrator: I) -> Result<Curve, casados::Error>
where
    I: Integrator<Number = f64>,
    I::Model: Dae<Shape = <Plain as Dae>::Shape>,
{
    let mut x: Vector4<f64> = vector![1.0, 0.0, 0.0, 0.0];
    let (mut curve, mut worst, mut next) = (Vec::new(), f64::EPSILON / 2.0, 1.0);
    for step in 1..=STEPS {
        x = integrator.solve(&x, &vector![], STEP)?.x;
        worst = f64::max(worst, (x[0].hypot(x[1]) - 1.0).abs());
        // Stretches that look equally long where the axis is logarithmic.
        if step as f64 >= next {
            curve.push((step as f64 * STEP, worst));
            (worst, next) = (f64::EPSILON / 2.0, (step as f64 * 1.12).max(step as f64 + 1.0));
        }
    }
    Ok(curve)
}

fn irk<M: Dae>() -> Result<Irk<M, RadauIIA<2>>, casados::Error> {
    Irk::<M, RadauIIA<2>>::new(Options::default())
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = match std::env::args_os().nth(1) {
        Some(path) => PathBuf::from(path),
        None => PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/plots/drift.svg")),
    };
    let curves = [
        ("no stabilisation", run(irk::<Plain>()?)?),
        ("baumgarte = 1.0", run(irk::<Slow>()?)?),
        ("baumgarte = 20.0", run(irk::<Fast>()?)?),
        ("projection", run(Projected::new(irk::<Held>()?))?),
    ];
    for (name, curve) in &curves {
        let at = |t: f64| curve.iter().find(|point| point.0 >= t).map_or(f64::NAN, |point| point.1);
        println!(
            "{name:>18}: {:.1e} after 1 s, {:.1e} after 100 s, {:.1e} after 1000 s",
            at(1.0),
            at(100.0),
            at(1000.0)
        );
    }
    let panel = Panel::new("The error of the length of a pendulum").x("time, s").y("m").log_x().log_y();
    let panel = curves.into_iter().fold(panel, |panel, (name, curve)| panel.line(name, curve));
    Figure::new().size(760, 420).with(panel).save(&path)?;
    println!("{}", path.display());
    Ok(())
}
