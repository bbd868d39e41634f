//! The registers of WebAssembly.
#![allow(unsafe_code)]

use super::functions::Call;
use super::shared::through_memory;
use core::arch::wasm32::*;

/// Functions of an expression of intrinsics each. They are safe: a machine without the instructions
/// rejects the whole module.
macro_rules! define {
    ($($(#[$attribute:meta])* $name:ident $(<$bits:ident>)? ($($argument:ident: $type:ty),*) -> $result:ty { $body:expr })*) => { $(
        $(#[$attribute])*
        #[inline(always)]
        pub fn $name $(<const $bits: i32>)? ($($argument: $type),*) -> $result {
            $body
        }
    )* };
}

/// Functions that are the same for both number types.
macro_rules! numbers {
    ($element:ty, $width:literal) => {
        pub type Register = v128;
        pub type Mask = v128;

        through_memory!($element, $width, |from| v128_load(from.cast()), |to, a| v128_store(to.cast(), a));
        define! {
            and(a: Register, b: Register) -> Register { v128_and(a, b) }
            or(a: Register, b: Register) -> Register { v128_or(a, b) }
            xor(a: Register, b: Register) -> Register { v128_xor(a, b) }
            mask_and(a: Mask, b: Mask) -> Mask { v128_and(a, b) }
            mask_or(a: Mask, b: Mask) -> Mask { v128_or(a, b) }
            mask_not(a: Mask) -> Mask { v128_not(a) }
            select(m: Mask, a: Register, b: Register) -> Register { v128_bitselect(a, b, m) }
        }
    };
}

/// Two `f64`.
pub mod wasm_f64 {
    use super::*;
    pub const FUSED: bool = false;

    numbers!(f64, 2);
    define! {
        total(a: Register) -> f64 { f64x2_extract_lane::<0>(a) + f64x2_extract_lane::<1>(a) }
        largest(a: Register) -> f64 { f64x2_extract_lane::<0>(max(a, i64x2_shuffle::<1, 0>(a, a))) }
        splat(a: f64) -> Register { f64x2_splat(a) }
        add(a: Register, b: Register) -> Register { f64x2_add(a, b) }
        sub(a: Register, b: Register) -> Register { f64x2_sub(a, b) }
        mul(a: Register, b: Register) -> Register { f64x2_mul(a, b) }
        div(a: Register, b: Register) -> Register { f64x2_div(a, b) }
        sqrt(a: Register) -> Register { f64x2_sqrt(a) }
        max(a: Register, b: Register) -> Register { f64x2_pmax(b, a) }
        /// Rounded twice.
        mul_add(a: Register, b: Register, c: Register) -> Register { f64x2_add(f64x2_mul(a, b), c) }
        subtract_product(c: Register, a: Register, b: Register) -> Register { f64x2_sub(c, f64x2_mul(a, b)) }
        lt(a: Register, b: Register) -> Mask { f64x2_lt(a, b) }
        le(a: Register, b: Register) -> Mask { f64x2_le(a, b) }
        eq(a: Register, b: Register) -> Mask { f64x2_eq(a, b) }
        bits(m: Mask) -> u32 { u32::from(i64x2_bitmask(m)) }
        add_bits(a: Register, b: Register) -> Register { i64x2_add(a, b) }
        shift_left<BITS>(a: Register) -> Register { i64x2_shl(a, BITS as u32) }
        shift_right<BITS>(a: Register) -> Register { u64x2_shr(a, BITS as u32) }
    }
}

/// Four `f32`.
pub mod wasm_f32 {
    pub use super::wasm_f64 as doubles;
    use super::*;

    numbers!(f32, 4);
    define! {
        turned(a: Register) -> Register { i32x4_shuffle::<2, 3, 0, 1>(a, a) }
        swapped(a: Register) -> Register { i32x4_shuffle::<1, 0, 3, 2>(a, a) }
        pairs(a: Register) -> Register { f32x4_add(a, turned(a)) }
        larger(a: Register) -> Register { max(a, turned(a)) }
        total(a: Register) -> f32 { f32x4_extract_lane::<0>(f32x4_add(pairs(a), swapped(pairs(a)))) }
        largest(a: Register) -> f32 { f32x4_extract_lane::<0>(max(larger(a), swapped(larger(a)))) }
        splat(a: f32) -> Register { f32x4_splat(a) }
        add(a: Register, b: Register) -> Register { f32x4_add(a, b) }
        sub(a: Register, b: Register) -> Register { f32x4_sub(a, b) }
        mul(a: Register, b: Register) -> Register { f32x4_mul(a, b) }
        div(a: Register, b: Register) -> Register { f32x4_div(a, b) }
        sqrt(a: Register) -> Register { f32x4_sqrt(a) }
        max(a: Register, b: Register) -> Register { f32x4_pmax(b, a) }
        subtract_product(c: Register, a: Register, b: Register) -> Register { f32x4_sub(c, f32x4_mul(a, b)) }
        lt(a: Register, b: Register) -> Mask { f32x4_lt(a, b) }
        le(a: Register, b: Register) -> Mask { f32x4_le(a, b) }
        eq(a: Register, b: Register) -> Mask { f32x4_eq(a, b) }
        bits(m: Mask) -> u32 { u32::from(i32x4_bitmask(m)) }
        widen(a: Register) -> [v128; 2] {
            [f64x2_promote_low_f32x4(a), f64x2_promote_low_f32x4(turned(a))]
        }
        narrow(a: [v128; 2]) -> Register {
            i32x4_shuffle::<0, 1, 4, 5>(f32x4_demote_f64x2_zero(a[0]), f32x4_demote_f64x2_zero(a[1]))
        }
    }
}
