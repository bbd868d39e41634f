//! What shows only after a million steps. Unoptimised they take minutes: `cargo test --release --test long_runs`.

use casados::{Gauss, Irk, Options};
use orbit::{Kepler, STEP, changes};

#[path = "stress/orbit.rs"]
mod orbit;

/// The changes of angular momentum and energy over 12 500 orbits are rounding errors. Plain sums round `x` in each step: a
/// random walk of a million steps of ε/2 is 1e-13 long. Compensated ones leave what is rounded at the stages: an
/// orbit that comes back to the same points collects the same errors.
#[test]
#[cfg_attr(debug_assertions, ignore = "takes minutes without optimisation")]
fn t07_t08_t09_a_million_steps_around_the_sun() {
    let run = |compensated| {
        let options = Options { steps: 1000, compensated, ..Default::default() };
        let mut irk = Irk::<Kepler, Gauss<9>>::new(options).expect("valid");
        changes(&mut irk, 1000, 1000.0 * STEP)
    };
    let (plain, compensated) = (run(false), run(true));
    println!("angular momentum and energy: {plain:?}, compensated {compensated:?}");
    assert!(plain[0] <= 3e-13 && plain[1] <= 5e-13, "{plain:?}");
    assert!(compensated[0] <= 5e-14 && compensated[1] <= 2e-13, "{compensated:?}");
    assert!(2.0 * compensated[0] <= plain[0] && compensated[1] <= plain[1], "{plain:?} {compensated:?}");
}
