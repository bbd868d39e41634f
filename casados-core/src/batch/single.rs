//! Integrators of batches: for a single interval, and for a group in SIMD lanes.

use super::intervals::Interval;
use super::lanes::{MAX_LANES, MaskedResult, pack};
use crate::error::Error;
use crate::integrator::Integrator;
use crate::memory::{WithAdjoint, WithForward, WithHessian};
use crate::model::Dae;
use crate::options::Options;
use crate::result::{Adjoint, Forward, ForwardAdjoint, Hessian, Nominal};
use crate::scalar::Lanes;
use crate::shape::Plain;
use crate::statistics::Statistics;
use core::any::Any;

/// An integrator of single intervals for batches: [`Irk`](crate::Irk) and [`Erk`](crate::Erk) with
/// memory on the heap. Its type `Group` integrates several intervals at once.
///
/// Its methods are used by the batch.
///
/// ```
/// use casados::batch::{Integrator, Single};
/// use casados::prelude::*;
/// use casados::{Custom, Tableau};
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
///
/// fn steps<I: Single>(batch: &Integrator<I>) -> usize {
///     batch.options().steps
/// }
/// // Heun's method as a tableau of one's own.
/// let heun = Tableau::new([[0.0, 0.0], [1.0, 0.0]], [0.5, 0.5], [0.0, 1.0])?;
/// let batch = Integrator::<Erk<Cart, Custom<2>>>::with_tableau(Options::default(), heun)?;
/// assert_eq!(steps(&batch), 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Single:
    Integrator<Memory: WithForward + WithAdjoint<1> + WithHessian> + Clone + Send + Sync
{
    /// The method.
    type Method;
    /// The tableau of the method.
    type Tableau: Copy + Send + Sync;
    /// The stored stages of a step.
    #[doc(hidden)]
    type Stages: Plain;
    /// The integrator of a group, with one interval in each lane.
    #[doc(hidden)]
    type Group<E: Lanes<Cell: AsRef<[Self::Number]> + AsMut<[Self::Number]>>>: Group<Self, E>;

    /// Whether stages are computed by iterations, which start from start values or from the stages
    /// of earlier calls.
    #[doc(hidden)]
    const IS_ITERATIVE: bool;
    /// Whether groups are supported.
    #[doc(hidden)]
    const SUPPORTS_GROUPS: bool;

    /// Returns an integrator for a tableau.
    ///
    /// # Errors
    /// [`Error::InvalidOption`], and errors of an unsuitable tableau.
    #[doc(hidden)]
    fn of(options: &Options, tableau: &Self::Tableau) -> Result<Self, Error>;
    /// Returns the working set of a group in bytes, with `columns` columns of derivatives.
    #[doc(hidden)]
    fn working_set<E: Lanes>(options: &Options, columns: usize) -> usize;

    /// Sets start values `ẋ` and `z`.
    ///
    /// # Errors
    /// Those of the setter.
    #[doc(hidden)]
    fn give(&mut self, given: [&[Self::Number]; 2]) -> Result<(), Error>;
    /// Sets the initial guess of the stages: those of an earlier call, which may be solutions, or
    /// `None`.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    #[doc(hidden)]
    fn start(&mut self, stages: Option<&[Self::Stages]>, reuses_solutions: bool) -> Result<(), Error>;
    /// Copies the stages of the last call.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    #[doc(hidden)]
    fn stages(&mut self, to: &mut [Self::Stages]) -> Result<(), Error>;

    /// Computes derivatives into a result.
    ///
    /// # Errors
    /// Those of a single call.
    #[doc(hidden)]
    fn forward_to(
        &mut self,
        at: &IntervalOf<'_, Self>,
        to: &mut Forward<Self::Model, Self::Number>,
    ) -> Result<(), Error>;
    /// Computes derivatives and gradients into a result.
    ///
    /// # Errors
    /// Those of a single call.
    #[doc(hidden)]
    fn forward_adjoint_to(
        &mut self,
        at: &IntervalOf<'_, Self>,
        to: &mut ForwardAdjoint<Self::Model, Self::Number>,
    ) -> Result<(), Error>;
    /// Computes derivatives, gradients and second derivatives into a result.
    ///
    /// # Errors
    /// Those of a single call.
    #[doc(hidden)]
    fn hessian_to(
        &mut self,
        at: &IntervalOf<'_, Self>,
        to: &mut Hessian<Self::Model, Self::Number>,
    ) -> Result<(), Error>;
}

/// An interval of an integrator.
type IntervalOf<'a, I> = Interval<'a, <I as Integrator>::Model, <I as Integrator>::Number>;

/// An integrator whose method has a tableau: all but those of [`Custom`](crate::Custom).
///
/// ```
/// use casados::batch::{Integrator, Standard};
/// use casados::prelude::*;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
///
/// fn finer<I: Standard>() -> Result<Integrator<I>, Error> {
///     Integrator::new(Options { steps: 4, ..Default::default() })
/// }
/// assert_eq!(finer::<Erk<Cart, Rk4>>()?.options().steps, 4);
/// # Ok::<(), Error>(())
/// ```
pub trait Standard: Single {
    /// The tableau of the method.
    const TABLEAU: Self::Tableau;
}

/// Integrates the intervals of a group.
pub trait Group<I: Single, E: Lanes>: Any + Send + Sync {
    fn new(options: &Options, tableau: &I::Tableau) -> Self;
    /// Loads an interval into each lane. `given` are start values; `stages` are those of earlier
    /// calls, if all lanes have them, which may be solutions.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    fn load_intervals(
        &mut self,
        intervals: &[&Interval<'_, I::Model, I::Number>],
        given: Option<[&[I::Number]; 2]>,
        stages: Option<&[&[I::Stages]; MAX_LANES]>,
        reuses_solutions: bool,
    ) -> Result<(), Error>;
    /// Copies the stages of a lane in the last call.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    fn copy_stages(&mut self, lane: usize, to: &mut [I::Stages]) -> Result<(), Error>;
    /// Returns the statistics of the last call.
    fn statistics(&self) -> Statistics;

    fn solve(&mut self) -> MaskedResult<'_, E, Nominal<I::Model, E>>;
    fn forward(&mut self) -> MaskedResult<'_, E, Forward<I::Model, E>>;
    fn adjoint(&mut self) -> MaskedResult<'_, E, Adjoint<I::Model, E>>;
    fn forward_adjoint(&mut self) -> MaskedResult<'_, E, ForwardAdjoint<I::Model, E>>;
    fn hessian(&mut self) -> MaskedResult<'_, E, Hessian<I::Model, E>>;
}

/// The group of integrators without groups ([`Single::SUPPORTS_GROUPS`]), which is never called.
pub struct NoGroup;

impl<I: Single, E: Lanes> Group<I, E> for NoGroup {
    fn new(_: &Options, _: &I::Tableau) -> Self {
        Self
    }

    fn load_intervals(
        &mut self,
        _: &[&Interval<'_, I::Model, I::Number>],
        _: Option<[&[I::Number]; 2]>,
        _: Option<&[&[I::Stages]; MAX_LANES]>,
        _: bool,
    ) -> Result<(), Error> {
        Err(Error::NoResult)
    }

    fn copy_stages(&mut self, _: usize, _: &mut [I::Stages]) -> Result<(), Error> {
        Err(Error::NoResult)
    }

    fn statistics(&self) -> Statistics {
        Statistics::default()
    }

    fn solve(&mut self) -> MaskedResult<'_, E, Nominal<I::Model, E>> {
        Err(Error::NoResult)
    }

    fn forward(&mut self) -> MaskedResult<'_, E, Forward<I::Model, E>> {
        Err(Error::NoResult)
    }

    fn adjoint(&mut self) -> MaskedResult<'_, E, Adjoint<I::Model, E>> {
        Err(Error::NoResult)
    }

    fn forward_adjoint(&mut self) -> MaskedResult<'_, E, ForwardAdjoint<I::Model, E>> {
        Err(Error::NoResult)
    }

    fn hessian(&mut self) -> MaskedResult<'_, E, Hessian<I::Model, E>> {
        Err(Error::NoResult)
    }
}

/// Gathers numbers of all intervals into SIMD lanes.
pub fn gather<M: Dae, T: Plain, E: Lanes<Cell: AsMut<[T]>>>(
    intervals: &[&Interval<'_, M, T>],
    to: &mut [E],
    field: impl for<'i> Fn(&'i Interval<'_, M, T>) -> &'i [T],
) {
    if to.is_empty() {
        return;
    }
    let mut from: [&[T]; MAX_LANES] = [&[]; MAX_LANES];
    for (from, interval) in from.iter_mut().zip(intervals) {
        *from = field(interval);
    }
    pack(&from, to);
}
