//! The C interface of `export!`: any numbers, absent pointers, workers that were never checked out.

// The functions are those that a C program calls, by raw pointers.
#![allow(unsafe_code)]

use super::source::Source;
use super::*;
use casados::prelude::*;
use core::ffi::{c_int, c_longlong};
use core::ptr::{null, null_mut};
use everything::Everything;

casados::casadi::export! {
    fuzzed = Irk<Everything, RadauIIA<2>>, interval = 0.1, cache = 3
}

type Evaluate =
    unsafe extern "C" fn(*const *const f64, *mut *mut f64, *mut c_longlong, *mut f64, c_int) -> c_int;
type Pattern = extern "C" fn(c_longlong) -> *const c_longlong;

macro_rules! declared {
    ($($name:ident)*) => {
        // SAFETY: `export!` above defines them with these signatures.
        unsafe extern "C" {
            $(safe fn $name() -> c_longlong;)*
        }
    };
}
declared! { fuzzed_n_in fuzzed_n_out jac_fuzzed_n_in jac_fuzzed_n_out adj1_fuzzed_n_in adj1_fuzzed_n_out
jac_adj1_fuzzed_n_in jac_adj1_fuzzed_n_out }
macro_rules! functions {
    ($($name:ident $inputs:ident $outputs:ident;)*) => {
        // SAFETY: as above.
        unsafe extern "C" {
            $(fn $name(_: *const *const f64, _: *mut *mut f64, _: *mut c_longlong, _: *mut f64, _: c_int) -> c_int;)*
            $(safe fn $inputs(index: c_longlong) -> *const c_longlong;)*
            $(safe fn $outputs(index: c_longlong) -> *const c_longlong;)*
            safe fn fuzzed_checkout() -> c_int;
            safe fn fuzzed_release(memory: c_int);
            safe fn fuzzed_incref();
            safe fn fuzzed_decref();
        }
    };
}
functions! {
    fuzzed fuzzed_sparsity_in fuzzed_sparsity_out;
    jac_fuzzed jac_fuzzed_sparsity_in jac_fuzzed_sparsity_out;
    adj1_fuzzed adj1_fuzzed_sparsity_in adj1_fuzzed_sparsity_out;
    jac_adj1_fuzzed jac_adj1_fuzzed_sparsity_in jac_adj1_fuzzed_sparsity_out;
}

/// How many numbers an argument has: the non-zeros of its pattern in compressed columns.
fn length(pattern: *const c_longlong) -> usize {
    // SAFETY: a pattern begins with two dimensions, and has a start for each column and an end; a
    // third number of one says that it is dense.
    unsafe {
        let (rows, columns, dense) = (*pattern, *pattern.add(1), *pattern.add(2));
        let count = if dense == 1 { rows * columns } else { *pattern.add(2 + columns as usize) };
        count as usize
    }
}

#[test]
fn exported() {
    let functions: [(Evaluate, [c_longlong; 2], [Pattern; 2]); 4] = [
        (
            fuzzed,
            [fuzzed_n_in(), fuzzed_n_out()],
            [patterns_as_rust_functions(0), patterns_as_rust_functions(1)],
        ),
        (
            jac_fuzzed,
            [jac_fuzzed_n_in(), jac_fuzzed_n_out()],
            [patterns_as_rust_functions(2), patterns_as_rust_functions(3)],
        ),
        (
            adj1_fuzzed,
            [adj1_fuzzed_n_in(), adj1_fuzzed_n_out()],
            [patterns_as_rust_functions(4), patterns_as_rust_functions(5)],
        ),
        (
            jac_adj1_fuzzed,
            [jac_adj1_fuzzed_n_in(), jac_adj1_fuzzed_n_out()],
            [patterns_as_rust_functions(6), patterns_as_rust_functions(7)],
        ),
    ];
    fuzzed_incref();
    let mut counts = Counts::new("exported");
    let memory = fuzzed_checkout();
    for seed in seeds(INTEGRATORS) {
        let mut source = Source::new(seed);
        for _ in 0..CALLS {
            let (evaluate, [inputs, outputs], [pattern_in, pattern_out]) = functions[source.below(4)];
            let vectors: Vec<Vec<f64>> =
                (0..inputs).map(|i| (0..length(pattern_in(i))).map(|_| source.number()).collect()).collect();
            let mut results: Vec<Vec<f64>> =
                (0..outputs).map(|i| vec![0.0; length(pattern_out(i))]).collect();
            let arguments: Vec<*const f64> = vectors
                .iter()
                .map(|vector| if source.below(12) == 0 { null() } else { vector.as_ptr() })
                .collect();
            let places: Vec<*mut f64> = results
                .iter_mut()
                .map(|result| if source.below(6) == 0 { null_mut() } else { result.as_mut_ptr() })
                .collect();
            let id = if source.below(20) == 0 { source.below(5) as c_int - 2 } else { memory };
            let call = |places: &mut [*mut f64]| {
                // SAFETY: pointers are null or to as many numbers as the patterns say.
                unsafe { evaluate(arguments.as_ptr(), places.as_mut_ptr(), null_mut(), null_mut(), id) }
            };
            let status = call(&mut places.clone());
            let first = results.clone();
            assert!(status == 0 || status == 1, "seed {seed}: {status}");
            if status == 0 {
                assert!(id == memory, "seed {seed}: memory {id}");
                let written = first.iter().zip(&places).filter(|(_, place)| !place.is_null());
                let finite = written.clone().all(|(result, _)| result.iter().all(|value| value.is_finite()));
                assert!(finite, "seed {seed}: {vectors:?} {first:?}");
            }
            // What is remembered is what is computed.
            let again = call(&mut places.clone());
            assert_eq!((status, format!("{first:?}")), (again, format!("{results:?}")), "seed {seed}");
            counts.count(if status == 0 { "Ok" } else { "error" });
        }
    }
    fuzzed_release(memory);
    fuzzed_decref();
    enough(&counts, 100);
}

/// The patterns of inputs and outputs, as functions of Rust's type.
fn patterns_as_rust_functions(which: usize) -> Pattern {
    extern "C" fn of<const WHICH: usize>(index: c_longlong) -> *const c_longlong {
        match WHICH {
            0 => fuzzed_sparsity_in(index),
            1 => fuzzed_sparsity_out(index),
            2 => jac_fuzzed_sparsity_in(index),
            3 => jac_fuzzed_sparsity_out(index),
            4 => adj1_fuzzed_sparsity_in(index),
            5 => adj1_fuzzed_sparsity_out(index),
            6 => jac_adj1_fuzzed_sparsity_in(index),
            _ => jac_adj1_fuzzed_sparsity_out(index),
        }
    }
    [of::<0>, of::<1>, of::<2>, of::<3>, of::<4>, of::<5>, of::<6>, of::<7>][which]
}
