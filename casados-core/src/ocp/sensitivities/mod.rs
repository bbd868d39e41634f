//! How a solution changes with its initial state and with parameters.

mod active;
mod parameters;
mod recursion;

use super::data::get;
use super::error::{OcpError, Part};
use super::instance::{Initial, Ocp};
use super::linearise::Curvature;
use super::problem::Formulation;
use crate::qp::StageDims;
use crate::scalar::Real;
use crate::shape::Shape;
use alloc::vec::Vec;

/// `dx_k/dx₀`, `du_k/dx₀`, `dx_k/dp` and `du_k/dp` of a solution, and the gains of the feedback
/// `u_k + K_k (x − x_k)`.
///
/// Derivatives with respect to `p` are those where the parameters of all stages change together.
#[derive(Clone, Debug)]
pub struct Sensitivities<T> {
    nx: usize,
    nu: usize,
    np: usize,
    /// `K`, `dx/dx₀`, `du/dx₀`: matrices column after column, one stage after the other.
    gains: Vec<T>,
    x: Vec<T>,
    u: Vec<T>,
    /// `dx/dp`, and `du/dp`; before that what the controls do where the states stay.
    x_p: Vec<T>,
    u_p: Vec<T>,
    problem: parameters::Parameters<T>,
    /// `P` of the next stage, `P [A B]`, `M`, its factors, and for the parameters the gradients of
    /// stage and next stage.
    work: Vec<T>,
}

impl<T: Real> Sensitivities<T> {
    /// Memory for a problem.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn new<P: Formulation<T>>(ocp: &super::HeapOcp<P, T>) -> Result<Self, OcpError> {
        let (nx, nu, np, n) = (P::Shape::NX, P::Shape::NU, P::Shape::NP, ocp.intervals());
        Ok(Self {
            nx,
            nu,
            np,
            gains: zeros(n * nu * nx)?,
            x: zeros((n + 1) * nx * nx)?,
            u: zeros(n * nu * nx)?,
            x_p: zeros((n + 1) * nx * np)?,
            u_p: zeros(n * nu * np)?,
            problem: parameters::Parameters::new::<P>(n)?,
            work: zeros(recursion::Work::<T>::length(nx, nu, np))?,
        })
    }

    /// `K_k`, `NU × NX`, column after column; empty where there is none.
    #[must_use]
    pub fn gain(&self, stage: usize) -> &[T] {
        block(&self.gains, stage, self.nu * self.nx)
    }
    /// `dx_k/dx₀`, `NX × NX`, column after column.
    #[must_use]
    pub fn dx(&self, stage: usize) -> &[T] {
        block(&self.x, stage, self.nx * self.nx)
    }
    /// `du_k/dx₀`, `NU × NX`, column after column.
    #[must_use]
    pub fn du(&self, stage: usize) -> &[T] {
        block(&self.u, stage, self.nu * self.nx)
    }
    /// `dx_k/dp`, `NX × NP`, column after column.
    #[must_use]
    pub fn dx_dp(&self, stage: usize) -> &[T] {
        block(&self.x_p, stage, self.nx * self.np)
    }
    /// `du_k/dp`, `NU × NP`, column after column.
    #[must_use]
    pub fn du_dp(&self, stage: usize) -> &[T] {
        block(&self.u_p, stage, self.nu * self.np)
    }
}

/// The matrix of a stage; empty where there is none.
fn block<T>(matrices: &[T], stage: usize, length: usize) -> &[T] {
    let begin = stage.checked_mul(length);
    let end = begin.and_then(|begin| begin.checked_add(length));
    begin.zip(end).and_then(|(begin, end)| matrices.get(begin..end)).unwrap_or_default()
}

fn zeros<T: Real>(length: usize) -> Result<Vec<T>, OcpError> {
    let mut memory = Vec::new();
    let bytes = length.saturating_mul(size_of::<T>());
    memory.try_reserve_exact(length).map_err(|_| OcpError::OutOfMemory { bytes })?;
    memory.resize(length, T::ZERO);
    Ok(memory)
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// How the solution changes with its initial state and with parameters, where the bounds that
    /// are active stay so: the iterate must be a solution, with a fixed initial state.
    ///
    /// With [`Exact`](super::Exact) Hessians that are not made convex these are derivatives of the
    /// solution; with those of Gauss and Newton, which leave second derivatives of dynamics,
    /// constraints and least squares out of what parameters change, too, they are approximations of
    /// the same quality. One Riccati recursion: [`OcpError::Qp`] if the reduced Hessian is not
    /// positive definite.
    ///
    /// # Errors
    /// Those of [`Ocp::linearise`]; [`OcpError::Missing`] if the initial state is not fixed;
    /// [`OcpError::Length`] if the memory is of another problem; [`OcpError::Coupled`].
    pub fn differentiate<C: Curvature<P::Dynamics, T>>(
        &mut self,
        curvature: C,
        result: &mut Sensitivities<T>,
    ) -> Result<(), OcpError> {
        self.check_memory(result)?;
        let problem = &mut result.problem;
        self.linearise_watched(curvature, |k, step| problem.take(k, step))?;
        self.differentiate_functions(C::EXACT, problem)?;
        recursion::backward(self.qp.view(), &self.iterate, result)?;
        recursion::forward(self.qp.view(), result);
        Ok(())
    }

    /// The gains `K_k` of the last QP at its solution, which is the iterate: after a feedback of
    /// [`RealTime`](super::RealTime) those of the feedback that was given, to be used until the
    /// next one. Nothing is linearised for it, and nothing else than gains is in the result.
    ///
    /// # Errors
    /// [`OcpError::Missing`] if the initial state is not fixed; [`OcpError::Length`] if the memory
    /// is of another problem; [`OcpError::Qp`] if the reduced Hessian is not positive definite.
    pub fn gains(&self, result: &mut Sensitivities<T>) -> Result<(), OcpError> {
        self.check_memory(result)?;
        recursion::backward(self.qp.view(), &self.iterate, result)?;
        let Sensitivities { x, u, x_p, u_p, .. } = result;
        for derivatives in [x, u, x_p, u_p] {
            derivatives.fill(T::ZERO);
        }
        Ok(())
    }

    fn check_memory(&self, result: &Sensitivities<T>) -> Result<(), OcpError> {
        self.is_uncoupled()?;
        if self.initial != Initial::Fixed {
            return Err(OcpError::Missing { part: Part::InitialState, stage: 0 });
        }
        let (nx, n) = (P::Shape::NX, self.intervals());
        let (expected, found) = ((n + 1) * nx * nx, result.x.len());
        if expected != found || [result.nu, result.np] != [P::Shape::NU, P::Shape::NP] {
            return Err(OcpError::Length { part: Part::Memory, stage: 0, expected, found });
        }
        Ok(())
    }
}

#[inline(always)]
fn set<T: Real>(values: &mut [T], index: usize, value: T) {
    if let Some(element) = values.get_mut(index) {
        *element = value;
    }
}
#[inline(always)]
fn add<T: Real>(values: &mut [T], index: usize, value: T) {
    if let Some(element) = values.get_mut(index) {
        *element = *element + value;
    }
}
