//! Elementary functions of `f64` for firmware: those of registers, with one number in each.
//!
//! No branch depends on the number for angles below 1.6 · 10⁶, so that a controller executes the
//! same number of instructions at every angle; larger ones use `libm`, whose reductions vary in
//! length. Bounds of errors are those of `lanes/functions/mod.rs`.

use super::lanes::functions::{self, Call};

macro_rules! functions {
    ($($name:ident -> $result:ty),*) => { $(
        #[inline(never)]
        pub fn $name(a: f64) -> $result {
            functions::$name::call(a)
        }
    )* };
}
functions!(sin -> f64, cos -> f64, sin_cos -> (f64, f64), tan -> f64, exp -> f64);
