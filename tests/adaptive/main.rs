//! Integrators that choose their steps, and what runs along every integrator: integrals, events,
//! piecewise constant controls.

mod consistent;
mod convergence;
mod events;
mod gauss;
mod piecewise;
mod quadrature;
