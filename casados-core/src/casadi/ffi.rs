//! The functions of a shared library that CasADi calls: converts pointers to a safe `Call`.
//!
//! CasADi's contract (`casadi/core/external_impl.hpp`): the pointers of a call are to as many
//! arrays as there are inputs and outputs, each null or as long as its pattern has non-zeros;
//! nobody else writes them during the call. Patterns and names are read while the function is
//! referred to.
#![allow(unsafe_code)]

use super::function::{Call, Port, Signature};
use super::library::{FunctionLibrary, Library};
use alloc::sync::Arc;
use core::ffi::{c_char, c_int, c_longlong};
use core::panic::AssertUnwindSafe;
use core::ptr::null;
use core::slice::{from_raw_parts, from_raw_parts_mut};
use std::panic::catch_unwind;

/// CasADi's status for a recoverable failure.
const FAILED: c_int = 1;

/// The kind of ports in a query.
#[derive(Clone, Copy, Debug)]
pub enum Side {
    /// The inputs.
    Input,
    /// The outputs.
    Output,
}

/// The pointers of a call.
struct Pointers<'a> {
    inputs: &'a [Port],
    outputs: &'a [Port],
    /// Null, or an array of as many pointers as there are inputs.
    arguments: *const *const f64,
    /// Null, or an array of as many pointers as there are outputs.
    results: *mut *mut f64,
}

impl Call for Pointers<'_> {
    fn read(&self, input: usize, to: &mut [f64]) {
        to.fill(0.0);
        let Some(port) = self.inputs.get(input).filter(|_| !self.arguments.is_null()) else { return };
        // SAFETY: the index is that of an input, and there are as many pointers.
        let argument = unsafe { *self.arguments.add(input) };
        if !argument.is_null() {
            // SAFETY: a non-null pointer is to an array of as many numbers as the pattern has
            // non-zeros, which nobody writes while this reference exists: it ends here, before any
            // output is written.
            let values = unsafe { from_raw_parts(argument, port.sparsity.entries().len()) };
            for (to, from) in to.iter_mut().zip(values) {
                *to = *from;
            }
        }
    }

    fn wants(&self, output: usize) -> bool {
        // SAFETY: the index is that of an output, and there are as many pointers.
        output < self.outputs.len()
            && !self.results.is_null()
            && !unsafe { *self.results.add(output) }.is_null()
    }

    fn output(&mut self, output: usize) -> Option<&mut [f64]> {
        if !self.wants(output) {
            return None;
        }
        let port = self.outputs.get(output)?;
        // SAFETY: as in `wants`, which has tested that the pointer is not null; then it is to an
        // array of as many numbers as the pattern has non-zeros, which nobody else reads or writes
        // during the call. The result borrows `self`, so that there is no second reference.
        Some(unsafe { from_raw_parts_mut(*self.results.add(output), port.sparsity.entries().len()) })
    }
}

/// `F(arg, res, iw, w, mem)`
///
/// # Safety
/// The pointers are those of a call by CasADi to this function: see the head of this file.
pub unsafe fn evaluate<C: FunctionLibrary>(
    library: &Library<C>,
    function: usize,
    arguments: *const *const f64,
    results: *mut *mut f64,
    memory: c_int,
) -> c_int {
    let run = AssertUnwindSafe(|| {
        let begun = library.begin(memory).ok()?;
        let client = begun.client();
        let (inputs, outputs) = match client.signatures().get(function) {
            Some(Signature { inputs, outputs }) => (&inputs[..], &outputs[..]),
            None => Default::default(),
        };
        let mut call = Pointers { inputs, outputs, arguments, results };
        library.end(begun, function, &mut call).ok()
    });
    match catch_unwind(run) {
        Ok(Some(())) => 0,
        _ => FAILED,
    }
}

/// `F_n_in`, `F_n_out`
pub fn count<C: FunctionLibrary>(library: &Library<C>, function: usize, side: Side) -> c_longlong {
    with(library, function, side, |ports| ports.len() as c_longlong).unwrap_or(0)
}

/// `F_name_in`, `F_name_out`: null if there is no such port.
pub fn name<C: FunctionLibrary>(
    library: &Library<C>,
    function: usize,
    side: Side,
    index: c_longlong,
) -> *const c_char {
    let name = with(library, function, side, |ports| Some(port(ports, index)?.name.as_ptr()));
    name.flatten().unwrap_or(null())
}

/// `F_sparsity_in`, `F_sparsity_out`: null if there is no such port. The pointer is to memory of
/// the client, which lives until the last reference to the functions is dropped.
pub fn sparsity<C: FunctionLibrary>(
    library: &Library<C>,
    function: usize,
    side: Side,
    index: c_longlong,
) -> *const c_longlong {
    let pattern =
        with(library, function, side, |ports| Some(port(ports, index)?.sparsity.compressed().as_ptr()));
    pattern.flatten().unwrap_or(null())
}

/// `F_work`: only the arrays of pointers to inputs and outputs are needed.
///
/// # Safety
/// The pointers are null or to one number each, which nobody else reads or writes during the call.
pub unsafe fn work<C: FunctionLibrary>(
    library: &Library<C>,
    function: usize,
    sizes: [*mut c_longlong; 4],
) -> c_int {
    let counts = [count(library, function, Side::Input), count(library, function, Side::Output), 0, 0];
    for (to, size) in sizes.into_iter().zip(counts) {
        // SAFETY: a non-null pointer is to one number, to which this call has exclusive access.
        if let Some(to) = unsafe { to.as_mut() } {
            *to = size;
        }
    }
    0
}

/// `F_checkout`: the index of a memory, or −1.
pub fn check_out<C: FunctionLibrary>(library: &Library<C>) -> c_int {
    catch_unwind(AssertUnwindSafe(|| library.check_out())).ok().flatten().unwrap_or(-1)
}

/// `F_release`
pub fn release<C: FunctionLibrary>(library: &Library<C>, memory: c_int) {
    let _ = catch_unwind(AssertUnwindSafe(|| library.release(memory)));
}

/// `F_incref`
pub fn add_reference<C: FunctionLibrary>(library: &Library<C>) {
    let _ = catch_unwind(AssertUnwindSafe(|| library.add_reference()));
}

/// `F_decref`
pub fn remove_reference<C: FunctionLibrary>(library: &Library<C>) {
    let _ = catch_unwind(AssertUnwindSafe(|| library.remove_reference()));
}

/// The number of intervals integrated since the first reference to the functions, including those
/// of length zero for algebraic states.
pub fn integrations<C: FunctionLibrary>(library: &Library<C>) -> c_longlong {
    catch_unwind(AssertUnwindSafe(|| {
        library.client().map_or(0, |client| client.integrations() as c_longlong)
    }))
    .unwrap_or(0)
}

fn port(ports: &[Port], index: c_longlong) -> Option<&Port> {
    ports.get(usize::try_from(index).ok()?)
}

/// Queries the ports of a function; none after a panic.
fn with<C: FunctionLibrary, R>(
    library: &Library<C>,
    function: usize,
    side: Side,
    say: impl FnOnce(&[Port]) -> R,
) -> Option<R> {
    let run = AssertUnwindSafe(|| {
        let client: Arc<C> = library.client()?;
        let signature = client.signatures().get(function)?;
        Some(say(match side {
            Side::Input => &signature.inputs,
            Side::Output => &signature.outputs,
        }))
    });
    catch_unwind(run).ok().flatten()
}
