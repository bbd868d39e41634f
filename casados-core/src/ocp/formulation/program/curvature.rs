//! The Hessian of the QP.

use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::dynamics::{Dynamics, Nodes, SecondOrder, Sink};
use crate::scalar::Real;

/// The convexification of stages whose Hessian is not positive definite.
///
/// ```
/// use casados::ocp::{Convexification, Exact, GaussNewton};
///
/// assert_eq!(Exact::default().convexification, Convexification::Reduced);
/// assert_eq!(GaussNewton::default().convexification, Convexification::Project);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Convexification {
    /// Leaves the stages unchanged. If the reduced Hessian of the QP is not positive definite, the
    /// smallest sufficient multiple of the identity is added to all stages (inertia correction: A.
    /// Wächter, L. T. Biegler, "On the implementation of an interior-point filter line-search
    /// algorithm for large-scale nonlinear programming", Math. Program. 106, 2006, section 3.1).
    /// Near a solution with second-order sufficient conditions nothing is added, and convergence is
    /// quadratic. [`Sqp`](crate::ocp::Sqp) adds the multiple; the QP of a linearisation is that of
    /// `None`.
    Reduced,
    /// Leaves the stages unchanged, without inertia correction. The reduced Hessian may be positive
    /// definite although that of a stage is not; otherwise the QP solver returns an error.
    None,
    /// Replaces eigenvalues that are too small by a small positive number.
    #[default]
    Project,
    /// Replaces eigenvalues by their absolute values.
    Mirror,
    /// Adds the smallest sufficient multiple of the identity (Levenberg-Marquardt).
    LevenbergMarquardt,
}

/// The choice of the Hessian of the QP: [`Exact`], [`GaussNewton`].
///
/// ```
/// use casados::ocp::{Curvature, Exact, GaussNewton, Map};
/// use casados::prelude::*;
///
/// #[function]
/// fn push(x: f64, u: f64) -> f64 { x + u }
///
/// /// Whether second derivatives of the dynamics are in the Hessian.
/// fn is_exact<C: Curvature<Map<Push, f64>, f64>>(_: C) -> bool { C::EXACT }
/// assert!(is_exact(Exact::default()) && !is_exact(GaussNewton::default()));
/// ```
pub trait Curvature<D, T: Real>: Copy {
    /// Whether it has the second derivatives of all functions.
    const EXACT: bool;
    /// Returns the convexification of the stages.
    fn convexification(&self) -> Convexification;
    /// Linearises the dynamics.
    ///
    /// # Errors
    /// [`OcpError::Integration`]
    #[doc(hidden)]
    fn run(self, dynamics: &mut D, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError>;
}

/// The Gauss-Newton Hessian: `JᵀWJ` of least-squares costs and the exact Hessian of general costs;
/// dynamics and constraints contribute nothing.
///
/// ```
/// use casados::ocp::{Convexification, GaussNewton};
///
/// // What `HeapSqp::new(&ocp)?.gauss_newton()` takes.
/// assert_eq!(GaussNewton::default().convexification, Convexification::Project);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GaussNewton {
    /// The convexification of general costs.
    pub convexification: Convexification,
}

/// The Hessian of the Lagrangian. If costs or constraints depend on algebraic states, all intervals
/// are simulated first: the weights of the second derivatives of these states depend on their
/// values.
///
/// ```
/// use casados::ocp::{Convexification, Exact};
///
/// // Stage by stage instead of all together.
/// let exact = Exact { convexification: Convexification::Project };
/// assert_ne!(exact, Exact::default());
/// // `HeapSqp::new(&ocp)?.exact(exact)` takes it.
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exact {
    /// The convexification. Default [`Convexification::Reduced`].
    pub convexification: Convexification,
}

impl Default for Exact {
    fn default() -> Self {
        Self { convexification: Convexification::Reduced }
    }
}

impl<D: Dynamics<T>, T: Real> Curvature<D, T> for GaussNewton {
    const EXACT: bool = false;
    fn convexification(&self) -> Convexification {
        self.convexification
    }
    fn run(self, dynamics: &mut D, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        dynamics.linearise(nodes, sink)
    }
}

/// First derivatives, with the Hessian of [`GaussNewton`] without convexification.
#[derive(Clone, Copy, Debug)]
pub(in crate::ocp) struct FirstOrder;

impl<D: Dynamics<T>, T: Real> Curvature<D, T> for FirstOrder {
    const EXACT: bool = false;
    fn convexification(&self) -> Convexification {
        Convexification::None
    }
    fn run(self, dynamics: &mut D, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        dynamics.linearise(nodes, sink)
    }
}

impl<D: SecondOrder<T>, T: Real> Curvature<D, T> for Exact {
    const EXACT: bool = true;
    fn convexification(&self) -> Convexification {
        self.convexification
    }
    fn run(self, dynamics: &mut D, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        dynamics.second_order(nodes, sink)
    }
}
