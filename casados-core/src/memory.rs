//! The memory of integrators.
//!
//! - [`Heap`] (feature `alloc`): the memory of a mode (forward, adjoint, ...) is allocated and
//!   zeroed by the first call of that mode, or when it is reserved; later calls do not allocate.
//!   Large models do not use the stack.
//! - [`Inline`]: all memory is inside the integrator, for one mode, which is part of the type, and
//!   at most `STEPS` steps. A call of another mode does not compile:
//!
//! ```
//! # use casados_core::{Dae, Error, Gauss, Inline, Irk, mode, model::{VectorU, VectorX}};
//! type Small<M, Mode> = Irk<M, Gauss<2>, f64, Inline<Mode>>;
//! fn f<M: Dae>(irk: &mut Small<M, mode::Forward>, x: &VectorX<M, f64>, u: &VectorU<M, f64>) -> Result<(), Error> {
//!     irk.solve(x, u, 0.1)?;
//!     irk.forward(x, u, 0.1)?;
//!     Ok(())
//! }
//! ```
//!
//! ```compile_fail,E0277
//! # use casados_core::{Dae, Error, Gauss, Inline, Irk, mode, model::{VectorU, VectorX}};
//! type Small<M, Mode> = Irk<M, Gauss<2>, f64, Inline<Mode>>;
//! fn f<M: Dae>(irk: &mut Small<M, mode::Nominal>, x: &VectorX<M, f64>, u: &VectorU<M, f64>) -> Result<(), Error> {
//!     irk.solve(x, u, 0.1)?;
//!     irk.forward(x, u, 0.1)?; // no memory for sensitivities
//!     Ok(())
//! }
//! ```

pub mod fallback;
#[cfg(feature = "alloc")]
mod heap;
pub mod mode;

pub use fallback::{Fallback, OptionalPlace};
#[cfg(feature = "alloc")]
pub use heap::{Allocated, AllocatedByType, AllocatedTape, Heap, Shared};
#[cfg(feature = "alloc")]
pub(crate) use heap::{allocate, extend, push};

use crate::error::Error;
use bytemuck::Zeroable;
use core::marker::PhantomData;

/// A type that memory can hold.
pub trait Stored: Zeroable + Send + Sync + 'static {}
impl<V: Zeroable + Send + Sync + 'static> Stored for V {}

/// A family of types with a number of columns (seeds or directions), one type for each number.
pub trait Family: 'static {
    /// The type for `C` columns.
    type Of<const C: usize>: Stored;
}

mod sealed {
    pub trait Sealed {}
}

/// The memory of an integrator: [`Heap`] or [`Inline`].
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # use casados::{memory::Memory, mode};
/// /// Works in any memory that has a place for it.
/// fn position<W: Memory>(irk: &mut Irk<Cart, Gauss<2>, f64, W>) -> Result<f64, Error> {
///     Ok(irk.solve(&vector![0.0, 0.0], &vector![2.0], 1.0)?.x[0])
/// }
///
/// let (mut heap, mut inline) = (
///     Irk::<Cart, Gauss<2>>::new(Options::default())?,
///     Irk::<Cart, Gauss<2>, f64, Inline<mode::Nominal>>::inline(Options::default())?,
/// );
/// assert_eq!(position(&mut heap)?, position(&mut inline)?);
/// # Ok::<(), casados::Error>(())
/// ```
pub trait Memory: sealed::Sealed + 'static {
    /// Memory of all calls.
    type Nominal<V: Stored>: Default + Send + Sync;
    /// Memory of the steps.
    type Tape<V: Stored>: Default + Send + Sync;
    /// Memory of forward sensitivities.
    type Forward<V: Stored>: Default + Send + Sync;
    /// Memory of forward sensitivities in given directions.
    type Directional<V: Family>: Default + Send + Sync;
    /// Memory of adjoint sensitivities.
    type Adjoint<V: Family>: Default + Send + Sync;
    /// Memory of second-order sensitivities.
    type Hessian<V: Stored>: Default + Send + Sync;
    /// Memory of the steps for second-order sensitivities.
    type HessianTape<V: Stored>: Default + Send + Sync;

    /// The fallback if the planned elimination is too inaccurate.
    type Fallback: Fallback;

    /// The maximal number of steps.
    const STEPS: usize;

    /// Returns the memory of all calls.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    fn nominal<V: Stored>(place: &mut Self::Nominal<V>) -> Result<&mut V, Error>;
    /// Returns the memory of the steps.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    fn tape<V: Stored>(place: &mut Self::Tape<V>, steps: usize) -> Result<&mut [V], Error>;
}

/// Memory with forward sensitivities.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # use casados::{memory::WithForward, mode};
/// /// Works in any memory that has a place for it.
/// fn gain<W: WithForward>(irk: &mut Irk<Cart, Gauss<2>, f64, W>) -> Result<f64, Error> {
///     Ok(irk.forward(&vector![0.0, 0.0], &vector![2.0], 1.0)?.dx_du[0])
/// }
///
/// let (mut heap, mut inline) = (
///     Irk::<Cart, Gauss<2>>::new(Options::default())?,
///     Irk::<Cart, Gauss<2>, f64, Inline<mode::Forward>>::inline(Options::default())?,
/// );
/// assert_eq!(gain(&mut heap)?, gain(&mut inline)?);
/// # Ok::<(), casados::Error>(())
/// ```
#[diagnostic::on_unimplemented(
    message = "this memory has no place for forward sensitivities",
    note = "use `Heap`, `Inline<mode::Forward>` or `Inline<mode::Hessian>`"
)]
pub trait WithForward: Memory {
    /// Returns the memory.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    fn forward<V: Stored>(place: &mut Self::Forward<V>) -> Result<&mut V, Error>;
}

/// Memory with `C` directions.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # use casados::memory::WithDirectional;
/// /// What a force does to the velocity in a second, as one direction.
/// fn gain<W: WithDirectional<1>>(irk: &mut Irk<Cart, Gauss<2>, f64, W>) -> Result<f64, Error> {
///     let seeds = Seeds { u: SMatrix::<f64, 1, 1>::identity(), ..Default::default() };
///     Ok(irk.directional(&vector![0.0, 0.0], &vector![2.0], 1.0, &seeds)?.dx[1])
/// }
/// let mut irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
/// assert!((gain(&mut irk)? - 1.0).abs() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
#[diagnostic::on_unimplemented(
    message = "this memory has no place for {C} directions",
    note = "use `Heap` or `Inline<mode::Directional<{C}>>`"
)]
pub trait WithDirectional<const C: usize>: Memory {
    /// Returns the memory.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    fn directional<V: Family>(place: &mut Self::Directional<V>) -> Result<&mut V::Of<C>, Error>;
}

/// Memory with the adjoint of `C` seeds.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # use casados::{memory::WithAdjoint, mode};
/// /// Works in any memory that has a place for it.
/// fn slope<W: WithAdjoint<1>>(irk: &mut Irk<Cart, Gauss<2>, f64, W>) -> Result<f64, Error> {
///     Ok(irk.adjoint(&vector![0.0, 0.0], &vector![2.0], 1.0, &vector![1.0, 0.0])?.grad_u[0])
/// }
///
/// let (mut heap, mut inline) = (
///     Irk::<Cart, Gauss<2>>::new(Options::default())?,
///     Irk::<Cart, Gauss<2>, f64, Inline<mode::Adjoint>>::inline(Options::default())?,
/// );
/// assert_eq!(slope(&mut heap)?, slope(&mut inline)?);
/// # Ok::<(), casados::Error>(())
/// ```
#[diagnostic::on_unimplemented(
    message = "this memory has no place for the adjoint of {C} seeds",
    note = "use `Heap` or `Inline<mode::Adjoint<{C}>>`"
)]
pub trait WithAdjoint<const C: usize>: Memory {
    /// Returns the memory.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    fn adjoint<V: Family>(place: &mut Self::Adjoint<V>) -> Result<&mut V::Of<C>, Error>;
}

/// Memory with second-order sensitivities.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # use casados::{memory::WithHessian, mode};
/// /// Works in any memory that has a place for it.
/// fn bend<W: WithHessian>(irk: &mut Irk<Cart, Gauss<2>, f64, W>) -> Result<f64, Error> {
///     Ok(irk.hessian(&vector![0.0, 0.0], &vector![2.0], 1.0, &vector![1.0, 0.0])?.h_uu[0])
/// }
///
/// let (mut heap, mut inline) = (
///     Irk::<Cart, Gauss<2>>::new(Options::default())?,
///     Irk::<Cart, Gauss<2>, f64, Inline<mode::Hessian>>::inline(Options::default())?,
/// );
/// assert_eq!(bend(&mut heap)?, bend(&mut inline)?);
/// # Ok::<(), casados::Error>(())
/// ```
#[diagnostic::on_unimplemented(
    message = "this memory has no place for second-order sensitivities",
    note = "use `Heap` or `Inline<mode::Hessian>`"
)]
pub trait WithHessian: WithForward {
    /// Returns the memory.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    fn hessian<V: Stored>(place: &mut Self::Hessian<V>) -> Result<&mut V, Error>;
    /// Returns the memory of the steps.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    fn hessian_tape<V: Stored>(place: &mut Self::HessianTape<V>, steps: usize) -> Result<&mut [V], Error>;
}

/// The absence of memory.
#[derive(Clone, Copy, Debug, Default, Zeroable)]
pub struct Absent;

/// A value inside the integrator.
#[derive(Clone, Copy, Debug, Zeroable)]
pub struct Inside<V>(V);

impl<V: Zeroable> Default for Inside<V> {
    fn default() -> Self {
        Self(V::zeroed())
    }
}

/// Memory inside the integrator, for the calls of one [`mode`] and at most `STEPS` steps, with or
/// without the memory of a [`fallback`].
///
/// The constant `SIZE` of an integrator is its total memory in bytes. For a pendulum on a cart
/// (four states, a control) in `f64` on a 32-bit processor:
///
/// | integrator | [`mode::Nominal`] | [`mode::Forward`] | [`mode::Adjoint`] | [`mode::Hessian`] |
/// |---|---|---|---|---|
/// | `Irk`, `Gauss<2>` | 2632 | 4104 | 2952 | 8112 |
/// | `Erk`, `Rk4` | 1344 | 2912 | 1344 | 3872 |
///
/// For other models, define a public constant equal to `SIZE`: `cargo doc` prints its value for the
/// given target.
///
/// ```
/// use casados::prelude::*;
/// use casados::{Inline, mode};
/// use nalgebra::vector;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
///
/// type Predictor = Irk<Cart, Gauss<2>, f32, Inline<mode::Forward, 2>>;
/// const BYTES: usize = Predictor::SIZE;
/// let mut irk = Predictor::inline(Options { steps: 2, ..Default::default() })?;
/// let step = irk.forward(&vector![0.0, 1.0], &vector![2.0], 0.5)?;
/// assert!((step.x - vector![0.75, 2.0]).norm() < 1e-6);
/// assert!(BYTES < 4096);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Inline<Mode, const STEPS: usize = 1, F = fallback::Pivoting>(PhantomData<fn() -> (Mode, F)>);

impl<Mode, const STEPS: usize, F> sealed::Sealed for Inline<Mode, STEPS, F> {}

/// Implements the memory of one mode.
macro_rules! inline {
    ([$($constant:ident)?] $mode:ty {
        forward: $forward:ty, directional: $directional:ty, adjoint: $adjoint:ty, hessian: $hessian:ty, hessian_tape: $tape:ty,
    }) => {
        impl<$(const $constant: usize,)? const STEPS: usize, F: Fallback> Memory for Inline<$mode, STEPS, F> {
            type Fallback = F;
            type Nominal<V: Stored> = Inside<V>;
            type Tape<V: Stored> = Inside<[V; STEPS]>;
            type Forward<V: Stored> = $forward;
            type Directional<V: Family> = $directional;
            type Adjoint<V: Family> = $adjoint;
            type Hessian<V: Stored> = $hessian;
            type HessianTape<V: Stored> = $tape;
            const STEPS: usize = STEPS;
            fn nominal<V: Stored>(place: &mut Inside<V>) -> Result<&mut V, Error> {
                Ok(&mut place.0)
            }
            fn tape<V: Stored>(place: &mut Inside<[V; STEPS]>, steps: usize) -> Result<&mut [V], Error> {
                steps_of(&mut place.0, steps)
            }
        }
    };
}

inline!([] mode::Nominal {
    forward: Absent, directional: Absent, adjoint: Absent, hessian: Absent, hessian_tape: Absent,
});
inline!([] mode::Forward {
    forward: Inside<V>, directional: Absent, adjoint: Absent, hessian: Absent, hessian_tape: Absent,
});
inline!([C] mode::Directional<C> {
    forward: Absent, directional: Inside<V::Of<C>>, adjoint: Absent, hessian: Absent,
    hessian_tape: Absent,
});
inline!([C] mode::Adjoint<C> {
    forward: Absent, directional: Absent, adjoint: Inside<V::Of<C>>, hessian: Absent,
    hessian_tape: Absent,
});
inline!([] mode::Hessian {
    forward: Inside<V>, directional: Absent, adjoint: Absent, hessian: Inside<V>,
    hessian_tape: Inside<[V; STEPS]>,
});

impl<const STEPS: usize, F: Fallback> WithForward for Inline<mode::Forward, STEPS, F> {
    fn forward<V: Stored>(place: &mut Inside<V>) -> Result<&mut V, Error> {
        Ok(&mut place.0)
    }
}
impl<const STEPS: usize, F: Fallback> WithForward for Inline<mode::Hessian, STEPS, F> {
    fn forward<V: Stored>(place: &mut Inside<V>) -> Result<&mut V, Error> {
        Ok(&mut place.0)
    }
}
impl<const C: usize, const STEPS: usize, F: Fallback> WithDirectional<C>
    for Inline<mode::Directional<C>, STEPS, F>
{
    fn directional<V: Family>(place: &mut Self::Directional<V>) -> Result<&mut V::Of<C>, Error> {
        Ok(&mut place.0)
    }
}
impl<const C: usize, const STEPS: usize, F: Fallback> WithAdjoint<C> for Inline<mode::Adjoint<C>, STEPS, F> {
    fn adjoint<V: Family>(place: &mut Self::Adjoint<V>) -> Result<&mut V::Of<C>, Error> {
        Ok(&mut place.0)
    }
}
impl<const STEPS: usize, F: Fallback> WithHessian for Inline<mode::Hessian, STEPS, F> {
    fn hessian<V: Stored>(place: &mut Inside<V>) -> Result<&mut V, Error> {
        Ok(&mut place.0)
    }
    fn hessian_tape<V: Stored>(place: &mut Inside<[V; STEPS]>, steps: usize) -> Result<&mut [V], Error> {
        steps_of(&mut place.0, steps)
    }
}

fn steps_of<V: Stored>(place: &mut [V], steps: usize) -> Result<&mut [V], Error> {
    place.get_mut(..steps).ok_or(Error::OutOfMemory { bytes: steps.saturating_mul(size_of::<V>()) })
}
