//! Pictures: the orbit with the attitude of the aircraft, states, controls and constraints over
//! time, and the convergence of all runs.

use crate::awe::Awe;
use crate::awe::awe::{LENGTH, State, TETHER_SCALE, TURBINE_SCALE, power};
use casados::prelude::*;
use casados::qp::HeapSolution;
use nalgebra::{SVector, Vector3};
use plotters::coord::Shift;
use plotters::prelude::*;
use std::error::Error;
use std::ops::Range;
use std::path::Path;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn Error>>;
/// Values over time, with names.
type Lines = Vec<(&'static str, Vec<f64>)>;

const GRID: RGBColor = RGBColor(225, 225, 225);
const INK: RGBColor = RGBColor(40, 40, 40);
const COLOURS: [RGBColor; 4] =
    [RGBColor(31, 95, 168), RGBColor(230, 145, 20), RGBColor(60, 140, 70), RGBColor(200, 62, 45)];
const DEGREE: f64 = core::f64::consts::PI / 180.0;
/// The aircraft is drawn so many times larger than it is.
const ENLARGED: f64 = 3.0;

/// The largest residual of each iteration of a run.
pub struct Convergence {
    pub name: String,
    pub residuals: Vec<f64>,
}

/// A solution.
pub struct Picture {
    states: Vec<State>,
    controls: Vec<[f64; 4]>,
    tensions: Vec<f64>,
    h: f64,
}

impl Picture {
    /// Of an orbit with intervals of length `h`.
    ///
    /// # Errors
    /// Those of the integrator.
    pub fn of(solution: &HeapSolution, h: f64) -> Result<Self, casados::Error> {
        let mut irk = Irk::<Awe, RadauIIA<4>>::new(Options { start: Start::Zero, ..Default::default() })?;
        let (mut states, mut controls, mut tensions) = (Vec::new(), Vec::new(), Vec::new());
        for stage in solution.stages() {
            let x = SVector::<f64, 23>::from_column_slice(stage.x);
            states.push(State {
                q: x.fixed_rows::<3>(0).into(),
                dq: x.fixed_rows::<3>(3).into(),
                omega: x.fixed_rows::<3>(6).into(),
                r: nalgebra::Matrix3::from_column_slice(&stage.x[9..18]),
                delta: x.fixed_rows::<3>(18).into(),
                kappa: x[21],
                cost: x[22],
            });
            if stage.u.len() == 4 {
                controls.push(std::array::from_fn(|i| stage.u[i]));
                let step = irk.solve(&x, &SVector::from_column_slice(stage.u), h)?;
                tensions.push(TETHER_SCALE * step.z0[0] * LENGTH);
            }
        }
        Ok(Self { states, controls, tensions, h })
    }

    /// Writes three SVG files into a folder, which is made if there is none.
    pub fn draw(&self, folder: &Path, convergence: &[Convergence]) -> Drawn {
        let failed = |error: std::io::Error| format!("cannot write {}: {error}", folder.display());
        std::fs::create_dir_all(folder).map_err(failed)?;
        let write = |name: &str, size: (u32, u32), draw: &dyn Fn(&Area) -> Drawn| -> Drawn {
            let mut svg = String::new();
            {
                let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
                root.fill(&WHITE)?;
                draw(&root.margin(8, 8, 8, 8))?;
                root.present()?;
            }
            std::fs::write(folder.join(name), svg).map_err(failed)?;
            Ok(())
        };
        write("awe_orbit.svg", (620, 560), &|area| self.draw_orbit(area))?;
        write("awe_orbit_time.svg", (1000, 760), &|area| self.draw_time(area))?;
        write("awe_orbit_convergence.svg", (620, 420), &|area| draw_convergence(area, convergence))
    }

    /// The orbit as seen from the ground station, with the aircraft at every other node: wing,
    /// fuselage, tailplane and fin.
    fn draw_orbit(&self, area: &Area) -> Drawn {
        let mut chart = ChartBuilder::on(area)
            .caption(
                "Orbit of most power, seen from the ground station; aircraft three times its size",
                text(),
            )
            .margin(6)
            .x_label_area_size(44)
            .y_label_area_size(60)
            .build_cartesian_2d(-90.0..90.0, 75.0..240.0)?;
        mesh(&mut chart, "across the wind, m", "height, m")?;
        // The wind blows into the picture, so that y points to the left.
        let place = |p: Vector3<f64>| (-p.y, p.z);
        let powers: Vec<f64> = self.states.iter().map(|state| power(state) / 1e3).collect();
        let least = powers.iter().copied().fold(f64::INFINITY, f64::min);
        let most = powers.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let colour = |kilowatts: f64| {
            let share = ((kilowatts - least) / (most - least)).clamp(0.0, 1.0);
            let channel = |a: f64, b: f64| (a + share * (b - a)).round() as u8;
            RGBColor(channel(38.0, 245.0), channel(90.0, 170.0), channel(160.0, 40.0))
        };
        for (pair, power) in self.states.windows(2).zip(&powers) {
            let points: Vec<_> = pair.iter().map(|state| place(state.q)).collect();
            chart.draw_series([PathElement::new(points, colour(*power).stroke_width(3))])?;
        }
        for state in self.states.iter().step_by(2) {
            let at = |chord: f64, span: f64, up: f64| {
                place(state.q + ENLARGED * (state.r * Vector3::new(chord, span, up)))
            };
            // Metres from the centre: the wing, the fuselage, the tailplane, the fin.
            let lines = [
                [at(0.0, -2.75, 0.0), at(0.0, 2.75, 0.0)],
                [at(-0.6, 0.0, 0.0), at(2.2, 0.0, 0.0)],
                [at(2.2, -0.7, 0.0), at(2.2, 0.7, 0.0)],
                [at(2.2, 0.0, 0.0), at(2.4, 0.0, 0.8)],
            ];
            chart.draw_series(lines.map(|line| PathElement::new(line, INK.stroke_width(2))))?;
        }
        let labels = [(-20.0, 160.0, most), (-20.0, 150.0, least)];
        for (x, y, kilowatts) in labels {
            let corners = [(x - 6.0, y), (x - 1.0, y - 5.0)];
            chart.draw_series([Rectangle::new(corners, colour(kilowatts).filled())])?;
            chart.draw_series([Text::new(format!("{kilowatts:.1} kW"), (x, y), text())])?;
        }
        Ok(())
    }

    /// Six panels over time.
    fn draw_time(&self, area: &Area) -> Drawn {
        let panels = area.split_evenly((3, 2));
        let of_state = |f: &dyn Fn(&State) -> f64| self.states.iter().map(f).collect::<Vec<_>>();
        let air = |state: &State| {
            let wind = 10.0 * ((state.q.z * state.q.z + 1.0).sqrt() / 100.0).powf(0.15);
            state.r.transpose() * (Vector3::new(wind, 0.0, 0.0) - state.dq)
        };
        let kilonewtons = self.tensions.iter().map(|t| t / 1e3).collect();
        let rates: Vec<Vec<f64>> =
            (0..3).map(|i| self.controls.iter().map(|u| u[i] / DEGREE).collect()).collect();
        let deflections: Vec<Vec<f64>> = (0..3).map(|i| of_state(&|s| s.delta[i] / DEGREE)).collect();
        let [aileron, elevator, rudder] = ["aileron", "elevator", "rudder"];
        let named = |lines: Vec<Vec<f64>>| [aileron, elevator, rudder].into_iter().zip(lines).collect();
        let drawn: [(&str, &str, Lines, Vec<f64>); 6] = [
            ("Tension of the tether", "kN", vec![("", kilonewtons)], vec![1.8]),
            ("Airspeed", "m/s", vec![("", of_state(&|s| air(s).norm()))], vec![10.0, 32.0]),
            (
                "Angles of attack and sideslip",
                "degrees",
                vec![
                    ("attack", of_state(&|s| air(s).z / air(s).x / DEGREE)),
                    ("sideslip", of_state(&|s| air(s).y / air(s).x / DEGREE)),
                ],
                vec![9.0, -6.0],
            ),
            ("Deflections", "degrees", named(deflections), vec![]),
            ("Their rates", "degrees/s", named(rates), vec![]),
            (
                "Drag coefficient of the turbines",
                "kg/m",
                vec![("", of_state(&|s| TURBINE_SCALE * s.kappa))],
                vec![],
            ),
        ];
        for (area, (caption, unit, lines, limits)) in panels.iter().zip(&drawn) {
            self.draw_panel(area, [caption, unit], lines, limits)?;
        }
        Ok(())
    }

    /// Lines over time, and limits in red.
    fn draw_panel(&self, area: &Area, [caption, unit]: [&str; 2], lines: &Lines, limits: &[f64]) -> Drawn {
        let end = self.h * self.controls.len() as f64;
        let values = || lines.iter().flat_map(|(_, line)| line).chain(limits).copied();
        let (low, high) =
            (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        let room = 0.12 * (high - low).max(0.05 * high.abs()).max(1e-9);
        let mut chart = ChartBuilder::on(area)
            .caption(caption, title())
            .margin(6)
            .x_label_area_size(36)
            .y_label_area_size(64)
            .build_cartesian_2d(0.0..end, low - room..high + 2.0 * room)?;
        mesh(&mut chart, "time, s", unit)?;
        for &limit in limits {
            chart
                .draw_series([PathElement::new([(0.0, limit), (end, limit)], COLOURS[3].stroke_width(1))])?;
        }
        for (i, (name, line)) in lines.iter().enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            let points = line.iter().enumerate().map(|(k, &value)| (self.h * k as f64, value));
            chart.draw_series(LineSeries::new(points, colour.stroke_width(2)))?;
            let at = (end * (0.04 + 0.3 * i as f64), high + 1.7 * room);
            chart.draw_series([Text::new((*name).to_owned(), at, text().color(&colour))])?;
        }
        Ok(())
    }
}

/// The largest residual over the iterations; every second run has dots.
fn draw_convergence(area: &Area, runs: &[Convergence]) -> Drawn {
    let longest = runs.iter().map(|run| run.residuals.len()).max().unwrap_or(1);
    let range: Range<f64> = 1e-10..1e4;
    let mut chart = ChartBuilder::on(area)
        .caption("Largest residual of the conditions of optimality", title())
        .margin(6)
        .x_label_area_size(40)
        .y_label_area_size(64)
        .build_cartesian_2d(0.0..longest as f64, range.log_scale())?;
    chart
        .configure_mesh()
        .x_desc("iteration")
        .label_style(text())
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .y_label_formatter(&|y| format!("{y:.0e}"))
        .x_label_formatter(&|x| format!("{x:.0}"))
        .draw()?;
    for (i, run) in runs.iter().enumerate() {
        let colour = COLOURS[i / 2 % COLOURS.len()];
        let points: Vec<_> =
            run.residuals.iter().enumerate().map(|(k, &r)| (k as f64, r.max(1e-10))).collect();
        chart.draw_series(LineSeries::new(points.clone(), colour.stroke_width(2)))?;
        if i % 2 == 1 {
            chart.draw_series(points.into_iter().map(|point| Circle::new(point, 3, colour.filled())))?;
        }
        let at = (0.64 * longest as f64, 8e3 / 5f64.powi(i as i32));
        chart.draw_series([Text::new(run.name.clone(), at, text().color(&colour))])?;
    }
    Ok(())
}

fn mesh<'a>(
    chart: &mut ChartContext<
        'a,
        SVGBackend<'_>,
        Cartesian2d<plotters::coord::types::RangedCoordf64, plotters::coord::types::RangedCoordf64>,
    >,
    x: &str,
    y: &str,
) -> Drawn {
    chart
        .configure_mesh()
        .x_desc(x)
        .y_desc(y)
        .axis_desc_style(text())
        .label_style(text())
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(INK)
        .x_labels(8)
        .y_labels(5)
        .draw()?;
    Ok(())
}

fn text() -> TextStyle<'static> {
    ("sans-serif", 14).into_font().color(&INK)
}

fn title() -> TextStyle<'static> {
    ("sans-serif", 16).into_font().color(&INK)
}
