//! Factors of the optimality conditions at a solution, for any number of derivatives.

use super::active_constraints::ActiveConstraints;
use super::bordered_system::BorderedSystem;
use super::kkt_direction::KktDirection;
use super::parameters::KktParameterDerivatives;
use super::stage_matrix;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::HeapOcp;
use crate::ocp::formulation::problem::Formulation;
use crate::qp::{copy_common, part, zeros};
use crate::scalar::Real;
use crate::shape::Shape;
use alloc::vec::Vec;

/// Factors of the optimality conditions at a solution: adjoint derivatives of the solution, and
/// derivatives of the optimal value, with respect to the initial state and to parameters.
///
/// ```text
/// adjoint(λ)              λᵀ dw/dx₀,  λᵀ dw/dp            w = (x₀, u₀, …, x_N) of the solution
/// value_gradient_x0, _p   ∂V/∂x₀,  ∂V/∂p                   V(x₀, p) = min f
/// value_hessian           ∂²V/∂x₀²,  ∂²V/∂x₀∂p,  ∂²V/∂p²
/// ```
///
/// `p` are the parameters of all stages, which change together.
/// [`Ocp::factorise`](crate::ocp::Ocp::factorise) computes the factors by one linearisation and one
/// Riccati recursion, `O(N (NX + NU)³)`. An adjoint costs `O(N (NX + NU) (NX + NU + NP))`, for any
/// number of parameters; the Hessian of the value costs one such solve for each parameter. The
/// gradient of the value is that of the Lagrangian (envelope theorem), at no further cost.
///
/// A free initial state, periodic states, shared controls, free parameters and end times are
/// unknowns of a bordered system. There are no derivatives with respect to a free initial state,
/// and those with respect to a free parameter are zero: its value is a result. In seeds of adjoints
/// free parameters precede the controls of a stage.
///
/// Derivatives are those for a constant active set. At a weakly active bound solutions have two
/// one-sided derivatives; the bound counts as active if its multiplier is larger than its slack.
/// [`weakly_active`] is the number of such bounds. [`smoothing`] makes derivatives continuous
/// there.
///
/// [`weakly_active`]: SolutionFactors::weakly_active
/// [`smoothing`]: SolutionFactors::smoothing
///
/// # Example
/// Derivatives of the optimal cost with respect to the target of a mass, a parameter:
/// ```
/// use casados::ocp::{Exact, HeapSqp, Horizon, LeastSquaresCost, Map, Problem, SolutionFactors};
/// use casados::prelude::*;
/// use casados::qp::HeapSolution;
///
/// #[function]
/// fn push(x: [f64; 1], u: [f64; 1], _p: [f64; 1]) -> f64 { x[0] + u[0] }
/// #[function]
/// fn away(x: [f64; 1], u: [f64; 1], p: [f64; 1]) -> [f64; 2] { [x[0] - p[0], u[0]] }
///
/// let mut ocp = Problem::new(Map::<Push, f64>::new())
///     .stage_cost(LeastSquaresCost::<Away>::diagonal(&[1.0, 1.0]))
///     .on(Horizon::uniform(2, 1.0))?;
/// ocp.fix_initial_state(&[0.0])?.set_parameters(.., &[1.0])?.guess(&[0.0], &[0.0])?;
/// assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
///
/// let mut factors = SolutionFactors::new(&ocp)?;
/// ocp.factorise(Exact::default(), &mut factors)?;
/// // V(x₀, p) = ½ (x₀ − p)² + ¼ (x₀ − p)², with u₀ = (p − x₀) / 2.
/// assert!((factors.value_gradient_x0()[0] + 1.5).abs() < 1e-9);
/// assert!((factors.value_hessian().pp[0] - 1.5).abs() < 1e-6);
/// let mut seed = HeapSolution::new(ocp.qp().dims())?;
/// seed.stage_mut(0).ok_or("a stage")?.u[0] = 1.0;
/// let adjoint = factors.adjoint(&seed)?;
/// assert!((adjoint.x0[0] + 0.5).abs() < 1e-6 && (adjoint.p[0] - 0.5).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct SolutionFactors<T> {
    /// The barrier parameter `μ` of the iterate, which must be a solution of
    /// [`Ipm`](crate::ocp::Ipm) with this
    /// [`IpmOptions::final_mu`](crate::ocp::IpmOptions::final_mu): derivatives are those of the
    /// barrier problem, which are continuous; bounds have the stiffness `μ/s²`. Zero, the default:
    /// derivatives of solutions of the problem itself, with active sets.
    pub smoothing: T,
    /// `NX`, free parameters and `NU`, `NP`
    pub(super) dims: [usize; 3],
    /// The number of free parameters, in front of the controls.
    pub(super) free: usize,
    pub(super) intervals: usize,
    /// `K` and the factors of `M_uu` of every interval.
    pub(super) gains: Vec<T>,
    pub(super) control_factors: Vec<T>,
    /// The rows of `K` without free parameters, if there are some.
    feedback: Vec<T>,
    /// `P` of every stage.
    pub(super) costs_to_go: Vec<T>,
    /// The rows of `[A B]` of every interval.
    pub(super) dynamics: Vec<T>,
    /// The number of negative pivots of controls.
    pub(super) negative_pivots: usize,
    pub(super) bordered_system: BorderedSystem<T>,
    pub(super) parameter_derivatives: KktParameterDerivatives<T>,
    pub(in crate::ocp) direction: KktDirection<T>,
    /// `∂V/∂x₀`, and the Hessian of the value.
    pub(super) gradient: Vec<T>,
    pub(super) hessian_x0: Vec<T>,
    pub(super) hessian_x0_p: Vec<T>,
    pub(super) hessian_p: Vec<T>,
    pub(super) adjoint: Vec<T>,
    pub(super) weakly_active: usize,
    pub(super) active: ActiveConstraints<T>,
    pub(super) work: Vec<T>,
}

impl<T: Real> SolutionFactors<T> {
    /// Allocates memory for a problem.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn new<P: Formulation<T>>(ocp: &HeapOcp<P, T>) -> Result<Self, OcpError> {
        let (free, n) = (ocp.free.count(), ocp.intervals());
        let dims = [P::Shape::NX, free + P::Shape::NU, P::Shape::NP];
        let derivatives = KktParameterDerivatives::new::<P>(free, n)?;
        Self::with_dims(dims, free, n, derivatives)
    }

    /// Memory for stages of at most these dimensions.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub(in crate::ocp) fn with_dims(
        dims: [usize; 3],
        free: usize,
        n: usize,
        parameter_derivatives: KktParameterDerivatives<T>,
    ) -> Result<Self, OcpError> {
        let [nx, nu, np] = dims;
        Ok(Self {
            smoothing: T::ZERO,
            dims,
            free,
            intervals: n,
            gains: zeros(n * nu * nx)?,
            control_factors: zeros(n * nu * nu)?,
            costs_to_go: zeros((n + 1) * nx * nx)?,
            dynamics: zeros(n * nx * (nx + nu))?,
            negative_pivots: 0,
            bordered_system: BorderedSystem::default(),
            parameter_derivatives,
            feedback: zeros(if free > 0 { n * (nu - free) * nx } else { 0 })?,
            direction: KktDirection::new(dims, n)?,
            gradient: zeros(nx)?,
            hessian_x0: zeros(nx * nx)?,
            hessian_x0_p: zeros(nx * np)?,
            hessian_p: zeros(np * np)?,
            adjoint: zeros(np)?,
            weakly_active: 0,
            active: ActiveConstraints::default(),
            work: zeros(work_len(nx, nu))?,
        })
    }

    /// `K_k` of the feedback `u_k + K_k (x − x_k)`, `NU × NX`, by columns; empty for other stages.
    /// Gains of controls at active bounds are zero up to `∛ε`.
    #[must_use]
    pub fn gain(&self, stage: usize) -> &[T] {
        let [nx, nu, _] = self.dims;
        let gains = if self.free > 0 { &self.feedback } else { &self.gains };
        stage_matrix(gains, stage, (nu - self.free) * nx)
    }

    /// Writes the rows of `K` without free parameters.
    pub(super) fn write_feedback(&mut self) {
        let [_, nu, _] = self.dims;
        let columns = self.gains.chunks_exact(nu.max(1));
        for (to, from) in self.feedback.chunks_exact_mut((nu - self.free).max(1)).zip(columns) {
            copy_common(to, from.get(self.free..).unwrap_or_default());
        }
    }

    /// The number of bounds whose slack and multiplier are both below `ε^¼` (1e-4 in double
    /// precision), where solutions have two one-sided derivatives. Zero with smoothing.
    #[must_use]
    pub fn weakly_active(&self) -> usize {
        self.weakly_active
    }

    /// `∂V/∂x₀`, `NX`; empty if the initial state is free.
    #[must_use]
    pub fn value_gradient_x0(&self) -> &[T] {
        part(&self.gradient, 0, self.given_initial_states())
    }

    /// `∂V/∂p`, `NP`.
    #[must_use]
    pub fn value_gradient_p(&self) -> &[T] {
        &self.parameter_derivatives.value_gradient
    }

    /// The product of the forces of active constraints with their derivatives by a parameter.
    pub(in crate::ocp) fn product_with_forces(
        &self,
        direction: &KktDirection<T>,
        slope: impl Fn(usize, usize) -> T,
    ) -> T {
        self.active.product(&direction.constraint_multipliers, slope)
    }
    /// States, controls and parameters of a stage.
    pub(in crate::ocp) fn dims(&self) -> [usize; 3] {
        self.dims
    }
    pub(in crate::ocp) fn intervals(&self) -> usize {
        self.intervals
    }
    /// The number of given elements of the first state: all, none, or all but linear controls and
    /// what follows them.
    pub(super) fn given_initial_states(&self) -> usize {
        self.bordered_system.given_initial_states(self.dims[0])
    }
    /// Columns of `P` of a stage.
    pub(super) fn cost_to_go(&self, k: usize) -> impl Iterator<Item = &[T]> {
        let [nx, _, _] = self.dims;
        part(&self.costs_to_go, k * nx * nx, nx * nx).chunks_exact(nx.max(1))
    }
    /// Rows of `[A B]` of an interval.
    pub(super) fn dynamics_rows(&self, k: usize) -> impl Iterator<Item = &[T]> {
        let [nx, nu, _] = self.dims;
        part(&self.dynamics, k * nx * (nx + nu), nx * (nx + nu)).chunks_exact((nx + nu).max(1))
    }
    /// A column of `K` of an interval.
    pub(super) fn gain_column(&self, k: usize, state: usize) -> &[T] {
        let [nx, nu, _] = self.dims;
        part(&self.gains, (k * nx + state) * nu, nu)
    }
}

/// The length of memory for `P [A B]`, `M`, a gradient and a state.
const fn work_len(nx: usize, nu: usize) -> usize {
    let size = nx + nu;
    nx * size + size * size + size + nx
}
