//! Figures: trajectories with their bounds, convergence, histograms of times, phase portraits,
//! curves in three dimensions, sparsity patterns (feature `plot`).
//!
//! A [`Figure`] consists of [`Panel`]s, and becomes the text of an SVG file without other crates.
//! Lines, dots and groups have titles, which browsers show as tooltips.
//!
//! ```
//! use casados::ocp::{HeapSqp, Horizon, LeastSquaresCost, Problem};
//! use casados::plot::{Figure, Panel};
//! use casados::prelude::*;
//!
//! /// A pendulum that is pushed: angle from below, rate.
//! #[ode]
//! fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] {
//!     [x[1], u - 9.81 * x[0].sin()]
//! }
//! #[function]
//! fn deviation(x: [f64; 2], u: f64) -> [f64; 3] {
//!     [x[0], x[1], u]
//! }
//!
//! let mut ocp = Problem::new(Irk::<Pendulum, Gauss<2>>::new(Options::default())?)
//!     .running_cost(LeastSquaresCost::<Deviation>::diagonal(&[10.0, 0.1, 0.01]))
//!     .on(Horizon::uniform(20, 0.1))?;
//! ocp.fix_initial_state(&[1.0, 0.0])?.bound("u", .., -3.0, 3.0)?.guess(&[0.0; 2], &[0.0])?;
//! let mut sqp = HeapSqp::new(&ocp)?;
//! sqp.solve(&mut ocp)?;
//!
//! // All that can be drawn of a model with two states, in two columns.
//! let solution = ocp.dense_solution(3)?;
//! let (angle, rate) = (solution.state("x[0]")?, solution.state("x[1]")?);
//! let phase = Panel::new("Phase portrait without a push")
//!     .x("angle, rad")
//!     .y("rate, rad/s")
//!     .field(|x| pendulum(x, 0.0))
//!     .line("solution", angle.iter().copied().zip(rate.iter().copied()));
//! let figure = Figure::new()
//!     .with(Panel::trajectories(&solution, "x")?)
//!     .with(Panel::trajectories(&solution, "u")?)
//!     .column(0.8)
//!     .with(phase)
//!     .with(Panel::convergence(sqp.log()));
//! assert!(figure.to_svg().starts_with("<svg"));
//! // figure.save("plots/pendulum.svg")?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod axis;
mod curve;
mod draw;
mod figure;
mod panel;
mod run;
mod space;
mod sparsity;
mod svg;
mod trajectories;

pub use curve::Curve;
pub use figure::{Cell, Figure};
pub use panel::Panel;
pub use space::Space;
pub use sparsity::Sparsity;
pub use svg::Colour;
