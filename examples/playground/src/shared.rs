//! What Rust and the page have in common: lists of numbers in place, a message, a clock.

use std::fmt::Display;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Something that there is one of, in a program that has one thread.
pub struct One<T>(Mutex<T>);

impl<T> One<T> {
    /// From the start of the program on.
    pub const fn new(value: T) -> Self {
        Self(Mutex::new(value))
    }
    /// Until the guard is dropped.
    pub fn get(&self) -> MutexGuard<'_, T> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<const N: usize> One<[f64; N]> {
    /// Where the numbers are. The page reads and writes them while no function runs.
    pub fn place(&self) -> *mut f64 {
        self.get().as_mut_ptr()
    }
}

#[cfg(target_arch = "wasm32")]
#[link(wasm_import_module = "page")]
unsafe extern "C" {
    /// Milliseconds.
    pub safe fn now() -> f64;
    /// An iteration of the interior point: its number, objective, and residual.
    pub safe fn iterated(iteration: f64, objective: f64, residual: f64);
}

/// Milliseconds.
#[cfg(not(target_arch = "wasm32"))]
pub fn now() -> f64 {
    static BEGIN: std::sync::LazyLock<std::time::Instant> = std::sync::LazyLock::new(std::time::Instant::now);
    BEGIN.elapsed().as_secs_f64() * 1e3
}

/// Nobody looks.
#[cfg(not(target_arch = "wasm32"))]
pub fn iterated(_iteration: f64, _objective: f64, _residual: f64) {}

static MESSAGE: One<String> = One::new(String::new());

/// Zero, or one with a message.
pub fn outcome<E: Display>(result: Result<(), E>) -> u32 {
    match result {
        Ok(()) => 0,
        Err(error) => {
            *MESSAGE.get() = error.to_string();
            1
        }
    }
}

/// Where the last message is, in UTF-8.
#[unsafe(no_mangle)]
pub extern "C" fn message() -> *const u8 {
    MESSAGE.get().as_ptr()
}

/// Its length in bytes.
#[unsafe(no_mangle)]
pub extern "C" fn message_length() -> usize {
    MESSAGE.get().len()
}
