//! What an exported call costs over the call of Rust: both in a loop of Rust, by turns, at inputs
//! that are new each time, so that the cache knows none of them.

use core::ffi::{c_int, c_longlong};
use core::ptr::null_mut;
use std::time::Instant;

/// The functions that CasADi calls.
type Exported =
    unsafe extern "C" fn(*const *const f64, *mut *mut f64, *mut c_longlong, *mut f64, c_int) -> c_int;

unsafe extern "C" {
    fn chain(_: *const *const f64, _: *mut *mut f64, _: *mut c_longlong, _: *mut f64, _: c_int) -> c_int;
    fn jac_chain(_: *const *const f64, _: *mut *mut f64, _: *mut c_longlong, _: *mut f64, _: c_int) -> c_int;
    fn jac_adj1_chain(
        _: *const *const f64,
        _: *mut *mut f64,
        _: *mut c_longlong,
        _: *mut f64,
        _: c_int,
    ) -> c_int;
    safe fn chain_incref();
    safe fn chain_decref();
    fn chain_checkout() -> c_int;
    fn chain_release(_: c_int);
}

/// What is asked: values, the Jacobian, the Hessian.
#[derive(Clone, Copy)]
pub enum Mode {
    Value,
    Jacobian,
    Hessian,
}

impl Mode {
    /// The function, how many inputs it has, the index of the multipliers among them, and how many
    /// outputs.
    fn function(self) -> (Exported, usize, usize, usize) {
        match self {
            Self::Value => (chain, 3, 3, 1),
            Self::Jacobian => (jac_chain, 4, 4, 3),
            Self::Hessian => (jac_adj1_chain, 8, 4, 15),
        }
    }
}

/// The shortest of many calls in nanoseconds: of Rust, exported, and exported at known inputs.
pub fn measure<const NX: usize>(
    mode: Mode,
    calls: u32,
    start: &[f64; NX],
    mut bare: impl FnMut(&[f64; NX], &[f64; 3]) -> bool,
) -> Option<[f64; 3]> {
    // With the last reference the library forgets everything, and that an earlier measurement asked
    // for derivatives twice.
    chain_incref();
    let shortest = alternate(mode, calls, start, &mut bare);
    chain_decref();
    shortest
}

fn alternate<const NX: usize>(
    mode: Mode,
    calls: u32,
    start: &[f64; NX],
    bare: &mut impl FnMut(&[f64; NX], &[f64; 3]) -> bool,
) -> Option<[f64; 3]> {
    let (function, inputs, seed, outputs) = mode.function();
    let (mut x, u, lambda) = (*start, [0.1, -0.2, 0.3], [1.0; NX]);
    // As many as the widest output has.
    let mut results = vec![vec![0.0; (NX + 3) * (NX + 3)]; outputs];
    let mut places: Vec<*mut f64> = results.iter_mut().map(|result| result.as_mut_ptr()).collect();
    // Of second derivatives those by the multipliers, which are the Jacobian, are not wanted.
    if let Mode::Hessian = mode {
        places.iter_mut().skip(4).step_by(5).for_each(|place| *place = null_mut());
    }
    // SAFETY: it takes no arguments.
    let memory = unsafe { chain_checkout() };
    let mut exported = |x: &[f64; NX]| {
        let mut arguments = vec![core::ptr::null(); inputs];
        (arguments[0], arguments[1]) = (x.as_ptr(), u.as_ptr());
        if let Some(place) = arguments.get_mut(seed) {
            *place = lambda.as_ptr();
        }
        let begin = Instant::now();
        // SAFETY: as many pointers as there are inputs and outputs, null or to arrays that are long
        // enough; the memory was checked out above.
        let status =
            unsafe { function(arguments.as_ptr(), places.as_mut_ptr(), null_mut(), null_mut(), memory) };
        (status == 0).then(|| begin.elapsed().as_nanos() as f64)
    };
    let mut shortest = [f64::INFINITY; 3];
    for call in 0..calls {
        x[0] = start[0] + 1e-9 * f64::from(call);
        let first = exported(&x)?;
        let begin = Instant::now();
        if !bare(&x, &u) {
            return None;
        }
        let direct = begin.elapsed().as_nanos() as f64;
        (shortest[0], shortest[1]) = (shortest[0].min(direct), shortest[1].min(first));
    }
    // By themselves: who asks for the same derivatives again has them kept from then on.
    for call in 0..calls {
        x[0] = start[0] - 1e-9 * f64::from(call + 1);
        exported(&x)?;
        shortest[2] = shortest[2].min(exported(&x)?);
    }
    // SAFETY: the memory was checked out above.
    unsafe { chain_release(memory) };
    Some(shortest)
}
