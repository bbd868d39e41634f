//! The problems, by what they are about. Horizons are divided into uniform intervals with constant
//! controls, integrated by the classical Runge-Kutta method of order four if nothing else is said.

mod curves;
mod estimation;
mod flight;
mod processes;
mod robots;
mod textbook;

use crate::{Entry, Failure};
use casados::ocp::{Formulation, HeapOcp, Horizon};
use casados::{Erk, Error, Ode, Options, Rk4};
use std::sync::atomic::{AtomicUsize, Ordering};

/// No bound.
pub const FREE: f64 = f64::INFINITY;

/// A problem on its grid.
macro_rules! made {
    () => {
        Result<
            casados::ocp::HeapOcp<
                impl casados::ocp::Formulation<f64, Dynamics: casados::ocp::SecondOrder<f64>>,
            >,
            crate::Failure,
        >
    };
}
pub(crate) use made;

static REFINEMENT: AtomicUsize = AtomicUsize::new(1);

/// From now on problems have so many times as many intervals.
pub fn refine(by: usize) {
    REFINEMENT.store(by, Ordering::Relaxed);
}

/// So many intervals, refined.
pub fn intervals(given: usize) -> usize {
    given * REFINEMENT.load(Ordering::Relaxed)
}

/// The classical Runge-Kutta method with some steps in each interval.
fn rk4<M: Ode>(steps: usize) -> Result<Erk<M, Rk4>, Error> {
    Erk::<M, Rk4>::new(Options { steps, ..Options::default() })
}

/// Uniform intervals over a horizon.
fn over(n: usize, length: f64) -> Horizon<'static, f64> {
    Horizon::uniform(n, length / n as f64)
}

/// The straight line between two states, and a constant control, as the guess.
fn line<P: Formulation<f64>>(
    ocp: &mut HeapOcp<P>,
    from: &[f64],
    to: &[f64],
    u: &[f64],
) -> Result<(), Failure> {
    let n = ocp.intervals();
    for k in 0..=n {
        let part = k as f64 / n as f64;
        let x: Vec<f64> = from.iter().zip(to).map(|(a, b)| a + part * (b - a)).collect();
        ocp.guess_stage(k, &x, if k < n { u } else { &[] })?;
    }
    Ok(())
}

/// Gives the first states values at a stage: not more than are in the list, and not those that are
/// not finite.
fn fix<P: Formulation<f64>>(ocp: &mut HeapOcp<P>, stage: usize, values: &[f64]) -> Result<(), Failure> {
    for (i, &value) in values.iter().enumerate().filter(|(_, value)| value.is_finite()) {
        ocp.bound(&format!("x[{i}]"), stage..=stage, value, value)?;
    }
    Ok(())
}

/// All problems.
#[must_use]
pub fn all() -> Vec<Entry> {
    [curves::all(), textbook::all(), flight::all(), robots::all(), processes::all(), estimation::all()]
        .into_iter()
        .flatten()
        .collect()
}
