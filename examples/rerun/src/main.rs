//! The flight of a quadrotor in the viewer Rerun (<https://rerun.io>): its pose and trajectory, two
//! columns, thrusts within their bounds, and the iterations of the solver.
//!
//! ```text
//! cargo run                     writes quadrotor.rrd, for the viewer: rerun quadrotor.rrd
//! cargo run -- FILE.rrd         writes another file
//! cargo run -- --spawn          shows it in the viewer, if that is installed
//! ```

mod problem;
#[path = "../../models/quadrotor.rs"]
#[allow(dead_code)] // The one in a plane.
mod quadrotor;

use casados::ocp::Trajectory;
use problem::{COLUMNS, DURATION, INTERVALS, RADIUS, THRUST};
use rerun::{
    Arrows3D, Boxes3D, Color, Cylinders3D, FillMode, LineStrips3D, Quaternion, RecordingStream,
    RecordingStreamBuilder, Scalars, SeriesLines, TextLog, Transform3D,
};
use std::error::Error;

type Done = Result<(), Box<dyn Error>>;

/// Points of an interval that are shown.
const POINTS: usize = 5;
const ARM: f64 = 0.2; // m
const ROTORS: [(&str, [f64; 2]); 4] =
    [("front", [1.0, 0.0]), ("right", [0.0, -1.0]), ("behind", [-1.0, 0.0]), ("left", [0.0, 1.0])];

fn orange() -> Color {
    Color::from_rgb(217, 115, 13)
}

fn main() -> Done {
    let argument = std::env::args().nth(1).unwrap_or_else(|| "quadrotor.rrd".into());
    let builder = RecordingStreamBuilder::new("casados_quadrotor");
    let recording = if argument == "--spawn" { builder.spawn()? } else { builder.save(&argument)? };
    scene(&recording)?;
    let iterations = iterations(&recording)?;
    flight(&recording, iterations)?;
    recording.flush_blocking()?;
    if argument != "--spawn" {
        println!("{argument} is written; rerun {argument} shows it");
    }
    Ok(())
}

/// What does not move.
fn scene(recording: &RecordingStream) -> Done {
    recording.log_static("world", &rerun::ViewCoordinates::RIGHT_HAND_Z_UP())?;
    let lengths = [2.0_f32; 2];
    let columns = Cylinders3D::from_lengths_and_radii(lengths, [RADIUS as f32; 2])
        .with_centers(COLUMNS.map(|[x, y]| [x as f32, y as f32, 1.0]))
        .with_colors([Color::from_unmultiplied_rgba(102, 112, 133, 160)])
        .with_fill_mode(FillMode::Solid);
    recording.log_static("world/columns", &columns)?;
    let arm = ARM as f32;
    let body = Boxes3D::from_half_sizes([[arm, 0.02, 0.01], [0.02, arm, 0.01], [0.05, 0.05, 0.03]])
        .with_fill_mode(FillMode::Solid)
        .with_colors([Color::from_rgb(11, 107, 203)]);
    recording.log_static("world/quadrotor", &body)?;
    for (name, _) in ROTORS {
        let line = SeriesLines::new().with_names([name]).with_widths([2.0]);
        recording.log_static(format!("thrust/{name}"), &line)?;
    }
    for (name, bound) in [("least", THRUST[0]), ("most", THRUST[1])] {
        let line = SeriesLines::new().with_names([format!("{name}: {bound} N")]).with_widths([1.0]);
        recording.log_static(format!("thrust/{name}"), &line)?;
    }
    Ok(())
}

/// The iterate after each iteration: it solves as often as there are iterations, each time from the
/// same guess, and one iteration farther. Returns their number.
fn iterations(recording: &RecordingStream) -> Result<usize, Box<dyn Error>> {
    let mut ocp = problem::flight()?;
    let mut sqp = problem::solver(&ocp, 100)?;
    let outcome = sqp.solve(&mut ocp)?;
    println!("{}{outcome}", sqp.log());
    if !outcome.is_converged() {
        return Err(outcome.to_string().into());
    }
    for row in sqp.log().0 {
        recording.set_time_sequence("iteration", row.iteration as i64);
        recording.log("solver/objective", &Scalars::single(row.objective))?;
        let residuals = &row.residuals;
        let parts = [
            ("stationarity", residuals.stationarity),
            ("dynamics", residuals.dynamics),
            ("inequalities", residuals.inequalities),
            ("complementarity", residuals.complementarity),
        ];
        for (name, residual) in parts {
            // Logarithmic: the axes of the viewer are linear.
            let digits = residual.max(1e-16).log10();
            recording.log(format!("solver/residuals/{name}"), &Scalars::single(digits))?;
        }
        let mut ocp = problem::flight()?;
        problem::solver(&ocp, row.iteration)?.solve(&mut ocp)?;
        recording.log("world/iterate", &strip(&ocp.dense_solution(POINTS)?)?.with_colors([orange()]))?;
    }
    recording.log("solver/outcome", &TextLog::new(outcome.to_string()))?;
    Ok(outcome.iterations)
}

/// The solution over time.
fn flight(recording: &RecordingStream, iterations: usize) -> Done {
    let mut ocp = problem::flight()?;
    problem::solver(&ocp, iterations)?.solve(&mut ocp)?;
    let solution = ocp.dense_solution(POINTS)?;
    recording.disable_timeline("iteration");
    recording.log_static("world/trajectory", &strip(&solution)?.with_radii([0.01]))?;
    let states = (0..12).map(|i| solution.state(&format!("x[{i}]"))).collect::<Result<Vec<_>, _>>()?;
    let controls = (0..4).map(|i| solution.control(&format!("u[{i}]"))).collect::<Result<Vec<_>, _>>()?;
    for (k, &time) in solution.times().iter().enumerate() {
        recording.set_duration_secs("flight", time);
        let at = |i: usize| states[i][k] as f32;
        let pose =
            Transform3D::from_translation_rotation([at(0), at(1), at(2)], quaternion([at(3), at(4), at(5)]));
        recording.log("world/quadrotor", &pose)?;
        recording.log("velocity", &Scalars::new([at(6), at(7), at(8)].map(f64::from)))?;
        let u: Vec<f64> = controls.iter().filter_map(|u| u.get(k)).copied().collect();
        if u.len() < 4 {
            continue;
        }
        let arrows = Arrows3D::from_vectors(u.iter().map(|&thrust| [0.0, 0.0, 0.1 * thrust as f32]))
            .with_origins(ROTORS.map(|(_, [x, y])| [(ARM * x) as f32, (ARM * y) as f32, 0.0]))
            .with_colors([orange()]);
        recording.log("world/quadrotor/thrusts", &arrows)?;
        for ((name, _), thrust) in ROTORS.iter().zip(u) {
            recording.log(format!("thrust/{name}"), &Scalars::single(thrust))?;
        }
        for (name, bound) in [("least", THRUST[0]), ("most", THRUST[1])] {
            recording.log(format!("thrust/{name}"), &Scalars::single(bound))?;
        }
    }
    println!("{INTERVALS} intervals, {DURATION} s");
    Ok(())
}

/// The positions of a trajectory.
fn strip(solution: &Trajectory) -> Result<LineStrips3D, Box<dyn Error>> {
    let (x, y, z) = (solution.state("x[0]")?, solution.state("x[1]")?, solution.state("x[2]")?);
    let points = (0..x.len()).map(|k| [x[k] as f32, y[k] as f32, z[k] as f32]);
    Ok(LineStrips3D::new([points.collect::<Vec<_>>()]))
}

/// Of roll, pitch and yaw.
fn quaternion(angles: [f32; 3]) -> Quaternion {
    let [(sr, cr), (sp, cp), (sy, cy)] = angles.map(|angle| (0.5 * angle).sin_cos());
    Quaternion::from_xyzw([
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    ])
}
