//! Memory whose size is known when the program is linked.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, Ordering};

/// A static that is set once. It costs no flash: nothing is in it until then.
pub struct Static<T> {
    value: UnsafeCell<MaybeUninit<T>>,
    taken: AtomicBool,
}

// SAFETY: only the one caller that finds `taken` unset ever touches the value.
unsafe impl<T: Send> Sync for Static<T> {}

impl<T> Static<T> {
    /// With nothing in it.
    pub const fn new() -> Self {
        Self { value: UnsafeCell::new(MaybeUninit::uninit()), taken: AtomicBool::new(false) }
    }

    /// A value, in its place; none the second time.
    pub fn set(&'static self, value: T) -> Option<&'static mut T> {
        Some(self.place()?.write(value))
    }

    fn place(&'static self) -> Option<&'static mut MaybeUninit<T>> {
        if self.taken.swap(true, Ordering::Relaxed) {
            return None;
        }
        // SAFETY: see above: this is the only reference that there will be.
        Some(unsafe { &mut *self.value.get() })
    }
}

impl<T: Copy, const N: usize> Static<[T; N]> {
    /// Copies of a number, written where they are to be: they may be more than the stack holds.
    pub fn fill(&'static self, number: T) -> Option<&'static mut [T]> {
        let place = self.place()?.as_mut_ptr().cast::<MaybeUninit<T>>();
        // SAFETY: an array of places is what the place of an array is, and no other reference to it is there.
        let places = unsafe { core::slice::from_raw_parts_mut(place, N) };
        for place in places.iter_mut() {
            place.write(number);
        }
        // SAFETY: all are written.
        Some(unsafe { core::slice::from_raw_parts_mut(places.as_mut_ptr().cast::<T>(), N) })
    }
}

impl<T> Default for Static<T> {
    fn default() -> Self {
        Self::new()
    }
}
