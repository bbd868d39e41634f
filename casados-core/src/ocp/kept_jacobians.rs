//! Dynamics whose Jacobians are kept, and corrected by adjoints.

use super::dynamics::{Dynamics, IntegralTerms, Nodes, Sink, Step, vector};
use super::error::OcpError;
use super::names::Names;
use super::single::{Begin, at};
use crate::memory::{WithAdjoint, WithForward};
use crate::model::{Dae, Ode, VectorU, VectorX};
use crate::qp::{part, part_mut};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};
use crate::{erk, irk};
use alloc::vec::Vec;

/// Dynamics with adjoints.
pub trait Adjoints<T: Real>: Dynamics<T> {
    /// The ends of all intervals, and `∂(πᵀφ)/∂x` and `∂(πᵀφ)/∂u` with the multipliers `π` of the
    /// interval, in order.
    ///
    /// # Errors
    /// [`OcpError::Integration`]
    fn adjoints(
        &mut self,
        nodes: &Nodes<'_, T>,
        sink: &mut dyn FnMut(usize, [&[T]; 3]),
    ) -> Result<(), OcpError>;
}

macro_rules! adjoints {
    ($module:ident, $model:ident, $($memory:tt)+) => {
        impl<M: $model, B, const S: usize, T: Real, W: $($memory)+> Adjoints<T>
            for $module::Integrator<M, B, S, T, W>
        {
            fn adjoints(
                &mut self,
                nodes: &Nodes<'_, T>,
                sink: &mut dyn FnMut(usize, [&[T]; 3]),
            ) -> Result<(), OcpError> {
                for (k, interval) in nodes.iter().enumerate() {
                    at(k, self.begin(&interval))?;
                    let (x, u): (VectorX<M, T>, VectorU<M, T>) = (vector(interval.x), vector(interval.u));
                    let lambda: VectorX<M, T> = vector(interval.multipliers);
                    let result = at(k, self.adjoint(&x, &u, interval.h, &lambda))?;
                    let gradients = [result.grad_x0.as_slice(), result.grad_u.as_slice()];
                    sink(k, [result.x.as_slice(), gradients[0], gradients[1]]);
                }
                Ok(())
            }
        }
    };
}

adjoints!(irk, Dae, WithForward + WithAdjoint<1>);
adjoints!(erk, Ode, WithForward);

/// Dynamics that keep their Jacobians `[A B]` from iteration to iteration, and ask the integrator
/// for adjoints only: inexact sequential quadratic programming.
///
/// ```text
/// QP with kept [A B], and the gradient  ∇f + ([A B]_exact − [A B]_kept)ᵀ π
/// ```
///
/// One adjoint of an interval costs about as much as one direction of its Jacobian. Residuals of
/// the conditions of optimality are exact, whatever Jacobians are kept, and so are solutions;
/// convergence is linear, at a rate that the distance from the kept point says. Where a step is
/// longer than [`contraction`](Self::contraction) of the one before, all Jacobians are computed
/// again.
///
/// It is for [`Sqp::gauss_newton`](super::Sqp::gauss_newton), over integrators of single intervals
/// without costs at algebraic states, integrals, or derivatives of solutions by parameters.
///
/// H. G. Bock, M. Diehl, E. Kostina, J. P. Schlöder, "Constrained optimal feedback control of
/// systems governed by large differential algebraic equations", 2007; L. Wirsching, H. G. Bock,
/// M. Diehl, "Fast NMPC of a chain of masses connected by springs", 2006.
///
/// # Example
/// ```
/// use casados::ocp::{HeapSqp, Horizon, KeptJacobians, LeastSquaresCost, Problem};
/// use casados::prelude::*;
///
/// #[ode]
/// fn pendulum(x: [f64; 2], u: [f64; 1]) -> [f64; 2] { [x[1], -x[0].sin() + u[0]] }
/// #[function]
/// fn all(x: [f64; 2], u: [f64; 1]) -> [f64; 3] { [x[0], x[1], u[0]] }
///
/// let irk = Irk::<Pendulum, Gauss<2>>::new(Options::default())?;
/// let mut ocp = Problem::new(KeptJacobians::new(irk))
///     .stage_cost(LeastSquaresCost::<All>::diagonal(&[1.0, 1.0, 0.1]))
///     .on(Horizon::uniform(10, 0.1))?;
/// ocp.fix_initial_state(&[0.5, 0.0])?.guess(&[0.5, 0.0], &[0.0])?;
/// assert!(HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?.is_converged());
/// let dynamics = &ocp.problem().dynamics;
/// assert!(dynamics.adjoints() > 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct KeptJacobians<D, T> {
    /// The dynamics.
    pub dynamics: D,
    /// A step is to be shorter than this part of the one before, or Jacobians are computed again.
    /// Zero: in every iteration. Default 0.5.
    pub contraction: f64,
    /// Columns of `[A B]` of every interval, and the points of the last call.
    matrices: Vec<T>,
    points: Vec<T>,
    corrections: Vec<T>,
    /// The length of the last step; infinite after new Jacobians.
    step: f64,
    jacobians: usize,
    adjoints: usize,
}

impl<D, T: Real> KeptJacobians<D, T> {
    /// Dynamics that keep their Jacobians.
    pub fn new(dynamics: D) -> Self {
        Self {
            dynamics,
            contraction: 0.5,
            matrices: Vec::new(),
            points: Vec::new(),
            corrections: Vec::new(),
            step: f64::INFINITY,
            jacobians: 0,
            adjoints: 0,
        }
    }

    /// How often all Jacobians were computed.
    #[must_use]
    pub fn jacobians(&self) -> usize {
        self.jacobians
    }

    /// How often adjoints alone were computed.
    #[must_use]
    pub fn adjoints(&self) -> usize {
        self.adjoints
    }

    /// Forgets the Jacobians, as after other parameters.
    pub fn reset(&mut self) {
        self.matrices.clear();
    }
}

impl<D: Dynamics<T>, T: Real> KeptJacobians<D, T> {
    /// Memory for so many intervals; whether there are no Jacobians of these.
    fn reserve(&mut self, intervals: usize) -> Result<bool, OcpError> {
        let n = D::Shape::NX + D::Shape::NU;
        let is_new = self.matrices.len() != intervals * n * D::Shape::NX;
        for (memory, length) in [
            (&mut self.matrices, intervals * n * D::Shape::NX),
            (&mut self.points, intervals * n),
            (&mut self.corrections, n),
        ] {
            let more = length.saturating_sub(memory.len());
            let bytes = more.saturating_mul(size_of::<T>());
            memory.try_reserve_exact(more).map_err(|_| OcpError::OutOfMemory { bytes })?;
            memory.resize(length, T::ZERO);
        }
        Ok(is_new)
    }

    /// How far the points are from those of the last call, which they replace.
    fn distance(&mut self, nodes: &Nodes<'_, T>) -> f64 {
        let here = nodes.iter().flat_map(|interval| interval.x.iter().chain(interval.u));
        self.points.iter_mut().zip(here).fold(0.0, |largest, (point, &new)| {
            let distance = (new - *point).abs().to_f64();
            *point = new;
            if distance > largest { distance } else { largest }
        })
    }
}

impl<D: Adjoints<T>, T: Real> Dynamics<T> for KeptJacobians<D, T> {
    type Shape = D::Shape;
    const NAMES: Names = D::NAMES;
    fn check(&self) -> Result<(), OcpError> {
        self.dynamics.check()
    }
    fn simulate(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        self.dynamics.simulate(nodes, &mut |k, step| sink(k, &Step { z: &[], ..*step }))
    }
    fn linearise(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        let (nx, n) = (D::Shape::NX, D::Shape::NX + D::Shape::NU);
        let is_new = self.reserve(nodes.len())?;
        let distance = self.distance(nodes);
        // Of nothing times infinity, too.
        let is_near = distance <= self.contraction * self.step;
        let Self { dynamics, matrices, corrections, .. } = self;
        if is_new || !is_near {
            self.step = f64::INFINITY;
            self.jacobians += 1;
            let result = dynamics.linearise(nodes, &mut |k, step| {
                let both = part_mut(matrices, k * n * nx, n * nx);
                both.iter_mut().zip(step.dx.iter().chain(step.du)).for_each(|(to, &from)| *to = from);
                sink(k, &Step { x: step.x, dx: step.dx, du: step.du, ..Step::default() });
            });
            if result.is_err() {
                self.reset();
            }
            return result;
        }
        self.step = distance;
        self.adjoints += 1;
        let mut intervals = nodes.iter();
        dynamics.adjoints(nodes, &mut |k, [x, of_x, of_u]| {
            let Some(interval) = intervals.next() else { return };
            let both = part(matrices, k * n * nx, n * nx);
            corrections.iter_mut().zip(of_x.iter().chain(of_u)).for_each(|(to, &from)| *to = from);
            for (correction, column) in corrections.iter_mut().zip(both.chunks_exact(nx.max(1))) {
                let products = column.iter().zip(interval.multipliers);
                *correction = products.fold(*correction, |sum, (&a, &pi)| sum - a * pi);
            }
            let (dx, du) = both.split_at_checked(nx * nx).unwrap_or_default();
            let (of_x, of_u) = corrections.split_at_checked(nx).unwrap_or_default();
            let cost = IntegralTerms { x: of_x, u: of_u, ..IntegralTerms::default() };
            sink(k, &Step { x, dx, du, cost, ..Step::default() });
        })
    }
}
