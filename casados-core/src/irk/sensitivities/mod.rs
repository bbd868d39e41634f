//! The public interface to derivatives.

mod adjoint;
mod forward;
mod hessian;
