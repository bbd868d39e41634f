//! The pool of memories, and the functions with pointers.
#![allow(unsafe_code)]

use crate::casadi::ffi::{self, Side};
use crate::casadi::function::{Call, Port, Signature};
use crate::casadi::library::{CallFailure, FunctionLibrary, Library};
use crate::casadi::sparsity::Sparsity;
use crate::error::Error;
use alloc::vec;
use alloc::vec::Vec;
use core::ptr::{null, null_mut};
use core::sync::atomic::{AtomicUsize, Ordering};

/// The sum of two inputs, for three numbers and for one; it fails below zero and panics above 100.
struct SumLibrary(Vec<Signature>, &'static AtomicUsize);

/// The memory of a thread, which counts its instances.
struct Counted(&'static AtomicUsize);

impl Drop for Counted {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

impl SumLibrary {
    fn new(workers: &'static AtomicUsize) -> Self {
        let port = |name, length| Port::new(name, Sparsity::vector(length));
        let signature = Signature {
            inputs: vec![port(c"a", 3), port(c"b", 1)],
            outputs: vec![port(c"c", 3), port(c"d", 1)],
        };
        Self(vec![signature], workers)
    }
}

impl FunctionLibrary for SumLibrary {
    type Worker = Counted;
    fn signatures(&self) -> &[Signature] {
        &self.0
    }
    fn worker(&self) -> Result<Counted, CallFailure> {
        self.1.fetch_add(1, Ordering::Relaxed);
        Ok(Counted(self.1))
    }
    fn evaluate(&self, _: &mut Counted, _: usize, call: &mut dyn Call) -> Result<(), CallFailure> {
        let (mut a, mut b) = ([0.0; 3], [0.0; 1]);
        call.read(0, &mut a);
        call.read(1, &mut b);
        if b[0] < 0.0 {
            return Err(CallFailure("below zero".into()));
        }
        assert!(b[0] <= 100.0, "on purpose");
        assert!(!call.wants(2) && call.output(2).is_none());
        if let Some(c) = call.output(0) {
            c.copy_from_slice(&a.map(|a| a + b[0]));
        }
        if let Some(d) = call.output(1) {
            d[0] = a.iter().sum();
        }
        Ok(())
    }
    fn integrations(&self) -> u64 {
        7
    }
}

/// A call with two inputs and two outputs.
fn call(library: &Library<SumLibrary>, inputs: [Option<&[f64]>; 2], id: i32) -> Option<([f64; 3], [f64; 1])> {
    let (mut c, mut d) = ([f64::NAN; 3], [f64::NAN; 1]);
    let arguments = inputs.map(|input| input.map_or(null(), <[f64]>::as_ptr));
    let mut results = [c.as_mut_ptr(), d.as_mut_ptr()];
    // SAFETY: as many pointers as inputs and outputs, to arrays of their lengths.
    let status = unsafe { ffi::evaluate(library, 0, arguments.as_ptr(), results.as_mut_ptr(), id) };
    (status == 0).then_some((c, d))
}

#[test]
fn pointers_become_calls() {
    static WORKERS: AtomicUsize = AtomicUsize::new(0);
    static LIBRARY: Library<SumLibrary> = Library::new(|| Ok(SumLibrary::new(&WORKERS)));
    ffi::add_reference(&LIBRARY);
    let id = ffi::check_out(&LIBRARY);
    let (a, b) = ([1.0, 2.0, 3.0], [10.0]);
    assert_eq!(call(&LIBRARY, [Some(&a), Some(&b)], id), Some(([11.0, 12.0, 13.0], [6.0])));
    assert_eq!(call(&LIBRARY, [None, Some(&b)], id), Some(([10.0; 3], [0.0])));
    // Null pointers for all arrays.
    // SAFETY: null is allowed for both.
    assert_eq!(unsafe { ffi::evaluate(&LIBRARY, 0, null(), null_mut(), id) }, 0);
    // SAFETY: as above; there is no such function.
    assert_eq!(unsafe { ffi::evaluate(&LIBRARY, 9, null(), null_mut(), id) }, 1);
    // Failures and a panic; later calls succeed.
    assert_eq!(call(&LIBRARY, [Some(&a), Some(&[-1.0])], id), None);
    assert_eq!(call(&LIBRARY, [Some(&a), Some(&[101.0])], id), None);
    assert_eq!(call(&LIBRARY, [Some(&a), None], id), Some((a, [6.0])));
    for stranger in [-1, 1, i32::MIN, i32::MAX] {
        assert_eq!(call(&LIBRARY, [Some(&a), None], stranger), None);
    }
    assert_eq!(ffi::count(&LIBRARY, 0, Side::Input), 2);
    assert_eq!(ffi::count(&LIBRARY, 1, Side::Input), 0);
    assert_eq!(ffi::integrations(&LIBRARY), 7);
    // SAFETY: the name is terminated by zero, and lives until the last reference is dropped.
    let name = unsafe { core::ffi::CStr::from_ptr(ffi::name(&LIBRARY, 0, Side::Output, 1)) };
    assert_eq!(name, c"d");
    assert!(ffi::name(&LIBRARY, 0, Side::Output, 2).is_null());
    assert!(ffi::sparsity(&LIBRARY, 0, Side::Input, -1).is_null());
    // SAFETY: the pattern of a dense vector consists of three numbers.
    let pattern = unsafe { core::slice::from_raw_parts(ffi::sparsity(&LIBRARY, 0, Side::Input, 0), 3) };
    assert_eq!(pattern, [3, 1, 1]);
    ffi::release(&LIBRARY, id);
    assert_eq!(call(&LIBRARY, [Some(&a), None], id), None);
    // The last reference drops everything.
    assert_eq!(WORKERS.load(Ordering::Relaxed), 1);
    ffi::remove_reference(&LIBRARY);
    assert_eq!(WORKERS.load(Ordering::Relaxed), 0);
}

#[test]
fn threads_have_memory_of_their_own() {
    static WORKERS: AtomicUsize = AtomicUsize::new(0);
    static LIBRARY: Library<SumLibrary> = Library::new(|| Ok(SumLibrary::new(&WORKERS)));
    let ids: Vec<i32> = (0..4).map(|_| ffi::check_out(&LIBRARY)).collect();
    assert_eq!(ids, [0, 1, 2, 3]);
    ffi::release(&LIBRARY, 2);
    assert_eq!(ffi::check_out(&LIBRARY), 2);
    std::thread::scope(|scope| {
        for id in ids {
            scope.spawn(move || {
                for round in 0..20 {
                    let b = [f64::from(id * 100 + round) / 100.0];
                    let expected = ([1.0 + b[0]; 3], [3.0]);
                    assert_eq!(call(&LIBRARY, [Some(&[1.0; 3]), Some(&b)], id), Some(expected));
                }
            });
        }
    });
    assert_eq!(WORKERS.load(Ordering::Relaxed), 4);
}

/// If the construction of the client panics, the library has no functions.
#[test]
fn a_client_that_cannot_be_made() {
    static LIBRARY: Library<SumLibrary> = Library::new(|| panic!("on purpose"));
    assert_eq!(ffi::count(&LIBRARY, 0, Side::Input), 0);
    assert_eq!(call(&LIBRARY, [None, None], ffi::check_out(&LIBRARY)), None);
    assert_eq!(ffi::integrations(&LIBRARY), 0);
}

/// If the construction fails, there are no functions, and the cause is written.
#[test]
fn functions_that_have_no_memory() {
    static LIBRARY: Library<SumLibrary> =
        Library::new(|| Err(Error::OutOfMemory { bytes: usize::MAX }.into()));
    assert_eq!(ffi::count(&LIBRARY, 0, Side::Input), 0);
    assert_eq!(call(&LIBRARY, [None, None], ffi::check_out(&LIBRARY)), None);
}
