//! Derivatives of a solution and of its value with respect to the initial state and to parameters.
//!
//! | | |
//! | --- | --- |
//! | `factors`, `derivatives` | factors of the KKT system: adjoints, derivatives of the value |
//! | `recursion`, `bound_stiffness` | the Riccati recursion, and the stiffness of bounds |
//! | `solve`, `kkt_direction`, `bordered_system` | solves by the factors, coupling of stages |
//! | `active_constraints` | active constraints, and the removal of their compliance |
//! | `parameters`, `references` | derivatives of the optimality conditions with respect to these |
//! | `covariance` | the covariance of an estimate, and unidentifiable directions |
//! | `unknowns`, `gram` | the unknowns of an estimate, and its reduced Hessian |

pub(in crate::ocp) mod active_constraints;
mod bordered_system;
mod bound_stiffness;
mod covariance;
mod derivatives;
mod factors;
mod gram;
pub(in crate::ocp) mod kkt_direction;
pub(in crate::ocp) mod parameters;
pub(in crate::ocp) mod recursion;
pub(in crate::ocp) mod references;
mod results;
mod solve;
mod unknowns;

use crate::qp::element::get;
pub use covariance::{Covariance, Unidentifiable};
pub use factors::SolutionFactors;
pub use results::{SolutionAdjoint, ValueHessian};

use crate::ocp::formulation::error::{OcpError, Part};
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::instance::{InitialState, Ocp};
use crate::ocp::formulation::names::Names;
use crate::ocp::formulation::problem::Formulation;
use crate::ocp::formulation::program::curvature::Curvature;
use crate::qp::{StageDims, copy_common, part, part_mut, zeros};
use crate::scalar::Real;
use crate::shape::Shape;
use alloc::vec::Vec;

/// Derivatives of a solution: `dx_k/dx₀`, `du_k/dx₀`, `dx_k/dp` and `du_k/dp`, and the gains of the
/// feedback `u_k + K_k (x − x_k)`.
///
/// For derivatives with respect to `p` the parameters of all stages change together. For few
/// functions of the solution, adjoints by [`SolutionFactors`] are cheaper.
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(20, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
/// let mut sensitivities = Sensitivities::new(&ocp)?;
/// ocp.differentiate(Exact::default(), &mut sensitivities)?;
/// // The linear-quadratic regulator: u = -0.618 x, x₊ = 0.382 x.
/// assert!((sensitivities.gain(0)[0] + 0.618).abs() < 1e-3);
/// assert!((sensitivities.du(0)[0] + 0.618).abs() < 1e-3);
/// assert!((sensitivities.dx(1)[0] - 0.382).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Sensitivities<T> {
    factors: SolutionFactors<T>,
    /// `dx/dx₀` and `du/dx₀`: matrices by columns, for all stages.
    x: Vec<T>,
    u: Vec<T>,
    /// `dx/dp` and `du/dp`.
    x_p: Vec<T>,
    u_p: Vec<T>,
    /// `dw/dx₀` and `dw/dp` of the free parameters.
    w: Vec<T>,
    w_p: Vec<T>,
}

impl<T: Real> Sensitivities<T> {
    /// Allocates memory for a problem.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn new<P: Formulation<T>>(
        ocp: &crate::ocp::formulation::instance::HeapOcp<P, T>,
    ) -> Result<Self, OcpError> {
        let factors = SolutionFactors::new(ocp)?;
        let ([nx, nu, np], n, free) = (factors.dims, factors.intervals, factors.free);
        let nu = nu - free;
        Ok(Self {
            factors,
            x: zeros((n + 1) * nx * nx)?,
            u: zeros(n * nu * nx)?,
            x_p: zeros((n + 1) * nx * np)?,
            u_p: zeros(n * nu * np)?,
            w: zeros(free * nx)?,
            w_p: zeros(free * np)?,
        })
    }

    /// The factors, for adjoints and the value of the same solution, and for smoothing.
    pub fn factors(&mut self) -> &mut SolutionFactors<T> {
        &mut self.factors
    }

    /// `K_k`, `NU × NX`, by columns; empty for other stages.
    #[must_use]
    pub fn gain(&self, stage: usize) -> &[T] {
        self.factors.gain(stage)
    }
    /// `dx_k/dx₀`, `NX × NX`, by columns; zero if the initial state is free.
    #[must_use]
    pub fn dx(&self, stage: usize) -> &[T] {
        let [nx, _, _] = self.factors.dims;
        stage_matrix(&self.x, stage, nx * nx)
    }
    /// `du_k/dx₀`, `NU × NX`, by columns; zero if the initial state is free.
    #[must_use]
    pub fn du(&self, stage: usize) -> &[T] {
        let [nx, nu, _] = self.factors.dims;
        stage_matrix(&self.u, stage, (nu - self.factors.free) * nx)
    }
    /// `dx_k/dp`, `NX × NP`, by columns.
    #[must_use]
    pub fn dx_dp(&self, stage: usize) -> &[T] {
        let [nx, _, np] = self.factors.dims;
        stage_matrix(&self.x_p, stage, nx * np)
    }
    /// `du_k/dp`, `NU × NP`, by columns.
    #[must_use]
    pub fn du_dp(&self, stage: usize) -> &[T] {
        let [_, nu, np] = self.factors.dims;
        stage_matrix(&self.u_p, stage, (nu - self.factors.free) * np)
    }
    /// `dw/dx₀` of the [free parameters](crate::ocp::HeapOcp::free), in the order of the calls of
    /// `free`, after the elements of the first state that boundary conditions depend on; by
    /// columns.
    #[must_use]
    pub fn dw(&self) -> &[T] {
        &self.w
    }
    /// `dw/dp` of the free parameters, by columns; zero by free parameters.
    #[must_use]
    pub fn dw_dp(&self) -> &[T] {
        &self.w_p
    }

    fn differentiate_by_initial_state(&mut self) {
        let Self { factors, x, u, w, .. } = self;
        let ([nx, nu, _], n, free) = (factors.dims, factors.intervals, factors.free);
        let nu = nu - free;
        let mut direction = core::mem::take(&mut factors.direction);
        x.fill(T::ZERO);
        u.fill(T::ZERO);
        for i in 0..factors.given_initial_states() {
            solve::solve_initial_state(factors, i, &mut direction);
            copy_common(part_mut(w, i * free, free), direction.control(0));
            for k in 0..=n {
                copy_common(part_mut(x, (k * nx + i) * nx, nx), direction.state(k));
                copy_common(part_mut(u, (k * nx + i) * nu, nu), part(direction.control(k), free, nu));
            }
        }
        factors.direction = direction;
    }

    /// A derivative that is not finite: its stage, its row in `(x, u)`, its column in `(x₀, p)`,
    /// and its value.
    fn find_non_finite(&self) -> Option<(usize, usize, usize, f64)> {
        let ([nx, nu, np], free) = (self.factors.dims, self.factors.free);
        let nu = nu - free;
        let by_initial_state = [(&self.x, [0, nx], [0, nx]), (&self.u, [nx, nu], [0, nx])];
        let by_parameters = [(&self.x_p, [0, nx], [nx, np]), (&self.u_p, [nx, nu], [nx, np])];
        by_initial_state.into_iter().chain(by_parameters).find_map(
            |(list, [row, rows], [column, columns])| {
                let index = list.iter().position(|value| !value.is_finite())?;
                let (i, j) = (index % rows, index / rows % columns);
                Some((index / (rows * columns), row + i, column + j, list.get(index)?.to_f64()))
            },
        )
    }

    fn differentiate_by_parameters(&mut self) {
        let Self { factors, x_p, u_p, w_p, .. } = self;
        let ([nx, nu, np], n, free) = (factors.dims, factors.intervals, factors.free);
        let nu = nu - free;
        let mut direction = core::mem::take(&mut factors.direction);
        for p in 0..np {
            solve::solve_parameter(factors, p, &mut direction);
            copy_common(part_mut(w_p, p * free, free), direction.control(0));
            for k in 0..=n {
                copy_common(part_mut(x_p, (k * np + p) * nx, nx), direction.state(k));
                copy_common(part_mut(u_p, (k * np + p) * nu, nu), part(direction.control(k), free, nu));
            }
        }
        factors.direction = direction;
    }
}

/// The matrix of a stage; empty for other stages.
fn stage_matrix<T>(matrices: &[T], stage: usize, length: usize) -> &[T] {
    let begin = stage.checked_mul(length);
    let end = begin.and_then(|begin| begin.checked_add(length));
    begin.zip(end).and_then(|(begin, end)| matrices.get(begin..end)).unwrap_or_default()
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Computes the derivatives of the solution with respect to the initial state and to
    /// parameters, for a constant active set: [`Ocp::factorise`], and one solve for each state and
    /// parameter.
    ///
    /// With [`Exact`](crate::ocp::Exact) Hessians without convexification the derivatives are
    /// exact. Gauss-Newton Hessians omit second derivatives of dynamics, constraints and least
    /// squares, also with respect to parameters; the derivatives are approximations of the same
    /// quality.
    ///
    /// # Errors
    /// The errors of [`Ocp::factorise`]; [`OcpError::NonFiniteSensitivity`].
    pub fn differentiate<C: Curvature<P::Dynamics, T>>(
        &mut self,
        curvature: C,
        result: &mut Sensitivities<T>,
    ) -> Result<(), OcpError> {
        self.factorise(curvature, &mut result.factors)?;
        result.differentiate_by_initial_state();
        result.differentiate_by_parameters();
        match result.find_non_finite() {
            Some((stage, of, by, value)) => {
                let Names { x, u, p, .. } = <P::Dynamics as Dynamics<T>>::NAMES;
                let name = |names: &[&'static str], i: usize| names.get(i).copied().unwrap_or("");
                let nx = P::Shape::NX;
                let of = if of < nx { name(x, of) } else { name(u, of - nx) };
                let by = if by < nx { name(x, by) } else { name(p, by - nx) };
                Err(OcpError::NonFiniteSensitivity { stage, of, by, value })
            }
            None => Ok(()),
        }
    }

    /// Computes the gains `K_k` of the last QP at its solution, the iterate. After a feedback of
    /// [`RealTime`](crate::ocp::RealTime) they are those of this feedback, for use until the next
    /// one. The problem is not linearised, and all other results are zero.
    ///
    /// # Errors
    /// [`OcpError::Missing`] if the initial state is not fixed; [`OcpError::Length`] if the memory
    /// is that of another problem; [`OcpError::FreeParameters`], [`OcpError::Coupled`];
    /// [`OcpError::Qp`] if the reduced Hessian
    /// is not positive definite.
    pub fn gains(&self, result: &mut Sensitivities<T>) -> Result<(), OcpError> {
        if self.free.count() > 0 {
            return Err(OcpError::FreeParameters);
        }
        self.check_uncoupled()?;
        if self.initial_state == InitialState::Free {
            return Err(OcpError::Missing { part: Part::InitialState, stage: 0 });
        }
        self.prepare_factors(&mut result.factors)?;
        let compliance = T::from_f64(T::EPSILON).sqrt();
        result.factors.factorise_qp(self.qp.view(), &self.iterate, compliance, &mut |_, _, _| {})?;
        let Sensitivities { x, u, x_p, u_p, .. } = result;
        for derivatives in [x, u, x_p, u_p] {
            derivatives.fill(T::ZERO);
        }
        Ok(())
    }
}
