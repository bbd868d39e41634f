//! The chain of masses.

#[path = "../../../models/chain.rs"]
#[allow(dead_code)]
mod chain;
#[path = "../../../models/chain_problem.rs"]
#[allow(unused_macros, unused_imports)]
mod chain_problem;

use crate::overhead::{Mode, measure};
use crate::{Report, numbers, write};
use casados::casadi::Program;
use casados::ocp::{Formulation, HeapIpm, HeapOcp, HeapSqp, Horizon, LeastSquaresCost, Problem};
use casados::ocp::{SecondOrder, Shooting};
use casados::prelude::*;
use chain::Chain;
use chain_problem::{Control, State};
use nalgebra::SVector;
use std::error::Error;
use std::time::Instant;

const MASSES: usize = {
    let choices = [
        (3, cfg!(feature = "masses-3")),
        (4, cfg!(feature = "masses-4")),
        (6, cfg!(feature = "masses-6")),
        (7, cfg!(feature = "masses-7")),
    ];
    let (mut masses, mut i) = (5, 0);
    while i < choices.len() {
        if choices[i].1 {
            masses = choices[i].0;
        }
        i += 1;
    }
    masses
};
const NX: usize = 6 * (MASSES - 2) + 3;
const ORDER_8: bool = cfg!(feature = "order-8");
const STAGES: usize = if ORDER_8 { 4 } else { 2 };
const INTERVALS: usize = 40;
const SECONDS: f64 = 0.2;

fn options() -> Options {
    Options { steps: if ORDER_8 { 4 } else { 1 }, ..Default::default() }
}

casados::casadi::export! { chain = Irk<Chain<NX>, Gauss<STAGES>>, interval = SECONDS, options = options() }
casados::casadi::export! {
    chain_rk4 = Erk<Chain<NX>, Rk4>, interval = SECONDS, options = Options { steps: 4, ..Default::default() }
}
casados::casadi::export_horizon! {
    chains = Batch<Chain<NX>, Gauss<STAGES>>, interval = SECONDS, intervals = INTERVALS, options = options()
}
casados::casadi::export_problem! { program }
#[cfg(not(feature = "order-8"))]
casados::casadi::export_problem! { explicit = explicit }

fn program() -> Result<impl Program + 'static, Box<dyn Error>> {
    formulate()
}

fn formulate()
-> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>> + Send + use<>>, Box<dyn Error>> {
    back_to_rest(Shooting::new(Batch::<Chain<NX>, Gauss<STAGES>>::new(options())?))
}

#[cfg(not(feature = "order-8"))]
fn explicit() -> Result<impl Program + 'static, Box<dyn Error>> {
    let options = Options { steps: 4, ..Default::default() };
    back_to_rest(Shooting::new(Batch::<Chain<NX>, Rk4>::new(options)?))
}

/// Back to rest from a disturbance; the environment has both states.
fn back_to_rest<D>(
    dynamics: D,
) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>> + Send + use<D>>, Box<dyn Error>>
where
    D: SecondOrder<f64, Shape = <Chain<NX> as Dae>::Shape> + Send,
{
    let numbers = numbers()?;
    let (rest, start) = numbers.split_at_checked(NX).ok_or("two states are to be given")?;
    let weights = chain_problem::weights::<NX>();
    let mut ocp = Problem::new(dynamics)
        .running_cost((
            LeastSquaresCost::<State<NX>>::diagonal(&weights),
            LeastSquaresCost::<Control<NX>>::diagonal(&[0.02; 3]),
        ))
        .terminal_cost(LeastSquaresCost::<State<NX>>::diagonal(&weights))
        .on(Horizon::uniform(INTERVALS, SECONDS))?;
    ocp.set_reference(.., &[rest, &[0.0; 3]].concat())?.set_terminal_reference(rest)?;
    ocp.fix_initial_state(start)?.bound("u", .., -1.0, 1.0)?;
    for mass in 0..MASSES - 1 {
        ocp.bound(&format!("x[{}]", 3 * mass + 1), 1..INTERVALS, -0.05, f64::INFINITY)?;
    }
    ocp.guess(rest, &[0.0; 3])?;
    Ok(ocp)
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
    let start = chain::stretched::<NX>().into();
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
