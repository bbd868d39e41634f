//! The picture: the orbit as seen from the ground station, what it yields, and the errors.

use crate::awe::awe::{LENGTH, State, TETHER_SCALE, power};
use plotters::coord::Shift;
use plotters::prelude::*;
use std::error::Error;
use std::ops::Range;
use std::path::Path;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn Error>>;

/// What is drawn. Times in seconds.
#[derive(Default)]
pub struct Orbit {
    /// Time, state, and the multiplier of the tether.
    pub curve: Vec<(f64, State, f64)>,
    /// The state at the start of each interval.
    pub wings: Vec<State>,
    /// Errors of x, the Jacobian, the adjoint and the Hessian at the end of each interval.
    pub errors: Vec<(f64, [f64; 4])>,
}

const SPAN: f64 = 5.5;
const GRID: RGBColor = RGBColor(225, 225, 225);
const INK: RGBColor = RGBColor(40, 40, 40);
const BLUE: RGBColor = RGBColor(31, 95, 168);
const RED: RGBColor = RGBColor(200, 62, 45);
const SERIES: [(&str, RGBColor); 4] =
    [("x", BLUE), ("Jacobian", RGBColor(230, 145, 20)), ("adjoint", RGBColor(60, 140, 70)), ("Hessian", RED)];

impl Orbit {
    /// Writes an SVG file; its folder is made if there is none.
    pub fn draw(&self, path: &Path) -> Drawn {
        let failed = |error: std::io::Error| format!("cannot write {}: {error}", path.display());
        let mut svg = String::new();
        {
            let root = SVGBackend::with_string(&mut svg, (1200, 660)).into_drawing_area();
            root.fill(&WHITE)?;
            let (left, right) = root.margin(8, 8, 8, 8).split_horizontally(570);
            let (power, right) = right.split_vertically(195);
            let (tension, errors) = right.split_vertically(195);
            self.draw_orbit(&left)?;
            self.draw_power(&power)?;
            self.draw_tension(&tension)?;
            self.draw_errors(&errors)?;
            root.present()?;
        }
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(failed)?;
        }
        std::fs::write(path, svg).map_err(failed)?;
        Ok(())
    }

    fn end(&self) -> f64 {
        self.curve.last().map_or(1.0, |(t, ..)| *t)
    }

    /// The orbit against the sky, coloured by power, with the wing at the start of each interval.
    fn draw_orbit(&self, area: &Area) -> Drawn {
        let mut chart = ChartBuilder::on(area)
            .caption("Orbit, seen from the ground station", title())
            .margin(6)
            .x_label_area_size(48)
            .y_label_area_size(64)
            .build_cartesian_2d(-75.0..75.0, 72.0..234.0)?;
        chart
            .configure_mesh()
            .x_desc("across the wind, m")
            .y_desc("height, m")
            .axis_desc_style(text())
            .label_style(text())
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .axis_style(INK)
            .x_labels(7)
            .y_labels(8)
            .x_label_formatter(&|x| format!("{x:.0}"))
            .y_label_formatter(&|y| format!("{y:.0}"))
            .draw()?;

        // The wind blows into the picture, so that y points to the left.
        let place = |state: &State| (-state.q.y, state.q.z);
        let powers = || self.curve.iter().map(|(_, state, _)| power(state) / 1e3);
        let (low, high) = (powers().fold(f64::MAX, f64::min), powers().fold(0.0, f64::max));
        let colour = |kilowatts: f64| mix((kilowatts - low) / (high - low));
        chart.draw_series((0..self.curve.len()).step_by(7).map(|i| {
            let piece = &self.curve[i..(i + 9).min(self.curve.len())];
            let points: Vec<_> = piece.iter().map(|(_, state, _)| place(state)).collect();
            PathElement::new(points, colour(power(&piece[0].1) / 1e3).stroke_width(5))
        }))?;
        chart.draw_series(self.wings.iter().map(|state| {
            let (x, y) = place(state);
            let half = SPAN / 2.0 * state.r.column(1);
            PathElement::new([(x + half.y, y - half.z), (x - half.y, y + half.z)], INK.stroke_width(2))
        }))?;

        // Where it starts, and which way it goes.
        if let Some(start) = self.wings.first() {
            let (x, y) = place(start);
            let along = start.dq / start.dq.norm() * 9.0;
            let (tip, base) = ((x - 7.0 - along.y, y + along.z), (x - 7.0, y));
            let wing = (0.35 * (tip.0 - base.0), 0.35 * (tip.1 - base.1));
            let barb =
                |side: f64| (tip.0 - wing.0 - side * 0.6 * wing.1, tip.1 - wing.1 + side * 0.6 * wing.0);
            chart.draw_series([
                PathElement::new([base, tip], INK.stroke_width(2)),
                PathElement::new([barb(1.0), tip, barb(-1.0)], INK.stroke_width(2)),
            ])?;
            chart.draw_series([Text::new("start", (x + 5.0, y + 3.0), text())])?;
        }

        // The scale of colours stands inside the orbit.
        let height = |share: f64| 130.0 + 45.0 * share;
        chart.draw_series((0..60).map(|i| {
            let share = f64::from(i) / 60.0;
            let corners = [(-9.0, height(share)), (-3.0, height(share + 1.0 / 60.0))];
            Rectangle::new(corners, mix(share).filled())
        }))?;
        for share in [0.0, 0.5, 1.0] {
            let label = format!("{:.1} kW", low + share * (high - low));
            chart.draw_series([Text::new(label, (0.0, height(share) + 2.0), text())])?;
        }
        chart.draw_series([Text::new("power", (-9.0, height(1.0) + 10.0), text())])?;
        Ok(())
    }

    fn draw_power(&self, area: &Area) -> Drawn {
        let points = self.curve.iter().map(|(t, state, _)| (*t, power(state) / 1e3));
        self.draw_curve(area, "Power of the turbines", "kW", points.collect(), 0.0..18.0, |p| {
            format!("{p:.0}")
        })
    }

    fn draw_tension(&self, area: &Area) -> Drawn {
        let points = self.curve.iter().map(|(t, _, z)| (*t, TETHER_SCALE * z * LENGTH / 1e3));
        self.draw_curve(area, "Tension of the tether", "kN", points.collect(), 1.7..1.9, |t| {
            format!("{t:.2}")
        })
    }

    fn draw_curve(
        &self,
        area: &Area,
        caption: &str,
        unit: &str,
        points: Vec<(f64, f64)>,
        range: Range<f64>,
        format: fn(&f64) -> String,
    ) -> Drawn {
        let mut chart = ChartBuilder::on(area)
            .caption(caption, title())
            .margin(6)
            .x_label_area_size(26)
            .y_label_area_size(72)
            .build_cartesian_2d(0.0..self.end(), range)?;
        chart
            .configure_mesh()
            .y_desc(unit)
            .axis_desc_style(text())
            .label_style(text())
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .axis_style(INK)
            .x_labels(8)
            .y_labels(5)
            .x_label_formatter(&|t| format!("{t:.0}"))
            .y_label_formatter(&format)
            .draw()?;
        chart.draw_series(LineSeries::new(points, BLUE.stroke_width(2)))?;
        Ok(())
    }

    fn draw_errors(&self, area: &Area) -> Drawn {
        let mut chart = ChartBuilder::on(area)
            .caption("Largest relative error after each interval", title())
            .margin(6)
            .x_label_area_size(48)
            .y_label_area_size(72)
            .build_cartesian_2d(0.0..self.end(), (1e-17..1e-9).log_scale())?;
        chart
            .configure_mesh()
            .x_desc("time, s")
            .axis_desc_style(text())
            .label_style(text())
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .axis_style(INK)
            .x_labels(8)
            .y_labels(5)
            .x_label_formatter(&|t| format!("{t:.0}"))
            .y_label_formatter(&|error| format!("{error:.0e}"))
            .draw()?;
        for (i, (name, colour)) in SERIES.into_iter().enumerate() {
            let points = self.errors.iter().map(|(t, errors)| (*t, errors[i].max(1e-17)));
            chart.draw_series(points.map(|point| Circle::new(point, 3, colour.filled())))?;
            let (x, y) = (self.end() * (0.05 + 0.24 * i as f64), 3e-11);
            chart.draw_series([Circle::new((x, y), 5, colour.filled())])?;
            chart.draw_series([Text::new(name, (x + 0.2, 8e-11), text())])?;
        }
        Ok(())
    }
}

fn text() -> TextStyle<'static> {
    ("sans-serif", 16).into_font().color(&INK)
}

fn title() -> TextStyle<'static> {
    ("sans-serif", 19).into_font().color(&INK)
}

/// From blue to yellow.
fn mix(share: f64) -> RGBColor {
    let stops = [(38, 60, 130), (60, 140, 140), (245, 200, 60)];
    let position = 2.0 * share.clamp(0.0, 1.0);
    let (from, to, weight) =
        if position < 1.0 { (stops[0], stops[1], position) } else { (stops[1], stops[2], position - 1.0) };
    let channel = |a: i32, b: i32| (f64::from(a) + weight * f64::from(b - a)).round() as u8;
    RGBColor(channel(from.0, to.0), channel(from.1, to.1), channel(from.2, to.2))
}
