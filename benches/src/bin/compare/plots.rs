//! The plots: time over the size of the chain, error over time, and how many times faster.

use super::growth::{Precision, ScalingWithSize};
use super::report::{mode_label, time_origin};
use super::rows::Measured;
use super::{Failure, Results};
use casados::plot::{Curve, Figure, Panel};
use casados_benches::case::Mode;
use std::path::Path;

/// Writes all plots that there is something for.
pub fn draw_all(results: &Results, folder: &Path) -> Result<(), Failure> {
    for growth in &results.growth {
        let name = format!("growth_s{}n{}.svg", growth.stages, growth.steps);
        Figure::new().size(720, 520).with(growth_plot(growth)).save(folder.join(name))?;
    }
    if let Some((all, _)) = &results.precision {
        let figure = Figure::new().size(1100, 480).with(work_precision_plot("state", all, |p| p.simulation));
        let figure = figure.column(1.0).with(work_precision_plot("Jacobian", all, |p| p.forward));
        figure.save(folder.join("work_precision.svg"))?;
    }
    if results.rows.iter().any(|row| row.acados[0].is_some()) {
        Figure::new().size(1100, 480).with(speedup_plot(results)).save(folder.join("speedup.svg"))?;
    }
    Ok(())
}

fn growth_plot(growth: &ScalingWithSize) -> Panel {
    let title = format!("Chain of masses, s = {}, {} steps", growth.stages, growth.steps);
    let panel = Panel::new(title).x("states nx").y("µs of one call").log_x().log_y();
    Mode::ALL_MODES.into_iter().enumerate().fold(panel, |panel, (k, mode)| {
        let points = growth.points.iter().map(|(nx, m)| (*nx as f64, 1e6 * m[k].time.median));
        let name = format!("{}, nx^{:.2}", mode_label(mode), growth.fitted_exponent(k));
        panel.with(Curve::line(name, points).marked())
    })
}

fn work_precision_plot(what: &str, all: &[Precision], of: fn(&Precision) -> Measured) -> Panel {
    let panel = Panel::new(format!("Chain of 5 masses: error of the {what}"));
    let panel = panel.x("µs of one call").y("relative error").log_x().log_y();
    (1..=5).fold(panel, |panel, stages| {
        let points = all.iter().filter(|p| p.stages == stages).map(|p| {
            let measured = of(p);
            (1e6 * measured.time.median, measured.error.unwrap_or(f64::NAN).max(1e-17))
        });
        panel.with(Curve::line(format!("s = {stages}"), points).marked())
    })
}

/// How many times faster one call is than acados' IRK.
fn speedup_plot(results: &Results) -> Panel {
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
    let how = time_origin(results.rows.iter().filter_map(|row| row.acados[0].as_ref()));
    let short = |case: &&str| case.replace("chain ", "ch").replace("pendulum", "pend").replace("radau ", "");
    let panel = Panel::new(format!("One call: times faster than acados' IRK ({how})")).log_y().limit(1.0);
    Mode::ALL_MODES.into_iter().enumerate().fold(
        panel.x_names(cases.iter().map(short)),
        |panel, (k, mode)| {
            let points = cases
                .iter()
                .enumerate()
                .filter_map(|(i, case)| Some((i as f64 + 0.15 * (k as f64 - 1.5), ratio(case, mode)?)));
            panel.dots(mode_label(mode), points)
        },
    )
}
