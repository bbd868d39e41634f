//! The picture: at the left the motion of the chain as seen from above, at the right what an
//! iteration costs.

use plotters::coord::Shift;
use plotters::prelude::*;
use std::error::Error;
use std::path::Path;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn Error>>;

const GRID: RGBColor = RGBColor(225, 225, 225);
const INK: RGBColor = RGBColor(40, 40, 40);
const WALL: RGBColor = RGBColor(200, 62, 45);
const COLOURS: [RGBColor; 3] = [RGBColor(60, 140, 70), RGBColor(31, 95, 168), RGBColor(230, 145, 20)];

/// Milliseconds of an iteration, over the number of masses.
pub struct Series {
    pub name: String,
    pub points: Vec<(usize, f64)>,
}

/// What is drawn.
#[derive(Default)]
pub struct Picture {
    pub series: Vec<Series>,
    /// States at the nodes.
    pub states: Vec<Vec<f64>>,
    /// The iterations, which are printed.
    pub log: String,
}

impl Picture {
    /// Writes an SVG file; its folder is made if there is none.
    pub fn draw(&self, path: &Path) -> Drawn {
        let failed = |error: std::io::Error| format!("cannot write {}: {error}", path.display());
        let mut svg = String::new();
        {
            let root = SVGBackend::with_string(&mut svg, (1100, 460)).into_drawing_area();
            root.fill(&WHITE)?;
            let (left, right) = root.margin(8, 8, 8, 8).split_horizontally(560);
            self.draw_motion(&left)?;
            self.draw_times(&right)?;
            root.present()?;
        }
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(failed)?;
        }
        std::fs::write(path, svg).map_err(failed)?;
        Ok(())
    }

    /// x and y of all masses at every other node, from light to dark; the wall.
    fn draw_motion(&self, area: &Area) -> Drawn {
        let chains: Vec<Vec<(f64, f64)>> = self.states.iter().map(|state| chain(state)).collect();
        let all = chains.iter().flatten();
        let range = |coordinate: fn(&(f64, f64)) -> f64| {
            let values = all.clone().map(coordinate);
            let (low, high) = values.fold((-0.1, 0.1), |(low, high), v| (v.min(low), v.max(high)));
            low - 0.05..high + 0.05
        };
        let (x, y) = (range(|p| p.0), range(|p| p.1));
        let mut chart = ChartBuilder::on(area)
            .caption("Five masses on their way to rest, from above", ("sans-serif", 17))
            .x_label_area_size(36)
            .y_label_area_size(46)
            .build_cartesian_2d(x.clone(), y)?;
        chart
            .configure_mesh()
            .light_line_style(WHITE)
            .bold_line_style(GRID)
            .x_desc("x, m")
            .y_desc("y, m")
            .draw()?;
        chart.draw_series(LineSeries::new([(x.start, -0.05), (x.end, -0.05)], WALL.stroke_width(2)))?;
        let last = chains.len().saturating_sub(1).max(1) as f64;
        for (k, chain) in chains.iter().enumerate().step_by(2) {
            let shade = (205.0 * (1.0 - k as f64 / last)) as u8;
            let colour = RGBColor(shade, shade, (shade / 2).saturating_add(90));
            chart.draw_series(LineSeries::new(chain.iter().copied(), colour.stroke_width(1)))?;
            chart.draw_series(chain.iter().map(|point| Circle::new(*point, 2, colour.filled())))?;
        }
        Ok(())
    }

    fn draw_times(&self, area: &Area) -> Drawn {
        let largest = self.series.iter().flat_map(|s| &s.points).fold(0.1, |m: f64, p| m.max(p.1));
        let smallest = self.series.iter().flat_map(|s| &s.points).fold(largest, |m: f64, p| m.min(p.1));
        let mut chart = ChartBuilder::on(area)
            .caption("Time of an iteration", ("sans-serif", 17))
            .x_label_area_size(36)
            .y_label_area_size(54)
            .build_cartesian_2d(2.8..7.2, (0.8 * smallest..1.3 * largest).log_scale())?;
        chart
            .configure_mesh()
            .light_line_style(WHITE)
            .bold_line_style(GRID)
            .x_desc("masses")
            .y_desc("ms")
            .x_labels(5)
            .x_label_formatter(&|x| format!("{x:.0}"))
            .draw()?;
        for (series, colour) in self.series.iter().zip(COLOURS) {
            let points: Vec<_> = series.points.iter().map(|(n, time)| (*n as f64, *time)).collect();
            chart
                .draw_series(LineSeries::new(points.iter().copied(), colour.stroke_width(2)))?
                .label(series.name.as_str())
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
            chart.draw_series(points.iter().map(|point| Circle::new(*point, 3, colour.filled())))?;
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperLeft)
            .border_style(GRID)
            .background_style(WHITE)
            .label_font(("sans-serif", 14).into_font().color(&INK))
            .draw()?;
        Ok(())
    }
}

/// x and y of the wall and of all masses.
fn chain(state: &[f64]) -> Vec<(f64, f64)> {
    let free = state.len().saturating_sub(3) / 6;
    let masses = state.chunks_exact(3).take(free + 1);
    core::iter::once((0.0, 0.0)).chain(masses.filter_map(|p| Some((*p.first()?, *p.get(1)?)))).collect()
}
