//! A program that could panic: `run.py` sees to it that it does not link, for the proof is worth
//! nothing otherwise.
#![cfg_attr(target_os = "none", no_std, no_main)]

use firmware::board;

#[cfg_attr(target_os = "none", cortex_m_rt::entry)]
fn main() -> ! {
    let index: usize = core::hint::black_box(0);
    board::exit([true][index])
}
