//! The plots: time over the size of the chain, error over time, and how many times faster.

use super::growth::Growth;
use super::report::{label, origin, three};
use super::{Failure, Results};
use casados_benches::case::Mode;
use plotters::coord::Shift;
use plotters::prelude::*;
use std::ops::Range;
use std::path::Path;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

const GRID: RGBColor = RGBColor(225, 225, 225);
const COLOURS: [RGBColor; 5] = [
    RGBColor(31, 95, 168),
    RGBColor(230, 145, 20),
    RGBColor(60, 140, 70),
    RGBColor(200, 62, 45),
    RGBColor(120, 80, 160),
];

/// Writes all plots that there is something for.
pub fn draw(results: &Results, folder: &Path) -> Result<(), Failure> {
    for growth in &results.growth {
        let name = format!("growth_s{}n{}.svg", growth.stages, growth.steps);
        svg(&folder.join(name), (720, 520), |area| draw_growth(area, growth))?;
    }
    if let Some((all, _)) = &results.precision {
        svg(&folder.join("work_precision.svg"), (1100, 480), |area| {
            let (left, right) = area.split_horizontally(550);
            let simulation = |p: &super::growth::Precision| p.simulation;
            let forward = |p: &super::growth::Precision| p.forward;
            draw_precision(&left, "state", all, simulation)?;
            draw_precision(&right, "Jacobian", all, forward)
        })?;
    }
    if results.rows.iter().any(|row| row.acados[0].is_some()) {
        svg(&folder.join("speedup.svg"), (1100, 480), |area| draw_speedup(area, results))?;
    }
    Ok(())
}

fn svg(
    path: &Path,
    size: (u32, u32),
    draw: impl FnOnce(&Area) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let area = SVGBackend::new(path, size).into_drawing_area();
    area.fill(&WHITE)?;
    draw(&area)?;
    area.present()?;
    Ok(())
}

/// The decade around all values.
fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values
        .filter(|v| v.is_finite() && *v > 0.0)
        .fold((f64::INFINITY, 0.0f64), |(low, high), v| (low.min(v), high.max(v)));
    if low > high { 0.1..10.0 } else { low / 1.5..high * 1.5 }
}

fn draw_growth(area: &Area, growth: &Growth) -> Result<(), Failure> {
    let y = range(growth.points.iter().flat_map(|(_, m)| m.map(|m| 1e6 * m.time.median)));
    let x = range(growth.points.iter().map(|(nx, _)| *nx as f64));
    let mut chart = ChartBuilder::on(area)
        .caption(
            format!("Chain of masses, s = {}, {} steps", growth.stages, growth.steps),
            ("sans-serif", 18),
        )
        .margin(10)
        .x_label_area_size(42)
        .y_label_area_size(64)
        .build_cartesian_2d(x.log_scale(), y.log_scale())?;
    chart
        .configure_mesh()
        .x_desc("states nx")
        .y_desc("µs of one call")
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .x_label_formatter(&|v| format!("{v:.0}"))
        .y_label_formatter(&|v| three(*v))
        .draw()?;
    for (k, mode) in Mode::ALL.into_iter().enumerate() {
        let points: Vec<_> =
            growth.points.iter().map(|(nx, m)| (*nx as f64, 1e6 * m[k].time.median)).collect();
        let colour = COLOURS[k];
        chart
            .draw_series(LineSeries::new(points.iter().copied(), colour.stroke_width(2)).point_size(3))?
            .label(format!("{}, nx^{:.2}", label(mode), growth.exponent(k)))
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE)
        .draw()?;
    Ok(())
}

/// Labels at 1, 2, 5, 10, ... only: the others would overlap.
fn round(value: f64) -> String {
    let digit = value / 10f64.powf(value.log10().floor());
    let known = [1.0, 2.0, 5.0, 10.0].iter().any(|d| (digit - d).abs() < 1e-6);
    if known { format!("{value:.0}") } else { String::new() }
}

fn draw_precision(
    area: &Area,
    what: &str,
    all: &[super::growth::Precision],
    of: impl Fn(&super::growth::Precision) -> super::rows::Measured,
) -> Result<(), Failure> {
    let time = |p| 1e6 * of(p).time.median;
    let error = |p| of(p).error.unwrap_or(f64::NAN).max(1e-17);
    let mut chart = ChartBuilder::on(area)
        .caption(format!("Chain of 5 masses: error of the {what}"), ("sans-serif", 18))
        .margin(10)
        .x_label_area_size(42)
        .y_label_area_size(72)
        .build_cartesian_2d(
            range(all.iter().map(time)).log_scale(),
            range(all.iter().map(error)).log_scale(),
        )?;
    chart
        .configure_mesh()
        .x_desc("µs of one call")
        .y_desc("relative error")
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .x_label_formatter(&|v| round(*v))
        .y_label_formatter(&|v| format!("{v:.0e}"))
        .draw()?;
    for stages in 1..=5 {
        let points: Vec<_> = all.iter().filter(|p| p.stages == stages).map(|p| (time(p), error(p))).collect();
        let colour = COLOURS[stages - 1];
        chart
            .draw_series(LineSeries::new(points, colour.stroke_width(2)).point_size(3))?
            .label(format!("s = {stages}"))
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE)
        .draw()?;
    Ok(())
}

/// Bars: how many times faster one call is than acados' IRK.
fn draw_speedup(area: &Area, results: &Results) -> Result<(), Failure> {
    let mut cases: Vec<&str> = Vec::new();
    for row in results.rows.iter().filter(|row| row.acados[0].is_some()) {
        if cases.last() != Some(&row.case.as_str()) {
            cases.push(&row.case);
        }
    }
    let ratio = |case: &str, mode: Mode| {
        let row = results.rows.iter().find(|row| row.case == case && row.mode == mode)?;
        Some(row.acados[0]?.seconds() / row.cold.time.median)
    };
    let all = cases.iter().flat_map(|case| Mode::ALL.map(|mode| ratio(case, mode).unwrap_or(f64::NAN)));
    let high = range(all).end;
    let how = origin(results.rows.iter().filter_map(|row| row.acados[0].as_ref()));
    let mut chart = ChartBuilder::on(area)
        .caption(format!("One call: times faster than acados' IRK ({how})"), ("sans-serif", 18))
        .margin(10)
        .x_label_area_size(42)
        .y_label_area_size(50)
        .build_cartesian_2d(0.0..cases.len() as f64, (0.5..high).log_scale())?;
    chart
        .configure_mesh()
        .disable_x_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .x_labels(2 * cases.len() + 1)
        .x_label_style(("sans-serif", 10))
        .x_label_formatter(&|x| {
            let at = x - 0.5;
            let case = if (at - at.round()).abs() < 1e-6 { cases.get(at.round() as usize) } else { None };
            case.map_or_else(String::new, |case| {
                case.replace("chain ", "ch").replace("pendulum", "pend").replace("radau ", "")
            })
        })
        .y_label_formatter(&|v| three(*v))
        .draw()?;
    for (k, mode) in Mode::ALL.into_iter().enumerate() {
        let colour = COLOURS[k];
        let bars = cases.iter().enumerate().filter_map(|(i, case)| {
            let left = i as f64 + 0.1 + 0.2 * k as f64;
            Some(Rectangle::new([(left, 0.5), (left + 0.18, ratio(case, mode)?)], colour.filled()))
        });
        chart
            .draw_series(bars)?
            .label(label(mode))
            .legend(move |(x, y)| Rectangle::new([(x, y - 5), (x + 12, y + 5)], colour.filled()));
    }
    chart.draw_series(LineSeries::new([(0.0, 1.0), (cases.len() as f64, 1.0)], BLACK))?;
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE)
        .draw()?;
    Ok(())
}
