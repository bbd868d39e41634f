//! The pendulum, as the page calls it.

use crate::controller::{DEFAULT, INTERVALS, Loop, Settings};
use crate::shared::{One, outcome};

/// Weights of position, angle, velocity, rate and force; bounds of force (N) and position (m).
static SETTINGS: One<Settings> = One::new(DEFAULT);
/// State; force; milliseconds of both phases of all samples; numbers of samples, of
/// samples without a solution, of iterations of the last QP; the angle that is upright; seconds.
static STATE: One<[f64; 12]> = One::new([0.0; 12]);
/// State and force at each node.
static PLAN: One<[f64; 5 * (INTERVALS + 1)]> = One::new([0.0; 5 * (INTERVALS + 1)]);
static LOOP: One<Option<Loop>> = One::new(None);

#[unsafe(no_mangle)]
pub extern "C" fn pendulum_settings() -> *mut f64 {
    SETTINGS.place()
}

#[unsafe(no_mangle)]
pub extern "C" fn pendulum_state() -> *mut f64 {
    STATE.place()
}

#[unsafe(no_mangle)]
pub extern "C" fn pendulum_plan() -> *mut f64 {
    PLAN.place()
}

/// Nodes of the plan.
#[unsafe(no_mangle)]
pub extern "C" fn pendulum_nodes() -> usize {
    INTERVALS + 1
}

/// It hangs, and the controller knows nothing.
#[unsafe(no_mangle)]
pub extern "C" fn pendulum_reset() -> u32 {
    outcome(Loop::new().and_then(|mut new| {
        new.apply(&SETTINGS.get())?;
        show(&new);
        *LOOP.get() = Some(new);
        Ok(())
    }))
}

/// The controller takes the settings over.
#[unsafe(no_mangle)]
pub extern "C" fn pendulum_apply() -> u32 {
    outcome(LOOP.get().as_mut().map_or(Ok(()), |the| the.apply(&SETTINGS.get())))
}

/// Time goes on by some seconds, while cart and ball are pushed by these forces.
#[unsafe(no_mangle)]
pub extern "C" fn pendulum_advance(seconds: f64, cart: f64, right: f64, up: f64) -> u32 {
    outcome(
        LOOP.get().as_mut().map_or(Ok(()), |the| the.advance(seconds, [cart, right, up]).map(|()| show(the))),
    )
}

fn show(the: &Loop) {
    let mut state = STATE.get();
    state[..4].copy_from_slice(&the.x);
    state[4] = the.force;
    let of = &the.statistics;
    state[5..7].copy_from_slice(&of.phases);
    state[7..].copy_from_slice(&[of.samples, of.lost, of.iterations, the.upright(), of.seconds]);
    PLAN.get().copy_from_slice(the.plan().as_flattened());
}
