//! Memory on the heap, allocated and zeroed at its first use.

use super::{
    Fallback, Family, Memory, Stored, WithAdjoint, WithDirectional, WithForward, WithHessian, fallback,
    sealed,
};
use crate::error::Error;
use alloc::boxed::Box;
use alloc::vec::Vec;
use bytemuck::Zeroable;
use bytemuck::allocation::{try_zeroed_box, try_zeroed_slice_box};
use core::any::Any;
use core::marker::PhantomData;

/// Memory on the heap, allocated at its first use, with the [`fallback`] of implicit integrators.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// // What integrators have if nothing is said: memory of derivatives is there once they are asked
/// // for.
/// let mut irk = Irk::<Cart, Gauss<2>, f64, Heap>::new(Options::default())?;
/// irk.reserve_forward()?; // now, and not in the first call
/// assert!((irk.forward(&vector![0.0, 0.0], &vector![2.0], 1.0)?.x[0] - 1.0).abs() < 1e-14);
/// // Without a fallback.
/// use casados::memory::Refusing;
/// let mut lean = Irk::<Cart, Gauss<2>, f64, Heap<Refusing>>::new(Options::default())?;
/// assert!((lean.solve(&vector![0.0, 0.0], &vector![2.0], 1.0)?.x[0] - 1.0).abs() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Heap<F = fallback::Pivoting>(PhantomData<fn() -> F>);

/// Memory on the heap for integrators whose kernels are shared by all models: kernels read the
/// structure of the model at run time. A program compiles them once for each method and number
/// type, instead of once for each model. Loops over the structure are not unrolled, so that calls
/// take longer. Results and errors are those of [`Heap`] up to rounding.
///
/// It is intended for debug builds and tests, and for programs with many models; see the chapter on
/// performance of the guide.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// use casados::memory::Shared;
/// let mut irk = Irk::<Cart, Gauss<2>, f64, Shared>::new(Options::default())?;
/// let step = irk.forward(&vector![0.0, 1.0], &vector![2.0], 0.5)?;
/// // Of polynomials the method is exact: x₊ = (x + v h + u h²/2, v + u h).
/// assert!((step.x - vector![0.75, 2.0]).norm() < 1e-14);
/// assert!((step.dx_du - vector![0.125, 0.5]).norm() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
pub type Shared = Heap<fallback::RunTime>;

/// A value on the heap.
#[derive(Debug)]
pub struct Allocated<V>(Option<Box<V>>);

/// Values on the heap, one for each step.
#[derive(Debug)]
pub struct AllocatedTape<V>(Option<Box<[V]>>);

/// Values on the heap, one of each requested type: types differ in the number of seeds.
#[derive(Debug, Default)]
pub struct AllocatedByType(Vec<Box<dyn Any + Send + Sync>>);

impl<V> Default for Allocated<V> {
    fn default() -> Self {
        Self(None)
    }
}
impl<V> Default for AllocatedTape<V> {
    fn default() -> Self {
        Self(None)
    }
}

/// Allocates a value whose bytes are zero.
pub(crate) fn allocate<V: Zeroable>() -> Result<Box<V>, Error> {
    try_zeroed_box().map_err(|()| Error::OutOfMemory { bytes: size_of::<V>() })
}

/// Appends an element to a list.
pub(crate) fn push<V>(list: &mut Vec<V>, value: V) -> Result<(), Error> {
    list.try_reserve(1).map_err(|_| Error::OutOfMemory { bytes: size_of::<V>() })?;
    list.push(value);
    Ok(())
}

/// Appends elements to a list.
pub(crate) fn extend<V: Copy>(list: &mut Vec<V>, values: &[V]) -> Result<(), Error> {
    list.try_reserve(values.len()).map_err(|_| Error::OutOfMemory { bytes: size_of_val(values) })?;
    list.extend_from_slice(values);
    Ok(())
}

impl<V: Stored> Allocated<V> {
    fn get_or_allocate(&mut self) -> Result<&mut V, Error> {
        if self.0.is_none() {
            self.0 = Some(allocate()?);
        }
        self.0.as_deref_mut().ok_or(Error::OutOfMemory { bytes: size_of::<V>() })
    }
}

impl<V> Allocated<V> {
    /// Returns the value, if it was allocated.
    pub(crate) fn get(&self) -> Option<&V> {
        self.0.as_deref()
    }
}

impl<V: Stored> AllocatedTape<V> {
    fn get_or_allocate(&mut self, steps: usize) -> Result<&mut [V], Error> {
        let error = Error::OutOfMemory { bytes: steps.saturating_mul(size_of::<V>()) };
        if self.0.is_none() {
            self.0 = Some(try_zeroed_slice_box(steps).map_err(|()| error)?);
        }
        self.0.as_deref_mut().ok_or(error)
    }
}

impl AllocatedByType {
    fn get_or_allocate<V: Stored>(&mut self) -> Result<&mut V, Error> {
        let error = Error::OutOfMemory { bytes: size_of::<V>() };
        let index = match self.0.iter().position(|value| (**value).is::<V>()) {
            Some(index) => index,
            None => {
                let value: Box<V> = allocate()?;
                self.0.try_reserve(1).map_err(|_| error)?;
                self.0.push(value);
                self.0.len() - 1
            }
        };
        self.0.get_mut(index).and_then(|value| value.downcast_mut()).ok_or(error)
    }
}

impl<F> sealed::Sealed for Heap<F> {}

impl<F: Fallback> Memory for Heap<F> {
    type Nominal<V: Stored> = Allocated<V>;
    type Tape<V: Stored> = AllocatedTape<V>;
    type Forward<V: Stored> = Allocated<V>;
    type Directional<V: Family> = AllocatedByType;
    type Adjoint<V: Family> = AllocatedByType;
    type Hessian<V: Stored> = Allocated<V>;
    type HessianTape<V: Stored> = AllocatedTape<V>;
    type Fallback = F;
    const STEPS: usize = usize::MAX;
    fn nominal<V: Stored>(place: &mut Allocated<V>) -> Result<&mut V, Error> {
        place.get_or_allocate()
    }
    fn tape<V: Stored>(place: &mut AllocatedTape<V>, steps: usize) -> Result<&mut [V], Error> {
        place.get_or_allocate(steps)
    }
}
impl<F: Fallback> WithForward for Heap<F> {
    fn forward<V: Stored>(place: &mut Allocated<V>) -> Result<&mut V, Error> {
        place.get_or_allocate()
    }
}
impl<F: Fallback, const C: usize> WithDirectional<C> for Heap<F> {
    fn directional<V: Family>(place: &mut AllocatedByType) -> Result<&mut V::Of<C>, Error> {
        place.get_or_allocate()
    }
}
impl<F: Fallback, const C: usize> WithAdjoint<C> for Heap<F> {
    fn adjoint<V: Family>(place: &mut AllocatedByType) -> Result<&mut V::Of<C>, Error> {
        place.get_or_allocate()
    }
}
impl<F: Fallback> WithHessian for Heap<F> {
    fn hessian<V: Stored>(place: &mut Allocated<V>) -> Result<&mut V, Error> {
        place.get_or_allocate()
    }
    fn hessian_tape<V: Stored>(place: &mut AllocatedTape<V>, steps: usize) -> Result<&mut [V], Error> {
        place.get_or_allocate(steps)
    }
}
