//! Anything at all into every public entry of every integrator: an answer that is finite or an
//! error, never a panic, never an endless loop. What comes is drawn from a seed, so that a failure
//! repeats. Each call is repeated by an integrator that never saw another one, which says the same,
//! to the bit: neither answers nor errors leave a trace.
//!
//! `CASADOS_RANDOM=100` makes a hundred times as many integrators.

#[path = "../stress/everything.rs"]
mod everything;
#[path = "../runs/mod.rs"]
mod runs;

mod adaptive;
mod batches;
mod control;
mod events;
mod exported;
mod feasible;
mod files;
mod fixed_step;
mod horizons;
mod source;
mod tables;

use casados::Error;
use casados::{Real, dae, ode};
use nalgebra::SVector;
use runs::{Counts, case_multiplier, prints_verdicts, seeds};

/// Poles, roots and powers of anything.
#[ode]
fn fragile(x: [f64; 2], u: f64, p: [f64; 2], t: f64) -> [f64; 2] {
    [x[1] / x[0] + u, (p[0] * x[0]).exp() - x[1].sqrt() + (p[1] * t).tan()]
}

/// Linear, and singular where an element of `p` is zero.
#[dae]
fn linear(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
    [p[1] * xdot[0] - x[1] + z, xdot[1] + x[0] - u, p[0] * z - x[0]]
}

/// What came of a call: all numbers of an answer.
type Answer = Result<Vec<f64>, Error>;

/// All numbers of these fields.
macro_rules! numbers {
    ($result:expr; $($field:ident)*) => {{
        let mut all: Vec<f64> = Vec::new();
        $(all.extend($result.$field.iter().map(|value| casados::Real::to_f64(*value)));)*
        all
    }};
}
macro_rules! nominal {
    ($result:expr) => {
        crate::numbers!($result; x z z0)
    };
}
macro_rules! forward {
    ($result:expr) => {
        crate::numbers!($result; x z z0 dx_dx0 dx_du dx_dp dz_dx0 dz_du dz_dp dz0_dx0 dz0_du dz0_dp)
    };
}
macro_rules! gradient {
    ($result:expr) => {
        crate::numbers!($result; x z z0 grad_x0 grad_u grad_p)
    };
}
macro_rules! hessian {
    ($result:expr) => {{
        let mut all = crate::forward!($result);
        all.extend(crate::numbers!($result; grad_x0 grad_u grad_p h_xx h_xu h_uu h_xp h_up h_pp));
        all
    }};
}
use {forward, gradient, hessian, nominal, numbers};

/// What stays until it is set again.
struct Given<T, const NZ: usize> {
    p: Option<SVector<T, 2>>,
    t: Option<T>,
    start: Option<(SVector<T, 2>, SVector<T, NZ>)>,
}

impl<T, const NZ: usize> Default for Given<T, NZ> {
    fn default() -> Self {
        Self { p: None, t: None, start: None }
    }
}

/// An answer is finite, and, where somebody else was asked, the same.
fn judge(counts: &mut Counts, seed: u64, found: &Answer, again: Option<Answer>) {
    if let Ok(numbers) = found {
        assert!(numbers.iter().all(|number| number.is_finite()), "seed {seed}: {numbers:?}");
    }
    if let Some(again) = again {
        // Shortest digits that give the number back: as good as bits.
        assert_eq!(format!("{found:?}"), format!("{again:?}"), "seed {seed}");
    }
    counts.count_result(found);
    if prints_verdicts() && found.is_err() {
        println!("{counts} {seed}: {found:?}");
    }
}

/// How many integrators of each kind are made, and how many calls of each.
const INTEGRATORS: u64 = 120;
const CALLS: usize = 8;

/// Draws are the same in every run: of what they ask for, so much has an answer (somewhat less than
/// what is counted, since rounding differs between machines). Less means that something has begun
/// to fail.
fn enough(counts: &Counts, answers: u64) {
    println!("{counts}");
    let one = seeds(1).start > 0;
    assert!(one || counts.count_of("Ok") >= answers * case_multiplier(), "{counts}");
}
