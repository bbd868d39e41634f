//! Memory of a mode: born zeroed when the mode is first called.

use crate::error::Error;
use alloc::boxed::Box;
use bytemuck::Zeroable;
use bytemuck::allocation::{try_zeroed_box, try_zeroed_slice_box};

/// One value.
pub(super) struct Slot<X>(Option<Box<X>>);

impl<X: Zeroable> Slot<X> {
    pub const fn empty() -> Self {
        Self(None)
    }

    /// The value; `start` sees it when it is new.
    pub fn get(&mut self, start: impl FnOnce(&mut X)) -> Result<&mut X, Error> {
        if self.0.is_none() {
            let mut value =
                try_zeroed_box::<X>().map_err(|()| Error::OutOfMemory { bytes: size_of::<X>() })?;
            start(&mut value);
            self.0 = Some(value);
        }
        self.0.as_deref_mut().ok_or(Error::NoResult)
    }

    pub fn peek(&self) -> Option<&X> {
        self.0.as_deref()
    }
}

/// One value per step.
pub(super) struct List<X>(Box<[X]>);

impl<X: Zeroable> List<X> {
    pub fn empty() -> Self {
        Self(Box::new([]))
    }

    pub fn get(&mut self, length: usize) -> Result<&mut [X], Error> {
        if self.0.len() != length {
            let bytes = size_of::<X>().saturating_mul(length);
            self.0 = try_zeroed_slice_box(length).map_err(|()| Error::OutOfMemory { bytes })?;
        }
        Ok(&mut self.0)
    }
}
