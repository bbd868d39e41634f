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

use casados::testing::{Level, limit_cache, limit_level};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The turn of a test. Whatever becomes of it, the next one finds the machine as it is.
struct SerialTest {
    _guard: MutexGuard<'static, ()>,
}

fn serialise() -> SerialTest {
    static TURN: Mutex<()> = Mutex::new(());
    SerialTest { _guard: TURN.lock().unwrap_or_else(PoisonError::into_inner) }
}

impl Drop for SerialTest {
    fn drop(&mut self) {
        limit_level(Level::Avx512);
        limit_cache(0);
    }
}
