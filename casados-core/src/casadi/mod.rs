//! Integrators as external functions of CasADi, in a shared library (feature `casadi`).
//!
//! CasADi finds functions of a shared library by their names:
//! `casadi.external("pendulum", "./libmodel.so")` is an ordinary `casadi.Function` with exact first
//! and second derivatives. [`export!`] defines them, in a crate of the type `cdylib`:
//!
//! ```text
//! casados::casadi::export! {
//!     pendulum = Irk<Pendulum, Gauss<2>>, interval = 0.2, options = Options { steps: 4, ..Default::default() }
//! }
//! ```
//!
//! | function | inputs | outputs |
//! | --- | --- | --- |
//! | `F` | `x0`, `u`, `p` | `xf`; `zf` with `algebraic = true`; `qf` with `quadrature = F` |
//! | `jac_F` | and `out_xf` | `∂xf/∂x0`, `∂xf/∂u`, … |
//! | `adj1_F` | and `adj_xf`, which is `λ` | `∇(λᵀxf)` |
//! | `jac_adj1_F` | and `out_adj_x0`, … | `∇²(λᵀxf)`, and its derivative with respect to `λ`, the transposed Jacobian |
//!
//! Sparsity patterns are those of the model's graph, propagated over stages and steps. Results for
//! the last inputs are cached ([`Settings::cache`]): the stages are solved once, for requests in
//! any order. Only requested outputs are computed. A failed call returns CasADi's status; with the
//! environment variable `CASADOS_CASADI_ERRORS` it writes the cause to standard error. Threads
//! (`F.map(N, "thread")`) have memory of their own.
//!
//! `zf` are the algebraic states consistent with `xf`, for implicit methods.
//!
//! An adaptive integrator takes the steps chosen at [`Settings::steps_at`] in all calls: a smooth
//! function of its inputs.
//!
//! [`export_horizon!`] exports the same functions for all intervals of a horizon in one call, one
//! column for each; [`export_problem!`] exports a problem of [`ocp`](crate::ocp) for
//! `casadi.nlpsol`.
//!
//! The interface is described in CasADi's `casadi/core/external.cpp` and `external_impl.hpp`.

mod algebraic;
mod blocks;
mod cache;
mod dependence;
mod entries;
mod export;
#[doc(hidden)]
pub mod ffi;
mod function;
mod groups;
mod horizon;
mod integral;
mod integrators;
mod interval;
mod layout;
mod library;
mod nlp;
mod pattern;
mod problem;
mod program;
mod second;
mod signature;
mod sparsity;
#[cfg(test)]
mod tests;

#[doc(inline)]
pub use crate::{
    __casadi_export as export, __casadi_export_horizon as export_horizon,
    __casadi_export_problem as export_problem,
};
pub use program::Program;
// Items used by the macros.
#[doc(hidden)]
pub use self::{
    horizon::{Horizon, Horizons},
    integral::{Integral, Nothing, Of},
    integrators::{Integrators, Settings},
    interval::Interval,
    library::Library,
    problem::Problems,
};
