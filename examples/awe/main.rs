//! An aircraft that harvests wind energy on a tether: the 40 intervals of its optimal orbit,
//! integrated with all sensitivities, compared with an independent implementation, timed and drawn.
//!
//! ```text
//! cargo run --release --example awe [PICTURE.svg]
//! ```

#[path = "../models/awe.rs"]
mod awe;

use awe::Awe;
use awe::awe::{LENGTH, State, TETHER_SCALE, power};
use casados::plot::{Figure, Panel, Space};
use casados::prelude::*;
use casados::result::Hessian;
use nalgebra::{SMatrix, SVector};
use reference_data::Record;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

const USAGE: &str = "usage: cargo run --release --example awe [PICTURE.svg]";

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args_os().skip(1).collect();
    let picture = match &arguments[..] {
        [] => PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/plots/awe.svg")),
        [path] if path.as_encoded_bytes().ends_with(b".svg") => PathBuf::from(path),
        _ => {
            eprintln!("{USAGE}");
            return ExitCode::FAILURE;
        }
    };
    match run(&picture) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("awe: {error}");
            ExitCode::FAILURE
        }
    }
}

/// One interval of the orbit: what goes into the integrator, and what must come out.
struct Interval {
    x0: SVector<f64, 23>,
    u: SVector<f64, 4>,
    x: SVector<f64, 23>,
    forward: SMatrix<f64, 23, 27>,
    adjoint: SVector<f64, 27>,
    hessian: SMatrix<f64, 27, 27>,
}

/// What is drawn. Times in seconds.
#[derive(Default)]
struct Orbit {
    /// Time, state, and the multiplier of the tether.
    curve: Vec<(f64, State, f64)>,
    /// The state at the start of each interval.
    wings: Vec<State>,
    /// Errors of x, the Jacobian, the adjoint and the Hessian at the end of each interval.
    errors: Vec<(f64, [f64; 4])>,
}

/// m
const WING_SPAN: f64 = 5.5;

impl Orbit {
    /// The orbit in space, with the wing at the start of each interval; what it yields; the errors.
    fn orbit_figure(&self) -> Figure {
        let curve = self.curve.iter().map(|(_, state, _)| (state.q.into(), power(state) / 1e3));
        let wing =
            |state: &State| [-0.5, 0.5].map(|side| (state.q + side * WING_SPAN * state.r.column(1)).into());
        let orbit = Space::new("The orbit; the wind blows along x, the ground station is at zero")
            .axes(["x, m", "y, m", "z, m"])
            .seen_from(-150.0, 15.0)
            .coloured("kW", curve);
        let over =
            |of: fn(&State, f64) -> f64| self.curve.iter().map(move |(t, state, z)| (*t, of(state, *z)));
        let errors = Panel::new("Largest relative error after each interval").x("time, s").log_y();
        let names = ["x", "Jacobian", "adjoint", "Hessian"];
        let errors = names.iter().enumerate().fold(errors, |panel, (i, name)| {
            panel.dots(*name, self.errors.iter().map(|(t, errors)| (*t, errors[i])))
        });
        Figure::new()
            .size(1200, 660)
            .with(self.wings.iter().fold(orbit, |orbit, state| orbit.outline(wing(state))))
            .column(1.0)
            .with(Panel::new("Power of the turbines").y("kW").line("", over(|state, _| power(state) / 1e3)))
            .with(
                Panel::new("Tension of the tether")
                    .y_range(1.7..1.9)
                    .y("kN")
                    .line("", over(|_, z| TETHER_SCALE * z * LENGTH / 1e3)),
            )
            .with(errors)
    }
}

fn run(picture: &Path) -> Result<(), Box<dyn Error>> {
    let reference = Record::load("awe/intervals.json")?;
    let h = reference.number("T")?;
    let lambda = reference.vector("lambda")?;
    let intervals =
        reference.records("intervals")?.iter().map(Interval::read).collect::<Result<Vec<_>, _>>()?;

    let mut irk = Irk::<Awe, RadauIIA<4>>::new(Options { start: Start::Zero, ..Default::default() })?;

    let mut orbit = Orbit::default();
    for (k, interval) in intervals.iter().enumerate() {
        let start = k as f64 * h;
        let step = irk.hessian(&interval.x0, &interval.u, h, &lambda)?;
        orbit.errors.push((start, interval.errors(step)));
        orbit.wings.push(State::from(interval.x0));
        for i in 0..=20 {
            let t = h * f64::from(i) / 20.0;
            let dense = irk.dense(t)?;
            orbit.curve.push((start + t, State::from(dense.x), dense.z[0]));
        }
    }

    let times = [
        median(&intervals, |i| irk.solve(&i.x0, &i.u, h).map(drop))?,
        median(&intervals, |i| irk.forward(&i.x0, &i.u, h).map(drop))?,
        median(&intervals, |i| irk.adjoint(&i.x0, &i.u, h, &lambda).map(drop))?,
        median(&intervals, |i| irk.hessian(&i.x0, &i.u, h, &lambda).map(drop))?,
    ];

    println!(
        "The optimal orbit of an aircraft on a tether: {} intervals of {:.1} ms,",
        intervals.len(),
        1e3 * h
    );
    println!("nx = 23, nz = 1, nu = 4; Radau IIA with 4 stages, one step per interval.\n");
    println!("                             largest error   ms per interval");
    for (i, (name, time)) in QUANTITIES.iter().zip(times).enumerate() {
        let error = orbit.errors.iter().map(|(_, errors)| errors[i]).fold(0.0, f64::max);
        println!("{name:<30} {error:>11.1e}   {:>15.4}", 1e3 * time.as_secs_f64());
    }
    println!("\nErrors are relative to the largest element of the reference. Each time is that of one call");
    println!("from start values of zero: the Jacobian includes the simulation, the Hessian everything.");

    orbit.orbit_figure().save(picture)?;
    println!("The orbit is drawn in {}", picture.display());
    Ok(())
}

/// What is compared and timed, in this order everywhere.
const QUANTITIES: [&str; 4] = [
    "simulation  x(h)",
    "Jacobian    dx(h)/d(x0, u)",
    "adjoint     λ' dx(h)/d(x0, u)",
    "Hessian     of λ' x(h)",
];

impl Interval {
    fn read(record: &Record) -> Result<Self, String> {
        Ok(Self {
            x0: record.vector("x0")?,
            u: record.vector("u")?,
            x: record.vector("x_next")?,
            forward: record.matrix("forward")?,
            adjoint: record.vector("adjoint")?,
            hessian: record.symmetric("hessian")?,
        })
    }

    fn errors(&self, step: &Hessian<Awe>) -> [f64; 4] {
        let mut forward = SMatrix::<f64, 23, 27>::zeros();
        forward.fixed_view_mut::<23, 23>(0, 0).copy_from(&step.dx_dx0);
        forward.fixed_view_mut::<23, 4>(0, 23).copy_from(&step.dx_du);
        let mut adjoint = SVector::<f64, 27>::zeros();
        adjoint.fixed_rows_mut::<23>(0).copy_from(&step.grad_x0);
        adjoint.fixed_rows_mut::<4>(23).copy_from(&step.grad_u);
        let mut hessian = SMatrix::<f64, 27, 27>::zeros();
        hessian.fixed_view_mut::<23, 23>(0, 0).copy_from(&step.h_xx);
        hessian.fixed_view_mut::<23, 4>(0, 23).copy_from(&step.h_xu);
        hessian.fixed_view_mut::<4, 23>(23, 0).copy_from(&step.h_xu.transpose());
        hessian.fixed_view_mut::<4, 4>(23, 23).copy_from(&step.h_uu);
        [
            error(&step.x, &self.x),
            error(&forward, &self.forward),
            error(&adjoint, &self.adjoint),
            error(&hessian, &self.hessian),
        ]
    }
}

/// The largest error relative to the largest element of the reference.
fn error<const R: usize, const C: usize>(a: &SMatrix<f64, R, C>, reference: &SMatrix<f64, R, C>) -> f64 {
    (a - reference).amax() / reference.amax()
}

/// Time of a call: the mean of a pass over all intervals, and of many passes the median.
fn median<E>(
    intervals: &[Interval],
    mut call: impl FnMut(&Interval) -> Result<(), E>,
) -> Result<Duration, E> {
    let mut times = Vec::new();
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_millis(500) {
        let start = Instant::now();
        for interval in intervals {
            call(std::hint::black_box(interval))?;
        }
        times.push(start.elapsed() / intervals.len() as u32);
    }
    times.sort_unstable();
    Ok(times[times.len() / 2])
}
