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
    pub const fn new() -> Self {
        Self { value: UnsafeCell::new(MaybeUninit::uninit()), taken: AtomicBool::new(false) }
    }

    /// The value, in its place; none if there is one already.
    pub fn set(&'static self, value: T) -> Option<&'static mut T> {
        if self.taken.swap(true, Ordering::Relaxed) {
            return None;
        }
        // SAFETY: see above: this is the only reference that there will be.
        Some(unsafe { (*self.value.get()).write(value) })
    }
}

impl<T> Default for Static<T> {
    fn default() -> Self {
        Self::new()
    }
}
