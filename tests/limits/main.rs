//! What a process is told about its machine: kinds of registers, size of the cache. They hold for
//! all calls, so that tests take turns, in a process of their own.

#[allow(dead_code)] // Each program takes a part.
#[path = "../../examples/models"]
mod models {
    pub mod chain;
    pub mod pendulum;
}

mod cache;
mod registers;

use casados::testing::{Level, limit, limit_cache};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The turn of a test. Whatever becomes of it, the next one finds the machine as it is.
struct Turn {
    _guard: MutexGuard<'static, ()>,
}

fn turn() -> Turn {
    static TURN: Mutex<()> = Mutex::new(());
    Turn { _guard: TURN.lock().unwrap_or_else(PoisonError::into_inner) }
}

impl Drop for Turn {
    fn drop(&mut self) {
        limit(Level::Avx512);
        limit_cache(0);
    }
}
