//! The conditions of optimality at a solution, factorised once for any number of derivatives.

use super::active::Springs;
use super::answers::{SolutionAdjoint, ValueHessian};
use super::border::Border;
use super::column::{self, Column};
use super::parameters::Parameters;
use super::{block, recursion};
use crate::ocp::HeapOcp;
use crate::ocp::curvature::Curvature;
use crate::ocp::error::{OcpError, Part};
use crate::ocp::instance::{Initial, Ocp};
use crate::ocp::problem::Formulation;
use crate::qp::element::{get, set};
use crate::qp::{QpView, Solution, StageDims, assign, part, part_mut, zeros};
use crate::scalar::Real;
use crate::shape::Shape;
use alloc::vec::Vec;

/// The conditions of optimality at a solution, factorised: adjoint derivatives of the solution, and
/// derivatives of the optimal value, by the initial state and by parameters.
///
/// ```text
/// adjoint(λ)              λᵀ dw/dx₀,  λᵀ dw/dp            w = (x₀, u₀, …, x_N) of the solution
/// value_gradient_x0, _p   ∂V/∂x₀,  ∂V/∂p                   V(x₀, p) = min f
/// value_hessian           ∂²V/∂x₀²,  ∂²V/∂x₀∂p,  ∂²V/∂p²
/// ```
///
/// `p` are the parameters of all stages, which change together. [`Ocp::factorise`] fills it by one
/// linearisation and one Riccati recursion, `O(N (NX + NU)³)`. An adjoint costs
/// `O(N (NX + NU) (NX + NU + NP))`, however many parameters there are; the Hessian of the value one
/// such solve for each parameter. The gradient of the value is that of the Lagrangian (envelope
/// theorem), and costs nothing more.
///
/// A free initial state, periodic states and shared controls are unknowns beside the recursion.
/// There are no derivatives by a free initial state.
///
/// Where bounds are active the derivatives are those along which the active set stays. At a bound
/// that is active without a force solutions have two derivatives, one for each side. Then the bound
/// counts as active if its multiplier is larger than its slack, and [`weakly_active`] says how many
/// bounds are in question. [`smoothing`] gives derivatives that are continuous there.
///
/// [`weakly_active`]: SolutionFactors::weakly_active
/// [`smoothing`]: SolutionFactors::smoothing
///
/// # Example
/// The distance of a mass is a parameter: what does it change of the cost?
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
    /// The barrier parameter `μ` that the iterate solves, as that of [`Ipm`](crate::ocp::Ipm) with
    /// [`IpmOptions::final_mu`](crate::ocp::IpmOptions::final_mu): bounds are springs `μ/s²`, and
    /// derivatives those of the barrier problem, which are smooth. Zero, the default: solutions of
    /// the problem itself, with active sets.
    pub smoothing: T,
    /// `NX`, `NU`, `NP`
    pub(super) dims: [usize; 3],
    pub(super) intervals: usize,
    /// `K`, and factors of `M_uu`, of every interval.
    pub(super) gains: Vec<T>,
    pub(super) controls: Vec<T>,
    /// `P` of every stage.
    pub(super) costs_to_go: Vec<T>,
    /// The rows of `[A B]` of every interval.
    pub(super) dynamics: Vec<T>,
    /// How many pivots of controls are negative.
    pub(super) negative: usize,
    pub(super) border: Border<T>,
    pub(super) problem: Parameters<T>,
    pub(super) column: Column<T>,
    /// `∂V/∂x₀`, and the Hessian of the value.
    gradient: Vec<T>,
    of_start: Vec<T>,
    cross: Vec<T>,
    square: Vec<T>,
    adjoint: Vec<T>,
    weak: usize,
    pub(super) work: Vec<T>,
}

impl<T: Real> SolutionFactors<T> {
    /// Memory for a problem.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn new<P: Formulation<T>>(ocp: &HeapOcp<P, T>) -> Result<Self, OcpError> {
        let dims @ [nx, nu, np] = [P::Shape::NX, P::Shape::NU, P::Shape::NP];
        let n = ocp.intervals();
        Ok(Self {
            smoothing: T::ZERO,
            dims,
            intervals: n,
            gains: zeros(n * nu * nx)?,
            controls: zeros(n * nu * nu)?,
            costs_to_go: zeros((n + 1) * nx * nx)?,
            dynamics: zeros(n * nx * (nx + nu))?,
            negative: 0,
            border: Border::default(),
            problem: Parameters::new::<P>(n)?,
            column: Column::new(dims, n)?,
            gradient: zeros(nx)?,
            of_start: zeros(nx * nx)?,
            cross: zeros(nx * np)?,
            square: zeros(np * np)?,
            adjoint: zeros(np)?,
            weak: 0,
            work: zeros(recursion::work(nx, nu))?,
        })
    }

    /// `K_k` of the feedback `u_k + K_k (x − x_k)`, `NU × NX`, column after column; empty where
    /// there is none.
    #[must_use]
    pub fn gain(&self, stage: usize) -> &[T] {
        let [nx, nu, _] = self.dims;
        block(&self.gains, stage, nu * nx)
    }

    /// How many bounds have neither a slack nor a multiplier above `ε^¼` (1e-4 in double
    /// precision): there, solutions have a derivative to either side. Zero where solutions are
    /// smoothed.
    #[must_use]
    pub fn weakly_active(&self) -> usize {
        self.weak
    }

    /// `∂V/∂x₀`, `NX`; empty where the initial state is free.
    #[must_use]
    pub fn value_gradient_x0(&self) -> &[T] {
        part(&self.gradient, 0, self.given())
    }

    /// `∂V/∂p`, `NP`.
    #[must_use]
    pub fn value_gradient_p(&self) -> &[T] {
        &self.problem.slopes_of_value
    }

    /// The Hessian of the optimal value.
    pub fn value_hessian(&mut self) -> ValueHessian<'_, T> {
        let ([nx, _, np], given) = (self.dims, self.given());
        let mut column = core::mem::take(&mut self.column);
        for i in 0..given {
            column::solve_start(self, i, &mut column);
            assign(part_mut(&mut self.of_start, i * nx, nx), column.multipliers(0));
        }
        for p in 0..np {
            column::solve_parameter(self, p, &mut column);
            assign(part_mut(&mut self.cross, p * nx, nx), column.multipliers(0));
            for q in 0..np {
                let value = get(&self.problem.square, p * np + q) + self.change(q, &column);
                set(&mut self.square, p * np + q, value);
            }
        }
        self.column = column;
        ValueHessian {
            xx: part(&self.of_start, 0, given * nx),
            xp: part(&self.cross, 0, given * np),
            pp: &self.square,
        }
    }

    /// `λᵀ dw/dx₀` and `λᵀ dw/dp`, where states and controls of `seed` are `λ`; its multipliers are
    /// not looked at.
    ///
    /// # Errors
    /// [`OcpError::Length`] if the seed has other dimensions; [`OcpError::InvalidValue`] if it is
    /// not finite.
    pub fn adjoint<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        &mut self,
        seed: &Solution<T, D, M>,
    ) -> Result<SolutionAdjoint<'_, T>, OcpError> {
        self.check_seed(seed)?;
        let mut column = core::mem::take(&mut self.column);
        column::solve_seed(self, seed, &mut column);
        for p in 0..self.dims[2] {
            let value = self.change(p, &column);
            set(&mut self.adjoint, p, value);
        }
        self.column = column;
        Ok(SolutionAdjoint { x0: part(self.column.multipliers(0), 0, self.given()), p: &self.adjoint })
    }

    /// How many elements of the first state are given: all, or none.
    pub(super) fn given(&self) -> usize {
        if self.border.is_free() { 0 } else { self.dims[0] }
    }
    /// Columns of `P` of a stage.
    pub(super) fn cost_to_go(&self, k: usize) -> impl Iterator<Item = &[T]> {
        let [nx, _, _] = self.dims;
        part(&self.costs_to_go, k * nx * nx, nx * nx).chunks_exact(nx.max(1))
    }
    /// Rows of `[A B]` of an interval.
    pub(super) fn rows(&self, k: usize) -> impl Iterator<Item = &[T]> {
        let [nx, nu, _] = self.dims;
        part(&self.dynamics, k * nx * (nx + nu), nx * (nx + nu)).chunks_exact((nx + nu).max(1))
    }
    /// A column of `K` of an interval.
    pub(super) fn gains(&self, k: usize, state: usize) -> &[T] {
        let [nx, nu, _] = self.dims;
        part(&self.gains, (k * nx + state) * nu, nu)
    }

    /// The product of a solution of the conditions of optimality with what a parameter changes of
    /// these.
    fn change(&self, p: usize, column: &Column<T>) -> T {
        let [nx, nu, _] = self.dims;
        let mut sum = T::ZERO;
        for k in 0..=self.intervals {
            let gradient = part(self.problem.gradient(k), p * (nx + nu), nx + nu);
            let (of_x, of_u) = gradient.split_at_checked(nx).unwrap_or_default();
            let end = part(self.problem.end(k), p * nx, nx);
            let pairs = of_x.iter().zip(column.state(k)).chain(of_u.iter().zip(column.control(k)));
            let pairs = pairs.chain(end.iter().zip(column.multipliers(k + 1)));
            sum = pairs.fold(sum, |sum, (&a, &b)| sum + a * b);
        }
        sum
    }

    fn check_seed<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        &self,
        seed: &Solution<T, D, M>,
    ) -> Result<(), OcpError> {
        let [nx, nu, _] = self.dims;
        let (expected, found) = (self.intervals + 1, seed.dims().len());
        if expected != found {
            return Err(OcpError::Length { part: Part::Dimensions, stage: 0, expected, found });
        }
        for (stage, at) in seed.stages().enumerate() {
            let controls = if stage < self.intervals { nu } else { 0 };
            for (part, values, expected) in [(Part::States, at.x, nx), (Part::Controls, at.u, controls)] {
                if values.len() != expected {
                    return Err(OcpError::Length { part, stage, expected, found: values.len() });
                }
                if let Some((index, value)) = crate::finite::not_finite(values) {
                    return Err(OcpError::InvalidValue { part, stage, name: "seed", index, value });
                }
            }
        }
        Ok(())
    }

    /// The recursion, for the QP at the iterate.
    ///
    /// # Errors
    /// [`OcpError::Qp`]
    pub(super) fn fill<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        &mut self,
        qp: QpView<'_, T>,
        iterate: &Solution<T, D, M>,
        parameters: bool,
    ) -> Result<(), OcpError> {
        let mut largest = T::ZERO;
        for stage in qp.stages() {
            for &value in stage.arrays().hessian {
                largest = value.abs().max(largest);
            }
        }
        let mut springs = Springs::new(largest, self.smoothing);
        recursion::factorise(self, qp, iterate, &mut springs, parameters)?;
        self.weak = springs.weak;
        let mut column = core::mem::take(&mut self.column);
        let result = Border::factorise(self, &mut column);
        self.column = column;
        recursion::gradient(qp, iterate, &mut self.gradient);
        result
    }
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Factorises the conditions of optimality at the iterate, for derivatives of the solution and
    /// of its value: the iterate must be a solution.
    ///
    /// With [`Exact`](crate::ocp::Exact) Hessians that are not made convex these are derivatives of
    /// the solution; with those of Gauss and Newton approximations, but for the gradient of the
    /// value, which has no Hessian in it.
    ///
    /// # Errors
    /// Those of [`Ocp::linearise`]; [`OcpError::Missing`] if nothing was said of the initial state;
    /// [`OcpError::Length`] if the memory is of another problem; [`OcpError::InvalidOption`] of the
    /// smoothing; [`OcpError::Qp`] if the reduced Hessian is not positive definite.
    pub fn factorise<C: Curvature<P::Dynamics, T>>(
        &mut self,
        curvature: C,
        factors: &mut SolutionFactors<T>,
    ) -> Result<(), OcpError> {
        self.prepare_factors(factors)?;
        let problem = &mut factors.problem;
        problem.begin();
        self.linearise_watched(curvature, &mut |k, step| problem.take(k, step))?;
        self.differentiate_functions(C::EXACT, problem)?;
        factors.fill(self.qp.view(), &self.iterate, true)
    }

    /// Checks memory and options, and what has to be found beside the recursion.
    ///
    /// # Errors
    /// [`OcpError::Missing`], [`OcpError::Length`], [`OcpError::InvalidOption`]
    pub(super) fn prepare_factors(&self, factors: &mut SolutionFactors<T>) -> Result<(), OcpError> {
        if self.initial == Initial::Unknown {
            return Err(OcpError::Missing { part: Part::InitialState, stage: 0 });
        }
        let value = factors.smoothing.to_f64();
        if !(value >= 0.0 && value.is_finite()) {
            return Err(OcpError::InvalidOption {
                name: "smoothing",
                value,
                allowed: "from 0 on and finite",
            });
        }
        let (part, stage) = (Part::Memory, 0);
        let given = [P::Shape::NX, P::Shape::NU, P::Shape::NP, self.intervals()];
        let [nx, nu, np] = factors.dims;
        for (expected, found) in given.into_iter().zip([nx, nu, np, factors.intervals]) {
            if expected != found {
                return Err(OcpError::Length { part, stage, expected, found });
            }
        }
        factors.border.prepare(self.qp.view(), self.initial == Initial::Free, [nx, nu, self.intervals()])
    }
}
