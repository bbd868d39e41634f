//! What a constraint is off by over time: a pendulum in Cartesian coordinates without
//! stabilisation, with Baumgarte's, and projected after every step.
//!
//! ```text
//! cargo run --release --example drift [PICTURE.svg]
//! ```

use casados::prelude::*;
use casados::{Integrator, Projected};
use nalgebra::{Vector4, vector};
use plotters::prelude::*;
use std::error::Error;
use std::path::{Path, PathBuf};

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
        ("no stabilisation", RGBColor(200, 62, 45), run(irk::<Plain>()?)?),
        ("baumgarte = 1.0", RGBColor(230, 145, 20), run(irk::<Slow>()?)?),
        ("baumgarte = 20.0", RGBColor(60, 140, 70), run(irk::<Fast>()?)?),
        ("projection", RGBColor(31, 95, 168), run(Projected::new(irk::<Held>()?))?),
    ];
    for (name, _, curve) in &curves {
        let at = |t: f64| curve.iter().find(|point| point.0 >= t).map_or(f64::NAN, |point| point.1);
        println!(
            "{name:>18}: {:.1e} after 1 s, {:.1e} after 100 s, {:.1e} after 1000 s",
            at(1.0),
            at(100.0),
            at(1000.0)
        );
    }
    draw(&curves, &path)
}

fn draw(curves: &[(&str, RGBColor, Curve)], path: &Path) -> Result<(), Box<dyn Error>> {
    let failed = |error: std::io::Error| format!("cannot write {}: {error}", path.display());
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(failed)?;
    }
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, (760, 420)).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .margin(12)
            .x_label_area_size(42)
            .y_label_area_size(60)
            .build_cartesian_2d((STEP..3000.0).log_scale(), (2e-17..10.0).log_scale())?;
        chart
            .configure_mesh()
            .x_desc("time, s")
            .y_desc("error of the length, m")
            .light_line_style(TRANSPARENT)
            .bold_line_style(RGBColor(225, 225, 225))
            .x_label_formatter(&|x| format!("{x}"))
            .y_label_formatter(&|y| format!("{y:.0e}"))
            .draw()?;
        for &(name, colour, ref curve) in curves {
            chart
                .draw_series(LineSeries::new(curve.iter().copied(), colour.stroke_width(2)))?
                .label(name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperLeft)
            .background_style(WHITE.mix(0.85))
            .border_style(RGBColor(225, 225, 225))
            .draw()?;
        area.present()?;
    }
    std::fs::write(path, svg).map_err(failed)?;
    println!("{}", path.display());
    Ok(())
}
