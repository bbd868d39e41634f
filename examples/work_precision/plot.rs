//! A picture for each problem: error over time.

use super::Measured;
use plotters::prelude::*;
use std::error::Error;
use std::path::Path;

const GRID: RGBColor = RGBColor(225, 225, 225);
/// Of this library, warm; of the others, cold.
const OURS: [RGBColor; 5] = [
    RGBColor(200, 62, 45),
    RGBColor(230, 145, 20),
    RGBColor(180, 110, 60),
    RGBColor(220, 180, 60),
    RGBColor(150, 40, 90),
];
const PEERS: [RGBColor; 5] = [
    RGBColor(31, 95, 168),
    RGBColor(60, 140, 70),
    RGBColor(90, 170, 190),
    RGBColor(120, 80, 160),
    RGBColor(110, 110, 110),
];

/// Draws `NAME.svg`, or `NAME_sensitivities.svg`.
///
/// # Errors
/// Of the file.
pub fn draw(measured: &Measured, folder: &Path) -> Result<(), Box<dyn Error>> {
    let with = if measured.derivatives { "_sensitivities" } else { "" };
    let path = folder.join(format!("{}{with}.svg", measured.name));
    let area = SVGBackend::new(&path, (760, 520)).into_drawing_area();
    area.fill(&WHITE)?;
    let title = if measured.derivatives {
        format!("{}, with sensitivities", measured.title)
    } else {
        measured.title.into()
    };
    let mut chart = ChartBuilder::on(&area)
        .caption(title, ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(42)
        .y_label_area_size(56)
        .build_cartesian_2d((1e-14..1.0).log_scale(), times(measured).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("largest relative error")
        .y_desc("ms")
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .x_label_formatter(&|x| format!("{x:.0e}"))
        .y_label_formatter(&|y| format!("{y}"))
        .draw()?;
    let mut names: Vec<(&str, bool)> = Vec::new();
    for run in &measured.runs {
        if !names.contains(&(run.solver.as_str(), run.ours)) {
            names.push((&run.solver, run.ours));
        }
    }
    let mut counts = [0, 0];
    for (name, ours) in names {
        let count = &mut counts[usize::from(ours)];
        let colours = if ours { OURS } else { PEERS };
        let style = colours[*count % colours.len()].stroke_width(if name == "Radau" { 3 } else { 1 });
        *count += 1;
        let outcomes =
            measured.runs.iter().filter(|run| run.solver == name).filter_map(|run| run.outcome.as_ref().ok());
        let points: Vec<_> =
            outcomes.filter(|o| o.error < 1.0).map(|o| (o.error.max(1e-14), 1e3 * o.time)).collect();
        if points.is_empty() {
            continue;
        }
        chart
            .draw_series(LineSeries::new(points.iter().copied(), style))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
        chart.draw_series(points.iter().map(|point| Circle::new(*point, 2, style.filled())))?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.85))
        .border_style(GRID)
        .draw()?;
    area.present()?;
    Ok(())
}

/// The range of all times, in milliseconds.
fn times(measured: &Measured) -> std::ops::Range<f64> {
    let outcomes = measured.runs.iter().filter_map(|run| run.outcome.as_ref().ok());
    let (low, high) =
        outcomes.fold((f64::INFINITY, 0.0f64), |(low, high), o| (low.min(o.time), high.max(o.time)));
    if low > high { 0.1..10.0 } else { 1e3 * low / 1.5..1e3 * high * 1.5 }
}
