//! The fallback of implicit integrators if the planned elimination is too inaccurate.

use super::{Absent, Inside, Stored, sealed};
use crate::model::Dae;
#[cfg(feature = "alloc")]
use crate::plan::ModelTable;
use crate::plan::{Known, PlanOf};

/// Pivots the whole matrix. With three stages or more, its memory also holds the factors of the
/// shared Jacobian, which Newton's method uses unless the number of iterations is fixed.
///
/// ```
/// # use casados::prelude::*;
/// # use casados::{memory::Pivoting, mode};
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// // It is the default.
/// type Written = Irk<Cart, Gauss<4>, f64, Inline<mode::Forward, 1, Pivoting>>;
/// type Short = Irk<Cart, Gauss<4>, f64, Inline<mode::Forward>>;
/// assert_eq!(Written::SIZE, Short::SIZE);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Pivoting;

/// Returns [`Error::NotPivoted`](crate::Error::NotPivoted), so that the worst case of the time of a
/// call is the usual case. There is no memory and no code for the whole matrix or the shared
/// Jacobian: for firmware with fixed iterations.
///
/// ```
/// # use casados_core::{Dae, Error, Gauss, Inline, Irk, memory::fallback, mode};
/// type Whole<M> = Irk<M, Gauss<4>, f64, Inline<mode::Forward>>;
/// type Lean<M> = Irk<M, Gauss<4>, f64, Inline<mode::Forward, 1, fallback::Refusing>>;
/// fn saved<M: Dae>() -> usize {
///     Whole::<M>::SIZE - Lean::<M>::SIZE
/// }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Refusing;

/// [`Pivoting`], for integrators of one step with default options: there is no code for other
/// numbers of steps or options.
#[cfg(feature = "alloc")]
#[derive(Clone, Copy, Debug)]
pub(crate) struct OneStep;

/// [`Pivoting`], with kernels that take their plans at run time and are compiled once for all
/// models ([`Shared`](super::Shared)).
#[cfg(feature = "alloc")]
#[derive(Clone, Copy, Debug)]
pub struct RunTime;

/// The fallback: [`Pivoting`], [`Refusing`] or `RunTime`.
pub trait Fallback: sealed::Sealed + 'static {
    /// Memory of the fallback.
    type Place<V: Stored>: OptionalPlace<V>;
    /// Whether there is such memory.
    const HAS_MEMORY: bool;
    /// The plan type of kernels.
    type Plan<M: Dae>: PlanOf<M>;
    /// Returns the plan of a model.
    fn plan<M: Dae>() -> Self::Plan<M>;
    /// Whether intervals may have several steps, with any options.
    #[doc(hidden)]
    const INTERVALS: bool = true;
}

/// Memory with or without a value.
pub trait OptionalPlace<V>: Stored {
    /// Returns the value.
    fn get(&self) -> Option<&V>;
    /// Returns the value for writing.
    fn get_mut(&mut self) -> Option<&mut V>;
}

/// Plans that are known at compile time.
macro_rules! known {
    () => {
        type Plan<M: Dae> = Known<M>;
        #[inline(always)]
        fn plan<M: Dae>() -> Known<M> {
            Known::PLAN
        }
    };
}

impl sealed::Sealed for Pivoting {}
impl Fallback for Pivoting {
    type Place<V: Stored> = Inside<V>;
    const HAS_MEMORY: bool = true;
    known!();
}
impl sealed::Sealed for Refusing {}
impl Fallback for Refusing {
    type Place<V: Stored> = Absent;
    const HAS_MEMORY: bool = false;
    known!();
}

#[cfg(feature = "alloc")]
impl sealed::Sealed for OneStep {}
#[cfg(feature = "alloc")]
impl Fallback for OneStep {
    type Place<V: Stored> = Inside<V>;
    const HAS_MEMORY: bool = true;
    known!();
    const INTERVALS: bool = false;
}

#[cfg(feature = "alloc")]
impl sealed::Sealed for RunTime {}
#[cfg(feature = "alloc")]
impl Fallback for RunTime {
    type Place<V: Stored> = Inside<V>;
    const HAS_MEMORY: bool = true;
    type Plan<M: Dae> = &'static ModelTable;
    #[inline(always)]
    fn plan<M: Dae>() -> &'static ModelTable {
        const { &ModelTable::of(&M::STRUCTURE) }
    }
}

impl<V: Stored> OptionalPlace<V> for Inside<V> {
    #[inline(always)]
    fn get(&self) -> Option<&V> {
        Some(&self.0)
    }
    #[inline(always)]
    fn get_mut(&mut self) -> Option<&mut V> {
        Some(&mut self.0)
    }
}
impl<V> OptionalPlace<V> for Absent {
    #[inline(always)]
    fn get(&self) -> Option<&V> {
        None
    }
    #[inline(always)]
    fn get_mut(&mut self) -> Option<&mut V> {
        None
    }
}
