//! What the tables compare the chain of masses with: RK4, and the solvers of casados.

use crate::overhead::{Mode, measure};
use crate::report::{Report, write};
use crate::shooting::chain::{Chain, stretched};
use crate::shooting::{NX, SECONDS, STAGES, formulate, options};
use casados::ocp::{HeapIpm, HeapSqp};
use casados::prelude::*;
use nalgebra::SVector;
use std::error::Error;
use std::time::Instant;
#[cfg(not(feature = "order-8"))]
use {crate::shooting::back_to_rest, casados::casadi::Program, casados::ocp::Shooting};

casados::casadi::export! {
    chain_rk4 = Erk<Chain<NX>, Rk4>, interval = SECONDS, options = Options { steps: 4, ..Default::default() }
}
#[cfg(not(feature = "order-8"))]
casados::casadi::export_problem! { explicit = explicit }

#[cfg(not(feature = "order-8"))]
fn explicit() -> Result<impl Program + 'static, Box<dyn Error>> {
    let options = Options { steps: 4, ..Default::default() };
    back_to_rest(Shooting::new(Batch::<Chain<NX>, Rk4>::new(options)?))
}

/// The sequential quadratic programming of casados with exact Hessians (0) or those of Gauss and
/// Newton (1), or its interior point (2).
///
/// # Safety
/// The pointer is to a report, which nobody else has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn own(solver: i32, to: *mut Report) -> i32 {
    // SAFETY: see above.
    let Some(to) = (unsafe { to.as_mut() }) else { return 1 };
    write(to, solve(solver))
}

fn solve(solver: i32) -> Result<Report, Box<dyn Error>> {
    let mut ocp = formulate()?;
    let (begin, outcome) = match solver {
        0 => {
            let mut sqp = HeapSqp::new(&ocp)?;
            sqp.options.tolerance = 1e-6;
            (Instant::now(), sqp.solve(&mut ocp)?)
        }
        1 => {
            let mut sqp = HeapSqp::new(&ocp)?.gauss_newton();
            sqp.options.tolerance = 1e-6;
            (Instant::now(), sqp.solve(&mut ocp)?)
        }
        _ => {
            let mut ipm = HeapIpm::new(&ocp)?;
            ipm.options.tolerance = 1e-6;
            (Instant::now(), ipm.solve(&mut ocp)?)
        }
    };
    Ok(Report::new(&outcome, begin.elapsed().as_secs_f64()))
}

/// Nanoseconds of a call for values (0), Jacobian (1) or Hessian (2): of Rust, exported, and
/// exported at known inputs; the status is zero if all calls succeeded.
///
/// # Safety
/// The pointer is to three numbers, which nobody else has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn overhead(mode: i32, calls: u32, to: *mut [f64; 3]) -> i32 {
    // SAFETY: see above.
    let Some(to) = (unsafe { to.as_mut() }) else { return 1 };
    match compare(mode, calls) {
        Some(shortest) => *to = shortest,
        None => return 1,
    }
    0
}

fn compare(mode: i32, calls: u32) -> Option<[f64; 3]> {
    let start = stretched::<NX>().into();
    let mut irk = Irk::<Chain<NX>, Gauss<STAGES>>::new(options()).ok()?;
    let (vector, control) = (SVector::<f64, NX>::from, SVector::<f64, 3>::from);
    match mode {
        0 => {
            measure(Mode::Value, calls, &start, |x, u| irk.solve(&vector(*x), &control(*u), SECONDS).is_ok())
        }
        1 => measure(Mode::Jacobian, calls, &start, |x, u| {
            irk.forward(&vector(*x), &control(*u), SECONDS).is_ok()
        }),
        _ => measure(Mode::Hessian, calls, &start, |x, u| {
            irk.hessian(&vector(*x), &control(*u), SECONDS, &vector([1.0; NX])).is_ok()
        }),
    }
}
