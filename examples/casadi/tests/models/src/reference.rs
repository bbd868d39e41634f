//! The calls of Rust, for comparison.

use crate::{Pendulum, steps};
use casados::prelude::*;
use nalgebra::SVector;

/// Writes `x`, `∂x/∂(x₀, u)` and `∂²(λᵀx)/∂x₀²` of the pendulum by `Irk`.
///
/// # Safety
/// The pointers are to 4, 1, 4 and 4 + 20 + 16 numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn reference(x0: *const f64, u: *const f64, lambda: *const f64, to: *mut f64) -> i32 {
    // SAFETY: see above.
    let (x0, u, lambda, to) = unsafe {
        (
            core::slice::from_raw_parts(x0, 4),
            core::slice::from_raw_parts(u, 1),
            core::slice::from_raw_parts(lambda, 4),
            core::slice::from_raw_parts_mut(to, 40),
        )
    };
    let mut run = || -> Result<(), casados::Error> {
        let mut irk = Irk::<Pendulum, Gauss<2>>::new(steps(2))?;
        let result = irk.hessian(
            &SVector::from_column_slice(x0),
            &SVector::from_column_slice(u),
            0.05,
            &SVector::from_column_slice(lambda),
        )?;
        let parts =
            [result.x.as_slice(), result.dx_dx0.as_slice(), result.dx_du.as_slice(), result.h_xx.as_slice()];
        to.copy_from_slice(&parts.concat());
        Ok(())
    };
    i32::from(run().is_err())
}

/// Nanoseconds of a call of `forward`.
#[unsafe(no_mangle)]
pub extern "C" fn nanoseconds_of_forward(calls: u64) -> f64 {
    let Ok(mut irk) = Irk::<Pendulum, Gauss<2>>::new(steps(2)) else { return f64::NAN };
    let (mut x0, u) = (SVector::from([0.0, 0.3, 0.0, 0.0]), SVector::from([1.0]));
    let begin = std::time::Instant::now();
    for call in 0..calls {
        x0[1] = 0.3 + 1e-9 * call as f64;
        if let Ok(result) = irk.forward(&x0, &u, 0.05) {
            core::hint::black_box(result);
        }
    }
    begin.elapsed().as_secs_f64() * 1e9 / calls as f64
}
