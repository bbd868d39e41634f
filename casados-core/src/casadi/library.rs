//! The state of a loaded shared library: the client of its functions, and a pool of memories, one
//! for each concurrent thread.

use super::function::{Call, Signature};
use crate::error::Error;
use alloc::boxed::Box;
use alloc::string::{String, ToString};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt::Display;
use core::panic::AssertUnwindSafe;
use std::panic::catch_unwind;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Several functions that share memory.
pub trait FunctionLibrary: Send + Sync + 'static {
    /// The memory of a thread.
    type Worker: Send;
    /// The signatures of all functions.
    fn signatures(&self) -> &[Signature];
    /// Creates the memory of a thread.
    ///
    /// # Errors
    /// Those of the options.
    fn worker(&self) -> Result<Self::Worker, CallFailure>;
    /// Computes the requested outputs of a function.
    ///
    /// # Errors
    /// The outputs are then undefined.
    fn evaluate(
        &self,
        worker: &mut Self::Worker,
        function: usize,
        call: &mut dyn Call,
    ) -> Result<(), CallFailure>;
    /// The number of integrated intervals.
    fn integrations(&self) -> u64;
}

/// The cause of a failed call, as a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CallFailure(pub String);

impl From<Error> for CallFailure {
    fn from(error: Error) -> Self {
        Self(error.to_string())
    }
}

impl CallFailure {
    /// The failure for a memory that is not checked out.
    fn memory(id: i32) -> Self {
        Self(alloc::format!("memory {id} was not checked out, or another call has it"))
    }
}

/// A client that is created on first use, and dropped with its last reference.
#[doc(hidden)]
pub struct Library<C: FunctionLibrary> {
    make: fn() -> Result<C, CallFailure>,
    state: Mutex<State<C>>,
}

struct State<C: FunctionLibrary> {
    references: usize,
    client: Option<Arc<C>>,
    memories: Vec<WorkerSlot<C::Worker>>,
}

/// A memory of the pool.
enum WorkerSlot<W> {
    /// Not checked out.
    Free(Option<Box<W>>),
    /// Checked out.
    Ready(Option<Box<W>>),
    /// In a call.
    Busy,
}

impl<C: FunctionLibrary> Library<C> {
    /// A library whose client is created by `make`.
    pub const fn new(make: fn() -> Result<C, CallFailure>) -> Self {
        Self { make, state: Mutex::new(State { references: 0, client: None, memories: Vec::new() }) }
    }

    /// Locks the state, which is consistent even after a panic, since the code under the lock does
    /// not panic.
    fn state(&self) -> MutexGuard<'_, State<C>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The client; none if it cannot be created.
    pub fn client(&self) -> Option<Arc<C>> {
        if let Some(client) = &self.state().client {
            return Some(Arc::clone(client));
        }
        let made =
            Arc::new(catch_panic(self.make).flatten().map_err(|failure| log_failure(&failure.0)).ok()?);
        Some(Arc::clone(self.state().client.get_or_insert(made)))
    }

    /// Adds a reference to the functions.
    pub fn add_reference(&self) {
        self.state().references += 1;
    }

    /// Removes a reference; the last one drops everything.
    pub fn remove_reference(&self) {
        let mut state = self.state();
        state.references = state.references.saturating_sub(1);
        if state.references == 0 {
            let last = (state.client.take(), core::mem::take(&mut state.memories));
            drop(state);
            drop(last);
        }
    }

    /// Checks a memory out for a caller.
    pub fn check_out(&self) -> Option<i32> {
        let mut state = self.state();
        let free = state.memories.iter().position(|memory| matches!(memory, WorkerSlot::Free(_)));
        let id = free.unwrap_or(state.memories.len());
        let number = i32::try_from(id).ok()?;
        match state.memories.get_mut(id) {
            Some(memory) => {
                let worker = match memory {
                    WorkerSlot::Free(worker) => worker.take(),
                    _ => None,
                };
                *memory = WorkerSlot::Ready(worker);
            }
            None => state.memories.push(WorkerSlot::Ready(None)),
        }
        Some(number)
    }

    /// Returns a memory to the pool; one in a call returns at its end.
    pub fn release(&self, id: i32) {
        let mut state = self.state();
        let memory = usize::try_from(id).ok().and_then(|id| state.memories.get_mut(id));
        if let Some(memory) = memory
            && let WorkerSlot::Ready(worker) = memory
        {
            *memory = WorkerSlot::Free(worker.take());
        }
    }

    /// Begins a call, which holds the memory until its end.
    ///
    /// # Errors
    /// A memory that is not checked out; no client.
    pub fn begin(&self, id: i32) -> Result<PendingCall<C>, CallFailure> {
        let mut state = self.state();
        let client = match &state.client {
            Some(client) => Arc::clone(client),
            None => {
                drop(state);
                let made = self.client().ok_or_else(|| CallFailure("the library has no client".into()))?;
                state = self.state();
                made
            }
        };
        let worker = state.take_worker(id).ok_or_else(|| CallFailure::memory(id));
        drop(state);
        let worker = worker.inspect_err(|failure| log_failure(&failure.0))?;
        Ok(PendingCall { client, worker, id })
    }

    /// Computes the requested outputs of a function, and ends the call.
    ///
    /// # Errors
    /// Those of the client; no such function; a panic.
    pub fn end(
        &self,
        PendingCall { worker, client, id }: PendingCall<C>,
        function: usize,
        call: &mut dyn Call,
    ) -> Result<(), CallFailure> {
        // A panic drops the worker, and the next call creates a new one.
        let outcome = catch_panic(AssertUnwindSafe(|| {
            let mut worker = match worker {
                Some(worker) => worker,
                None => Box::new(client.worker()?),
            };
            let outcome = match client.signatures().get(function) {
                Some(_) => client.evaluate(&mut worker, function, call),
                None => Err(CallFailure("there is no such function".into())),
            };
            Ok::<_, CallFailure>((worker, outcome))
        }));
        let (worker, outcome) = match outcome {
            Ok(Ok((worker, outcome))) => (Some(worker), outcome),
            Ok(Err(failure)) | Err(failure) => (None, Err(failure)),
        };
        self.state().return_worker(id, worker);
        outcome.inspect_err(|failure| log_failure(&failure.0))
    }
}

/// A call in progress.
pub struct PendingCall<C: FunctionLibrary> {
    client: Arc<C>,
    worker: Option<Box<C::Worker>>,
    id: i32,
}

impl<C: FunctionLibrary> PendingCall<C> {
    /// The client of the call.
    pub fn client(&self) -> Arc<C> {
        Arc::clone(&self.client)
    }
}

impl<C: FunctionLibrary> State<C> {
    fn take_worker(&mut self, id: i32) -> Option<Option<Box<C::Worker>>> {
        let memory = self.memories.get_mut(usize::try_from(id).ok()?)?;
        match core::mem::replace(memory, WorkerSlot::Busy) {
            WorkerSlot::Ready(worker) => Some(worker),
            other => {
                *memory = other;
                None
            }
        }
    }

    fn return_worker(&mut self, id: i32, worker: Option<Box<C::Worker>>) {
        if let Some(memory) = usize::try_from(id).ok().and_then(|id| self.memories.get_mut(id)) {
            *memory = WorkerSlot::Ready(worker);
        }
    }
}

/// Runs a function; converts a panic to a failure.
fn catch_panic<R>(run: impl FnOnce() -> R) -> Result<R, CallFailure> {
    catch_unwind(AssertUnwindSafe(run)).map_err(|panic| {
        let said = panic.downcast_ref::<&str>().copied().map(String::from);
        let said = said.or_else(|| panic.downcast_ref::<String>().cloned());
        CallFailure(alloc::format!("panicked: {}", said.unwrap_or_default()))
    })
}

/// Writes a failure to standard error, if the environment requests it: solvers also try points at
/// which functions fail.
fn log_failure(what: &dyn Display) {
    if std::env::var_os("CASADOS_CASADI_ERRORS").is_some() {
        std::eprintln!("casados: {what}");
    }
}
