//! Derivatives of all instances of a batch.

use super::gradients::Gradients;
use super::{BatchOcp, Worker, reset_list};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::HeapOcp;
use crate::ocp::formulation::problem::Formulation;
use crate::ocp::formulation::program::curvature::Curvature;
use crate::ocp::nlp::ocp_solver::OcpSolver;
use crate::ocp::solution::outcome::Outcome;
use crate::ocp::solution::sensitivities::{Sensitivities, SolutionFactors};
use crate::qp::{HeapSolution, copy_common, each, try_reserve};
use crate::scalar::Real;

impl<P, S, T> BatchOcp<P, S, T>
where
    P: Formulation<T> + Clone + Send + Sync,
    S: OcpSolver<P, T>,
    T: Real,
{
    /// Computes adjoint derivatives of all solutions: `λᵀ dw/dx₀`, `λᵀ dw/dp` and `λᵀ dw/dr` of
    /// each instance, by initial state, parameters and references, as [`SolutionFactors::adjoint`]
    /// and [`Ocp::adjoint_by_references`](crate::ocp::Ocp::adjoint_by_references) do. `seed` writes
    /// the `λ` of an instance over states and controls, which are zero before, from the index and
    /// the solution of the instance: the gradient of a loss.
    ///
    /// Each instance takes one linearisation and one factorisation, for any number of parameters.
    /// An instance whose last run did not end at a solution has an error instead; before the first
    /// run all iterates count as solutions.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]: nothing was computed. The errors of instances are among the
    /// gradients.
    ///
    /// # Example
    /// ```
    /// # use casados::ocp::{BatchOcp, Exact, HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
    /// # use casados::prelude::*;
    /// #[function]
    /// fn push(x: f64, u: f64, _p: f64) -> f64 { x + u }
    /// /// A place `p` to go to.
    /// #[function]
    /// fn away(x: f64, u: f64, p: f64) -> [f64; 2] { [x - p, u] }
    ///
    /// let mut ocp = Problem::new(Map::<Push, f64>::new())
    ///     .stage_cost(LeastSquaresCost::<Away>::diagonal(&[1.0; 2]))
    ///     .on(Horizon::uniform(30, 0.1))?;
    /// ocp.fix_initial_state(&[1.0])?.set_parameters(.., &[0.0])?.guess(&[1.0], &[0.0])?;
    /// let mut batch = BatchOcp::new(&ocp, 10, HeapSqp::new(&ocp)?)?;
    /// batch.solve()?;
    /// // The loss ½ (u₀ + 1)²: how it changes with the place.
    /// let gradients = batch.adjoint(Exact::default(), |_, ocp, seed| {
    ///     if let (Ok(first), Some(seed)) = (ocp.stage(0), seed.stage_mut(0)) {
    ///         seed.u[0] = first.u[0] + 1.0;
    ///     }
    /// })?;
    /// // u₀ = 0.618 (p − x₀)
    /// assert!((gradients.get(3)?.p[0] - 0.618 * (1.0 - 0.618)).abs() < 1e-4);
    /// # Ok::<(), casados::ocp::OcpError>(())
    /// ```
    pub fn adjoint<C: Curvature<P::Dynamics, T> + Sync>(
        &mut self,
        curvature: C,
        seed: impl Fn(usize, &HeapOcp<P, T>, &mut HeapSolution<T>) + Sync,
    ) -> Result<Gradients<'_, T>, OcpError> {
        self.gradients(curvature, |instance, ocp, factors, seed_of_worker, [x0, p, references]| {
            seed_of_worker.clear();
            seed(instance, ocp, seed_of_worker);
            let found = factors.adjoint(seed_of_worker)?;
            copy_common(x0, found.x0);
            copy_common(p, found.p);
            ocp.adjoint_by_references(factors, references)
        })
    }

    /// Computes the gradients of all optimal values: `∂V/∂x₀`, `∂V/∂p` and `∂V/∂r` of each
    /// instance, as [`SolutionFactors::value_gradient_x0`] and `value_gradient_p` do. They do not
    /// depend on the Hessian; the Gauss-Newton Hessian is the cheapest.
    ///
    /// # Errors
    /// As [`BatchOcp::adjoint`].
    pub fn value_gradient<C: Curvature<P::Dynamics, T> + Sync>(
        &mut self,
        curvature: C,
    ) -> Result<Gradients<'_, T>, OcpError> {
        self.gradients(curvature, |_, ocp, factors, _, [x0, p, references]| {
            copy_common(x0, factors.value_gradient_x0());
            copy_common(p, factors.value_gradient_p());
            ocp.value_gradient_by_references(references)
        })
    }

    /// Factorises each instance at its solution, and computes a gradient by the factors.
    #[allow(clippy::type_complexity)]
    fn gradients<C: Curvature<P::Dynamics, T> + Sync>(
        &mut self,
        curvature: C,
        evaluate: impl Fn(
            usize,
            &mut HeapOcp<P, T>,
            &mut SolutionFactors<T>,
            &mut HeapSolution<T>,
            [&mut [T]; 3],
        ) -> Result<(), OcpError>
        + Sync,
    ) -> Result<Gradients<'_, T>, OcpError> {
        let (threads, smoothing) = (self.prepare_workers()?, self.smoothing);
        let Self { instances, workers, gradient_memory: gradients, outcomes, .. } = self;
        let workers = workers.get_mut(..threads).unwrap_or_default();
        let Some(first) = instances.first() else { return Ok(gradients.view()) };
        for worker in workers.iter_mut().filter(|worker| worker.adjoint.is_none()) {
            worker.adjoint = Some((SolutionFactors::new(first)?, HeapSolution::new(first.qp().dims())?));
        }
        let places = gradients.instance_gradients(instances.len())?;
        let items = instances.iter_mut().zip(places).enumerate();
        each(workers, items, |Worker { adjoint, .. }, (i, (ocp, (status, places)))| {
            let Some((factors, seed)) = adjoint else { return };
            factors.smoothing = smoothing;
            let mut places = places;
            places.iter_mut().for_each(|place| place.fill(T::ZERO));
            *status = check_solved(outcomes, i)
                .and_then(|()| ocp.factorise(curvature, factors))
                .and_then(|()| evaluate(i, ocp, factors, seed, places));
        });
        Ok(gradients.view())
    }

    /// Computes the derivatives of all solutions by initial states and parameters, and the feedback
    /// gains, as [`Ocp::differentiate`](crate::ocp::Ocp::differentiate) does. Returns the status of
    /// each instance; [`BatchOcp::sensitivities`] has the derivatives.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]: nothing was computed. The errors of instances are their statuses.
    ///
    /// # Example
    /// ```
    /// # use casados::ocp::{BatchOcp, Exact, HeapIpm, Horizon, LeastSquaresCost, Map, Problem};
    /// # use casados::prelude::*;
    /// # #[function]
    /// # fn push(x: f64, u: f64) -> f64 { x + u }
    /// # #[function]
    /// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
    /// # let mut ocp = Problem::new(Map::<Push, f64>::new())
    /// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
    /// #     .on(Horizon::uniform(20, 0.1))?;
    /// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
    /// let mut batch = BatchOcp::new(&ocp, 5, HeapIpm::new(&ocp)?)?;
    /// batch.solve()?;
    /// assert!(batch.differentiate(Exact::default())?.iter().all(Result::is_ok));
    /// let fifth = batch.sensitivities(4).ok_or("there are five")?;
    /// assert!((fifth.du(0)[0] + 0.618).abs() < 1e-3);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn differentiate<C: Curvature<P::Dynamics, T> + Sync>(
        &mut self,
        curvature: C,
    ) -> Result<&[Result<(), OcpError>], OcpError> {
        let (threads, smoothing) = (self.prepare_workers()?, self.smoothing);
        let Self { instances, workers, sensitivities: forward, statuses, outcomes, .. } = self;
        try_reserve(forward, instances.len().saturating_sub(forward.len()))?;
        while let Some(ocp) = instances.get(forward.len()) {
            forward.push(Sensitivities::new(ocp)?);
        }
        reset_list(statuses, instances.len(), || Ok(()))?;
        let workers = workers.get_mut(..threads).unwrap_or_default();
        let items = instances.iter_mut().zip(forward).zip(&mut *statuses).enumerate();
        each(workers, items, |_, (i, ((ocp, result), status))| {
            result.factors().smoothing = smoothing;
            *status = check_solved(outcomes, i).and_then(|()| ocp.differentiate(curvature, result));
        });
        Ok(statuses)
    }

    /// Returns the derivatives of the last [`BatchOcp::differentiate`]; none for an instance that
    /// failed.
    #[must_use]
    pub fn sensitivities(&self, instance: usize) -> Option<&Sensitivities<T>> {
        self.statuses.get(instance)?.as_ref().ok()?;
        self.sensitivities.get(instance)
    }
}

/// Checks that the last run of an instance, if there was one, ended at a solution.
fn check_solved(outcomes: &[Result<Outcome, OcpError>], instance: usize) -> Result<(), OcpError> {
    match outcomes.get(instance) {
        Some(Err(error)) => Err(*error),
        Some(Ok(outcome)) if !outcome.is_solved() => Err(OcpError::NoSolution),
        _ => Ok(()),
    }
}
