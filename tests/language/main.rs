//! The language of models: each model below uses a part of it. The residual that the attribute
//! emits must have the bits of the plain function, which the compiler understood by itself.
//!
//! Bits, not numbers: the emitted code does the same operations in the same order. The places where
//! it does not (`mul_add`) are compared with a tolerance, said there.

#![allow(
    clippy::manual_clamp,
    clippy::manual_repeat_n,
    clippy::needless_late_init,
    clippy::needless_range_loop,
    clippy::neg_cmp_op_on_partial_ord,
    clippy::redundant_guards,
    reason = "models may be written in these ways, and are understood"
)]

#[path = "../../examples/models"]
#[allow(dead_code)] // Each program takes a part.
mod models {
    pub mod awe;
    pub mod chain;
    pub mod pendulum;
}

mod description;
mod dual;
mod elementary;
mod emit;
mod forms;
mod function;
mod globs;
mod iterators;
mod macros;
mod modules;
#[path = "nalgebra.rs"]
mod nalgebra_values;
mod paths;
mod statements;
mod tables;
mod traits;

use casados::{__private::Array, Shape};
use casados::{__private::ArrayV, Dae};

/// The residual that was emitted for a model.
pub fn emitted_residual<M: Dae>(v: &[f64]) -> Vec<f64> {
    assert_eq!(v.len(), M::Shape::NV, "number of variables of {}", M::STRUCTURE.name);
    let v = <ArrayV<M, f64>>::from_fn(|i| v[i]);
    let mut f = Array::from_fn(|_| f64::NAN);
    M::residual::<f64>(&v, &mut f);
    f.as_ref().to_vec()
}

/// Numbers between −2 and 2 that no two variables share, a different row for each `seed`.
pub fn test_point(length: usize, seed: u64) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(0x1234_5678_9abc_def1);
    (0..length)
        .map(|_| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1u64 << 53) as f64 * 4.0 - 2.0
        })
        .collect()
}

/// Compares the emitted residual of a model with the plain function at several points, bit by bit.
pub fn same_bits<M: Dae>(plain: impl Fn(&[f64]) -> Vec<f64>) {
    for seed in 1..=20 {
        let v = test_point(M::Shape::NV, seed);
        let (expected, found) = (plain(&v), emitted_residual::<M>(&v));
        assert_eq!(expected.len(), M::Shape::NK);
        for (row, (e, f)) in expected.iter().zip(&found).enumerate() {
            // The sign of a zero apart: structural zeros have none.
            let same = e.to_bits() == f.to_bits() || (*e == 0.0 && *f == 0.0) || (e.is_nan() && f.is_nan());
            assert!(same, "{} row {row}: plain {e:e}, emitted {f:e} at {v:?}", M::STRUCTURE.name);
        }
    }
}

/// `v[start..start + N]`
pub fn subarray<const N: usize>(v: &[f64], start: usize) -> [f64; N] {
    v[start..start + N].try_into().unwrap()
}
