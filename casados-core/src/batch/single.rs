//! What integrates intervals: one of them alone, and several side by side.

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

/// An integrator that a batch is made of: [`Irk`](crate::Irk) and [`Erk`](crate::Erk) with memory
/// on the heap. It integrates intervals one at a time, and knows what integrates several at once.
///
/// Its methods are for the batch.
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
    /// The tableau of a method.
    type Tableau: Copy + Send + Sync;
    /// What is remembered of a step.
    #[doc(hidden)]
    type Stages: Plain;
    /// What integrates several intervals side by side, one in each lane.
    #[doc(hidden)]
    type Group<E: Lanes<Cell: AsRef<[Self::Number]> + AsMut<[Self::Number]>>>: Group<Self, E>;

    /// Whether stages are found by iterations: then start values matter, and those that were found
    /// before.
    #[doc(hidden)]
    const IS_ITERATIVE: bool;
    /// Whether there are groups.
    #[doc(hidden)]
    const SUPPORTS_GROUPS: bool;

    /// An integrator with a tableau.
    ///
    /// # Errors
    /// [`Error::InvalidOption`], and those of a tableau that does not fit.
    #[doc(hidden)]
    fn of(options: &Options, tableau: &Self::Tableau) -> Result<Self, Error>;
    /// Bytes that are fetched again and again of a group: with so many columns of derivatives.
    #[doc(hidden)]
    fn working_set<E: Lanes>(options: &Options, columns: usize) -> usize;

    /// Start values `ẋ` and `z`.
    ///
    /// # Errors
    /// Those of the setter.
    #[doc(hidden)]
    fn give(&mut self, given: [&[Self::Number]; 2]) -> Result<(), Error>;
    /// Where stages begin: at those of an earlier call, which may be solutions; or anew.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    #[doc(hidden)]
    fn start(&mut self, stages: Option<&[Self::Stages]>, reuses_solutions: bool) -> Result<(), Error>;
    /// The stages of the last call.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    #[doc(hidden)]
    fn stages(&mut self, to: &mut [Self::Stages]) -> Result<(), Error>;

    /// Derivatives, where they belong.
    ///
    /// # Errors
    /// Those of a single call.
    #[doc(hidden)]
    fn forward_to(
        &mut self,
        at: &IntervalOf<'_, Self>,
        to: &mut Forward<Self::Model, Self::Number>,
    ) -> Result<(), Error>;
    /// The same with gradients.
    ///
    /// # Errors
    /// Those of a single call.
    #[doc(hidden)]
    fn forward_adjoint_to(
        &mut self,
        at: &IntervalOf<'_, Self>,
        to: &mut ForwardAdjoint<Self::Model, Self::Number>,
    ) -> Result<(), Error>;
    /// The same with second derivatives.
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
    /// That one.
    const TABLEAU: Self::Tableau;
}

/// What integrates several intervals side by side.
pub trait Group<I: Single, E: Lanes>: Any + Send + Sync {
    fn new(options: &Options, tableau: &I::Tableau) -> Self;
    /// Puts an interval into each lane; `given` are start values, and `stages` those of earlier
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
    /// The stages of a lane in the last call.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    fn copy_stages(&mut self, lane: usize, to: &mut [I::Stages]) -> Result<(), Error>;
    /// What the last call did.
    fn statistics(&self) -> Statistics;

    fn solve(&mut self) -> MaskedResult<'_, E, Nominal<I::Model, E>>;
    fn forward(&mut self) -> MaskedResult<'_, E, Forward<I::Model, E>>;
    fn adjoint(&mut self) -> MaskedResult<'_, E, Adjoint<I::Model, E>>;
    fn forward_adjoint(&mut self) -> MaskedResult<'_, E, ForwardAdjoint<I::Model, E>>;
    fn hessian(&mut self) -> MaskedResult<'_, E, Hessian<I::Model, E>>;
}

/// The group of integrators that take one interval after the other ([`Single::SUPPORTS_GROUPS`]): nobody
/// asks it for anything.
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

/// Numbers of each interval, in the lanes of registers.
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
