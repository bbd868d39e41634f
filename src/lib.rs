#![doc = include_str!("../README.md")]
//!
//! ## Integrals along the solution
//!
//! `#[function]` writes a function of a model's variables with its derivatives. An integrator takes
//! its integral along:
//!
//! ```
//! use casados::prelude::*;
//! use nalgebra::{Vector1, matrix, vector};
//!
//! #[ode]
//! fn oscillator(x: [f64; 2], u: f64) -> [f64; 2] {
//!     [x[1], u - x[0]]
//! }
//!
//! /// How far the oscillator is from rest, and the effort.
//! #[function]
//! fn distance(x: [f64; 2], u: f64) -> [f64; 2] {
//!     [x[0], 0.1 * u]
//! }
//!
//! let mut irk = Irk::<Oscillator, Gauss<3>>::new(Options { steps: 4, ..Default::default() })?;
//! let (x0, u) = (vector![1.0, 0.0], Vector1::new(0.5));
//!
//! // ½ ∫ rᵀ W r dt, its gradient, and the matrix of Gauss and Newton over (x₀, u).
//! let mut cost = LeastSquares::<Distance>::new(&matrix![1.0, 0.0; 0.0, 1.0]);
//! irk.with(&mut cost).forward(&x0, &u, 1.0)?;
//! println!("{} {} {}", cost.value, cost.grad_u, cost.h_uu);
//!
//! // ∫ r dt; with multipliers ν the gradient and the exact Hessian of λᵀx + νᵀ∫ r dt.
//! let mut integral = Quadrature::<Distance>::new();
//! integral.nu = vector![1.0, 2.0];
//! let step = irk.with(&mut integral).hessian(&x0, &u, 1.0, &vector![0.0, 1.0])?;
//! println!("{} {} {}", integral.q, integral.dq_dx0, step.h_uu);
//!
//! // x₀ = 1 + (u − 1)(1 − cos t): the integral over [0, 1] is 1 − (1 − sin 1)/2.
//! assert!((integral.q[0] - (1.0 - 0.5 * (1.0 - 1.0_f64.sin()))).abs() < 1e-6);
//! # Ok::<(), casados::Error>(())
//! ```
//!
//! ## Steps of variable size, events, and controls that change
//!
//! ```
//! use casados::prelude::*;
//! use nalgebra::{Vector1, vector};
//!
//! /// A ball: height and velocity; gravity and what is left of the speed after a bounce.
//! #[ode]
//! fn ball(x: [f64; 2], p: [f64; 2]) -> [f64; 2] {
//!     [x[1], -p[0]]
//! }
//! #[function]
//! fn height(x: [f64; 2], _p: [f64; 2]) -> f64 {
//!     x[0]
//! }
//! #[function]
//! fn bounce(x: [f64; 2], p: [f64; 2]) -> [f64; 2] {
//!     [x[0], -p[1] * x[1]]
//! }
//!
//! let radau = Adaptive::<Ball, Radau>::new(AdaptiveOptions::default())?;
//! let mut hybrid = Hybrid::new(radau, &[Event::jump::<Height, Bounce>(Crossing::Falling)])?;
//! hybrid.integrator().set_parameters(&vector![9.81, 0.8])?;
//! let end = hybrid.forward(&vector![1.0, 0.0], &vector![], 1.0)?;
//! // The first bounce is at √(2h/g), and half of that relative change for one of h.
//! let t = end.solution.occurrences[0].t;
//! assert!((t - (2.0_f64 / 9.81).sqrt()).abs() < 1e-9);
//! assert!((end.times[0].x0[0] - 0.5 * t).abs() < 1e-8);
//! // Second derivatives of the height, which is 1.8 √(2gh) − 2.6 h − g/2. `freeze` would keep steps and bounces.
//! let second = hybrid.hessian(&vector![1.0, 0.0], &vector![], 1.0, &vector![1.0, 0.0])?;
//! assert!((second.h_xx[(0, 0)] + 0.45 * (2.0_f64 * 9.81).sqrt()).abs() < 1e-8);
//!
//! /// Decay with a source that is switched.
//! #[ode]
//! fn decay(x: f64, u: f64) -> f64 {
//!     u - x
//! }
//! let mut horizon = Piecewise::new(Adaptive::<Decay, Gauss<3>>::new(AdaptiveOptions::default())?);
//! let controls = [Vector1::new(1.0), Vector1::new(0.0)];
//! let end = horizon.forward(&Vector1::new(0.0), &controls, &[1.0, 3.0])?;
//! let expected = (1.0 - (-1.0_f64).exp()) * (-2.0_f64).exp();
//! assert!((end.nominal.x[0] - expected).abs() < 1e-5);
//! assert!((end.dx_du[0][0] - expected).abs() < 1e-5);
//!
//! /// What it costs: half of ∫ x² + u² dt.
//! #[function]
//! fn effort(x: f64, u: f64) -> f64 {
//!     0.5 * (x * x + u * u)
//! }
//! // Derivatives take part in the choice of the steps.
//! horizon.integrator().control_sensitivities(true)?;
//! let mut cost = Quadrature::<Effort>::new();
//! cost.nu[0] = 1.0;
//! let zero = Vector1::new(0.0);
//! let (end, slopes) = horizon.with(&mut cost).hessian(&zero, &controls, &[1.0, 3.0], &zero)?;
//! // By the last control: ∫ x x_u dt with x = x₁ e⁻ᵗ and x_u = 1 − e⁻ᵗ, and ∫ x_u² + 1 dt.
//! let decayed = |t: f64| 1.0 - (-t).exp();
//! let expected = decayed(1.0) * (decayed(2.0) - 0.5 * decayed(4.0));
//! assert!((slopes.dq_du[1][0] - expected).abs() < 1e-5);
//! assert!((end.h_uu[3][0] - (4.0 - 2.0 * decayed(2.0) + 0.5 * decayed(4.0))).abs() < 1e-5);
//! # Ok::<(), casados::Error>(())
//! ```
//!
//! ## Second derivatives of algebraic states
//!
//! The Hessian of `λᵀx + νᵀz₀` has those of the algebraic states at the start of an interval, too,
//! on which costs and constraints may depend; problems of optimal control ask for it by themselves.
//!
//! ```
//! use casados::prelude::*;
//! use nalgebra::{Vector1, vector};
//!
//! /// A state that stays as it is, and its third power.
//! #[dae]
//! fn cube(xdot: [f64; 1], x: [f64; 1], z: f64) -> [f64; 2] {
//!     [xdot[0], z - x[0].powi(3)]
//! }
//!
//! let mut irk = Irk::<Cube, Gauss<2>>::new(Options::default())?;
//! let (x0, lambda, nu) = (vector![1.5], vector![0.0], Vector1::new(0.5));
//! let step = irk.hessian_with_z0(&x0, &vector![], 0.1, &lambda, &nu)?;
//!
//! // Of ½ x₀³.
//! assert!((step.grad_x0[0] - 1.5 * 1.5_f64.powi(2)).abs() < 1e-14);
//! assert!((step.h_xx[0] - 3.0 * 1.5).abs() < 1e-14);
//! # Ok::<(), casados::Error>(())
//! ```
//!
//! ## Optimal control
//!
//! ```
//! use casados::ocp::{HeapSqp, Horizon, LeastSquaresCost, Problem, Shooting};
//! use casados::prelude::*;
//!
//! /// A pendulum that is pushed: angle from below, rate.
//! #[ode]
//! fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] {
//!     [x[1], u - 9.81 * x[0].sin()]
//! }
//! /// What is to be small.
//! #[function]
//! fn deviation(x: [f64; 2], u: f64) -> [f64; 3] {
//!     [x[0], x[1], u]
//! }
//! #[function]
//! fn end(x: [f64; 2], _u: f64) -> [f64; 2] {
//!     x
//! }
//!
//! let batch = Batch::<Pendulum, Gauss<2>>::new(Options::default())?;
//! let mut ocp = Problem::new(Shooting::new(batch))
//!     .running_cost(LeastSquaresCost::<Deviation>::diagonal(&[10.0, 0.1, 0.01]))
//!     .terminal_cost(LeastSquaresCost::<End>::diagonal(&[10.0, 1.0]))
//!     .on(Horizon::uniform(20, 0.1))?;
//! ocp.fix_initial_state(&[1.0, 0.0])?.bound("u", .., -3.0, 3.0)?;
//! ocp.bound("x[1]", 1.., -1.5, 1.5)?.soften("x[1]", 1.., 100.0, 0.0)?;
//! ocp.guess(&[0.0; 2], &[0.0])?;
//!
//! let mut sqp = HeapSqp::new(&ocp)?;
//! let outcome = sqp.solve(&mut ocp)?;
//! println!("{}{outcome}", sqp.log());
//! assert!(outcome.is_converged());
//! assert!(ocp.stage(20)?.x[0].abs() < 0.1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! ## Testing a model of your own
//!
//! With the feature `testing`, among the `dev-dependencies`:
//!
//! ```
//! use casados::prelude::*;
//! use casados::testing::{Points, check_derivatives, check_sensitivities};
//! use nalgebra::{vector, Vector1};
//!
//! /// An oscillator whose spring force is an algebraic state.
//! #[dae]
//! fn oscillator(xdot: [f64; 2], x: [f64; 2], z: f64, p: f64) -> [f64; 3] {
//!     [xdot[0] - x[1], xdot[1] + z, z - p * x[0].sinh()]
//! }
//!
//! // Jacobian, adjoint and Hessian against num-dual, the complex step and differences, at 10 random points.
//! let points = Points::random(10).x(0, 0.5..=2.0);
//! check_derivatives::<Oscillator>(&points).assert();
//!
//! // Forward, adjoint and second-order sensitivities of a step, against each other and against differences.
//! let mut irk = Irk::<Oscillator, RadauIIA<3>>::new(Options { steps: 2, ..Default::default() })?;
//! let (x0, u, p) = (vector![1.0, 0.0], vector![], Vector1::new(2.0));
//! let report = check_sensitivities(&mut irk, &x0, &u, &p, 0.1)?;
//! println!("{report}");
//! report.assert();
//! # Ok::<(), casados::Error>(())
//! ```
#![no_std]
#![forbid(unsafe_code)]

pub use casados_core::*;
pub use casados_macros::{dae, function, ode};

/// What most programs need: `use casados::prelude::*;`
pub mod prelude {
    pub use casados_core::prelude::*;
    pub use casados_macros::{dae, function, ode};
}

/// The examples of the documentation are run.
#[cfg(doctest)]
#[doc = include_str!("../docs/language.md")]
mod language {}
#[cfg(doctest)]
#[doc = include_str!("../docs/mechanics.md")]
mod mechanics {}
#[cfg(doctest)]
#[doc = include_str!("../docs/embedded.md")]
mod embedded {}
