//! What an implicit integrator does where the planned elimination is not good enough.

use super::{Absent, Inside, Stored, sealed};
use crate::model::Dae;
#[cfg(feature = "alloc")]
use crate::plan::ModelTable;
use crate::plan::{Known, PlanOf};

/// It pivots the whole matrix. With three stages or more it has memory for the shared Jacobian of
/// the stages too, which Newton's method takes where iterations are not fixed.
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

/// It returns [`Error::NotPivoted`](crate::Error::NotPivoted), and the time of a call has no
/// other worst case than the usual one. Neither the whole matrix nor the shared Jacobian of the
/// stages has any memory or any code: for firmware with fixed iterations.
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

/// [`Pivoting`], in an integrator of one step with the options that are those by default: it has no
/// code for other steps and options.
#[cfg(feature = "alloc")]
#[derive(Clone, Copy, Debug)]
pub(crate) struct OneStep;

/// [`Pivoting`], by kernels whose plans are bound when they run: they are compiled once for all
/// models ([`Shared`](super::Shared)).
#[cfg(feature = "alloc")]
#[derive(Clone, Copy, Debug)]
pub struct RunTime;

/// [`Pivoting`], [`Refusing`] or `RunTime`.
pub trait Fallback: sealed::Sealed + 'static {
    /// A place for what only the fallback needs.
    type Place<V: Stored>: OptionalPlace<V>;
    /// Whether there is one.
    const HAS_MEMORY: bool;
    /// What kernels know of a model.
    type Plan<M: Dae>: PlanOf<M>;
    /// The plan of a model.
    fn plan<M: Dae>() -> Self::Plan<M>;
    /// Whether intervals may have several steps, and any options.
    #[doc(hidden)]
    const INTERVALS: bool = true;
}

/// A place that has a value, or has none.
pub trait OptionalPlace<V>: Stored {
    /// The value.
    fn get(&self) -> Option<&V>;
    /// The value, to be written.
    fn get_mut(&mut self) -> Option<&mut V>;
}

/// Plans that are known when kernels are compiled.
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
