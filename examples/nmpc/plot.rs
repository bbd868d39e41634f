//! The picture: what the pendulum and the chain do, and how long samples take.

use plotters::coord::Shift;
use plotters::prelude::*;
use std::error::Error;
use std::path::Path;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn Error>>;

const GRID: RGBColor = RGBColor(225, 225, 225);
const COLOURS: [RGBColor; 4] =
    [RGBColor(31, 95, 168), RGBColor(200, 62, 45), RGBColor(60, 140, 70), RGBColor(230, 145, 20)];
/// Bins of a decade.
const BINS: f64 = 12.0;

/// Something over time.
pub struct Curve {
    name: &'static str,
    points: Vec<(f64, f64)>,
}

impl Curve {
    pub fn new(name: &'static str, points: Vec<(f64, f64)>) -> Self {
        Self { name, points }
    }
}

/// What is drawn.
#[derive(Default)]
pub struct Picture {
    pub pendulum: Vec<Curve>,
    pub chain: Vec<Curve>,
    /// Milliseconds of samples, sorted, by what they are of.
    pub times: Vec<(String, Vec<f64>)>,
}

impl Picture {
    /// Writes an SVG file; its folder is made if there is none.
    pub fn draw(&self, path: &Path) -> Drawn {
        let failed = |error: std::io::Error| format!("cannot write {}: {error}", path.display());
        let mut svg = String::new();
        {
            let root = SVGBackend::with_string(&mut svg, (1100, 640)).into_drawing_area();
            root.fill(&WHITE)?;
            let (left, right) = root.margin(8, 8, 8, 8).split_horizontally(560);
            let (pendulum, chain) = left.split_vertically(312);
            curves(&pendulum, "A pendulum swings up, and is pushed every four seconds", &self.pendulum)?;
            curves(
                &chain,
                "A chain, disturbed every four seconds: distances from references, m",
                &self.chain,
            )?;
            self.histogram(&right)?;
            root.present()?;
        }
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(failed)?;
        }
        std::fs::write(path, svg).map_err(failed)?;
        Ok(())
    }

    /// Parts of all samples, in bins that are as wide as their time is long.
    fn histogram(&self, area: &Area) -> Drawn {
        let bin = |time: f64| (time.max(1e-6).log10() * BINS).floor() as i32;
        let all = || self.times.iter().flat_map(|(_, times)| times);
        let (first, last) =
            all().fold((i32::MAX, i32::MIN), |(a, b), &time| (a.min(bin(time)), b.max(bin(time))));
        if first > last {
            return Ok(());
        }
        let at = |bin: i32| 10_f64.powf(f64::from(bin) / BINS);
        let mut chart = ChartBuilder::on(area)
            .caption("Time of a phase, parts of all samples", ("sans-serif", 17))
            .x_label_area_size(36)
            .y_label_area_size(54)
            .build_cartesian_2d((at(first - 1)..at(last + 2)).log_scale(), (1e-4..1.5).log_scale())?;
        chart.configure_mesh().light_line_style(WHITE).bold_line_style(GRID).x_desc("ms").draw()?;
        for ((name, times), colour) in self.times.iter().zip(COLOURS) {
            let mut steps = Vec::new();
            for here in first..=last {
                let count = times.iter().filter(|time| bin(**time) == here).count();
                let part = (count as f64 / times.len() as f64).max(1e-4);
                steps.extend([(at(here), part), (at(here + 1), part)]);
            }
            chart
                .draw_series(LineSeries::new(steps, colour.stroke_width(2)))?
                .label(name.as_str())
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
        }
        legend(&mut chart)
    }
}

fn curves(area: &Area, caption: &str, curves: &[Curve]) -> Drawn {
    let all = || curves.iter().flat_map(|curve| &curve.points);
    let end = all().fold(1.0, |end: f64, point| end.max(point.0));
    let (low, high) = all().fold((0.0, 0.1), |(low, high): (f64, f64), p| (low.min(p.1), high.max(p.1)));
    let mut chart = ChartBuilder::on(area)
        .caption(caption, ("sans-serif", 17))
        .x_label_area_size(32)
        .y_label_area_size(46)
        .build_cartesian_2d(0.0..end, 1.1 * low - 0.05 * high..1.1 * high)?;
    chart.configure_mesh().light_line_style(WHITE).bold_line_style(GRID).x_desc("s").draw()?;
    for (curve, colour) in curves.iter().zip(COLOURS) {
        chart
            .draw_series(LineSeries::new(curve.points.iter().copied(), colour.stroke_width(2)))?
            .label(curve.name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
    }
    legend(&mut chart)
}

fn legend<'a, C: plotters::coord::CoordTranslate>(chart: &mut ChartContext<'a, SVGBackend<'a>, C>) -> Drawn {
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .border_style(GRID)
        .background_style(WHITE)
        .draw()?;
    Ok(())
}
