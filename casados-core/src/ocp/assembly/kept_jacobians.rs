//! Jacobians that are kept from iteration to iteration, and corrected by adjoints.
//!
//! ```text
//! QP with kept [A B], and the gradient  ∇f + ([A B]_exact − [A B]_kept)ᵀ π
//! ```

use crate::ocp::assembly::convexify::Convexification;
use crate::ocp::assembly::curvature::{Curvature, GaussNewton};
use crate::ocp::dynamics::adjoints::Adjoints;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::dynamics::{Nodes, Sink};
use crate::scalar::Real;

/// The Hessian of Gauss and Newton, and Jacobians `[A B]` that stay while steps contract: inexact
/// sequential quadratic programming, made by
/// [`Sqp::keep_jacobians`](crate::ocp::Sqp::keep_jacobians).
///
/// One adjoint of an interval costs about as much as one direction of its Jacobian. Residuals of
/// the conditions of optimality are exact, whatever Jacobians are kept, and so are solutions;
/// convergence is linear, at a rate that the distance from the kept point says. Where a step is
/// longer than [`contraction`](Self::contraction) of the one before, or is shortened, all Jacobians
/// are computed again.
///
/// H. G. Bock, M. Diehl, E. Kostina, J. P. Schlöder, "Constrained optimal feedback control of
/// systems governed by large differential algebraic equations", 2007; L. Wirsching, H. G. Bock,
/// M. Diehl, "Fast NMPC of a chain of masses connected by springs", 2006.
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
/// let mut sqp = HeapSqp::new(&ocp)?.keep_jacobians();
/// sqp.curvature.contraction = 0.3;
/// assert!(sqp.solve(&mut ocp)?.is_converged());
/// println!("{} times all Jacobians", sqp.curvature.jacobians());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeptJacobians {
    /// A step is to be shorter than this part of the one before, or Jacobians are computed again.
    /// Zero: in every iteration. Default 0.5.
    pub contraction: f64,
    /// The costs.
    hessian: GaussNewton,
    /// Whether the next linearisation keeps what there is.
    keeps: bool,
    jacobians: usize,
    adjoints: usize,
}

impl KeptJacobians {
    pub(in crate::ocp) fn new() -> Self {
        let hessian = GaussNewton::default();
        Self { contraction: 0.5, hessian, keeps: false, jacobians: 0, adjoints: 0 }
    }

    /// How often it was decided to compute all Jacobians, since the solver was made.
    #[must_use]
    pub fn jacobians(&self) -> usize {
        self.jacobians
    }

    /// How often it was decided to compute adjoints alone.
    #[must_use]
    pub fn adjoints(&self) -> usize {
        self.adjoints
    }
}

impl<D: Adjoints<T>, T: Real> Curvature<D, T> for KeptJacobians {
    const EXACT: bool = false;
    const KEEPS: bool = true;
    fn convexification(&self) -> Convexification {
        Curvature::<D, T>::convexification(&self.hessian)
    }
    fn run(self, dynamics: &mut D, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        if self.keeps { dynamics.adjoints(nodes, sink) } else { dynamics.linearise(nodes, sink) }
    }
    fn follow(&mut self, ratio: f64) -> bool {
        self.keeps = ratio < self.contraction;
        if self.keeps {
            self.adjoints += 1;
        } else {
            self.jacobians += 1;
        }
        self.keeps
    }
}
