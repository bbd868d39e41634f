//! The functions that a shared library exports, called as CasADi calls them.
#![allow(unsafe_code)]

use crate::models::pendulum::Pendulum;
use casados_core::{Gauss, Irk, Options};
use core::ffi::{CStr, c_char, c_int, c_longlong};
use core::ptr::{null, null_mut};
use nalgebra::{SVector, vector};

casados_core::casadi::export! {
    pendulum = Irk<Pendulum, Gauss<2>>, interval = 0.05, options = Options { steps: 2, ..Default::default() }, cache = 3
}

type Pointers = (*const *const f64, *mut *mut f64);

unsafe extern "C" {
    fn pendulum(
        arg: *const *const f64,
        res: *mut *mut f64,
        iw: *mut c_longlong,
        w: *mut f64,
        mem: c_int,
    ) -> c_int;
    fn jac_pendulum(
        arg: *const *const f64,
        res: *mut *mut f64,
        iw: *mut c_longlong,
        w: *mut f64,
        mem: c_int,
    ) -> c_int;
    fn jac_adj1_pendulum(
        arg: *const *const f64,
        res: *mut *mut f64,
        iw: *mut c_longlong,
        w: *mut f64,
        mem: c_int,
    ) -> c_int;
    safe fn pendulum_checkout() -> c_int;
    safe fn pendulum_release(memory: c_int);
    safe fn pendulum_incref();
    safe fn pendulum_decref();
    safe fn pendulum_integrations() -> c_longlong;
    safe fn jac_pendulum_n_in() -> c_longlong;
    safe fn jac_pendulum_n_out() -> c_longlong;
    safe fn jac_pendulum_name_in(index: c_longlong) -> *const c_char;
    safe fn jac_pendulum_name_out(index: c_longlong) -> *const c_char;
    safe fn jac_pendulum_sparsity_in(index: c_longlong) -> *const c_longlong;
    safe fn jac_pendulum_sparsity_out(index: c_longlong) -> *const c_longlong;
    fn pendulum_work(
        arg: *mut c_longlong,
        res: *mut c_longlong,
        iw: *mut c_longlong,
        w: *mut c_longlong,
    ) -> c_int;
}

type Function =
    unsafe extern "C" fn(*const *const f64, *mut *mut f64, *mut c_longlong, *mut f64, c_int) -> c_int;

/// Calls a function with inputs, which are missing where they are empty, and outputs of these
/// lengths, which are not wanted where they have none.
fn call(function: Function, inputs: &[&[f64]], lengths: &[usize], memory: c_int) -> Option<Vec<Vec<f64>>> {
    let arg: Vec<_> = inputs.iter().map(|i| if i.is_empty() { null() } else { i.as_ptr() }).collect();
    let mut outputs: Vec<_> = lengths.iter().map(|&length| vec![f64::NAN; length]).collect();
    let mut res: Vec<_> =
        outputs.iter_mut().map(|o| if o.is_empty() { null_mut() } else { o.as_mut_ptr() }).collect();
    let (arg, res): Pointers = (arg.as_ptr(), res.as_mut_ptr());
    // SAFETY: the arrays are as long as the patterns of the function say.
    let status = unsafe { function(arg, res, null_mut(), null_mut(), memory) };
    (status == 0).then_some(outputs)
}

/// The numbers behind a pattern: what is read ends with the last row.
fn pattern(pointer: *const c_longlong) -> Vec<i64> {
    // SAFETY: a pattern is two dimensions, then a one, or begins of columns and rows.
    unsafe {
        let (columns, dense) = (*pointer.add(1) as usize, *pointer.add(2));
        let length = if dense == 1 { 3 } else { 3 + columns + *pointer.add(2 + columns) as usize };
        core::slice::from_raw_parts(pointer, length).to_vec()
    }
}

const X0: [f64; 4] = [0.1, 0.4, -0.3, 0.7];
const LAMBDA: [f64; 4] = [0.3, -0.2, 0.7, 1.1];

/// One test: they would share the pool and the cache.
#[test]
fn calls_by_casadi() {
    pendulum_incref();
    let memory = pendulum_checkout();
    let mut irk = Irk::<Pendulum, Gauss<2>>::new(Options { steps: 2, ..Default::default() }).unwrap();
    let expected = *irk.hessian(&SVector::from(X0), &vector![1.5], 0.05, &SVector::from(LAMBDA)).unwrap();

    // The same bits; nothing is integrated twice, or when nothing is wanted.
    let begin = pendulum_integrations();
    call(pendulum, &[&X0, &[1.5], &[]], &[0], memory).unwrap();
    assert_eq!(pendulum_integrations(), begin);
    let value = call(pendulum, &[&X0, &[1.5], &[]], &[4], memory).unwrap();
    assert_eq!(value[0], expected.x.as_slice());
    let jacobian = call(jac_pendulum, &[&X0, &[1.5], &[], &[]], &[16, 4, 0], memory).unwrap();
    assert_eq!(jacobian[1], expected.dx_du.as_slice());
    let inputs: [&[f64]; 8] = [&X0, &[1.5], &[], &[], &LAMBDA, &[], &[], &[]];
    let entries = count(jac_adj1_pendulum_sparsity_out(0));
    // Three gradients by five inputs of the adjoint.
    let mut lengths = [0; 15];
    lengths[0] = entries;
    let second = call(jac_adj1_pendulum, &inputs, &lengths, memory).unwrap();
    assert_eq!(pendulum_integrations(), begin + 1);
    for (place, value) in entries_of(jac_adj1_pendulum_sparsity_out(0)).into_iter().zip(&second[0]) {
        assert_eq!(expected.h_xx[place], *value);
    }

    // Zeros for what is missing.
    let zero = call(pendulum, &[&X0, &[], &[]], &[4], memory).unwrap();
    assert_eq!(zero[0], irk.solve(&SVector::from(X0), &vector![0.0], 0.05).unwrap().x.as_slice());

    // Refused: what is no number, memories of nobody and of others.
    assert!(call(pendulum, &[&[f64::NAN; 4], &[1.5], &[]], &[4], memory).is_none());
    for stranger in [-1, 1, 5, c_int::MIN, c_int::MAX] {
        assert!(call(pendulum, &[&X0, &[1.5], &[]], &[4], stranger).is_none());
    }
    pendulum_release(memory);
    assert!(call(pendulum, &[&X0, &[1.5], &[]], &[4], memory).is_none());

    // What there is.
    assert_eq!((jac_pendulum_n_in(), jac_pendulum_n_out()), (4, 3));
    // SAFETY: names end with zero, and live until the last reference is gone.
    let name = |pointer| unsafe { CStr::from_ptr(pointer) }.to_str().unwrap();
    assert_eq!(name(jac_pendulum_name_in(3)), "out_xf");
    assert_eq!(name(jac_pendulum_name_out(1)), "jac_xf_u");
    assert!(jac_pendulum_name_in(4).is_null() && jac_pendulum_name_out(-1).is_null());
    assert_eq!(pattern(jac_pendulum_sparsity_in(0)), [4, 1, 1]);
    assert_eq!(pattern(jac_pendulum_sparsity_in(2)), [0, 1, 0, 0]);
    assert_eq!(pattern(jac_pendulum_sparsity_in(3)), [4, 1, 0, 0]);
    assert_eq!(pattern(jac_pendulum_sparsity_out(1)), [4, 1, 1]);
    assert!(jac_pendulum_sparsity_out(3).is_null());
    let mut sizes = [-1; 4];
    let [a, b, c, d] = &mut sizes;
    // SAFETY: pointers to a number each, and one to none.
    assert_eq!(unsafe { pendulum_work(a, b, c, d) }, 0);
    // SAFETY: null is allowed.
    assert_eq!(unsafe { pendulum_work(null_mut(), null_mut(), null_mut(), null_mut()) }, 0);
    assert_eq!(sizes, [3, 1, 0, 0]);

    concurrent_calls();
    // With the last reference everything is forgotten.
    pendulum_decref();
    assert!(call(pendulum, &[&X0, &[1.5], &[]], &[4], memory).is_none());
}

unsafe extern "C" {
    safe fn jac_adj1_pendulum_sparsity_out(index: c_longlong) -> *const c_longlong;
}

fn count(pointer: *const c_longlong) -> usize {
    entries_of(pointer).len()
}

fn entries_of(pointer: *const c_longlong) -> Vec<(usize, usize)> {
    let pattern = pattern(pointer);
    let (rows, columns) = (pattern[0] as usize, pattern[1] as usize);
    if pattern.len() == 3 {
        return (0..columns).flat_map(|c| (0..rows).map(move |r| (r, c))).collect();
    }
    let (begins, rows) = pattern[2..].split_at(columns + 1);
    let column = |c: usize| begins[c] as usize..begins[c + 1] as usize;
    (0..columns).flat_map(|c| column(c).map(move |i| (i, c))).map(|(i, c)| (rows[i] as usize, c)).collect()
}

/// Several at the same time, over more inputs than are remembered: as one after the other.
fn concurrent_calls() {
    let run = |first: usize| {
        let memory = pendulum_checkout();
        let values: Vec<_> = (0..6)
            .map(|i| {
                let x0 = [0.1 * ((first + i) % 4) as f64, 0.4, -0.3, 0.7];
                call(pendulum, &[&x0, &[1.5], &[]], &[4], memory).unwrap().swap_remove(0)
            })
            .collect();
        pendulum_release(memory);
        values
    };
    let expected: Vec<_> = (0..4).map(run).collect();
    let found: Vec<_> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..4).map(|first| scope.spawn(move || run(first))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    assert_eq!(found, expected);
}
