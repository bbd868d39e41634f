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

    #[allow(clippy::mut_from_ref, reason = "there is one call that gets it")]
    fn place(&'static self) -> Option<&'static mut MaybeUninit<T>> {
        if self.taken.swap(true, Ordering::Relaxed) {
            return None;
        }
        // SAFETY: see above: this is the only reference that there will be.
        Some(unsafe { &mut *self.value.get() })
    }
}

/// All that a controller is made of: numbers and indices that it points to, and itself.
pub struct Whole<T, const NUMBERS: usize, const INDICES: usize, C> {
    numbers: [T; NUMBERS],
    indices: [u32; INDICES],
    controller: MaybeUninit<C>,
}

/// The parts of a [`Whole`].
pub type Parts<T, C> = (&'static mut [T], &'static mut [u32], &'static mut MaybeUninit<C>);

impl<T: Copy, const NUMBERS: usize, const INDICES: usize, C> Static<Whole<T, NUMBERS, INDICES, C>> {
    /// Zeros, written where they are to be, for they may be more than the stack holds, and a place.
    pub fn parts(&'static self, zero: T) -> Option<Parts<T, C>> {
        let place = self.place()?.as_mut_ptr();
        // SAFETY: the fields of a place are places, and no other reference to them is there.
        let (numbers, indices, controller) = unsafe {
            (
                &mut *(&raw mut (*place).numbers).cast::<[MaybeUninit<T>; NUMBERS]>(),
                &mut *(&raw mut (*place).indices).cast::<[MaybeUninit<u32>; INDICES]>(),
                &mut (*place).controller,
            )
        };
        Some((fill(numbers, zero), fill(indices, 0), controller))
    }
}

fn fill<T: Copy>(places: &mut [MaybeUninit<T>], value: T) -> &mut [T] {
    for place in places.iter_mut() {
        place.write(value);
    }
    // SAFETY: all are written.
    unsafe { core::slice::from_raw_parts_mut(places.as_mut_ptr().cast::<T>(), places.len()) }
}

impl<T> Default for Static<T> {
    fn default() -> Self {
        Self::new()
    }
}
