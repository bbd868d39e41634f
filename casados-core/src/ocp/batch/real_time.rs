//! Real-time iterations for many plants.

use super::reset_list;
use crate::ocp::feedback::real_time::HeapRealTime;
use crate::ocp::formulation::error::{OcpError, Part};
use crate::ocp::formulation::instance::HeapOcp;
use crate::ocp::formulation::problem::Formulation;
use crate::ocp::formulation::program::curvature::{Curvature, GaussNewton};
use crate::qp::{HeapInteriorPoint, copy_common, each, part, threads, try_reserve, try_resize};
use crate::scalar::Real;
use crate::shape::Shape;
use alloc::vec::Vec;

/// Real-time iterations for many plants at once: a [`HeapRealTime`] for each, with its own plan,
/// references and parameters, in the threads of rayon (feature `parallel`).
///
/// ```
/// use casados::ocp::{BatchRealTime, Horizon, LeastSquaresCost, Map, Problem};
/// use casados::prelude::*;
///
/// #[function]
/// fn push(x: f64, u: f64) -> f64 { x + u }
/// #[function]
/// fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
///
/// let mut ocp = Problem::new(Map::<Push, f64>::new())
///     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
///     .on(Horizon::uniform(20, 0.1))?;
/// ocp.fix_initial_state(&[1.0])?.guess(&[0.0], &[0.0])?;
/// let mut controllers = BatchRealTime::new(&ocp, 50)?;
/// let mut x: Vec<f64> = (0..50).map(f64::from).collect();
/// for _ in 0..30 {
///     let prepared = controllers.prepare()?; // while the last controls act
///     let u = prepared.feedback(&x)?; // the states have been measured
///     x.iter_mut().zip(u).for_each(|(x, u)| *x += u);
///     controllers.shift();
/// }
/// assert!(controllers.statuses().iter().all(Result::is_ok));
/// assert!(x.iter().all(|x| x.abs() < 1e-6));
/// # Ok::<(), casados::ocp::OcpError>(())
/// ```
pub struct BatchRealTime<P: Formulation<T>, C = GaussNewton, T: Real = f64> {
    controllers: Vec<HeapRealTime<P, HeapInteriorPoint<T>, C, T>>,
    statuses: Vec<Result<(), OcpError>>,
    /// The controls of all plants, in order.
    u: Vec<T>,
    thread_slots: Vec<()>,
}

/// Prepared QPs, before the feedback phase; see [`BatchRealTime`].
///
/// ```
/// # use casados::ocp::{BatchRealTime, Horizon, LeastSquaresCost, Map, Problem};
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(20, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[0.0], &[0.0])?;
/// let mut controllers = BatchRealTime::new(&ocp, 2)?;
/// // The second sensor is broken: its plant keeps the control before, here none.
/// let u = controllers.prepare()?.feedback(&[1.0, f64::NAN])?;
/// assert!((u[0] + 0.618).abs() < 1e-3 && u[1] == 0.0);
/// assert!(controllers.statuses()[0].is_ok() && controllers.statuses()[1].is_err());
/// # Ok::<(), casados::ocp::OcpError>(())
/// ```
pub struct BatchPrepared<'a, P: Formulation<T>, C, T: Real> {
    batch: &'a mut BatchRealTime<P, C, T>,
}

impl<P: Formulation<T> + Clone, T: Real> BatchRealTime<P, GaussNewton, T> {
    /// Creates `count` controllers for a problem whose iterate is the first plan, with the
    /// Gauss-Newton Hessian.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn new(ocp: &HeapOcp<P, T>, count: usize) -> Result<Self, OcpError> {
        let (mut controllers, mut u, mut workers) = (Vec::new(), Vec::new(), Vec::new());
        try_reserve(&mut controllers, count)?;
        for _ in 0..count {
            controllers.push(HeapRealTime::new(ocp.clone())?);
        }
        try_resize(&mut u, count.saturating_mul(P::Shape::NU))?;
        workers.resize(threads(count), ());
        let mut statuses = Vec::new();
        reset_list(&mut statuses, count, || Ok(()))?;
        Ok(Self { controllers, statuses, u, thread_slots: workers })
    }
}

impl<P, C, T> BatchRealTime<P, C, T>
where
    P: Formulation<T>,
    T: Real,
{
    /// Changes the Hessian, for example to [`Exact`](crate::ocp::Exact).
    #[must_use]
    pub fn with_curvature<N: Copy>(self, curvature: N) -> BatchRealTime<P, N, T> {
        let Self { controllers, statuses, u, thread_slots: threads } = self;
        let controllers = controllers.into_iter().map(|each| each.with_curvature(curvature)).collect();
        BatchRealTime { controllers, statuses, u, thread_slots: threads }
    }

    /// Returns the controllers, to change references, parameters and plans by
    /// [`RealTime::ocp_mut`](crate::ocp::RealTime::ocp_mut).
    pub fn controllers_mut(&mut self) -> &mut [HeapRealTime<P, HeapInteriorPoint<T>, C, T>] {
        &mut self.controllers
    }

    /// Returns the status of each plant after the last call.
    pub fn statuses(&self) -> &[Result<(), OcpError>] {
        &self.statuses
    }
}

impl<P, C, T> BatchRealTime<P, C, T>
where
    P: Formulation<T> + Send,
    C: Curvature<P::Dynamics, T> + Send,
    T: Real,
{
    /// The preparation phase of all plants: linearises each problem at its plan. A plant whose
    /// linearisation fails has no feedback in this sample.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn prepare(&mut self) -> Result<BatchPrepared<'_, P, C, T>, OcpError> {
        let Self { controllers, statuses, thread_slots: threads, .. } = self;
        reset_list(statuses, controllers.len(), || Ok(()))?;
        each(threads, controllers.iter_mut().zip(&mut *statuses), |(), (controller, status)| {
            *status = controller.linearise();
        });
        Ok(BatchPrepared { batch: self })
    }

    /// Shifts all plans by one interval, for the next sample.
    pub fn shift(&mut self) {
        self.controllers.iter_mut().for_each(HeapRealTime::shift);
    }
}

impl<'a, P, C, T> BatchPrepared<'a, P, C, T>
where
    P: Formulation<T> + Send,
    C: Curvature<P::Dynamics, T> + Send,
    T: Real,
{
    /// The feedback phase of all plants: solves each QP with its state; `x` has the states of all
    /// plants in order. Returns the controls of all plants in the same order. A plant without
    /// feedback keeps its last control, initially zero, and [`BatchRealTime::statuses`] has its
    /// error.
    ///
    /// # Errors
    /// [`OcpError::Length`] unless `x` has `NX` elements for each plant.
    pub fn feedback(self, x: &[T]) -> Result<&'a [T], OcpError> {
        let (nx, nu) = (P::Shape::NX, P::Shape::NU);
        let BatchRealTime { controllers, statuses, u, thread_slots: threads } = self.batch;
        let (expected, found) = (controllers.len() * nx, x.len());
        if expected != found {
            return Err(OcpError::Length { part: Part::States, stage: 0, expected, found });
        }
        let controls = controllers.len() * nu;
        let mut rest = u.get_mut(..controls).unwrap_or_default();
        let places = core::iter::repeat_with(move || crate::qp::take_mut(&mut rest, nu));
        let items = controllers.iter_mut().zip(statuses).zip(places).enumerate();
        each(threads, items, |(), (i, ((controller, status), u))| {
            if status.is_ok() {
                *status = controller.iterate(part(x, i * nx, nx), &mut || false).and_then(|_| {
                    copy_common(u, controller.ocp().stage(0)?.u);
                    Ok(())
                });
            }
        });
        Ok(u)
    }
}
