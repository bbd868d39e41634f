//! The control loop in `f32`.
#![cfg_attr(target_os = "none", no_std, no_main)]

use firmware::closed_loop::{self, Predictor};
use firmware::{board, memory::Static};

static PREDICTOR: Static<Predictor<f32>> = Static::new();

#[cfg_attr(target_os = "none", cortex_m_rt::entry)]
fn main() -> ! {
    board::exit(closed_loop::run("state", &PREDICTOR).is_ok())
}
