//! What the Hessian of the QP is.

use crate::ocp::assembly::convexify::Convexification;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::dynamics::{Dynamics, Nodes, SecondOrder, Sink};
use crate::scalar::Real;

/// What the Hessian of the QP is: [`Exact`], [`GaussNewton`], [`Secant`].
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
    /// Whether Jacobians may stay those that the QP has.
    #[doc(hidden)]
    const KEEPS: bool = false;
    /// How a stage is made convex.
    fn convexification(&self) -> Convexification;
    /// How it learns from differences of gradients, if it does.
    #[doc(hidden)]
    fn update(&self) -> Option<Update> {
        None
    }
    /// Linearises the dynamics.
    ///
    /// # Errors
    /// [`OcpError::Integration`]
    #[doc(hidden)]
    fn run(self, dynamics: &mut D, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError>;
    /// Says how long the next step is, as a part of the one before; whether Jacobians are kept.
    #[doc(hidden)]
    fn follow(&mut self, _ratio: f64) -> bool {
        false
    }
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
    /// What is done where a general cost is not convex.
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
pub(in crate::ocp) struct Slopes;

impl<D: Dynamics<T>, T: Real> Curvature<D, T> for Slopes {
    const EXACT: bool = false;
    fn convexification(&self) -> Convexification {
        Convexification::None
    }
    fn run(self, dynamics: &mut D, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        dynamics.linearise(nodes, sink)
    }
}

/// How a Hessian learns from a step `s` and the difference `y` of gradients.
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # #[function]
/// # fn effort(_x: [f64; 2], u: f64) -> f64 { u }
/// # let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
/// #     .running_cost(LeastSquaresCost::<Effort>::diagonal(&[1.0]))
/// #     .on(Horizon::uniform(10, 0.1))?;
/// # ocp.fix_initial_state(&[0.0, 0.0])?.bound("x[0]", 10.., 1.0, 1.0)?;
/// # ocp.guess(&[0.0, 0.0], &[0.0])?;
/// let mut sqp = HeapSqp::new(&ocp)?.secant(Update::RankOne)?;
/// assert!(sqp.solve(&mut ocp)?.is_converged());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Update {
    /// `B ← B − B s sᵀB / sᵀB s + r rᵀ / sᵀr`, where `r` is a mean of `y` and `B s` with `sᵀr ≥ 0.2
    /// sᵀB s`: positive definite whatever `y` is.
    #[default]
    DampedBfgs,
    /// `B ← B + r rᵀ / sᵀr` with `r = y − B s`: as indefinite as the Hessian itself is. QPs that
    /// are not convex are regularised, as those of [`Exact`].
    RankOne,
}

/// The Hessian of the Lagrangian, learned from its gradients
/// ([`Sqp::secant`](crate::ocp::Sqp::secant)).
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # #[function]
/// # fn effort(_x: [f64; 2], u: f64) -> f64 { u }
/// # let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
/// #     .running_cost(LeastSquaresCost::<Effort>::diagonal(&[1.0]))
/// #     .on(Horizon::uniform(10, 0.1))?;
/// # ocp.fix_initial_state(&[0.0, 0.0])?.bound("x[0]", 10.., 1.0, 1.0)?;
/// # ocp.guess(&[0.0, 0.0], &[0.0])?;
/// let mut sqp = HeapSqp::new(&ocp)?.secant(Update::default())?;
/// let _: Secant = sqp.curvature; // instead of `Exact`
/// assert!(sqp.solve(&mut ocp)?.is_converged());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Secant(pub(in crate::ocp) Update);

impl<D: Dynamics<T>, T: Real> Curvature<D, T> for Secant {
    const EXACT: bool = false;
    fn convexification(&self) -> Convexification {
        Convexification::Reduced
    }
    fn update(&self) -> Option<Update> {
        Some(self.0)
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
