//! The registers of x86-64: SSE2, which every such machine has, AVX2 with FMA, and AVX-512.
//!
//! One module for each kind of register, all with the same functions.
#![allow(unsafe_code)]

use super::functions::{Call, CallWithEight, CallWithFour};
use super::shared::define;
use core::arch::x86_64::*;

// SAFETY of every `unsafe` of this file and its modules: these intrinsics require only that the
// machine has the instructions. SSE2 is part of x86-64. Registers of AVX2 or AVX-512 are used only
// after detection, as the head of `lanes` states. Loads and stores, which take pointers, get
// references to arrays as large as the access, and require no alignment.

/// Functions of one intrinsic each.
macro_rules! wrap {
    ($($name:ident($($argument:ident: $type:ty),*) -> $result:ty = $intrinsic:ident $(::<$constant:tt>)?;)*) => { $(
        #[inline(always)]
        #[allow(unused_unsafe)] // SSE2 is always enabled, so the block may be unnecessary.
        pub fn $name($($argument: $type),*) -> $result {
            // SAFETY: see the head of the file.
            unsafe { $intrinsic $(::<$constant>)? ($($argument),*) }
        }
    )* };
}

/// Loads and stores of whole registers, and of their first `N` numbers.
macro_rules! memory {
    ($element:ty, $width:literal, $load:ident, $store:ident, $set:ident; $($index:literal)*) => {
        pub const WIDTH: usize = $width;

        /// Unused lanes repeat the last used one.
        #[inline(always)]
        #[allow(unused_unsafe)]
        pub fn load<const N: usize>(cell: &[$element; N]) -> Register {
            // SAFETY: the array is as large as the whole register.
            unsafe {
                if const { N == $width } {
                    $load(cell.as_ptr())
                } else {
                    $set($(cell[const { if $index < N { $index } else { N - 1 } }]),*)
                }
            }
        }
        #[inline(always)]
        pub fn store<const N: usize>(a: Register, cell: &mut [$element; N]) {
            if const { N == $width } {
                // SAFETY: the array is as large as the register.
                return unsafe { $store(cell.as_mut_ptr(), a) };
            }
            let mut all = [0.0; $width];
            // SAFETY: the array is as large as the register.
            unsafe { $store(all.as_mut_ptr(), a) };
            cell.copy_from_slice(&all[..N]);
        }
    };
}

/// Transposes registers through memory.
macro_rules! transpose_in_memory {
    ($element:ty) => {
        #[inline(always)]
        pub fn transpose(rows: [Register; WIDTH]) -> [Register; WIDTH] {
            super::super::transpose_in_memory::<$element, Register, WIDTH>(rows, store, load)
        }
    };
}

/// A function that is compiled for given instructions.
macro_rules! enter {
    ($features:literal) => {
        /// Calls `F` with the instructions of this register enabled; not inlined.
        #[inline(always)]
        pub fn enter<F: Call<A>, A>(argument: A) -> F::Output {
            #[target_feature(enable = $features)]
            #[inline(never)]
            fn inside<F: Call<A>, A>(argument: A) -> F::Output {
                F::call(argument)
            }
            // SAFETY: see the head of the file.
            unsafe { inside::<F, A>(argument) }
        }
    };
}

/// Functions that are compiled for given instructions, with four and eight arguments. Each argument
/// is passed separately: registers loaded across two elements of an array would wait until both are
/// in the cache.
macro_rules! enter_with_many {
    ($features:literal) => {
        enter_with_many!($features, enter_with_four, CallWithFour, 4: a b c d);
        enter_with_many!($features, enter_with_eight, CallWithEight, 8: a b c d e f g h);
    };
    ($features:literal, $enter:ident, $call:ident, $count:literal: $($argument:ident)*) => {
        /// Calls `F` with the instructions of this register enabled; not inlined.
        #[inline(always)]
        pub fn $enter<F: $call<A>, A>([$($argument),*]: [A; $count]) -> F::Output {
            #[target_feature(enable = $features)]
            #[inline(never)]
            #[allow(clippy::too_many_arguments)]
            fn inside<F: $call<A>, A>($($argument: A),*) -> F::Output {
                F::call([$($argument),*])
            }
            // SAFETY: see the head of the file.
            unsafe { inside::<F, A>($($argument),*) }
        }
    };
}

/// The sum and the maximum of all lanes, from registers with half as many.
macro_rules! halves {
    ($element:ty, $half:ident, $low:ident, $high:ident) => {
        #[inline(always)]
        pub fn total(a: Register) -> $element {
            // SAFETY: see the head of the file.
            let (low, high) = unsafe { ($low(a), $high::<1>(a)) };
            $half::total($half::add(low, high))
        }
        #[inline(always)]
        pub fn largest(a: Register) -> $element {
            // SAFETY: see the head of the file.
            let (low, high) = unsafe { ($low(a), $high::<1>(a)) };
            $half::largest($half::max(low, high))
        }
    };
}

/// Two `f64`.
pub mod sse2_f64 {
    use super::*;
    pub type Register = __m128d;
    pub type Mask = __m128d;
    pub const FUSED: bool = false;

    enter!("sse2");
    memory!(f64, 2, _mm_loadu_pd, _mm_storeu_pd, _mm_setr_pd; 0 1);
    transpose_in_memory!(f64);
    wrap! {
        splat(a: f64) -> Register = _mm_set1_pd;
        add(a: Register, b: Register) -> Register = _mm_add_pd;
        sub(a: Register, b: Register) -> Register = _mm_sub_pd;
        mul(a: Register, b: Register) -> Register = _mm_mul_pd;
        div(a: Register, b: Register) -> Register = _mm_div_pd;
        sqrt(a: Register) -> Register = _mm_sqrt_pd;
        max(a: Register, b: Register) -> Register = _mm_max_pd;
        and(a: Register, b: Register) -> Register = _mm_and_pd;
        or(a: Register, b: Register) -> Register = _mm_or_pd;
        xor(a: Register, b: Register) -> Register = _mm_xor_pd;
        lt(a: Register, b: Register) -> Mask = _mm_cmplt_pd;
        le(a: Register, b: Register) -> Mask = _mm_cmple_pd;
        eq(a: Register, b: Register) -> Mask = _mm_cmpeq_pd;
        mask_and(a: Mask, b: Mask) -> Mask = _mm_and_pd;
        mask_or(a: Mask, b: Mask) -> Mask = _mm_or_pd;
    }
    define! {
        total(a: Register) -> f64 { _mm_cvtsd_f64(_mm_add_sd(a, _mm_unpackhi_pd(a, a))) }
        largest(a: Register) -> f64 { _mm_cvtsd_f64(_mm_max_sd(a, _mm_unpackhi_pd(a, a))) }
        /// Rounded twice.
        mul_add(a: Register, b: Register, c: Register) -> Register { _mm_add_pd(_mm_mul_pd(a, b), c) }
        subtract_product(c: Register, a: Register, b: Register) -> Register { _mm_sub_pd(c, _mm_mul_pd(a, b)) }
        mask_not(a: Mask) -> Mask { _mm_xor_pd(a, _mm_castsi128_pd(_mm_set1_epi64x(-1))) }
        select(m: Mask, a: Register, b: Register) -> Register { _mm_or_pd(_mm_and_pd(m, a), _mm_andnot_pd(m, b)) }
        bits(m: Mask) -> u32 { _mm_movemask_pd(m) as u32 }
        add_bits(a: Register, b: Register) -> Register {
            _mm_castsi128_pd(_mm_add_epi64(_mm_castpd_si128(a), _mm_castpd_si128(b)))
        }
        shift_left<BITS>(a: Register) -> Register { _mm_castsi128_pd(_mm_slli_epi64::<BITS>(_mm_castpd_si128(a))) }
        shift_right<BITS>(a: Register) -> Register { _mm_castsi128_pd(_mm_srli_epi64::<BITS>(_mm_castpd_si128(a))) }
    }
}

/// Four `f32`.
pub mod sse_f32 {
    pub use super::sse2_f64 as doubles;
    use super::*;
    pub type Register = __m128;
    pub type Mask = __m128;

    enter!("sse2");
    memory!(f32, 4, _mm_loadu_ps, _mm_storeu_ps, _mm_setr_ps; 0 1 2 3);
    transpose_in_memory!(f32);
    wrap! {
        splat(a: f32) -> Register = _mm_set1_ps;
        add(a: Register, b: Register) -> Register = _mm_add_ps;
        sub(a: Register, b: Register) -> Register = _mm_sub_ps;
        mul(a: Register, b: Register) -> Register = _mm_mul_ps;
        div(a: Register, b: Register) -> Register = _mm_div_ps;
        sqrt(a: Register) -> Register = _mm_sqrt_ps;
        max(a: Register, b: Register) -> Register = _mm_max_ps;
        and(a: Register, b: Register) -> Register = _mm_and_ps;
        or(a: Register, b: Register) -> Register = _mm_or_ps;
        xor(a: Register, b: Register) -> Register = _mm_xor_ps;
        lt(a: Register, b: Register) -> Mask = _mm_cmplt_ps;
        le(a: Register, b: Register) -> Mask = _mm_cmple_ps;
        eq(a: Register, b: Register) -> Mask = _mm_cmpeq_ps;
        mask_and(a: Mask, b: Mask) -> Mask = _mm_and_ps;
        mask_or(a: Mask, b: Mask) -> Mask = _mm_or_ps;
    }
    define! {
        total(a: Register) -> f32 {{
            let pairs = _mm_add_ps(a, _mm_movehl_ps(a, a));
            _mm_cvtss_f32(_mm_add_ss(pairs, _mm_shuffle_ps::<1>(pairs, pairs)))
        }}
        largest(a: Register) -> f32 {{
            let pairs = _mm_max_ps(a, _mm_movehl_ps(a, a));
            _mm_cvtss_f32(_mm_max_ss(pairs, _mm_shuffle_ps::<1>(pairs, pairs)))
        }}
        subtract_product(c: Register, a: Register, b: Register) -> Register { _mm_sub_ps(c, _mm_mul_ps(a, b)) }
        mask_not(a: Mask) -> Mask { _mm_xor_ps(a, _mm_castsi128_ps(_mm_set1_epi32(-1))) }
        select(m: Mask, a: Register, b: Register) -> Register { _mm_or_ps(_mm_and_ps(m, a), _mm_andnot_ps(m, b)) }
        bits(m: Mask) -> u32 { _mm_movemask_ps(m) as u32 }
        widen(a: Register) -> [__m128d; 2] { [_mm_cvtps_pd(a), _mm_cvtps_pd(_mm_movehl_ps(a, a))] }
        narrow(a: [__m128d; 2]) -> Register { _mm_movelh_ps(_mm_cvtpd_ps(a[0]), _mm_cvtpd_ps(a[1])) }
    }
}

/// Four `f64`.
pub mod avx2_f64 {
    use super::*;
    pub type Register = __m256d;
    pub type Mask = __m256d;
    pub const FUSED: bool = true;

    enter!("avx2,fma");
    enter_with_many!("avx2,fma");
    halves!(f64, sse2_f64, _mm256_castpd256_pd128, _mm256_extractf128_pd);
    memory!(f64, 4, _mm256_loadu_pd, _mm256_storeu_pd, _mm256_setr_pd; 0 1 2 3);
    wrap! {
        splat(a: f64) -> Register = _mm256_set1_pd;
        add(a: Register, b: Register) -> Register = _mm256_add_pd;
        sub(a: Register, b: Register) -> Register = _mm256_sub_pd;
        mul(a: Register, b: Register) -> Register = _mm256_mul_pd;
        div(a: Register, b: Register) -> Register = _mm256_div_pd;
        sqrt(a: Register) -> Register = _mm256_sqrt_pd;
        max(a: Register, b: Register) -> Register = _mm256_max_pd;
        and(a: Register, b: Register) -> Register = _mm256_and_pd;
        or(a: Register, b: Register) -> Register = _mm256_or_pd;
        xor(a: Register, b: Register) -> Register = _mm256_xor_pd;
        mul_add(a: Register, b: Register, c: Register) -> Register = _mm256_fmadd_pd;
        lt(a: Register, b: Register) -> Mask = _mm256_cmp_pd::<_CMP_LT_OQ>;
        le(a: Register, b: Register) -> Mask = _mm256_cmp_pd::<_CMP_LE_OQ>;
        eq(a: Register, b: Register) -> Mask = _mm256_cmp_pd::<_CMP_EQ_OQ>;
        mask_and(a: Mask, b: Mask) -> Mask = _mm256_and_pd;
        mask_or(a: Mask, b: Mask) -> Mask = _mm256_or_pd;
    }
    define! {
        transpose(rows: [Register; 4]) -> [Register; 4] {{
            let [a, b, c, d] = rows;
            let (even, odd) = (
                [_mm256_unpacklo_pd(a, b), _mm256_unpacklo_pd(c, d)],
                [_mm256_unpackhi_pd(a, b), _mm256_unpackhi_pd(c, d)],
            );
            [
                _mm256_permute2f128_pd::<0x20>(even[0], even[1]),
                _mm256_permute2f128_pd::<0x20>(odd[0], odd[1]),
                _mm256_permute2f128_pd::<0x31>(even[0], even[1]),
                _mm256_permute2f128_pd::<0x31>(odd[0], odd[1]),
            ]
        }}
        low_halves(a: Register, b: Register) -> Register { _mm256_permute2f128_pd::<0x20>(a, b) }
        high_halves(a: Register, b: Register) -> Register { _mm256_permute2f128_pd::<0x31>(a, b) }
        swap_halves(a: Register) -> Register { _mm256_permute2f128_pd::<1>(a, a) }
        signs_below() -> Register { _mm256_setr_pd(-0.0, -0.0, 0.0, 0.0) }
        subtract_product(c: Register, a: Register, b: Register) -> Register { _mm256_fnmadd_pd(a, b, c) }
        mask_not(a: Mask) -> Mask { _mm256_xor_pd(a, _mm256_castsi256_pd(_mm256_set1_epi64x(-1))) }
        select(m: Mask, a: Register, b: Register) -> Register { _mm256_blendv_pd(b, a, m) }
        bits(m: Mask) -> u32 { _mm256_movemask_pd(m) as u32 }
        add_bits(a: Register, b: Register) -> Register {
            _mm256_castsi256_pd(_mm256_add_epi64(_mm256_castpd_si256(a), _mm256_castpd_si256(b)))
        }
        shift_left<BITS>(a: Register) -> Register {
            _mm256_castsi256_pd(_mm256_slli_epi64::<BITS>(_mm256_castpd_si256(a)))
        }
        shift_right<BITS>(a: Register) -> Register {
            _mm256_castsi256_pd(_mm256_srli_epi64::<BITS>(_mm256_castpd_si256(a)))
        }
    }
}

/// Eight `f32`.
pub mod avx2_f32 {
    pub use super::avx2_f64 as doubles;
    use super::*;
    pub type Register = __m256;
    pub type Mask = __m256;

    enter!("avx2,fma");
    halves!(f32, sse_f32, _mm256_castps256_ps128, _mm256_extractf128_ps);
    memory!(f32, 8, _mm256_loadu_ps, _mm256_storeu_ps, _mm256_setr_ps; 0 1 2 3 4 5 6 7);
    transpose_in_memory!(f32);
    wrap! {
        splat(a: f32) -> Register = _mm256_set1_ps;
        add(a: Register, b: Register) -> Register = _mm256_add_ps;
        sub(a: Register, b: Register) -> Register = _mm256_sub_ps;
        mul(a: Register, b: Register) -> Register = _mm256_mul_ps;
        div(a: Register, b: Register) -> Register = _mm256_div_ps;
        sqrt(a: Register) -> Register = _mm256_sqrt_ps;
        max(a: Register, b: Register) -> Register = _mm256_max_ps;
        and(a: Register, b: Register) -> Register = _mm256_and_ps;
        or(a: Register, b: Register) -> Register = _mm256_or_ps;
        xor(a: Register, b: Register) -> Register = _mm256_xor_ps;
        lt(a: Register, b: Register) -> Mask = _mm256_cmp_ps::<_CMP_LT_OQ>;
        le(a: Register, b: Register) -> Mask = _mm256_cmp_ps::<_CMP_LE_OQ>;
        eq(a: Register, b: Register) -> Mask = _mm256_cmp_ps::<_CMP_EQ_OQ>;
        mask_and(a: Mask, b: Mask) -> Mask = _mm256_and_ps;
        mask_or(a: Mask, b: Mask) -> Mask = _mm256_or_ps;
    }
    define! {
        swap_halves(a: Register) -> Register { _mm256_permute2f128_ps::<1>(a, a) }
        signs_below() -> Register { _mm256_setr_ps(-0.0, -0.0, -0.0, -0.0, 0.0, 0.0, 0.0, 0.0) }
        subtract_product(c: Register, a: Register, b: Register) -> Register { _mm256_fnmadd_ps(a, b, c) }
        mask_not(a: Mask) -> Mask { _mm256_xor_ps(a, _mm256_castsi256_ps(_mm256_set1_epi32(-1))) }
        select(m: Mask, a: Register, b: Register) -> Register { _mm256_blendv_ps(b, a, m) }
        bits(m: Mask) -> u32 { _mm256_movemask_ps(m) as u32 }
        widen(a: Register) -> [__m256d; 2] {
            [_mm256_cvtps_pd(_mm256_castps256_ps128(a)), _mm256_cvtps_pd(_mm256_extractf128_ps::<1>(a))]
        }
        narrow(a: [__m256d; 2]) -> Register {
            _mm256_set_m128(_mm256_cvtpd_ps(a[1]), _mm256_cvtpd_ps(a[0]))
        }
    }
}

/// Masked loads and stores; masks have one bit for each lane.
macro_rules! masked {
    ($element:ty, $width:literal, $mask:ident, $load:ident, $store:ident, $blend:ident) => {
        pub const WIDTH: usize = $width;

        /// The mask of the first `N` lanes, at most all of them.
        const fn first<const N: usize>() -> $mask {
            if N < $width { !($mask::MAX << N) } else { $mask::MAX }
        }

        /// Unused lanes repeat the first one.
        #[inline(always)]
        pub fn load<const N: usize>(cell: &[$element; N]) -> Register {
            // SAFETY: only the lanes of the array are read, whatever its length.
            unsafe { $load(splat(cell[0]), const { first::<N>() }, cell.as_ptr()) }
        }
        #[inline(always)]
        pub fn store<const N: usize>(a: Register, cell: &mut [$element; N]) {
            // SAFETY: only the lanes of the array are written, whatever its length.
            unsafe { $store(cell.as_mut_ptr(), const { first::<N>() }, a) }
        }
        define! {
            mask_and(a: Mask, b: Mask) -> Mask { a & b }
            mask_or(a: Mask, b: Mask) -> Mask { a | b }
            mask_not(a: Mask) -> Mask { !a }
            select(m: Mask, a: Register, b: Register) -> Register { $blend(m, b, a) }
            bits(m: Mask) -> u32 { u32::from(m) }
        }
    };
}

pub mod avx512_f64;

pub mod avx512_f32;
