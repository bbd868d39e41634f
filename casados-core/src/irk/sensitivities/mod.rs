//! Derivatives of a call, as users see them.

mod adjoint;
mod forward;
mod hessian;
