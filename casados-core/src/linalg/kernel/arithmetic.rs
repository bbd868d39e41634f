//! The multiply-subtract operation of kernels: rounded twice, or fused on machines with the
//! instruction.

#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
use crate::scalar::Known;
use crate::scalar::{Field, transposed};

/// An s×s matrix in column-major order.
pub type Block<E, const S: usize> = [[E; S]; S];

/// Implementation of `t − a b`.
pub trait Arithmetic {
    /// Whether it is rounded once.
    const FUSED: bool = false;
    /// Whether short loops over tables are unrolled. Operations on blocks of SIMD registers take so
    /// long that address computations do not matter.
    const UNROLLED: bool = false;
    /// Whether adjacent numbers fill AVX-512 registers.
    const WIDE: bool = false;
    /// `t − a b`
    fn subtract<E: Field>(t: E, a: E, b: E) -> E;
    /// `t + a b`
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn add<E: Field>(t: E, a: E, b: E) -> E {
        if Self::FUSED { Self::subtract(t, -a, b) } else { t + a * b }
    }
    /// `target − left · right`
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract_blocks<E: Field, const S: usize>(
        target: &mut Block<E, S>,
        left: &Block<E, S>,
        right: &Block<E, S>,
    ) {
        for (target, right) in target.iter_mut().zip(right) {
            Self::subtract_columns(target, left, right);
        }
    }
    /// `target − block · x`
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract_columns<E: Field, const S: usize>(target: &mut [E; S], block: &Block<E, S>, x: &[E; S]) {
        for (column, &x) in block.iter().zip(x) {
            for (target, &element) in target.iter_mut().zip(column) {
                *target = Self::subtract(*target, element, x);
            }
        }
    }
    /// `target − factor · row`
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract_row<E: Field, const W: usize>(target: &mut [E; W], factor: E, row: &[E; W]) {
        for (target, &element) in target.iter_mut().zip(row) {
            *target = Self::subtract(*target, factor, element);
        }
    }
    /// `target = block`, with stores as wide as the following loads: a wider load would wait until
    /// all of its stores have reached the L1 cache.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn write<E: Field, const S: usize>(target: &mut Block<E, S>, block: &Block<E, S>) {
        *target = *block;
    }
    /// The transposed matrix.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn transposed<E: Field, const N: usize>(rows: &[[E; N]; N]) -> [[E; N]; N] {
        transposed(rows)
    }
    /// `target − a b`, element by element.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract_products<E: Field, const W: usize>(target: &mut [E; W], a: &[E; W], b: &[E; W]) {
        for ((target, &a), &b) in target.iter_mut().zip(a).zip(b) {
            *target = Self::subtract(*target, a, b);
        }
    }
}

/// `t − a b` rounded twice.
pub struct Unfused;

impl Arithmetic for Unfused {
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract<E: Field>(t: E, a: E, b: E) -> E {
        t - a * b
    }
}

/// `t − a b` rounded once, in one instruction. Only [`dispatch`](super::dispatch::dispatch) runs
/// kernels with it, on machines with the instructions; they are therefore [`Known`]. `WIDE`: with
/// AVX-512 registers, otherwise half as wide. `UNROLLED`: with unrolled loops.
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
pub struct Fused<const WIDE: bool, const UNROLLED: bool>;

#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
impl<const WIDE: bool, const UNROLLED: bool> Arithmetic for Fused<WIDE, UNROLLED> {
    const FUSED: bool = true;
    const UNROLLED: bool = UNROLLED;
    const WIDE: bool = WIDE;
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract<E: Field>(t: E, a: E, b: E) -> E {
        t.subtract_product(a, b)
    }
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract_blocks<E: Field, const S: usize>(
        target: &mut Block<E, S>,
        left: &Block<E, S>,
        right: &Block<E, S>,
    ) {
        E::subtract_blocks(target, left, right, Known::<WIDE>::assume_detected());
    }
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract_columns<E: Field, const S: usize>(target: &mut [E; S], block: &Block<E, S>, x: &[E; S]) {
        E::subtract_columns(target, block, x, Known::<WIDE>::assume_detected());
    }
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract_row<E: Field, const W: usize>(target: &mut [E; W], factor: E, row: &[E; W]) {
        E::subtract_row(target, factor, row, Known::<WIDE>::assume_detected());
    }
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn write<E: Field, const S: usize>(target: &mut Block<E, S>, block: &Block<E, S>) {
        E::write_block(target, block, Known::<WIDE>::assume_detected());
    }
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn transposed<E: Field, const N: usize>(rows: &[[E; N]; N]) -> [[E; N]; N] {
        E::transposed(rows, Known::<WIDE>::assume_detected())
    }
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract_products<E: Field, const W: usize>(target: &mut [E; W], a: &[E; W], b: &[E; W]) {
        E::subtract_products(target, a, b, Known::<WIDE>::assume_detected());
    }
}
