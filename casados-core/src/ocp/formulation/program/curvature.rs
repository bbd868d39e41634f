//! What the Hessian of the QP is.

use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::dynamics::{Dynamics, Nodes, SecondOrder, Sink};
use crate::scalar::Real;

/// What is done with the Hessian of a stage that is not positive definite.
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
    /// Stages stay as they are. Where a QP is not convex in the directions that its dynamics and
    /// bounds leave, a multiple of the identity is added to all of them, as little as it takes (A.
    /// Wächter, L. T. Biegler, "On the implementation of an interior-point filter line-search
    /// algorithm for large-scale nonlinear programming", Math. Program. 106, 2006, section 3.1).
    /// Near a solution with second-order sufficient conditions nothing is added, and convergence is
    /// quadratic. This is what [`Sqp`](crate::ocp::Sqp) does; a QP without it is that of `None`.
    Reduced,
    /// Nothing. The reduced Hessian may be positive definite where that of a stage is not; the QP
    /// says if it is not.
    None,
    /// Eigenvalues that are too small become a small positive number.
    #[default]
    Project,
    /// Eigenvalues get the sign plus.
    Mirror,
    /// A multiple of the identity is added, as large as it takes (Levenberg and Marquardt).
    LevenbergMarquardt,
}

/// What the Hessian of the QP is: [`Exact`], [`GaussNewton`].
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
    /// Whether second derivatives of everything are in it.
    const EXACT: bool;
    /// How a stage is made convex.
    fn convexification(&self) -> Convexification;
    /// Linearises the dynamics.
    ///
    /// # Errors
    /// [`OcpError::Integration`]
    #[doc(hidden)]
    fn run(self, dynamics: &mut D, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError>;
}

/// Least-squares costs have `JᵀWJ`, general ones their exact Hessian; dynamics and constraints have
/// none.
///
/// ```
/// use casados::ocp::{Convexification, GaussNewton};
///
/// // What `HeapSqp::new(&ocp)?.gauss_newton()` takes.
/// assert_eq!(GaussNewton::default().convexification, Convexification::Project);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GaussNewton {
    /// What is done where a general cost is not convex. Default [`Convexification::Project`].
    pub convexification: Convexification,
}

/// The Hessian of the Lagrangian. Where costs or constraints depend on algebraic states, all
/// intervals are simulated first: what second derivatives of these states are multiplied by depends
/// on them.
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
    /// What is done where it is not convex. Default [`Convexification::Reduced`].
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

/// First derivatives, where the Hessian does not matter yet: it is that of [`GaussNewton`], convex
/// or not.
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
