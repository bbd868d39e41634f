//! A control loop and measurements, the same on a microcontroller and on the desk.
#![no_std]

#[cfg_attr(target_os = "none", path = "board/cortex_m.rs")]
#[cfg_attr(not(target_os = "none"), path = "board/desk.rs")]
pub mod board;
pub mod catalyst;
pub mod closed_loop;
pub mod lost;
pub mod measure;
pub mod memory;
pub mod modes;
pub mod mpc;
pub mod report;

// The models that run on the desk, as they stand.
#[path = "../../models/pendulum.rs"]
pub mod pendulum;
#[path = "../../models/quadrotor.rs"]
pub mod quadrotor;

use casados::prelude::*;

/// Every step takes the same time: so many Newton iterations, and nothing depends on whether they
/// were enough.
pub fn options(iterations: usize) -> Options {
    Options {
        newton: Newton { fixed_iterations: Some(iterations), ..Default::default() },
        ..Default::default()
    }
}

/// Pseudo-random numbers (Knuth's linear congruences): the same on every machine.
pub struct Random(pub u64);

impl Random {
    /// Between −1 and 1, with 24 digits: the same in `f32` and `f64`.
    pub fn number<T: casados::Real>(&mut self) -> T {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        T::from_f64((self.0 >> 40) as f64 / 8_388_608.0 - 1.0)
    }
}
