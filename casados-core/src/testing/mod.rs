//! Checks of models and integrators, for `cargo test` in a user's crate.
//!
//! - [`check_derivatives`]: Jacobian, adjoint and Hessian of a model against `num-dual`, the
//!   complex step and differences ([`check_by_differences`] for dual models); [`check_pattern`]:
//!   declared zeros and constants.
//! - [`check_sensitivities`]: forward, adjoint and second-order sensitivities of an integrator
//!   against each other and against differences of its solution; [`check_exact`]: against a closed
//!   form.
//! - [`convergence`]: the order of convergence of an integrator, against an exact solution.
//! - [`Bounded`] and [`Forward`]: scalars with a bound of their rounding error, or with a
//!   derivative, for any code that is generic over [`Scalar`](crate::Scalar).
//!
//! Every check returns a report that is displayed as a table; its `assert` panics with it.
//! Tolerances are not parameters: they are bounds of the rounding errors at each point, or
//! estimates of truncation errors.

mod bounded;
mod convergence;
mod declared_structure;
mod derivatives;
mod differences;
mod evaluate;
mod exact;
mod forward;
mod integrator;
mod names;
mod points;
mod report;
mod rounding_noise;
mod sensitivities;

#[doc(hidden)]
pub use crate::scalar::lanes::{Level, limit_cache, limit_level};
pub use bounded::Bounded;
pub use convergence::{Convergence, convergence};
pub use derivatives::{check_by_differences, check_derivatives, check_pattern};
pub use exact::{Exact, check_exact};
pub use forward::Forward;
pub use points::{Points, Random};
pub use report::{Deviation, Report, Row};
pub use sensitivities::check_sensitivities;
