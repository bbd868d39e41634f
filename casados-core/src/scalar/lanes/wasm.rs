//! The registers of WebAssembly.
#![allow(unsafe_code)]

use super::functions::Call;
use core::arch::wasm32::*;

/// Functions of an expression of intrinsics each, which are safe: a module with instructions that a
/// machine does not have is refused as a whole.
macro_rules! define {
    ($($(#[$attribute:meta])* $name:ident $(<$bits:ident>)? ($($argument:ident: $type:ty),*) -> $result:ty { $body:expr })*) => { $(
        $(#[$attribute])*
        #[inline(always)]
        pub fn $name $(<const $bits: i32>)? ($($argument: $type),*) -> $result {
            $body
        }
    )* };
}

macro_rules! shared {
    ($element:ty, $width:literal) => {
        pub const WIDTH: usize = $width;
        pub type Register = v128;
        pub type Mask = v128;

        /// Lanes that are not used are copies of the last one that is.
        #[inline(always)]
        pub fn load<const N: usize>(cell: &[$element; N]) -> Register {
            let all: [$element; $width] =
                core::array::from_fn(|lane| cell[if lane < N { lane } else { N - 1 }]);
            // SAFETY: the array is as large as the register, and no alignment is asked for.
            unsafe { v128_load(all.as_ptr().cast()) }
        }
        #[inline(always)]
        pub fn store<const N: usize>(a: Register, cell: &mut [$element; N]) {
            let mut all = [0.0; $width];
            // SAFETY: the array is as large as the register, and no alignment is asked for.
            unsafe { v128_store(all.as_mut_ptr().cast(), a) };
            cell.copy_from_slice(&all[..N]);
        }
        /// The numbers of each lane beside each other.
        #[inline(always)]
        pub fn transpose(rows: [Register; WIDTH]) -> [Register; WIDTH] {
            super::super::transpose_in_memory::<$element, Register, WIDTH>(rows, store, load)
        }
        /// Calls `F`; not inlined.
        #[inline(never)]
        pub fn enter<F: Call<A>, A>(argument: A) -> F::Output {
            F::call(argument)
        }
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

    shared!(f64, 2);
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

    shared!(f32, 4);
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
