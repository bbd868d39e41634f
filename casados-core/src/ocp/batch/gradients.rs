//! Gradients of all instances of a batch.

use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::problem::Formulation;
use crate::ocp::solution::sensitivities::references;
use crate::qp::{part, take_mut, try_resize};
use crate::scalar::Real;
use crate::shape::Shape;
use alloc::vec::Vec;

/// A gradient of an instance: `λᵀ dw/d·` of its solution `w`, or `∂V/d·` of its optimal value.
///
/// ```
/// # use casados::ocp::{BatchOcp, GaussNewton, HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(20, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// let mut batch = BatchOcp::new(&ocp, 2, HeapSqp::new(&ocp)?)?;
/// batch.solve()?;
/// // The value is ½ · 1.618 x².
/// let gradients = batch.value_gradient(GaussNewton::default())?;
/// assert!((gradients.get(0)?.x0[0] - 1.618).abs() < 1e-3);
/// # Ok::<(), casados::ocp::OcpError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Gradient<'a, T> {
    /// By the initial state, `NX`; zero if it is free.
    pub x0: &'a [T],
    /// By the parameters, `NP`, changed at all stages together.
    pub p: &'a [T],
    /// By the references of all stages in order, followed by that of the terminal cost, as in
    /// [`Ocp::adjoint_by_references`](crate::ocp::Ocp::adjoint_by_references).
    pub references: &'a [T],
}

/// The gradients of all instances, or their errors.
///
/// ```
/// # use casados::ocp::{BatchOcp, GaussNewton, HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(20, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// let mut batch = BatchOcp::new(&ocp, 2, HeapSqp::new(&ocp)?)?;
/// batch.solve()?;
/// let gradients = batch.value_gradient(GaussNewton::default())?;
/// // Those that there are; others have an error in their place.
/// let sum: f64 = gradients.iter().flatten().map(|gradient| gradient.x0[0]).sum();
/// assert!((sum - 2.0 * 1.618).abs() < 1e-3 && gradients.get(0).is_ok());
/// # Ok::<(), casados::ocp::OcpError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Gradients<'a, T> {
    memory: &'a GradientMemory<T>,
}

impl<'a, T: Real> Gradients<'a, T> {
    /// Returns the gradient of an instance.
    ///
    /// # Errors
    /// [`OcpError::NoSolution`] if the last run of the instance did not end at a solution, or if
    /// there is no such instance; the error of that run; those of
    /// [`Ocp::factorise`](crate::ocp::Ocp::factorise).
    pub fn get(&self, instance: usize) -> Result<Gradient<'a, T>, OcpError> {
        let GradientMemory { dims: [nx, np, nr], x0, p, references, statuses } = self.memory;
        statuses.get(instance).copied().unwrap_or(Err(OcpError::NoSolution))?;
        Ok(Gradient {
            x0: part(x0, instance * nx, *nx),
            p: part(p, instance * np, *np),
            references: part(references, instance * nr, *nr),
        })
    }

    /// Returns the gradients of all instances.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Result<Gradient<'a, T>, OcpError>> + use<'a, T> {
        let all = *self;
        (0..self.memory.statuses.len()).map(move |instance| all.get(instance))
    }
}

/// The memory of the gradients.
#[derive(Clone, Debug)]
pub struct GradientMemory<T> {
    /// `NX`, `NP`, and the number of references.
    dims: [usize; 3],
    x0: Vec<T>,
    p: Vec<T>,
    references: Vec<T>,
    statuses: Vec<Result<(), OcpError>>,
}

/// The status and the gradients by `x0`, `p` and references of an instance.
type InstanceGradients<'a, T> = (&'a mut Result<(), OcpError>, [&'a mut [T]; 3]);

impl<T: Real> GradientMemory<T> {
    /// Memory for zero instances.
    pub fn new<P: Formulation<T>>(intervals: usize) -> Self {
        let dims = [P::Shape::NX, P::Shape::NP, references::reference_count::<P, T>(intervals)];
        Self { dims, x0: Vec::new(), p: Vec::new(), references: Vec::new(), statuses: Vec::new() }
    }

    /// Resizes the memory to this number of instances; returns the status and the three gradients
    /// of each.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn instance_gradients(
        &mut self,
        count: usize,
    ) -> Result<impl Iterator<Item = InstanceGradients<'_, T>> + Send, OcpError> {
        let [nx, np, nr] = self.dims;
        super::reset_list(&mut self.statuses, count, || Ok(()))?;
        try_resize(&mut self.x0, count * nx)?;
        try_resize(&mut self.p, count * np)?;
        try_resize(&mut self.references, count * nr)?;
        let (mut x0, mut p, mut references) = (&mut *self.x0, &mut *self.p, &mut *self.references);
        Ok(self.statuses.iter_mut().map(move |status| {
            (status, [take_mut(&mut x0, nx), take_mut(&mut p, np), take_mut(&mut references, nr)])
        }))
    }

    /// Returns a view of the gradients.
    pub fn view(&self) -> Gradients<'_, T> {
        Gradients { memory: self }
    }
}
